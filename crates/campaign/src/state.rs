//! Everything that a campaign has stored, in memory and in its journals.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{CampaignError, Damage, ExecutorError};
use crate::folder::{ITERATIONS, RESULTS, TASKS};
use crate::journal::{self, Journal};
use crate::outage::Streak;
use crate::outcome::Outcome;
use crate::record::ResultRecord;
use crate::spec::{CampaignSpec, CommandSpec};
use crate::task::Task;
use crate::{files, seal};

/// Room that is kept on the disk for outcomes \[bytes\]: of a hundred runs with dozens of values each.
const RESERVE_BYTES: u64 = 64 << 10;

/// End of the names of journals as they were before failures were given up: `results.jsonl.retried-1`.
const GIVEN_UP: &str = "retried";

/// The tasks by number, each with its fingerprint.
type Tasks = BTreeMap<u64, (Task, String)>;

/// A file in `iterations`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Iteration {
    iteration: u32,
    record: Value,
}

/// The stored tasks, results and iterations. Its owner must hold the directory's lock.
#[derive(Debug)]
pub(crate) struct State {
    pub(crate) tasks: Tasks,
    /// Outcomes by number and fingerprint: a result belongs to its parameters, not to a number.
    results: HashMap<(u64, String), Outcome>,
    pub(crate) iterations: BTreeMap<u32, Value>,
    tasks_journal: Journal,
    results_journal: Journal,
    /// How the last runs ended.
    streak: Streak,
    /// Tasks as they were placed before failures were given up.
    earlier: Tasks,
    /// Number of tasks that were placed otherwise than before.
    placed_again: u64,
}

impl State {
    /// Reads the journals and iterations, and mends what is damaged.
    pub(crate) fn open(
        dir: &Path,
        spec: &CampaignSpec,
        damage: &mut Vec<Damage>,
    ) -> Result<Self, CampaignError> {
        let (tasks_journal, tasks, broken) = Journal::open::<Task>(&dir.join(TASKS))?;
        damage.extend(broken);
        let (mut results_journal, stored, broken) =
            Journal::open::<ResultRecord>(&dir.join(RESULTS))?;
        results_journal.reserve(RESERVE_BYTES);
        damage.extend(broken);
        let folder = dir.join(ITERATIONS);
        let number = |read: &Iteration| u64::from(read.iteration);
        let read = files::read_numbered(&folder, "iteration", number, damage)?;
        let iterations = read.into_iter().map(|(_, read)| (read.iteration, read.record)).collect();
        let mut results = HashMap::with_capacity(stored.len());
        for result in stored {
            results.entry((result.number, result.task)).or_insert(result.outcome);
        }
        let tasks = index(spec, tasks);
        let mut streak = Streak::default();
        for (number, (_, fingerprint)) in &tasks {
            results.get(&(*number, fingerprint.clone())).iter().for_each(|found| streak.add(found));
        }
        streak.end();
        let (earlier, placed_again) = (Tasks::new(), 0);
        Ok(Self {
            tasks,
            results,
            iterations,
            tasks_journal,
            results_journal,
            streak,
            earlier,
            placed_again,
        })
    }

    /// Stores the `tasks` that are new and flushes them to disk; if one is refused, none is stored.
    pub(crate) fn add_tasks(
        &mut self,
        spec: &CampaignSpec,
        tasks: &[Task],
    ) -> Result<(), CampaignError> {
        let mut new: BTreeMap<u64, &Task> = BTreeMap::new();
        for task in tasks {
            check_task(spec, task)
                .map_err(|problem| CampaignError::InvalidTask { number: task.number, problem })?;
            let known = self.tasks.get(&task.number).map(|(task, _)| task);
            match known.or_else(|| new.get(&task.number).copied()) {
                Some(stored) if !same_bits(stored, task) => {
                    return Err(CampaignError::TaskDiffers {
                        number: task.number,
                        stored: Box::new(stored.clone()),
                        given: Box::new(task.clone()),
                    });
                }
                Some(_) => {}
                None => {
                    new.insert(task.number, task);
                }
            }
        }
        let new: Vec<&Task> = new.into_values().collect();
        self.tasks_journal.append(&new)?;
        for task in new {
            let fingerprint = seal::hex(spec.fingerprint(task));
            let before = self.earlier.remove(&task.number);
            self.placed_again +=
                u64::from(before.is_some_and(|(before, _)| !same_bits(&before, task)));
            self.tasks.insert(task.number, (task.clone(), fingerprint));
        }
        Ok(())
    }

