//! `calibrate runs`: what results are there.

use std::path::PathBuf;
use std::time::SystemTime;

use workbench::error::Failure;
use workbench::output::pretty;
use workbench::runs;

use crate::terminal;

const EXAMPLES: &str = "\
Examples:
  calibrate runs
  calibrate runs results/of-march

Lists each result with its kind, material or plan, data, trust, day, age and size. A run that was moved aside for a newer one \
(NAME.1, NAME.2) is superseded; the command that removes those is printed, not run. Folders that are no runs, or are damaged, are named below.";

/// The results in a folder.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct RunsArgs {
    /// Folder with the folders of runs, or the folder of a run
    #[arg(value_name = "DIR", default_value = "results")]
    dir: PathBuf,

    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &RunsArgs) -> Result<(), Failure> {
    let listing = runs::list(&args.dir, SystemTime::now())?;
    let text = if args.json { pretty(&listing)? } else { listing.text() };
    terminal::write(text.as_bytes())
}
