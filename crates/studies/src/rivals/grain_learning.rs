//! The iterative Bayesian filter of GrainLearning, as its package does it.
//!
//! H. Cheng, T. Shuku, K. Thoeni, P. Tempone, S. Luding, V. Magnanimo, Comput. Methods Appl. Mech. Eng. 350 (2019) 268; every
//! number and order of steps is that of the package GrainLearning 2.0.5 on PyPI. Its posterior is tuned: the
//! noise is chosen for a wanted effective sample size, and samples from the mixture count as
//! samples from the prior.

use nalgebra::{DMatrix, DVector};
use rand::RngExt as _;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;
use smc_calib::normal;

use super::{Bayes, Estimate, cholesky, random, weighted};

/// Wanted effective sample size, as a share of an iteration's samples.
const ESS_TARGET: f64 = 0.3;
/// Bounds and tolerances of the noise: of the first search from above, and of the end.
const SIGMA_LOWER: f64 = 1e-6;
const SIGMA_UPPER: f64 = 1e6;
const SIGMA_TOLERANCE: f64 = 1e-3;
/// Absolute tolerance of the search for the noise.
const SEARCH_TOLERANCE: f64 = 0.01;
/// Copies of an average sample that the mixture is fitted to.
const EXPANSION: f64 = 10.0;
/// Added to the diagonal of the fitted covariance, in units of the samples' range.
const REGULARISATION: f64 = 1e-6;
/// Iterations, as in the package's own example.
const ITERATIONS: usize = 8;

/// Eight iterations of as many samples each, the first from the Halton sequence over the prior's box; the result is
/// that of the last iteration. Ends early, as the package does, where the tuned noise falls below its tolerance.
///
/// The box is that of the priors' distribution functions: for uniform and log-uniform priors that of their bounds.
pub(crate) fn grain_learning(bayes: &dyn Bayes, samples: usize, seed: u64) -> Estimate {
    let mut random = random(4, seed);
    let d = bayes.dimension();
    let each = samples / ITERATIONS;
    let mut box_points = halton(each, d);
    let mut sigma_upper = SIGMA_UPPER;
    let mut simulations = 0;
    let mut found = Estimate::default();
    for iteration in 1..=ITERATIONS {
        let z: Vec<f64> =
            box_points.iter().map(|u| normal::quantile(u.clamp(1e-15, 1.0 - 1e-15))).collect();
        let misfits: Vec<f64> = z.chunks_exact(d).map(|z| bayes.misfit(z)).collect();
        simulations += each;
        let ess_error = |sigma: f64| {
            let weights = tuned(&misfits, sigma);
            let ess = 1.0 / weights.iter().map(|w| w * w).sum::<f64>() / each as f64;
            (ess - ESS_TARGET) * (ess - ESS_TARGET)
        };
        sigma_upper = bounded_minimum(ess_error, SIGMA_LOWER, sigma_upper, SEARCH_TOLERANCE);
        let weights = tuned(&misfits, sigma_upper.max(SIGMA_TOLERANCE));
        let ln_weights: Vec<f64> = weights.iter().map(|w| w.ln()).collect();
        found = weighted(bayes, &z, &ln_weights);
        if sigma_upper < SIGMA_TOLERANCE || iteration == ITERATIONS {
            break;
        }
        let Some(next) = resample(&box_points, &weights, d, &mut random) else { break };
        box_points = next;
    }
    Estimate { log_evidence: None, simulations, ..found }
}

/// Normalised weights at a noise level.
fn tuned(misfits: &[f64], sigma: f64) -> Vec<f64> {
    let least = misfits.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = misfits.iter().map(|m| (-(m - least) / sigma).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|w| w / total).collect()
}

