//! Records of the stages of a run, as plain data.

use serde::{Deserialize, Serialize};

/// Record of one stage.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    /// Stage, from 0 (the prior).
    pub stage: usize,
    /// Whether this is the final, frozen proposal.
    pub last: bool,
    /// Simulations of this stage.
    pub simulations: usize,
    /// Simulations so far.
    pub total: usize,
    /// Failed simulations of this stage.
    pub failed: usize,
    /// Failed simulations so far.
    pub failed_total: usize,
    /// Power of the likelihood that this stage's proposal was fitted to; 0 for the prior.
    pub beta: f64,
    /// Effective sample size of all samples so far, at full likelihood.
    pub ess: f64,
    /// Log evidence so far.
    pub log_evidence: f64,
    /// Its standard error.
    pub log_evidence_se: f64,
    /// Pareto shape of the weights so far.
    pub khat: f64,
    /// Means of the parameters so far, in the priors' coordinates.
    pub means: Vec<f64>,
    /// Standard deviations of the parameters so far, in the priors' coordinates.
    pub sds: Vec<f64>,
    /// The proposal that this stage drew from, in normal scores.
    pub proposal: MixtureRecord,
}

/// A mixture of Student-t components in normal scores, beside a share of the prior.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MixtureRecord {
    /// Share of the prior (1 in the first stage).
    pub prior_share: f64,
    /// Components.
    pub components: Vec<ComponentRecord>,
}

/// One component of a proposal.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentRecord {
    /// Share of the draws.
    pub weight: f64,
    /// Centre, in normal scores.
    pub mean: Vec<f64>,
    /// Scale matrix, in normal scores, row by row.
    pub scale: Vec<Vec<f64>>,
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
}
