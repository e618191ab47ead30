//! `calibrate scene`: many particles through the phases of a scene file.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::output::{pool, pretty};
use workbench::scene::SceneJob;

use crate::arguments;
use crate::terminal::{self, OnInterrupt, Terminal};

const EXAMPLES: &str = "\
Examples:
  calibrate scene experiments/scenes/pair.toml
  calibrate scene experiments/scenes/powder-bed-1000.toml --vtk
  calibrate scene experiments/scenes/ps-pulse.toml
  calibrate scene my-bed.toml --dry-run

Writes series.csv (density, coordination, contact ratios, forces and energies over time), scene.json (summary), pictures of \
the bed at the start and at the end (PNG), the curves (PNG and SVG), and with --vtk a file per observation for ParaView. A \
scene with a heat section is run under that heat, of which every number must be stated. A run that was interrupted or killed goes on where it was when the same command is given again, to the same bits.";

/// Run a scene of many particles.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct SceneArgs {
    /// A scene (.toml or .json); experiments/scenes has worked examples
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Folder for the results [default: results/NAME of the scene]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Write a VTK file at every observation
    #[arg(long)]
    vtk: bool,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Check the scene, print what would be done, and stop; packings are not made
    #[arg(long)]
    dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the summary (or with --dry-run the scene) as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &SceneArgs) -> Result<(), Failure> {
    let job = SceneJob::read(&args.file, args.out.clone(), args.vtk)?;
    if args.dry_run {
        let text = if args.json { pretty(job.plan())? } else { job.describe() };
        return terminal::write(text.as_bytes());
    }
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    let found = job.run(pool(args.threads)?, &terminal)?;
    terminal.announce(&found.published, job.out());
    let text = || found.record.text(Some((found.seconds, job.out())));
    terminal.print_result(args.json, || pretty(&found.record), text)?;
    terminal.advise(&found.record.advice);
    Ok(())
}