/// As many points from one Gaussian, the variational fit to the samples repeated by weight; none where the fit or
/// the box leaves no room.
///
/// With one component, which is the package's default, the variational fit is in closed form: the mean of the
/// copies, and their covariance shrunk towards itself: `(S/(n-1) + S)/(d + n)`, S the sum of squares about the mean,
/// regularised.
fn resample(
    points: &[f64],
    weights: &[f64],
    d: usize,
    random: &mut ChaCha8Rng,
) -> Option<Vec<f64>> {
    let count = weights.len();
    let copies: Vec<f64> = weights.iter().map(|w| (EXPANSION * count as f64 * w).floor()).collect();
    let n: f64 = copies.iter().sum();
    if n < 2.0 {
        return None;
    }
    let kept = || points.chunks_exact(d).zip(&copies).filter(|(_, c)| **c > 0.0);
    let (mut low, mut high) = (vec![f64::INFINITY; d], vec![f64::NEG_INFINITY; d]);
    for (point, _) in kept() {
        for j in 0..d {
            low[j] = low[j].min(point[j]);
            high[j] = high[j].max(point[j]);
        }
    }
    if (0..d).any(|j| low[j] >= high[j]) {
        return None;
    }
    let scaled =
        |point: &[f64]| DVector::from_fn(d, |j, _| (point[j] - low[j]) / (high[j] - low[j]));
    let mut mean = DVector::zeros(d);
    for (point, c) in kept() {
        mean.axpy(c / n, &scaled(point), 1.0);
    }
    let mut raw = DMatrix::zeros(d, d);
    for (point, c) in kept() {
        let from_mean = scaled(point) - &mean;
        raw.ger(c / n, &from_mean, &from_mean, 1.0);
    }
    let regularised = &raw + DMatrix::identity(d, d) * REGULARISATION;
    let factor = cholesky((raw * (n / (n - 1.0)) + regularised * n) / (d as f64 + n))?;
    let mut out = Vec::with_capacity(count * d);
    for _ in 0..1000 * count {
        let drawn = &factor * DVector::from_fn(d, |_, _| random.sample(StandardNormal)) + &mean;
        let point: Vec<f64> = (0..d).map(|j| low[j] + (high[j] - low[j]) * drawn[j]).collect();
        if point.iter().all(|u| *u > 0.0 && *u < 1.0) {
            out.extend(point);
        }
        if out.len() == count * d {
            return Some(out);
        }
    }
    None
}

/// The Halton sequence from its start at the origin, row by row.
fn halton(count: usize, d: usize) -> Vec<f64> {
    const PRIMES: [usize; 8] = [2, 3, 5, 7, 11, 13, 17, 19];
    let inverse = |mut index: usize, base: usize| {
        let (mut value, mut digit) = (0.0, 1.0 / base as f64);
        while index > 0 {
            value += digit * (index % base) as f64;
            index /= base;
            digit /= base as f64;
        }
        value
    };
    (0..count).flat_map(|i| PRIMES[..d].iter().map(move |base| inverse(i, *base))).collect()
}

