//! Reasons to be careful with experiments that are calibrated together.

use std::fmt;

use serde::Serialize;

use super::section;
use crate::number::significant;

/// A reason to be careful with a joint calibration that its sampler does not see.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub(crate) enum OfJoint {
    /// Measurements farther from the curves of the posterior than its noise puts them.
    NotReplicated { observable: String, rmse: f64, as_far: f64, replicated: usize },
}

impl OfJoint {
    /// Probability of replicated data as far off below which measurements contradict the model.
    pub(crate) const CONTRADICTED: f64 = 0.01;
}

/// The probability of replicated data as far off, in words; where there are none of n, it is below 3/n with 95 % probability.
pub(crate) fn as_far_in_words(as_far: f64, replicated: usize) -> String {
    if as_far > 0.0 {
        format!("p = {}", significant(as_far, 2))
    } else {
        format!("p < {}", significant(3.0 / replicated.max(1) as f64, 1))
    }
}

impl fmt::Display for OfJoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::NotReplicated { observable, rmse, as_far, replicated } = self;
        write!(
            f,
            "{observable}: its measurements contradict what is calibrated together, or the noise: data made with its errors are as far from their curves with {} only (RMSE {}); calibrate it alone and see whether it is met then{}",
            as_far_in_words(*as_far, *replicated),
            significant(*rmse, 2),
            section(self)
        )
    }
}
