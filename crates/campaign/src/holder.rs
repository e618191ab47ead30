//! The process that has a directory.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::machine;

/// The process that has a directory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Number of the process.
    pub pid: u32,
    /// Its machine.
    pub host: String,
    /// Time since which it has the directory \[s since 1970\].
    pub since: u64,
}

impl Holder {
    /// This process, from now on.
    pub(crate) fn this() -> Self {
        Self { pid: std::process::id(), host: machine::host(), since: machine::now_s() }
    }

    /// Whether it is known to have ended: on another machine it is not.
    pub(crate) fn is_dead(&self) -> bool {
        self.host == machine::host() && !machine::process_exists(self.pid)
    }
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ago = machine::now_s().saturating_sub(self.since);
        write!(f, "process {} on {} since ", self.pid, self.host)?;
        match ago {
            0..=119 => write!(f, "{ago} s"),
            120..=7199 => write!(f, "{} min", ago / 60),
            _ => write!(f, "{} h", ago / 3600),
        }
    }
}
