//! A Gaussian process through simulated values: a cheap stand-in that says where to simulate next.
//!
//! It decides only where samples are placed; their weights come from the true likelihood.
//!
//! Covariance: a quadratic whose coefficients are as good as unknown, plus a squared exponential whose scale and
//! length maximise the marginal likelihood (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine
//! Learning (2006), sections 2.7 and 5.4), the same for all columns. Each sample has a nugget of its own: curves
//! far from the data need not be met closely. The error of the process is measured by leaving out each sample in turn
//! (the same, section 5.4.2).

use crate::cholesky::{cholesky, packed_inverse};
use crate::sobol::MAX_DIMENSIONS;
use rayon::prelude::*;

/// Candidates for the squared exponential's standard deviation and length, the latter in standard deviations of the
/// samples as they are weighted now.
const SCALES: [f64; 4] = [0.3, 1.0, 4.0, 16.0];
const LENGTHS: [f64; 4] = [0.7, 1.5, 3.0, 6.0];

/// Columns of numbers as a function of normal scores.
#[derive(Clone, Debug)]
pub(crate) struct GaussianProcess {
    d: usize,
    /// Whitening: centre and packed inverse factor.
    centre: Vec<f64>,
    inverse: Vec<f64>,
    /// Whitened samples, row by row, and the coefficients of each, one per column.
    points: Vec<f64>,
    coefficients: Vec<f64>,
    kernel: Kernel,
    /// Mean and unit of each column.
    offsets: Vec<f64>,
    units: Vec<f64>,
    /// Value of every column at every sample minus its prediction from the other samples.
    pub left_out: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Kernel {
    quadratic: f64,
    scale: f64,
    length: f64,
}

impl Kernel {
    fn of(&self, a: &[f64], b: &[f64]) -> f64 {
        let (mut dot, mut square) = (1.0, 0.0);
        for (a, b) in a.iter().zip(b) {
            dot += a * b;
            square += (a - b) * (a - b);
        }
        self.quadratic * dot * dot
            + self.scale * self.scale * (-0.5 * square / (self.length * self.length)).exp()
    }
}

/// Data of a process.
pub(crate) struct Data<'a> {
    pub d: usize,
    /// Samples, row by row.
    pub z: &'a [f64],
    /// Weights whose covariance whitens the samples.
    pub weights: &'a [f64],
    /// Numbers of the samples that the process runs through.
    pub chosen: &'a [usize],
    /// Values at these samples, row by row.
    pub values: &'a [f64],
    /// Standard deviation of the nugget of each, in units of the columns.
    pub nuggets: &'a [f64],
    /// Offset and unit of each column.
    pub offsets: Vec<f64>,
    pub units: Vec<f64>,
}

impl GaussianProcess {
    /// The process through some data; none where they have no spread.
    pub(crate) fn new(data: Data<'_>) -> Option<Self> {
        let (d, m) = (data.d, data.units.len());
        let (centre, inverse) = whitening(d, data.z, data.weights)?;
        let mut points = vec![0.0; data.chosen.len() * d];
        for (i, x) in data.chosen.iter().zip(points.chunks_exact_mut(d)) {
            whiten(&data.z[i * d..(i + 1) * d], &centre, &inverse, x);
        }
        let mut values = data.values.to_vec();
        for row in values.chunks_exact_mut(m) {
            for ((v, offset), unit) in row.iter_mut().zip(&data.offsets).zip(&data.units) {
                *v = (*v - offset) / unit;
            }
        }
        // Coefficients of the quadratic: of the size of the values.
        let quadratic = 1.0 + values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
        let candidates: Vec<Kernel> = SCALES
            .iter()
            .flat_map(|scale| LENGTHS.map(|length| Kernel { quadratic, scale: *scale, length }))
            .collect();
        let fits: Vec<Option<Fit>> = candidates
            .par_iter()
            .map(|kernel| Fit::new(d, &points, &values, data.nuggets, kernel))
            .collect();
        let mut chosen: Option<(Fit, Kernel)> = None;
        for (fit, kernel) in fits.into_iter().zip(candidates) {
            if let Some(fit) = fit
                && chosen.as_ref().is_none_or(|c| fit.evidence > c.0.evidence)
            {
                chosen = Some((fit, kernel));
            }
        }
        let (fit, kernel) = chosen?;
        let left_out = fit.left_out(&data.units);
        let coefficients = fit.coefficients;
        let (offsets, units) = (data.offsets, data.units);
        Some(Self { d, centre, inverse, points, coefficients, kernel, offsets, units, left_out })
    }

