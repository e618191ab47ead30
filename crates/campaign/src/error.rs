//! Errors of campaigns and executors, and reports of damage.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::folder::RECORD;
use crate::holder::Holder;
use crate::numbers;
use crate::spec::SpecError;

/// Why a campaign cannot be made, opened or written to.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The specification cannot be run.
    #[error("{0}")]
    Spec(#[from] SpecError),
    /// The directory is there already, and not empty.
    #[error("{}: is there already and not empty; resume it, or choose another directory", dir.display())]
    Exists {
        /// The directory.
        dir: PathBuf,
    },
    /// There is no campaign in the directory.
    #[error("{}: holds no run (there is no {})", dir.display(), RECORD)]
    NotACampaign {
        /// The directory.
        dir: PathBuf,
    },
    /// Another driver has the directory.
    #[error("{}: is in use by {}; wait for it, or stop it", dir.display(),
        .holder.as_ref().map_or_else(|| "another process".to_owned(), Holder::to_string))]
    Locked {
        /// The directory.
        dir: PathBuf,
        /// The process that has it, where that can be read.
        holder: Option<Holder>,
    },
    /// The file that this driver has locked is not in the directory any more: somebody removed it, and another driver may
    /// have the directory.
    #[error("{}: the lock of this run was removed while it ran, and another process may have the folder: nothing more is \
        written; what was stored before is safe", dir.display())]
    LockLost {
        /// The directory.
        dir: PathBuf,
    },
    /// The record of what is run is damaged. [`Campaign::restore`](crate::Campaign::restore) mends it with a
    /// specification.
    #[error("{}: {what}; give the plan again to restore it", file.display())]
    Damaged {
        /// The file.
        file: PathBuf,
        /// The problem with it.
        what: String,
    },
    /// The directory was written by another version of this program.
    #[error("{}: has format {found}, this program reads {expected}; use the version that wrote it",
        file.display())]
    Format {
        /// The file.
        file: PathBuf,
        /// Its format.
        found: u64,
        /// The format that this version reads.
        expected: u64,
    },
    /// A name for an additional file that cannot be used.
    #[error("{name:?} cannot be the name of a file in a run directory")]
    FileName {
        /// The name.
        name: String,
    },
    /// A task that cannot be run.
    #[error("run {number}: {problem}")]
    InvalidTask {
        /// Number of the run.
        number: u64,
        /// The problem.
        problem: String,
    },
    /// A run of this number is known, with another command or other parameters: the plan, the
    /// program or the machine's arithmetic changed since.
    #[error(
        "run {number} was submitted as {} {:?} before and is {} {:?} now: the plan or the program has changed",
        .stored.command, .stored.parameters, .given.command, .given.parameters
    )]
    TaskDiffers {
        /// Number of the run.
        number: u64,
        /// The stored task.
        stored: Box<crate::Task>,
        /// The task as submitted now.
        given: Box<crate::Task>,
    },
    /// An outcome that cannot be stored.
    #[error("outcome of run {number}: {problem}")]
    InvalidOutcome {
        /// Number of the run.
        number: u64,
        /// The problem.
        problem: String,
    },
    /// The disk (or the user's share of it) is full. What was stored before is intact.
    #[error(
        "{}: the disk is full; everything before is safe: make room, then resume",
        path.display()
    )]
    DiskFull {
        /// File that could not be written.
        path: PathBuf,
    },
    /// A file cannot be read or written.
    #[error("{}: cannot be {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted operation as a participle: "read", "written", ...
        action: &'static str,
        /// The system's words.
        source: io::Error,
    },
}

impl CampaignError {
    /// A failed access to a file; a full disk is told from other failures.
    pub(crate) fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
        let path = path.to_path_buf();
        match source.kind() {
            StorageFull | QuotaExceeded | FileTooLarge => Self::DiskFull { path },
            _ => Self::Io { path, action, source },
        }
    }

    /// Whether the disk is full, so that making room helps.
    #[must_use]
    pub fn is_disk_full(&self) -> bool {
        matches!(self, Self::DiskFull { .. })
    }
}

