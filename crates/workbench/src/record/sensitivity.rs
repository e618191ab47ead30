//! A result under another noise model, beside the one that was asked for.

use serde::{Deserialize, Serialize};
use smc_calib::{Concern, Noise, ShapeSummary};

/// The posterior under correlated errors.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensitivity {
    /// Noise model of each observable.
    pub noise: Vec<Noise>,
    /// Origin of the samples.
    pub method: Method,
    /// Number of samples.
    pub samples: usize,
    /// Log evidence.
    pub log_evidence: f64,
    /// Its standard error.
    pub log_evidence_se: f64,
    /// Effective sample size.
    pub ess: f64,
    /// Pareto shape of the weights.
    pub khat: f64,
    /// Whether the numbers can be trusted; else the summary says what to run.
    pub trusted: bool,
    /// What is to be known of its posterior: two modes, residuals that are still alike, a poor fit.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub concerns: Vec<Concern>,
    /// Parameters, in the order of the plan.
    pub parameters: Vec<SensitivityOf>,
    /// Correlation length and white share of each observable, where the samples are of this model.
    pub noise_shape: Vec<Option<ShapeSummary>>,
}

impl Sensitivity {
    /// Most observations with a second posterior that was not asked for: with more the likelihood takes too long.
    pub const MOST_OBSERVATIONS: usize = 200;
}

/// Origin of the samples of a second posterior.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The simulator was run again.
    Sampled,
    /// The run's own samples, weighted by the other likelihood.
    Weighted,
}

/// One parameter under the other model.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensitivityOf {
    /// Name.
    pub name: String,
    /// Median, SI.
    pub median: f64,
    /// Equal-tailed 95 % interval, SI.
    pub eti95: [f64; 2],
    /// Mean in the prior's coordinate.
    pub mean: f64,
    /// Standard deviation in the prior's coordinate.
    pub sd: f64,
    /// Mean minus that of the run, in standard deviations of the run.
    pub shift: f64,
    /// Standard deviation over that of the run.
    pub widening: f64,
}
