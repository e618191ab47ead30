//! The main job: calibrate, write the run's folder, say what was found.

use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;
use smc_calib::{Observer, StageRecord};

use crate::args::RunArgs;
use crate::calibration::Calibration;
use crate::check::describe;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::number::{shown_unit, significant};
use crate::output::{POSTERIOR_RECORD, Published, RunFolder};
use crate::pictures::{self, SampleColumns};
use crate::plan::{Plan, Planned, noise_in_words};
use crate::posterior_file::{self, PosteriorFile};
use crate::{checksums, interrupt, summary, tables, verify};
use figures::{Figure, Width};

/// How long things took. Apart from the posterior, whose bytes do not depend on it.
#[derive(Debug, Serialize)]
struct Timings {
    threads: usize,
    inference_seconds: f64,
    stage_seconds: Vec<f64>,
    report_seconds: f64,
}

/// A bar with the time left on a terminal, nothing elsewhere. `of_what` follows the numbers.
pub fn progress_bar(length: u64, of_what: &str, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    let template = format!("{{bar:30}} {{pos}}/{{len}} {of_what}, {{eta}} left {{msg}}");
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Progress on a terminal, and the clock: the sampler has neither.
struct Watch {
    bar: ProgressBar,
    last: Instant,
    stage_seconds: Vec<f64>,
}

impl Watch {
    fn new(samples: usize, quiet: bool) -> Self {
        let bar = progress_bar(samples as u64, "simulations", quiet);
        Self { bar, last: Instant::now(), stage_seconds: Vec::new() }
    }
}

impl Observer for Watch {
    fn stage(&mut self, record: &StageRecord) -> ControlFlow<()> {
        let now = Instant::now();
        self.stage_seconds.push(now.duration_since(self.last).as_secs_f64());
        self.last = now;
        self.bar.set_message(format!("(stage {}, ESS {:.0})", record.stage, record.ess));
        if interrupt::asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Runs the main job.
///
/// # Errors
///
/// [`Failure`] with the reason; nothing has been written then, and earlier results are untouched.
pub fn run(args: &RunArgs) -> Result<(), Failure> {
    if args.plan.is_some() || args.resume.is_some() {
        return crate::external::driver::run(args);
    }
    let planned = Planned::from_args(args)?;
    let folder = RunFolder::prepare(&planned.out, POSTERIOR_RECORD)?;
    if args.dry_run {
        return dry_run(&planned, args.json);
    }
    let pool = pool(args.threads)?;
    let mut watch = Watch::new(planned.plan.sampler.samples, args.quiet);
    let bar = watch.bar.clone();
    let visible = !bar.is_hidden();
    interrupt::listen();
    let count = || {
        if visible {
            bar.inc(1);
        }
        !interrupt::asked()
    };
    let start = Instant::now();
    let calibration = pool.install(|| Calibration::run(&planned, &mut watch, &count));
    let inference_seconds = start.elapsed().as_secs_f64();
    watch.bar.finish_and_clear();
    let Calibration { file, posterior } = calibration?;
    // What a break between stages leaves is no answer to the plan.
    interrupt::check()?;

    let staging = folder.stage()?;
    let write =
        |name: &str, bytes: &[u8]| staging.write(&planned.out, name, bytes).map_err(make_room);
    let samples = tables::sample_columns(&posterior);
    pool.install(|| {
        let (tables, pictures) = rayon::join(
            || {
                write("table.md", tables::markdown(&file).as_bytes())?;
                write("table.csv", tables::csv(&file).as_bytes())?;
                let read_again = [
                    (POSTERIOR_RECORD, record(&file, posterior_file::parse)?),
                    ("samples.csv", tables::samples_csv(&posterior)),
                    ("draws.csv", tables::draws_csv(&posterior)),
                ];
                checksums::write_all(&read_again, &write)
            },
            || draw(&file, &samples, false, Width::Column, &write),
        );
        tables.and(pictures)
    })?;
    let timings = Timings {
        threads: pool.current_num_threads(),
        inference_seconds,
        stage_seconds: watch.stage_seconds,
        report_seconds: start.elapsed().as_secs_f64() - inference_seconds,
    };
    write("timings.json", pretty(&timings)?.as_bytes())?;
    interrupt::check()?;
    let published = staging.publish()?;

    announce(&published, &planned.out, args.quiet);
    if args.quiet {
        for line in &file.advice {
            eprintln!("warning: {line}");
        }
    }
    let mut out = std::io::stdout().lock();
    if args.json {
        writeln!(out, "{}", summary::json(&file, Some(&planned.out)).map_err(unserialisable)?)?;
    } else if !args.quiet {
        write!(out, "{}", summary::text(&file, Some(inference_seconds), Some(&planned.out)))?;
    }
    if args.verify {
        verify::run(&planned.plan, &file, &pool, args.quiet)?;
    }
    Ok(())
}

/// What to do about results that cannot be written.
pub fn make_room(error: RunError) -> RunError {
    error.help("make room on the disk, or choose another folder with --out")
}

/// Takes a file name and its bytes.
pub type WriteFile<'a> = dyn Fn(&str, &[u8]) -> Result<(), RunError> + Sync + 'a;

/// Writes every figure of a run as PNG and SVG.
///
/// # Errors
///
/// [`RunError`] for a figure that cannot be drawn, or what `write` says.
pub fn draw(
    file: &PosteriorFile,
    samples: &SampleColumns,
    log_time: bool,
    width: Width,
    write: &WriteFile<'_>,
) -> Result<(), RunError> {
    draw_all(&pictures::all(file, samples, log_time), width, write)
}

/// Figures by the names of their files.
pub type NamedFigures = Vec<(String, Box<dyn Figure + Send + Sync>)>;

/// Writes figures as PNG and SVG.
pub fn draw_all(
    figures: &NamedFigures,
    width: Width,
    write: &WriteFile<'_>,
) -> Result<(), RunError> {
    figures
        .par_iter()
        .map(|(name, figure)| {
            let picture = figure
                .render(width)
                .map_err(|error| RunError::new(format_args!("figure {name}: {error}")))?;
            write(&format!("{name}.png"), &picture.png)?;
            write(&format!("{name}.svg"), picture.svg.as_bytes())
        })
        .collect()
}

/// The text of `posterior.json`, which reads back as what it was.
pub(crate) fn record<T: Serialize + PartialEq>(
    file: &T,
    parse: impl Fn(&str, &str) -> Result<T, InputError>,
) -> Result<String, RunError> {
    let text = pretty(file)?;
    match parse(POSTERIOR_RECORD, &text) {
        Ok(back) if back == *file => Ok(text),
        Ok(_) => Err(RunError::new("posterior.json does not read back as it was written")),
        Err(error) => Err(RunError::new(format_args!(
            "the posterior holds a number that JSON cannot: {error}"
        ))),
    }
}

/// JSON as it is written to files.
pub fn pretty(value: &impl Serialize) -> Result<String, RunError> {
    let mut text = serde_json::to_string_pretty(value).map_err(unserialisable)?;
    text.push('\n');
    Ok(text)
}

fn unserialisable(error: serde_json::Error) -> RunError {
    RunError::new(format_args!("the result cannot be written as JSON: {error}"))
}

/// A pool of the asked number of threads, or of all cores.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(|error| {
        InputError::new("--threads", Mistake::OutOfRange)
            .found(threads.map_or_else(|| "all cores".to_owned(), |n| n.to_string()))
            .expected(format_args!("as many threads as the machine can start ({error})"))
            .into()
    })
}

