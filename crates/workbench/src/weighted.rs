//! Quantiles of weighted samples.

/// Weighted samples in ascending order with their cumulative weights; non-finite samples and zero weights are left
/// out.
#[derive(Debug, Clone, PartialEq)]
pub struct Weighted {
    values: Vec<f64>,
    cumulative: Vec<f64>,
}

impl Weighted {
    /// Sorts samples by value; ties keep their order.
    #[must_use]
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

    /// The p-quantile, linear between the midpoints of neighbouring weights; NaN without samples.
    #[must_use]
    pub fn quantile(&self, p: f64) -> f64 {
        let Some(&total) = self.cumulative.last() else {
            return f64::NAN;
        };
        let target = p * total;
        let middle = |i: usize| {
            let before = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
            0.5 * (before + self.cumulative[i])
        };
        let after = {
            let mut range = 0..self.values.len();
            while !range.is_empty() {
                let mid = range.start + range.len() / 2;
                if middle(mid) < target { range.start = mid + 1 } else { range.end = mid }
            }
            range.start
        };
        match after {
            0 => self.values[0],
            i if i == self.values.len() => self.values[i - 1],
            i => {
                let (below, above) = (middle(i - 1), middle(i));
                let share = (target - below) / (above - below);
                self.values[i - 1] + share * (self.values[i] - self.values[i - 1])
            }
        }
    }

    /// The interval between two quantiles, equally far from both ends.
    #[must_use]
    pub fn interval(&self, probability: f64) -> [f64; 2] {
        let tail = 0.5 * (1.0 - probability);
        [self.quantile(tail), self.quantile(1.0 - tail)]
    }

    /// Share of the weight below a value, that of equal samples counted half.
    #[must_use]
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
    #[must_use]
    pub fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Mean and standard deviation.
    #[must_use]
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
}
