//! A Gaussian process through simulated values: a cheap stand-in that says where to simulate next.
//!
//! It decides only where samples are placed, and takes noise out of estimates ([`crate::control`]); weights come from
//! the true likelihood.
//!
//! Two covariances are tried, the same for all columns, and the one of larger marginal likelihood is taken
//! (C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), sections 2.7, 4.2 and 5.4):
//!
//! - over normal scores, whitened by the samples' weights: a quadratic whose coefficients are as good as unknown, plus a
//!   squared exponential, its scale and length from a small table. Exact for a normal posterior.
//! - over the prior's cube: a linear function with unknown coefficients, plus a Matern covariance of order 5/2 with a length
//!   for every parameter; scale and lengths by a search. It does not move with the weights and knows regimes that begin
//!   somewhere in the prior.
//!
//! Each sample has a nugget of its own: curves far from the data need not be met closely. The error of the process is
//! measured by leaving out each sample in turn (the same, section 5.4.2).

use crate::cholesky::{cholesky, narrow, packed_inverse, whiten, whitening};
use crate::nelder_mead::{Start, best_of};
use crate::normal;
use crate::sobol::MAX_DIMENSIONS;
use rayon::prelude::*;

/// Candidates for the squared exponential's standard deviation and length, the latter in standard deviations of the
/// samples as they are weighted now.
const SCALES: [f64; 4] = [0.3, 1.0, 4.0, 16.0];
const LENGTHS: [f64; 4] = [0.7, 1.5, 3.0, 6.0];
/// Lengths that the search over the prior's cube starts from; the cube is two wide.
const STARTS: [f64; 3] = [0.5, 1.5, 4.0];
/// First step of the search, in logarithms.
const STEP: f64 = 0.7;
/// Logarithms that lengths and the scale stay between.
const LN_LENGTH: [f64; 2] = [-4.0, 4.0];
const LN_SCALE: [f64; 2] = [-6.0, 6.0];
/// Evaluations of the evidence by the search, per number that is searched.
const SEARCH: usize = 40;
/// Samples that the search looks at: the best ones.
const SEARCHED: usize = 80;

/// Columns of numbers as a function of normal scores.
#[derive(Clone, Debug)]
pub(crate) struct GaussianProcess {
    d: usize,
    place: Place,
    /// Samples in these coordinates, row by row, and the coefficients of each, one per column.
    points: Vec<f64>,
    coefficients: Vec<f64>,
    kernel: Kernel,
    /// The rough covariance that was tried, whichever was taken.
    pub rough: Option<Kernel>,
    /// Mean and unit of each column.
    offsets: Vec<f64>,
    units: Vec<f64>,
    /// Value of every column at every sample minus its prediction from the other samples.
    pub left_out: Vec<f64>,
}

/// The coordinates of a kernel.
#[derive(Clone, Debug)]
enum Place {
    /// Whitened normal scores: centre and packed inverse factor.
    Whitened(Vec<f64>, Vec<f64>),
    /// The prior's cube, from -1 to 1.
    Cube,
}

impl Place {
    fn of(&self, z: &[f64], out: &mut [f64]) {
        match self {
            Self::Whitened(centre, inverse) => whiten(z, centre, inverse, out),
            Self::Cube => {
                out.iter_mut().zip(z).for_each(|(o, z)| *o = 2.0 * normal::cdf(*z) - 1.0);
            }
        }
    }
}

/// A covariance.
#[derive(Clone, Debug)]
pub(crate) enum Kernel {
    /// `quadratic (1 + a b)^2 + scale^2 exp(-|a - b|^2 / (2 length^2))`
    Smooth { quadratic: f64, scale: f64, length: f64 },
    /// `linear (1 + a b) + scale^2 (1 + r + r^2/3) exp(-r)` with `r^2 = 5 sum ((a - b)/length)^2`
    Rough { linear: f64, scale: f64, lengths: Vec<f64> },
}

impl Kernel {
    fn of(&self, a: &[f64], b: &[f64]) -> f64 {
        match self {
            Self::Smooth { quadratic, scale, length } => {
                let (mut dot, mut square) = (1.0, 0.0);
                for (a, b) in a.iter().zip(b) {
                    dot += a * b;
                    square += (a - b) * (a - b);
                }
                quadratic * dot * dot + scale * scale * (-0.5 * square / (length * length)).exp()
            }
            Self::Rough { linear, scale, lengths } => {
                let (mut dot, mut square) = (1.0, 0.0);
                for ((a, b), length) in a.iter().zip(b).zip(lengths) {
                    dot += a * b;
                    square += ((a - b) / length).powi(2);
                }
                let r = (5.0 * square).sqrt();
                linear * dot + scale * scale * (1.0 + r + r * r / 3.0) * (-r).exp()
            }
        }
    }
}

