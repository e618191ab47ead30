//! The result under correlated errors, made without asking where the residuals are alike.

use std::ops::ControlFlow;

use dem_core::SolverKind;
use smc_calib::trust::khat_holds;
use smc_calib::trust::limits::FEWEST_EFFECTIVE_SAMPLES;
use smc_calib::{
    Concern, Group, JointProblem, Noise, Observer, ParameterSummary, Posterior, Settings,
    Simulator, StageRecord, Trust, Verdict, Weighted, calibrate_joint, reweighted,
};

use crate::error::InputError;
use crate::plan::{Plan, SolverPlan, pairs};
use crate::record::{Method, Record, Sensitivity, SensitivityOf};
use crate::watch::Watch;

/// Simulations of the second posterior: its means are then known to a few hundredths of their standard deviations.
const SIMULATIONS: usize = 4096;

/// Times as many where these were not enough.
const MORE: usize = 4;

/// Adds to a record the result under correlated errors. Nothing is added above [`Sensitivity::MOST_OBSERVATIONS`], where the residuals are
/// no reason for it, or where the noise of those that are has no correlated counterpart.
///
/// A built-in simulator is sampled again: by [`SIMULATIONS`], or [`MORE`] times as many where these do not do; where they are not [`cheap`],
/// by no more than the run had. Programs are not run, and functions not called: the run's own samples are weighted by the other
/// likelihood, with their curves, which `simulator` has from the folder or has kept.
pub(super) fn add(
    plan: &Plan,
    posterior: &Posterior,
    record: &mut Record,
    simulator: &dyn Simulator,
    watch: &dyn Watch,
) -> Result<(), InputError> {
    if plan.observations() > Sensitivity::MOST_OBSERVATIONS {
        return Ok(());
    }
    let Some(groups) = correlated_groups(plan, &record.trust)? else { return Ok(()) };
    let noise = groups.iter().map(|group| group.noise.clone()).collect();
    let problem = JointProblem { simulator, parameters: plan.parameters.clone(), groups };
    let own = plan.commands().next().is_some() || plan.function().is_some();
    let again = !own && plan.design.is_none();
    // A second opinion that cannot be had is no reason to lose the first.
    record.sensitivity = if again {
        sampled(plan, posterior, &problem, noise, watch)
    } else {
        weighted(posterior, &problem, noise)
    };
    Ok(())
}

/// The groups of observations, those whose residuals are alike with correlated errors.
fn correlated_groups(plan: &Plan, trust: &Trust) -> Result<Option<Vec<Group>>, InputError> {
    let alike: Vec<Option<String>> = trust
        .concerns
        .iter()
        .filter_map(|concern| match concern {
            Concern::ResidualsNotIndependent { lag1, group, .. } if *lag1 > 0.0 => {
                Some(group.clone())
            }
            _ => None,
        })
        .collect();
    let mut changed = false;
    let mut groups = plan.groups()?;
    let single = groups.len() == 1;
    for (group, (_, observable)) in groups.iter_mut().zip(plan.observables()) {
        let asked = alike.iter().any(|name| match name {
            Some(name) => *name == group.name,
            None => single,
        });
        if let (true, Some(noise)) = (asked, group.noise.with_correlation()) {
            group.noise = observable.scaled(noise);
            changed = true;
        }
    }
    Ok(changed.then_some(groups))
}

/// Stops between stages where the whole job is to stop.
struct Stopping<'a>(&'a dyn Watch);

