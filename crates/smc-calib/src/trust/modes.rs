//! Whether a posterior has two modes: two groups of samples with hardly anything between them.
//!
//! Samples are looked at along every parameter and along every principal axis of their correlation, in the priors'
//! coordinates. Along each their density is a histogram of the weights, smoothed by a normal; where it falls below a
//! quarter of the lower of two peaks, the samples on either side are groups. Of several such places the deepest counts.

use super::Concern;
use super::limits::{MODE_SAMPLES, MODE_SHARE, VALLEY};
use crate::posterior::Posterior;
use crate::weighted::Weighted;

/// Cells of the histogram.
const CELLS: usize = 128;

/// The samples in standardised coordinates, and their weights.
struct Cloud {
    x: Vec<Vec<f64>>,
    weights: Vec<f64>,
    effective: f64,
}

/// The two modes of a posterior, told apart by the parameter in which they are farthest from each other; none where it
/// has one.
pub(super) fn two_modes(posterior: &Posterior) -> Option<Concern> {
    let cloud = Cloud::of(posterior);
    let d = posterior.parameters.len();
    if cloud.effective < 2.0 * MODE_SAMPLES || posterior.correlation.len() != d {
        return None;
    }
    let units = (0..d).map(|j| (0..d).map(|i| f64::from(u8::from(i == j))).collect());
    let directions = units.chain(principal_axes(&posterior.correlation));
    let split = directions
        .filter_map(|direction: Vec<f64>| cloud.split(&direction))
        .min_by(|a, b| a.valley.total_cmp(&b.valley))?;
    let median = |j: usize, upper: bool| {
        let chosen = posterior.samples.iter().zip(&split.upper).filter(|(_, u)| **u == upper);
        Weighted::new(chosen.map(|(s, _)| (s.theta[j], s.weight))).quantile(0.5)
    };
    let of_group = |j: usize, upper: bool| {
        let chosen = || cloud.x[j].iter().zip(&cloud.weights).zip(&split.upper);
        let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
            chosen().filter(|(_, u)| **u == upper).map(|((x, w), _)| w * of(*x)).sum()
        };
        let total = sum(&|_| 1.0);
        let mean = sum(&|x| x) / total;
        (mean, sum(&|x| (x - mean).powi(2)) / total)
    };
    let apart = |j: usize| {
        let ((a, v), (b, w)) = (of_group(j, false), of_group(j, true));
        (a - b).abs() / (v + w).sqrt().max(f64::MIN_POSITIVE)
    };
    let best = (0..d).max_by(|i, j| apart(*i).total_cmp(&apart(*j)))?;
    let mut modes = [(median(best, false), 1.0 - split.share), (median(best, true), split.share)];
    modes.sort_by(|a, b| b.1.total_cmp(&a.1));
    Some(Concern::TwoModes {
        parameter: posterior.parameters[best].parameter.name.clone(),
        centres: modes.map(|m| m.0),
        shares: modes.map(|m| m.1),
    })
}

/// Two groups of samples along a direction.
struct Split {
    /// Density between them over that of the lower peak.
    valley: f64,
    /// Which samples are in the upper group.
    upper: Vec<bool>,
    /// Their share of the weight.
    share: f64,
}

impl Cloud {
    fn of(posterior: &Posterior) -> Self {
        let standardised = |(j, p): (usize, &crate::ParameterSummary)| {
            let (mean, sd) = (p.in_coordinate.mean, p.in_coordinate.sd.max(f64::MIN_POSITIVE));
            let prior = &p.parameter.prior;
            posterior
                .samples
                .iter()
                .map(|s| (prior.to_coordinate(s.theta[j]) - mean) / sd)
                .collect()
        };
        let x = posterior.parameters.iter().enumerate().map(standardised).collect();
        let weights: Vec<f64> = posterior.samples.iter().map(|s| s.weight).collect();
        let effective = effective(weights.iter().copied());
        Self { x, weights, effective }
    }

