//! A directory of runs, open for the one driver that has its lock.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::durable;
use crate::error::{CampaignError, Damage};
use crate::journal::{self, Journal};
use crate::lock::{self, Lock};
use crate::outcome::Outcome;
use crate::seal;
use crate::spec::CampaignSpec;
use crate::task::Task;

/// The file that says what is run. A directory without it is no campaign.
pub(crate) const RECORD: &str = "campaign.json";
pub(crate) const TASKS: &str = "tasks.jsonl";
pub(crate) const RESULTS: &str = "results.jsonl";
pub(crate) const OUTCOMES: &str = "outcomes";
pub(crate) const ITERATIONS: &str = "iterations";
pub(crate) const WORK: &str = "work";
const LOCK: &str = "lock";
const TEMPORARY: &str = ".campaign-";

/// Format of the directory.
const FORMAT: u64 = 2;

/// Room that is kept on the disk for outcomes: of a hundred runs with dozens of values each.
const RESERVE_BYTES: u64 = 64 << 10;

/// A file that was being written when its process died is removed when it is older than this.
const STALE: Duration = Duration::from_secs(600);

/// What is in [`RECORD`].
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Record {
    format: u64,
    /// Tells this campaign from every other: its processes carry it in their environment.
    pub(crate) id: String,
    pub(crate) spec: CampaignSpec,
    /// Checksums of the caller's files.
    files: BTreeMap<String, String>,
}

/// A line of [`RESULTS`] and a file of [`OUTCOMES`].
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ResultRecord {
    pub(crate) number: u64,
    /// Fingerprint of the task that this is the result of.
    pub(crate) task: String,
    pub(crate) outcome: Outcome,
    /// When it ended \[s since 1970\].
    pub(crate) ended: u64,
}

impl ResultRecord {
    pub(crate) fn new(spec: &CampaignSpec, task: &Task, outcome: Outcome) -> Self {
        let number = task.number;
        Self { number, task: hex(spec.fingerprint(task)), outcome, ended: lock::now_s() }
    }
}

/// A file of [`ITERATIONS`].
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Iteration {
    iteration: u32,
    record: Value,
}

/// What [`Campaign::collect`] found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Collected {
    /// Runs whose outcomes are now in the journal.
    pub numbers: Vec<u64>,
    /// Outcome files that are damaged; they were set aside, and their runs have no outcome.
    pub damage: Vec<Damage>,
}

/// A directory in which runs are made, open and locked. It may be used from several threads.
///
/// ```text
/// campaign.json     what is run, and checksums of the caller's files
/// lock              who has the directory
/// tasks.jsonl       every task, before it is started
/// results.jsonl     every outcome
/// outcomes/         outcomes of workers on other machines, until they are collected
/// iterations/       what the caller records
/// work/             working directories of the runs: work/000012/attempt-1
/// ```
///
/// Every line and file carries a checksum. What is damaged is set aside, and only its runs are made again.
#[derive(Debug)]
pub struct Campaign {
    dir: PathBuf,
    record: Record,
    extra: BTreeMap<String, Vec<u8>>,
    created: bool,
    looked: AtomicBool,
    state: Mutex<State>,
    _lock: Lock,
}

#[derive(Debug)]
struct State {
    tasks: BTreeMap<u64, (Task, String)>,
    /// By number and fingerprint: a result belongs to its parameters, not to a number.
    results: HashMap<(u64, String), Outcome>,
    iterations: BTreeMap<u32, Value>,
    tasks_journal: Journal,
    results_journal: Journal,
}

