//! Several models over one series of measurements, with their residuals.

use super::Role;

/// One model of a [`CompareFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCurve {
    /// Name in the legend.
    pub name: String,
    /// What decides its colour and dash: the same model gets the same role in every figure.
    pub role: Role,
    /// Model at the grid times (a/R).
    pub curve: Vec<f64>,
    /// Model at the times of the measurements (a/R), for the residuals.
    pub at_data: Vec<f64>,
}

/// MAP curves of several models over the data, and residuals below.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CompareFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the measurements [s].
    pub time_s: Vec<f64>,
    /// Measured contact ratios a/R, one per time.
    pub contact_ratio: Vec<f64>,
    /// Times of the curves [s], increasing.
    pub grid_s: Vec<f64>,
    /// The models, in the order of the legend.
    pub curves: Vec<NamedCurve>,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}
