//! Recursive Bayes: what is known of each parameter after each observation.

use super::Band;

/// One parameter of a [`RecursionFigure`], after each observation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionParameter {
    /// Symbol, for example `τ_{s}`.
    pub symbol: String,
    /// Unit; empty for a pure number.
    pub unit: String,
    /// True if all values are log10 of the parameter: the axis is then labelled with the parameter itself.
    pub log10: bool,
    /// Posterior median after each observation.
    pub median: Vec<f64>,
    /// Central 50 % interval after each observation.
    pub interval50: Band,
    /// Central 95 % interval after each observation.
    pub interval95: Band,
    /// The paper's value.
    pub paper: Option<f64>,
}

/// Medians and intervals of the parameters and the effective sample size against the control value (time).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecursionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the control, for example `time t`.
    pub control_name: String,
    /// Unit of the control, for example `s`.
    pub control_unit: String,
    /// Control value of each observation, in the order of assimilation.
    pub control: Vec<f64>,
    /// Logarithmic control axis.
    pub log_control: bool,
    /// The parameters, up to five.
    pub parameters: Vec<RecursionParameter>,
    /// Effective sample size after each observation.
    pub ess: Vec<f64>,
}