impl Campaign {
    /// Makes a campaign in a directory that is not there yet, or is empty. `extra` are files that
    /// the caller wants kept with it (a plan, versions), by their names; their checksums are kept.
    ///
    /// # Errors
    ///
    /// [`CampaignError`]; a directory that it began to fill is no campaign, and may be used again.
    pub fn create(
        dir: &Path,
        spec: &CampaignSpec,
        extra: &BTreeMap<String, Vec<u8>>,
    ) -> Result<Self, CampaignError> {
        spec.check()?;
        for name in extra.keys() {
            check_name(name)?;
        }
        let failed = |error| CampaignError::io("made", dir, error);
        if !dir.is_dir() {
            fs::create_dir_all(dir).map_err(failed)?;
        }
        let dir = fs::canonicalize(dir).map_err(failed)?;
        // Before anything is put into somebody else's directory.
        unfinished(&dir, extra)?;
        let lock = Lock::take(&dir)?;
        clear_unfinished(&dir, extra)?;
        for name in [OUTCOMES, ITERATIONS, WORK] {
            fs::create_dir_all(dir.join(name)).map_err(failed)?;
        }
        durable::spread(&dir.join(WORK));
        for (name, contents) in extra {
            durable::write(&dir.join(name), contents)?;
        }
        for name in [TASKS, RESULTS] {
            durable::write(&dir.join(name), b"")?;
        }
        let record = Record::new(&dir, spec, extra);
        record.write(&dir)?;
        if let Some(parent) = dir.parent() {
            durable::flush_folder(parent).map_err(failed)?;
        }
        let mut damage = Vec::new();
        let state = State::open(&dir, &record.spec, &mut damage)?;
        Ok(Self {
            dir,
            record,
            extra: extra.clone(),
            created: true,
            looked: AtomicBool::new(false),
            state,
            _lock: lock,
        })
    }

    /// Opens a campaign, mends it, and says what was damaged. What had finished and is not damaged has its outcome.
    ///
    /// # Errors
    ///
    /// [`CampaignError`], among them [`Locked`](CampaignError::Locked) where another driver has it,
    /// and [`Damaged`](CampaignError::Damaged) where it is not known any more what is run.
    pub fn open(dir: &Path) -> Result<(Self, Vec<Damage>), CampaignError> {
        Self::open_or_restore(dir, None)
    }

    /// As [`open`](Self::open), and replaces those of the specification and the caller's files that
    /// are damaged by the ones given. What is not damaged stays as it is stored: compare
    /// [`spec`](Self::spec) and [`extra`](Self::extra) with what you expect. Outcomes of runs that
    /// were made under another specification are not used.
    ///
    /// # Errors
    ///
    /// [`CampaignError`].
    pub fn restore(
        dir: &Path,
        spec: &CampaignSpec,
        extra: &BTreeMap<String, Vec<u8>>,
    ) -> Result<(Self, Vec<Damage>), CampaignError> {
        spec.check()?;
        for name in extra.keys() {
            check_name(name)?;
        }
        Self::open_or_restore(dir, Some((spec, extra)))
    }

    fn open_or_restore(
        dir: &Path,
        given: Option<(&CampaignSpec, &BTreeMap<String, Vec<u8>>)>,
    ) -> Result<(Self, Vec<Damage>), CampaignError> {
        let path = dir.join(RECORD);
        let there = path.symlink_metadata().is_ok();
        if !there && !dir.join(TASKS).exists() {
            return Err(CampaignError::NotACampaign { dir: dir.to_path_buf() });
        }
        let dir = fs::canonicalize(dir).map_err(|error| CampaignError::io("read", dir, error))?;
        let lock = Lock::take(&dir)?;
        let mut damage = Vec::new();
        let mut rewrite = false;
        let mut record = match (Record::read(&dir), given) {
            (Ok(record), _) => record,
            (Err(CampaignError::Damaged { file, what }), Some((spec, extra))) => {
                damage.push(if there {
                    durable::set_aside(&file, what)?
                } else {
                    Damage { file, line: None, what, set_aside: None, torn: false }
                });
                rewrite = true;
                Record::new(&dir, spec, extra)
            }
            (Err(error), _) => return Err(error),
        };
        for name in [OUTCOMES, ITERATIONS, WORK] {
            let path = dir.join(name);
            if !path.is_dir() {
                let what = "it is not there".to_owned();
                damage.push(match path.symlink_metadata() {
                    Ok(_) => durable::set_aside(&path, "it is not a directory")?,
                    Err(_) => Damage {
                        file: path.clone(),
                        line: None,
                        what,
                        set_aside: None,
                        torn: false,
                    },
                });
                fs::create_dir_all(&path).map_err(|e| CampaignError::io("made", &path, e))?;
            }
            remove_stale(&path);
        }
        remove_stale(&dir);
        let mut extra = BTreeMap::new();
        for (name, sum) in &record.files.clone() {
            let path = dir.join(name);
            let contents = if path.is_dir() { None } else { durable::read(&path)? };
            let whole = contents.filter(|contents| hex(seal::checksum(contents)) == *sum);
            if let Some(contents) = whole {
                extra.insert(name.clone(), contents);
                continue;
            }
            damage.push(if path.symlink_metadata().is_ok() {
                durable::set_aside(&path, "its checksum does not fit")?
            } else {
                let what = "it is not there".into();
                Damage { file: path.clone(), line: None, what, set_aside: None, torn: false }
            });
            if let Some(contents) = given.and_then(|(_, extra)| extra.get(name)) {
                durable::write(&path, contents)?;
                record.files.insert(name.clone(), hex(seal::checksum(contents)));
                rewrite = true;
                extra.insert(name.clone(), contents.clone());
            }
        }
        if rewrite {
            record.write(&dir)?;
        }
        let state = State::open(&dir, &record.spec, &mut damage)?;
        let campaign = Self {
            dir,
            record,
            extra,
            created: false,
            looked: AtomicBool::new(false),
            state,
            _lock: lock,
        };
        damage.extend(campaign.collect()?.damage);
        Ok((campaign, damage))
    }

