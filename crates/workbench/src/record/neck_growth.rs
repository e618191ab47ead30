//! Results of a pair of particles: Table 3, the knee, the product, the curves of the fit plot.

use dem_core::Kinetics;
use serde::{Deserialize, Serialize};

use super::{Doubt, FitError};

/// Results of a pair of particles.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckGrowthRecord {
    /// The parameters in the form printed in Table 3, for a powder of the paper and kinetics with all three.
    pub printed: Vec<PrintedParameter>,
    /// The paper's parameters for this material and where they fall in the posterior.
    pub paper: Option<PaperComparison>,
    /// The one combination of c1 and delta_c that the data inform, for kinetics that do not separate them.
    pub product: Option<ProductSummary>,
    /// How well four curves fit the measurements.
    pub fit: Fit,
    /// Where stage 2 gives way to stage 3, for kinetics with a knee.
    pub knee: Option<KneeSummary>,
    /// Contact ratio at which the pair stops growing because it has cooled, where its heat ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub freezes_at: Option<Derived>,
    /// Posterior predictive bands on a fine grid of times, with the curves of the fit plot.
    pub curves: Curves,
    /// Reasons to suspect the clock of the table, or the priors, before the measurements and the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
    /// What other kinetics are worth beside those that were used, by evidence; empty where that was not looked at.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other_kinetics: Vec<OtherKinetics>,
}

/// Other kinetics with the same noise and priors, from few simulations.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OtherKinetics {
    /// The kinetics.
    pub kinetics: Kinetics,
    /// Their log evidence minus that of the kinetics that were used.
    pub ln_bayes_factor: f64,
    /// Its standard error.
    pub ln_bayes_factor_se: f64,
    /// Whether the simulations were enough to judge them.
    #[serde(default)]
    pub judged: bool,
    /// Whether they fit as well or better: ln K above -1, by more than two standard errors.
    pub fits_as_well: bool,
    /// Posterior median of tau_s under them \[s\].
    pub tau_s_median: f64,
    /// Its equal-tailed 95 % interval.
    pub tau_s_eti95: [f64; 2],
    /// Whether that interval has nothing in common with the one under the kinetics that were used.
    pub tau_s_disjoint: bool,
}

/// A parameter in the form printed in Table 3.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrintedParameter {
    /// `c1`, `tau_s` or `delta_c`.
    pub name: String,
    /// The unit that Table 3 prints.
    pub unit: String,
    /// Maximum a posteriori, through the map.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Mean and standard deviation of log10.
    pub mean_log10: f64,
    /// Standard deviation of log10.
    pub sd_log10: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// Value that the paper prints.
    pub paper: Option<f64>,
    /// Posterior probability of a smaller value, in percent.
    pub paper_percentile: Option<f64>,
}

/// The product c1 delta_c^2, all that the `regime-map` kinetics see of the two.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProductSummary {
    /// `c1 * delta_c^2`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// At the MAP.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// Mean of log10.
    pub mean_log10: f64,
    /// Standard deviation of log10.
    pub sd_log10: f64,
    /// Divergence of its posterior from its prior \[bits\].
    pub information_gain_bits: f64,
    /// With the paper's parameters.
    pub paper: Option<f64>,
    /// Posterior probability of a smaller value, in percent.
    pub paper_percentile: Option<f64>,
}

/// The paper's parameters.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperComparison {
    /// As printed: c1, tau_s, delta_c.
    pub printed: [f64; 3],
    /// In SI, through the map: c1, tau_s, delta_c.
    pub si: [f64; 3],
    /// Posterior probability of a smaller SI value, in percent, per calibrated parameter; none for one that
    /// the paper does not have.
    pub percentile_si: Vec<Option<f64>>,
}

/// How well four curves fit.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// The MAP curve.
    pub map: FitError,
    /// The posterior mean curve.
    pub posterior_mean: FitError,
    /// The paper's parameters, through the map of Table 3.
    pub paper: Option<FitError>,
    /// The best Frenkel curve (least squares in tau_s); none without an observation after t = 0.
    pub frenkel: Option<FitError>,
    /// Its tau_s \[s\].
    pub frenkel_tau_s: Option<f64>,
}

/// A derived quantity under the posterior.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Derived {
    /// At the MAP.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// With the paper's parameters.
    pub paper: Option<f64>,
}

/// The knee between zipping and stretching.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KneeSummary {
    /// Posterior probability that there is one between the starting and the final contact. The rest is
    /// conditional on it.
    pub probability: f64,
    /// Contact ratio a_ve/R.
    pub contact_ratio: Derived,
    /// When it is reached \[s\].
    pub time_s: Derived,
}

/// Curves on a fine grid of times, all of the same length.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// Times \[s\].
    pub time_s: Vec<f64>,
    /// Posterior mean of the curve.
    pub mean: Vec<f64>,
    /// 50 % band of the curve: lower, upper.
    pub curve50: [Vec<f64>; 2],
    /// 90 % band of the curve.
    pub curve90: [Vec<f64>; 2],
    /// 90 % band of a new measurement; none where the noise is stated row by row.
    pub noisy90: Option<[Vec<f64>; 2]>,
    /// MAP curve.
    pub map: Vec<f64>,
    /// The paper's curve.
    pub paper: Option<Vec<f64>>,
    /// The best Frenkel curve; none without an observation after t = 0.
    pub frenkel: Option<Vec<f64>>,
}