/// Says what became of an earlier run in the folder.
pub(crate) fn announce(published: &Published, out: &Path, quiet: bool) {
    if quiet {
        return;
    }
    let out = out.display();
    match published {
        Published::New => {}
        Published::Replaced => eprintln!("note: {out}: replaced the earlier run of the same plan"),
        Published::MovedAside { kept, same_plan } => eprintln!(
            "note: {out}: moved the earlier run to {}, as {}",
            kept.display(),
            if *same_plan { "it holds other files too" } else { "its plan was another" }
        ),
    }
}

/// The warning that the run itself would give, for a plan that is only printed.
fn few_points_of(plan: &Plan) -> Option<String> {
    let (observations, parameters) = (plan.experiment.time_s.len(), plan.parameters.len());
    (observations < parameters)
        .then(|| smc_calib::Warning::FewObservations { observations, parameters }.to_string())
}

fn dry_run(planned: &Planned, json: bool) -> Result<(), Failure> {
    let plan = &planned.plan;
    let mut out = std::io::stdout().lock();
    if json {
        write!(out, "{}", pretty(plan)?)?;
        return Ok(());
    }
    let experiment = &plan.experiment;
    let span = |values: &[f64]| match (values.first(), values.last()) {
        (Some(first), Some(last)) => format!("{first} .. {last} s"),
        _ => "none".to_owned(),
    };
    writeln!(out, "plan: {} ({})", plan.title, plan.name)?;
    writeln!(
        out,
        "  observations  {} of {} ({})",
        experiment.time_s.len(),
        experiment.table_file,
        span(&experiment.time_s)
    )?;
    writeln!(
        out,
        "  powder        R {} um, E {} GPa, gamma {} mN/m, rho {} kg/m3, phi {}",
        significant(1e6 * experiment.radius_m, 4),
        significant(1e-9 * experiment.youngs_modulus_pa, 3),
        significant(1e3 * experiment.surface_tension_n_per_m, 4),
        significant(experiment.density_kg_per_m3, 4),
        significant(experiment.final_contact_ratio, 4)
    )?;
    writeln!(out, "  priors        {}", plan.prior_file)?;
    for parameter in &plan.parameters {
        let unit = shown_unit(&parameter.unit);
        writeln!(out, "    {:<8} {} {unit}", parameter.name, describe(parameter.prior.spec()))?;
    }
    writeln!(out, "  kinetics      {}", plan.kinetics)?;
    writeln!(out, "  solver        {}", plan.solver.reason)?;
    writeln!(out, "  noise         {}", noise_in_words(&plan.noise))?;
    writeln!(
        out,
        "  sampler       {} simulations, {} adaptive stages, seed {}",
        plan.sampler.samples, plan.sampler.iterations, plan.sampler.seed
    )?;
    writeln!(out, "  results to    {}", planned.out.display())?;
    let few = few_points_of(plan);
    for warning in planned.warnings.iter().chain(&few) {
        eprintln!("warning: {warning}");
    }
    Ok(())
}

