//! Samples that are moved to moments that no weights of theirs have.
//!
//! A few samples in many dimensions have no weights with all means and covariances that are known. The affine map
//!
//! `x -> m + L L_w^-1 (x - m_w)`, `C = L L^T`, `C_w = L_w L_w^T`,
//!
//! gives those of mean m_w and covariance C_w the known m and C (T. Paananen, J. Piironen, P.-C. Buerkner, A. Vehtari, Stat. Comput. 31
//! (2021) 16, section 2.2). Summaries of parameters, and of what follows from them, are of moved samples: simulations stay where they are.

use crate::cholesky::{cholesky, lower_times, packed_inverse, whiten};
use crate::surrogate::monomials;
use serde::{Deserialize, Serialize};

/// Farthest that a mean is moved, in standard deviations of the samples, and most that a standard deviation changes by.
const FARTHEST: f64 = 1.0;
const MOST: f64 = 2.0;
/// Least width of any direction, over that of the samples.
const NARROWEST: f64 = 0.25;
/// Steps in which correlations go to those of the samples.
const SHARES: u32 = 20;
/// Largest part of a standard deviation by which means and standard deviations may miss what they are moved to, because samples that the
/// map would take out of the prior's range stop at its end.
const MISSED: f64 = 0.02;

/// What a coordinate is standardised by, and the range of its prior.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub mean: f64,
    pub sd: f64,
    pub range: [f64; 2],
}

impl Axis {
    /// The coordinate of a standardised one.
    pub(super) fn coordinate(&self, x: f64) -> f64 {
        self.within(self.mean + self.sd * x)
    }

    /// The nearest coordinate in the prior's range.
    fn within(&self, coordinate: f64) -> f64 {
        coordinate.max(self.range[0]).min(self.range[1])
    }
}

/// How far the moments of a small budget's weighted samples are from those that are known better, in the priors' coordinates: parameters,
/// correlations, draws and what follows from parameters are of samples moved to the latter, which no weights of so few samples have; outputs
/// are those of the samples where they were simulated.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MovedBy {
    /// Largest difference of a mean, in posterior standard deviations.
    pub mean: f64,
    /// Largest relative difference of a standard deviation.
    pub sd: f64,
    /// Largest difference of a correlation.
    pub correlation: f64,
}

/// Mean and covariance of d coordinates, row by row, from the integrals of 1, x_j and x_i x_j.
fn moments(integrals: &[f64], d: usize) -> (Vec<f64>, Vec<f64>) {
    let of = |a: usize| integrals[a] / integrals[0];
    let mean: Vec<f64> = (1..=d).map(of).collect();
    let mut covariance = vec![0.0; d * d];
    for i in 0..d {
        for j in 0..=i {
            let value = of(1 + d + i * (i + 1) / 2 + j) - mean[i] * mean[j];
            covariance[i * d + j] = value;
            covariance[j * d + i] = value;
        }
    }
    (mean, covariance)
}

/// Standard deviation of coordinate i; not a number where there is none.
fn sd(covariance: &[f64], d: usize, i: usize) -> f64 {
    covariance[i * d + i].sqrt()
}

/// Cholesky factor of a covariance; where that is not positive definite, or narrower than [`NARROWEST`] allows in some direction, of its
/// mixture with the correlations of the samples at the same standard deviations, with as little of these as it takes. Integrals that are
/// known one by one need not be those of a density: where coordinates are nearly proportional to each other, their products are known less
/// well than the way across is wide.
fn factor_of(covariance: &[f64], of_samples: &[f64], d: usize) -> Option<Vec<f64>> {
    let scaled = |i: usize, j: usize| {
        let factor = |i: usize| sd(covariance, d, i) / sd(of_samples, d, i);
        of_samples[i * d + j] * factor(i) * factor(j)
    };
    let mixed = |share: f64, off: f64| -> Vec<f64> {
        let value = |k: usize| {
            let scaled = scaled(k / d, k % d);
            (1.0 - share) * covariance[k] + share * scaled - off * scaled
        };
        (0..d * d).map(value).collect()
    };
    let shares = (0..=SHARES).map(|k| f64::from(k) / f64::from(SHARES));
    let wide = |share: &f64| cholesky(&mixed(*share, NARROWEST.powi(2)), d).is_some();
    cholesky(&mixed(shares.into_iter().find(wide)?, 0.0), d)
}

/// Mean, and Cholesky factor of the covariance, that samples are moved to.
pub(super) struct Moments {
    mean: Vec<f64>,
    factor: Vec<f64>,
}

impl Moments {
    /// Those of `wished` integrals over d coordinates ([`factor_of`]) from samples with these `sums`; none where they change by more than is
    /// allowed.
    pub(super) fn to([sums, wished]: [&[f64]; 2], d: usize) -> Option<Self> {
        let ((from, from_covariance), (mean, covariance)) = (moments(sums, d), moments(wished, d));
        for i in 0..d {
            let [from_sd, to_sd] = [&from_covariance, &covariance].map(|c| sd(c, d, i));
            let near = (mean[i] - from[i]).abs() <= FARTHEST * from_sd;
            if !(near && (1.0 / MOST..=MOST).contains(&(to_sd / from_sd))) {
                return None;
            }
        }
        let factor = factor_of(&covariance, &from_covariance, d)?;
        Some(Self { mean, factor })
    }
}

/// 1, x_j and x_i x_j of all samples, which have these `sums`, moved to other moments; samples that would leave the prior's range stop at its
/// end. None where they have no covariance.
pub(super) fn moved(
    features: &[f64],
    sums: &[f64],
    Moments { mean: to, factor: to_factor }: &Moments,
    axes: &[Axis],
) -> Option<Vec<f64>> {
    let (d, p) = (axes.len(), sums.len());
    let (from, covariance) = moments(sums, d);
    let from_factor = cholesky(&covariance, d)?;
    let inverse = packed_inverse(&from_factor, d);
    let (mut out, mut white) = (vec![0.0; features.len()], vec![0.0; d]);
    for (row, out) in features.chunks_exact(p).zip(out.chunks_exact_mut(p)) {
        whiten(&row[1..=d], &from, &inverse, &mut white);
        let mut x = lower_times(to_factor, &white);
        for ((x, to), axis) in x.iter_mut().zip(to).zip(axes) {
            *x += to;
            let free = axis.mean + axis.sd * *x;
            let within = axis.within(free);
            if within != free {
                *x = (within - axis.mean) / axis.sd;
            }
        }
        monomials(&x, out);
    }
    Some(out)
}

/// Whether integrals over d coordinates have the means and standard deviations of the wished ones, but for [`MISSED`].
pub(super) fn reach(sums: &[f64], wished: &[f64], d: usize) -> bool {
    let ((mean, covariance), (to, to_covariance)) = (moments(sums, d), moments(wished, d));
    (0..d).all(|i| {
        let [sd, wished] = [&covariance, &to_covariance].map(|c| sd(c, d, i));
        (mean[i] - to[i]).abs() <= MISSED * wished && (sd - wished).abs() <= MISSED * wished
    })
}
