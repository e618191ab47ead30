//! Weighted points in coordinates in which they have mean zero and unit covariance, with the map back.

use crate::cholesky::{cholesky, packed_inverse};
use crate::lanes::LANES;
use crate::stream::{Purpose, stream};
use rand::{Rng, RngExt};

/// Most distinct samples that a mixture is fitted to; more are resampled to this number.
const MAX_POINTS: usize = 1024;

/// One fitted Gaussian.
#[derive(Clone, Debug)]
pub(crate) struct Gaussian {
    pub weight: f64,
    pub mean: Vec<f64>,
    /// Lower Cholesky factor of the covariance, row by row.
    pub factor: Vec<f64>,
}

/// Weighted points, whitened, with the map back.
pub(crate) struct Cloud {
    pub d: usize,
    /// Whitened points, row by row.
    pub points: Vec<f64>,
    /// Weights, summing to one.
    pub weights: Vec<f64>,
    /// The points again in blocks of [`LANES`], coordinate by coordinate within a block, and their weights; the last
    /// block filled up with points of weight zero.
    pub lanes: Vec<f64>,
    pub lane_weights: Vec<f64>,
    mean: Vec<f64>,
    factor: Vec<f64>,
    /// Effective number of samples behind the weights.
    pub ess: f64,
}

impl Cloud {
    /// Takes points (row by row) and weights of any scale; resamples where there are many.
    pub(crate) fn new(
        d: usize,
        z: &[f64],
        weights: &[f64],
        seed: u64,
        stage: usize,
    ) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let squares: f64 = weights.iter().map(|w| w * w).sum();
        let ess = total * total / squares;
        let (mean, cov) = moments(d, z, weights, total);
        let factor = cholesky(&cov, d)?;
        let inverse = packed_inverse(&factor, d);
        let kept = if weights.len() <= MAX_POINTS {
            let alive = weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
            alive.map(|(i, w)| (i, w / total)).collect()
        } else {
            resampled(weights, total, &mut stream(seed, Purpose::MixtureResample, stage, 0))
        };
        let mut points = Vec::with_capacity(kept.len() * d);
        for (index, _) in &kept {
            let z = &z[index * d..(index + 1) * d];
            let mut row = 0;
            for i in 0..d {
                points.push((0..=i).map(|j| inverse[row + j] * (z[j] - mean[j])).sum::<f64>());
                row += i + 1;
            }
        }
        let weights: Vec<f64> = kept.into_iter().map(|(_, weight)| weight).collect();
        let mut lane_weights = weights.clone();
        lane_weights.resize(weights.len().next_multiple_of(LANES), 0.0);
        let mut lanes = vec![0.0; lane_weights.len() * d];
        for (i, x) in points.chunks_exact(d).enumerate() {
            for (j, x) in x.iter().enumerate() {
                lanes[(i / LANES * d + j) * LANES + i % LANES] = *x;
            }
        }
        Some(Self { d, points, weights, lanes, lane_weights, mean, factor, ess })
    }

    /// A Gaussian taken back from whitened coordinates: its mean by the affine map, its factor by the product of the two.
    pub(crate) fn unwhiten(&self, weight: f64, m: &[f64], f: &[f64]) -> Gaussian {
        let d = self.d;
        let mean = (0..d)
            .map(|i| self.mean[i] + (0..=i).map(|j| self.factor[i * d + j] * m[j]).sum::<f64>())
            .collect();
        let mut factor = vec![0.0; d * d];
        for i in 0..d {
            for j in 0..=i {
                factor[i * d + j] = (j..=i).map(|l| self.factor[i * d + l] * f[l * d + j]).sum();
            }
        }
        Gaussian { weight, mean, factor }
    }
}

/// Weighted mean and covariance, the latter with a trace of the identity so that it has a factor.
fn moments(d: usize, z: &[f64], weights: &[f64], total: f64) -> (Vec<f64>, Vec<f64>) {
    let mut mean = vec![0.0; d];
    for (w, z) in weights.iter().zip(z.chunks_exact(d)) {
        if *w > 0.0 {
            for (m, z) in mean.iter_mut().zip(z) {
                *m += w / total * z;
            }
        }
    }
    let mut cov = vec![0.0; d * d];
    for (w, z) in weights.iter().zip(z.chunks_exact(d)) {
        if *w > 0.0 {
            for i in 0..d {
                for j in 0..=i {
                    cov[i * d + j] += w / total * (z[i] - mean[i]) * (z[j] - mean[j]);
                }
            }
        }
    }
    let trace: f64 = (0..d).map(|i| cov[i * d + i]).sum();
    for i in 0..d {
        for j in 0..i {
            cov[j * d + i] = cov[i * d + j];
        }
        cov[i * d + i] += 1e-12 * trace + 1e-18;
    }
    (mean, cov)
}

/// Systematic resampling to [`MAX_POINTS`]: samples and their weights; one drawn several times is kept once with that
/// weight.
fn resampled(weights: &[f64], total: f64, rng: &mut impl Rng) -> Vec<(usize, f64)> {
    let step = 1.0 / MAX_POINTS as f64;
    let mut next = step * rng.random::<f64>();
    let mut sum = 0.0;
    let mut kept = Vec::with_capacity(MAX_POINTS);
    for (i, weight) in weights.iter().enumerate() {
        sum += weight / total;
        let mut times = 0;
        while next < sum {
            times += 1;
            next += step;
        }
        if times > 0 {
            kept.push((i, f64::from(times) * step));
        }
    }
    let kept_total: f64 = kept.iter().map(|k| k.1).sum();
    kept.iter_mut().for_each(|k| k.1 /= kept_total);
    kept
}
