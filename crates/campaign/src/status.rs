//! Progress of a campaign, for any process that may read its directory.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::attempt::Process;
use crate::error::CampaignError;
use crate::folder::{OUTCOMES, PROCESS, last_attempt, number_of, task_folder};
use crate::holder::Holder;
use crate::lock::Lock;
use crate::record::{Record, ResultRecord};
use crate::state::snapshot;
use crate::{files, machine, seal};

/// Progress of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// The process that drives it; none where no process does, `Some(None)` where its name cannot be read.
    pub driver: Option<Option<Holder>>,
    /// Number of submitted tasks: finished, failed, running or queued.
    pub submitted: u64,
    /// Number of runs that gave values.
    pub finished: u64,
    /// Number of failed runs by cause.
    pub failed: BTreeMap<String, u64>,
    /// Number of runs that are being made; one on another machine counts until it has an outcome.
    pub running: u64,
    /// Number of tasks that are neither running nor ended.
    pub queued: u64,
    /// Mean duration of the runs that ended \[s\].
    pub seconds_per_run: Option<f64>,
    /// Number of runs at the same time: now, or the most so far where none is running.
    pub parallel: u64,
    /// Estimated time until every submitted task has ended \[s\], if nothing stops; none before the
    /// first has ended.
    ///
    /// # Formula
    ///
    /// (sum over the running of max(mean duration − elapsed, 0) + queued × mean duration) / `parallel`
    pub time_left_s: Option<f64>,
}

impl Status {
    /// Number of failed runs.
    #[must_use]
    pub fn failures(&self) -> u64 {
        self.failed.values().sum()
    }
}

/// Reads the progress of the campaign in `dir`, without its lock and without changing anything.
///
/// # Errors
///
/// [`CampaignError`] where there is no campaign, or its record is damaged.
pub fn status(dir: &Path) -> Result<Status, CampaignError> {
    let record = Record::read_present(dir)?;
    // First those that wait to be collected: they may be in the journal a moment later.
    let published = published(dir);
    let (tasks, results) = snapshot(dir, &record.spec)?;
    let mut ended: BTreeMap<u64, ResultRecord> = BTreeMap::new();
    for result in results.into_iter().chain(published) {
        let known = tasks.get(&result.number).is_some_and(|(_, task)| *task == result.task);
        if known {
            ended.entry(result.number).or_insert(result);
        }
    }
    let driver = Lock::holder(dir);
    let now = machine::now_s();
    let mut finished = 0;
    let mut failed = BTreeMap::new();
    for result in ended.values() {
        match result.outcome.failure() {
            None => finished += 1,
            Some(kind) => *failed.entry(kind.to_string()).or_insert(0) += 1,
        }
    }
    let open = tasks.keys().filter(|number| !ended.contains_key(number));
    let elapsed: Vec<f64> = open
        .filter_map(|&number| running_since(dir, number))
        .map(|since| now.saturating_sub(since) as f64)
        .collect();
    let (submitted, running) = (tasks.len() as u64, elapsed.len() as u64);
    let queued = submitted - ended.len() as u64 - running;
    let seconds: Vec<f64> = ended.values().map(|result| result.outcome.seconds()).collect();
    let seconds_per_run =
        (!seconds.is_empty()).then(|| seconds.iter().sum::<f64>() / seconds.len() as f64);
    let parallel = if running > 0 { running } else { most_at_once(ended.values()) };
    let time_left_s = seconds_per_run.map(|mean| {
        let begun: f64 = elapsed.iter().map(|elapsed| (mean - elapsed).max(0.0)).sum();
        (begun + queued as f64 * mean) / parallel.max(1) as f64
    });
    Ok(Status {
        driver,
        submitted,
        finished,
        failed,
        running,
        queued,
        seconds_per_run,
        parallel,
        time_left_s,
    })
}

/// Outcomes of workers that are not collected yet; what cannot be read is not there yet.
pub(crate) fn published(dir: &Path) -> Vec<ResultRecord> {
    let Ok(entries) = fs::read_dir(dir.join(OUTCOMES)) else { return Vec::new() };
    entries
        .flatten()
        .filter(|entry| number_of(&entry.path()).is_some())
        .filter_map(|entry| seal::unseal(&files::read(&entry.path()).ok()??).ok())
        .collect()
}

/// Start of the last attempt at a run \[s since 1970\]; none where it is not being made.
fn running_since(dir: &Path, number: u64) -> Option<u64> {
    let folder = task_folder(dir, number);
    let attempt = last_attempt(&folder);
    let path = folder.join(format!("attempt-{attempt}")).join(PROCESS);
    let process: Process = serde_json::from_slice(&files::read(&path).ok()??).ok()?;
    process.is_running().unwrap_or(true).then_some(process.started)
}

/// The largest number of runs that were being made at the same time, to the second.
fn most_at_once<'a>(ended: impl Iterator<Item = &'a ResultRecord>) -> u64 {
    let mut changes: Vec<(f64, i64)> = Vec::new();
    for result in ended {
        let end = result.ended as f64;
        // Whole seconds: half a second less, so that one after the other is not at once.
        let duration = (result.outcome.seconds() - 0.5).max(0.0);
        changes.extend([(end - duration, 1), (end, -1)]);
    }
    changes.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut now, mut most) = (0_i64, 0_i64);
    for (_, change) in changes {
        now += change;
        most = most.max(now);
    }
    most.unsigned_abs()
}
