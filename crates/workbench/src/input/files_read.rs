//! Which files were read, and the sums of the bytes that were read of them: a file may be another one by the time a result is
//! written.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

/// Length and SHA-256 of a file as it was read.
pub(crate) type Sum = (u64, [u8; 32]);

/// Files by their whole paths, each as it was when it was read first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct FilesRead(BTreeMap<PathBuf, Sum>);

thread_local! {
    /// One for each [`noted`] that this thread is in.
    static NOTED: RefCell<Vec<FilesRead>> = const { RefCell::new(Vec::new()) };
}

impl FilesRead {
    /// The sum of a file; none where it was not read.
    pub(crate) fn of(&self, path: &Path) -> Option<Sum> {
        self.0.get(&whole(path)).copied()
    }
}

fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Does something, and gives the files that this thread has read in doing it.
pub(crate) fn noted<T>(job: impl FnOnce() -> T) -> (T, FilesRead) {
    /// Ends the notes also where the job panics.
    struct Begun;
    impl Drop for Begun {
        fn drop(&mut self) {
            NOTED.with_borrow_mut(Vec::pop);
        }
    }
    NOTED.with_borrow_mut(|all| all.push(FilesRead::default()));
    let begun = Begun;
    let done = job();
    let read = NOTED.with_borrow(|all| all.last().cloned()).unwrap_or_default();
    drop(begun);
    (done, read)
}

/// Notes a file that was read, with its bytes.
pub(super) fn note(path: &Path, bytes: &[u8]) {
    NOTED.with_borrow_mut(|all| {
        if all.is_empty() {
            return;
        }
        let sum = (bytes.len() as u64, Sha256::digest(bytes).into());
        for files in all {
            files.0.entry(whole(path)).or_insert(sum);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_noted_as_it_was_when_it_was_read_first() {
        let file = Path::new("a.csv");
        note(file, b"before");
        let ((_, inner), outer) = noted(|| {
            let inner = noted(|| note(file, b"abc"));
            note(file, b"other");
            inner
        });
        let abc: [u8; 32] = Sha256::digest(b"abc").into();
        assert_eq!((inner.of(file), outer.of(file)), (Some((3, abc)), Some((3, abc))));
        assert_eq!(outer.of(Path::new("b.csv")), None);
        assert_eq!(noted(|| ()).1, FilesRead::default(), "nothing is noted outside");
    }
}
