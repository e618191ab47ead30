//! Runs as processes of this machine, a limited number at the same time.

use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::task::Task;

/// Runs tasks as local processes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Local {
    /// How many runs are made at the same time; at least 1.
    pub parallel: usize,
}

impl Executor for Local {
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        _watch: &mut dyn FnMut(Event),
        _stop: &Stop,
    ) -> Result<(), ExecutorError> {
        campaign.record_submitted(tasks)?;
        Err(ExecutorError::Scheduler("local runs come with the worker".into()))
    }
}
