//! Draws of what a stand-in does not know of the likelihood.

use super::unknown::{Unknown, moved};
use super::{Edge, StandIn, ln_alive};
use crate::cholesky::lower_times;
use crate::pool::Pool;
use crate::stream::{Purpose, normals, stream};
use rayon::prelude::*;

/// Largest square of an error, over its expected square, that counts.
const FARTHEST: f64 = 100.0;

impl StandIn<'_> {
    /// Whether its process runs through all samples of this pool that have a likelihood.
    pub(crate) fn runs_through_all(&self, pool: &Pool) -> bool {
        self.chosen.len() == pool.ln_l.iter().filter(|ln_l| ln_l.is_finite()).count()
    }

    /// Draws of the log likelihood at points z, less what is predicted there with a wide edge: errors of the
    /// process at all of them together, as large as those of samples that are left out, along each principal component of curves, and
    /// where simulations fail an edge anywhere between samples.
    pub(crate) fn ln_ratios(
        &self,
        pool: &Pool,
        z: &[f64],
        draws: usize,
        seed: u64,
    ) -> Vec<Vec<f64>> {
        let d = pool.d;
        let m = z.len() / d;
        let predicted: Vec<Vec<f64>> = z.chunks_exact(d).map(|z| self.predicted(z)).collect();
        let plain: Vec<f64> =
            predicted.iter().map(|values| self.ln_likelihood_of_predicted(values)).collect();
        let factor = self.process.factor_of_errors(z);
        let edge = self.failing.as_ref().map(|failing| {
            let ln_finished: Vec<f64> =
                z.chunks_exact(d).map(|z| self.ln_finished(z, Edge::WIDE)).collect();
            let mut rng = stream(seed, Purpose::Errors, 2, 0);
            (ln_finished, failing.draws(z, draws, &mut rng))
        });
        let unknown = self.unknown(pool);
        let directions = unknown.directions();
        let larger = self.larger(pool, &unknown);
        let draw = |k: usize| -> Vec<f64> {
            let mut rng = stream(seed, Purpose::Errors, 0, k);
            let mut errors = || lower_times(&factor, &normals(m, &mut rng));
            let along: Vec<Vec<f64>> = directions.iter().map(|_| errors()).collect();
            let ratio = |i: usize| {
                let mut values = predicted[i].clone();
                for (direction, errors) in directions.iter().zip(&along) {
                    values = moved(&values, &self.process.units, direction, larger * errors[i]);
                }
                self.ln_likelihood_of_predicted(&values) - plain[i]
            };
            let mut ratios: Vec<f64> = (0..m).map(ratio).collect();
            if let Some((ln_finished, drawn)) = &edge {
                for ((ratio, ln), finished) in ratios.iter_mut().zip(ln_finished).zip(&drawn[k]) {
                    *ratio += ln_alive(f64::from(u8::from(*finished))) - ln;
                }
            }
            ratios
        };
        (0..draws).into_par_iter().map(draw).collect()
    }

    /// Factor by which the errors of the process exceed what it says: the root mean square, over the best samples, each left out, of the
    /// error of the log likelihood over its expected root mean square, each ratio counting as 10 at most, and one at least (variance by
    /// cross validation: F. Bachoc, Comput. Stat. Data Anal. 66 (2013) 55). An expectation that is not finite says nothing: one.
    ///
    /// A smooth process through curves with kinks says too little: of 48 runs of 50 simulations of PA12 the third with the largest
    /// factors, 1.5 to 2.5, had means 2.3 standard errors off, the third with the smallest factors .5 standard errors.
    fn larger(&self, pool: &Pool, unknown: &Unknown) -> f64 {
        let square = |k: usize| {
            let (predicted, error) = self.left_out(pool, k);
            let (units, v) = (&self.process.units, self.process.left_out_variance[k]);
            let expected = unknown.mean_square(self.target, units, &predicted, v);
            match error {
                0.0 => 0.0,
                _ if expected.is_finite() => (error * error / expected).min(FARTHEST),
                _ => 1.0,
            }
        };
        let squares: Vec<f64> = (0..self.best).into_par_iter().map(square).collect();
        (squares.iter().sum::<f64>() / self.best as f64).max(1.0).sqrt()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::gaussian_process::Covariance;
    use crate::sampler::Sampler;
    use crate::small_budget::likelihood_process;
    use crate::small_budget::unknown::tests::Three;
    use crate::target::Target;
    use crate::{Settings, SimError};

    /// So many samples of a target by the default settings, in one net.
    pub(crate) fn sampled(target: &dyn Target, samples: usize) -> Pool {
        let settings = Settings { samples, replicates: 1, ..Settings::default() };
        let mut sampler = Sampler::new(target, &settings);
        sampler.run().expect("never fails");
        sampler.pool
    }

    /// A stand-in through all of them, of equal weights.
    pub(crate) fn through_all<'a>(target: &'a dyn Target, pool: &'a Pool) -> StandIn<'a> {
        let n = pool.len();
        StandIn::new(target, pool, &vec![1.0; n], 0..n, Covariance::Search).expect("has spread")
    }

    /// A parabola that is cut off below zero.
    struct Cut;

    impl Target for Cut {
        fn dimension(&self) -> usize {
            1
        }

        fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
            Ok(if z[0] < 0.0 { f64::NEG_INFINITY } else { -z[0] * z[0] })
        }
    }

    /// Mean over draws of curves, point by point, against the product of two normal densities.
    #[test]
    fn draws_of_curves_have_the_mean_that_two_normal_densities_have() {
        const DRAWS: usize = 4000;
        let pool = &sampled(&Three, 10);
        let stand_in = through_all(&Three, pool);
        assert!(stand_in.runs_through_all(pool));
        // Errors are hardly larger than the process says; of nine samples they are 1.13 times that.
        let larger = stand_in.larger(pool, &stand_in.unknown(pool));
        assert!(larger < 1.05, "{larger}");
        let z = [-2.2, -0.9, 0.3, 0.6, 2.4];
        let ratios = stand_in.ln_ratios(pool, &z, DRAWS, 3);
        let unknown = stand_in.unknown(pool);
        let mut unsure = 0;
        for (i, z) in z.iter().enumerate() {
            let predicted = stand_in.predicted(&[*z]);
            let mean = ratios.iter().map(|draw| draw[i].exp()).sum::<f64>() / DRAWS as f64;
            let plain = stand_in.ln_likelihood_of_predicted(&predicted);
            let exact = (stand_in.ln_mean(&unknown, &[*z], &predicted) - plain).exp();
            let squares = ratios.iter().map(|draw| (draw[i].exp() - mean).powi(2)).sum::<f64>();
            let error = squares.sqrt() / DRAWS as f64;
            assert!((mean - exact).abs() < 4.0 * error + 1e-3, "{z}: {mean} +- {error}, {exact}");
            unsure += usize::from((exact - 1.0).abs() > 0.1);
        }
        assert!(unsure > 0, "nothing is unknown");
    }

    /// A log likelihood with a kink.
    struct Kinked;

    impl Target for Kinked {
        fn dimension(&self) -> usize {
            1
        }

        fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
            Ok(-3.0 * (z[0] - 0.3).abs())
        }
    }

    #[test]
    fn drawn_errors_are_as_large_as_those_of_the_best_samples_that_are_left_out() {
        const DRAWS: usize = 4000;
        let pool = &sampled(&Kinked, 15);
        let stand_in = through_all(&Kinked, pool);
        // Each of them by a process through the others: that the best one is left out changes the mean too.
        let density = |i: usize| pool.ln_l[i] + pool.ln_prior(i);
        let depth = |i: &usize| density(stand_in.chosen[0]) - density(*i);
        let square = |k: usize| {
            let without = |j: &usize| *j != stand_in.chosen[k];
            let chosen: Vec<usize> = stand_in.chosen.iter().copied().filter(without).collect();
            let depths: Vec<f64> = chosen.iter().map(depth).collect();
            let found = Covariance::Like(&stand_in.process.covariance);
            let process = likelihood_process(pool, &[1.0; 15], &chosen, &depths, found);
            let (process, i) = (process.expect("fourteen samples"), stand_in.chosen[k]);
            let mut predicted = [0.0];
            process.predict(&pool.z[i..=i], &mut predicted);
            (predicted[0] - pool.ln_l[i]).powi(2) / stand_in.process.left_out_variance[k]
        };
        let best = stand_in.best;
        let exact = ((0..best).map(square).sum::<f64>() / best as f64).sqrt();
        let found = stand_in.larger(pool, &stand_in.unknown(pool));
        assert!(exact > 1.1 && (found / exact - 1.0).abs() < 0.02, "{found} {exact}");
        let z = [0.25];
        let ratios = stand_in.ln_ratios(pool, &z, DRAWS, 3);
        let squares = ratios.iter().map(|draw| draw[0] * draw[0]).sum::<f64>() / DRAWS as f64;
        let drawn = (squares / stand_in.process.variance(&z)).sqrt();
        assert!((drawn / found - 1.0).abs() < 0.05, "{drawn} {found}");
    }

    /// The same as a sum of outputs, one of which has the kink.
    struct KinkedCurve;

    const SUM: [f64; 2] = [-3.0, 0.2];

    impl Target for KinkedCurve {
        fn dimension(&self) -> usize {
            1
        }

        fn kept(&self) -> usize {
            2
        }

        fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
            kept.copy_from_slice(&[(z[0] - 0.3).abs(), z[0]]);
            Ok(self.ln_likelihood_of(kept).unwrap_or(f64::NAN))
        }

        fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
            Some(kept.iter().zip(SUM).map(|(k, a)| a * k).sum())
        }
    }

    #[test]
    fn errors_of_curves_exceed_what_is_said_as_those_of_their_log_likelihood_do() {
        let pool = &sampled(&KinkedCurve, 15);
        let stand_in = through_all(&KinkedCurve, pool);
        let unknown = stand_in.unknown(pool);
        // Of a sum of outputs the expected square is that of the same sum of every component of the errors.
        let process = &stand_in.process;
        let sum = |outputs: &[f64]| outputs.iter().zip(SUM).map(|(o, a)| a * o).sum::<f64>();
        let along = |direction: &&[f64]| {
            let of = |(b, unit): (&f64, &f64)| b * unit;
            sum(&direction.iter().zip(&process.units).map(of).collect::<Vec<_>>()).powi(2)
        };
        let of_one: f64 = unknown.directions().iter().map(along).sum();
        let of = |k: usize| {
            sum(&process.left_out[2 * k..2 * k + 2]).powi(2)
                / (of_one * process.left_out_variance[k])
        };
        let best = stand_in.best;
        let exact = ((0..best).map(of).sum::<f64>() / best as f64).sqrt();
        let found = stand_in.larger(pool, &unknown);
        assert!(exact > 1.02 && (found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    }

    #[test]
    fn an_edge_is_anywhere_between_finished_and_failed_samples() {
        const DRAWS: usize = 2000;
        let pool = &sampled(&Cut, 14);
        let stand_in = through_all(&Cut, pool);
        let failed = pool.z.iter().copied().filter(|z| *z < 0.0).fold(-9.0, f64::max);
        let finished = pool.z.iter().copied().filter(|z| *z >= 0.0).fold(9.0, f64::min);
        // The parabola itself is known: what is drawn is the edge.
        let share_at = |z: f64| {
            let ratios = stand_in.ln_ratios(pool, &[z], DRAWS, 3);
            let widely = stand_in.ln_finished(&[z], Edge::WIDE);
            ratios.iter().filter(|draw| draw[0] + widely > -0.5).count() as f64 / DRAWS as f64
        };
        let at = |part: f64| share_at(failed + part * (finished - failed));
        for part in [0.2, 0.5, 0.8] {
            assert!((at(part) - part).abs() < 0.1, "{part}: {}", at(part));
        }
        assert!(at(-0.1) < 0.1 && at(1.1) > 0.9, "{} {}", at(-0.1), at(1.1));
    }
}
