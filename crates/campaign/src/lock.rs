//! The lock of a directory, which one driver has at a time.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::CampaignError;
use crate::folder::LOCK;
use crate::holder::Holder;

/// Time for which the lock is tried: a process that asks for the status holds it for a moment.
const PATIENCE: Duration = Duration::from_millis(300);

/// The same where its holder was killed: a process that the holder was just starting has the lock until it executes its
/// program.
const PATIENCE_WITH_THE_DEAD: Duration = Duration::from_secs(10);

/// An exclusive lock on a directory. It ends with the process, however that ends.
#[derive(Debug)]
pub(crate) struct Lock {
    file: File,
    path: PathBuf,
}

impl Lock {
    /// Takes the lock of `dir`.
    pub(crate) fn take(dir: &Path) -> Result<Self, CampaignError> {
        let path = dir.join(LOCK);
        let failed = |error| CampaignError::io("locked", &path, error);
        let mut options = plain_file();
        options.write(true).create(true).truncate(false);
        let mut file = options.open(&path).map_err(failed)?;
        let start = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) => {
                    let holder = read_holder(&mut file);
                    let dead = holder.as_ref().is_some_and(Holder::is_dead);
                    let patience = if dead { PATIENCE_WITH_THE_DEAD } else { PATIENCE };
                    if start.elapsed() > patience {
                        return Err(CampaignError::Locked { dir: dir.to_path_buf(), holder });
                    }
                    std::thread::sleep(Duration::from_millis(20));
                }
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
        }
        // The holder's name is for messages: on a full disk the lock holds without it.
        let _ = write_holder(&mut file, &Holder::this());
        Ok(Self { file, path })
    }

    /// Checks that the locked file is the one in the directory.
    pub(crate) fn check(&self) -> Result<(), CampaignError> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let failed = |error| CampaignError::io("read", &self.path, error);
            let held = self.file.metadata().map_err(failed)?;
            let same = match self.path.symlink_metadata() {
                Ok(there) => (there.dev(), there.ino()) == (held.dev(), held.ino()),
                Err(error) if error.kind() == io::ErrorKind::NotFound => false,
                Err(error) => return Err(failed(error)),
            };
            if !same {
                let dir = self.path.parent().unwrap_or(&self.path).to_path_buf();
                return Err(CampaignError::LockLost { dir });
            }
        }
        Ok(())
    }

    /// The process that has `dir`: none where it is free, `Some(None)` where its name cannot be read. Takes the lock for a
    /// moment at most.
    pub(crate) fn holder(dir: &Path) -> Option<Option<Holder>> {
        let mut file = plain_file().open(dir.join(LOCK)).ok()?;
        match file.try_lock_shared() {
            Ok(()) => {
                let _ = file.unlock();
                None
            }
            Err(_) => Some(read_holder(&mut file)),
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = self.file.set_len(0);
        let _ = self.file.unlock();
    }
}

/// To read a file that is neither a link nor waits for a writer, as a received folder may hold in its place.
fn plain_file() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
        options.custom_flags(flags.bits() as i32);
    }
    options
}

fn read_holder(file: &mut File) -> Option<Holder> {
    let mut text = Vec::new();
    file.rewind().ok()?;
    file.take(4096).read_to_end(&mut text).ok()?;
    serde_json::from_slice(&text).ok()
}

fn write_holder(file: &mut File, holder: &Holder) -> io::Result<()> {
    let mut text = serde_json::to_vec(holder)?;
    text.push(b'\n');
    file.set_len(0)?;
    file.rewind()?;
    file.write_all(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_driver_is_refused_with_the_name_of_the_first_and_let_in_after_it() {
        let dir = tempfile::tempdir().expect("a directory");
        assert_eq!(Lock::holder(dir.path()), None);
        let lock = Lock::take(dir.path()).expect("free");
        let Err(CampaignError::Locked { holder: Some(holder), .. }) = Lock::take(dir.path()) else {
            panic!("must be locked");
        };
        assert_eq!((holder.pid, holder.host), (std::process::id(), crate::machine::host()));
        assert!(matches!(Lock::holder(dir.path()), Some(Some(_))));
        drop(lock);
        assert_eq!(Lock::holder(dir.path()), None);
        Lock::take(dir.path()).expect("free again");
    }

    #[test]
    fn a_lock_file_without_a_holder_does_not_keep_anybody_out() {
        let dir = tempfile::tempdir().expect("a directory");
        for left in [&b"{\"pid\":1,\"host\":\"x\",\"since\":5}\n"[..], b"", b"\xff\0nonsense"] {
            std::fs::write(dir.path().join(LOCK), left).expect("written");
            Lock::take(dir.path()).expect("nobody holds it");
        }
    }
}
