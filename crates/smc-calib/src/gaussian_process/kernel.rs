//! Covariances of a Gaussian process, the search for the one of largest evidence, and the fit of one.

use crate::cholesky::{large_cholesky, packed_inverse};
use crate::lanes::{LANES, exp_of_nonpositive};
use crate::nelder_mead::{Start, best_of};
use crate::sobol::MAX_DIMENSIONS;
use rayon::prelude::*;

/// Candidates for the squared exponential's standard deviation and length, the latter in standard deviations of the
/// samples as they are weighted now.
const SCALES: [f64; 6] = [0.3, 1.0, 4.0, 16.0, 64.0, 256.0];
const LENGTHS: [f64; 4] = [0.7, 1.5, 3.0, 6.0];
/// Lengths that the search over the prior's cube starts from; the cube is two wide.
const STARTS: [f64; 3] = [0.5, 1.5, 4.0];
/// Candidates for the factor on the nuggets.
const NUGGETS: [f64; 3] = [1.0, 0.1, 0.01];
/// First step of the search, in logarithms.
const STEP: f64 = 0.7;
/// Logarithms that lengths and the factor on the nuggets stay between.
const LN_LENGTH: [f64; 2] = [-4.0, 4.0];
const LN_NUGGET: [f64; 2] = [-5.0, 0.0];
/// The same of the scale over the values' root mean square, which it starts from (one where that is less): log likelihoods in the
/// prior are thousands below the best one.
const LN_SCALE: [f64; 2] = [-6.0, 6.0];
/// Evaluations of the evidence by the search, per number that is searched.
const SEARCH: usize = 40;
/// Nugget up to which the factor of a covariance acts: what far samples are off by beyond it does not shrink with it.
const NEAR: f64 = 0.6;

/// A covariance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Kernel {
    /// `quadratic (1 + a b)^2 + scale^2 exp(-|a - b|^2 / (2 length^2))`
    Smooth { quadratic: f64, scale: f64, length: f64, nugget: f64 },
    /// `mean(a, b) + scale^2 shape(sum ((a - b)/length)^2)`, with a length for every parameter.
    Searched { shape: Shape, size: f64, scale: f64, lengths: Vec<f64>, nugget: f64 },
}

/// How a covariance whose lengths are searched falls with the distance r, and what its mean function is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// `(1 + s + s^2/3) exp(-s)` with `s^2 = 5 r^2`, about a linear function `size (1 + a b)`.
    Matern,
    /// `exp(-r^2/2)`, about a quadratic `size (1 + a b)^2`.
    SquaredExponential,
}

impl Kernel {
    /// Factor on the nuggets up to [`NEAR`].
    pub(super) fn nugget(&self) -> f64 {
        match self {
            Self::Smooth { nugget, .. } | Self::Searched { nugget, .. } => *nugget,
        }
    }

    /// Covariances of a with points, row by row.
    pub(super) fn row(&self, a: &[f64], points: &[f64], out: &mut [f64]) {
        let mut inverse = [0.0; MAX_DIMENSIONS];
        match self {
            Self::Smooth { quadratic, scale, length, .. } => {
                let variance = scale * scale;
                inverse.fill(1.0 / length);
                each(a, points, &inverse, out, |dot, square| {
                    quadratic * dot * dot + variance * exp_of_nonpositive(-0.5 * square)
                });
            }
            Self::Searched { shape, size, scale, lengths, .. } => {
                let variance = scale * scale;
                inverse.iter_mut().zip(lengths).for_each(|(i, length)| *i = 1.0 / length);
                match shape {
                    Shape::Matern => each(a, points, &inverse, out, |dot, square| {
                        let s = (5.0 * square).sqrt();
                        size * dot + variance * (1.0 + s + s * s / 3.0) * exp_of_nonpositive(-s)
                    }),
                    Shape::SquaredExponential => each(a, points, &inverse, out, |dot, square| {
                        size * dot * dot + variance * exp_of_nonpositive(-0.5 * square)
                    }),
                }
            }
        }
    }
}

