//! The result of a calibration, as plain data.

use crate::{
    Coordinate, Draw, EffectiveSampleSize, MovedBy, Noise, NoiseDraw, NoiseShape, Parameter, Point,
    Settings, ShapeSummary, SigmaSummary, StageRecord,
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
    /// Equally weighted draws: systematic resampling of `samples`, or of the Gaussian process that knows more than a few weights do.
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
    /// Effective sample size.
    pub ess: EffectiveSampleSize,
    /// Pareto shape of the importance weights: the largest over the weights and all parameters.
    pub khat: f64,
    /// The maximum a posteriori point.
    pub map: MapPoint,
    /// Posterior of the noise standard deviation; none where it is fixed per point or tuned, or there are several.
    pub sigma: Option<SigmaSummary>,
    /// Posterior of what the noise has beside its standard deviation; none where it has nothing, or there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_shape: Option<ShapeSummary>,
    /// Residuals of the MAP curve; of several groups, the tests of the group that fails them most clearly.
    pub residuals: Residuals,
    /// Posterior predictive bands at the observation points.
    pub predictive: Vec<BandPoint>,
    /// Recursive Bayes: the state of knowledge after each observation.
    pub path: Vec<PathPoint>,
    /// Records of the stages.
    pub stages: Vec<StageRecord>,
    /// Failed simulations by cause, commonest first.
    pub failures: Vec<Failure>,
    /// Where simulations fail, and what that means; none where none failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failing: Option<Failing>,
    /// Why the run ended.
    pub stop: StopReason,
    /// Work done.
    pub counters: Counters,
    /// One entry per group of observations; empty where there is one group, which `noise`, `sigma` and `residuals`
    /// describe.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupSummary>,
}

/// Results of one of several groups of observations.
///
/// Its observations are `first`, `first + 1`, .. of those that the posterior lists: in the curves, the bands, the path
/// and the residuals.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupSummary {
    /// Name.
    pub name: String,
    /// Noise model.
    pub noise: Noise,
    /// Its first observation.
    pub first: usize,
    /// Number of its observations.
    pub observations: usize,
    /// Its part of the log likelihood of the MAP.
    pub log_likelihood: f64,
    /// Posterior of its noise standard deviation; none where it is fixed point by point.
    pub sigma: Option<SigmaSummary>,
    /// Its noise standard deviation in each of the posterior's draws; empty where it is fixed point by point.
    pub sigma_draws: Vec<f64>,
    /// Posterior of what its noise has beside its standard deviation; none where it has nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_shape: Option<ShapeSummary>,
    /// The same in each of the posterior's draws; empty where it has nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shape_draws: Vec<NoiseShape>,
    /// Its residuals, of the MAP curve.
    pub residuals: Residuals,
    /// Whether replicated data are as far from their curves; none without draws, or where whole curves were not kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<PredictiveCheck>,
}

/// How often replicated data lie as far from their curve as the measurements do.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PredictiveCheck {
    /// Probability that replicated data are as far from the curve or farther, by the root mean square of their errors.
    pub as_far: f64,
    /// Probability that neighbouring errors of replicated data are as much alike or more, by their lag-1 correlation.
    pub as_alike: f64,
    /// Number of replicated data sets.
    pub replicated: usize,
}

impl GroupSummary {
    /// Its noise in draw `k`; none where it is fixed point by point.
    pub fn noise_draw(&self, k: usize) -> Option<NoiseDraw> {
        Some(NoiseDraw {
            sigma: *self.sigma_draws.get(k)?,
            shape: self.shape_draws.get(k).copied(),
        })
    }

    /// Places of its observations among those of all groups.
    pub fn places(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.observations
    }
}

