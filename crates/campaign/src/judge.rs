//! What an attempt came to: values, a failure of the run, or a fault of what is around it.

use std::io;
use std::path::Path;

use crate::folder::STDERR;
use crate::outcome::FailureKind;
use crate::process::Ended;
use crate::results::{self, Blame};
use crate::spec::CommandSpec;
use crate::streams::end_of;

/// What an attempt came to.
#[derive(Debug)]
pub(crate) enum Verdict {
    /// It gave values.
    Values(Vec<f64>),
    /// It failed, and would fail again.
    Failed(FailureKind, String),
    /// A result that looks cut off: a second attempt tells whether the run or the disk did it.
    Cut(FailureKind, String),
    /// It was ended from outside, or met an error of the disk: that says nothing about its parameters.
    Lost(FailureKind, String),
    /// The program asks to be called again later.
    Later(FailureKind, String),
}

/// Judges an attempt; `ended` is none where the system had no room for the process, or its folder was gone.
pub(crate) fn judge(
    command: &CommandSpec,
    folder: &Path,
    ended: Option<Ended>,
    disk_was_full: bool,
) -> Verdict {
    let said = || end_of(&folder.join(STDERR));
    let kind = match ended {
        Some(Ended::Exit(0)) => {
            let refusal = match results::read(folder, &command.outputs) {
                Ok(values) => return Verdict::Values(values),
                Err(refusal) => refusal,
            };
            let lost = || Verdict::Lost(FailureKind::Lost { signal: None }, refusal.detail.clone());
            return match refusal.blame {
                Blame::Environment => lost(),
                _ if disk_was_full || tells_of_the_disk(&said()) => lost(),
                Blame::Cut => Verdict::Cut(refusal.kind, refusal.detail),
                Blame::Run => Verdict::Failed(refusal.kind, refusal.detail),
            };
        }
        Some(Ended::Exit(code)) if command.call.try_later.exit_codes.contains(&code) => {
            return Verdict::Later(FailureKind::ExitCode { code }, said());
        }
        // A shell says so of a child that was killed.
        Some(Ended::Exit(code)) if lost_signal(code - 128) => {
            FailureKind::Lost { signal: Some(code - 128) }
        }
        Some(Ended::Exit(code)) => FailureKind::ExitCode { code },
        Some(Ended::Signal(signal)) if own_fault(signal) => FailureKind::Crashed { signal },
        Some(Ended::Signal(signal)) => FailureKind::Lost { signal: Some(signal) },
        Some(Ended::TimedOut) => FailureKind::Timeout { limit_s: command.call.timeout_s },
        Some(Ended::Stopped) | None => FailureKind::Lost { signal: None },
    };
    let detail = match ended {
        None if !folder.is_dir() => "its working folder has vanished".to_owned(),
        None => "the system had no room for another process".to_owned(),
        Some(_) => said(),
    };
    blame(kind, detail, folder, disk_was_full)
}

/// Puts a failure down to the run, or to the disk where there are signs of that.
pub(crate) fn blame(
    kind: FailureKind,
    detail: String,
    folder: &Path,
    disk_was_full: bool,
) -> Verdict {
    if kind.is_lost() {
        Verdict::Lost(kind, detail)
    } else if disk_was_full || tells_of_the_disk(&detail) || !folder.is_dir() {
        Verdict::Lost(FailureKind::Lost { signal: None }, format!("{kind}: {detail}"))
    } else {
        Verdict::Failed(kind, detail)
    }
}

/// Whether a program says that its disk was full or broken: the words of the C library, and Python's numbers.
fn tells_of_the_disk(said: &str) -> bool {
    const WORDS: [&str; 9] = [
        "No space left on device",
        "Disk quota exceeded",
        "Input/output error",
        "Stale file handle",
        "Stale NFS file handle",
        "[Errno 28]",
        "[Errno 122]",
        "[Errno 116]",
        "[Errno 5]",
    ];
    WORDS.iter().any(|words| said.contains(words))
}

/// Whether a process could not be made for want of resources, which may pass.
pub(crate) fn is_shortage(error: &io::Error) -> bool {
    use io::ErrorKind::{ExecutableFileBusy, OutOfMemory, WouldBlock};
    #[cfg(unix)]
    let files = [rustix::io::Errno::MFILE, rustix::io::Errno::NFILE]
        .iter()
        .any(|errno| error.raw_os_error() == Some(errno.raw_os_error()));
    #[cfg(not(unix))]
    let files = false;
    files || matches!(error.kind(), OutOfMemory | WouldBlock | ExecutableFileBusy)
}

/// Signals that come from outside: hang-up, interrupt, kill, termination.
fn lost_signal(signal: i32) -> bool {
    matches!(signal, 1 | 2 | 9 | 15)
}

/// Signals that a program brings upon itself: illegal instruction, trap, abort, bus error, arithmetic,
/// segment, broken pipe, bad system call.
fn own_fault(signal: i32) -> bool {
    #[cfg(unix)]
    {
        use rustix::process::Signal;
        let own = [
            Signal::ILL,
            Signal::TRAP,
            Signal::ABORT,
            Signal::BUS,
            Signal::FPE,
            Signal::SEGV,
            Signal::PIPE,
            Signal::SYS,
            Signal::XFSZ,
        ];
        own.iter().any(|own| own.as_raw() == signal)
    }
    #[cfg(not(unix))]
    {
        let _ = signal;
        false
    }
}

/// Whether the disk is full, which makes programs fail in many ways.
pub(crate) fn disk_is_full(folder: &Path) -> bool {
    #[cfg(unix)]
    {
        let Ok(disk) = rustix::fs::statvfs(folder) else { return false };
        let unit = disk.f_frsize.max(1);
        let enough = (disk.f_blocks * unit / 100).min(1 << 20);
        disk.f_bavail * unit < enough || (disk.f_files > 0 && disk.f_favail == 0)
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_from_outside_and_a_programs_own_are_told_apart() {
        for signal in 1..32 {
            assert!(!(lost_signal(signal) && own_fault(signal)), "{signal}");
        }
        assert!(own_fault(11) && own_fault(6) && lost_signal(9) && lost_signal(15));
    }
}
