//! The calibration as a whole: checks, stages, summary.

use crate::estimate::Estimator;
use crate::joint::{JointLikelihood, JointProblem};
use crate::marginal::mean_and_sd;
use crate::mixture::Proposal;
use crate::pool::{Pool, effective_sample_size, exponentiate};
use crate::sampler::{NextStage, Sampler};
use crate::stage::Observer;
use crate::summary::{Run, summarise};
use crate::target::CurveTarget;
use crate::trust::khat_holds;
use crate::{
    CalibrateError, Noise, NoiseError, Posterior, Problem, Settings, StageRecord, StopReason, psis,
};
use rayon::prelude::*;

/// Fewest simulations after which too many failures end a run.
const FEWEST_TO_JUDGE: usize = 16;

/// Infers the parameters of a problem.
///
/// # Errors
/// See [`CalibrateError`]: a problem or settings that do not fit together, a simulator that cannot run, too many
/// failures, zero evidence, or an interruption by the simulator or the observer before there is a posterior.
pub fn calibrate(
    problem: &Problem<'_>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    calibrate_joint(&problem.into(), settings, observer)
}

/// Infers parameters that several groups of observations share.
///
/// Observations are counted through the groups wherever a [`Posterior`] lists them; what belongs to one group is in
/// [`Posterior::groups`].
///
/// # Errors
/// Same as [`calibrate`].
pub fn calibrate_joint(
    problem: &JointProblem<'_>,
    settings: &Settings,
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    let likelihood = check(problem, settings)?;
    let tuned = match problem.groups[0].noise {
        Noise::EssTarget { share } => Some(share),
        _ => None,
    };
    let surrogate = settings.surrogate && (tuned.is_none() || settings.samples < Settings::PLAIN);
    let settings = &Settings { surrogate, ..settings.clone() };
    let target = CurveTarget::new(problem, &likelihood, settings.samples);
    let mut sampler = Sampler::new(&target, settings);
    let mut next = next_stage(settings, tuned);
    let mut stages: Vec<StageRecord> = Vec::new();
    let mut stop = None;
    loop {
        if stop.is_none() {
            sampler.place(&mut *next);
        }
        let Some(last) = sampler.take().map_err(|error| error.after(&stages))? else { break };
        sampler.revise().map_err(|error| error.after(&stages))?;
        // The share of failures among a handful of simulations says nothing yet.
        let enough = sampler.pool.len() >= FEWEST_TO_JUDGE.min(settings.samples);
        if enough && !sampler.target.will_revise() {
            refuse_failures(&sampler.pool, settings)?;
        }
        let record = stage_record(&sampler, &problem.coordinate(), tuned, last);
        // Stages that were placed meanwhile are still taken.
        let may_end = tuned.is_none() && settings.earlier.is_empty();
        if stop.is_none() && may_end && !stages.is_empty() && !last {
            stop = reached(&record, &sampler, settings);
        }
        stages.push(record.record);
        let stopped = observer.stage(&stages[stages.len() - 1]).is_break();
        if stopped && !last {
            if stages[stages.len() - 1].ess < 2.0 {
                return Err(CalibrateError::Interrupted { stages });
            }
            stop = stop.or(Some(StopReason::Interrupted));
            break;
        }
    }
    let stop = stop.unwrap_or(StopReason::BudgetSpent);
    let (raw, ln_scale) = final_weights(&sampler, tuned);
    if ln_scale == f64::NEG_INFINITY {
        return Err(CalibrateError::ZeroEvidence { simulations: sampler.pool.len() });
    }
    let run = Run { target: &target, sampler, raw, ln_scale, tuned: tuned.is_some(), stages, stop };
    summarise(run, observer)
}

/// Ends a run in which too large a share of the simulations failed.
pub(crate) fn refuse_failures(pool: &Pool, settings: &Settings) -> Result<(), CalibrateError> {
    let failed = pool.failed_from(0);
    if failed as f64 > settings.max_failed_share * pool.len() as f64 {
        return Err(CalibrateError::TooManyFailures {
            failed,
            simulations: pool.len(),
            commonest: pool.failures().first().map_or_else(String::new, |f| f.cause.clone()),
        });
    }
    Ok(())
}