/// One simulated sample.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Normal scores.
    pub z: Vec<f64>,
    /// Parameters in SI.
    pub theta: Vec<f64>,
    /// Log likelihood; none where the simulation failed.
    pub log_likelihood: Option<f64>,
    /// Log of the importance weight, prior times likelihood over the mixture of all proposals; none where it is zero.
    pub log_weight: Option<f64>,
    /// Normalised weight; in sum over the samples it gives the means and covariances of the result, which surrogates know better than
    /// the importance weights do. Of a small budget whose weights cannot give them, `parameters` are of samples that are moved to them.
    pub weight: f64,
    /// Parameters in SI where the sample was moved to; empty where samples stay where they were simulated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moved: Vec<f64>,
    /// Stage that drew it.
    pub stage: usize,
    /// Sub-net that it belongs to.
    pub replicate: usize,
}

impl Sample {
    /// Parameters in SI as the summaries have them: [`moved`](Self::moved), or [`theta`](Self::theta) where it was not moved.
    pub fn estimated(&self) -> &[f64] {
        if self.moved.is_empty() { &self.theta } else { &self.moved }
    }
}

impl Posterior {
    /// Parameters of one of its draws in SI: its own where a process drew it, or those of its sample, [`estimated`](Sample::estimated).
    pub fn theta<'a>(&'a self, draw: &'a Draw) -> &'a [f64] {
        if draw.theta.is_empty() { self.samples[draw.sample].estimated() } else { &draw.theta }
    }

    /// Parameters in SI with their shares of the posterior: draws of a process where there are any, else all samples that have weight.
    pub fn points(&self) -> impl Iterator<Item = Point<'_>> {
        let drawn = self.is_drawn();
        let share = 1.0 / self.draws.len() as f64;
        let draws = self.draws.iter().filter(move |_| drawn);
        let draws = draws.map(move |d| Point { theta: &d.theta, weight: share, replicate: None });
        let samples = self.samples.iter().filter(move |sample| !drawn && sample.weight > 0.0);
        draws.chain(samples.map(|sample| Point {
            theta: sample.estimated(),
            weight: sample.weight,
            replicate: Some(sample.replicate),
        }))
    }

    /// Whether draws are of a Gaussian process, not of the samples.
    pub fn is_drawn(&self) -> bool {
        let d = self.parameters.len();
        !self.draws.is_empty() && self.draws.iter().all(|draw| draw.theta.len() == d && d > 0)
    }
}

/// An interval and the standard errors of its ends.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
    /// Monte Carlo standard error of the lower end.
    pub lower_se: f64,
    /// Monte Carlo standard error of the upper end.
    pub upper_se: f64,
}

/// Moments and intervals of a marginal.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Mean.
    pub mean: f64,
    /// Monte Carlo standard error of the mean.
    pub mean_se: f64,
    /// Standard deviation.
    pub sd: f64,
    /// Monte Carlo standard error of the standard deviation.
    pub sd_se: f64,
    /// Median.
    pub median: f64,
    /// Monte Carlo standard error of the median.
    pub median_se: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: Interval,
    /// Equal-tailed 90 % interval.
    pub eti90: Interval,
    /// Equal-tailed 95 % interval.
    pub eti95: Interval,
    /// Shortest 50 % interval in the prior's coordinate: the highest-density one where the marginal has one peak.
    /// One interval is assumed; with two far peaks the region of highest density is two, and this one spans the gap.
    pub hdi50: Interval,
    /// Shortest 90 % interval in the prior's coordinate: the highest-density one where the marginal has one peak.
    /// One interval is assumed; with two far peaks the region of highest density is two, and this one spans the gap.
    pub hdi90: Interval,
    /// Shortest 95 % interval in the prior's coordinate: the highest-density one where the marginal has one peak.
    /// One interval is assumed; with two far peaks the region of highest density is two, and this one spans the gap.
    pub hdi95: Interval,
}

