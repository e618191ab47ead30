//! Covariances of a Gaussian process, their evidence, and the fit of one.

use super::metric::Metric;
use crate::cholesky::{
    dot, inverse_of_factored, large_cholesky, lower_solve, packed_inverse, upper_solve,
};
use crate::lanes::{LANES, exp_of_nonpositive, wide};
use rayon::prelude::*;

/// Candidates for the squared exponential's standard deviation and length, the latter in standard deviations of the
/// samples as they are weighted now.
const SCALES: [f64; 6] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0];
const LENGTHS: [f64; 4] = [0.7, 1.5, 3.0, 6.0];
/// Candidates for the factor on the nuggets.
const NUGGETS: [f64; 3] = [1.0, 0.1, 0.01];
/// Share of a variance that is added to it.
const ROUNDING: f64 = 1e-11;
/// Nugget up to which the factor of a covariance acts: what far samples are off by beyond it does not shrink with it.
const NEAR: f64 = 0.6;

/// A covariance `mean(a, b) + scale^2 shape(|metric(a) - metric(b)|^2)`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Kernel {
    pub(super) shape: Shape,
    /// Variance of the coefficients of the mean.
    pub(super) size: f64,
    pub(super) scale: f64,
    pub(super) metric: Metric,
    /// Factor on the nuggets up to [`NEAR`].
    pub(super) nugget: f64,
}

/// How a covariance falls with the distance r, and what its mean function is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// `(1 + s + s^2/3) exp(-s)` with `s^2 = 5 r^2`, about a linear function `size (1 + a b)`.
    Matern,
    /// `exp(-r^2/2)`, about a quadratic `size (1 + a b)^2`.
    SquaredExponential,
}

impl Kernel {
    /// Fills the second half of a row, the coordinates that distances of the point in its first half are measured in.
    pub(super) fn extend(&self, row: &mut [f64]) {
        let (point, measured) = row.split_at_mut(row.len() / 2);
        self.metric.of(point, measured);
    }

    /// Points, row by row, each [extended](Self::extend).
    fn extended(&self, points: &[f64], d: usize) -> Vec<f64> {
        let mut extended = vec![0.0; 2 * points.len()];
        for (x, row) in points.chunks_exact(d).zip(extended.chunks_exact_mut(2 * d)) {
            row[..d].copy_from_slice(x);
            self.extend(row);
        }
        extended
    }

    /// Covariance of two points, both [extended](Self::extend).
    pub(super) fn between(&self, a: &[f64], b: &[f64]) -> f64 {
        let mut covariance = [0.0];
        self.row(a, &Points::new(b.len(), b), &mut covariance);
        covariance[0]
    }

    /// Covariances of a, [extended](Self::extend), with the first points, as many as there is room for.
    pub(super) fn row(&self, a: &[f64], points: &Points, out: &mut [f64]) {
        let (size, variance) = (self.size, self.scale * self.scale);
        wide(
            #[inline(always)]
            || match self.shape {
                Shape::Matern => points.each(a, out, |dot, square| {
                    let s = (5.0 * square).sqrt();
                    size * dot + variance * (1.0 + s + s * s / 3.0) * exp_of_nonpositive(-s)
                }),
                Shape::SquaredExponential => points.each(a, out, |dot, square| {
                    size * dot * dot + variance * exp_of_nonpositive(-0.5 * square)
                }),
            },
        );
    }

    /// These covariances without their mean function, and their slopes by the squares of the distances.
    fn sloped_row(&self, a: &[f64], points: &Points, out: &mut [[f64; 2]]) {
        let variance = self.scale * self.scale;
        wide(
            #[inline(always)]
            || match self.shape {
                Shape::Matern => points.each(a, out, |_, square| {
                    let s = (5.0 * square).sqrt();
                    let fallen = exp_of_nonpositive(-s);
                    let slope = -5.0 / 6.0 * variance * (1.0 + s) * fallen;
                    [variance * (1.0 + s + s * s / 3.0) * fallen, slope]
                }),
                Shape::SquaredExponential => points.each(a, out, |_, square| {
                    let fallen = exp_of_nonpositive(-0.5 * square);
                    [variance * fallen, -0.5 * variance * fallen]
                }),
            },
        );
    }

