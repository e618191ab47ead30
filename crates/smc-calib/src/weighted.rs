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

    /// Weight of the sample that the running weight is in at `target`; zero without samples.
    pub(crate) fn weight_at(&self, target: f64) -> f64 {
        let Some(last) = self.values.len().checked_sub(1) else { return 0.0 };
        let i = self.cumulative.partition_point(|sum| *sum < target).min(last);
        self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] }
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
    fn the_weight_at_a_running_weight_is_that_of_its_sample() {
        let samples = Weighted::new([(3.0, 0.5), (1.0, 0.2), (2.0, 0.3)]);
        let found = [0.0, 0.1, 0.3, 0.6, 2.0].map(|target| samples.weight_at(target));
        let exact = [0.2, 0.2, 0.3, 0.5, 0.5];
        assert!(found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        assert_eq!(Weighted::new([]).weight_at(0.5), 0.0);
    }

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
