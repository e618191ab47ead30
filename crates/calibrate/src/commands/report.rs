//! `calibrate report`: the report of a saved calibration, made again from its files.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::input::text_file::folder_of;
use workbench::output::{self, page};
use workbench::{record, report};

use crate::terminal;

const EXAMPLES: &str = "\
Examples:
  calibrate report results/ps
  calibrate report results/ps --out to-send.html

Every run writes report.html: one file for readers who were not there, with the answer, the figures, the \
checks and how to repeat it. This makes that of a calibration again, also of one that was saved by a version that wrote none. \
Nothing is simulated.";

/// The report of a saved calibration.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct ReportArgs {
    /// A posterior.json, or the folder it is in; samples.csv and draws.csv must be beside it
    #[arg(value_name = "RUN")]
    run: PathBuf,

    /// The file to write [default: report.html in the folder of the run]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &ReportArgs) -> Result<(), Failure> {
    let file = record::locate(&args.run);
    let out = args.out.clone().unwrap_or_else(|| folder_of(&file).join(page::FILE_NAME));
    output::check_file(&out)?;
    let html = terminal::working(args.quiet, "report", || report::again(&args.run))?;
    output::write_file(&out, html.as_bytes())?;
    if args.quiet { Ok(()) } else { terminal::write(format!("{}\n", out.display()).as_bytes()) }
}
