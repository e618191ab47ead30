//! `calibrate status`: how far a run is.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::output::pretty;
use workbench::status;

use crate::terminal;

/// The run of a plan.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub(crate) struct StatusArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    dir: PathBuf,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &StatusArgs) -> Result<(), Failure> {
    let status = status::read(&args.dir)?;
    let text = if args.json { pretty(&status)? } else { status::text(&args.dir, &status) };
    terminal::write(text.as_bytes())
}