/// Data of a process.
pub(crate) struct Data<'a> {
    pub d: usize,
    /// Samples, row by row.
    pub z: &'a [f64],
    /// Weights whose covariance whitens the samples.
    pub weights: &'a [f64],
    /// Numbers of the samples that the process runs through, the best first.
    pub chosen: &'a [usize],
    /// Values at these samples, row by row.
    pub values: &'a [f64],
    /// Standard deviation of the nugget of each, in units of the columns.
    pub nuggets: &'a [f64],
    /// Offset and unit of each column.
    pub offsets: Vec<f64>,
    pub units: Vec<f64>,
    pub covariance: Covariance<'a>,
}

/// Where the covariance of a process comes from.
#[derive(Clone, Copy)]
pub(crate) enum Covariance<'a> {
    /// The better of the best smooth and the best rough one.
    Search,
    /// The better of the best smooth one and this rough one.
    Rough(&'a Kernel),
    /// That of another process.
    Like(&'a GaussianProcess),
}

impl GaussianProcess {
    /// The process through some data; none where they have no spread.
    pub(crate) fn new(data: Data<'_>) -> Option<Self> {
        let (d, m) = (data.d, data.units.len());
        let mut values = data.values.to_vec();
        for row in values.chunks_exact_mut(m) {
            for ((v, offset), unit) in row.iter_mut().zip(&data.offsets).zip(&data.units) {
                *v = (*v - offset) / unit;
            }
        }
        let at = |place: &Place| {
            let mut points = vec![0.0; data.chosen.len() * d];
            for (i, x) in data.chosen.iter().zip(points.chunks_exact_mut(d)) {
                place.of(&data.z[i * d..(i + 1) * d], x);
            }
            points
        };
        let mut rough = None;
        let (fit, kernel, place, points) = if let Covariance::Like(like) = data.covariance {
            let points = at(&like.place);
            let fit = Fit::new(d, &points, &values, data.nuggets, &like.kernel)?;
            (fit, like.kernel.clone(), like.place.clone(), points)
        } else {
            // Coefficients of the mean: of the size of the values.
            let size = 1.0 + values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64;
            let (centre, inverse) = whitening(d, data.z, data.weights)?;
            let mut found = [Place::Whitened(centre, inverse), Place::Cube].map(|place| {
                let points = at(&place);
                let kernel = match (&place, data.covariance) {
                    (Place::Whitened(..), _) => {
                        smooth_kernel(d, &points, &values, data.nuggets, size)
                    }
                    (Place::Cube, Covariance::Rough(known)) => Some(known.clone()),
                    (Place::Cube, _) => rough_kernel(d, &points, &values, data.nuggets, size),
                };
                kernel.and_then(|kernel| {
                    let fit = Fit::new(d, &points, &values, data.nuggets, &kernel)?;
                    Some((fit, kernel, place, points))
                })
            });
            rough = found[1].as_ref().map(|(_, kernel, ..)| kernel.clone());
            // Of equal ones the first.
            let better = |a: Found, b: Found| if b.0.evidence > a.0.evidence { b } else { a };
            found.iter_mut().filter_map(Option::take).reduce(better)?
        };
        let left_out = fit.left_out(&data.units);
        let coefficients = fit.coefficients;
        let (offsets, units) = (data.offsets, data.units);
        Some(Self { d, place, points, coefficients, kernel, rough, offsets, units, left_out })
    }

    /// Predicted values of all columns.
    pub(crate) fn predict(&self, z: &[f64], out: &mut [f64]) {
        let mut small = [0.0; MAX_DIMENSIONS];
        let x = &mut small[..self.d];
        self.place.of(z, x);
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

/// A process with one covariance: fit, covariance, and its coordinates and the points in them.
type Found = (Fit, Kernel, Place, Vec<f64>);

/// The smooth covariance of largest evidence.
fn smooth_kernel(
    d: usize,
    points: &[f64],
    values: &[f64],
    nuggets: &[f64],
    quadratic: f64,
) -> Option<Kernel> {
    let m = values.len() / nuggets.len();
    let candidates: Vec<Kernel> = SCALES
        .iter()
        .flat_map(|scale| LENGTHS.map(|length| Kernel::Smooth { quadratic, scale: *scale, length }))
        .collect();
    let evidences: Vec<f64> = candidates
        .par_iter()
        .map(|kernel| {
            let half = HalfFit::new(d, points, values, nuggets, kernel);
            half.map_or(f64::NEG_INFINITY, |half| half.evidence(m))
        })
        .collect();
    let found = candidates.into_iter().zip(evidences).filter(|(_, evidence)| evidence.is_finite());
    found.reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(kernel, _)| kernel)
}

/// The rough covariance of largest evidence, judged by the best samples.
fn rough_kernel(
    d: usize,
    points: &[f64],
    values: &[f64],
    nuggets: &[f64],
    linear: f64,
) -> Option<Kernel> {
    let n = nuggets.len();
    let m = values.len() / n;
    let few = n.min(SEARCHED);
    let (points, nuggets) = (&points[..few * d], &nuggets[..few]);
    let values = narrow(&values[..few * m], few);
    let bounds = |i: usize| if i == 0 { LN_SCALE } else { LN_LENGTH };
    let clamped = |i: usize, x: f64| x.clamp(bounds(i)[0], bounds(i)[1]);
    let kernel = |x: &[f64]| Kernel::Rough {
        linear,
        scale: clamped(0, x[0]).exp(),
        lengths: (1..=d).map(|i| clamped(i, x[i]).exp()).collect(),
    };
    let mut axes = vec![0.0; (d + 1) * (d + 1)];
    (0..=d).for_each(|i| axes[i * (d + 1) + i] = STEP);
    let starts = STARTS.map(|length| {
        let mut point = vec![length.ln(); d + 1];
        point[0] = 0.0;
        Start { point, axes: axes.clone() }
    });
    let mut evidence = |x: &[f64]| {
        let Some(half) = HalfFit::new(d, points, &values, nuggets, &kernel(x)) else {
            return f64::NEG_INFINITY;
        };
        let beyond: f64 = x.iter().enumerate().map(|(i, x)| (x - clamped(i, *x)).abs()).sum();
        half.evidence(m) - beyond
    };
    let (x, best, _) = best_of(&starts, SEARCH * (d + 1), &mut evidence);
    best.is_finite().then(|| kernel(&x))
}

/// What the evidence of one kernel takes: half of the way to the process.
struct HalfFit {
    /// Lower Cholesky factor L of the covariance, row by row.
    factor: Vec<f64>,
    /// `L^-1 values`, row by row.
    solved: Vec<f64>,
}

impl HalfFit {
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

    /// Log marginal likelihood of `m` columns, without its constant. Values that were narrowed have fewer.
    fn evidence(&self, m: usize) -> f64 {
        let n = self.factor.len().isqrt();
        let ln_det: f64 = (0..n).map(|i| self.factor[i * n + i].ln()).sum();
        -0.5 * self.solved.iter().map(|c| c * c).sum::<f64>() - m as f64 * ln_det
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
        let half = HalfFit::new(d, points, values, nuggets, k)?;
        let evidence = half.evidence(m);
        let HalfFit { factor, solved: mut c } = half;
        for i in (0..n).rev() {
            let (before, rest) = c.split_at_mut(i * m);
            let row = &mut rest[..m];
            row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
            for (l, other) in factor[i * n..].iter().zip(before.chunks_exact_mut(m)) {
                other.iter_mut().zip(&*row).for_each(|(o, r)| *o -= l * r);
            }
        }
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
        let inverse = packed_inverse(&self.factor, n);
        // Diagonal of the inverse: sums of squares of the columns of the factor's inverse.
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
        like(Covariance::Search, z, columns, value)
    }

    fn like(
        covariance: Covariance<'_>,
        z: &[f64],
        columns: usize,
        value: impl Fn(&[f64]) -> Vec<f64>,
    ) -> GaussianProcess {
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
            covariance,
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
        // The last sample predicted by the process through the others, with the same covariance.
        let without = like(Covariance::Like(&all), &z[..58], 2, wave);
        let mut predicted = [0.0; 2];
        without.predict(&z[58..], &mut predicted);
        for column in 0..2 {
            let error = wave(&z[58..])[column] - predicted[column];
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

    #[test]
    fn a_regime_that_begins_somewhere_in_the_prior_is_met_better_over_its_cube() {
        // Level up to a knee, then a line; the other parameter hardly matters.
        let knee = |z: &[f64]| vec![(normal::cdf(z[0]) - 0.4).max(0.0) + 0.01 * z[1]];
        let process = through(&points(60), 1, knee);
        let Kernel::Rough { lengths, .. } = &process.kernel else { panic!("{:?}", process.kernel) };
        assert!(lengths[1] > 4.0 * lengths[0], "{lengths:?}");
        for z in [[-1.5, 0.3], [-0.2, -0.9], [0.1, 1.2], [1.4, -1.0]] {
            let mut out = [0.0];
            process.predict(&z, &mut out);
            assert!((out[0] - knee(&z)[0]).abs() < 0.03, "{z:?}: {out:?} {:?}", knee(&z));
        }
    }

    #[test]
    fn evidence_does_not_change_when_many_columns_are_narrowed() {
        let z = points(12);
        let many: Vec<f64> = z
            .chunks_exact(2)
            .flat_map(|z| (0..40).map(|k| (z[0] + 0.1 * f64::from(k) * z[1]).sin()))
            .collect();
        let few = narrow(&many, 12);
        assert_eq!(few.len(), 12 * 12);
        let kernel = Kernel::Rough { linear: 1.0, scale: 0.7, lengths: vec![1.0, 2.0] };
        let squares = |values: &[f64]| {
            let half = HalfFit::new(2, &z, values, &[1e-2; 12], &kernel).expect("definite");
            half.solved.iter().map(|c| c * c).sum::<f64>()
        };
        let (a, b) = (squares(&many), squares(&few));
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
}