/// Summary of one parameter.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterSummary {
    /// Name, unit and prior.
    pub parameter: Parameter,
    /// The prior's coordinate.
    pub coordinate: Coordinate,
    /// Summary in that coordinate.
    pub in_coordinate: Moments,
    /// Summary in SI.
    pub in_si: Moments,
    /// Maximum a posteriori value, in SI.
    pub map: f64,
    /// Pareto shape for this parameter's moments.
    pub khat: f64,
    /// Largest share of the weights, or of this parameter's moments, that a heavy tail has above its cut; 0 where no tail is
    /// heavy.
    #[serde(default)]
    pub tail_share: f64,
    /// Information gained: divergence of the marginal posterior from the prior, in bits.
    pub information_gain_bits: f64,
    /// Prior mean in the coordinate.
    pub prior_mean: f64,
    /// Prior standard deviation in the coordinate.
    pub prior_sd: f64,
}

/// Log evidence: natural log of the probability of the data under the model.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// From the final stage, drawn from one frozen proposal, with surrogates fitted to other samples as control
    /// variate; without them where they are of no use. From all samples with few simulations and with more than six
    /// parameters, and where the run ended before its final stage or that stage's error is more than 1.5 times theirs.
    /// Where a Gaussian process places the samples, what it predicts of all integrals has the share that its errors give it.
    pub value: f64,
    /// Its standard error.
    pub se: f64,
    /// From the last stage's plain weights (with few simulations, those of the last stages), whose mean (of the evidence, not its
    /// log) is exact.
    pub frozen_value: f64,
    /// Its standard error.
    pub frozen_se: f64,
    /// From all samples, weighted by the mixture of all proposals: low by up to a standard error or two, because each
    /// proposal was fitted to samples that the next ones are averaged with.
    pub pooled_value: f64,
    /// Its standard error.
    pub pooled_se: f64,
    /// Whether those two agree within three standard errors.
    pub agree: bool,
    /// By the likelihood that the process through the samples predicts, without weights, where a process places samples and came to
    /// fewer than [`HELD_AGAINST_PROCESS`](crate::trust::limits::HELD_AGAINST_PROCESS) effective ones, or to weights with a heavy tail.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process_value: Option<f64>,
    /// Same, by the mean of that likelihood over the errors of a process through curves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process_mean: Option<f64>,
    /// Beside those two, where the estimates are held to integrals by surrogates: from samples, each with surrogates through the others
    /// alone, before the integrals of a process through all had a share.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cross_fitted_value: Option<f64>,
}

/// Where simulations fail, and what that means for posterior and evidence, in which they count as likelihood zero.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failing {
    /// Failed simulations.
    pub failed: usize,
    /// All simulations.
    pub simulations: usize,
    /// Chance that failures lie as much together as these where failing does not depend on the parameters: a permutation
    /// test on the failed among the five nearest neighbours of each failed sample.
    pub p_value: f64,
    /// Estimated share of the posterior in the failed samples, if they had the likelihood that a Gaussian process through
    /// those of the others predicts for them.
    pub mass: f64,
    /// Where they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<FailingPlace>,
    /// Log evidence if failures are random: that with failures as likelihood zero, less ln(1 - share of failures).
    pub log_evidence_if_random: f64,
    /// Its standard error, with that of the share.
    pub log_evidence_if_random_se: f64,
}

impl Failing {
    /// Whether failing depends on the parameters.
    pub fn depends(&self) -> bool {
        self.p_value < crate::trust::limits::FAILING_CHANCE
    }

    /// Whether it cuts the posterior off.
    pub fn matters(&self) -> bool {
        self.depends() && self.mass > crate::trust::limits::FAILING_MASS
    }
}

/// The parameter that tells failed simulations from finished ones best.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailingPlace {
    /// Its name.
    pub parameter: String,
    /// 5 % of the failed simulations lie below (SI).
    pub lower: f64,
    /// 5 % of the failed simulations lie above (SI).
    pub upper: f64,
    /// Ends of twenty bins over all simulations, equally wide in the prior's coordinate (SI).
    pub edges: Vec<f64>,
    /// Finished simulations in each bin.
    pub finished: Vec<usize>,
    /// Failed simulations in each bin.
    pub failed: Vec<usize>,
    /// Share of the posterior in each bin.
    pub posterior: Vec<f64>,
}

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
