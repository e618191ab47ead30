//! One driver per directory.

use std::fmt;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use crate::error::CampaignError;

const NAME: &str = "lock";

/// For how long the lock is tried: somebody who asks for the status holds it for a moment.
const PATIENCE: Duration = Duration::from_millis(300);

/// For how long it is tried where its holder was killed: a process that the holder was just starting has it
/// until it becomes the program that it is to be.
const PATIENCE_WITH_THE_DEAD: Duration = Duration::from_secs(10);

/// Who has a directory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Number of the process.
    pub pid: u32,
    /// Its machine.
    pub host: String,
    /// Since when \[seconds since 1970\].
    pub since: u64,
}

impl Holder {
    fn is_dead(&self) -> bool {
        self.host == host() && !process_exists(self.pid)
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ago = now_s().saturating_sub(self.since);
        write!(f, "process {} on {} since ", self.pid, self.host)?;
        match ago {
            0..=119 => write!(f, "{ago} s"),
            120..=7199 => write!(f, "{} min", ago / 60),
            _ => write!(f, "{} h", ago / 3600),
        }
    }
}

/// Seconds since 1970.
pub(crate) fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// Name of this machine.
pub(crate) fn host() -> String {
    #[cfg(unix)]
    {
        rustix::system::uname().nodename().to_string_lossy().into_owned()
    }
    #[cfg(not(unix))]
    {
        std::env::var("COMPUTERNAME").unwrap_or_default()
    }
}

/// Whether there is a process of this number on this machine.
#[cfg(unix)]
pub(crate) fn process_exists(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw);
    pid.is_some_and(|pid| {
        // Not allowed to signal it means that it is there.
        rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH)
    })
}

#[cfg(not(unix))]
pub(crate) fn process_exists(_pid: u32) -> bool {
    true
}

/// An exclusive lock on a directory. It ends with the process, however that ends.
#[derive(Debug)]
pub(crate) struct Lock {
    file: File,
}

impl Lock {
    /// Takes the lock of `dir`.
    pub(crate) fn take(dir: &Path) -> Result<Self, CampaignError> {
        let path = dir.join(NAME);
        let failed = |error| CampaignError::io("locked", &path, error);
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)?;
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
        let holder = Holder { pid: std::process::id(), host: host(), since: now_s() };
        // Who holds it is for messages: on a full disk the lock holds all the same.
        let _ = write_holder(&mut file, &holder);
        Ok(Self { file })
    }

    /// Who has `dir`, if anybody has; never takes the lock for longer than a moment.
    pub(crate) fn holder(dir: &Path) -> Option<Option<Holder>> {
        let mut file = File::open(dir.join(NAME)).ok()?;
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
    fn the_second_is_told_who_has_it_and_may_have_it_afterwards() {
        let dir = tempfile::tempdir().expect("a directory");
        assert_eq!(Lock::holder(dir.path()), None);
        let lock = Lock::take(dir.path()).expect("free");
        let Err(CampaignError::Locked { holder: Some(holder), .. }) = Lock::take(dir.path()) else {
            panic!("must be locked");
        };
        assert_eq!((holder.pid, holder.host), (std::process::id(), host()));
        assert!(matches!(Lock::holder(dir.path()), Some(Some(_))));
        drop(lock);
        assert_eq!(Lock::holder(dir.path()), None);
        Lock::take(dir.path()).expect("free again");
    }

    #[test]
    fn a_lock_file_that_somebody_left_is_no_obstacle() {
        let dir = tempfile::tempdir().expect("a directory");
        for left in [&b"{\"pid\":1,\"host\":\"x\",\"since\":5}\n"[..], b"", b"\xff\0nonsense"] {
            std::fs::write(dir.path().join(NAME), left).expect("written");
            Lock::take(dir.path()).expect("nobody holds it");
        }
    }
}
