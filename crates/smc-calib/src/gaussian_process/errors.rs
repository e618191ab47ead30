//! Errors of a process: from column to column, and at many points together.

use super::kernel::Points;
use super::{At, GaussianProcess};
use crate::cholesky::{add_multiple, dot, semidefinite_cholesky};
use crate::lanes::wide;

/// Variance, over that of the process at the same point before any sample, up to which rounding can have made it. With a hundredth of
/// this, errors at points in a row had up to 28 times their variance.
const ROUNDING: f64 = 1e-10;

/// Samples after which a variance is judged for the first time.
const BLOCK: usize = 32;

impl GaussianProcess {
    /// `L^-1 k` for coordinates x, with their covariances k with all samples and the lower factor L of that of the samples.
    fn solved(&self, x: &[f64]) -> Vec<f64> {
        self.solve(self.covariances(x), |_| false).0
    }

    /// The same from k, and the sum of its squares: of all numbers, or of the first [`BLOCK`], four times as many, and so on where that sum
    /// is `enough`.
    fn solve(&self, mut k: Vec<f64>, enough: impl Fn(f64) -> bool) -> (Vec<f64>, f64) {
        let squares = wide(
            #[inline(always)]
            || {
                let (n, mut squares, mut next) = (k.len(), 0.0, BLOCK);
                for (i, row) in self.factor.chunks_exact(n).enumerate() {
                    if i == next {
                        if enough(squares) {
                            break;
                        }
                        next *= 4;
                    }
                    k[i] = (k[i] - dot(&k[..i], &row[..i])) / row[i];
                    squares += k[i] * k[i];
                }
                squares
            },
        );
        (k, squares)
    }

    /// Variance of the process at z, in squared units of the columns: `k(z, z) - |L^-1 k|^2` (section 2.2 of the same).
    pub(crate) fn variance(&self, z: &[f64]) -> f64 {
        self.variance_at(self.at(z), |_| false)
    }

    /// The same at a point, or that by the first samples alone, which is the larger one, where it is small enough.
    pub(crate) fn variance_at(
        &self,
        At { x, covariances }: At,
        enough: impl Fn(f64) -> bool,
    ) -> f64 {
        let before = self.covariance.kernel.between(&x, &x);
        let left = |explained: f64| (before - explained).max(0.0);
        let (_, explained) = self.solve(covariances, |explained| enough(left(explained)));
        left(explained)
    }

