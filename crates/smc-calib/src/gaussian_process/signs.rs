//! Draws of a process of which nothing but signs is known at the samples.
//!
//! Values with these signs are drawn by elliptical slice sampling (I. Murray, R. P. Adams, D. J. C. MacKay, Proc. AISTATS 9 (2010)
//! 541): `v cos t + e sin t` for a draw e of the process and the first angle t, of a shrinking range about zero, at which all signs are
//! right.

use super::GaussianProcess;
use super::kernel::{Fit, Samples};
use crate::cholesky::{add_multiple, dot, lower_times};
use crate::stream::normals;
use rand::{Rng, RngExt as _};
use std::f64::consts::TAU;

/// Steps of the sampling before the first draw, and from one to the next.
const STEPS: [usize; 2] = [300, 60];
/// Most angles that one step tries.
const ANGLES: usize = 60;

/// Values at the samples, `L x`, and x.
struct State {
    values: Vec<f64>,
    x: Vec<f64>,
}

impl State {
    /// The next one that has the same signs.
    fn step(&mut self, factor: &[f64], rng: &mut impl Rng) {
        let x = normals(self.x.len(), rng);
        let values = lower_times(factor, &x);
        let mut angle = TAU * rng.random::<f64>();
        let (mut least, mut most) = (angle - TAU, angle);
        for _ in 0..ANGLES {
            let (sin, cos) = angle.sin_cos();
            let turned = |(old, new): (&f64, &f64)| old * cos + new * sin;
            if self.values.iter().zip(&values).all(|(v, new)| turned((v, new)) * v > 0.0) {
                self.values = self.values.iter().zip(&values).map(turned).collect();
                self.x = self.x.iter().zip(&x).map(turned).collect();
                return;
            }
            if angle < 0.0 {
                least = angle;
            } else {
                most = angle;
            }
            angle = least + (most - least) * rng.random::<f64>();
        }
    }
}

impl GaussianProcess {
    /// The same samples and values, in units of the columns, by a covariance whose lengths are this many times as long, with one
    /// nugget.
    pub(crate) fn longer(&self, times_as_long: f64, nugget: f64) -> Option<Self> {
        let mut longer = self.clone();
        let lengths = &mut longer.covariance.kernel.metric.lengths;
        lengths.iter_mut().for_each(|length| *length *= times_as_long);
        let values = lower_times(&self.factor, &self.solved_values());
        let nuggets = vec![nugget; values.len()];
        let points = self.points.own(values.len());
        let samples = Samples { d: self.d, points: &points, values: &values, nuggets: &nuggets };
        let fit = Fit::new(&samples, &longer.covariance.kernel)?;
        (longer.points, longer.coefficients, longer.factor) =
            (fit.points, fit.coefficients, fit.factor);
        Some(longer)
    }

    /// `L^-1 v = L^T c` of the values v of one column, with its coefficients c.
    fn solved_values(&self) -> Vec<f64> {
        let n = self.coefficients.len();
        let mut x = vec![0.0; n];
        for (i, row) in self.factor.chunks_exact(n).enumerate() {
            add_multiple(&mut x[..=i], self.coefficients[i], &row[..=i]);
        }
        x
    }

    /// Draws at points z, where values of its one column at the samples may be any that have their signs.
    pub(crate) fn draws_of_signs(
        &self,
        z: &[f64],
        draws: usize,
        rng: &mut impl Rng,
    ) -> Vec<Vec<f64>> {
        let (factor_of_errors, solved) = self.errors_at(z);
        let x = self.solved_values();
        let mut state = State { values: lower_times(&self.factor, &x), x };
        (0..STEPS[0]).for_each(|_| state.step(&self.factor, rng));
        let mut draw = || {
            (0..STEPS[1]).for_each(|_| state.step(&self.factor, rng));
            let errors = lower_times(&factor_of_errors, &normals(solved.len(), rng));
            solved.iter().zip(errors).map(|(solved, e)| dot(solved, &state.x) + e).collect()
        };
        (0..draws).map(|_| draw()).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::gaussian_process::{Covariance, Data, GaussianProcess};
    use crate::stream::{Purpose, stream};
    use std::f64::consts::PI;

    fn through(z: &[f64], covariance: Covariance<'_>) -> GaussianProcess {
        let n = z.len();
        GaussianProcess::new(Data {
            d: 1,
            z,
            weights: &vec![1.0; n],
            chosen: &(0..n).collect::<Vec<_>>(),
            values: &z.iter().map(|z| if *z < 0.3 { -1.0 } else { 1.0 }).collect::<Vec<_>>(),
            nuggets: &vec![0.1; n],
            offsets: vec![0.0],
            units: vec![1.0],
            covariance,
        })
        .expect("has spread")
    }

    #[test]
    fn signs_beside_two_samples_have_the_probabilities_of_orthants_of_three_normal_numbers() {
        const DRAWS: usize = 4000;
        let found = through(&[-1.2, -0.4, 0.2, 0.7, 1.9], Covariance::Search).covariance;
        let process = through(&[-0.4, 0.7], Covariance::Like(&found));
        for process in [process.longer(3.0, 0.1).expect("definite"), process] {
            let place = |z: f64| process.coordinates(&[z]);
            let points = [place(-0.4), place(0.7)];
            let kernel = &process.covariance.kernel;
            let of = |a: &[f64], b: &[f64]| kernel.between(a, b);
            let noisy = |a: usize| of(&points[a], &points[a]) + (0.1 * kernel.nugget).powi(2_i32);
            let z = [-0.9, -0.2, 0.0, 0.3, 0.6, 1.4];
            let draws = process.draws_of_signs(&z, DRAWS, &mut stream(1, Purpose::Errors, 0, 0));
            for (k, z) in z.iter().enumerate() {
                let x = place(*z);
                let with = |a: usize| of(&points[a], &x) / (noisy(a) * of(&x, &x)).sqrt();
                let both = of(&points[0], &points[1]) / (noisy(0) * noisy(1)).sqrt();
                let two = 0.25 - both.asin() / (2.0 * PI);
                let angles = -both.asin() - with(0).asin() + with(1).asin();
                let exact = (0.125 + angles / (4.0 * PI)) / two;
                let positive = draws.iter().filter(|draw| draw[k] > 0.0).count();
                let share = positive as f64 / DRAWS as f64;
                assert!((share - exact).abs() < 0.03, "{z}: {share} {exact}");
            }
        }
    }

    #[test]
    fn draws_have_the_signs_of_all_samples() {
        let z: Vec<f64> = (0..30).map(|i| 0.1 * f64::from(i) - 1.4).collect();
        let process = through(&z, Covariance::Search);
        // Where the nugget is small, draws at the samples are those of the samples.
        let draws = process.draws_of_signs(&z, 50, &mut stream(1, Purpose::Errors, 0, 0));
        let wrong = draws.iter().flat_map(|draw| draw.iter().zip(&z));
        let wrong = wrong.filter(|(value, z)| (**value > 0.0) != (**z >= 0.3)).count();
        assert!(wrong <= 50, "{wrong} of 1500");
        let apart = draws.windows(2).filter(|pair| (pair[0][0] - pair[1][0]).abs() > 1e-3).count();
        assert!(apart > 40, "{apart} of 49 differ from the one before");
    }
}
