//! `calibrate export`: everything that a run has so far as tables.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::export::{Exported, export};

use crate::terminal;

const EXPORT_NOTES: &str = "\
Writes samples.csv (every sample so far: parameters, state, log likelihood, its weight where its stage is \
complete, simulated values), runs.csv (every run: state, cause, attempts, seconds) and \
samples-grainlearning.txt (the parameter sets as GrainLearning and yade-batch read them).";

/// Tables of a run.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXPORT_NOTES)]
pub(crate) struct ExportArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    dir: PathBuf,

    /// Folder for the tables [default: export in the folder of the run]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let Exported { out, samples, weighted, runs } = export(&args.dir, args.out.as_deref())?;
    if args.quiet {
        return Ok(());
    }
    let text = format!(
        "{}/: samples.csv ({samples} samples, {weighted} with weights), runs.csv ({runs} runs), \
         samples-grainlearning.txt\n",
        out.display()
    );
    terminal::write(text.as_bytes())
}
