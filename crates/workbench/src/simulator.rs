//! All experiments of a plan as one simulator: built-in ones are computed, programs are run by an executor.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use campaign::{Campaign, Event, Executor, ExecutorError, Feed, Outcome, Task};
use smc_calib::{SimError, Simulator};

use crate::error::{InputError, Mistake};
use crate::given_up::Counting;
use crate::pair::model::NeckGrowth;
use crate::plan::{Plan, SimulatorPlan, run_number};
use crate::watch::Watch;

/// What has happened to the programs of a run.
#[derive(Debug)]
pub(crate) enum Change {
    /// One is another than at the beginning, in words.
    Another(String),
    /// A file was written or put into its place again, and is what it was: it may have been another one for a while.
    Written(String),
}

/// Looks at the programs of runs.
type Look<'a> = dyn FnMut(&BTreeSet<u64>) -> Option<Change> + Send + 'a;

/// Where and by what the programs of a plan are run.
pub(crate) struct Runner<'a> {
    /// Folder of the runs.
    pub(crate) campaign: &'a Campaign,
    /// Executor of the runs.
    pub(crate) executor: Box<dyn Executor + Send + 'a>,
    /// Takes runs whose turn has not come, where those of several stages go on at a time.
    pub(crate) ahead: Option<&'a Feed<'a>>,
    /// Numbers of the runs that were given and since whose end the programs were not looked at.
    pub(crate) unsure: BTreeSet<u64>,
    /// Whether a program is another one than at the beginning, or was written; asked with the runs of which that is not known yet.
    pub(crate) changed: Box<Look<'a>>,
    /// Failures that count until all that was placed with them is in.
    pub(crate) given_up: Counting,
    /// Told of every run.
    pub(crate) on_event: Box<dyn FnMut(Event) + Send + 'a>,
}

/// All experiments of a plan.
pub(crate) struct Experiments<'a> {
    plan: &'a Plan,
    models: Vec<Option<NeckGrowth>>,
    observables: usize,
    runner: Option<Mutex<Runner<'a>>>,
    watch: &'a dyn Watch,
    failure: Mutex<Option<ExecutorError>>,
}

/// The built-in models of a plan, none in the places of programs and functions.
pub(crate) fn models(plan: &Plan) -> Result<Vec<Option<NeckGrowth>>, InputError> {
    plan.experiments
        .iter()
        .map(|experiment| match &experiment.simulator {
            SimulatorPlan::Builtin(pair) => {
                let times = experiment.observables.first().map(|o| o.control.clone());
                NeckGrowth::new(pair, &plan.parameters, times.unwrap_or_default()).map(Some)
            }
            SimulatorPlan::Command(_) | SimulatorPlan::Function { .. } => Ok(None),
        })
        .collect()
}

/// Refuses to call a function that this program does not have.
fn of_another_program(plan: &Plan, name: &str) -> InputError {
    InputError::new(&plan.name, Mistake::Conflict)
        .found(format_args!("a run of {name}, a function of the program that calibrated it"))
        .expected("a run of built-in simulators or of programs")
        .help("calibrate once more in that program, or put the function behind a command in a plan file")
}

/// A cause of failure, with the name of its experiment where there are several.
pub(crate) fn cause(plan: &Plan, experiment: usize, words: &str) -> String {
    if plan.experiments.len() > 1 {
        format!("{}: {words}", plan.experiments[experiment].name)
    } else {
        words.to_owned()
    }
}

/// Outcome of a run of a program: its values, or the cause of its failure; none before it ended.
pub(crate) fn stored(
    plan: &Plan,
    place: usize,
    outcome: Option<Outcome>,
) -> Option<Result<Vec<f64>, SimError>> {
    match outcome? {
        Outcome::Finished { values, .. } if values.len() == plan.experiments[place].width() => {
            Some(Ok(values))
        }
        Outcome::Finished { .. } => None,
        Outcome::Failed { kind, .. } => {
            Some(Err(SimError::recoverable(cause(plan, place, &kind.to_string()))))
        }
    }
}

