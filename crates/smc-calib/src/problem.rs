//! The inference problem: parameters, observations, and the noise of the measurements.

use crate::{Noise, Observations, Prior, Simulator};
use serde::{Deserialize, Serialize};

/// A parameter to infer.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name, as printed.
    pub name: String,
    /// SI unit, as printed.
    pub unit: String,
    /// Prior.
    pub prior: Prior,
}

impl Parameter {
    /// A named parameter.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, prior: Prior) -> Self {
        Self { name: name.into(), unit: unit.into(), prior }
    }
}

/// A calibration problem: simulator, priors, observations, noise.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The simulator.
    pub simulator: &'a dyn Simulator,
    /// Parameters, in the order the simulator takes them.
    pub parameters: Vec<Parameter>,
    /// The measured curve.
    pub observations: Observations,
    /// The noise model.
    pub noise: Noise,
}
