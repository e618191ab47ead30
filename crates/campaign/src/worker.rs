//! Workers: runs made without the directory's lock, as on other machines.

use std::fs;
use std::path::{Path, PathBuf};

use crate::attempt::Runner;
use crate::error::{CampaignError, ExecutorError};
use crate::executor::Stop;
use crate::folder::OUTCOMES;
use crate::outcome::Outcome;
use crate::record::{Record, ResultRecord};
use crate::state::{check_outcome, snapshot};
use crate::task::Task;
use crate::{durable, files, seal};

/// Runs submitted tasks of a campaign without its lock, as an element of a job array does, and
/// publishes their outcomes for the driver to collect.
#[derive(Debug)]
pub struct Worker {
    dir: PathBuf,
    record: Record,
}

impl Worker {
    /// Reads the campaign in `dir`.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::Campaign`] where there is no campaign, or it cannot be read.
    pub fn open(dir: &Path) -> Result<Self, ExecutorError> {
        let record = Record::read_present(dir)?;
        let dir = fs::canonicalize(dir).map_err(|error| CampaignError::io("read", dir, error))?;
        Ok(Self { dir, record })
    }

    /// Makes the run `number` and publishes its outcome. A run that has an outcome is not made again.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::Interrupted`] where `stop` was asked for, [`ExecutorError::CannotStart`] where the
    /// program is not there, [`ExecutorError::Campaign`] where the task was not submitted or its
    /// outcome cannot be written: no outcome is published then.
    pub fn run(&self, number: u64, stop: &Stop) -> Result<Outcome, ExecutorError> {
        // Read anew each time: the driver appends while workers run.
        let (mut tasks, results) = snapshot(&self.dir, &self.record.spec)?;
        let (task, fingerprint) = tasks.remove(&number).ok_or_else(|| {
            let problem = "it was never submitted, or its line is damaged".to_owned();
            CampaignError::InvalidTask { number, problem }
        })?;
        let mut stored = results.into_iter();
        if let Some(done) = stored.find(|r| r.number == number && r.task == fingerprint) {
            return Ok(done.outcome);
        }
        let path = self.dir.join(OUTCOMES).join(format!("{number:06}.json"));
        if let Some(outcome) = published(&path, &fingerprint)? {
            return Ok(outcome);
        }
        let (dir, spec) = (&self.dir, &self.record.spec);
        let runner = Runner { dir, spec, mark: None, workers: None, alone: false };
        let ran = runner.run(&task, stop, |_| ())?;
        self.publish(&path, &task, &ran.outcome)?;
        runner.tidy(&task, &ran);
        Ok(ran.outcome)
    }

    fn publish(&self, path: &Path, task: &Task, outcome: &Outcome) -> Result<(), ExecutorError> {
        check_outcome(&self.record.spec, task, outcome)
            .map_err(|problem| CampaignError::InvalidOutcome { number: task.number, problem })?;
        let result = ResultRecord::new(&self.record.spec, task, outcome.clone());
        let failed = |error| CampaignError::io("written", path, error);
        let text = seal::seal(&result).map_err(|error| failed(error.into()))?;
        durable::publish(path, &text).map_err(failed)?;
        Ok(())
    }
}

/// The published outcome of the task with this fingerprint, if there is one.
fn published(path: &Path, fingerprint: &str) -> Result<Option<Outcome>, CampaignError> {
    let Some(text) = files::read(path)? else { return Ok(None) };
    let result = seal::unseal::<ResultRecord>(&text).ok();
    Ok(result.filter(|result| result.task == fingerprint).map(|result| result.outcome))
}

/// [`Worker::open`] and [`Worker::run`] for one run.
///
/// # Errors
///
/// Same as these two.
pub fn run_task(dir: &Path, number: u64, stop: &Stop) -> Result<Outcome, ExecutorError> {
    Worker::open(dir)?.run(number, stop)
}
