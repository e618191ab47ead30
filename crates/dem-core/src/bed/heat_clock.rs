//! The heat of a bed and its pace in a step.

use std::sync::Arc;

use crate::heat::Heat;

/// A heat, and the time of the bed at which its own time is 0 \[s\].
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HeatClock {
    pub(crate) heat: Arc<Heat>,
    pub(crate) contact_s: f64,
}

/// How fast the contacts grow in a step: `step_s` and 1 without heat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepPace {
    /// The step in reduced time \[s\].
    pub(crate) growing_s: f64,
    /// Resistance of necks over that at the reference, 1/m.
    pub(crate) slowness: f64,
}
