//! Weighted samples of one quantity: quantiles, intervals, moments.
//!
//! # Definition
//! With the samples in ascending order, weights w_i and W their sum, sample i stands at the probability
//! `(w_1 + .. + w_(i-1) + w_i / 2) / W`, the middle of its own weight. The p-quantile is linear between the two samples
//! around p, and the first or the last sample beyond them. Equal weights put sample i of n at (i - 1/2)/n (type 5 of
//! R. J. Hyndman, Y. Fan, "Sample quantiles in statistical packages", Am. Stat. 50 (1996) 361).

use serde::{Deserialize, Serialize};

/// Weighted samples in ascending order with their cumulative weights; samples that are not finite and zero weights are
/// left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighted {
    values: Vec<f64>,
    cumulative: Vec<f64>,
}

impl Weighted {
    /// Sorts samples by value; ties keep their order.
    pub fn new(samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut samples: Vec<(f64, f64)> = samples
            .into_iter()
            .filter(|(value, weight)| value.is_finite() && *weight > 0.0)
            .collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut total = 0.0;
        let cumulative = samples
            .iter()
            .map(|(_, weight)| {
                total += weight;
                total
            })
            .collect();
        Self { values: samples.into_iter().map(|(value, _)| value).collect(), cumulative }
    }

    /// Samples of weight one.
    pub fn equal(mut values: Vec<f64>) -> Self {
        values.retain(|value| value.is_finite());
        values.sort_unstable_by(f64::total_cmp);
        let cumulative = (1..=values.len()).map(|count| count as f64).collect();
        Self { values, cumulative }
    }

    /// The p-quantile; NaN without samples.
    pub fn quantile(&self, p: f64) -> f64 {
        self.at_weight(p * self.total())
    }

    /// The value at which the running weight is `target`, in the unit of the weights.
    pub(crate) fn at_weight(&self, target: f64) -> f64 {
        let Some(last) = self.values.len().checked_sub(1) else { return f64::NAN };
        let middle = |i: usize| {
            let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
            0.5 * (before + self.cumulative[i])
        };
        let mut range = 0..self.values.len();
        while !range.is_empty() {
            let mid = range.start + range.len() / 2;
            if middle(mid) <= target { range.start = mid + 1 } else { range.end = mid }
        }
        match range.start {
            0 => self.values[0],
            i if i > last => self.values[last],
            i => {
                let (below, above) = (middle(i - 1), middle(i));
                let share = (target - below) / (above - below);
                self.values[i - 1] + share * (self.values[i] - self.values[i - 1])
            }
        }
    }

    /// The equal-tailed interval that holds a share of the weight.
    pub fn interval(&self, share: f64) -> [f64; 2] {
        let tail = 0.5 * (1.0 - share);
        [self.quantile(tail), self.quantile(1.0 - tail)]
    }

    /// Share of the weight below a value, that of equal samples counted half; NaN without samples.
    pub fn share_below(&self, value: f64) -> f64 {
        let Some(&total) = self.cumulative.last() else {
            return f64::NAN;
        };
        let up_to = |count: usize| if count == 0 { 0.0 } else { self.cumulative[count - 1] };
        let below = self.values.partition_point(|v| *v < value);
        let equal = self.values.partition_point(|v| *v <= value);
        0.5 * (up_to(below) + up_to(equal)) / total
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Mean and standard deviation; NaN without samples.
    pub fn moments(&self) -> (f64, f64) {
        let Some(&total) = self.cumulative.last() else {
            return (f64::NAN, f64::NAN);
        };
        let weights = self
            .cumulative
            .iter()
            .scan(0.0, |before, &up_to| Some(up_to - std::mem::replace(before, up_to)));
        let pairs = || self.values.iter().zip(weights.clone());
        let mean = pairs().map(|(v, w)| v * w).sum::<f64>() / total;
        let variance = pairs().map(|(v, w)| (v - mean) * (v - mean) * w).sum::<f64>() / total;
        (mean, variance.sqrt())
    }
}

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
    /// Parameters of a draw in SI: those of its sample, [`estimated`](Sample::estimated).
    pub fn theta(&self, draw: &Draw) -> &[f64] {
        self.samples[draw.sample].estimated()
    }
}

