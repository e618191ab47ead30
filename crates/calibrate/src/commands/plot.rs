//! `calibrate plot`: the figures of a saved run, drawn again from its files.

use std::fs;
use std::path::PathBuf;

use figures::Width;
use workbench::error::{Failure, InputError, Mistake, RunError};
use workbench::input::text_file::folder_of;
use workbench::{output, record, report};

use crate::arguments;
use crate::terminal;

const EXAMPLES: &str = "\
Examples:
  calibrate plot results/ps
  calibrate plot results/ps/posterior.json --log-time --width full \\
      --out figures

Draws fit, corner, recursion, convergence and residuals (.png and .svg) from posterior.json, samples.csv and draws.csv. \
Without options they are the files of the run itself, byte for byte.";

/// Figures of a saved run.
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PlotArgs {
    /// A posterior.json, or the folder it is in; samples.csv and draws.csv must be beside it
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// Logarithmic time axes, for stages that span decades [default: where half of what is measured changes within the
    /// first tenth of the time]
    #[arg(long)]
    log_time: bool,

    /// Linear time axes, also where the measurements change early
    #[arg(long, conflicts_with = "log_time")]
    linear_time: bool,

    /// Printed width: column is 85 mm, full is 170 mm
    #[arg(long, value_name = "WIDTH", default_value = "column", value_parser = arguments::width())]
    width: Width,

    /// Folder for the figures [default: the folder of the run]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Say nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

/// Runs the command.
pub(crate) fn run(args: &PlotArgs) -> Result<(), Failure> {
    let path = record::locate(&args.file);
    let record = record::read(&args.file)?;
    let folder = folder_of(&path);
    let points = report::PointColumns::read(&record, folder)?;
    let out = args.out.as_deref().unwrap_or(folder);
    if args.out.is_some() {
        fs::create_dir_all(out).map_err(|error| {
            InputError::new("--out", Mistake::Unwritable)
                .found(format_args!("{} ({error})", out.display()))
                .expected("a folder for the figures")
        })?;
    }
    output::check_file(&out.join("corner.png"))?;
    let figures =
        report::pictures(&record, &points, arguments::time_scale(args.log_time, args.linear_time));
    let write = |name: &str, bytes: &[u8]| {
        output::write_file(&out.join(name), bytes)
            .map_err(|error| RunError::new(format_args!("{}: {error}", out.join(name).display())))
    };
    terminal::working(args.quiet, "figures", || report::draw_all(&figures, args.width, &write))?;
    if args.quiet {
        return Ok(());
    }
    let width = match args.width {
        Width::Column => "85 mm",
        Width::Full => "170 mm",
    };
    let names: Vec<&str> = figures.iter().map(|(name, _)| name.as_str()).collect();
    let names = names.join(", ");
    terminal::write(format!("{}/: {names} (.png, .svg; {width} wide)\n", out.display()).as_bytes())
}
