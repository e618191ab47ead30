//! `calibrate run-task DIR --tasks 1-20,33`: makes given runs of a campaign. It is what a job on a cluster calls.

use campaign::{ExecutorError, Stop, Worker};

use super::store;
use crate::args::RunTaskArgs;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::interrupt;

/// Makes the runs one after the other. A simulation that fails is an outcome, and no failure of this command.
///
/// # Errors
///
/// [`Failure::Input`] for numbers that are none, [`Failure::Run`] for a run that cannot be made,
/// [`Failure::Interrupted`] where it was asked to end; no outcome is stored for that run then.
pub fn run(args: &RunTaskArgs) -> Result<(), Failure> {
    let numbers = campaign::numbers::parse(&args.tasks).map_err(|error| {
        InputError::new("--tasks", Mistake::OutOfRange).found(error).expected("as in 1-20,33")
    })?;
    let stop = Stop::new();
    {
        let stop = stop.clone();
        interrupt::listen_with(move || stop.cancel());
    }
    let failed = |error: ExecutorError| match error {
        ExecutorError::Interrupted { .. } => {
            Failure::Paused("interrupted; no outcome is stored for the run that was made".into())
        }
        ExecutorError::Campaign(error) => store::refused(&args.dir, error),
        other => RunError::new(other).into(),
    };
    let worker = Worker::open(&args.dir).map_err(failed)?;
    for number in numbers {
        worker.run(number, &stop).map_err(failed)?;
    }
    Ok(())
}
