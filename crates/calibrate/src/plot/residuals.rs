//! Residuals: is what the model leaves over noise?

/// Residuals against time, their autocorrelation, and their normal quantiles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidualsFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the measurements [s], increasing.
    pub time_s: Vec<f64>,
    /// Measurement minus model (a/R), one per time.
    pub residual: Vec<f64>,
    /// Standard deviation of the noise (a/R): the band is twice that to both sides.
    pub sigma: f64,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}
