//! `calibrate diff`: two runs side by side.

use std::path::PathBuf;

use workbench::diff::{self, RECORD};
use workbench::error::Failure;
use workbench::output::{RunFolder, pretty};

use crate::terminal::{OnInterrupt, Terminal};

const EXAMPLES: &str = "\
Examples:
  calibrate diff results/ps results/ps.1
  calibrate diff results/coarse results/fine --out results/mesh

Says what differs in the plans of two calibrations, what that did to each parameter (in standard deviations of the first, with the \
Monte Carlo error) and to the evidence, which is compared for the same data alone. Writes diff.json, report.html and the figure \
diff (.png, .svg) with the marginals of both.

Exit code 0 whether or not they differ, 2 for a run that cannot be read.";

/// Two calibrations.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct DiffArgs {
    /// The first run: a posterior.json, or the folder it is in; draws.csv must be beside it
    #[arg(value_name = "RUN")]
    one: PathBuf,

    /// The other run
    #[arg(value_name = "OTHER")]
    other: PathBuf,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/diff")]
    out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &DiffArgs) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, RECORD)?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    let compared = diff::compare(&args.one, &args.other)?;
    let published = compared.publish(&folder)?;
    terminal.announce(&published, &args.out);
    terminal.advise(&compared.diff.advice);
    let text = || {
        let out = args.out.display();
        let files = format!("  files: {out}/ (diff.json, report.html, diff.png, diff.svg)\n");
        diff::text(&compared.diff) + &files
    };
    terminal.print_result(args.json, || pretty(&compared.diff), text)
}
