//! Executors: the trait, their events, and the flag that stops them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::feed::Feed;
use crate::outcome::FailureKind;
use crate::task::Task;

/// Makes runs.
pub trait Executor {
    /// Stores `tasks` ([`Campaign::record_submitted`]), runs those that have no outcome, and stores
    /// their outcomes. Returns when every task has one.
    ///
    /// `watch` is called from this thread, and for the end of a run only after its outcome is stored.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::Interrupted`] where `stop` was asked for; other errors where no further run can be made. Outcomes of
    /// runs that had ended are stored in any case where they can be.
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError>;

    /// Runs what `feed` gives until nothing more is to be run: tasks that are placed while others run. Events and errors as in
    /// [`run`](Self::run).
    ///
    /// Without an own implementation tasks that were given together are run to the last one before further ones are taken:
    /// the same outcomes, with pauses.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    fn run_fed(
        &mut self,
        campaign: &Campaign,
        feed: &Feed<'_>,
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        while let Some(tasks) = feed.next()? {
            self.run(campaign, &tasks, watch, stop)?;
        }
        Ok(())
    }
}

impl<E: Executor + ?Sized> Executor for &mut E {
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        (**self).run(campaign, tasks, watch, stop)
    }

    fn run_fed(
        &mut self,
        campaign: &Campaign,
        feed: &Feed<'_>,
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        (**self).run_fed(campaign, feed, watch, stop)
    }
}

impl Feed<'_> {
    /// Lets an executor run what is given, until nothing more is to be run or the executor fails.
    pub fn serve(&self, executor: &mut dyn Executor, watch: &mut dyn FnMut(Event), stop: &Stop) {
        /// Ends the feed, also after a panic.
        struct Leaving<'b, 'a>(&'b Feed<'a>);
        impl Drop for Leaving<'_, '_> {
            fn drop(&mut self) {
                self.0.end();
            }
        }
        let _leaving = Leaving(self);
        if let Err(error) = executor.run_fed(self.campaign(), self, watch, stop) {
            self.fail(error);
        }
    }
}

/// A feed stands in the place of the executor that it is taken by: tasks are given, and waited for.
impl Executor for &Feed<'_> {
    fn run(
        &mut self,
        _: &Campaign,
        tasks: &[Task],
        _: &mut dyn FnMut(Event),
        _: &Stop,
    ) -> Result<(), ExecutorError> {
        self.wait(tasks)
    }
}

/// An event while tasks are run.
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
        /// Why the attempt was lost.
        kind: FailureKind,
    },
    /// A run ended, and its outcome is stored.
    Ended {
        /// Number of the run.
        number: u64,
        /// The cause, where it failed.
        failed: Option<FailureKind>,
    },
    /// A message to the user, in a sentence: "squeue does not answer; waiting".
    Note(String),
}

/// A request to an executor.
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
    /// The caller's flag, which counts too.
    parent: Option<Arc<AtomicU8>>,
}

impl Stop {
    /// A flag that says to go on.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A flag that can be set by itself, and counts as set whenever this one is.
    pub(crate) fn child(&self) -> Self {
        Self { asked: Arc::default(), parent: Some(Arc::clone(&self.asked)) }
    }

    /// Asks to end the runs; overrides a request to detach.
    pub fn cancel(&self) {
        self.asked.store(2, Ordering::SeqCst);
    }

    /// Asks to return and let the runs go on.
    pub fn detach(&self) {
        let _ = self.asked.compare_exchange(0, 1, Ordering::SeqCst, Ordering::SeqCst);
    }

    /// The request.
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