    /// Predicted values of all columns.
    pub(crate) fn predict(&self, z: &[f64], out: &mut [f64]) {
        let mut small = [0.0; MAX_DIMENSIONS];
        let x = &mut small[..self.d];
        whiten(z, &self.centre, &self.inverse, x);
        out.fill(0.0);
        let points = self.points.chunks_exact(self.d);
        for (p, row) in points.zip(self.coefficients.chunks_exact(out.len())) {
            let k = self.kernel.of(x, p);
            for (o, c) in out.iter_mut().zip(row) {
                *o += k * c;
            }
        }
        for ((o, offset), unit) in out.iter_mut().zip(&self.offsets).zip(&self.units) {
            *o = offset + unit * *o;
        }
    }
}

/// The process with one kernel.
struct Fit {
    coefficients: Vec<f64>,
    /// Lower Cholesky factor of the covariance, row by row.
    factor: Vec<f64>,
    /// Log marginal likelihood, without its constant.
    evidence: f64,
}

impl Fit {
    fn new(d: usize, points: &[f64], values: &[f64], nuggets: &[f64], k: &Kernel) -> Option<Self> {
        let n = nuggets.len();
        let m = values.len() / n;
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let k = k.of(&points[i * d..(i + 1) * d], &points[j * d..(j + 1) * d]);
                matrix[i * n + j] = k;
                matrix[j * n + i] = k;
            }
            matrix[i * n + i] = matrix[i * n + i] * (1.0 + 1e-11) + nuggets[i] * nuggets[i];
        }
        let factor = cholesky(&matrix, n)?;
        // L L^T c = y, all columns at once.
        let mut c = values.to_vec();
        for i in 0..n {
            let (before, rest) = c.split_at_mut(i * m);
            let row = &mut rest[..m];
            for (l, other) in factor[i * n..].iter().zip(before.chunks_exact(m)) {
                row.iter_mut().zip(other).for_each(|(r, o)| *r -= l * o);
            }
            row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
        }
        let squares: f64 = c.iter().map(|c| c * c).sum();
        for i in (0..n).rev() {
            let (before, rest) = c.split_at_mut(i * m);
            let row = &mut rest[..m];
            row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
            for (l, other) in factor[i * n..].iter().zip(before.chunks_exact_mut(m)) {
                other.iter_mut().zip(&*row).for_each(|(o, r)| *o -= l * r);
            }
        }
        let ln_det: f64 = (0..n).map(|i| factor[i * n + i].ln()).sum();
        let evidence = -0.5 * squares - m as f64 * ln_det;
        (evidence.is_finite() && c.iter().all(|c| c.is_finite())).then_some(Self {
            coefficients: c,
            factor,
            evidence,
        })
    }

    /// Values minus their predictions from the other samples, `c_i / (K^-1)_ii`.
    fn left_out(&self, units: &[f64]) -> Vec<f64> {
        let m = units.len();
        let n = self.coefficients.len() / m;
        // Diagonal of the inverse: sums of squares of the columns of the factor's inverse.
        let inverse = packed_inverse(&self.factor, n);
        let mut diagonal = vec![0.0; n];
        let mut at = 0;
        for i in 0..n {
            for d in &mut diagonal[..=i] {
                *d += inverse[at] * inverse[at];
                at += 1;
            }
        }
        let rows = self.coefficients.chunks_exact(m).zip(&diagonal);
        rows.flat_map(|(row, d)| row.iter().zip(units).map(move |(c, unit)| unit * c / d)).collect()
    }
}

/// Centre and packed inverse factor of the weighted covariance.
fn whitening(d: usize, z: &[f64], weights: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let total: f64 = weights.iter().sum();
    let mut centre = vec![0.0; d];
    let mut covariance = vec![0.0; d * d];
    for (w, z) in weights.iter().zip(z.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
        for (c, z) in centre.iter_mut().zip(z) {
            *c += w / total * z;
        }
    }
    for (w, z) in weights.iter().zip(z.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
        for i in 0..d {
            for j in 0..d {
                covariance[i * d + j] += w / total * (z[i] - centre[i]) * (z[j] - centre[j]);
            }
        }
    }
    let trace: f64 = (0..d).map(|i| covariance[i * d + i]).sum();
    (0..d).for_each(|i| covariance[i * d + i] += 1e-3 * trace / d as f64 + 1e-18);
    let factor = cholesky(&covariance, d)?;
    Some((centre, packed_inverse(&factor, d)))
}

