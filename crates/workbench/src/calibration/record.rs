//! The record of a posterior.

use smc_calib::{BandPoint, Concern, Posterior, Trust};

use super::of_pair::OfPair;
use crate::careful::{self, Careful, OfJoint};
use crate::error::{Failure, RunError};
use crate::plan::{Plan, SimulatorPlan};
use crate::record::{ExperimentRecord, FitError, ObservableRecord, Record, SCHEMA_VERSION};

/// The record of a plan's posterior; `warnings` are those on the input.
pub(super) fn record(
    plan: &Plan,
    warnings: &[String],
    posterior: &Posterior,
) -> Result<Record, Failure> {
    let trust = posterior.trust();
    let mut of_pairs = Vec::new();
    let mut experiments = Vec::new();
    let mut group = 0;
    let mut first = 0;
    for experiment in &plan.experiments {
        let mut observables = Vec::new();
        let of_experiment = group;
        for observable in &experiment.observables {
            let range = first..first + observable.values.len();
            first = range.end;
            let label = plan.label(experiment, observable);
            observables.push(found(posterior, group, range, (label, observable))?);
            group += 1;
        }
        let pair = match (&experiment.simulator, &experiment.observables[..]) {
            (SimulatorPlan::Builtin(pair), [measured]) => {
                Some(OfPair::new(plan, pair, (of_experiment, measured), posterior)?)
            }
            _ => None,
        };
        of_pairs.extend(pair.as_ref().and_then(OfPair::advice));
        let neck_growth = match (&pair, observables.first()) {
            (Some(pair), Some(found)) => Some(pair.record(found, &trust)?),
            _ => None,
        };
        let name = experiment.name.clone();
        experiments.push(ExperimentRecord { name, observables, neck_growth });
    }
    let advice =
        advice((plan, warnings), (&trust, posterior.ess.importance), &experiments, of_pairs);
    Ok(Record {
        schema_version: SCHEMA_VERSION,
        plan: plan.clone(),
        is_posterior: posterior.is_posterior,
        parameters: posterior.parameters.clone(),
        drawn_by_process: posterior.is_drawn(),
        correlation: posterior.correlation.clone(),
        correlation_si: posterior.correlation_si.clone(),
        log_evidence: posterior.log_evidence,
        ess: posterior.ess,
        khat: posterior.khat,
        trust,
        map: posterior.map.clone(),
        experiments,
        path: posterior.path.clone(),
        stages: posterior.stages.clone(),
        failures: posterior.failures.clone(),
        failing: posterior.failing.clone(),
        stop: posterior.stop,
        sensitivity: None,
        population: None,
        advice,
        counters: posterior.counters,
    })
}

/// Reasons to be careful in plain words: warnings on the input, doubts of clock and priors, concerns, advice on pairs.
fn advice(
    (plan, warnings): (&Plan, &[String]),
    (trust, ess): (&Trust, f64),
    experiments: &[ExperimentRecord],
    of_pairs: Vec<String>,
) -> Vec<String> {
    let mut advice = warnings.to_vec();
    let neck_growths = experiments.iter().filter_map(|experiment| experiment.neck_growth.as_ref());
    let doubts: Vec<String> =
        neck_growths.flat_map(|n| &n.doubts).map(ToString::to_string).collect();
    // A poor fit that the clock or the prior explains is no reason to doubt the model.
    let explained = !doubts.is_empty();
    advice.extend(doubts);
    let concerns = trust.concerns.iter();
    advice.extend(
        concerns
            .filter(|concern| !(explained && matches!(concern, Concern::PoorFit { .. })))
            .map(|concern| careful::concern(concern, plan.simulations())),
    );
    advice.extend(of_pairs);
    let observables = experiments.iter().flat_map(|one| &one.observables);
    advice.extend(observables.filter_map(|found| contradicted(found, ess)));
    if plan.design.is_some() {
        advice.push(Careful::GivenParameterSets.to_string());
    }
    // Input and sampler may say the same (fewer observations than parameters): it is said once.
    let mut seen = std::collections::BTreeSet::new();
    advice.retain(|line| seen.insert(line.clone()));
    advice
}

/// An observable that data made by the posterior do not look like.
fn contradicted(found: &ObservableRecord, ess: f64) -> Option<String> {
    let check = found.check.filter(|check| check.as_far < OfJoint::CONTRADICTED)?;
    let not_replicated = OfJoint::NotReplicated {
        observable: found.label.clone(),
        rmse: found.map_error.rmse,
        as_far: check.as_far,
        counted: careful::counted(&check, ess),
    };
    Some(not_replicated.to_string())
}

/// One observable, whose values are at `range` among those of all.
fn found(
    posterior: &Posterior,
    group: usize,
    range: std::ops::Range<usize>,
    (label, observable): (String, &crate::plan::ObservablePlan),
) -> Result<ObservableRecord, Failure> {
    let map = posterior.map.outputs.get(range.clone()).map(<[f64]>::to_vec).ok_or_else(|| {
        RunError::new("the posterior has fewer simulated values than there are observations")
    })?;
    let predictive: Vec<BandPoint> = posterior
        .predictive
        .iter()
        .filter(|band| range.contains(&band.index))
        .map(|band| BandPoint { index: band.index - range.start, ..*band })
        .collect();
    // With very many observations the bands are at some of them only.
    let observed: Vec<f64> = predictive.iter().map(|band| observable.values[band.index]).collect();
    let mean: Vec<f64> = predictive.iter().map(|band| band.mean).collect();
    let (sigma, noise_shape, residuals) = match posterior.groups.get(group) {
        Some(group) => (group.sigma, group.noise_shape.clone(), group.residuals.clone()),
        None => (posterior.sigma, posterior.noise_shape.clone(), posterior.residuals.clone()),
    };
    Ok(ObservableRecord {
        name: observable.name.clone(),
        label,
        sigma,
        noise_shape,
        map_error: FitError::of(&observable.values, &map),
        mean_error: FitError::of(&observed, &mean),
        map,
        residuals,
        predictive,
        check: posterior.groups.get(group).and_then(|group| group.check),
    })
}
