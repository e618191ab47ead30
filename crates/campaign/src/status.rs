//! How far a campaign is, for anybody who may read its directory.

use std::collections::BTreeMap;
use std::path::Path;

use crate::campaign::{self, Record};
use crate::error::CampaignError;
use crate::lock::{Holder, Lock};

/// How far a campaign is.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Who drives it now, if anybody does; without a name where it cannot be read.
    pub driver: Option<Option<Holder>>,
    /// Tasks that were submitted.
    pub submitted: u64,
    /// Runs that gave results.
    pub finished: u64,
    /// Failed runs by the words of their cause.
    pub failed: BTreeMap<String, u64>,
    /// Attempts that are being made, as far as can be seen from here.
    pub running: u64,
    /// Tasks that are neither running nor ended.
    pub queued: u64,
    /// Mean duration of the runs that ended \[s\].
    pub seconds_per_run: Option<f64>,
    /// How many runs are made at the same time: now, or at most so far.
    pub parallel: u64,
    /// Estimated time until every submitted task has ended \[s\]; none before the first has.
    pub time_left_s: Option<f64>,
}

/// Reads how far the campaign in `dir` is, without its lock and without changing anything.
///
/// # Errors
///
/// [`CampaignError`] where there is no campaign, or its record is damaged.
pub fn status(dir: &Path) -> Result<Status, CampaignError> {
    let record = Record::read(dir)?;
    let (tasks, results) = campaign::snapshot(dir, &record.spec)?;
    let mut failed = BTreeMap::new();
    let mut finished = 0;
    for result in &results {
        match result.outcome.failure() {
            None => finished += 1,
            Some(kind) => *failed.entry(kind.to_string()).or_insert(0) += 1,
        }
    }
    let submitted = tasks.len() as u64;
    Ok(Status {
        driver: Lock::holder(dir),
        submitted,
        finished,
        queued: submitted.saturating_sub(results.len() as u64),
        failed,
        running: 0,
        seconds_per_run: None,
        parallel: 0,
        time_left_s: None,
    })
}