/// Minimum of a function between bounds by golden sections and parabolas (R. P. Brent, Algorithms for Minimization
/// without Derivatives, 1973, chapter 5), which the package uses; with an absolute tolerance as wide as here, where it
/// stops is part of the method.
fn bounded_minimum(f: impl Fn(f64) -> f64, lower: f64, upper: f64, tolerance: f64) -> f64 {
    let golden = 0.5 * (3.0 - 5f64.sqrt());
    let (mut a, mut b) = (lower, upper);
    let mut best = a + golden * (b - a);
    let (mut second, mut third) = (best, best);
    let mut f_best = f(best);
    let (mut f_second, mut f_third) = (f_best, f_best);
    // The last step and the one before it.
    let (mut step, mut before) = (0.0_f64, 0.0_f64);
    for _ in 0..500 {
        let middle = 0.5 * (a + b);
        let tight = f64::EPSILON.sqrt() * best.abs() + tolerance / 3.0;
        if (best - middle).abs() <= 2.0 * tight - 0.5 * (b - a) {
            break;
        }
        let mut parabola = None;
        if before.abs() > tight {
            let r = (best - second) * (f_best - f_third);
            let q = (best - third) * (f_best - f_second);
            let mut p = (best - third) * q - (best - second) * r;
            let mut q = 2.0 * (q - r);
            if q > 0.0 {
                p = -p;
            }
            q = q.abs();
            let earlier = before;
            before = step;
            if p.abs() < (0.5 * q * earlier).abs() && p > q * (a - best) && p < q * (b - best) {
                let to = best + p / q;
                let near_bound = to - a < 2.0 * tight || b - to < 2.0 * tight;
                parabola = Some(if near_bound { tight.copysign(middle - best) } else { p / q });
            }
        }
        step = parabola.unwrap_or_else(|| {
            before = if best >= middle { a - best } else { b - best };
            golden * before
        });
        let x = best + step.abs().max(tight).copysign(step);
        let f_x = f(x);
        if f_x <= f_best {
            if x >= best {
                a = best
            } else {
                b = best
            }
            (third, f_third) = (second, f_second);
            (second, f_second) = (best, f_best);
            (best, f_best) = (x, f_x);
        } else {
            if x < best {
                a = x
            } else {
                b = x
            }
            if f_x <= f_second || second == best {
                (third, f_third) = (second, f_second);
                (second, f_second) = (x, f_x);
            } else if f_x <= f_third || third == best || third == second {
                (third, f_third) = (x, f_x);
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::known::Conjugate;
    use super::*;

    #[test]
    fn the_search_ends_where_scipys_bounded_search_does() {
        assert!((bounded_minimum(|x| (x - 2.0).powi(2), -10.0, 10.0, 1e-6) - 2.0).abs() < 1e-5);
        // scipy 1.17: minimize_scalar(lambda x: (x - 0.3)**4 + x, bounds=(-2, 5), method='bounded',
        // options={'xatol': 0.01}).x
        let found = bounded_minimum(|x| (x - 0.3).powi(4) + x, -2.0, 5.0, 0.01);
        assert!((found + 0.328_696_066_505_281_77).abs() < 1e-9, "{found}");
    }

    #[test]
    fn halton_points_are_those_of_van_der_corput() {
        let expected = [0.0, 0.0, 0.5, 1.0 / 3.0, 0.25, 2.0 / 3.0, 0.75, 1.0 / 9.0];
        for (found, expected) in halton(4, 2).iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn tuned_weights_have_the_wanted_effective_sample_size() {
        let misfits: Vec<f64> = (0..1000).map(|i| 50.0 * (i as f64 / 1000.0).powi(2)).collect();
        let ess = |sigma: f64| {
            1.0 / tuned(&misfits, sigma).iter().map(|w| w * w).sum::<f64>() / misfits.len() as f64
        };
        let found = bounded_minimum(
            |sigma| (ess(sigma) - ESS_TARGET).powi(2),
            SIGMA_LOWER,
            SIGMA_UPPER,
            SEARCH_TOLERANCE,
        );
        assert!((ess(found) - ESS_TARGET).abs() < 1e-3, "{found}: {}", ess(found));
    }

    #[test]
    fn the_proposal_is_the_gaussian_of_the_weighted_samples() {
        // Samples in a band of the box: the new ones have their mean and covariance.
        let points: Vec<f64> = halton(4096, 2)
            .chunks_exact(2)
            .flat_map(|u| [0.4 + 0.1 * u[0], 0.3 + 0.2 * u[0] + 0.1 * u[1]])
            .collect();
        let next = resample(&points, &[1.0 / 4096.0; 4096], 2, &mut random(9, 1)).expect("room");
        let mean = |f: &dyn Fn(&[f64]) -> f64| next.chunks_exact(2).map(f).sum::<f64>() / 4096.0;
        let (x, y) = (mean(&|u| u[0]), mean(&|u| u[1]));
        assert!((x - 0.45).abs() < 2e-3 && (y - 0.45).abs() < 5e-3, "{x} {y}");
        let cross = mean(&|u| (u[0] - x) * (u[1] - y));
        assert!((cross / (0.1 * 0.2 / 12.0) - 1.0).abs() < 0.1, "{cross}");
    }

    #[test]
    fn the_spread_collapses_as_the_packages_does() {
        // It is no posterior: on a conjugate problem the mean is found, the spread is far too narrow.
        let exact = Conjugate::new();
        let found = grain_learning(&exact, 8 * 2048, 1);
        let [mean, sd, _] = exact.errors(&found);
        assert!(mean < 0.5 && sd > 0.3, "{mean} {sd} {found:?}");
    }
}