impl Observer for Stopping<'_> {
    fn stage(&mut self, _: &StageRecord) -> ControlFlow<()> {
        if self.0.stop().asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Whether simulations of a plan of pairs cost microseconds: in closed form, or quasi-static with no more accuracy than by default, and
/// heated by no table of temperatures.
fn cheap(plan: &Plan) -> bool {
    pairs(&plan.experiments).all(|(_, pair)| {
        let solver = match pair.solver.name {
            SolverKind::ClosedForm => true,
            SolverKind::QuasiStatic => pair.solver.tolerance >= SolverPlan::DEFAULT_TOLERANCE,
            SolverKind::Verlet => false,
        };
        solver && pair.heat.as_ref().is_none_or(|heat| heat.table_file().is_none())
    })
}

fn sampled(
    plan: &Plan,
    posterior: &Posterior,
    problem: &JointProblem<'_>,
    noise: Vec<Noise>,
    watch: &dyn Watch,
) -> Option<Sensitivity> {
    let sampled = |samples: usize| {
        let settings = plan.begun(Settings {
            seed: plan.sampler.seed,
            draws: 1000,
            path: false,
            surrogate: samples < Settings::PLAIN,
            ..Settings::for_budget(samples)
        });
        calibrate_joint(problem, &settings, &mut Stopping(watch)).ok()
    };
    // So many cost less than fewer that a process places.
    let most = if cheap(plan) { MORE * SIMULATIONS } else { plan.sampler.samples };
    let mut other = sampled(most.min(SIMULATIONS))?;
    if other.trust().verdict == Verdict::Untrusted && most > SIMULATIONS {
        other = sampled(most.min(MORE * SIMULATIONS))?;
    }
    let parameters = other.parameters.iter().zip(&posterior.parameters).map(|(new, old)| {
        let (si, eti95) = (&new.in_si, &new.in_si.eti95);
        let moments = (new.in_coordinate.mean, new.in_coordinate.sd);
        parameter(old, moments, si.median, [eti95.lower, eti95.upper])
    });
    let shapes = match &other.groups[..] {
        [] => vec![other.noise_shape.clone()],
        groups => groups.iter().map(|group| group.noise_shape.clone()).collect(),
    };
    let trust = other.trust();
    let told = |concern: &Concern| {
        matches!(
            concern,
            Concern::TwoModes { .. }
                | Concern::ResidualsNotIndependent { .. }
                | Concern::PoorFit { .. }
        )
    };
    Some(Sensitivity {
        trusted: trust.verdict != Verdict::Untrusted,
        concerns: trust.concerns.into_iter().filter(told).collect(),
        noise,
        method: Method::Sampled,
        samples: other.samples.len(),
        log_evidence: other.log_evidence.value,
        log_evidence_se: other.log_evidence.se,
        ess: other.ess.importance,
        khat: other.khat,
        parameters: parameters.collect(),
        noise_shape: shapes,
    })
}

fn weighted(
    posterior: &Posterior,
    problem: &JointProblem<'_>,
    noise: Vec<Noise>,
) -> Option<Sensitivity> {
    let thetas: Vec<f64> = posterior.samples.iter().flat_map(|s| &s.theta).copied().collect();
    let mut curves = vec![0.0; posterior.samples.len() * problem.observations()];
    // Every run has ended: they are answered from the folder, or from what was kept.
    let results = problem.simulator.simulate_batch(0, &thetas, &mut curves);
    let as_before = results
        .iter()
        .zip(&posterior.samples)
        .all(|(result, sample)| result.is_ok() || sample.log_likelihood.is_none());
    if !as_before {
        return None;
    }
    let found = reweighted(problem, posterior, &curves).ok()?;
    let parameters = posterior.parameters.iter().enumerate().map(|(j, old)| {
        let prior = &old.parameter.prior;
        let column = posterior.samples.iter().zip(&found.weights);
        let values =
            Weighted::new(column.map(|(s, w)| (prior.to_coordinate(s.estimated()[j]), *w)));
        let si = |p: f64| old.coordinate.theta(values.quantile(p));
        parameter(old, values.moments(), si(0.5), [si(0.025), si(0.975)])
    });
    Some(Sensitivity {
        noise_shape: vec![None; problem.groups.len()],
        noise,
        method: Method::Weighted,
        samples: posterior.samples.len(),
        log_evidence: found.log_evidence,
        log_evidence_se: found.log_evidence_se,
        ess: found.ess,
        khat: found.khat,
        concerns: Vec::new(),
        trusted: khat_holds(found.khat) && found.ess >= FEWEST_EFFECTIVE_SAMPLES,
        parameters: parameters.collect(),
    })
}

/// One parameter under the other model, beside the run's own result.
fn parameter(
    own: &ParameterSummary,
    (mean, sd): (f64, f64),
    median: f64,
    eti95: [f64; 2],
) -> SensitivityOf {
    let before = &own.in_coordinate;
    SensitivityOf {
        name: own.parameter.name.clone(),
        median,
        eti95,
        mean,
        sd,
        shift: (mean - before.mean) / before.sd,
        widening: sd / before.sd,
    }
}

#[cfg(test)]
mod tests {
    use super::cheap;
    use crate::input::material::Material;
    use crate::plan::{PairOptions, SimulatorPlan};
    use dem_core::SolverKind;

    #[test]
    fn simulations_of_all_solvers_but_verlet_are_cheap_where_no_more_accuracy_is_asked_for() {
        for (solver, tolerance, expected) in [
            (SolverKind::ClosedForm, 1e-12, true),
            (SolverKind::QuasiStatic, 1e-3, true),
            (SolverKind::QuasiStatic, 1e-12, false),
            (SolverKind::Verlet, 1e-3, false),
        ] {
            let material = Some(Material::Ps);
            let mut plan =
                PairOptions { material, ..PairOptions::default() }.plan().expect("a plan").plan;
            let SimulatorPlan::Builtin(pair) = &mut plan.experiments[0].simulator else {
                panic!("a pair")
            };
            (pair.solver.name, pair.solver.tolerance) = (solver, tolerance);
            assert_eq!(cheap(&plan), expected, "{solver} {tolerance}");
        }
    }
}
