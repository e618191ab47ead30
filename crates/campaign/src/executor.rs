//! What makes runs: the trait, what it tells, and how it is stopped.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::outcome::FailureKind;
use crate::task::Task;

/// Makes runs.
pub trait Executor {
    /// Stores `tasks` ([`Campaign::record_submitted`]), runs those that have no outcome, and stores
    /// their outcomes. Returns when every task has one.
    ///
    /// `watch` is called from this thread; it is told of an end only when the outcome is stored.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::Interrupted`] where `stop` was asked for; other errors where no further run
    /// can be made. Outcomes of runs that had ended are stored in any case, unless they cannot be.
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError>;
}

/// What happens while tasks are run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A task was given to a scheduler and waits there.
    Queued {
        /// Number of the run.
        number: u64,
    },
    /// An attempt began.
    Started {
        /// Number of the run.
        number: u64,
    },
    /// An attempt was lost, and another is made.
    Retried {
        /// Number of the run.
        number: u64,
        /// What happened to the attempt.
        kind: FailureKind,
    },
    /// A run ended, and its outcome is stored.
    Ended {
        /// Number of the run.
        number: u64,
        /// Why, where it failed.
        failed: Option<FailureKind>,
    },
    /// Something that the user should know, in a sentence: "squeue does not answer; waiting".
    Note(String),
}

/// What somebody has asked the executor to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Request {
    /// Go on.
    Run,
    /// End the runs, store nothing for them, and return.
    Cancel,
    /// Return and let the runs go on where that is possible (on a cluster); elsewhere as `Cancel`.
    Detach,
}

/// A flag to stop an executor with, shared with a signal handler or another thread.
#[derive(Debug, Clone, Default)]
pub struct Stop {
    asked: Arc<AtomicU8>,
    /// Of the caller, who is listened to as well.
    parent: Option<Arc<AtomicU8>>,
}

impl Stop {
    /// A flag that says to go on.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A flag of its own that is asked too whenever this one is.
    pub(crate) fn child(&self) -> Self {
        Self { asked: Arc::default(), parent: Some(Arc::clone(&self.asked)) }
    }

    /// Asks to end the runs. Counts more than a request to detach.
    pub fn cancel(&self) {
        self.asked.store(2, Ordering::SeqCst);
    }

    /// Asks to return and let the runs go on.
    pub fn detach(&self) {
        let _ = self.asked.compare_exchange(0, 1, Ordering::SeqCst, Ordering::SeqCst);
    }

    /// What was asked for.
    #[must_use]
    pub fn request(&self) -> Request {
        let parent = self.parent.as_ref().map_or(0, |parent| parent.load(Ordering::SeqCst));
        match self.asked.load(Ordering::SeqCst).max(parent) {
            0 => Request::Run,
            1 => Request::Detach,
            _ => Request::Cancel,
        }
    }

    /// Whether anything was asked for.
    #[must_use]
    pub fn asked(&self) -> bool {
        self.request() != Request::Run
    }
}
