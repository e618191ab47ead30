//! Unfinished work of a long job: a hidden folder beside the results, `results/.pair.work-0123456789abcdef`, named after
//! the plan that it belongs to.
//!
//! Every file in it appears whole (written aside, flushed, renamed), so that a run that was interrupted or killed goes
//! on from them. The same plan finds its folder again, another plan does not. It is removed when the results are
//! published.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use crate::error::{Failure, RunError};
use crate::output::{RunFolder, write_file};
use crate::watch::Watch;

const LOCK: &str = "lock";

/// A folder of unfinished work, locked against other processes.
#[derive(Debug)]
pub(crate) struct WorkFolder {
    path: PathBuf,
    prefix: String,
    // Held while the folder is in use; the system releases it when the process ends, however it does.
    _lock: File,
}

/// A number that tells plans apart (FNV-1a of its text).
pub(crate) fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |sum, byte| {
        (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

impl WorkFolder {
    /// Opens or makes the folder for a plan.
    pub(crate) fn open(folder: &RunFolder, plan: &str) -> Result<Self, Failure> {
        let prefix = format!(".{}.work-", folder.name());
        let path = folder.parent().join(format!("{prefix}{:016x}", fingerprint(plan)));
        let failed = |error: std::io::Error| {
            RunError::new(format_args!("{}: cannot be written: {error}", path.display()))
                .help("make room, or choose another folder with --out")
        };
        fs::create_dir_all(&path).map_err(failed)?;
        let lock = File::create(path.join(LOCK)).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(RunError::new(format_args!(
                    "{}: another process is computing this very plan",
                    folder.path().display()
                ))
                .help("wait for it, or choose another folder with --out")
                .into());
            }
            // A file system without locks.
            Err(TryLockError::Error(_)) => {}
        }
        Ok(Self { path, prefix, _lock: lock })
    }

    /// A file of earlier work, if it is there.
    pub(crate) fn get(&self, name: &str) -> Option<Vec<u8>> {
        fs::read(self.path.join(name)).ok()
    }

    /// Writes a file whole: aside, then renamed.
    pub(crate) fn put(&self, name: &str, contents: &[u8]) -> Result<(), RunError> {
        write_file(&self.path.join(name), contents)
    }

    /// Whether a folder holds nothing but the lock.
    fn is_empty(path: &Path) -> bool {
        fs::read_dir(path)
            .is_ok_and(|entries| entries.flatten().all(|entry| entry.file_name() == LOCK))
    }

    /// Folders of unfinished work of other plans for the same results.
    pub(crate) fn others(&self) -> Vec<PathBuf> {
        let Some(parent) = self.path.parent() else { return Vec::new() };
        let Ok(entries) = fs::read_dir(parent) else { return Vec::new() };
        let mut others: Vec<PathBuf> = entries
            .flatten()
            .filter(|entry| entry.file_name().to_string_lossy().starts_with(&self.prefix))
            .map(|entry| entry.path())
            .filter(|path| *path != self.path && !Self::is_empty(path))
            .collect();
        others.sort();
        others
    }

    /// Notes what other plans have left.
    pub(crate) fn mention_others(&self, watch: &dyn Watch) {
        for other in self.others() {
            watch.note(&format!(
                "{}: unfinished work of another plan is kept there; delete it if it is not wanted",
                other.display()
            ));
        }
    }

    /// Removes the folder: its results are published.
    pub(crate) fn finish(self) {
        // Best effort: what is left is hidden and of no harm.
        let _ = fs::remove_dir_all(&self.path);
    }
}

impl Drop for WorkFolder {
    /// Removes an empty folder.
    fn drop(&mut self) {
        if Self::is_empty(&self.path) {
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_plan_finds_its_work_again_and_another_does_not() {
        let place = tempfile::tempdir().expect("a temporary folder");
        let folder = RunFolder::prepare(&place.path().join("pair"), "scene.json").expect("free");
        let one = WorkFolder::open(&folder, "one").expect("made");
        one.put("state", b"1").expect("written");
        let error = WorkFolder::open(&folder, "one").expect_err("in use");
        assert!(error.to_string().contains("another process"), "{error}");
        let two = WorkFolder::open(&folder, "two").expect("made");
        assert_eq!((two.get("state"), two.others()), (None, vec![one.path.clone()]));
        two.finish();
        drop(one);
        let again = WorkFolder::open(&folder, "one").expect("free again");
        assert_eq!(again.get("state").as_deref(), Some(b"1".as_slice()));
        assert!(again.others().is_empty());
    }
}