/// Reads the samples beside a `posterior.json`.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_samples(
    dimensions: usize,
    simulations: usize,
    folder: &Path,
) -> Result<SampleColumns, InputError> {
    let path = folder.join("samples.csv");
    checksums::read_as(&path, |name, text| {
        let samples = tables::read_sample_columns(name, text, dimensions)?;
        complete(name, samples.weights.len(), simulations, "samples")?;
        Ok(samples)
    })
}

/// Reads the parameter columns \[SI\] of the draws beside a `posterior.json`, one draw per row.
///
/// # Errors
///
/// [`InputError`] for a file that is missing or cut off.
pub fn read_draws(file: &PosteriorFile, folder: &Path) -> Result<Vec<Vec<f64>>, InputError> {
    let path = folder.join("draws.csv");
    checksums::read_as(&path, |name, text| {
        let draws = tables::read_parameters(name, text, file.parameters.len())?;
        complete(name, draws.first().map_or(0, Vec::len), file.plan.sampler.draws, "draws")?;
        Ok(draws)
    })
}

/// Refuses a table that was cut off at the end of a line.
fn complete(name: &str, found: usize, wanted: usize, what: &str) -> Result<(), InputError> {
    if found == wanted {
        return Ok(());
    }
    Err(InputError::new(name, Mistake::Damaged)
        .found(format_args!("{found} {what}"))
        .expected(format_args!("{wanted}, as posterior.json says"))
        .help("the file is cut off or belongs to another run: run the calibration again"))
}