    /// The groups along a direction, where there are two.
    fn split(&self, direction: &[f64]) -> Option<Split> {
        let mut along = vec![0.0; self.weights.len()];
        for (x, factor) in self.x.iter().zip(direction).filter(|(_, factor)| **factor != 0.0) {
            along.iter_mut().zip(x).for_each(|(a, x)| *a += factor * x);
        }
        let pairs = along.iter().copied().zip(self.weights.iter().copied());
        let sorted = Weighted::new(pairs.clone().filter(|(_, w)| *w > 0.0));
        // Without the outermost thousandth on each side, which may be anywhere.
        let (lower, upper) = (sorted.quantile(0.001), sorted.quantile(0.999));
        let width = (upper - lower) / CELLS as f64;
        if width.is_nan() || width <= 0.0 {
            return None;
        }
        let mut histogram = vec![0.0; CELLS];
        for (a, w) in pairs.filter(|(a, _)| (lower..=upper).contains(a)) {
            histogram[(((a - lower) / width) as usize).min(CELLS - 1)] += w;
        }
        // Silverman's bandwidth for the narrower of the spread and half the middle half, which of two groups is one's own.
        let spread = sorted.quantile(0.75) - sorted.quantile(0.25);
        let sd = if spread > 0.0 { (spread / 1.35).min(1.0) } else { 1.0 };
        let bandwidth = (0.9 * sd * self.effective.powf(-0.2) / width).max(1.0);
        let density = smoothed(&histogram, bandwidth);
        let (valley, at) = deepest_valley(&histogram, &density)?;
        let edge = lower + (at as f64 + 0.5) * width;
        let is_upper: Vec<bool> = along.iter().map(|a| *a > edge).collect();
        let of = |wanted: bool| {
            let chosen = self.weights.iter().zip(&is_upper).filter(move |(_, u)| **u == wanted);
            chosen.map(|(w, _)| *w)
        };
        let total: f64 = self.weights.iter().sum();
        let share = of(true).sum::<f64>() / total;
        let enough = effective(of(true)).min(effective(of(false))) >= MODE_SAMPLES;
        (valley < VALLEY && enough).then_some(Split { valley, upper: is_upper, share })
    }
}

/// Effective number of weights.
fn effective(weights: impl Iterator<Item = f64>) -> f64 {
    let (sum, squares) = weights.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// A histogram smoothed by a normal of this many cells.
fn smoothed(histogram: &[f64], bandwidth: f64) -> Vec<f64> {
    let reach = (4.0 * bandwidth).ceil() as usize;
    let kernel: Vec<f64> =
        (0..=reach).map(|k| (-0.5 * (k as f64 / bandwidth).powi(2)).exp()).collect();
    (0..histogram.len())
        .map(|i| {
            let near = i.saturating_sub(reach)..(i + reach + 1).min(histogram.len());
            near.map(|j| histogram[j] * kernel[i.abs_diff(j)]).sum()
        })
        .collect()
}

/// The place, with enough of the posterior on either side, where the density is the smallest part of the lower of the
/// highest peaks on its two sides; and that part.
fn deepest_valley(histogram: &[f64], density: &[f64]) -> Option<(f64, usize)> {
    let total: f64 = histogram.iter().sum();
    let peak = |cells: &[f64]| cells.iter().copied().fold(0.0, f64::max);
    let mut below = 0.0;
    let candidates = histogram.iter().enumerate().filter_map(|(i, cell)| {
        below += cell / total;
        let lower = peak(&density[..=i]).min(peak(&density[i..]));
        let ratio = density[i] / lower;
        (below.min(1.0 - below) >= MODE_SHARE && ratio.is_finite()).then_some((ratio, i))
    });
    candidates.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Eigenvectors of a correlation matrix, by Jacobi's rotations; none for a single parameter.
fn principal_axes(correlation: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let d = correlation.len();
    if d < 2 {
        return Vec::new();
    }
    let mut a = correlation.to_vec();
    let mut axes: Vec<Vec<f64>> =
        (0..d).map(|i| (0..d).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for (p, q) in (0..SWEEPS).flat_map(|_| (0..d).flat_map(|p| (p + 1..d).map(move |q| (p, q)))) {
        if a[p][q].abs() < 1e-12 {
            continue;
        }
        let (sin, cos) = (0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p])).sin_cos();
        for row in &mut a {
            (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
        }
        for k in 0..d {
            (a[p][k], a[q][k]) = (cos * a[p][k] - sin * a[q][k], sin * a[p][k] + cos * a[q][k]);
        }
        for k in 0..d {
            let (x, y) = (axes[p][k], axes[q][k]);
            (axes[p][k], axes[q][k]) = (cos * x - sin * y, sin * x + cos * y);
        }
    }
    axes
}

/// Sweeps of Jacobi's rotations: they converge quadratically.
const SWEEPS: usize = 8;