    /// Standard deviation of a sample's nugget, and its slope by the logarithm of the factor.
    fn nugget_of(&self, nugget: f64) -> [f64; 2] {
        let near = self.nugget * nugget.min(NEAR);
        [near + (nugget - NEAR).max(0.0), near]
    }
}

/// Points, each [extended](Kernel::extend): numbers in each, and blocks of [`LANES`] points, number by number within.
#[derive(Clone, Debug)]
pub(super) struct Points(usize, Vec<f64>);

impl Points {
    /// From rows of `width` numbers.
    pub(super) fn new(width: usize, rows: &[f64]) -> Self {
        let count = rows.len() / width;
        let mut blocks = vec![0.0; count.next_multiple_of(LANES) * width];
        for (i, row) in rows.chunks_exact(width).enumerate() {
            let block = &mut blocks[i / LANES * LANES * width..];
            row.iter().enumerate().for_each(|(j, x)| block[j * LANES + i % LANES] = *x);
        }
        Self(width, blocks)
    }

    /// The first `count` points, row by row, without what distances are measured in.
    pub(super) fn own(&self, count: usize) -> Vec<f64> {
        let Self(width, blocks) = self;
        let at = |i: usize| &blocks[i / LANES * LANES * width + i % LANES..];
        (0..count).flat_map(|i| (0..width / 2).map(move |j| at(i)[j * LANES])).collect()
    }

    /// `value(1 + a b, |a' - b'|^2)` of a with these points b, each followed by its a' or b', in lanes.
    #[inline(always)]
    fn each<T: Copy + Default>(&self, a: &[f64], out: &mut [T], value: impl Fn(f64, f64) -> T) {
        let Self(width, blocks) = self;
        let (own, measured) = a.split_at(width / 2);
        for (block, out) in blocks.chunks_exact(LANES * width).zip(out.chunks_mut(LANES)) {
            let (own_b, measured_b) = block.as_chunks::<LANES>().0.split_at(own.len());
            let (mut dots, mut squares) = ([1.0; LANES], [0.0; LANES]);
            for j in 0..own.len() {
                for l in 0..LANES {
                    let step = measured[j] - measured_b[j][l];
                    dots[l] += own[j] * own_b[j][l];
                    squares[l] += step * step;
                }
            }
            // By `array::from_fn` they would be computed one at a time, by narrow instructions.
            let mut values = [T::default(); LANES];
            for l in 0..LANES {
                values[l] = value(dots[l], squares[l]);
            }
            match out.first_chunk_mut() {
                Some(all) => *all = values,
                None => out.copy_from_slice(&values[..out.len()]),
            }
        }
    }
}

/// Samples in the coordinates of a covariance, the best first.
#[derive(Clone, Copy)]
pub(super) struct Samples<'a> {
    pub(super) d: usize,
    /// Row by row.
    pub(super) points: &'a [f64],
    /// Row by row.
    pub(super) values: &'a [f64],
    pub(super) nuggets: &'a [f64],
}