    /// The directory, absolute.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// What is run.
    #[must_use]
    pub fn spec(&self) -> &CampaignSpec {
        &self.record.spec
    }

    /// One of the caller's files; none where there is no such file or it was damaged.
    #[must_use]
    pub fn extra(&self, name: &str) -> Option<&[u8]> {
        self.extra.get(name).map(Vec::as_slice)
    }

    /// A text that tells this campaign from every other.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.record.id
    }

    /// Whether it was made by [`create`](Self::create) just now, so that nothing of before can be there.
    #[must_use]
    pub fn is_new(&self) -> bool {
        self.created
    }

    /// Whether nobody has asked this before.
    pub(crate) fn first_look(&self) -> bool {
        !self.looked.swap(true, Ordering::Relaxed)
    }

    /// Stores tasks, flushed to disk. Tasks that are known already are not stored again. Executors do this
    /// before they start anything.
    ///
    /// # Errors
    ///
    /// [`CampaignError::TaskDiffers`] where a number is known with other parameters;
    /// [`CampaignError::InvalidTask`]; a failed write. Nothing is stored then.
    pub fn record_submitted(&self, tasks: &[Task]) -> Result<(), CampaignError> {
        let mut state = self.state();
        let mut new: BTreeMap<u64, &Task> = BTreeMap::new();
        for task in tasks {
            check_task(&self.record.spec, task)
                .map_err(|problem| CampaignError::InvalidTask { number: task.number, problem })?;
            let known = state.tasks.get(&task.number).map(|(task, _)| task);
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
        state.tasks_journal.append(&new)?;
        for task in new {
            let fingerprint = hex(self.record.spec.fingerprint(task));
            state.tasks.insert(task.number, (task.clone(), fingerprint));
        }
        Ok(())
    }

    /// A task that was submitted.
    #[must_use]
    pub fn task(&self, number: u64) -> Option<Task> {
        self.state().tasks.get(&number).map(|(task, _)| task.clone())
    }

    /// Every task that was submitted, by number.
    #[must_use]
    pub fn tasks(&self) -> Vec<Task> {
        self.state().tasks.values().map(|(task, _)| task.clone()).collect()
    }

    /// How a submitted task ended, with the same bits as it was stored; none where it did not end yet.
    #[must_use]
    pub fn outcome(&self, number: u64) -> Option<Outcome> {
        let state = self.state();
        let (_, fingerprint) = state.tasks.get(&number)?;
        state.results.get(&(number, fingerprint.clone())).cloned()
    }

    /// Those of `tasks` that have no outcome, each once.
    #[must_use]
    pub fn missing(&self, tasks: &[Task]) -> Vec<Task> {
        let state = self.state();
        let ended = |number: u64| {
            state.tasks.get(&number).is_some_and(|(_, fingerprint)| {
                state.results.contains_key(&(number, fingerprint.clone()))
            })
        };
        let mut seen = HashSet::new();
        let mut open = |task: &&Task| seen.insert(task.number) && !ended(task.number);
        tasks.iter().filter(&mut open).cloned().collect()
    }

    /// Stores outcomes of submitted tasks, flushed to disk once for all of them. A run that has an
    /// outcome keeps it: the first one counts.
    ///
    /// # Errors
    ///
    /// [`CampaignError::InvalidOutcome`] for a task that was never submitted, or values that are not
    /// finite or not as many as the command gives; a failed write. Nothing is stored then.
    pub fn record(&self, outcomes: Vec<(u64, Outcome)>) -> Result<(), CampaignError> {
        self.write_outcomes(outcomes)?;
        self.flush_outcomes()
    }

    /// As [`record`](Self::record), without flushing.
    pub(crate) fn write_outcomes(
        &self,
        outcomes: Vec<(u64, Outcome)>,
    ) -> Result<(), CampaignError> {
        let mut state = self.state();
        let mut results = Vec::with_capacity(outcomes.len());
        for (number, outcome) in outcomes {
            let invalid = |problem: String| CampaignError::InvalidOutcome { number, problem };
            let (task, _) =
                state.tasks.get(&number).ok_or_else(|| invalid("there is no such task".into()))?;
            check_outcome(&self.record.spec, task, &outcome).map_err(invalid)?;
            results.push(ResultRecord::new(&self.record.spec, task, outcome));
        }
        state.add(results).map(drop)
    }

    pub(crate) fn flush_outcomes(&self) -> Result<(), CampaignError> {
        self.state().results_journal.flush()
    }

    /// Takes the outcomes that workers on other machines have published into the journal, and removes their files.
    ///
    /// # Errors
    ///
    /// [`CampaignError`] for a directory that cannot be read or written; nothing is lost then.
    pub fn collect(&self) -> Result<Collected, CampaignError> {
        let folder = self.dir.join(OUTCOMES);
        let failed = |error| CampaignError::io("read", &folder, error);
        let mut collected = Collected::default();
        let mut results = Vec::new();
        let mut files = Vec::new();
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let Some(number) = number_of(&path) else { continue };
            if path.is_dir() {
                collected.damage.push(durable::set_aside(&path, "it is a directory")?);
                continue;
            }
            let Some(text) = durable::read(&path)? else { continue };
            match seal::unseal::<ResultRecord>(&text) {
                Ok(result) if result.number == number => {
                    results.push(result);
                    files.push(path);
                }
                Ok(result) => {
                    let what = format!("it is the outcome of run {}", result.number);
                    collected.damage.push(durable::set_aside(&path, what)?);
                }
                Err(what) => collected.damage.push(durable::set_aside(&path, what)?),
            }
        }
        results.sort_by_key(|result| result.number);
        collected.numbers = self.state().add(results)?;
        self.flush_outcomes()?;
        for file in files {
            // It is in the journal: left behind it is only ignored.
            let _ = fs::remove_file(file);
        }
        Ok(collected)
    }

    /// Stores what the caller wants kept of its iteration `k`, in place of what was there.
    ///
    /// # Errors
    ///
    /// A failed write; what was there before stays.
    pub fn record_iteration(&self, k: u32, record: &Value) -> Result<(), CampaignError> {
        let mut state = self.state();
        if state.iterations.get(&k) == Some(record) {
            return Ok(());
        }
        let path = self.dir.join(ITERATIONS).join(format!("{k:04}.json"));
        let iteration = Iteration { iteration: k, record: record.clone() };
        let text = seal::seal_pretty(&iteration)
            .map_err(|error| CampaignError::io("written", &path, error.into()))?;
        durable::write(&path, &text)?;
        state.iterations.insert(k, iteration.record);
        Ok(())
    }

    /// What was recorded of the iterations.
    #[must_use]
    pub fn iterations(&self) -> BTreeMap<u32, Value> {
        self.state().iterations.clone()
    }

    /// How many attempts at a run were begun, as far as their directories are still there.
    #[must_use]
    pub fn attempts(&self, number: u64) -> u32 {
        last_attempt(&task_folder(&self.dir, number))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change of the state is whole before anything can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Record {
    fn new(dir: &Path, spec: &CampaignSpec, extra: &BTreeMap<String, Vec<u8>>) -> Self {
        let mut digest = seal::Digest::new();
        digest.add(dir.as_os_str().as_encoded_bytes());
        digest.add(lock::host().as_bytes());
        digest.add(&std::process::id().to_le_bytes());
        let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        digest.add(&time.map_or(0, |time| time.as_nanos()).to_le_bytes());
        let files = extra.iter();
        let files = files.map(|(name, text)| (name.clone(), hex(seal::checksum(text)))).collect();
        Self { format: FORMAT, id: hex(digest.finish()), spec: spec.clone(), files }
    }

    fn write(&self, dir: &Path) -> Result<(), CampaignError> {
        let path = dir.join(RECORD);
        let text = seal::seal_pretty(self)
            .map_err(|error| CampaignError::io("written", &path, error.into()))?;
        durable::write(&path, &text)
    }

    /// As [`read`](Self::read), where it may be that there is no campaign at all.
    pub(crate) fn read_present(dir: &Path) -> Result<Self, CampaignError> {
        if !dir.join(RECORD).exists() && !dir.join(TASKS).exists() {
            return Err(CampaignError::NotACampaign { dir: dir.to_path_buf() });
        }
        Self::read(dir)
    }

    pub(crate) fn read(dir: &Path) -> Result<Self, CampaignError> {
        #[derive(Deserialize)]
        struct Any {
            format: u64,
        }
        let path = dir.join(RECORD);
        let damaged = |what: String| CampaignError::Damaged { file: path.clone(), what };
        if path.is_dir() {
            return Err(damaged("it is a directory".into()));
        }
        let text = durable::read(&path)?.ok_or_else(|| damaged("it is not there".into()))?;
        let Any { format } = seal::unseal(&text).map_err(damaged)?;
        if format != FORMAT {
            let (found, expected) = (format, FORMAT);
            return Err(CampaignError::Format { file: path, found, expected });
        }
        let record: Self = seal::unseal(&text).map_err(damaged)?;
        record.spec.check()?;
        Ok(record)
    }
}

impl State {
    fn open(
        dir: &Path,
        spec: &CampaignSpec,
        damage: &mut Vec<Damage>,
    ) -> Result<Mutex<Self>, CampaignError> {
        let (tasks_journal, tasks, broken) = Journal::open::<Task>(&dir.join(TASKS))?;
        damage.extend(broken);
        let (mut results_journal, results, broken) =
            Journal::open::<ResultRecord>(&dir.join(RESULTS))?;
        results_journal.reserve(RESERVE_BYTES);
        damage.extend(broken);
        let iterations = read_iterations(dir, damage)?;
        let tasks = index_tasks(spec, tasks);
        let results = index_results(results);
        let state = Self { tasks, results, iterations, tasks_journal, results_journal };
        Ok(Mutex::new(state))
    }

    /// Adds results that are not there yet, and says which; they are not flushed.
    fn add(&mut self, mut results: Vec<ResultRecord>) -> Result<Vec<u64>, CampaignError> {
        let mut keys = Vec::with_capacity(results.len());
        results.retain(|result| {
            let key = (result.number, result.task.clone());
            let new = !self.results.contains_key(&key) && !keys.contains(&key);
            if new {
                keys.push(key);
            }
            new
        });
        self.results_journal.write(&results)?;
        let numbers = results.iter().map(|result| result.number).collect();
        self.results.extend(keys.into_iter().zip(results.into_iter().map(|r| r.outcome)));
        Ok(numbers)
    }
}

/// Tasks by number, with their fingerprints; those that do not fit the specification are left out.
pub(crate) fn index_tasks(spec: &CampaignSpec, tasks: Vec<Task>) -> BTreeMap<u64, (Task, String)> {
    let mut index = BTreeMap::new();
    for task in tasks.into_iter().filter(|task| check_task(spec, task).is_ok()) {
        let fingerprint = hex(spec.fingerprint(&task));
        index.entry(task.number).or_insert((task, fingerprint));
    }
    index
}

fn index_results(results: Vec<ResultRecord>) -> HashMap<(u64, String), Outcome> {
    let mut index = HashMap::with_capacity(results.len());
    for result in results {
        index.entry((result.number, result.task)).or_insert(result.outcome);
    }
    index
}

fn read_iterations(
    dir: &Path,
    damage: &mut Vec<Damage>,
) -> Result<BTreeMap<u32, Value>, CampaignError> {
    let folder = dir.join(ITERATIONS);
    let failed = |error| CampaignError::io("read", &folder, error);
    let mut iterations = BTreeMap::new();
    for entry in fs::read_dir(&folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let Some(number) = number_of(&path) else { continue };
        if path.is_dir() {
            damage.push(durable::set_aside(&path, "it is a directory")?);
            continue;
        }
        let Some(text) = durable::read(&path)? else { continue };
        match seal::unseal::<Iteration>(&text) {
            Ok(read) if u64::from(read.iteration) == number => {
                iterations.insert(read.iteration, read.record);
            }
            Ok(read) => {
                let what = format!("it is iteration {}", read.iteration);
                damage.push(durable::set_aside(&path, what)?);
            }
            Err(what) => damage.push(durable::set_aside(&path, what)?),
        }
    }
    Ok(iterations)
}

/// The number in `000012.json`.
pub(crate) fn number_of(path: &Path) -> Option<u64> {
    let stem = path.file_name()?.to_str()?.strip_suffix(".json")?;
    if stem.bytes().all(|byte| byte.is_ascii_digit()) { stem.parse().ok() } else { None }
}

/// Where the attempts at a run are.
pub(crate) fn task_folder(dir: &Path, number: u64) -> PathBuf {
    dir.join(WORK).join(format!("{number:06}"))
}

/// Number of the last attempt in a folder of attempts; 0 where there is none.
pub(crate) fn last_attempt(folder: &Path) -> u32 {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    entries
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_prefix("attempt-")?.parse().ok())
        .max()
        .unwrap_or(0)
}

