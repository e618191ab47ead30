//! Summaries of one weighted marginal.

use crate::estimate::{Below, Estimator};
use crate::normal;
use crate::weighted::Weighted;
use crate::{Coordinate, Interval, Moments};

/// One coordinate of the samples, by the weights of an estimator.
pub(crate) struct Marginal<'a> {
    x: &'a [f64],
    estimator: &'a Estimator,
    /// Samples whose weight counts, each with its share of the total.
    shares: Weighted,
    /// What is known of it beyond the samples, and its range.
    below: Option<(&'a Below, [f64; 2])>,
}

impl<'a> Marginal<'a> {
    pub(crate) fn new(x: &'a [f64], estimator: &'a Estimator) -> Self {
        let largest = estimator.weights.iter().copied().fold(0.0, f64::max);
        let mut alive: Vec<(f64, f64)> = x
            .iter()
            .zip(&estimator.weights)
            .filter(|(_, w)| **w > 1e-20 * largest)
            .map(|(x, w)| (*x, *w))
            .collect();
        alive.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = alive.iter().map(|(_, w)| w).sum();
        let shares = Weighted::new(alive.into_iter().map(|(x, w)| (x, w / total)));
        Self { x, estimator, shares, below: None }
    }

    /// With what is known beyond the samples, if anything is, and the range of the prior.
    pub(crate) fn known_by(self, below: Option<&'a Below>, range: [f64; 2]) -> Self {
        Self { below: below.map(|below| (below, range)), ..self }
    }

    /// The p-quantile.
    pub(crate) fn quantile(&self, p: f64) -> f64 {
        match self.below {
            Some((below, range)) => below.quantile(p, range),
            None => self.shares.at_weight(p),
        }
    }

    /// Standard error of the quantile `q` at probability `p`: standard error of the share below q, divided by the density
    /// about q, over as much of it as that error.
    fn quantile_error(&self, p: f64, q: f64) -> f64 {
        // What ends at the end of the prior is not known without error.
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        let at = |p: f64| match self.below {
            Some((below, _)) => below.quantile(p, everywhere),
            None => self.quantile(p),
        };
        let x = self.x;
        let of_share = self.below.map(|(below, _)| below.error(p)).unwrap_or_else(|| {
            let se = self.estimator.standard_error(|i| f64::from(u8::from(x[i] <= q)) - p);
            // No share is known better than to the weight of the sample there.
            let least = self.shares.weight_at(p);
            if se < least { least } else { se }
        });
        // The density is that from half of the tail to half as much again, or further where its share is not known to that.
        let outer = p.min(1.0 - p);
        let h = of_share.max(0.05f64.min(0.4 * outer));
        let (from, to) = ((p - h).max(0.04 * outer), (p + h).min(1.0 - 0.04 * outer));
        of_share * (at(to) - at(from)) / (to - from)
    }

    fn equal_tailed(&self, share: f64) -> Interval {
        let (p, r) = (0.5 * (1.0 - share), 0.5 * (1.0 + share));
        let (lower, upper) = (self.quantile(p), self.quantile(r));
        Interval {
            lower,
            upper,
            lower_se: self.quantile_error(p, lower),
            upper_se: self.quantile_error(r, upper),
        }
    }

    /// The shortest interval that holds the share: the highest-density one of a density with one peak.
    fn highest_density(&self, share: f64) -> Interval {
        // Between quantiles a two-hundredth apart; a finer search follows the noise of single samples.
        let steps = 200;
        let slack = 1.0 - share;
        let length = |p: f64| self.quantile(p + share) - self.quantile(p);
        let mut best = (f64::INFINITY, 0.0);
        for k in 0..=steps {
            let p = slack * f64::from(k) / f64::from(steps);
            let l = length(p);
            if l < best.0 {
                best = (l, p);
            }
        }
        let p = best.1;
        let (lower, upper) = (self.quantile(p), self.quantile(p + share));
        let clamp = |p: f64| p.clamp(1e-3, 1.0 - 1e-3);
        Interval {
            lower,
            upper,
            lower_se: self.quantile_error(clamp(p), lower),
            upper_se: self.quantile_error(clamp(p + share), upper),
        }
    }

