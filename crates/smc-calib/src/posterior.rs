//! The result of a calibration, as plain data.

use crate::{
    Coordinate, EffectiveSampleSize, MovedBy, Noise, NoiseDraw, NoiseShape, Parameter, Settings,
    ShapeSummary, SigmaSummary, StageRecord,
};
use serde::{Deserialize, Serialize};

/// Everything a calibration reports.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// False for tuned weights (`ess-target`), which are no posterior.
    pub is_posterior: bool,
    /// Noise model; of several groups of observations, the first one's.
    pub noise: Noise,
    /// Settings of the run.
    pub settings: Settings,
    /// Every simulated sample, in the order drawn.
    pub samples: Vec<Sample>,
    /// Equally weighted draws: systematic resampling of `samples`.
    pub draws: Vec<Draw>,
    /// One summary per parameter.
    pub parameters: Vec<ParameterSummary>,
    /// How far the samples are from the moments in `parameters` and correlations; none where these are of the samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved: Option<MovedBy>,
    /// Correlation matrix in the priors' coordinates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Correlation matrix in SI.
    pub correlation_si: Vec<Vec<f64>>,
    /// Log evidence.
    pub log_evidence: Evidence,
    /// The maximum a posteriori point, of the density in the priors' coordinates.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapPoint {
    /// Parameters in SI.
    pub theta: Vec<f64>,
    /// Log likelihood.
    pub log_likelihood: f64,
    /// Log density, likelihood times prior in the coordinates.
    pub log_density: f64,
    /// The simulated curve.
    pub outputs: Vec<f64>,
    /// Simulations of the local search.
    pub simulations: usize,
}

/// Residuals, observed minus simulated, of the MAP curve and their independence.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Residuals {
    /// Observed minus simulated.
    pub values: Vec<f64>,
    /// Residuals as a noise model with correlation or outliers sees them: independent, of variance 1 where it holds. The
    /// tests are then of these.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub whitened: Vec<f64>,
    /// Lag-1 autocorrelation.
    pub lag1: f64,
    /// z-score of the number of runs of equal sign; negative for too few.
    pub runs_z: f64,
    /// Whether both tests pass, at 5 % for the two together.
    pub independent: bool,
    /// Root mean square of the residuals over the expected noise: s0 where sigma is inferred, sigma where it is fixed; none
    /// for tuned noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub misfit: Option<f64>,
}

/// Posterior predictive distribution at one point of a curve.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BandPoint {
    /// Index of the point.
    pub index: usize,
    /// Control value (time).
    pub control: f64,
    /// Posterior mean of the curve.
    pub mean: f64,
    /// 50 % band of the curve.
    pub curve50: [f64; 2],
    /// 90 % band of the curve.
    pub curve90: [f64; 2],
    /// 95 % band of the curve.
    pub curve95: [f64; 2],
    /// 50 % band of a new observation, noise included.
    pub noisy50: [f64; 2],
    /// 90 % band of a new observation, noise included.
    pub noisy90: [f64; 2],
    /// 95 % band of a new observation, noise included.
    pub noisy95: [f64; 2],
}

/// State of knowledge after one observation.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathPoint {
    /// Observation, from 0.
    pub index: usize,
    /// Control value (time).
    pub control: f64,
    /// Effective sample size of the weights after it.
    pub ess: f64,
    /// Log evidence of the observations so far.
    pub log_evidence: f64,
    /// One entry per parameter, in its prior's coordinate.
    pub parameters: Vec<PathParameter>,
}

/// Posterior of one parameter after one observation, in its prior's coordinate.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PathParameter {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Median.
    pub median: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
}

/// Failed simulations of one cause.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Failure {
    /// The cause, in the simulator's words.
    pub cause: String,
    /// Number of them.
    pub count: usize,
}

/// Why a run ended.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum StopReason {
    /// The budget was spent.
    BudgetSpent,
    /// The wished-for effective sample size was reached.
    EssReached,
    /// The wished-for accuracy of the means was reached.
    AccuracyReached,
    /// The observer asked to stop.
    Interrupted,
}

/// Work done.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Simulations of the sampler.
    pub simulations: usize,
    /// Simulations of the local search for the MAP.
    pub map_simulations: usize,
    /// EM iterations over all mixture fits.
    pub em_iterations: usize,
    /// Mixtures fitted.
    pub mixtures_fitted: usize,
    /// Evaluations of one component's density at one sample.
    pub component_densities: usize,
}
