//! Draws of what a stand-in does not know of the likelihood.

use super::unknown::moved;
use super::{Failing, StandIn, ln_alive};
use crate::pool::Pool;
use crate::stream::{Purpose, stream};
use rand_distr::{Distribution as _, StandardNormal};
use rayon::prelude::*;

impl StandIn<'_> {
    /// Whether its process runs through all samples of this pool that have a likelihood.
    pub(crate) fn runs_through_all(&self, pool: &Pool) -> bool {
        self.chosen.len() == pool.ln_l.iter().filter(|ln_l| ln_l.is_finite()).count()
    }

    /// Draws of the log likelihood at points z, less what is predicted there: errors of the process at all of them together, along
    /// each principal component of curves, and where simulations fail an edge that errors of its process move.
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
            let points = z.chunks_exact(d).map(|z| [failing.mean(z), self.ln_finished(z)]);
            (points.collect::<Vec<_>>(), failing.process.factor_of_errors(z))
        });
        let unknown = self.unknown(pool);
        let directions = unknown.directions();
        let draw = |k: usize| -> Vec<f64> {
            let mut rng = stream(seed, Purpose::Errors, 0, k);
            let mut errors = |factor: &[f64]| -> Vec<f64> {
                let x: Vec<f64> = (0..m).map(|_| StandardNormal.sample(&mut rng)).collect();
                let of = |row: &[f64]| row.iter().zip(&x).map(|(l, x)| l * x).sum();
                factor.chunks_exact(m).map(of).collect()
            };
            let along: Vec<Vec<f64>> = directions.iter().map(|_| errors(&factor)).collect();
            let ratio = |i: usize| {
                let mut values = predicted[i].clone();
                for ((direction, sd), errors) in directions.iter().zip(&along) {
                    values = moved(&values, &self.process.units, direction, sd * errors[i]);
                }
                self.ln_likelihood_of_predicted(&values) - plain[i]
            };
            let mut ratios: Vec<f64> = (0..m).map(ratio).collect();
            if let Some((points, factor)) = &edge {
                let moved = points.iter().zip(errors(factor));
                for (ratio, ([mean, ln_finished], by)) in ratios.iter_mut().zip(moved) {
                    *ratio += ln_alive(Failing::finished_at(mean + by)) - ln_finished;
                }
            }
            ratios
        };
        (0..draws).into_par_iter().map(draw).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian_process::Covariance;
    use crate::sampler::Sampler;
    use crate::small_budget::failing::EDGE;
    use crate::small_budget::unknown::tests::Three;
    use crate::target::Target;
    use crate::{Settings, SimError, normal};

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
        let settings = Settings { samples: 9, replicates: 1, ..Settings::default() };
        let mut sampler = Sampler::new(&Three, &settings);
        sampler.run().expect("never fails");
        let pool = &sampler.pool;
        let stand_in =
            StandIn::new(&Three, pool, &[1.0; 9], 0..9, Covariance::Search).expect("has spread");
        assert!(stand_in.runs_through_all(pool));
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

    /// The mean of `Phi((m + x)/e)` over normal x of variance v is `Phi(m / sqrt(e^2 + v))`.
    #[test]
    fn an_edge_that_errors_move_is_as_wide_in_the_mean_as_the_errors() {
        const DRAWS: usize = 4000;
        let settings = Settings { samples: 14, replicates: 1, ..Settings::default() };
        let mut sampler = Sampler::new(&Cut, &settings);
        sampler.run().expect("never fails");
        let pool = &sampler.pool;
        let stand_in =
            StandIn::new(&Cut, pool, &[1.0; 14], 0..14, Covariance::Search).expect("has spread");
        let z = [-0.3, -0.1, 0.0, 0.05, 0.2];
        let ratios = stand_in.ln_ratios(pool, &z, DRAWS, 3);
        let failing = stand_in.failing.as_ref().expect("some failed");
        let mut moved = 0;
        for (i, z) in z.iter().enumerate() {
            // The parabola itself is known: what is drawn is the edge.
            let finished = stand_in.ln_finished(&[*z]);
            let drawn = |draw: &Vec<f64>| (draw[i] + finished).exp();
            let mean = ratios.iter().map(drawn).sum::<f64>() / DRAWS as f64;
            let variance = failing.process.variance(&[*z]);
            let exact = normal::cdf(failing.mean(&[*z]) / (EDGE[0] * EDGE[0] + variance).sqrt());
            assert!((mean - exact).abs() < 0.03, "{z}: {mean} {exact}");
            moved += usize::from(variance.sqrt() > 0.5 * EDGE[0]);
        }
        assert!(moved > 0, "the edge is known everywhere");
    }
}
