//! Whether other kinetics fit as well as those that were used, by evidence.
//!
//! The evidence of each is estimated with a small budget and the same noise; its standard error decides what can be said.

use dem_core::{Kinetics, SolverKind};
use rayon::prelude::*;
use smc_calib::{Parameter, Posterior, Settings, Trust, Verdict};

use super::of_pair::calibrated_alone;
use crate::error::InputError;
use crate::input::prior_file::PriorFile;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairPlan, Plan};
use crate::record::{OtherKinetics, Record};
use crate::watch::Watch;

/// Fewest simulations of a run that is worth it.
const LEAST_SAMPLES: usize = 4096;
/// Most observations: beyond them it would take more than a small share of a second.
const MOST_OBSERVATIONS: usize = 500;
/// Most simulations for kinetics with three parameters: with 768 the sampler does not converge on the materials.
const BUDGET: usize = 2048;
/// Times as many where that was not enough.
const MORE: usize = 4;
/// Standard errors that a difference must be beyond.
const ERRORS: f64 = 2.0;
/// Evidence that is not worth more than a bare mention, in ln K (Kass and Raftery).
const BARE_MENTION: f64 = 1.0;

/// Adds to the record of one pair what other kinetics are worth. Nothing is added where they cannot be computed in a
/// fraction of a second: programs, numerical solvers, many observations, small budgets; nor for tuned or given samples.
pub(super) fn add(
    plan: &Plan,
    posterior: &Posterior,
    record: &mut Record,
    watch: &dyn Watch,
) -> Result<(), InputError> {
    let found = look(plan, posterior, &record.trust, watch)?;
    let neck = record.experiments.first_mut().and_then(|one| one.neck_growth.as_mut());
    if let Some(neck) = neck {
        neck.other_kinetics = found;
    }
    Ok(())
}

fn look(
    plan: &Plan,
    posterior: &Posterior,
    trust: &Trust,
    watch: &dyn Watch,
) -> Result<Vec<OtherKinetics>, InputError> {
    let Ok((pair, measured)) = plan.pair() else { return Ok(Vec::new()) };
    if plan.is_tuned()
        || plan.design.is_some()
        || pair.solver.name != SolverKind::ClosedForm
        || plan.sampler.samples < LEAST_SAMPLES
        || measured.values.len() > MOST_OBSERVATIONS
        || !trust.converged()
    {
        return Ok(Vec::new());
    }
    let place = |parameters: &[Parameter]| {
        parameters.iter().position(|one| one.name == pair.calibrated(ParameterName::TauS))
    };
    let own = place(&plan.parameters).and_then(|place| posterior.parameters.get(place));
    let Some(own) = own.map(|own| own.in_si.eti95) else { return Ok(Vec::new()) };
    let one = |kinetics: Kinetics| -> Result<Option<OtherKinetics>, InputError> {
        let pair = PairPlan { kinetics, ..pair.clone() };
        let Some(parameters) = parameters(plan, &pair)? else { return Ok(None) };
        let mut settings = settings(plan, parameters.len());
        let mut other = calibrated_alone(&pair, &parameters, measured, &settings)?;
        let mut judged = other.as_ref().is_some_and(sound);
        if !judged {
            settings.samples *= MORE;
            other = calibrated_alone(&pair, &parameters, measured, &settings)?;
            judged = other.as_ref().is_some_and(sound);
        }
        let Some(other) = other else { return Ok(None) };
        let tau_s = place(&parameters).and_then(|place| other.parameters.get(place));
        let Some(tau_s) = tau_s else { return Ok(None) };
        let ln_bayes_factor = other.log_evidence.value - posterior.log_evidence.value;
        let se = other.log_evidence.se.hypot(posterior.log_evidence.se);
        let eti95 = tau_s.in_si.eti95;
        Ok(Some(OtherKinetics {
            kinetics,
            ln_bayes_factor,
            ln_bayes_factor_se: se,
            judged,
            fits_as_well: judged && ln_bayes_factor + BARE_MENTION > ERRORS * se,
            tau_s_median: tau_s.in_si.median,
            tau_s_eti95: [eti95.lower, eti95.upper],
            tau_s_disjoint: eti95.upper < own.lower || own.upper < eti95.lower,
        }))
    };
    let others: Vec<Kinetics> =
        Kinetics::ALL.into_iter().filter(|other| *other != pair.kinetics).collect();
    watch.begin(others.len() as u64, 0, "other kinetics");
    let found: Vec<_> = others
        .into_par_iter()
        .map(|kinetics| one(kinetics).inspect(|_| watch.advance()))
        .collect::<Result<_, _>>()?;
    Ok(found.into_iter().flatten().collect())
}

/// The parameters of a pair with other kinetics, with the plan's priors; those of the material where the plan took its
/// priors from there and has none for a parameter; the default one of lambda. None where there is no prior.
fn parameters(plan: &Plan, pair: &PairPlan) -> Result<Option<Vec<Parameter>>, InputError> {
    let built_in = match pair.material.map(PriorFile::of_material).transpose()? {
        Some(priors) if plan.prior_source.as_deref() == Some(&priors.file_name) => Some(priors),
        _ => None,
    };
    let mut found = Vec::new();
    for name in ParameterName::ALL.into_iter().filter(|name| pair.takes(*name)) {
        let of_plan = plan.parameters.iter().find(|one| one.name == pair.calibrated(name));
        let of_material = || {
            let prior = built_in.as_ref()?.get(name)?;
            Some(Parameter::new(pair.calibrated(name), name.unit(), prior.clone()))
        };
        let default = || {
            let tau_s = pair.calibrated(ParameterName::TauS);
            let tau_s = plan.parameters.iter().find(|one| one.name == tau_s)?;
            let prior = name.default_prior(&tau_s.prior)?;
            Some(Parameter::new(pair.calibrated(name), name.unit(), prior))
        };
        match of_plan.cloned().or_else(of_material).or_else(default) {
            Some(parameter) => found.push(parameter),
            None if !pair.needs(name) => {}
            None => return Ok(None),
        }
    }
    Ok(Some(found))
}

/// Whether the evidence and the rough place of tau_s can be read off.
fn sound(posterior: &Posterior) -> bool {
    posterior.trust().verdict != Verdict::Untrusted
}

/// A small budget, smaller still for kinetics with tau_s alone, and nothing simulated but the samples.
fn settings(plan: &Plan, parameters: usize) -> Settings {
    let most = (plan.sampler.samples / 8).min(BUDGET);
    let (samples, iterations) = if parameters > 2 { (most, 6) } else { (most / 4, 3) };
    Settings {
        samples,
        iterations,
        seed: plan.sampler.seed,
        replicates: 8,
        draws: 256,
        map_simulations: 0,
        path: false,
        ..Settings::default()
    }
}
