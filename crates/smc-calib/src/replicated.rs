//! Posterior predictive check of a group of observations: whether data made by the model look like those that were measured.
//!
//! Replicated data are the curve of a draw of the posterior with errors of the noise model on it. Where the size of the
//! errors is inferred it is drawn from its prior here (a mixed predictive check: A. Gelman, X.-L. Meng, H. Stern, Stat. Sinica 6 (1996)
//! 733; E.C. Marshall, D.J. Spiegelhalter, Bayesian Anal. 2 (2007) 409): a size that was inferred from these very residuals always agrees with
//! them.

use crate::PredictiveCheck;
use crate::joint::Group;
use crate::noise::Likelihood;
use crate::residuals::lag1;
use crate::stream::{Purpose, stream};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Most draws that data are replicated for: a probability of 0.01 is known within a fifth of itself.
const MOST: usize = 4000;

/// Checks a group; `curve` is its curve in each of `draws` draws. None where there are no draws.
pub(crate) fn check<'a>(
    (g, group, likelihood): (usize, &Group, &Likelihood),
    seed: u64,
    draws: usize,
    curve: impl Fn(usize) -> &'a [f64] + Sync,
) -> Option<PredictiveCheck> {
    let count = draws.min(MOST);
    let observed = group.observations.values();
    let control = group.observations.control();
    let found: Vec<[bool; 2]> = (0..count)
        .into_par_iter()
        .map(|k| {
            let mut rng = stream(seed, Purpose::Replicated, g, k);
            let curve = curve(k * draws / count);
            let residuals: Vec<f64> = observed.iter().zip(curve).map(|(y, o)| y - o).collect();
            let errors = match group.noise.draw_errors(control, &mut rng) {
                Some((_, errors)) => errors,
                // Noise that is stated row by row.
                None => (0..observed.len())
                    .map(|i| {
                        let score: f64 = rng.sample(StandardNormal);
                        likelihood.fixed_sigma(i).unwrap_or(0.0) * score
                    })
                    .collect(),
            };
            let squares = |values: &[f64]| values.iter().map(|r| r * r).sum::<f64>();
            [squares(&errors) >= squares(&residuals), lag1(&errors) >= lag1(&residuals)]
        })
        .collect();
    let share =
        |which: usize| found.iter().filter(|passed| passed[which]).count() as f64 / count as f64;
    (count > 0).then(|| PredictiveCheck { as_far: share(0), as_alike: share(1), replicated: count })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FixedSigma, Noise, Observations};
    use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

    fn checked(noise: Noise, values: Vec<f64>) -> PredictiveCheck {
        let control = (1..=values.len()).map(|i| i as f64).collect();
        let curve = vec![0.0; values.len()];
        let observations = Observations::new(control, values).expect("observations");
        let group = Group::new("a", observations, noise);
        let likelihood = Likelihood::new(&group.noise, &group.observations).expect("a model");
        check((0, &group, &likelihood), 3, MOST, |_| &curve).expect("draws")
    }

    fn fixed(sigma: f64) -> Noise {
        Noise::Fixed { sigma: FixedSigma::Absolute(sigma) }
    }

    /// Residuals of this root mean square whose signs alternate in pairs: lag-1 correlation 1/20.
    fn of_size(rms: f64) -> Vec<f64> {
        (0..20).map(|i| if i % 4 < 2 { rms } else { -rms }).collect()
    }

    #[test]
    fn sizes_under_stated_noise_have_the_probability_of_chi_squared() {
        for rms in [0.03, 0.04, 0.05] {
            let p = checked(fixed(0.04), of_size(rms)).as_far;
            let exact = ChiSquared::new(20.0).expect("20").sf(20.0 * (rms / 0.04f64).powi(2));
            assert!(
                (p - exact).abs() < 4.0 * (exact * (1.0 - exact) / 4000.0).sqrt(),
                "{p} {exact}"
            );
        }
    }

    #[test]
    fn sizes_under_inferred_noise_are_held_against_its_prior_and_not_against_themselves() {
        for rms in [0.05, 0.1, 0.15] {
            let p = checked(Noise::Inferred { nu0: 4.0, s0: 0.05 }, of_size(rms)).as_far;
            let exact = FisherSnedecor::new(20.0, 4.0).expect("F").sf((rms / 0.05f64).powi(2));
            assert!(
                (p - exact).abs() < 4.0 * (exact * (1.0 - exact) / 4000.0).sqrt(),
                "{p} {exact}"
            );
        }
    }

    #[test]
    fn drifting_residuals_are_not_replicated_by_independent_errors_but_by_correlated_ones() {
        let drifting: Vec<f64> = (0..20).map(|i| 0.01 * (f64::from(i) - 9.5)).collect();
        let independent = checked(Noise::default(), drifting.clone());
        assert!(independent.as_alike < 0.002 && independent.as_far > 0.1, "{independent:?}");
        let correlated = checked(Noise::correlated(), drifting);
        assert!(correlated.as_alike > 0.02, "{correlated:?}");
        let even = checked(Noise::default(), of_size(0.05));
        assert!((even.as_alike - 0.4).abs() < 0.05, "{even:?}");
    }

    #[test]
    fn noise_that_the_table_states_is_replicated_row_by_row() {
        let values = of_size(0.05);
        let control: Vec<f64> = (1..=values.len()).map(|i| i as f64).collect();
        let curve = vec![0.0; values.len()];
        let with = |sigma: f64| {
            let observations = Observations::new(control.clone(), values.clone());
            let observations = observations.and_then(|o| o.with_sigma(vec![sigma; curve.len()]));
            let noise = Noise::Fixed { sigma: FixedSigma::PerPoint };
            let group = Group::new("a", observations.expect("observations"), noise);
            let likelihood = Likelihood::new(&group.noise, &group.observations).expect("a model");
            check((0, &group, &likelihood), 3, 500, |_| &curve).expect("draws").as_far
        };
        assert!(with(0.02) < 0.01 && with(0.1) > 0.99);
    }
}