fn whiten(z: &[f64], centre: &[f64], inverse: &[f64], out: &mut [f64]) {
    let mut row = 0;
    for i in 0..z.len() {
        out[i] = (0..=i).map(|j| inverse[row + j] * (z[j] - centre[j])).sum();
        row += i + 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a plane, evenly spread without a pattern.
    fn points(n: usize) -> Vec<f64> {
        (0..n)
            .flat_map(|i| {
                let i = i as f64 + 0.5;
                [4.0 * (i * 0.754_877_67).fract() - 2.0, 4.0 * (i * 0.569_840_29).fract() - 2.0]
            })
            .collect()
    }

    fn through(z: &[f64], columns: usize, value: impl Fn(&[f64]) -> Vec<f64>) -> GaussianProcess {
        let values: Vec<f64> = z.chunks_exact(2).flat_map(value).collect();
        let n = z.len() / 2;
        GaussianProcess::new(Data {
            d: 2,
            z,
            weights: &vec![1.0; n],
            chosen: &(0..n).collect::<Vec<_>>(),
            values: &values,
            nuggets: &vec![1e-3; n],
            offsets: vec![0.0; columns],
            units: vec![1.0; columns],
        })
        .expect("has spread")
    }

    #[test]
    fn a_quadratic_is_met_and_continued_beyond_the_samples() {
        let quadratic = |z: &[f64]| {
            vec![3.0 - 2.0 * z[0] * z[0] + z[0] * z[1] - 0.5 * z[1] + 4.0 * z[1] * z[1]]
        };
        let process = through(&points(12), 1, quadratic);
        for z in [[0.0, 0.0], [1.3, -0.4], [2.5, 2.5]] {
            let mut out = [0.0];
            process.predict(&z, &mut out);
            assert!((out[0] - quadratic(&z)[0]).abs() < 0.05, "{z:?}: {out:?}");
        }
    }

    #[test]
    fn left_out_values_are_those_of_a_process_without_the_sample_and_columns_do_not_mix() {
        let wave = |z: &[f64]| vec![(1.5 * z[0]).sin() * z[1], (z[0] - z[1]).cos()];
        let z = points(30);
        let all = through(&z, 2, wave);
        let fit = |n: std::ops::Range<usize>| {
            let rows: Vec<f64> = n.flat_map(|i| z[2 * i..2 * i + 2].to_vec()).collect();
            let (centre, inverse) = whitening(2, &z, &[1.0; 30]).expect("spread");
            let mut x = vec![0.0; rows.len()];
            for (z, x) in rows.chunks_exact(2).zip(x.chunks_exact_mut(2)) {
                whiten(z, &centre, &inverse, x);
            }
            let values: Vec<f64> = rows.chunks_exact(2).flat_map(wave).collect();
            let nuggets = vec![1e-3; rows.len() / 2];
            (Fit::new(2, &x, &values, &nuggets, &all.kernel).expect("definite"), x)
        };
        // The last sample predicted by the process through the others, with the same kernel.
        let (without, x) = fit(0..29);
        let (_, last) = fit(29..30);
        for column in 0..2 {
            let predicted: f64 = x
                .chunks_exact(2)
                .zip(without.coefficients.chunks_exact(2))
                .map(|(p, c)| c[column] * all.kernel.of(&last, p))
                .sum();
            let error = wave(&z[58..])[column] - predicted;
            let left_out = all.left_out[58 + column];
            assert!((error - left_out).abs() < 1e-4 + 1e-3 * error.abs(), "{error} {left_out}");
        }
        // Between samples both columns are met.
        for at in [[0.3, 0.2], [-0.7, 0.9]] {
            let mut out = [0.0; 2];
            all.predict(&at, &mut out);
            let exact = wave(&at);
            assert!((0..2).all(|c| (out[c] - exact[c]).abs() < 0.05), "{out:?} {exact:?}");
        }
    }
}
