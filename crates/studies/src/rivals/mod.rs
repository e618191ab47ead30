//! Other ways to a posterior, each as its authors describe it and with their defaults.

mod grain_learning;
mod metropolis;
mod population;
mod prior_importance;

pub(crate) use grain_learning::grain_learning;
pub(crate) use metropolis::metropolis;
pub(crate) use population::population;
pub(crate) use prior_importance::prior_importance;

use nalgebra::DMatrix;
use rand::SeedableRng as _;
use rand::rngs::ChaCha8Rng;

/// A posterior over normal scores: the prior is the standard normal in every coordinate.
pub(crate) trait Bayes {
    /// Number of parameters.
    fn dimension(&self) -> usize;

    /// Log likelihood; minus infinity where the simulation failed.
    fn ln_likelihood(&self, z: &[f64]) -> f64;

    /// The misfit that tuned noise divides: minus the log likelihood at sigma 1, up to a constant; infinite where the simulation
    /// failed.
    fn misfit(&self, z: &[f64]) -> f64;

    /// The prior's coordinate of a normal score, in which moments are wanted.
    fn coordinate(&self, parameter: usize, z: f64) -> f64;
}

/// A method's estimate of a posterior.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Estimate {
    /// Means in the priors' coordinates; empty where the method found nothing.
    pub(crate) mean: Vec<f64>,
    /// Standard deviations.
    pub(crate) sd: Vec<f64>,
    /// Log evidence, where the method has one.
    pub(crate) log_evidence: Option<f64>,
    /// Simulations that were run.
    pub(crate) simulations: usize,
}

/// Moments of weighted points `z`, row by row; the log evidence is that of the mean weight.
fn weighted(bayes: &dyn Bayes, z: &[f64], ln_weights: &[f64]) -> Estimate {
    let d = bayes.dimension();
    let top = ln_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return Estimate { simulations: ln_weights.len(), ..Estimate::default() };
    }
    let weights: Vec<f64> = ln_weights.iter().map(|ln| (ln - top).exp()).collect();
    let total: f64 = weights.iter().sum();
    let (mut mean, mut sd) = (Vec::new(), Vec::new());
    for j in 0..d {
        let alive = || {
            let points = z.chunks_exact(d).zip(&weights).filter(|(_, w)| **w > 0.0);
            points.map(|(z, w)| (bayes.coordinate(j, z[j]), w / total))
        };
        let m: f64 = alive().map(|(x, w)| w * x).sum();
        mean.push(m);
        sd.push(alive().map(|(x, w)| w * (x - m) * (x - m)).sum::<f64>().sqrt());
    }
    Estimate {
        mean,
        sd,
        log_evidence: Some(top + (total / weights.len() as f64).ln()),
        simulations: weights.len(),
    }
}

/// Log of the standard normal density.
fn ln_prior(z: &[f64]) -> f64 {
    z.iter().map(|z| smc_calib::normal::ln_density(*z)).sum()
}

/// Lower Cholesky factor of a symmetric matrix; none where it is not positive definite.
fn cholesky(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let factor = matrix.cholesky()?.unpack();
    factor.iter().all(|value| value.is_finite()).then_some(factor)
}

/// The random numbers of one run of one method.
fn random(method: u64, seed: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(method);
    random
}

#[cfg(test)]
mod known {
    //! A conjugate posterior, for the tests of every rival.

    use super::{Bayes, Estimate};
    use smc_calib::Target as _;
    use smc_calib::reference::{Reference, gaussian};

    /// A measured normal in two dimensions: known mean, sd and evidence.
    pub(super) struct Conjugate(Reference);

    impl Conjugate {
        pub(super) fn new() -> Self {
            Self(gaussian(2, 0.8, 0.5))
        }

        /// Largest errors of mean and sd, in posterior sds, and of the log evidence.
        pub(super) fn errors(&self, found: &Estimate) -> [f64; 3] {
            let exact = &self.0;
            let worst = |of: &dyn Fn(usize) -> f64| (0..2).map(of).fold(0.0, f64::max);
            [
                worst(&|j| (found.mean[j] - exact.mean[j]).abs() / exact.sd[j]),
                worst(&|j| (found.sd[j] / exact.sd[j] - 1.0).abs()),
                found.log_evidence.map_or(0.0, |found| (found - exact.log_evidence).abs()),
            ]
        }
    }

    impl Bayes for Conjugate {
        fn dimension(&self) -> usize {
            2
        }
        fn ln_likelihood(&self, z: &[f64]) -> f64 {
            self.0.ln_likelihood(z, &mut []).expect("a density")
        }
        fn misfit(&self, z: &[f64]) -> f64 {
            -self.ln_likelihood(z)
        }
        fn coordinate(&self, _: usize, z: f64) -> f64 {
            z
        }
    }
}