    /// Moments, median and intervals.
    pub(crate) fn moments(&self) -> Moments {
        let (x, e) = (self.x, self.estimator);
        let (mean, mean_se, sd, sd_se) = mean_and_sd(x, e);
        let median = self.quantile(0.5);
        Moments {
            mean,
            mean_se,
            sd,
            sd_se,
            median,
            median_se: self.quantile_error(0.5, median),
            eti50: self.equal_tailed(0.5),
            eti90: self.equal_tailed(0.9),
            eti95: self.equal_tailed(0.95),
            hdi50: self.highest_density(0.5),
            hdi90: self.highest_density(0.9),
            hdi95: self.highest_density(0.95),
        }
    }

    /// Divergence of this marginal, given in normal scores, from the standard normal [bits].
    ///
    /// Sum over 64 bins of equal posterior mass and two of 0.05 % at the ends: a lower bound that a finer
    /// binning raises by little. Bins that lie in one sample belong to the next one outwards.
    pub(crate) fn information_gain_bits(&self) -> f64 {
        let end = 5e-4;
        let bins = 64;
        let mut edges = vec![f64::NEG_INFINITY];
        edges.extend(
            (0..=bins)
                .map(|k| self.quantile(end + (1.0 - 2.0 * end) * f64::from(k) / f64::from(bins))),
        );
        edges.push(f64::INFINITY);
        let last = bins as usize + 1;
        let mut masses = vec![0.0; last + 1];
        // From each end to the middle.
        for half in [(0..=last / 2).collect::<Vec<_>>(), (last / 2 + 1..=last).rev().collect()] {
            let mut outer = half[0];
            for k in half {
                if edges[k + 1] > edges[k] {
                    outer = k;
                }
                let ends = k == 0 || k == last;
                masses[outer] += if ends { end } else { (1.0 - 2.0 * end) / f64::from(bins) };
            }
        }
        let gain = masses.iter().zip(edges.windows(2)).filter(|(mass, _)| **mass > 0.0);
        let gain = gain.map(|(mass, w)| {
            // Of the two tails the smaller one has the digits.
            let prior = if w[0] > 0.0 {
                normal::cdf(-w[0]) - normal::cdf(-w[1])
            } else {
                normal::cdf(w[1]) - normal::cdf(w[0])
            };
            mass * (mass / prior.max(1e-300)).log2()
        });
        gain.sum::<f64>().max(0.0)
    }
}

/// Mean and variance.
pub(crate) fn mean_and_variance(x: &[f64], e: &Estimator) -> (f64, f64) {
    let mean = e.mean(|i| x[i]);
    (mean, e.mean(|i| (x[i] - mean).powi(2)).max(0.0))
}

/// Mean, its standard error, standard deviation, its standard error.
pub(crate) fn mean_and_sd(x: &[f64], e: &Estimator) -> (f64, f64, f64, f64) {
    let (mean, variance) = mean_and_variance(x, e);
    let sd = variance.sqrt();
    let mean_se = e.standard_error(|i| x[i] - mean);
    let sd_se = if sd > 0.0 {
        e.standard_error(|i| (x[i] - mean).powi(2) - variance) / (2.0 * sd)
    } else {
        0.0
    };
    (mean, mean_se, sd, sd_se)
}

