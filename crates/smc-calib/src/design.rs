//! Parameter sets that are given, not drawn: a design of experiments, or samples of another program.

use crate::calibrate::{check, final_weights, refuse_failures, stage_record};
use crate::mixture::Proposal;
use crate::sampler::Sampler;
use crate::stage::Observer;
use crate::summary::{Run, summarise};
use crate::target::CurveTarget;
use crate::{CalibrateError, JointProblem, Posterior, Settings, StopReason};

/// Largest normal score of a given set: one on the bound of its prior, where the score is infinite, counts as inside.
const FARTHEST: f64 = 9.0;

/// Evaluates given parameter sets \[SI\] and weights them as draws from the prior, in one stage.
///
/// The weights are the likelihoods, which is right only where the sets are draws from the prior (random, or evenly spread
/// over it). The simulator gets the sets through their normal scores, equal to rounding. Of
/// `settings` only the number of draws, the share of failures, the seed and `map_simulations` count.
///
/// # Errors
/// As [`calibrate_joint`](crate::calibrate_joint); [`CalibrateError::Design`] for a set of another
/// number of parameters, or outside its prior.
pub fn calibrate_design(
    problem: &JointProblem<'_>,
    settings: &Settings,
    sets: &[Vec<f64>],
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    let settings = Settings {
        samples: sets.len(),
        overlap: 0,
        earlier: Vec::new(),
        first_proposal: None,
        ..settings.clone()
    };
    let likelihood = check(problem, &settings)?;
    if problem.groups.iter().any(|group| group.noise.is_tuned()) {
        return Err(CalibrateError::Design {
            set: 0,
            problem: "tuned noise has no posterior to weight given sets by".to_owned(),
        });
    }
    let d = problem.parameters.len();
    let mut z = Vec::with_capacity(sets.len() * d);
    for (set, theta) in sets.iter().enumerate() {
        let refused = |problem| CalibrateError::Design { set, problem };
        if theta.len() != d {
            return Err(refused(format!("{} values for {d} parameters", theta.len())));
        }
        for (value, parameter) in theta.iter().zip(&problem.parameters) {
            let (lower, upper) = parameter.prior.support();
            if !(lower..=upper).contains(value) {
                return Err(refused(format!(
                    "{} = {value} is outside its prior, {lower} to {upper}",
                    parameter.name
                )));
            }
            z.push(parameter.prior.to_z(*value).clamp(-FARTHEST, FARTHEST));
        }
    }
    let target = CurveTarget::new(problem, &likelihood, settings.samples);
    let mut sampler = Sampler::new(&target, &settings);
    // Given sets are independent: for the error bars each belongs to one of as many groups as there are sub-nets.
    sampler.replicates = settings.replicates.min(sets.len()).max(1);
    let groups = sampler.replicates;
    let replicates: Vec<u32> = (0..sets.len()).map(|set| (set % groups) as u32).collect();
    sampler.simulate(Proposal::prior(d), &z, &replicates)?;
    refuse_failures(&sampler.pool, &settings)?;
    let stages = vec![stage_record(&sampler, &problem.coordinate(), None, true).record];
    // There is nothing left to stop.
    let _ = observer.stage(&stages[0]);
    let (raw, ln_scale) = final_weights(&sampler, None);
    if ln_scale == f64::NEG_INFINITY {
        return Err(CalibrateError::ZeroEvidence { simulations: sampler.pool.len() });
    }
    let stop = StopReason::BudgetSpent;
    let run = Run { target: &target, sampler, raw, ln_scale, tuned: false, stages, stop };
    summarise(run, observer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FixedSigma, FnSimulator, Group, Noise, Observations, Parameter, Prior, PriorSpec};

    #[test]
    fn given_sets_are_weighted_by_their_likelihood() {
        let simulator = FnSimulator::new(1, 1, |theta: &[f64], out: &mut [f64]| {
            out[0] = theta[0];
            Ok(())
        });
        let prior = Prior::new(PriorSpec::Uniform { lower: 0.0, upper: 4.0 }).expect("a prior");
        let observations = Observations::new(vec![0.0], vec![1.0]).expect("one");
        let noise = Noise::Fixed { sigma: FixedSigma::Absolute(0.5) };
        let problem = JointProblem {
            simulator: &simulator,
            parameters: vec![Parameter::new("x", "1", prior)],
            groups: vec![Group::new("y", observations, noise)],
        };
        let settings = Settings { map_simulations: 0, ..Settings::default() };
        let sets: Vec<Vec<f64>> = [0.0, 0.5, 1.0, 1.5, 2.5, 4.0].map(|x| vec![x]).to_vec();
        let posterior = calibrate_design(&problem, &settings, &sets, &mut ()).expect("weights");
        let likelihood = |x: f64| (-0.5 * ((1.0 - x) / 0.5).powi(2)).exp();
        let total: f64 = sets.iter().map(|set| likelihood(set[0])).sum();
        for (sample, set) in posterior.samples.iter().zip(&sets) {
            assert!((sample.theta[0] - set[0]).abs() < 1e-12, "{sample:?}");
            assert!((sample.weight - likelihood(set[0]) / total).abs() < 1e-12, "{sample:?}");
        }
        // Evidence: the mean likelihood over draws from the prior.
        let density = 1.0 / (0.5 * (2.0 * std::f64::consts::PI).sqrt());
        let evidence = (density * total / 6.0).ln();
        assert!((posterior.log_evidence.value - evidence).abs() < 1e-12);
        assert_eq!(posterior.map.theta, posterior.samples[2].theta);
        assert!(posterior.log_evidence.se.is_finite() && posterior.log_evidence.se > 0.0);
        for bad in [vec![vec![5.0]], vec![vec![1.0, 2.0]], vec![vec![f64::NAN]]] {
            let error = calibrate_design(&problem, &settings, &bad, &mut ()).expect_err("refused");
            assert!(matches!(error, CalibrateError::Design { set: 0, .. }), "{error}");
        }
        assert!(calibrate_design(&problem, &settings, &[], &mut ()).is_err());
    }
}