type ChooseStage = dyn FnMut(&mut Sampler<'_>) -> Option<NextStage>;

/// The stages of a run, one after the other; those of the tuned scheme are of equal size.
fn next_stage(settings: &Settings, tuned: Option<f64>) -> Box<ChooseStage> {
    let Some(share) = tuned else { return Box::new(|sampler| sampler.next()) };
    let equal = equal_stages(settings);
    Box::new(move |sampler| {
        let stage = sampler.stages();
        let n = *equal.get(stage)?;
        let proposal =
            if stage == 0 { Proposal::prior(sampler.pool.d) } else { sampler.refit_tuned(share) };
        Some((n, proposal, stage + 1 == equal.len()))
    })
}

/// Stages of the tuned scheme: as many samples in each iteration.
fn equal_stages(settings: &Settings) -> Vec<usize> {
    let stages = settings.iterations.clamp(1, settings.samples);
    (0..stages)
        .map(|i| settings.samples / stages + usize::from(i < settings.samples % stages))
        .collect()
}

/// Weights of the result and the log of the factor taken out of them.
pub(crate) fn final_weights(sampler: &Sampler<'_>, tuned: Option<f64>) -> (Vec<f64>, f64) {
    match tuned {
        None => exponentiate(&sampler.ln_weights()),
        Some(share) => exponentiate(&sampler.tuned_ln_weights(share)),
    }
}

pub(crate) struct Staged {
    pub(crate) record: StageRecord,
    worst_mean_error: f64,
}

/// Record of the newest stage; `coordinate(j, z_j)` is what moments are taken of.
pub(crate) fn stage_record(
    sampler: &Sampler<'_>,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    tuned: Option<f64>,
    last: bool,
) -> Staged {
    let pool = &sampler.pool;
    let (raw, ln_scale) = final_weights(sampler, tuned);
    let stage = sampler.proposals.len() - 1;
    let (simulations, proposal) = &sampler.proposals[stage];
    let mut record = StageRecord {
        stage,
        last,
        simulations: *simulations,
        total: pool.len(),
        failed: pool.failed_from(pool.len() - simulations),
        failed_total: pool.failed_from(0),
        beta: sampler.beta,
        ess: effective_sample_size(&raw),
        log_evidence: f64::MIN,
        log_evidence_se: f64::MAX,
        khat: psis::khat(&raw),
        means: Vec::new(),
        sds: Vec::new(),
        proposal: proposal.record(),
    };
    let mut worst_mean_error = f64::INFINITY;
    if ln_scale > f64::NEG_INFINITY {
        let estimator = Estimator::new(pool, raw, ln_scale, sampler.replicates);
        (record.log_evidence, record.log_evidence_se) = estimator.log_evidence();
        worst_mean_error = 0.0;
        for j in 0..pool.d {
            let x: Vec<f64> = (0..pool.len())
                .into_par_iter()
                .with_min_len(256)
                .map(|i| {
                    if estimator.weights[i] > 0.0 {
                        coordinate(j, pool.z[i * pool.d + j])
                    } else {
                        0.0
                    }
                })
                .collect();
            let (mean, mean_se, sd, _) = mean_and_sd(&x, &estimator);
            worst_mean_error = worst_mean_error.max(mean_se / sd);
            record.means.push(mean);
            record.sds.push(sd);
        }
    }
    Staged { record, worst_mean_error }
}

/// The target that is reached before the budget is spent, if any.
fn reached(staged: &Staged, sampler: &Sampler<'_>, settings: &Settings) -> Option<StopReason> {
    // Weights that cannot be trusted reach no target, nor do those of a flattened likelihood.
    if !khat_holds(staged.record.khat) || sampler.beta < 1.0 {
        return None;
    }
    if settings.ess_target.is_some_and(|wished| staged.record.ess >= wished) {
        return Some(StopReason::EssReached);
    }
    if settings.mean_se_target.is_some_and(|wished| staged.worst_mean_error <= wished) {
        return Some(StopReason::AccuracyReached);
    }
    None
}

/// Refuses settings and parts of a problem that do not fit together.
pub(crate) fn check(
    problem: &JointProblem<'_>,
    settings: &Settings,
) -> Result<JointLikelihood, CalibrateError> {
    let d = problem.parameters.len();
    if problem.simulator.parameters() != d || d == 0 {
        return Err(CalibrateError::Parameters {
            simulator: problem.simulator.parameters(),
            problem: d,
        });
    }
    if problem.simulator.observables() != problem.observations() || problem.groups.is_empty() {
        return Err(CalibrateError::Observables {
            simulator: problem.simulator.observables(),
            observations: problem.observations(),
        });
    }
    settings.check(d)?;
    let tuned = problem.groups.iter().any(|group| group.noise.is_tuned());
    if let (Some(budget), true) = (settings.earlier.first(), tuned) {
        return Err(CalibrateError::Setting {
            setting: "earlier",
            value: *budget as f64,
            range: "none with tuned noise, whose result is that of its newest iteration alone",
        });
    }
    if let (Some(_), true) = (&settings.first_proposal, tuned) {
        let problem = "tuned noise weights samples as draws from the prior".to_owned();
        return Err(CalibrateError::FirstProposal { problem });
    }
    let likelihood = JointLikelihood::new(problem)?;
    let observations = problem.observations();
    if likelihood.has_shape() && !CurveTarget::has_room(observations, settings.samples) {
        let numbers = settings.samples.saturating_mul(observations);
        return Err(NoiseError::CurvesNotKept { numbers }.into());
    }
    Ok(likelihood)
}