/// The summary in SI from that in the coordinate: intervals and median map end by end, mean and sd (with their errors)
/// are given.
pub(crate) fn in_si(coordinate: Coordinate, m: &Moments, moments: (f64, f64, f64, f64)) -> Moments {
    let slope = |theta: f64| match coordinate {
        Coordinate::Linear => 1.0,
        Coordinate::Log10 => theta * std::f64::consts::LN_10,
    };
    let map = |i: &Interval| {
        let (lower, upper) = (coordinate.theta(i.lower), coordinate.theta(i.upper));
        Interval {
            lower,
            upper,
            lower_se: i.lower_se * slope(lower),
            upper_se: i.upper_se * slope(upper),
        }
    };
    let median = coordinate.theta(m.median);
    Moments {
        mean: moments.0,
        mean_se: moments.1,
        sd: moments.2,
        sd_se: moments.3,
        median,
        median_se: m.median_se * slope(median),
        eti50: map(&m.eti50),
        eti90: map(&m.eti90),
        eti95: map(&m.eti95),
        hdi50: map(&m.hdi50),
        hdi90: map(&m.hdi90),
        hdi95: map(&m.hdi95),
    }
}

/// Draws by which something of this variance by one of them has such an error; none by an error that is not a number.
pub(crate) fn draws_by_error(variance: f64, se: f64) -> f64 {
    let draws = variance / (se * se);
    if draws.is_nan() { 0.0 } else { draws }
}

/// Draws of a normal distribution by which each of these, of which one draw has this variance, would have its standard error: the fewest.
fn fewest<const N: usize>(of: &Moments, each: [(f64, f64); N]) -> f64 {
    let draws = each.map(|(factor, se)| draws_by_error(factor * of.sd.powi(2), se));
    draws.into_iter().fold(f64::INFINITY, f64::min)
}

/// Variance of the median by one draw of a normal distribution, over its own.
const OF_MEDIAN: f64 = 0.5 * std::f64::consts::PI;

/// Independent draws of a normal distribution by which mean and median would have standard errors no larger than they have.
pub(crate) fn draws_by_centre(of: &Moments) -> f64 {
    fewest(of, [(1.0, of.mean_se), (OF_MEDIAN, of.median_se)])
}

/// Independent draws of a normal distribution by which all of these would have standard errors no larger than they have: variances of the
/// mean, the standard deviation, the median and a p-quantile are s^2, s^2 / 2, pi s^2 / 2 and p (1 - p) / f^2 over their number.
pub(crate) fn draws_by_errors(of: &Moments) -> f64 {
    const END: f64 = 1.959_963_984_540_054;
    let density = (-0.5 * END * END).exp() / std::f64::consts::TAU.sqrt();
    let end = 0.025 * 0.975 / (density * density);
    let rest = [(0.5, of.sd_se), (end, of.eti95.lower_se), (end, of.eti95.upper_se)];
    draws_by_centre(of).min(fewest(of, rest))
}

