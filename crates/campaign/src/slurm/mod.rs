//! Runs as job arrays of Slurm, through `sbatch`, `squeue`, `scancel` and, where the cluster keeps accounts, `sacct`.
//!
//! The outcome that a worker publishes in the directory counts; what Slurm reports of a job is a hint. A report that fails,
//! hangs or cannot be understood means "unknown", never "no jobs". A run whose job is gone and whose outcome is not there
//! after [`grace_s`](SlurmSettings::grace_s) is lost: it is submitted again, up to its command's `retries`.
//!
//! A submission is written to disk before sbatch is called, under a name that follows from the directory, so that a driver
//! that was killed and started again finds its jobs in the queue and waits for them. Where it cannot know (Slurm itself
//! forgot a job, or sbatch was cut off), a run may be made twice; attempts have their own directories, and the first outcome
//! counts.

mod call;
mod client;
mod cluster;
mod job;
mod losses;
mod parse;
mod queue;
mod session;
mod settings;
mod submission;
mod submit;
#[cfg(all(test, unix))]
mod tests;

use std::time::Duration;

pub use settings::{SlurmSettingError, SlurmSettings};

use crate::attempt::no_workers;
use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::feed::Feed;
use crate::task::Task;
use client::Client;
use cluster::Cluster;
use session::Session;

/// Runs tasks as elements of Slurm job arrays.
#[derive(Debug, Clone)]
pub struct Slurm {
    cluster: Cluster,
}

impl Slurm {
    /// `worker` is what an array element calls, a program and its first arguments; it gets the campaign's directory,
    /// `--tasks` and the numbers of the runs as in [`numbers::format`](crate::numbers::format). It shall make these runs
    /// one after the other with a [`Worker`](crate::Worker), and exit with 0 if each has its outcome.
    ///
    /// # Errors
    ///
    /// [`SlurmSettingError`] with the first mistake in the settings.
    pub fn new(settings: SlurmSettings, worker: Vec<String>) -> Result<Self, SlurmSettingError> {
        settings.check()?;
        if worker.is_empty() {
            return Err(SlurmSettingError {
                field: "worker",
                found: "nothing".into(),
                expected: "the program that array elements call".into(),
            });
        }
        let patience = Duration::from_secs_f64(settings.command_timeout_s);
        let client = Client { programs: None, patience };
        Ok(Self { cluster: Cluster { settings, worker, client } })
    }
}

impl Executor for Slurm {
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        self.run_fed(campaign, &Feed::of(campaign, tasks)?, watch, stop)
    }

    fn run_fed(
        &mut self,
        campaign: &Campaign,
        feed: &Feed<'_>,
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        if let Some(worker) = campaign.spec().commands.iter().find(|command| command.call.worker) {
            return Err(no_workers(worker));
        }
        Session::begin(&self.cluster, feed, watch, stop)?.run()
    }
}