impl Samples<'_> {
    /// The squared exponential of one length of largest evidence, and that evidence, where these stand for `m` columns.
    pub(super) fn smooth_kernel(&self, m: usize, size: f64) -> Option<(Kernel, f64)> {
        let of = |scale: f64, length: f64, nugget: f64| {
            let metric = Metric { lengths: vec![length; self.d], ..Metric::default() };
            Kernel { shape: Shape::SquaredExponential, size, scale, metric, nugget }
        };
        let candidates: Vec<Kernel> = SCALES
            .iter()
            .flat_map(|scale| LENGTHS.map(|length| (*scale, length)))
            .flat_map(|(scale, length)| NUGGETS.map(|nugget| of(scale, length, nugget)))
            .collect();
        let evidences: Vec<f64> =
            candidates.par_iter().map(|kernel| self.evidence(m, kernel)).collect();
        let found = candidates.into_iter().zip(evidences);
        let found = found.filter(|(_, evidence)| evidence.is_finite());
        found.reduce(|a, b| if b.1 > a.1 { b } else { a })
    }

    /// Log marginal likelihood of a covariance times the prior of its metric over that of none, without its constant, where these stand
    /// for `m` columns: values that were narrowed have fewer.
    pub(super) fn evidence(&self, m: usize, kernel: &Kernel) -> f64 {
        let half = HalfFit::new(self, kernel);
        half.map_or(f64::NEG_INFINITY, |half| half.evidence(m) + kernel.metric.ln_prior())
    }

    /// The same, and its slopes (C. E. Rasmussen, C. K. I. Williams (2006), section 5.4.1): by an element of the covariance K they are those
    /// of `(a a^T - m K^-1)/2` with `a = K^-1 values`.
    pub(super) fn evidence_and_slopes(&self, m: usize, kernel: &Kernel) -> Option<(f64, Slopes)> {
        let Samples { d, points, nuggets, .. } = *self;
        let n = nuggets.len();
        let half = HalfFit::new(self, kernel)?;
        let evidence = half.evidence(m) + kernel.metric.ln_prior();
        let HalfFit { rows, points: ready, factor, solved } = half;
        let mut by = inverse_of_factored(&factor, n);
        let (a, width) = (upper_solve(&factor, solved, n), self.values.len() / n);
        let mut sloped = vec![[0.0; 2]; n];
        let (mut scale, mut nugget, mut by_measured) = (0.0, 0.0, vec![0.0; n * d]);
        for (i, row) in rows.chunks_exact(2 * d).enumerate() {
            let by = &mut by[i * n..=i * n + i];
            wide(
                #[inline(always)]
                || {
                    let own = &a[i * width..(i + 1) * width];
                    for (j, by) in by.iter_mut().enumerate() {
                        let product = dot(own, &a[j * width..(j + 1) * width]);
                        *by = 0.5 * (product - m as f64 * *by);
                    }
                },
            );
            kernel.sloped_row(row, &ready, &mut sloped[..=i]);
            let covariances: Vec<f64> =
                sloped[..i].iter().map(|[covariance, _]| *covariance).collect();
            // Every element below the diagonal stands for two.
            let [of_nugget, near] = kernel.nugget_of(nuggets[i]);
            nugget += 2.0 * by[i] * of_nugget * near;
            scale += 4.0 * dot(&by[..i], &covariances);
            scale += 2.0 * by[i] * sloped[i][0] * (1.0 + ROUNDING);
            let (before, own) = by_measured.split_at_mut(i * d);
            let others = rows.chunks_exact(2 * d).zip(before.chunks_exact_mut(d));
            for ((by, [_, slope]), (other, before)) in by.iter().zip(&sloped[..i]).zip(others) {
                let by = 4.0 * by * slope;
                for k in 0..d {
                    let way = by * (row[d + k] - other[d + k]);
                    own[k] += way;
                    before[k] -= way;
                }
            }
        }
        let metric = kernel.metric.slopes(points, &by_measured);
        Some((evidence, Slopes { scale, metric, nugget }))
    }
}

/// Slopes of the evidence by the logarithms of the scale, of the lengths and of the factor on the nuggets, and by how coordinates are
/// mixed and bent.
pub(super) struct Slopes {
    pub(super) scale: f64,
    pub(super) metric: Metric,
    pub(super) nugget: f64,
}

/// What the evidence of one kernel takes: half of the way to the process.
pub(super) struct HalfFit {
    /// Samples, [extended](Kernel::extend), row by row and in blocks.
    rows: Vec<f64>,
    points: Points,
    /// Lower Cholesky factor L of the covariance, row by row.
    factor: Vec<f64>,
    /// `L^-1 values`, row by row.
    pub(super) solved: Vec<f64>,
}

