//! A directory of runs, open for the one driver that has its lock.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde_json::Value;

use crate::create;
use crate::error::{CampaignError, Damage, ExecutorError};
use crate::folder::{self, ITERATIONS, OUTCOMES, RECORD, RESULTS, TASKS, WORK};
use crate::lock::Lock;
use crate::mend::{Given, Mended, mend};
use crate::outcome::Outcome;
use crate::record::{Record, ResultRecord};
use crate::spec::CampaignSpec;
use crate::state::State;
use crate::task::Task;
use crate::{durable, files, seal};

/// The outcomes that [`Campaign::collect`] took over.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Collected {
    /// Runs whose outcomes are now in the journal.
    pub numbers: Vec<u64>,
    /// Damaged outcome files; they were set aside, and their runs have no outcome.
    pub damage: Vec<Damage>,
}

/// A directory in which runs are made, open and locked. It may be used from several threads.
///
/// ```text
/// campaign.json     what is run, and checksums of the caller's files
/// lock              the process that has the directory
/// tasks.jsonl       every task, before it is started
/// results.jsonl     every outcome
/// outcomes/         outcomes of workers on other machines, until they are collected
/// iterations/       the caller's records
/// work/             working directories of the runs: work/000012/attempt-1
/// workers/          working directories of the workers, while they are there
/// slurm/            submissions to Slurm
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
    copied: bool,
    lock: Lock,
}

impl Campaign {
    /// Makes a campaign in a directory that is empty or not there yet. `extra` holds files of the caller (a plan,
    /// versions) by name, which are stored with their checksums.
    ///
    /// # Errors
    ///
    /// [`CampaignError`]. A directory that was only begun to be filled may be used again.
    pub fn create(
        dir: &Path,
        spec: &CampaignSpec,
        extra: &BTreeMap<String, Vec<u8>>,
    ) -> Result<Self, CampaignError> {
        spec.check()?;
        create::check_names(extra)?;
        let failed = |error| CampaignError::io("made", dir, error);
        if !dir.is_dir() {
            files::make_folder(dir)?;
        }
        let dir = fs::canonicalize(dir).map_err(failed)?;
        // Before anything is put into somebody else's directory.
        create::unfinished(&dir, extra)?;
        let lock = Lock::take(&dir)?;
        create::clear_unfinished(&dir, extra)?;
        for name in [OUTCOMES, ITERATIONS, WORK] {
            files::make_folder(&dir.join(name))?;
        }
        durable::spread(&dir.join(WORK));
        for (name, contents) in extra {
            files::write(&dir.join(name), contents)?;
        }
        for name in [TASKS, RESULTS] {
            files::write(&dir.join(name), b"")?;
        }
        let record = Record::new(&dir, spec, extra);
        record.write(&dir)?;
        if let Some(parent) = dir.parent() {
            durable::flush_folder(parent).map_err(failed)?;
        }
        let mended = Mended { record, extra: extra.clone(), damage: Vec::new(), copied: false };
        Ok(Self::with(dir, lock, mended, true)?.0)
    }

    /// Opens a campaign, mends it, and returns what was damaged. Every outcome that is not damaged is there.
    ///
    /// # Errors
    ///
    /// [`CampaignError`], among them [`Locked`](CampaignError::Locked) where another driver has the directory, and
    /// [`Damaged`](CampaignError::Damaged) where the record of what is run is damaged.
    pub fn open(dir: &Path) -> Result<(Self, Vec<Damage>), CampaignError> {
        Self::open_or_restore(dir, None)
    }

