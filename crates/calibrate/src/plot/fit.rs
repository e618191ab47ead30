//! The fit: measurements, what the posterior predicts, and the curves it is compared with.

use super::Band;

/// Where zipping hands over to stretching: the contact ratio a_ve/R, with a central interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knee {
    /// Median, or any other point estimate.
    pub ratio: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

/// Neck growth: data, posterior predictive mean and bands, MAP curve, the paper's curve and the best Frenkel curve.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitFigure {
    /// Heading, for example the material; empty for none.
    pub title: String,
    /// Times of the measurements [s].
    pub time_s: Vec<f64>,
    /// Measured contact ratios a/R, one per time.
    pub contact_ratio: Vec<f64>,
    /// Times at which the curves are given [s], increasing.
    pub grid_s: Vec<f64>,
    /// Posterior mean of the curve, one per grid time (empty: not drawn, as for every curve and band here).
    pub mean: Vec<f64>,
    /// Central 50 % of the curve under the posterior.
    pub band50: Band,
    /// Central 90 % of the curve under the posterior.
    pub band90: Band,
    /// Central 90 % of a new measurement: the curve with noise.
    pub predictive90: Band,
    /// Curve of the maximum a posteriori.
    pub map: Vec<f64>,
    /// Curve of the paper's parameters.
    pub paper: Vec<f64>,
    /// Best Frenkel curve.
    pub frenkel: Vec<f64>,
    /// Knee of our posterior.
    pub knee: Option<Knee>,
    /// Knee of the paper's parameters, a_ve/R.
    pub paper_knee: Option<f64>,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}