/// One equally weighted posterior draw.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Index into `samples`.
    pub sample: usize,
    /// Noise standard deviation; none where the noise is fixed per point or tuned, or there are several.
    pub sigma: Option<f64>,
    /// What the noise has beside its standard deviation; none where it has nothing, or there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<NoiseShape>,
}

impl Draw {
    /// The noise; none where it is fixed per point or tuned, or there are several.
    pub fn noise(&self) -> Option<NoiseDraw> {
        Some(NoiseDraw { sigma: self.sigma?, shape: self.shape })
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
    /// fewer than [`HELD_AGAINST_PROCESS`](crate::trust::limits::HELD_AGAINST_PROCESS) effective ones.
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

/// Effective sample size.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EffectiveSampleSize {
    /// Of the importance weights: (sum w)^2 / sum w^2.
    pub importance: f64,
    /// The same per simulation.
    pub per_simulation: f64,
    /// Independent draws of a normal posterior that know mean, sd, median and 95 % interval as well as their standard errors say, the
    /// fewest over the parameters, where a Gaussian process knows more than the weights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_errors: Option<f64>,
}

/// For one order of samples under many sets of weights, where sorting each time would take too long: the first sample, in
/// the given ascending order, at which the running weight reaches each of some ascending shares of the total; without
/// interpolation. NaN without samples.
pub(crate) fn steps<const N: usize>(
    x: &[f64],
    weights: &[f64],
    order: &[u32],
    total: f64,
    shares: [f64; N],
) -> [f64; N] {
    let last = order.last().map_or(f64::NAN, |i| x[*i as usize]);
    // Rounding may leave the last ones open.
    let mut found = [last; N];
    let (mut sum, mut next) = (0.0, 0);
    for i in order {
        sum += weights[*i as usize];
        while next < N && sum >= shares[next] * total {
            found[next] = x[*i as usize];
            next += 1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_weights_give_the_textbook_quantiles() {
        let w = Weighted::new((1..=4).map(|k| (f64::from(k), 1.0)));
        assert_eq!(w.quantile(0.5), 2.5);
        assert_eq!(w.quantile(0.0), 1.0);
        assert_eq!(w.quantile(1.0), 4.0);
        assert_eq!(w.quantile(0.375), 2.0);
        assert_eq!(w, Weighted::equal(vec![3.0, 1.0, 4.0, 2.0]));
        assert_eq!(w.share_below(2.0), 0.375);
        let (mean, sd) = w.moments();
        assert_eq!(mean, 2.5);
        assert!((sd - 1.25f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn a_sample_of_weight_two_counts_as_two_samples() {
        let twice = Weighted::new([(1.0, 1.0), (2.0, 1.0), (2.0, 1.0), (5.0, 1.0)]);
        let heavy = Weighted::new([(1.0, 1.0), (2.0, 2.0), (5.0, 1.0)]);
        assert_eq!(twice.moments(), heavy.moments());
        assert_eq!(twice.quantile(0.5), heavy.quantile(0.5));
    }

    #[test]
    fn zero_weights_and_nan_are_left_out_and_nothing_gives_nan() {
        assert!(Weighted::new([(1.0, 0.0), (f64::NAN, 1.0)]).quantile(0.5).is_nan());
    }

    #[test]
    fn steps_are_the_first_samples_that_reach_a_share_of_the_weight() {
        let (x, w) = ([3.0, 1.0, 2.0], [0.5, 0.2, 0.3]);
        // What rounding leaves open is the last one.
        let shares = [0.1, 0.2, 0.21, 0.5, 1.0, 1.0 + 1e-15];
        assert_eq!(steps(&x, &w, &[1, 2, 0], 1.0, shares), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    }
}
