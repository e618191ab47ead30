//! `calibrate plot`: the figures of a saved run, drawn again from its files.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use crate::args::PlotArgs;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::external::posterior_file::{AnyPosterior, read_any};
use crate::external::report;
use crate::output;
use crate::pictures;
use crate::posterior_file::locate;
use crate::run::{draw_all, read_samples};
use figures::Width;

/// Draws every figure of the run that `args` name.
///
/// # Errors
///
/// [`Failure::Input`] for files that are missing or damaged, or a folder that cannot be written;
/// [`Failure::Run`] where writing fails.
pub fn run(args: &PlotArgs) -> Result<(), Failure> {
    let path = locate(&args.file);
    let file = read_any(&args.file)?;
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let (dimensions, simulations) = match &file {
        AnyPosterior::Pair(file) => (file.parameters.len(), file.counters.simulations),
        AnyPosterior::Plan(file) => (file.parameters.len(), file.counters.simulations),
    };
    let samples = read_samples(dimensions, simulations, folder)?;
    if samples.weights.is_empty() {
        return Err(InputError::new(
            folder.join("samples.csv").display().to_string(),
            Mistake::Empty,
        )
        .found("a table without samples")
        .expected("the samples of the run")
        .help("run the calibration again")
        .into());
    }
    let out = args.out.as_deref().unwrap_or(folder);
    if args.out.is_some() {
        fs::create_dir_all(out).map_err(|error| {
            InputError::new("--out", Mistake::Unwritable)
                .found(format_args!("{} ({error})", out.display()))
                .expected("a folder for the figures")
        })?;
    }
    output::check_file(&out.join("corner.png"))?;
    let figures = match &file {
        AnyPosterior::Pair(file) => pictures::all(file, &samples, args.log_time),
        AnyPosterior::Plan(file) => report::figures(file, &samples, args.log_time),
    };
    draw_all(&figures, args.width, &|name, bytes| {
        output::write_file(&out.join(name), bytes)
            .map_err(|error| RunError::new(format_args!("{}: {error}", out.join(name).display())))
    })?;
    if !args.quiet {
        let width = match args.width {
            Width::Column => "85 mm",
            Width::Full => "170 mm",
        };
        writeln!(
            std::io::stdout().lock(),
            "{}/: {} (.png, .svg; {width} wide)",
            out.display(),
            figures.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
        )?;
    }
    Ok(())
}
