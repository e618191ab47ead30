//! What decides the posterior of a population, beside the sampler.

use serde::{Deserialize, Serialize};
use smc_calib::population::Hyperprior;

/// A population of several calibrations of the same parameters.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopulationPlan {
    /// What was assumed of mean, spread and correlation, in the coordinates of the parameters.
    pub hyperprior: Hyperprior,
    /// Radius that every tau_s was moved to, in proportion to the radius \[m\]; none for runs without a pair of particles.
    pub radius_m: Option<f64>,
    /// The calibrations, one for each member.
    pub runs: Vec<PopulationRun>,
}

/// A calibration that is a member of a population.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopulationRun {
    /// Name of the calibration.
    pub name: String,
    /// Its folder, as it was given.
    pub run: String,
    /// SHA-256 of its `posterior.json`.
    pub sha256: String,
}