/// `covariance(1 + a b, sum ((a - b) inverse)^2)` of a with points b, row by row, in lanes.
fn each(
    a: &[f64],
    points: &[f64],
    inverse: &[f64],
    out: &mut [f64],
    covariance: impl Fn(f64, f64) -> f64,
) {
    for (points, out) in points.chunks(LANES * a.len()).zip(out.chunks_mut(LANES)) {
        let (mut dots, mut squares) = ([1.0; LANES], [0.0; LANES]);
        for (k, b) in points.chunks_exact(a.len()).enumerate() {
            for ((a, b), inverse) in a.iter().zip(b).zip(inverse) {
                let step = (a - b) * inverse;
                dots[k] += a * b;
                squares[k] += step * step;
            }
        }
        let values: [f64; LANES] = std::array::from_fn(|k| covariance(dots[k], squares[k]));
        out.copy_from_slice(&values[..out.len()]);
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
    /// The smooth covariance of largest evidence, where these stand for `m` columns.
    pub(super) fn smooth_kernel(&self, m: usize, quadratic: f64) -> Option<Kernel> {
        let candidates: Vec<Kernel> = SCALES
            .iter()
            .flat_map(|scale| LENGTHS.map(|length| (*scale, length)))
            .flat_map(|(scale, length)| {
                NUGGETS.map(|nugget| Kernel::Smooth { quadratic, scale, length, nugget })
            })
            .collect();
        let evidences: Vec<f64> =
            candidates.par_iter().map(|kernel| self.evidence(m, kernel)).collect();
        let found = candidates.into_iter().zip(evidences);
        let found = found.filter(|(_, evidence)| evidence.is_finite());
        found.reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(kernel, _)| kernel)
    }

    /// The covariance of this shape of largest evidence.
    pub(super) fn searched_kernel(&self, m: usize, shape: Shape, size: f64) -> Option<Kernel> {
        let d = self.d;
        let bounds = |i: usize| match i {
            0 => LN_SCALE,
            i if i > d => LN_NUGGET,
            _ => LN_LENGTH,
        };
        let clamped = |i: usize, x: f64| x.clamp(bounds(i)[0], bounds(i)[1]);
        // The size of coefficients is one more than the mean square.
        let unit = (size - 1.0).sqrt().max(1.0);
        let kernel = |x: &[f64]| Kernel::Searched {
            shape,
            size,
            scale: unit * clamped(0, x[0]).exp(),
            lengths: (1..=d).map(|i| clamped(i, x[i]).exp()).collect(),
            nugget: clamped(d + 1, x[d + 1]).exp(),
        };
        let numbers = d + 2;
        let mut axes = vec![0.0; numbers * numbers];
        (0..numbers).for_each(|i| axes[i * numbers + i] = STEP);
        axes[numbers * numbers - 1] = -STEP;
        let starts = STARTS.map(|length| {
            let mut point = vec![length.ln(); numbers];
            point[0] = 0.0;
            point[d + 1] = 0.0;
            Start { point, axes: axes.clone() }
        });
        let mut evidence = |x: &[f64]| {
            let beyond: f64 = x.iter().enumerate().map(|(i, x)| (x - clamped(i, *x)).abs()).sum();
            self.evidence(m, &kernel(x)) - beyond
        };
        let (x, best, _) = best_of(&starts, SEARCH * numbers, &mut evidence);
        best.is_finite().then(|| kernel(&x))
    }

    /// Log marginal likelihood of a covariance, without its constant, where these stand for `m` columns: values that were
    /// narrowed have fewer.
    pub(super) fn evidence(&self, m: usize, kernel: &Kernel) -> f64 {
        let half = HalfFit::new(self, kernel);
        half.map_or(f64::NEG_INFINITY, |half| half.evidence(m))
    }
}

/// What the evidence of one kernel takes: half of the way to the process.
pub(super) struct HalfFit {
    /// Lower Cholesky factor L of the covariance, row by row.
    factor: Vec<f64>,
    /// `L^-1 values`, row by row.
    pub(super) solved: Vec<f64>,
}

impl HalfFit {
    pub(super) fn new(samples: &Samples<'_>, k: &Kernel) -> Option<Self> {
        let Samples { d, points, values, nuggets } = *samples;
        let n = nuggets.len();
        let m = values.len() / n;
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            let point = &points[i * d..(i + 1) * d];
            k.row(point, &points[..(i + 1) * d], &mut matrix[i * n..=i * n + i]);
            let nugget = k.nugget() * nuggets[i].min(NEAR) + (nuggets[i] - NEAR).max(0.0);
            matrix[i * n + i] = matrix[i * n + i] * (1.0 + 1e-11) + nugget * nugget;
        }
        let factor = large_cholesky(&matrix, n)?;
        let mut solved = values.to_vec();
        for i in 0..n {
            let (before, rest) = solved.split_at_mut(i * m);
            let row = &mut rest[..m];
            for (l, other) in factor[i * n..].iter().zip(before.chunks_exact(m)) {
                row.iter_mut().zip(other).for_each(|(r, o)| *r -= l * o);
            }
            row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
        }
        Some(Self { factor, solved })
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
    pub(super) coefficients: Vec<f64>,
    /// Lower Cholesky factor of the covariance, row by row.
    pub(super) factor: Vec<f64>,
}

impl Fit {
    pub(super) fn new(samples: &Samples<'_>, k: &Kernel) -> Option<Self> {
        let n = samples.nuggets.len();
        let m = samples.values.len() / n;
        let HalfFit { factor, solved: mut c } = HalfFit::new(samples, k)?;
        for i in (0..n).rev() {
            let (before, rest) = c.split_at_mut(i * m);
            let row = &mut rest[..m];
            row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
            for (l, other) in factor[i * n..].iter().zip(before.chunks_exact_mut(m)) {
                other.iter_mut().zip(&*row).for_each(|(o, r)| *o -= l * r);
            }
        }
        c.iter().all(|c| c.is_finite()).then_some(Self { coefficients: c, factor })
    }

    /// Values minus their predictions from the other samples, `c_i / (K^-1)_ii`.
    pub(super) fn left_out(&self, units: &[f64]) -> Vec<f64> {
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