    /// Principal components of the columns' covariance `V^T K^-1 V / n`, in their units: direction and variance of each, the largest
    /// first. `values` are the n rows that the process runs through (section 9.1 of the same; subspace iteration: G. H. Golub,
    /// C. F. Van Loan, Matrix Computations (2013), section 8.2.4).
    pub(crate) fn principal<'v>(
        &self,
        values: impl Iterator<Item = &'v [f64]>,
        count: usize,
    ) -> Vec<(Vec<f64>, f64)> {
        // Enough where one variance is two thirds of the next larger one.
        const STEPS: usize = 20;
        let m = self.units.len();
        let rows: Vec<f64> = values
            .flat_map(|row| row.iter().zip(self.offsets.iter().zip(&self.units)))
            .map(|(v, (offset, unit))| (v - offset) / unit)
            .collect();
        let n = (rows.len() / m) as f64;
        let multiplied = |x: &[f64]| {
            let mut sum = vec![0.0; m];
            for (row, c) in rows.chunks_exact(m).zip(self.coefficients.chunks_exact(m)) {
                let along = dot(c, x) / n;
                add_multiple(&mut sum, along, row);
            }
            sum
        };
        // Any directions that are not alike.
        let wave = |k: usize| (0..m).map(move |j| (1.0 + 0.618 * (j * (k + 1)) as f64).sin());
        let mut found: Vec<(Vec<f64>, f64)> =
            (0..count).map(|k| (wave(k).collect(), 0.0)).collect();
        for _ in 0..STEPS {
            for k in 0..count {
                let mut x = multiplied(&found[k].0);
                for (before, _) in &found[..k] {
                    let along = dot(before, &x);
                    add_multiple(&mut x, -along, before);
                }
                let length = dot(&x, &x).sqrt();
                if length > 0.0 {
                    x.iter_mut().for_each(|x| *x /= length);
                }
                found[k] = (x, length);
            }
        }
        found
    }

    /// Lower factor L of the covariance of its errors at points z, row by row, in squared units of the columns: with independent
    /// standard normal numbers x the errors of a column are `L x` (C. E. Rasmussen, C. K. I. Williams (2006), section 2.2 and A.2).
    pub(crate) fn factor_of_errors(&self, z: &[f64]) -> Vec<f64> {
        self.errors_at(z).0
    }

    /// The same, and `L^-1 k` of every point, with the lower factor L of the covariance of the samples and covariances k with them.
    pub(super) fn errors_at(&self, z: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let d = self.d;
        let m = z.len() / d;
        let x = self.coordinates(z);
        let solved: Vec<Vec<f64>> = x.chunks_exact(2 * d).map(|x| self.solved(x)).collect();
        let points = Points::new(2 * d, &x);
        let mut covariance = vec![0.0; m * m];
        let mut rounding = vec![0.0; m];
        for (a, row) in covariance.chunks_exact_mut(m).enumerate() {
            self.covariance.kernel.row(&x[2 * a * d..][..2 * d], &points, &mut row[..=a]);
            rounding[a] = ROUNDING * row[a];
            for (c, solved_b) in row.iter_mut().zip(&solved[..=a]) {
                *c -= dot(&solved[a], solved_b);
            }
        }
        (semidefinite_cholesky(&covariance, m, &rounding), solved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian_process::{Covariance, Data};

    #[test]
    fn errors_at_many_points_have_the_variance_of_each_and_the_covariance_that_a_further_sample_shows()
     {
        let z: Vec<f64> = (0..7).map(|i| 0.6 * f64::from(i) - 1.8).collect();
        let through = |z: &[f64], covariance| {
            let n = z.len();
            GaussianProcess::new(Data {
                d: 1,
                z,
                weights: &vec![1.0; n],
                chosen: &(0..n).collect::<Vec<_>>(),
                values: &z.iter().map(|z| (3.0 * z).sin()).collect::<Vec<_>>(),
                nuggets: &vec![1e-3; n],
                offsets: vec![0.0],
                units: vec![1.0],
                covariance,
            })
            .expect("has spread")
        };
        let process = through(&z, Covariance::Search);
        // The last is a point once more: its error is that of the first.
        let points = [-2.5, -1.5, 0.3, 2.4, -2.5];
        let l = process.factor_of_errors(&points);
        let covariance = |a: usize, b: usize| dot(&l[a * 5..(a + 1) * 5], &l[b * 5..(b + 1) * 5]);
        for (a, z) in points.iter().enumerate() {
            let variance = process.variance(&[*z]);
            assert!((covariance(a, a) - variance).abs() < 1e-6 + 1e-6 * variance, "{z}");
        }
        assert!((covariance(0, 4) - covariance(0, 0)).abs() < 1e-6 * covariance(0, 0));
        // With a sample at one of them the variance at another falls by their covariance squared over the variance and nugget there.
        let more = through(&[&z[..], &points[..1]].concat(), Covariance::Like(&process.covariance));
        for b in 1..4 {
            let nugget = 1e-3 * process.covariance.kernel.nugget;
            let explained = covariance(0, b).powi(2) / (covariance(0, 0) + nugget * nugget);
            let left = covariance(b, b) - explained;
            let exact = more.variance(&points[b..=b]);
            assert!((left - exact).abs() < 1e-6 + 1e-4 * exact, "{b}: {left} {exact}");
        }
    }

    #[test]
    fn errors_at_points_next_to_each_other_have_the_variance_of_each() {
        let z = [1.29, -0.34, 0.52, -0.74, 0.11, -1.86, 0.94, -0.13, 0.3, -1.2];
        let smooth = |z: &f64| 1.5 * (2.5 * z).sin() + (4.0 * z).cos() - 5.0 * z * z;
        let process = GaussianProcess::new(Data {
            d: 1,
            z: &z,
            weights: &[1.0; 10],
            chosen: &(0..10).collect::<Vec<_>>(),
            values: &z.iter().map(smooth).collect::<Vec<_>>(),
            nuggets: &[1e-3; 10],
            offsets: vec![0.0],
            units: vec![1.0],
            covariance: Covariance::Search,
        })
        .expect("has spread");
        for n in [7, 31, 64, 200] {
            let points: Vec<f64> = (0..n).map(|i| -1.5 + 3.0 * i as f64 / n as f64).collect();
            let l = process.factor_of_errors(&points);
            for (row, z) in l.chunks_exact(n).zip(&points) {
                let (found, exact) = (dot(row, row), process.variance(&[*z]));
                let x = process.at(&[*z]).x;
                let before = process.covariance.kernel.between(&x, &x);
                assert!(
                    (found - exact).abs() < 0.01 * exact + 1e-9 * before,
                    "{n} {z}: {found} {exact} {before}"
                );
            }
        }
    }
}
