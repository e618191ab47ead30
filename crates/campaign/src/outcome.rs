//! How a run ended.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How a run ended. It is final: a run with an outcome is not made again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The run gave values.
    Finished {
        /// The values at the observation points of the first observable, then of the second, ...; all finite.
        values: Vec<f64>,
        /// Attempts that were made, from 1.
        attempts: u32,
        /// Duration of the last attempt \[s\].
        seconds: f64,
    },
    /// The run gave no values, and would not if it were tried again, or was lost too often.
    Failed {
        /// The cause. Its words are the same for the same cause, so that failures can be counted by them.
        kind: FailureKind,
        /// Particulars of this run: the line, the value, the end of its stderr. May be empty.
        detail: String,
        /// Attempts that were made, from 1.
        attempts: u32,
        /// Duration of the last attempt \[s\].
        seconds: f64,
    },
}

impl Outcome {
    /// The values, where the run finished.
    #[must_use]
    pub fn values(&self) -> Option<&[f64]> {
        match self {
            Self::Finished { values, .. } => Some(values),
            Self::Failed { .. } => None,
        }
    }

    /// The cause, where the run failed.
    #[must_use]
    pub fn failure(&self) -> Option<&FailureKind> {
        match self {
            Self::Finished { .. } => None,
            Self::Failed { kind, .. } => Some(kind),
        }
    }

    /// Attempts that were made.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        match self {
            Self::Finished { attempts, .. } | Self::Failed { attempts, .. } => *attempts,
        }
    }

    /// Duration of the last attempt \[s\].
    #[must_use]
    pub fn seconds(&self) -> f64 {
        match self {
            Self::Finished { seconds, .. } | Self::Failed { seconds, .. } => *seconds,
        }
    }
}

/// Why a run failed. `to_string` gives the words to count failures by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum FailureKind {
    /// The command ended with a code other than 0.
    ExitCode {
        /// The code.
        code: i32,
    },
    /// The command crashed: a signal that a program brings upon itself (SIGSEGV, SIGABRT, SIGFPE, ...).
    Crashed {
        /// Number of the signal.
        signal: i32,
    },
    /// The command did not end in time, and was ended.
    Timeout {
        /// The limit \[s\].
        limit_s: f64,
    },
    /// The scheduler ended it because it needs more memory than it may have.
    OutOfMemory,
    /// Killed from outside (SIGKILL, SIGTERM, ...) or gone without a result, more often than it may be
    /// tried again.
    Lost {
        /// Number of the signal, where it is known.
        signal: Option<i32>,
    },
    /// The command ended well, and the file with the results is not there.
    MissingOutput {
        /// The file.
        file: String,
    },
    /// The file with the results is not a table of its format.
    MalformedOutput {
        /// The file.
        file: String,
    },
    /// The table does not have the column.
    MissingColumn {
        /// The file.
        file: String,
        /// The column.
        column: String,
    },
    /// A value that is needed is not a number (nan, inf).
    NotANumber {
        /// The file; none for a simulator in this process.
        file: Option<String>,
        /// The column.
        column: String,
    },
    /// An observation point lies before the first or after the last row of the table.
    Extrapolation {
        /// The file.
        file: String,
        /// The control column.
        column: String,
    },
    /// Without interpolation: the table has no row at an observation point.
    NoMatch {
        /// The file.
        file: String,
        /// The control column, or the value column where there is no control.
        column: String,
    },
    /// A worker did not answer as it must.
    BadAnswer {
        /// What is wrong with the answer.
        problem: String,
    },
    /// A simulator in this process refused these parameters.
    Simulator {
        /// Its words.
        cause: String,
    },
}

impl FailureKind {
    /// Whether the run was lost, which says nothing about its parameters.
    #[must_use]
    pub fn is_lost(&self) -> bool {
        matches!(self, Self::Lost { .. })
    }
}

impl fmt::Display for FailureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ExitCode { code } => write!(f, "exit code {code}"),
            Self::Crashed { signal } => write!(f, "crashed with {}", signal_name(*signal)),
            Self::Timeout { limit_s } => write!(f, "timeout: not finished after {limit_s} s"),
            Self::OutOfMemory => f.write_str("out of memory"),
            Self::Lost { signal: Some(signal) } => {
                write!(f, "lost: killed from outside with {}", signal_name(*signal))
            }
            Self::Lost { signal: None } => write!(f, "lost: gone without a result"),
            Self::MissingOutput { file } => write!(f, "no file {file}"),
            Self::MalformedOutput { file } => write!(f, "{file} is not a table as described"),
            Self::MissingColumn { file, column } => write!(f, "{file} has no column {column}"),
            Self::NotANumber { file: Some(file), column } => {
                write!(f, "{column} in {file} is not a number")
            }
            Self::NotANumber { file: None, column } => write!(f, "{column} is not a number"),
            Self::Extrapolation { file, column } => {
                write!(f, "{column} in {file} does not reach all observation points")
            }
            Self::NoMatch { file, column } => {
                write!(f, "{column} in {file} has no row at an observation point")
            }
            Self::BadAnswer { problem } => write!(f, "the worker's answer: {problem}"),
            Self::Simulator { cause } => f.write_str(cause),
        }
    }
}

/// The usual name of a signal; numbers as on Linux and macOS where these agree.
pub(crate) fn signal_name(signal: i32) -> String {
    let name = match signal {
        1 => "SIGHUP",
        2 => "SIGINT",
        3 => "SIGQUIT",
        4 => "SIGILL",
        5 => "SIGTRAP",
        6 => "SIGABRT",
        8 => "SIGFPE",
        9 => "SIGKILL",
        11 => "SIGSEGV",
        13 => "SIGPIPE",
        14 => "SIGALRM",
        15 => "SIGTERM",
        _ => return format!("signal {signal}"),
    };
    format!("signal {signal} ({name})")
}
