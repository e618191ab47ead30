//! The result under correlated errors, made without asking where the residuals are alike.

use std::ops::ControlFlow;

use smc_calib::trust::khat_holds;
use smc_calib::trust::limits::FEWEST_EFFECTIVE_SAMPLES;
use smc_calib::{
    Concern, Group, JointProblem, Observer, Posterior, Settings, Simulator, StageRecord, Weighted,
    calibrate_joint, reweighted,
};

use crate::error::Failure;
use crate::plan::Plan;
use crate::record::{Method, Sensitivity, SensitivityOf};
use crate::simulator::Experiments;
use crate::watch::{Unwatched, Watch};

/// Most simulations of the second posterior: its means are then known to a few hundredths of their standard deviations.
const SIMULATIONS: usize = 4096;

/// Most observations with a second posterior: with more the likelihood takes much longer than a run without being asked may.
const MOST_OBSERVATIONS: usize = 200;

/// The posterior under correlated errors; none for very many observations, where the residuals are no reason for it, or the noise model of those that
/// are has no correlated counterpart.
///
/// A built-in simulator is sampled again. Programs are not run: the run's own samples are weighted by the other likelihood,
/// with their curves from `stored`.
pub(super) fn sensitivity(
    plan: &Plan,
    posterior: &Posterior,
    stored: &dyn Simulator,
    watch: &dyn Watch,
) -> Result<Option<Sensitivity>, Failure> {
    let Some(groups) = correlated_groups(plan, posterior)? else { return Ok(None) };
    if posterior.residuals.values.len() > MOST_OBSERVATIONS {
        return Ok(None);
    }
    let again = plan.commands().next().is_none() && plan.design.is_none();
    // A second opinion that cannot be had is no reason to lose the first.
    Ok(if again {
        sampled(plan, posterior, groups, watch)
    } else {
        weighted(plan, posterior, groups, stored)
    })
}

/// The groups of observations, those whose residuals are alike with correlated errors.
fn correlated_groups(plan: &Plan, posterior: &Posterior) -> Result<Option<Vec<Group>>, Failure> {
    let alike: Vec<Option<String>> = posterior
        .trust()
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
    for group in &mut groups {
        let asked = alike.iter().any(|name| match name {
            Some(name) => *name == group.name,
            None => single,
        });
        if let (true, Some(noise)) = (asked, group.noise.with_correlation()) {
            group.noise = noise.at(group.observations.control());
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

fn sampled(
    plan: &Plan,
    posterior: &Posterior,
    groups: Vec<Group>,
    watch: &dyn Watch,
) -> Option<Sensitivity> {
    let unwatched = Unwatched::default();
    let experiments = Experiments::new(plan, None, &unwatched).ok()?;
    let noise = groups.iter().map(|group| group.noise.clone()).collect();
    let problem =
        JointProblem { simulator: &experiments, parameters: plan.parameters.clone(), groups };
    let settings = Settings {
        seed: plan.sampler.seed,
        draws: 1000,
        ..Settings::for_budget(plan.sampler.samples.min(SIMULATIONS))
    };
    let other = calibrate_joint(&problem, &settings, &mut Stopping(watch)).ok()?;
    let parameters = other.parameters.iter().zip(&posterior.parameters).map(|(new, old)| {
        let (new_si, new, old_is) = (&new.in_si, &new.in_coordinate, &old.in_coordinate);
        SensitivityOf {
            name: old.parameter.name.clone(),
            median: new_si.median,
            eti95: [new_si.eti95.lower, new_si.eti95.upper],
            mean: new.mean,
            sd: new.sd,
            shift: (new.mean - old_is.mean) / old_is.sd,
            widening: new.sd / old_is.sd,
        }
    });
    let shapes = match &other.groups[..] {
        [] => vec![other.noise_shape.clone()],
        groups => groups.iter().map(|group| group.noise_shape.clone()).collect(),
    };
    Some(Sensitivity {
        noise,
        method: Method::Sampled,
        samples: other.samples.len(),
        log_evidence: other.log_evidence.value,
        log_evidence_se: other.log_evidence.se,
        ess: other.ess.importance,
        khat: other.khat,
        trusted: other.trust().verdict != smc_calib::Verdict::Untrusted,
        parameters: parameters.collect(),
        noise_shape: shapes,
    })
}

fn weighted(
    plan: &Plan,
    posterior: &Posterior,
    groups: Vec<Group>,
    stored: &dyn Simulator,
) -> Option<Sensitivity> {
    let thetas: Vec<f64> = posterior.samples.iter().flat_map(|s| &s.theta).copied().collect();
    let mut curves = vec![0.0; posterior.samples.len() * plan.observations()];
    // Every run has ended: they are answered from the folder.
    let results = stored.simulate_batch(0, &thetas, &mut curves);
    let as_before = results
        .iter()
        .zip(&posterior.samples)
        .all(|(result, sample)| result.is_ok() || sample.log_likelihood.is_none());
    if !as_before {
        return None;
    }
    let noise = groups.iter().map(|group| group.noise.clone()).collect();
    let shapes = vec![None; groups.len()];
    let problem = JointProblem { simulator: stored, parameters: plan.parameters.clone(), groups };
    let found = reweighted(&problem, posterior, &curves).ok()?;
    let parameters = posterior.parameters.iter().enumerate().map(|(j, old)| {
        let prior = &old.parameter.prior;
        let column = posterior.samples.iter().zip(&found.weights);
        let values = Weighted::new(column.map(|(s, w)| (prior.to_coordinate(s.theta[j]), *w)));
        let (mean, sd) = values.moments();
        let si = |p: f64| old.coordinate.theta(values.quantile(p));
        let before = &old.in_coordinate;
        SensitivityOf {
            name: old.parameter.name.clone(),
            median: si(0.5),
            eti95: [si(0.025), si(0.975)],
            mean,
            sd,
            shift: (mean - before.mean) / before.sd,
            widening: sd / before.sd,
        }
    });
    Some(Sensitivity {
        noise,
        method: Method::Weighted,
        samples: posterior.samples.len(),
        log_evidence: found.log_evidence,
        log_evidence_se: found.log_evidence_se,
        ess: found.ess,
        khat: found.khat,
        trusted: khat_holds(found.khat) && found.ess >= FEWEST_EFFECTIVE_SAMPLES,
        parameters: parameters.collect(),
        noise_shape: shapes,
    })
}
