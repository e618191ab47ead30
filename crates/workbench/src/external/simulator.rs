//! All experiments of a plan as one simulator: the built-in ones computed, the commands run by the campaign's
//! executor.

use std::sync::Mutex;
use std::sync::PoisonError;

use campaign::{Campaign, Event, Executor, ExecutorError, Outcome, Stop, Task};
use dem_core::{Kinetics, SolverKind, SolverSettings};
use rayon::prelude::*;
use smc_calib::{SimError, Simulator};

use super::plan::{BuiltinPlan, ExternalPlan, SimulatorPlan};
use crate::error::{InputError, Mistake};
use crate::model::NeckGrowth;
use crate::prior_file::ParameterName;

/// Why a calibration that must stop has stopped; the reason itself is kept apart.
pub(crate) const STOPPED: &str = "stopped";

/// The built-in neck growth of one experiment, with its places in the plan's parameter vector.
#[derive(Debug, Clone)]
pub(crate) struct BuiltinModel {
    model: NeckGrowth,
    places: Vec<usize>,
    /// Factor on the calibrated tau_s.
    tau_s_factor: f64,
}

impl BuiltinModel {
    /// The model of a built-in experiment.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a plan that names what this version does not know.
    pub(crate) fn of(
        builtin: &BuiltinPlan,
        parameters: &[String],
        times_s: Vec<f64>,
    ) -> Result<Self, InputError> {
        let unknown = |field: &str, error: &dem_core::kinetics::UnknownName| {
            InputError::new("plan", Mistake::UnknownName)
                .in_field(field)
                .found(format_args!("\"{}\"", error.value))
                .expected(format_args!("one of {}", error.choices))
        };
        let kinetics: Kinetics =
            builtin.kinetics.parse().map_err(|error| unknown("kinetics", &error))?;
        let kind: SolverKind =
            builtin.solver.name.parse().map_err(|error| unknown("solver.name", &error))?;
        let solver =
            SolverSettings { tolerance: builtin.solver.tolerance, ..SolverSettings::of(kind) };
        let scene = builtin.scene().map_err(|error| {
            InputError::new(&builtin.experiment, Mistake::OutOfRange).found(error)
        })?;
        let (names, places): (Vec<_>, Vec<_>) = ParameterName::ALL
            .into_iter()
            .filter_map(|model| {
                let calibrated =
                    builtin.parameters.get(model.name()).map_or(model.name(), String::as_str);
                Some((model, parameters.iter().position(|name| name == calibrated)?))
            })
            .unzip();
        Ok(Self {
            model: NeckGrowth::new(names, builtin.powder(), scene, kinetics, solver, times_s),
            places,
            tau_s_factor: builtin.tau_s_radius_m.map_or(1.0, |radius| builtin.radius_m / radius),
        })
    }

    /// The curve at a parameter vector of the plan.
    ///
    /// # Errors
    ///
    /// As [`Simulator::simulate`].
    pub(crate) fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let mut own = [0.0; 4];
        for ((own, &place), name) in own.iter_mut().zip(&self.places).zip(self.model.names()) {
            let factor = if *name == ParameterName::TauS { self.tau_s_factor } else { 1.0 };
            *own = theta[place] * factor;
        }
        self.model.simulate(&own[..self.places.len()], out)
    }
}

/// What runs the commands.
pub(crate) struct Runner<'a> {
    pub(crate) executor: Box<dyn Executor + Send + 'a>,
    pub(crate) watch: Box<dyn FnMut(Event) + Send + 'a>,
}

/// All experiments of a plan.
pub(crate) struct PlanSimulator<'a> {
    plan: &'a ExternalPlan,
    campaign: &'a Campaign,
    models: Vec<Option<BuiltinModel>>,
    /// Values of each experiment, in order.
    widths: Vec<usize>,
    observables: usize,
    runner: Mutex<Runner<'a>>,
    stop: Stop,
    failure: Mutex<Option<ExecutorError>>,
}

/// The built-in models of a plan, none in the places of commands.
pub(crate) fn models(plan: &ExternalPlan) -> Result<Vec<Option<BuiltinModel>>, InputError> {
    let names = plan.parameter_names();
    plan.experiments
        .iter()
        .map(|experiment| match &experiment.simulator {
            SimulatorPlan::Builtin(builtin) => {
                let times = experiment
                    .observables
                    .first()
                    .map_or_else(Vec::new, |observable| observable.control.clone());
                BuiltinModel::of(builtin, &names, times).map(Some)
            }
            SimulatorPlan::Command(_) => Ok(None),
        })
        .collect()
}

/// Number of the run of one experiment at one sample, both counted from 0; runs count from 1.
pub(crate) fn run_number(plan: &ExternalPlan, sample: usize, experiment: usize) -> u64 {
    (sample * plan.experiments.len() + experiment) as u64 + 1
}

/// Sample and experiment of a run.
pub(crate) fn sample_of(plan: &ExternalPlan, number: u64) -> (usize, usize) {
    let place = usize::try_from(number.saturating_sub(1)).unwrap_or(usize::MAX);
    (place / plan.experiments.len(), place % plan.experiments.len())
}

