//! Given runs of a campaign, made one after the other: the work of a job on a cluster.

use std::path::Path;

use campaign::{ExecutorError, Stop, Worker};

use crate::calibration::refused;
use crate::error::{Failure, InputError, Mistake, RunError};

/// Makes the runs of a list of numbers, as in `1-20,33`; `runs` is the folder of the campaign. A simulation that fails
/// is an outcome, not a failure here.
///
/// # Errors
///
/// [`Failure::Input`] for a list that is not one, [`Failure::Run`] for a run that cannot be made, [`Failure::Paused`]
/// where it was asked to stop; no outcome is stored for that run then.
pub fn run_tasks(runs: &Path, list: &str, stop: &Stop) -> Result<(), Failure> {
    let numbers = campaign::numbers::parse(list).map_err(|error| {
        InputError::new("--tasks", Mistake::OutOfRange).found(error).expected("as in 1-20,33")
    })?;
    let failed = |error: ExecutorError| match error {
        ExecutorError::Interrupted { .. } => {
            Failure::Paused("interrupted; no outcome is stored for the run that was made".into())
        }
        ExecutorError::Campaign(error) => refused(runs, error),
        other => RunError::new(other).into(),
    };
    let worker = Worker::open(runs).map_err(failed)?;
    for number in numbers {
        worker.run(number, stop).map_err(failed)?;
    }
    Ok(())
}
