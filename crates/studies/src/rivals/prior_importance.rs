//! Importance sampling from the prior.

use rand::RngExt as _;
use rand_distr::StandardNormal;

use super::{Bayes, Estimate, random, weighted};

/// Independent draws from the prior, weighted by the likelihood.
pub(crate) fn prior_importance(bayes: &dyn Bayes, samples: usize, seed: u64) -> Estimate {
    let mut random = random(1, seed);
    let d = bayes.dimension();
    let z: Vec<f64> = (0..samples * d).map(|_| random.sample(StandardNormal)).collect();
    let ln_weights: Vec<f64> = z.chunks_exact(d).map(|z| bayes.ln_likelihood(z)).collect();
    weighted(bayes, &z, &ln_weights)
}

#[cfg(test)]
mod tests {
    use super::super::known::Conjugate;
    use super::*;

    #[test]
    fn prior_weights_find_the_conjugate_posterior() {
        let exact = Conjugate::new();
        // About 30 000 effective draws: a standard error of 0.006 in the mean, 0.004 in the sd.
        let errors = exact.errors(&prior_importance(&exact, 200_000, 3));
        assert!(errors[0] < 0.025 && errors[1] < 0.018 && errors[2] < 0.02, "{errors:?}");
        let few = exact.errors(&prior_importance(&exact, 200, 3));
        assert!(few[0] > errors[0], "no better with a thousand times the draws: {few:?}");
    }
}
