//! The calibration as a whole.

use crate::{CalibrateError, Posterior, Problem, Settings, StageRecord};
use std::ops::ControlFlow;

/// Watches a run, and may end it.
pub trait Observer {
    /// Called after every stage; `Break` ends the run with what there is.
    fn stage(&mut self, record: &StageRecord) -> ControlFlow<()>;
}

/// Watches nothing.
impl Observer for () {
    fn stage(&mut self, _: &StageRecord) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Calibrates.
///
/// # Errors
/// See [`CalibrateError`].
pub fn calibrate(
    problem: &Problem<'_>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    let _ = (settings, observer);
    Err(CalibrateError::ZeroEvidence { simulations: problem.parameters.len() })
}
