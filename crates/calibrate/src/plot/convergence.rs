//! Convergence of the sampler, stage by stage.

/// One stage of the sampler.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ConvergenceStage {
    /// Simulations spent so far, this stage included.
    pub simulations: f64,
    /// Tempering exponent, 0 to 1.
    pub beta: f64,
    /// Effective sample size of the pool.
    pub ess: f64,
    /// Log evidence (natural logarithm).
    pub log_evidence: f64,
    /// Standard error of the log evidence (NaN if unknown).
    pub log_evidence_error: f64,
    /// Components of the mixture that proposed.
    pub components: f64,
    /// Pareto k-hat of the weights (NaN if unknown).
    pub k_hat: f64,
}

/// Tempering exponent, effective sample size, log evidence, components and k-hat per stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ConvergenceFigure {
    /// Heading; empty for none.
    pub title: String,
    /// The stages in order.
    pub stages: Vec<ConvergenceStage>,
    /// k-hat above which weights are not to be trusted (0.7), drawn as a line.
    pub k_hat_limit: f64,
    /// Effective sample size asked for, drawn as a line.
    pub ess_target: Option<f64>,
}