pub(crate) fn hex(sum: u64) -> String {
    format!("{sum:016x}")
}

fn same_bits(a: &Task, b: &Task) -> bool {
    let bits = |task: &Task| task.parameters.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    a.command == b.command && bits(a) == bits(b)
}

fn check_task(spec: &CampaignSpec, task: &Task) -> Result<(), String> {
    if task.command >= spec.commands.len() {
        return Err(format!("command {} of {}", task.command, spec.commands.len()));
    }
    let (given, wanted) = (task.parameters.len(), spec.parameter_names.len());
    if given != wanted {
        return Err(format!("{given} parameters, there are {wanted}"));
    }
    for (name, value) in spec.parameter_names.iter().zip(&task.parameters) {
        if !value.is_finite() {
            return Err(format!("{name} = {value} is not a number"));
        }
    }
    Ok(())
}

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
    let wanted = spec.commands.get(task.command).map_or(0, crate::CommandSpec::values);
    if wanted > 0 && wanted != values.len() {
        return Err(format!("{} values, there must be {wanted}", values.len()));
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), CampaignError> {
    let ours = [RECORD, TASKS, RESULTS, OUTCOMES, ITERATIONS, WORK, LOCK, crate::slurm::SLURM];
    let plain = !name.contains(['/', '\\', '\0']) && !name.starts_with('.') && !name.is_empty();
    if plain && !ours.contains(&name) {
        Ok(())
    } else {
        Err(CampaignError::FileName { name: name.to_owned() })
    }
}