    /// Writes outcomes of known tasks, not flushed; all of them, or none where one is refused.
    pub(crate) fn add_outcomes(
        &mut self,
        spec: &CampaignSpec,
        outcomes: Vec<(u64, Outcome)>,
    ) -> Result<(), CampaignError> {
        let mut results = Vec::with_capacity(outcomes.len());
        for (number, outcome) in outcomes {
            let invalid = |problem: String| CampaignError::InvalidOutcome { number, problem };
            let (task, _) =
                self.tasks.get(&number).ok_or_else(|| invalid("there is no such task".into()))?;
            check_outcome(spec, task, &outcome).map_err(invalid)?;
            results.push(ResultRecord::new(spec, task, outcome));
        }
        self.add_results(results).map(drop)
    }

    /// Writes the results that are not there yet, not flushed, and returns their numbers.
    pub(crate) fn add_results(
        &mut self,
        mut results: Vec<ResultRecord>,
    ) -> Result<Vec<u64>, CampaignError> {
        let mut keys = HashSet::with_capacity(results.len());
        results.retain(|result| {
            let key = (result.number, result.task.clone());
            !self.results.contains_key(&key) && keys.insert(key)
        });
        self.results_journal.write(&results)?;
        for result in &results {
            if self.tasks.get(&result.number).is_some_and(|(_, task)| *task == result.task) {
                self.streak.add(&result.outcome);
            }
        }
        let numbers = results.iter().map(|result| result.number).collect();
        self.results.extend(results.into_iter().map(|r| ((r.number, r.task), r.outcome)));
        Ok(numbers)
    }

    pub(crate) fn flush_outcomes(&self) -> Result<(), CampaignError> {
        self.results_journal.flush()
    }

    /// Gives up the outcomes of failed runs, and where tasks were placed: they are submitted anew. Results are found again
    /// by their parameters. What there was stays on the disk beside the journals.
    pub(crate) fn forget_failed(
        &mut self,
        dir: &Path,
        given_up: &dyn Fn(&Outcome) -> bool,
    ) -> Result<Vec<u64>, CampaignError> {
        let failed = |outcome: &Outcome| outcome.failure().is_some() && given_up(outcome);
        // Of the results, not of the tasks: a call that was cut off may have emptied those.
        let failures = self.results.iter().filter(|(_, outcome)| failed(outcome));
        let mut numbers: Vec<u64> = failures.map(|((number, _), _)| *number).collect();
        numbers.sort_unstable();
        numbers.dedup();
        if numbers.is_empty() {
            return Ok(numbers);
        }
        let stored = self.stored_without(|result| failed(&result.outcome))?;
        // In this order: tasks without a line are submitted again as they were, while failures are still there.
        self.place_again(dir)?;
        self.results_journal.keep_as(GIVEN_UP)?;
        self.results_journal.replace(&stored)?;
        self.results.retain(|_, outcome| !failed(outcome));
        self.streak = Streak::default();
        for outcome in self.results.values() {
            self.streak.add(outcome);
            self.streak.end();
        }
        Ok(numbers)
    }

    /// Gives up where tasks were placed: they are submitted anew, and results are found again by their parameters. What there
    /// was stays on the disk beside the journal.
    pub(crate) fn place_again(&mut self, dir: &Path) -> Result<(), CampaignError> {
        self.tasks_journal.keep_as(GIVEN_UP)?;
        self.tasks_journal.replace::<Task>(&[])?;
        self.earlier = std::mem::take(&mut self.tasks);
        // The caller makes them anew, perhaps fewer.
        for k in std::mem::take(&mut self.iterations).into_keys() {
            let _ = std::fs::remove_file(iteration_file(dir, k));
        }
        Ok(())
    }

    /// Gives up the outcomes of some tasks, which are made again. The journal as it was stays beside it.
    pub(crate) fn forget(&mut self, numbers: &[u64]) -> Result<usize, CampaignError> {
        let given_up: HashSet<(u64, String)> = numbers
            .iter()
            .filter_map(|number| Some((*number, self.tasks.get(number)?.1.clone())))
            .filter(|key| self.results.contains_key(key))
            .collect();
        if given_up.is_empty() {
            return Ok(0);
        }
        let stored =
            self.stored_without(|result| given_up.contains(&(result.number, result.task.clone())))?;
        self.results_journal.keep_as(GIVEN_UP)?;
        self.results_journal.replace(&stored)?;
        self.results.retain(|key, _| !given_up.contains(key));
        Ok(given_up.len())
    }