/// Why an executor stopped before every task had its outcome.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExecutorError {
    /// The executor was asked to stop. Finished runs are stored.
    #[error("interrupted")]
    Interrupted {
        /// Whether runs go on without the driver, to be taken up later.
        detached: bool,
    },
    /// The program of a command cannot be started: it is not there, or not a program. No outcome is stored; the runs can be
    /// made once the program is there.
    #[error("{program}: cannot be started: {reason}")]
    CannotStart {
        /// The program.
        program: String,
        /// The problem.
        reason: String,
    },
    /// The last runs failed in the same way, one after the other, and earlier ones did not: most likely something that they
    /// all need is out of order. Their outcomes are stored, and can be given up ([`Campaign::forget_failed`]).
    ///
    /// [`Campaign::forget_failed`]: crate::Campaign::forget_failed
    #[error("looks like an outage, {count} of the last {count}: {cause}{}", quoted(detail))]
    Outage {
        /// Number of runs in a row.
        count: u64,
        /// Their common cause.
        cause: String,
        /// The end of what the last of them wrote to stderr.
        detail: String,
    },
    /// A program asked again and again to be called later. No outcome is stored for the run.
    #[error(
        "run {number}: the program asked {attempts} times to be called later: {cause}{}",
        quoted(detail)
    )]
    NotNow {
        /// Number of the run.
        number: u64,
        /// Attempts that were made.
        attempts: u32,
        /// The last of them: "exit code 75".
        cause: String,
        /// The end of its stderr.
        detail: String,
    },
    /// Runs were lost more often than they may be tried again. No outcome is stored for them.
    #[error(
        "{} lost more often than it may be tried again: {cause}{}",
        lost_runs(numbers),
        quoted(detail)
    )]
    Lost {
        /// Numbers of the runs.
        numbers: Vec<u64>,
        /// How the first of them was lost.
        cause: String,
        /// Particulars of it.
        detail: String,
    },
    /// A simulator in this process reports that no run can succeed.
    #[error("{0}")]
    Simulator(String),
    /// The scheduler of a cluster refuses the runs or does not work.
    #[error("{0}")]
    Scheduler(String),
    /// The directory cannot be written to.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
}

impl ExecutorError {
    /// A program that the system does not start.
    pub(crate) fn cannot_start(program: String, error: &io::Error) -> Self {
        let reason = match error.kind() {
            io::ErrorKind::NotFound => {
                "there is no such program (or not the interpreter that it names)".to_owned()
            }
            io::ErrorKind::PermissionDenied => "it is not executable".to_owned(),
            _ => error.to_string(),
        };
        Self::CannotStart { program, reason }
    }
}

/// The end of a stderr behind a message.
fn quoted(detail: &str) -> String {
    if detail.is_empty() { String::new() } else { format!("; it said:\n{detail}") }
}

fn lost_runs(lost: &[u64]) -> String {
    match lost {
        [one] => format!("run {one} was"),
        several => format!("runs {} were", numbers::format(several)),
    }
}

/// A damaged file or line, and what became of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The file.
    pub file: PathBuf,
    /// The line in it, from 1, for a file of lines.
    pub line: Option<usize>,
    /// The problem in words: "its checksum does not fit".
    pub what: String,
    /// Place that the damaged file was moved to.
    pub set_aside: Option<PathBuf>,
    /// The last line of a journal that was being written when its driver was killed: nothing that
    /// had finished is lost.
    pub torn: bool,
}

impl Damage {
    /// A file that is damaged as a whole.
    pub(crate) fn of(file: &Path, what: impl Into<String>) -> Self {
        let file = file.to_path_buf();
        Self { file, line: None, what: what.into(), set_aside: None, torn: false }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        write!(f, ": {}", self.what)?;
        if let Some(place) = &self.set_aside {
            write!(f, "; the damaged file is kept as {}", place.display())?;
        }
        Ok(())
    }
}