/// Empties a directory that an earlier [`Campaign::create`] did not finish; refuses any other.
fn clear_unfinished(dir: &Path, extra: &BTreeMap<String, Vec<u8>>) -> Result<(), CampaignError> {
    for path in unfinished(dir, extra)? {
        // Without its record nothing was ever run here: the folders are empty.
        let removed = if path.is_dir() { fs::remove_dir(&path) } else { fs::remove_file(&path) };
        removed.map_err(|_| CampaignError::Exists { dir: dir.to_path_buf() })?;
    }
    Ok(())
}

/// What an earlier [`Campaign::create`] left in a directory, but for the lock; refuses a directory with anything else.
fn unfinished(
    dir: &Path,
    extra: &BTreeMap<String, Vec<u8>>,
) -> Result<Vec<PathBuf>, CampaignError> {
    let failed = |error| CampaignError::io("made", dir, error);
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let ours = [LOCK, TASKS, RESULTS, OUTCOMES, ITERATIONS, WORK].contains(&&*name)
            || extra.contains_key(&*name)
            || name.starts_with(TEMPORARY);
        if !ours {
            return Err(CampaignError::Exists { dir: dir.to_path_buf() });
        }
        if name != LOCK {
            found.push(entry.path());
        }
    }
    Ok(found)
}

/// Removes what processes that died left half-written. Best effort: it is hidden and harmless.
fn remove_stale(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let old = entry
            .metadata()
            .and_then(|metadata| metadata.modified())
            .is_ok_and(|modified| modified.elapsed().is_ok_and(|age| age > STALE));
        if old && entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Reads tasks and results without the lock and without mending anything.
pub(crate) type Snapshot = (BTreeMap<u64, (Task, String)>, Vec<ResultRecord>);

pub(crate) fn snapshot(dir: &Path, spec: &CampaignSpec) -> Result<Snapshot, CampaignError> {
    let tasks = journal::read::<Task>(&dir.join(TASKS))?.map_or_else(Vec::new, |l| l.records);
    let results =
        journal::read::<ResultRecord>(&dir.join(RESULTS))?.map_or_else(Vec::new, |l| l.records);
    Ok((index_tasks(spec, tasks), results))
}