/// Correlation matrix of weighted columns.
pub(crate) fn correlation(columns: &[Vec<f64>], e: &Estimator) -> Vec<Vec<f64>> {
    let d = columns.len();
    let means: Vec<f64> = columns.iter().map(|x| e.mean(|i| x[i])).collect();
    let mut c = vec![vec![0.0; d]; d];
    for i in 0..d {
        for j in 0..=i {
            let v = e.mean(|k| (columns[i][k] - means[i]) * (columns[j][k] - means[j]));
            c[i][j] = v;
            c[j][i] = v;
        }
    }
    let sd: Vec<f64> = (0..d).map(|i| c[i][i].max(0.0).sqrt()).collect();
    for i in 0..d {
        for j in 0..d {
            let s = sd[i] * sd[j];
            c[i][j] = if i == j {
                1.0
            } else if s > 0.0 {
                (c[i][j] / s).clamp(-1.0, 1.0)
            } else {
                0.0
            };
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of equal samples at these quantiles of the prior.
    fn bits(quantiles: impl Iterator<Item = f64>, sd: f64) -> f64 {
        let z: Vec<f64> = quantiles.map(|p| sd * normal::quantile(p)).collect();
        let estimator = Estimator::of(vec![0; z.len()], vec![1.0; z.len()], 0.0, 1);
        Marginal::new(&z, &estimator).information_gain_bits()
    }

    #[test]
    fn samples_of_the_prior_have_gained_nothing_however_few_they_are() {
        for n in [1, 2, 3, 5, 10, 40, 200] {
            let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
            let gain = bits((0..n).map(middle), 1.0);
            assert!(gain < 0.2, "{n}: {gain}");
        }
    }

    #[test]
    fn samples_of_a_narrower_normal_have_gained_its_divergence_on_either_side_of_the_middle() {
        let sd = 0.25_f64;
        let exact = -sd.log2() + 0.5 * (sd * sd - 1.0) / std::f64::consts::LN_2;
        for (n, tolerance) in [(20, 0.15), (2000, 0.03)] {
            let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(n);
            let gain = bits((0..n).map(middle), sd);
            assert!((gain - exact).abs() < tolerance, "{n}: {gain} {exact}");
        }
        let [low, high] = [[0.01, 0.1, 0.3], [0.99, 0.9, 0.7]].map(|p| bits(p.into_iter(), 1.0));
        assert!((low - high).abs() < 1e-9 && low > 0.0, "{low} {high}");
    }

    #[test]
    fn the_end_of_an_interval_in_one_sample_is_known_to_no_more_than_its_weight() {
        // Four sub-nets with the same samples, of which the last has a tenth: their spread says nothing.
        let x: Vec<f64> = (0..4).flat_map(|_| (0..10).map(f64::from)).collect();
        let label = (0..4).flat_map(|k| [k; 10]).collect();
        let weights = (0..40).map(|i| if i < 39 { 1.0 } else { 5.0 }).collect();
        let estimator = Estimator::of(label, weights, 0.0, 4);
        let marginal = Marginal::new(&x, &estimator);
        let q = marginal.quantile(0.975);
        // 5 of 44 at nine, and as far below as that is unknown.
        let (from, to) = (marginal.quantile(0.975 - 5.0 / 44.0), marginal.quantile(0.999));
        let slope = (to - from) / (0.999 - 0.975 + 5.0 / 44.0);
        let error = marginal.quantile_error(0.975, q);
        assert!(q == 9.0 && (error - 5.0 / 44.0 * slope).abs() < 1e-9, "{q} {error} {slope}");
    }

    #[test]
    fn errors_of_so_many_normal_draws_are_worth_as_many_draws_and_the_worst_counts() {
        // Of n draws of N(0, 2^2) the 2.5 % quantile has an error of 2.671 times 2 over the root of n.
        let of = |n: f64| {
            let se = |of_one: f64| 2.0 * of_one / n.sqrt();
            let eti95 =
                Interval { lower_se: se(2.6713), upper_se: se(2.6713), ..Interval::default() };
            let (mean_se, sd_se, median_se) = (se(1.0), se(0.5f64.sqrt()), se(1.2533));
            Moments { sd: 2.0, mean_se, sd_se, median_se, eti95, ..Moments::default() }
        };
        assert!((draws_by_errors(&of(250.0)) / 250.0 - 1.0).abs() < 1e-3);
        let (good, bad) = (of(250.0), of(40.0));
        for worse in [
            Moments { mean_se: bad.mean_se, ..good },
            Moments { sd_se: bad.sd_se, ..good },
            Moments { median_se: bad.median_se, ..good },
            Moments { eti95: bad.eti95, ..good },
        ] {
            assert!((draws_by_errors(&worse) / 40.0 - 1.0).abs() < 1e-3);
        }
        // Of mean and median alone the others are no part.
        let centre = Moments { mean_se: bad.mean_se, ..good };
        assert!((draws_by_centre(&centre) / 40.0 - 1.0).abs() < 1e-3);
        let others = Moments { sd_se: bad.sd_se, eti95: bad.eti95, ..good };
        assert!((draws_by_centre(&others) / 250.0 - 1.0).abs() < 1e-3);
        assert_eq!(draws_by_errors(&Moments { median_se: f64::NAN, ..good }), 0.0);
        assert_eq!(draws_by_errors(&Moments { sd: f64::NAN, ..good }), 0.0);
    }
}
