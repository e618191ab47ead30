//! The posterior under another noise model, from samples that are there: no simulation is run.

use crate::joint::JointLikelihood;
use crate::pool::{effective_sample_size, exponentiate};
use crate::{CalibrateError, JointProblem, Posterior, psis};
use rayon::prelude::*;

/// Weights of a posterior's samples under another noise model.
#[derive(Clone, Debug, PartialEq)]
pub struct Reweighted {
    /// Normalised weights, one for each sample; 0 where the simulation failed.
    pub weights: Vec<f64>,
    /// Log evidence.
    pub log_evidence: f64,
    /// Its standard error, as if the samples were independent.
    pub log_evidence_se: f64,
    /// Effective sample size.
    pub ess: f64,
    /// Pareto shape of the weights; trustworthy below [`KHAT_LIMIT`](crate::trust::limits::KHAT_LIMIT).
    pub khat: f64,
}

/// Weights the samples of a posterior by the likelihood of `problem`, which differs from the one that was calibrated in its
/// noise alone. `curves` holds the simulated curves, one row for each sample; those of failed simulations are not read.
///
/// # Formula
/// `ln w' = ln w - ln L + ln L'`; the evidence is the mean of w'.
///
/// # Errors
/// Noise that does not fit, and curves or samples that are not those of the problem.
pub fn reweighted(
    problem: &JointProblem<'_>,
    posterior: &Posterior,
    curves: &[f64],
) -> Result<Reweighted, CalibrateError> {
    let likelihood = JointLikelihood::new(problem)?;
    let (m, n) = (problem.observations(), posterior.samples.len());
    if curves.len() != n * m {
        return Err(CalibrateError::Observables {
            simulator: curves.len() / n.max(1),
            observations: m,
        });
    }
    let ln_weights: Vec<f64> = posterior
        .samples
        .par_iter()
        .zip(curves.par_chunks(m))
        .map(|(sample, curve)| match (sample.log_weight, sample.log_likelihood) {
            (Some(weight), Some(before)) => weight - before + likelihood.ln_joint(curve),
            _ => f64::NEG_INFINITY,
        })
        .collect();
    let (weights, ln_scale) = exponentiate(&ln_weights);
    let total: f64 = weights.iter().sum();
    if ln_scale == f64::NEG_INFINITY || total <= 0.0 {
        return Err(CalibrateError::ZeroEvidence { simulations: n });
    }
    let mean = total / n as f64;
    let variance = weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / n as f64;
    Ok(Reweighted {
        log_evidence: ln_scale + mean.ln(),
        log_evidence_se: (variance / n as f64).sqrt() / mean,
        ess: effective_sample_size(&weights),
        khat: psis::khat(&weights),
        weights: weights.iter().map(|w| w / total).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        FixedSigma, FnSimulator, Group, Noise, Observations, Parameter, Prior, PriorSpec, Settings,
        Simulator, calibrate_joint,
    };

    #[test]
    fn samples_under_a_wider_noise_give_the_posterior_and_evidence_of_a_run_with_that_noise() {
        let simulator = FnSimulator::new(1, 3, |theta: &[f64], out: &mut [f64]| {
            out.fill(theta[0]);
            Ok(())
        });
        let prior = Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 }).expect("a prior");
        let of = |sigma| JointProblem {
            simulator: &simulator,
            parameters: vec![Parameter::new("mu", "1", prior.clone())],
            groups: vec![Group::new(
                "",
                Observations::new(vec![0.0, 1.0, 2.0], vec![0.1, 0.5, 0.3]).expect("data"),
                Noise::Fixed { sigma: FixedSigma::Absolute(sigma) },
            )],
        };
        let settings = Settings { samples: 4096, ..Settings::default() };
        let (narrow, wide) = (of(0.3), of(0.4));
        let posterior = calibrate_joint(&narrow, &settings, &mut ()).expect("a posterior");
        let mut curves = vec![0.0; 3 * 4096];
        for (sample, curve) in posterior.samples.iter().zip(curves.chunks_exact_mut(3)) {
            simulator.simulate(&sample.theta, curve).expect("a curve");
        }
        let found = reweighted(&wide, &posterior, &curves).expect("weights");
        // Conjugate: precision 1 + 3/sigma^2.
        let precision = 1.0 + 3.0 / 0.16;
        let (mean, sd) = (0.9 / 0.16 / precision, 1.0 / f64::sqrt(precision));
        let samples = || found.weights.iter().zip(&posterior.samples);
        let at: f64 = samples().map(|(w, s)| w * s.theta[0]).sum();
        let square: f64 = samples().map(|(w, s)| w * (s.theta[0] - at).powi(2)).sum();
        assert!((at - mean).abs() < 0.02 * sd, "{at} {mean}");
        assert!((square.sqrt() / sd - 1.0).abs() < 0.03, "{} {sd}", square.sqrt());
        let direct = calibrate_joint(&wide, &settings, &mut ()).expect("a posterior").log_evidence;
        assert!((found.log_evidence - direct.value).abs() < 0.02, "{found:?} {direct:?}");
        assert!(found.khat < 0.5 && found.ess > 500.0, "{} {}", found.khat, found.ess);
        assert!(reweighted(&wide, &posterior, &curves[3..]).is_err());
    }
}
