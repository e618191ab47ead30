//! Random-walk Metropolis with an adaptive proposal.
//!
//! G. O. Roberts, J. S. Rosenthal, "Examples of adaptive MCMC", J. Comput. Graph. Stat. 18 (2009) 349, section 2, after
//! H. Haario, E. Saksman, J. Tamminen, Bernoulli 7 (2001) 223.

use nalgebra::{DMatrix, DVector};
use rand::RngExt as _;
use rand_distr::StandardNormal;

use super::{Bayes, Estimate, cholesky, ln_prior, random, weighted};

/// Share of steps with the fixed proposal (beta of the source).
const FIXED_SHARE: f64 = 0.05;
/// Standard deviation of the fixed proposal, over the root of the dimension.
const FIXED_SCALE: f64 = 0.1;
/// Scale of the adapted proposal, over the root of the dimension.
const ADAPTED_SCALE: f64 = 2.38;

/// One chain from a draw from the prior; the first half is left out.
///
/// The proposal is `N(x, 2.38^2 S/d)` with the covariance S of the chain so far, mixed with 5 % `N(x, 0.1^2 I/d)`;
/// the latter alone for the first 2 d steps. A chain has no evidence.
pub(crate) fn metropolis(bayes: &dyn Bayes, samples: usize, seed: u64) -> Estimate {
    let mut random = random(2, seed);
    let d = bayes.dimension();
    let root = (d as f64).sqrt();
    let ln_posterior = |z: &[f64]| bayes.ln_likelihood(z) + ln_prior(z);
    let mut here: Vec<f64> = (0..d).map(|_| random.sample(StandardNormal)).collect();
    let mut ln_here = ln_posterior(&here);
    let mut chain = here.clone();
    // Mean and sum of products about it, of the chain so far.
    let (mut mean, mut products) = (here.clone(), DMatrix::zeros(d, d));
    for step in 1..samples {
        let normals = DVector::from_fn(d, |_, _| random.sample(StandardNormal));
        let adapted = step > 2 * d && random.random::<f64>() >= FIXED_SHARE;
        let factor = adapted.then(|| cholesky(&products / (step - 1) as f64)).flatten();
        let moves = match factor {
            Some(factor) => factor * normals * (ADAPTED_SCALE / root),
            None => normals * (FIXED_SCALE / root),
        };
        let there: Vec<f64> = here.iter().zip(&moves).map(|(x, m)| x + m).collect();
        let ln_there = ln_posterior(&there);
        // A start without likelihood is left for anything.
        if ln_there >= ln_here || random.random::<f64>().ln() < ln_there - ln_here {
            (here, ln_here) = (there, ln_there);
        }
        chain.extend_from_slice(&here);
        let before: Vec<f64> = here.iter().zip(&mean).map(|(x, m)| x - m).collect();
        for (m, b) in mean.iter_mut().zip(&before) {
            *m += b / (step + 1) as f64;
        }
        for i in 0..d {
            for j in 0..d {
                products[(i, j)] += before[i] * (here[j] - mean[j]);
            }
        }
    }
    let kept = &chain[samples / 2 * d..];
    let found = weighted(bayes, kept, &vec![0.0; kept.len() / d]);
    Estimate { log_evidence: None, simulations: samples, ..found }
}

#[cfg(test)]
mod tests {
    use super::super::known::Conjugate;
    use super::*;

    #[test]
    fn the_chain_finds_the_conjugate_posterior() {
        let exact = Conjugate::new();
        let found = metropolis(&exact, 200_000, 5);
        assert!(found.simulations == 200_000 && found.log_evidence.is_none());
        // About 100 000/12 independent draws: standard errors 0.011 and 0.008.
        let errors = exact.errors(&found);
        assert!(errors[0] < 0.045 && errors[1] < 0.035, "{errors:?}");
    }

    #[test]
    fn the_proposal_adapts_to_a_scale_of_a_thousandth() {
        struct Needle;
        impl Bayes for Needle {
            fn dimension(&self) -> usize {
                1
            }
            fn ln_likelihood(&self, z: &[f64]) -> f64 {
                -0.5 * ((z[0] - 0.3) / 1e-3).powi(2)
            }
            fn misfit(&self, z: &[f64]) -> f64 {
                -self.ln_likelihood(z)
            }
            fn coordinate(&self, _: usize, z: f64) -> f64 {
                z
            }
        }
        let found = metropolis(&Needle, 20_000, 1);
        assert!((found.mean[0] - 0.3).abs() < 2e-4, "{found:?}");
        assert!((found.sd[0] / 1e-3 - 1.0).abs() < 0.1, "{found:?}");
    }
}