    /// The results on the disk without those that are given up.
    fn stored_without(
        &self,
        given_up: impl Fn(&ResultRecord) -> bool,
    ) -> Result<Vec<ResultRecord>, CampaignError> {
        let lines = journal::read::<ResultRecord>(self.results_journal.path())?;
        let mut stored = lines.map_or_else(Vec::new, |lines| lines.records);
        stored.retain(|result| !given_up(result));
        Ok(stored)
    }

    /// Number of tasks that were placed otherwise than before failures were given up.
    pub(crate) fn placed_again(&self) -> u64 {
        self.placed_again
    }

    /// Whether the last runs look like an outage.
    pub(crate) fn outage(&self) -> Option<ExecutorError> {
        self.streak.outage()
    }

    /// Stores the record of an iteration, in place of what was there.
    pub(crate) fn add_iteration(
        &mut self,
        dir: &Path,
        k: u32,
        record: &Value,
    ) -> Result<(), CampaignError> {
        if self.iterations.get(&k) == Some(record) {
            return Ok(());
        }
        let iteration = Iteration { iteration: k, record: record.clone() };
        files::write_sealed(&iteration_file(dir, k), &iteration)?;
        self.iterations.insert(k, iteration.record);
        Ok(())
    }

    /// Outcome of a known task; none where it has none yet.
    pub(crate) fn outcome(&self, number: u64) -> Option<&Outcome> {
        let (_, fingerprint) = self.tasks.get(&number)?;
        self.results.get(&(number, fingerprint.clone()))
    }

    /// The `tasks` without an outcome, each once.
    pub(crate) fn missing(&self, tasks: &[Task]) -> Vec<Task> {
        let mut seen = HashSet::new();
        let mut open =
            |task: &&Task| seen.insert(task.number) && self.outcome(task.number).is_none();
        tasks.iter().filter(&mut open).cloned().collect()
    }
}

fn iteration_file(dir: &Path, k: u32) -> PathBuf {
    dir.join(ITERATIONS).join(format!("{k:04}.json"))
}

/// Reads tasks and results without the lock and without mending anything.
pub(crate) fn snapshot(
    dir: &Path,
    spec: &CampaignSpec,
) -> Result<(Tasks, Vec<ResultRecord>), CampaignError> {
    let tasks = journal::read::<Task>(&dir.join(TASKS))?.map_or_else(Vec::new, |l| l.records);
    let results =
        journal::read::<ResultRecord>(&dir.join(RESULTS))?.map_or_else(Vec::new, |l| l.records);
    Ok((index(spec, tasks), results))
}

/// Tasks by number, with their fingerprints; those that do not fit the specification are left out.
fn index(spec: &CampaignSpec, tasks: Vec<Task>) -> Tasks {
    let mut index = BTreeMap::new();
    for task in tasks.into_iter().filter(|task| check_task(spec, task).is_ok()) {
        let fingerprint = seal::hex(spec.fingerprint(&task));
        index.entry(task.number).or_insert((task, fingerprint));
    }
    index
}

fn same_bits(a: &Task, b: &Task) -> bool {
    let bits = |task: &Task| task.parameters.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    a.command == b.command && bits(a) == bits(b)
}

fn check_task(spec: &CampaignSpec, task: &Task) -> Result<(), String> {
    if task.command >= spec.commands.len() {
        return Err(format!("command {} of {}", task.command, spec.commands.len()));
    }
    let (given, expected) = (task.parameters.len(), spec.parameter_names.len());
    if given != expected {
        return Err(format!("{given} parameters, there are {expected}"));
    }
    for (name, value) in spec.parameter_names.iter().zip(&task.parameters) {
        if !value.is_finite() {
            return Err(format!("{name} = {value} is not a number"));
        }
    }
    Ok(())
}

/// Checks that an outcome can be stored, and has as many values as the command gives.
pub(crate) fn check_outcome(
    spec: &CampaignSpec,
    task: &Task,
    outcome: &Outcome,
) -> Result<(), String> {
    if !outcome.seconds().is_finite() {
        return Err("its duration is not a number".into());
    }
    let Some(values) = outcome.values() else { return Ok(()) };
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        return Err(format!("{value} is not a number"));
    }
    let expected = spec.commands.get(task.command).map_or(0, CommandSpec::values);
    if expected > 0 && expected != values.len() {
        return Err(format!("{} values, there must be {expected}", values.len()));
    }
    Ok(())
}
