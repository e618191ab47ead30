//! `calibrate export`: a run for other programs, as tables or in their formats.

use std::path::PathBuf;

use clap::builder::TypedValueParser;
use workbench::error::Failure;
use workbench::export::{Exported, Format, Group, Written, export, export_posterior};

use crate::arguments::named;
use crate::terminal;

const EXPORT_NOTES: &str = "\
Examples:
  calibrate export results/ps --format zarr
  calibrate export results/ps --format idata-json,stan-csv,draws-csv
  calibrate export results/impact

With --format the posterior of a finished run is written: equally weighted draws, prior, pointwise log likelihood, \
replicated data and measurements. zarr: a Zarr v3 store for ArviZ 1.x (xarray.open_datatree). idata-json: for \
arviz.from_json of ArviZ 0.x. stan-csv: CmdStan's form, for cmdstanpy and rstan. draws-csv: for R's package posterior. \
What is there already is not overwritten.

Without it what a run of programs has so far is written, also while it runs: samples.csv (every sample: parameters, \
state, log likelihood, its weight where its stage is complete, simulated values), runs.csv (every run: state, cause, \
attempts, seconds) and samples-grainlearning.txt (the parameter sets as GrainLearning and yade-batch read them).";

/// Tables of a run, or its posterior in other formats.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXPORT_NOTES)]
pub(crate) struct ExportArgs {
    /// Folder of the run
    #[arg(value_name = "RUN")]
    dir: PathBuf,

    /// Formats of the posterior, separated by commas
    #[arg(short, long, value_name = "FORMAT", value_delimiter = ',', value_parser = format())]
    format: Vec<Format>,

    /// Folder for what is written [default: export in the folder of the run]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,
}

/// The name of a format.
fn format() -> impl TypedValueParser<Value = Format> {
    named(Format::ALL.map(|format| (format.name(), format)))
}

/// Runs the command.
pub(crate) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let out = args.out.as_deref();
    let text = if args.format.is_empty() {
        let Exported { out, samples, weighted, runs } = export(&args.dir, out)?;
        format!(
            "{}/: samples.csv ({samples} samples, {weighted} with weights), runs.csv ({runs} runs), \
             samples-grainlearning.txt\n",
            out.display()
        )
    } else {
        let asked = |format: &Format| args.format.contains(format);
        let formats: Vec<Format> = Format::ALL.into_iter().filter(asked).collect();
        let Written { files, groups } = export_posterior(&args.dir, &formats, out)?;
        groups.notes.iter().for_each(|note| terminal::warning(note));
        let draws = groups.group("posterior").and_then(Group::draws).unwrap_or(0);
        files.iter().map(|file| format!("{}: {draws} draws\n", file.display())).collect()
    };
    if args.quiet { Ok(()) } else { terminal::write(text.as_bytes()) }
}