    /// Same as [`open`](Self::open), and replaces the specification and the caller's files by the given ones where they are
    /// damaged. What is not damaged stays as it is stored: compare [`spec`](Self::spec) and [`extra`](Self::extra) with
    /// what you expect. Outcomes of runs made under another specification are not used.
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
        create::check_names(extra)?;
        Self::open_or_restore(dir, Some((spec, extra)))
    }

    fn open_or_restore(dir: &Path, given: Given<'_>) -> Result<(Self, Vec<Damage>), CampaignError> {
        let there = dir.join(RECORD).symlink_metadata().is_ok();
        if !there && !dir.join(TASKS).exists() {
            return Err(CampaignError::NotACampaign { dir: dir.to_path_buf() });
        }
        let dir = fs::canonicalize(dir).map_err(|error| CampaignError::io("read", dir, error))?;
        let lock = Lock::take(&dir)?;
        let mended = mend(&dir, given)?;
        let (campaign, mut damage) = Self::with(dir, lock, mended, false)?;
        damage.extend(campaign.collect()?.damage);
        Ok((campaign, damage))
    }

    /// A campaign in a directory that is in order, and what was damaged.
    fn with(
        dir: PathBuf,
        lock: Lock,
        mended: Mended,
        created: bool,
    ) -> Result<(Self, Vec<Damage>), CampaignError> {
        let Mended { record, extra, mut damage, copied } = mended;
        let state = Mutex::new(State::open(&dir, &record.spec, &mut damage)?);
        let looked = AtomicBool::new(false);
        Ok((Self { dir, record, extra, created, looked, state, copied, lock }, damage))
    }

    /// The directory, absolute.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Specification of the runs.
    #[must_use]
    pub fn spec(&self) -> &CampaignSpec {
        &self.record.spec
    }

    /// One of the caller's files; none where it is damaged or not there.
    #[must_use]
    pub fn extra(&self, name: &str) -> Option<&[u8]> {
        self.extra.get(name).map(Vec::as_slice)
    }

    /// A text that tells this campaign from every other.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.record.id
    }

    /// Whether [`create`](Self::create) has just made it, so that no earlier driver can have left anything.
    #[must_use]
    pub fn is_new(&self) -> bool {
        self.created
    }

    /// Whether it was found to be a copy of another directory, when it was opened. From then on it is a campaign of its
    /// own: processes and jobs of the other are not touched.
    #[must_use]
    pub fn is_copy(&self) -> bool {
        self.copied
    }

    /// Checks that the lock is still this driver's: its file may have been removed, and another driver let in. Everything
    /// that writes checks it first.
    ///
    /// # Errors
    ///
    /// [`CampaignError::LockLost`].
    pub fn check_lock(&self) -> Result<(), CampaignError> {
        self.lock.check()
    }

    /// Takes the limits of calls over from `spec`: what decides on whether runs get made, and not on their values
    /// ([`Call::set_limits`](crate::Call::set_limits)). They hold from the next run on.
    ///
    /// # Errors
    ///
    /// A limit that cannot be; a failed write.
    pub fn set_limits(&mut self, spec: &CampaignSpec) -> Result<(), CampaignError> {
        let mut record = self.record.clone();
        for (own, given) in record.spec.commands.iter_mut().zip(&spec.commands) {
            own.call.set_limits(&given.call);
        }
        if record.spec != self.record.spec {
            record.spec.check()?;
            self.check_lock()?;
            record.write(&self.dir)?;
            self.record = record;
        }
        Ok(())
    }

    /// Replaces one of the caller's files that were there at its creation.
    ///
    /// # Errors
    ///
    /// A failed write: the file is then the old one or the new one, also where the driver is killed on the way.
    pub fn replace_extra(&mut self, name: &str, contents: &[u8]) -> Result<(), CampaignError> {
        create::check_names(&BTreeMap::from([(name.to_owned(), ())]))?;
        self.check_lock()?;
        let sum = seal::hex(seal::checksum(contents));
        self.announce(name, &sum)?;
        files::write(&self.dir.join(name), contents)?;
        self.record.files.insert(name.to_owned(), sum);
        self.record.replacing.clear();
        self.record.write(&self.dir)?;
        self.extra.insert(name.to_owned(), contents.to_vec());
        Ok(())
    }

    /// Says that a file is about to have another checksum.
    fn announce(&mut self, name: &str, sum: &str) -> Result<(), CampaignError> {
        self.record.replacing.insert(name.to_owned(), sum.to_owned());
        self.record.write(&self.dir)
    }

    /// Gives up the outcomes of the failed runs that `given_up` chooses, and returns their numbers. The
    /// tasks must then be submitted anew, from the first: they may be placed otherwise where later ones depended on those
    /// outcomes. What finished is used as far as its parameters are asked for again. The journals as they were stay as
    /// `tasks.jsonl.retried-1`, `results.jsonl.retried-1`.
    ///
    /// # Errors
    ///
    /// A failed write. Nothing is lost then.
    pub fn forget_failed(
        &self,
        given_up: &dyn Fn(&Outcome) -> bool,
    ) -> Result<Vec<u64>, CampaignError> {
        self.check_lock()?;
        self.state().forget_failed(&self.dir, given_up)
    }

    /// Gives up where tasks were placed: they must be submitted anew, from the first. Results are used as far as their
    /// parameters are asked for again. The journal as it was stays as `tasks.jsonl.retried-1`.
    ///
    /// # Errors
    ///
    /// A failed write. Nothing is lost then.
    pub fn place_again(&self) -> Result<(), CampaignError> {
        self.check_lock()?;
        self.state().place_again(&self.dir)
    }

    /// Gives up the outcomes of some tasks, and returns how many had one: they are made again. What there was stays on the
    /// disk as `results.jsonl.retried-1`.
    ///
    /// # Errors
    ///
    /// A failed write. Nothing is lost then.
    pub fn forget(&self, numbers: &[u64]) -> Result<usize, CampaignError> {
        self.check_lock()?;
        self.state().forget(numbers)
    }

    /// Number of tasks that were submitted with other parameters than before [`forget_failed`](Self::forget_failed).
    #[must_use]
    pub fn placed_again(&self) -> u64 {
        self.state().placed_again()
    }

    /// Whether the last runs that ended look like an outage.
    pub(crate) fn outage(&self) -> Option<ExecutorError> {
        self.state().outage()
    }

    /// Whether this is the first call.
    pub(crate) fn first_look(&self) -> bool {
        !self.looked.swap(true, Ordering::Relaxed)
    }

    /// Stores tasks, flushed to disk; known ones are not stored again. Executors call this before they start anything.
    ///
    /// # Errors
    ///
    /// [`CampaignError::TaskDiffers`] where a number is known with other parameters;
    /// [`CampaignError::InvalidTask`]; a failed write. Nothing is stored then.
    pub fn record_submitted(&self, tasks: &[Task]) -> Result<(), CampaignError> {
        self.check_lock()?;
        self.state().add_tasks(&self.record.spec, tasks)
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

    /// Outcome of a submitted task, with the bits as stored; none where it has not ended.
    #[must_use]
    pub fn outcome(&self, number: u64) -> Option<Outcome> {
        self.state().outcome(number).cloned()
    }

    /// The `tasks` without an outcome, each once.
    #[must_use]
    pub fn missing(&self, tasks: &[Task]) -> Vec<Task> {
        self.state().missing(tasks)
    }

    /// Stores outcomes of submitted tasks, with one flush to disk for all of them. The first outcome of a run counts;
    /// further ones are ignored.
    ///
    /// # Errors
    ///
    /// [`CampaignError::InvalidOutcome`] for a task that was never submitted, or values that are not
    /// finite or not as many as the command gives; a failed write. Nothing is stored then.
    pub fn record(&self, outcomes: Vec<(u64, Outcome)>) -> Result<(), CampaignError> {
        self.write_outcomes(outcomes)?;
        self.flush_outcomes()
    }

    /// Same as [`record`](Self::record), without flushing.
    pub(crate) fn write_outcomes(
        &self,
        outcomes: Vec<(u64, Outcome)>,
    ) -> Result<(), CampaignError> {
        self.check_lock()?;
        self.state().add_outcomes(&self.record.spec, outcomes)
    }

    pub(crate) fn flush_outcomes(&self) -> Result<(), CampaignError> {
        self.state().flush_outcomes()
    }

    /// Moves the outcomes that workers on other machines have published into the journal.
    ///
    /// # Errors
    ///
    /// [`CampaignError`] for a directory that cannot be read or written; nothing is lost then.
    pub fn collect(&self) -> Result<Collected, CampaignError> {
        self.check_lock()?;
        let folder = self.dir.join(OUTCOMES);
        let number = |result: &ResultRecord| result.number;
        let mut damage = Vec::new();
        let mut found = files::read_numbered(&folder, "the outcome of run", number, &mut damage)?;
        found.sort_by_key(|(_, result)| result.number);
        let (paths, results): (Vec<PathBuf>, Vec<ResultRecord>) = found.into_iter().unzip();
        let numbers = self.state().add_results(results)?;
        self.flush_outcomes()?;
        for path in paths {
            // It is in the journal: a file that stays is ignored.
            let _ = fs::remove_file(path);
        }
        Ok(Collected { numbers, damage })
    }

    /// Stores the caller's record of its iteration `k`, in place of an earlier one.
    ///
    /// # Errors
    ///
    /// A failed write; what was there before stays.
    pub fn record_iteration(&self, k: u32, record: &Value) -> Result<(), CampaignError> {
        self.check_lock()?;
        self.state().add_iteration(&self.dir, k, record)
    }

    /// The caller's records, by iteration.
    #[must_use]
    pub fn iterations(&self) -> BTreeMap<u32, Value> {
        self.state().iterations.clone()
    }

    /// Number of attempts at a run, as far as their directories are still there.
    #[must_use]
    pub fn attempts(&self, number: u64) -> u32 {
        folder::last_attempt(&folder::task_folder(&self.dir, number))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change of the state is whole before anything can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_being_replaced_is_the_old_or_the_new_one_wherever_the_driver_is_killed() {
        let spec = CampaignSpec::of_squares();
        let folder = tempfile::tempdir().expect("a temporary folder");
        let dir = folder.path().join("run");
        let files = BTreeMap::from([("plan".to_owned(), b"old".to_vec())]);
        let mut campaign = Campaign::create(&dir, &spec, &files).expect("made");
        let sum = |text: &[u8]| seal::hex(seal::checksum(text));
        let reopened = |campaign: Campaign| {
            drop(campaign);
            let (campaign, damage) = Campaign::open(&dir).expect("opened");
            assert_eq!(damage, []);
            campaign
        };
        // Killed before a file is written, one that was there and one that was not.
        campaign.announce("plan", &sum(b"new")).expect("said");
        campaign = reopened(campaign);
        assert_eq!(campaign.extra("plan"), Some(&b"old"[..]));
        campaign.announce("more", &sum(b"new")).expect("said");
        campaign = reopened(campaign);
        assert_eq!(campaign.extra("more"), None);
        // Killed when it is written, and its checksum is not yet the only one.
        for name in ["plan", "more"] {
            campaign.announce(name, &sum(b"new")).expect("said");
            files::write(&campaign.dir.join(name), b"new").expect("written");
            campaign = reopened(campaign);
            assert_eq!(campaign.extra(name), Some(&b"new"[..]), "{name}");
            campaign = reopened(campaign);
            assert_eq!(campaign.extra(name), Some(&b"new"[..]), "{name}, once more");
        }
        campaign.replace_extra("plan", b"newest").expect("replaced");
        assert_eq!(reopened(campaign).extra("plan"), Some(&b"newest"[..]));
        // Anything else is damage.
        files::write(&dir.join("plan"), b"other").expect("written");
        let (campaign, damage) = Campaign::open(&dir).expect("opened");
        assert_eq!((campaign.extra("plan"), damage.len()), (None, 1));
    }
}