/// Values of each experiment.
pub(crate) fn widths(plan: &ExternalPlan) -> Vec<usize> {
    let width = |experiment: &super::plan::ExperimentPlan| {
        experiment.observables.iter().map(|observable| observable.values.len()).sum()
    };
    plan.experiments.iter().map(width).collect()
}

/// The words that failures are counted by.
pub(crate) fn cause(plan: &ExternalPlan, experiment: usize, words: &str) -> String {
    if plan.experiments.len() > 1 {
        format!("{}: {words}", plan.experiments[experiment].name)
    } else {
        words.to_owned()
    }
}

impl<'a> PlanSimulator<'a> {
    pub(crate) fn new(
        plan: &'a ExternalPlan,
        campaign: &'a Campaign,
        runner: Runner<'a>,
        stop: Stop,
    ) -> Result<Self, InputError> {
        let widths = widths(plan);
        Ok(Self {
            plan,
            campaign,
            models: models(plan)?,
            observables: widths.iter().sum(),
            widths,
            runner: Mutex::new(runner),
            stop,
            failure: Mutex::new(None),
        })
    }

    /// Why the runs stopped, if they did.
    pub(crate) fn take_failure(&self) -> Option<ExecutorError> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn stopped(&self, error: ExecutorError, rows: usize) -> Vec<Result<(), SimError>> {
        *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        vec![Err(SimError::fatal(STOPPED)); rows]
    }

    /// Runs the built-in experiments of one row.
    fn builtin_row(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let mut rest = out;
        for (place, (model, &width)) in self.models.iter().zip(&self.widths).enumerate() {
            let (own, after) = std::mem::take(&mut rest).split_at_mut(width);
            if let Some(model) = model {
                model.simulate(theta, own).map_err(|error| match error {
                    SimError::Recoverable { cause: words } => {
                        SimError::recoverable(cause(self.plan, place, &words))
                    }
                    SimError::Fatal { cause: words } => {
                        SimError::fatal(cause(self.plan, place, &words))
                    }
                })?;
            }
            rest = after;
        }
        Ok(())
    }

    /// Fills the values of the commands of one row from their stored outcomes.
    fn command_row(&self, sample: usize, out: &mut [f64]) -> Result<(), SimError> {
        let mut rest = out;
        for (place, (model, &width)) in self.models.iter().zip(&self.widths).enumerate() {
            let (own, after) = std::mem::take(&mut rest).split_at_mut(width);
            if model.is_none() {
                match self.campaign.outcome(run_number(self.plan, sample, place)) {
                    Some(Outcome::Finished { values, .. }) if values.len() == width => {
                        own.copy_from_slice(&values);
                    }
                    Some(Outcome::Failed { kind, .. }) => {
                        let words = cause(self.plan, place, &kind.to_string());
                        return Err(SimError::recoverable(words));
                    }
                    _ => return Err(SimError::fatal("a run ended without a stored outcome")),
                }
            }
            rest = after;
        }
        Ok(())
    }
}

impl Simulator for PlanSimulator<'_> {
    fn parameters(&self) -> usize {
        self.plan.parameters.len()
    }

    fn observables(&self) -> usize {
        self.observables
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        if self.models.iter().any(Option::is_none) {
            return Err(SimError::fatal("a command is run for samples alone"));
        }
        self.builtin_row(theta, out)
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let d = self.parameters();
        let rows = thetas.len() / d;
        // Given sets are run as they are given, not as their normal scores round them.
        let given: Option<Vec<f64>> =
            self.plan.design.as_ref().map(|design| {
                design.sets.iter().skip(first).take(rows).flatten().copied().collect()
            });
        let thetas = given.as_deref().filter(|given| given.len() == thetas.len()).unwrap_or(thetas);
        let mut results: Vec<Result<(), SimError>> = thetas
            .par_chunks_exact(d)
            .zip(outputs.par_chunks_exact_mut(self.observables))
            .with_min_len(16)
            .map(|(theta, out)| {
                if self.stop.asked() {
                    return Err(SimError::fatal(STOPPED));
                }
                self.builtin_row(theta, out)
            })
            .collect();
        if self.stop.asked() {
            return self.stopped(ExecutorError::Interrupted { detached: false }, rows);
        }
        // A set that a built-in experiment refuses has weight zero: its commands need not run.
        let commands: Vec<usize> =
            (0..self.models.len()).filter(|&place| self.models[place].is_none()).collect();
        if commands.is_empty() {
            return results;
        }
        let mut tasks = Vec::new();
        for (command, &place) in commands.iter().enumerate() {
            for (row, theta) in thetas.chunks_exact(d).enumerate() {
                if results[row].is_ok() {
                    tasks.push(Task {
                        number: run_number(self.plan, first + row, place),
                        command,
                        parameters: theta.to_vec(),
                    });
                }
            }
        }
        tasks.sort_by_key(|task| task.number);
        {
            let mut runner = self.runner.lock().unwrap_or_else(PoisonError::into_inner);
            let Runner { executor, watch } = &mut *runner;
            if let Err(error) = executor.run(self.campaign, &tasks, watch, &self.stop) {
                return self.stopped(error, rows);
            }
        }
        for ((row, result), out) in
            results.iter_mut().enumerate().zip(outputs.chunks_exact_mut(self.observables))
        {
            if result.is_ok() {
                *result = self.command_row(first + row, out);
            }
        }
        results
    }
}