impl Runner<'_> {
    /// Makes runs, and looks at their programs before them, so that none is made by another one, and after them, as it may have
    /// been replaced meanwhile. Which of the runs another program made is not known: all are made again.
    fn make(&mut self, tasks: &[Task], watch: &dyn Watch) -> Result<(), ExecutorError> {
        let campaign = self.campaign;
        let open = |number: &u64| campaign.outcome(*number).is_none();
        self.unsure.extend(tasks.iter().map(|task| task.number).filter(open));
        let mut again = false;
        loop {
            let mut ran = Ok(());
            let mut change = (self.changed)(&self.unsure);
            if change.is_none() {
                ran = self.executor.run(campaign, tasks, &mut *self.on_event, watch.stop());
                let left: BTreeSet<u64> = self.unsure.iter().copied().filter(open).collect();
                change = (self.changed)(&left);
                if change.is_none() {
                    self.unsure = left;
                }
            }
            let Some(change) = change else { return ran };
            let once_more = matches!(change, Change::Written(_)) && self.ahead.is_none() && !again;
            if let (Some(feed), false) = (self.ahead, once_more) {
                feed.finish();
            }
            let unsure: Vec<u64> = self.unsure.iter().copied().collect();
            let made_again = campaign.forget(&unsure)?;
            match change {
                Change::Another(change) => {
                    let said = format!("{change}: runs of both would be mixed");
                    return Err(ExecutorError::Simulator(said));
                }
                Change::Written(_) if ran.is_err() => return ran,
                Change::Written(file) if once_more => {
                    again = made_again > 0;
                    if again {
                        watch.note(&format!(
                            "{file} was written while runs were made, and is what it was: {made_again} runs are made again, as it may have \
                             been another one for a while"
                        ));
                    }
                }
                Change::Written(file) => {
                    return Err(ExecutorError::Simulator(format!(
                        "{file} was written while runs were made, and is what it was; whether it was so all the time is not known, \
                         and {made_again} runs are to be made again"
                    )));
                }
            }
        }
    }
}

impl<'a> Experiments<'a> {
    /// The experiments of a plan; `runner` is needed where it has programs.
    pub(crate) fn new(
        plan: &'a Plan,
        runner: Option<Runner<'a>>,
        watch: &'a dyn Watch,
    ) -> Result<Self, InputError> {
        if let Some((_, name)) = plan.function() {
            return Err(of_another_program(plan, name));
        }
        Ok(Self {
            plan,
            models: models(plan)?,
            observables: plan.observations(),
            runner: runner.map(Mutex::new),
            watch,
            failure: Mutex::new(None),
        })
    }

    /// Why the executor stopped, if it did.
    pub(crate) fn take_failure(&self) -> Option<ExecutorError> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// The experiments with the places of their values in a row.
    fn places(&self) -> impl Iterator<Item = (usize, Option<&NeckGrowth>, std::ops::Range<usize>)> {
        let mut first = 0;
        self.models.iter().zip(&self.plan.experiments).enumerate().map(
            move |(place, (model, experiment))| {
                let range = first..first + experiment.width();
                first = range.end;
                (place, model.as_ref(), range)
            },
        )
    }

    /// Names the experiment in an error of its simulation.
    fn of_experiment(&self, place: usize, error: SimError) -> SimError {
        match error {
            SimError::Recoverable { cause: words } => {
                SimError::recoverable(cause(self.plan, place, &words))
            }
            SimError::Fatal { cause: words } => SimError::fatal(cause(self.plan, place, &words)),
            SimError::Interrupted => SimError::Interrupted,
        }
    }

    /// Computes the built-in experiments of all rows.
    fn built_in(&self, thetas: &[f64], outputs: &mut [f64]) -> Vec<Result<(), SimError>> {
        let stop = self.watch.stop();
        let counted = self.runner.is_none();
        let go_on = |first: bool| {
            if first && counted {
                self.watch.advance();
            }
            !stop.asked()
        };
        if let [Some(model)] = &self.models[..] {
            return model.curves(thetas, outputs, &|| go_on(true));
        }
        let rows = thetas.len() / self.plan.parameters.len();
        let mut results = vec![Ok(()); rows];
        let mut first = true;
        for (place, model, range) in self.places() {
            let Some(model) = model else { continue };
            let mut own = vec![0.0; rows * range.len()];
            let found = model.curves(thetas, &mut own, &|| go_on(first));
            first = false;
            let values = own.chunks_exact(range.len());
            let out = outputs.chunks_exact_mut(self.observables);
            for (((result, found), values), out) in
                results.iter_mut().zip(found).zip(values).zip(out)
            {
                out[range.clone()].copy_from_slice(values);
                if result.is_ok() {
                    *result = found.map_err(|error| self.of_experiment(place, error));
                }
            }
        }
        results
    }