impl HalfFit {
    pub(super) fn new(samples: &Samples<'_>, k: &Kernel) -> Option<Self> {
        let Samples { d, points, values, nuggets } = *samples;
        let n = nuggets.len();
        let rows = k.extended(points, d);
        let points = Points::new(2 * d, &rows);
        let mut matrix = vec![0.0; n * n];
        for (i, row) in rows.chunks_exact(2 * d).enumerate() {
            k.row(row, &points, &mut matrix[i * n..=i * n + i]);
            let [nugget, _] = k.nugget_of(nuggets[i]);
            matrix[i * n + i] = matrix[i * n + i] * (1.0 + ROUNDING) + nugget * nugget;
        }
        let factor = large_cholesky(&matrix, n)?;
        let solved = lower_solve(&factor, values.to_vec(), n);
        Some(Self { rows, points, factor, solved })
    }

    /// Log marginal likelihood of `m` columns, without its constant.
    fn evidence(&self, m: usize) -> f64 {
        let n = self.factor.len().isqrt();
        let ln_det: f64 = (0..n).map(|i| self.factor[i * n + i].ln()).sum();
        -0.5 * self.solved.iter().map(|c| c * c).sum::<f64>() - m as f64 * ln_det
    }
}

/// The process with one kernel.
pub(super) struct Fit {
    pub(super) points: Points,
    pub(super) coefficients: Vec<f64>,
    /// Lower Cholesky factor of the covariance, row by row.
    pub(super) factor: Vec<f64>,
}

impl Fit {
    pub(super) fn new(samples: &Samples<'_>, k: &Kernel) -> Option<Self> {
        let n = samples.nuggets.len();
        let HalfFit { points, factor, solved, .. } = HalfFit::new(samples, k)?;
        let c = upper_solve(&factor, solved, n);
        c.iter().all(|c| c.is_finite()).then_some(Self { points, coefficients: c, factor })
    }

    /// Values minus their predictions from the other samples, `c_i / (K^-1)_ii`, row by row, and the variance of each row in squared
    /// units, `1 / (K^-1)_ii`.
    pub(super) fn left_out(&self, units: &[f64]) -> [Vec<f64>; 2] {
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
        let off =
            rows.flat_map(|(row, d)| row.iter().zip(units).map(move |(c, unit)| unit * c / d));
        [off.collect(), diagonal.iter().map(|d| 1.0 / d).collect()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_the_evidence_are_those_of_its_differences() {
        let (n, d, m) = (17, 3, 5);
        let wave = |by: f64, count: usize| (0..count).map(move |i| (1.0 + by * i as f64).sin());
        let points: Vec<f64> = wave(0.754_877_67, n * d).collect();
        // Two columns that stand for five.
        let values: Vec<f64> = wave(1.324_717_96, n * 2).collect();
        let nuggets: Vec<f64> = (0..n).map(|i| 0.05 * i as f64).collect();
        let samples = Samples { d, points: &points, values: &values, nuggets: &nuggets };
        for shape in [Shape::Matern, Shape::SquaredExponential] {
            let kernel = |x: &[f64]| Kernel {
                shape,
                size: 2.0,
                scale: x[0].exp(),
                metric: Metric {
                    lengths: x[1..4].iter().map(|x| x.exp()).collect(),
                    mixed: x[5..8].to_vec(),
                    bent: x[8..].to_vec(),
                },
                nugget: x[4].exp(),
            };
            let at = [0.3, -0.5, 0.2, 0.9, -0.7, 0.4, -0.6, 0.3, 0.8, 0.0, -1.7];
            let (evidence, slopes) =
                samples.evidence_and_slopes(m, &kernel(&at)).expect("definite");
            assert!((evidence - samples.evidence(m, &kernel(&at))).abs() < 1e-9);
            let Metric { lengths, mixed, bent } = slopes.metric;
            let found = [&[slopes.scale][..], &lengths, &[slopes.nugget], &mixed, &bent].concat();
            for (i, found) in found.iter().enumerate() {
                let off = |by: f64| {
                    let mut x = at;
                    x[i] += by;
                    samples.evidence(m, &kernel(&x))
                };
                let exact = (8.0 * (off(1e-3) - off(-1e-3)) - (off(2e-3) - off(-2e-3))) / 12e-3;
                assert!(
                    (found - exact).abs() < 1e-6 * exact.abs().max(1.0),
                    "{i}: {found} {exact}"
                );
            }
        }
    }
}
