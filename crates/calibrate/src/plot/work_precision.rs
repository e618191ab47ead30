//! Work against precision, both logarithmic.

use super::{Band, Role};

/// One method of a [`WorkPrecisionFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct WorkPrecisionSeries {
    /// Name in the legend.
    pub name: String,
    /// What decides its colour, dash and marker.
    pub role: Role,
    /// Work, positive.
    pub cost: Vec<f64>,
    /// Error, positive, one per cost.
    pub error: Vec<f64>,
    /// Interval of the error at each cost; empty for none.
    pub band: Band,
}

/// Error against cost of several methods, with a guide line of a given slope.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorkPrecisionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// What the cost is, for example `simulations`.
    pub cost_name: String,
    /// Unit of the cost; empty for a count.
    pub cost_unit: String,
    /// What the error is.
    pub error_name: String,
    /// Unit of the error; empty for a pure number.
    pub error_unit: String,
    /// The methods, in the order of the legend.
    pub series: Vec<WorkPrecisionSeries>,
    /// Slope of a guide line in the log-log plane, for example -0.5.
    pub guide_slope: Option<f64>,
}
