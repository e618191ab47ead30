//! What a population was found to be.

use serde::{Deserialize, Serialize};
use smc_calib::{Moments, Weighted};

use crate::plan::PairPlan;

/// The posterior of a population: mean, spread and correlation of the parameters, its members, and its next one. Parameters are in
/// their coordinates (log10 or linear, as `parameters` says), tau_s at the radius of the plan.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PopulationRecord {
    /// Mean of each parameter over the population.
    pub mean: Vec<Moments>,
    /// Standard deviation of each parameter between members.
    pub spread: Vec<Moments>,
    /// Correlations below the diagonal, row by row; empty where they were left out.
    pub correlation: Vec<Moments>,
    /// The members, in the order of the plan's runs.
    pub members: Vec<MemberRecord>,
    /// The next pair of particles, where every run is of one pair.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<NextPair>,
}

/// A member of a population.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberRecord {
    /// Name of its calibration.
    pub name: String,
    /// Log evidence of its calibration.
    pub log_evidence: f64,
    /// Factor that moved its tau_s to the radius of the population.
    pub tau_s_factor: f64,
    /// Effective number of its samples behind the likelihood of a population: median over the posterior.
    pub effective: f64,
    /// The same: 5 % of the posterior have fewer.
    pub effective_least: f64,
    /// Share of the posterior in which a density fitted to its likelihood stood in for too few samples.
    pub fitted: f64,
    /// Share of the population beyond the support of its prior, parameter by parameter.
    pub outside: Vec<f64>,
    /// Its parameters by its own measurements alone.
    pub alone: Vec<Marginal>,
    /// Its parameters as a member of the population.
    pub shrunk: Vec<Marginal>,
}

/// A distribution in a coordinate.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Marginal {
    /// Median.
    pub median: f64,
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
    /// The quantiles of 0.5 %, 1.5 %, .. 99.5 %.
    pub quantiles: Vec<f64>,
}

impl Marginal {
    /// Number of quantiles.
    pub const QUANTILES: usize = 100;

    /// Of weighted values.
    pub fn of(values: &Weighted) -> Self {
        let quantile = |k: usize| values.quantile((k as f64 + 0.5) / Self::QUANTILES as f64);
        Self {
            median: values.quantile(0.5),
            eti90: values.interval(0.9),
            quantiles: (0..Self::QUANTILES).map(quantile).collect(),
        }
    }
}

/// The next pair of a population.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NextPair {
    /// The pair, at the radius of the population.
    pub pair: PairPlan,
    /// Times of all measured pairs \[s\], one pair after the other.
    pub control: Vec<f64>,
    /// What was measured there.
    pub values: Vec<f64>,
    /// Times of the curves \[s\].
    pub time_s: Vec<f64>,
    /// Mean over the next pairs.
    pub mean: Vec<f64>,
    /// 50 % band: lower, upper.
    pub curve50: [Vec<f64>; 2],
    /// 90 % band.
    pub curve90: [Vec<f64>; 2],
}
