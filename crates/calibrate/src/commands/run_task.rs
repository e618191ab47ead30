//! `calibrate run-task`: makes given runs of a campaign. It is what a job on a cluster calls.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::run_task::run_tasks;
use workbench::watch::Watch as _;

use crate::terminal::{OnInterrupt, Terminal};

/// Runs to make.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub(crate) struct RunTaskArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    dir: PathBuf,

    /// Numbers of the runs, as in 1-20,33
    #[arg(long, value_name = "LIST")]
    tasks: String,
}

/// Runs the command.
pub(crate) fn run(args: &RunTaskArgs) -> Result<(), Failure> {
    let terminal = Terminal::new(true, OnInterrupt::Cancel);
    run_tasks(&args.dir, &args.tasks, terminal.stop())
}
