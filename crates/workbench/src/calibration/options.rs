//! How a run is made, and what it leaves.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::InputError;
use crate::output::{Published, RunFolder};
use crate::plan::{Plan, Planned};
use crate::record::{FILE_NAME, Record};

/// How a run is made; no part of its result.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Folder of the results; `results/NAME` where there is none.
    pub out: Option<PathBuf>,
    /// Number of threads; the plan's, or all cores, where there is none.
    pub threads: Option<usize>,
    /// The program and arguments that make given runs of a campaign, for jobs on a cluster: `calibrate run-task`.
    pub worker: Vec<String>,
    /// Folder of the run in this process that this one extends: its samples are compared with the first ones of this.
    pub extends: Option<PathBuf>,
    /// On resuming: the number of samples that the run is extended to.
    pub samples: Option<usize>,
    /// On resuming: makes runs once more that failed by a cause, or with words on stderr, that contain this text; empty for
    /// all failed runs.
    pub retry_failed: Option<String>,
    /// With `retry_failed`: keeps the runs that were placed while those had counted as failed, and uses all of them.
    pub keep_placed: bool,
    /// On resuming: goes on although the runs belong to another user, whose commands are run.
    pub accept_owner: bool,
    /// On resuming: goes on although a program, or a file that its command names, is not the one that the run began with.
    pub accept_changes: bool,
    /// Whether to leave out what other kinetics are worth.
    pub without_other_kinetics: bool,
}

/// Durations. Apart from the record, whose bytes do not depend on them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timings {
    /// Number of threads.
    pub threads: usize,
    /// From the first simulation to the posterior \[s\].
    pub inference_seconds: f64,
    /// Each stage \[s\].
    pub stage_seconds: Vec<f64>,
    /// What other kinetics are worth \[s\]; 0 where that is not looked at.
    pub other_kinetics_seconds: f64,
    /// Tables and figures \[s\].
    pub report_seconds: f64,
}

/// A run that is done and written.
#[derive(Debug, Clone, PartialEq)]
pub struct Finished {
    /// Results.
    pub record: Record,
    /// Folder of the results.
    pub out: PathBuf,
    /// Fate of an earlier run in the folder.
    pub published: Published,
    /// How long it took.
    pub timings: Timings,
}

/// Folder of a plan's run.
pub(super) fn folder_of(plan: &Plan, options: &RunOptions) -> PathBuf {
    options.out.clone().unwrap_or_else(|| Path::new("results").join(&plan.name))
}

impl RunOptions {
    /// Checks that a plan's run can be written, and gives its folder.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a folder that is not there for the taking.
    pub fn folder(&self, planned: &Planned) -> Result<PathBuf, InputError> {
        let out = folder_of(&planned.plan, self);
        if planned.plan.commands().next().is_none() {
            RunFolder::prepare(&out, FILE_NAME)?;
        }
        Ok(out)
    }
}
