//! One run by a worker that does not have the directory's lock.

use std::path::Path;

use crate::error::ExecutorError;
use crate::executor::Stop;
use crate::outcome::Outcome;

/// Runs submitted tasks of a campaign without its lock, as an element of a job array does, and
/// publishes their outcomes for the driver to collect.
#[derive(Debug)]
pub struct Worker {}

impl Worker {
    /// Reads the campaign in `dir`.
    ///
    /// # Errors
    ///
    /// [`ExecutorError`] where there is no campaign, or it cannot be read.
    pub fn open(_dir: &Path) -> Result<Self, ExecutorError> {
        Err(ExecutorError::Scheduler("the worker is not built yet".into()))
    }

    /// Makes one run, with its attempts, and publishes its outcome. A run that has one is not made again.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::Interrupted`] where `stop` was asked for, [`ExecutorError::CannotStart`] where the
    /// program is not there: no outcome is published then.
    pub fn run(&self, _number: u64, _stop: &Stop) -> Result<Outcome, ExecutorError> {
        Err(ExecutorError::Scheduler("the worker is not built yet".into()))
    }
}

/// [`Worker::open`] and [`Worker::run`] for one run.
///
/// # Errors
///
/// As these two.
pub fn run_task(dir: &Path, number: u64, stop: &Stop) -> Result<Outcome, ExecutorError> {
    Worker::open(dir)?.run(number, stop)
}