    /// The runs of programs of all rows that the built-in experiments did not refuse.
    fn tasks(&self, first: usize, thetas: &[f64], results: &[Result<(), SimError>]) -> Vec<Task> {
        let commands = self.places().filter(|(_, model, _)| model.is_none());
        let mut tasks = Vec::new();
        for (command, (place, ..)) in commands.enumerate() {
            let rows = thetas.chunks_exact(self.plan.parameters.len()).enumerate();
            tasks.extend(rows.filter(|(row, _)| results[*row].is_ok()).map(|(row, theta)| Task {
                number: run_number(self.plan, first + row, place),
                command,
                parameters: theta.to_vec(),
            }));
        }
        tasks.sort_by_key(|task| task.number);
        tasks
    }

    /// Runs the programs of all rows that the built-in experiments did not refuse, and fills in their values.
    fn programs(
        &self,
        runner: &Mutex<Runner<'_>>,
        (first, thetas): (usize, &[f64]),
        results: &mut [Result<(), SimError>],
        outputs: &mut [f64],
    ) {
        let tasks = self.tasks(first, thetas, results);
        let mut runner = runner.lock().unwrap_or_else(PoisonError::into_inner);
        let made = runner.make(&tasks, self.watch);
        let Runner { campaign, given_up, .. } = &mut *runner;
        if let Err(error) = made {
            *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            results.fill(Err(SimError::Interrupted));
            return;
        }
        let rows = outputs.chunks_exact_mut(self.observables).zip(results).enumerate();
        for (row, (out, result)) in rows.filter(|(_, (_, result))| result.is_ok()) {
            for (place, _, range) in self.places().filter(|(_, model, _)| model.is_none()) {
                let number = run_number(self.plan, first + row, place);
                if let Some(words) = given_up.cause(number) {
                    *result = Err(SimError::recoverable(cause(self.plan, place, words)));
                    break;
                }
                match stored(self.plan, place, campaign.outcome(number)) {
                    Some(Ok(values)) => out[range].copy_from_slice(&values),
                    Some(Err(error)) => {
                        *result = Err(error);
                        break;
                    }
                    None => {
                        *result = Err(SimError::fatal("a run ended without a stored outcome"));
                        break;
                    }
                }
            }
        }
    }
}

impl Simulator for Experiments<'_> {
    fn parameters(&self) -> usize {
        self.plan.parameters.len()
    }

    fn observables(&self) -> usize {
        self.observables
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        if self.watch.stop().asked() {
            return Err(SimError::Interrupted);
        }
        for (place, model, range) in self.places() {
            let Some(model) = model else {
                return Err(SimError::fatal("a program is run for samples alone"));
            };
            model
                .simulate(theta, &mut out[range])
                .map_err(|error| self.of_experiment(place, error))?;
        }
        Ok(())
    }

    fn revised(&self, samples: usize) -> Vec<usize> {
        let Some(runner) = &self.runner else { return Vec::new() };
        let runner = runner.lock().unwrap_or_else(PoisonError::into_inner);
        runner.given_up.reach(self.plan, samples)
    }

    fn will_revise(&self) -> bool {
        let Some(runner) = &self.runner else { return false };
        runner.lock().unwrap_or_else(PoisonError::into_inner).given_up.will_change()
    }

    fn announce(&self, first: usize, thetas: &[f64]) {
        let Some(runner) = &self.runner else { return };
        let mut runner = runner.lock().unwrap_or_else(PoisonError::into_inner);
        let Runner { campaign, ahead: Some(feed), unsure, .. } = &mut *runner else {
            return;
        };
        let rows = thetas.len() / self.parameters();
        let results = self.built_in(thetas, &mut vec![0.0; rows * self.observables]);
        let tasks = self.tasks(first, thetas, &results);
        let new = tasks.iter().map(|task| task.number);
        unsure.extend(new.filter(|number| campaign.outcome(*number).is_none()));
        // A run that is not given here is given, and its errors said, with its batch.
        let _ = feed.give(&tasks);
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let rows = thetas.len() / self.parameters();
        // Given sets are run as they are given, not as their normal scores round them.
        let given: Option<Vec<f64>> =
            self.plan.design.as_ref().map(|design| {
                design.sets.iter().skip(first).take(rows).flatten().copied().collect()
            });
        let thetas = given.as_deref().filter(|given| given.len() == thetas.len()).unwrap_or(thetas);
        let mut results = self.built_in(thetas, outputs);
        if self.watch.stop().asked() {
            return vec![Err(SimError::Interrupted); rows];
        }
        if let Some(runner) = &self.runner {
            self.programs(runner, (first, thetas), &mut results, outputs);
        }
        results
    }
}
