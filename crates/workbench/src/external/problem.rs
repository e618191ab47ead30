//! A plan as the sampler takes it.

use smc_calib::{CalibrateError, Group, JointProblem, Observer, Posterior, Simulator};

use super::plan::ExternalPlan;
use super::plan_file::observations;
use crate::error::{Failure, InputError, Mistake, RunError};

/// The observables of a plan as groups of observations, in the order of the simulated values.
pub(crate) fn groups(plan: &ExternalPlan) -> Result<Vec<Group>, InputError> {
    plan.observables()
        .map(|(experiment, observable)| {
            let observations = observations(observable).map_err(|error| {
                InputError::new(&observable.table, Mistake::OutOfRange).found(error)
            })?;
            let name = plan.label(experiment, observable);
            Ok(Group::new(name, observations, observable.noise.clone()))
        })
        .collect()
}

/// Why a plan has no posterior.
pub(crate) enum Unfinished {
    /// The plan is not one, as an edited file can hold.
    Plan(InputError),
    /// The sampler's reason.
    Sampler(CalibrateError),
}

impl From<Unfinished> for Failure {
    fn from(unfinished: Unfinished) -> Self {
        match unfinished {
            Unfinished::Plan(error) => error.into(),
            Unfinished::Sampler(error) => RunError::new(error).into(),
        }
    }
}

/// Calibrates a plan with a simulator of all its experiments.
pub(crate) fn calibrate(
    plan: &ExternalPlan,
    simulator: &dyn Simulator,
    observer: &mut dyn Observer,
) -> Result<Posterior, Unfinished> {
    let problem = JointProblem {
        simulator,
        parameters: plan.parameters.clone(),
        groups: groups(plan).map_err(Unfinished::Plan)?,
    };
    match &plan.design {
        None => smc_calib::calibrate_joint(&problem, &plan.sampler, observer),
        Some(design) => {
            smc_calib::calibrate_design(&problem, &plan.sampler, &design.sets, observer)
        }
    }
    .map_err(Unfinished::Sampler)
}
