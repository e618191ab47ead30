//! How a calibration is run.

use serde::{Deserialize, Serialize};

/// Settings of the sampler. The defaults were measured; see each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Total number of simulations of the sampler (the local search for the MAP comes on top).
    pub samples: usize,
    /// Stages that adapt the proposal, before the final one.
    pub iterations: usize,
    /// Seed of all random streams.
    pub seed: u64,
    /// Independently scrambled sub-nets per stage, from which error bars are computed.
    pub replicates: usize,
    /// Share of the budget drawn from the last, frozen proposal.
    pub final_share: f64,
    /// Effective sample size that tempering aims at, as a share of a stage.
    pub tempering_share: f64,
    /// Most mixture components.
    pub max_components: usize,
    /// Factor on the fitted covariances.
    pub widening: f64,
    /// Degrees of freedom of the proposal's Student-t components.
    pub degrees_of_freedom: f64,
    /// Share of the prior kept in every proposal.
    pub defensive_share: f64,
    /// Share of failed simulations above which the run stops with an error.
    pub max_failed_share: f64,
    /// Stop early once the effective sample size reaches this.
    pub ess_target: Option<f64>,
    /// Stop early once every posterior mean is known to this many posterior standard deviations.
    pub mean_se_target: Option<f64>,
    /// Number of equally weighted posterior draws.
    pub draws: usize,
    /// Most simulations of the local search for the MAP.
    pub map_simulations: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            samples: 16_384,
            iterations: 8,
            seed: 1,
            replicates: 16,
            final_share: 0.5,
            tempering_share: 0.25,
            max_components: 8,
            widening: 1.6,
            degrees_of_freedom: 10.0,
            defensive_share: 0.02,
            max_failed_share: 0.9,
            ess_target: None,
            mean_se_target: None,
            draws: 4096,
            map_simulations: 400,
        }
    }
}
