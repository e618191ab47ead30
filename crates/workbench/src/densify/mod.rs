//! `calibrate densify`: a powder bed for the draws of a posterior, and what that says of its densification.

mod curve;
mod draws;
mod report;
mod runs;
mod spread;

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use clap::Args as ArgsOf;
use dem_core::bed::BedError;
use serde_json::json;

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::interrupt;
use crate::number::significant;
use crate::output::RunFolder;
use crate::posterior_file::{self, PosteriorFile};
use crate::parameter::ParameterName;
use crate::run::{announce, make_room, pool, pretty, progress_bar, read_draws};
use crate::scene_file::{self, SceneInput};
use crate::work_folder::{WorkFolder, fingerprint};
use figures::{Figure as _, Width};

pub use curve::{Band, Curve, Moment, Point, Target, TimeTo};
pub use draws::Draw;
pub use report::{DensifyPlan, Report};
pub use spread::{Share, Spread};

use report::FailedDraw;
use runs::Message;

/// The record of a densification.
pub const DENSIFY_RECORD: &str = "densify.json";

const EXAMPLES: &str = "\
Examples:
  calibrate densify --posterior results/pa12 --scene experiments/scenes/packing-200.toml
  calibrate densify --posterior results/pa12 --scene my-bed.toml --draws 100 --target 0.85
  calibrate densify --posterior results/pa12 --scene experiments/scenes/pair.toml --contact-ratio 0.9

Takes draws of the posterior, evenly spread over the sintering time of their pair, runs the scene with the parameters of each,
and writes densify.json (all of it), densify.csv (bands over time), draws.csv (a row per draw), series/ (the bed of each draw)
and the fan chart densify.png and .svg. Finished draws are kept: the same command goes on with the others after an
interruption, and another target is read from the same beds.";

/// A powder bed for draws of a posterior.
#[derive(Debug, Clone, PartialEq, ArgsOf)]
#[command(after_help = EXAMPLES)]
pub struct DensifyArgs {
    /// A posterior.json, or the folder it is in; draws.csv must be beside it
    #[arg(short, long, value_name = "FILE")]
    pub posterior: PathBuf,

    /// A scene (.toml or .json) with a heated phase; its kinetics must be the posterior's, its sintering
    /// parameters are replaced by those of each draw
    #[arg(short, long, value_name = "FILE")]
    pub scene: PathBuf,

    /// Draws of the posterior
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub draws: u32,

    /// When is this relative density reached? [default: 0.9]
    #[arg(short, long, value_name = "DENSITY", value_parser = parse_density, allow_negative_numbers = true)]
    pub target: Option<f64>,

    /// When is this mean contact ratio a/R reached? For beds without a volume, as the pair
    #[arg(short, long, value_name = "A/R", value_parser = crate::args::parse_target, conflicts_with = "target", allow_negative_numbers = true)]
    pub contact_ratio: Option<f64>,

    /// Seed of the choice of draws
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Threads, each of which computes one bed at a time [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Folder for the results [default: results/SCENE-POSTERIOR]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Check everything, print what would be done, and stop
    #[arg(long)]
    pub dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,

    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
}

fn parse_density(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1.0 => Ok(value),
        Ok(value) if value > 1.0 && value <= 100.0 => Err(format!(
            "expected a share of the solid density; is that in percent? write {}",
            value / 100.0
        )),
        _ => Err("expected a relative density above 0, at most 1".to_owned()),
    }
}

/// Everything that was read, and found to go together.
struct Request {
    input: SceneInput,
    file: PosteriorFile,
    names: Vec<ParameterName>,
    draws: Vec<Draw>,
    plan: DensifyPlan,
    /// What the series of a draw depends on.
    series_plan: String,
    advice: Vec<String>,
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
///
/// [`Failure`] with the reason; finished draws are kept for the same command.
pub fn run(args: &DensifyArgs) -> Result<(), Failure> {
    let request = Request::read(args)?;
    let folder = RunFolder::prepare(&request.out, DENSIFY_RECORD)?;
    if args.dry_run {
        return request.dry_run();
    }
    interrupt::listen();
    let threads = pool(args.threads.map(usize::from))?;
    let cores = threads.current_num_threads();
    let start = Instant::now();
    let work = WorkFolder::open(&folder, &request.series_plan)?;
    work.mention_others(args.quiet);
    let curves = request.curves(&folder, &work, threads, args.quiet)?;
    let seconds = start.elapsed().as_secs_f64();

    let Request { draws, names, plan, advice, out, .. } = &request;
    let (mut computed, mut failed) = (Vec::new(), Vec::new());
    for (draw, outcome) in draws.iter().zip(curves) {
        match outcome {
            Ok(curve) => computed.push((draw.clone(), curve)),
            Err(error) => failed.push(FailedDraw { draw: draw.clone(), reason: error.to_string() }),
        }
    }
    let parameters: Vec<String> = names.iter().map(|name| name.name().to_owned()).collect();
    let units: Vec<String> = names.iter().map(|name| name.unit().to_owned()).collect();
    let report = Report::new(plan.clone(), parameters, &computed, failed, advice.clone());

    let staging = folder.stage()?;
    let write = |name: &str, bytes: &[u8]| staging.write(out, name, bytes).map_err(make_room);
    write(DENSIFY_RECORD, pretty(&report)?.as_bytes())?;
    write("densify.csv", report.curve_csv().as_bytes())?;
    write("draws.csv", report.draws_csv(&units).as_bytes())?;
    let picture = report
        .figure()
        .render(Width::Column)
        .map_err(|error| RunError::new(format_args!("figure densify: {error}")))?;
    write("densify.png", &picture.png)?;
    write("densify.svg", picture.svg.as_bytes())?;
    for (draw, curve) in &computed {
        let file = curve.file(&request.belongs_to(draw));
        write(&format!("series/{}", series_name(draw)), file.as_bytes())?;
    }
    let timings = json!({ "threads": cores, "seconds": seconds });
    write("timings.json", pretty(&timings)?.as_bytes())?;
    interrupt::check()?;
    let published = staging.publish()?;
    if report.failed.is_empty() {
        work.finish();
    }
    announce(&published, out, args.quiet);
    let mut stdout = std::io::stdout().lock();
    if args.json {
        write!(stdout, "{}", pretty(&report)?)?;
    } else if !args.quiet {
        write!(stdout, "{}", report.text(seconds, out))?;
    }
    if args.quiet {
        for line in &report.advice {
            eprintln!("warning: {line}");
        }
    }
    Ok(())
}

/// The file of a draw's bed.
fn series_name(draw: &Draw) -> String {
    format!("draw-{:06}.csv", draw.row)
}

impl Request {
    fn read(args: &DensifyArgs) -> Result<Self, Failure> {
        let path = posterior_file::locate(&args.posterior);
        let file = posterior_file::read(&path)?;
        let input = scene_file::read(&args.scene)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let theta = read_draws(&file, folder).map_err(|error| {
            error.help("draws.csv is written beside posterior.json: name the folder of a run")
        })?;
        let target = target(args, &input)?;
        check_kinetics(&args.posterior, &file, &input)?;
        if !input.file.phases.iter().any(|phase| phase.heated) {
            return Err(InputError::new(&input.place, Mistake::MissingField)
                .in_field("phases")
                .found("no phase with heated = true")
                .expected("a phase in which contacts grow")
                .help("write heated = true in the phase that sinters the bed")
                .into());
        }
        let names = file.plan.parameter_names()?;
        let draws = draws::choose(&file, &theta, args.draws as usize, args.seed)?;
        let plan_text = serde_json::to_string(&file.plan).map_err(RunError::new)?;
        let posterior_fingerprint =
            format!("{:016x}", fingerprint(&format!("{plan_text}\n{theta:?}")));
        let scene = input.identity()?;
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let series_plan = json!({
            "scene": scene, "posterior": posterior_fingerprint, "draws": args.draws, "seed": args.seed,
            "version": version,
        });
        let advice = advice(&file, &input, &names);
        let plan = DensifyPlan {
            scene_name: input.file.name.clone(),
            scene,
            posterior_name: file.plan.name.clone(),
            posterior_fingerprint,
            kinetics: file.plan.kinetics.clone(),
            calibrated_radius_m: file.plan.experiment.radius_m,
            draws: args.draws as usize,
            seed: args.seed,
            target,
            version,
        };
        let default = format!("{}-{}", input.folder_name(), file.plan.name);
        Ok(Self {
            out: args.out.clone().unwrap_or_else(|| Path::new("results").join(default)),
            series_plan: series_plan.to_string(),
            input,
            file,
            names,
            draws,
            plan,
            advice,
        })
    }

    fn belongs_to(&self, draw: &Draw) -> String {
        format!("densify {:016x}, draw {}", fingerprint(&self.series_plan), draw.row)
    }

    /// The beds of all draws: those of earlier work, and the others.
    fn curves(
        &self,
        folder: &RunFolder,
        work: &WorkFolder,
        threads: rayon::ThreadPool,
        quiet: bool,
    ) -> Result<Vec<Result<Curve, BedError>>, Failure> {
        let published = folder.path().join("series");
        let mut curves: Vec<Option<Result<Curve, BedError>>> = self
            .draws
            .iter()
            .map(|draw| {
                let name = series_name(draw);
                let text = work.get(&name).or_else(|| fs::read(published.join(&name)).ok())?;
                let text = String::from_utf8(text).ok()?;
                Curve::parse(&text, &self.belongs_to(draw)).map(Ok)
            })
            .collect();
        let taken_up = curves.iter().flatten().count();
        if taken_up > 0 && !quiet {
            eprintln!(
                "note: the beds of {taken_up} of {} draws are there already",
                self.draws.len()
            );
        }
        let kinetics = self.file.plan.kinetics()?;
        let Some(table) = &self.input.file.sintering else {
            return Err(RunError::new("the scene lost its [sintering]").into());
        };
        let radius_m = self.plan.calibrated_radius_m;
        let beds: Vec<runs::Bed> = (0..self.draws.len())
            .filter(|&draw| curves[draw].is_none())
            .map(|draw| {
                let chosen = &self.draws[draw];
                runs::Bed {
                    draw,
                    growing: draws::growing(&self.names, chosen, kinetics, radius_m, table),
                    phi: draws::value(&self.names, &chosen.parameters, ParameterName::Phi),
                }
            })
            .collect();
        let missing = beds.len();
        if missing > 0 {
            let per_bed: usize = self
                .input
                .file
                .phases
                .iter()
                .skip_while(|phase| !phase.heated)
                .map(|phase| phase.outputs + 1)
                .sum();
            let bar = progress_bar((missing * per_bed) as u64, "observations", quiet);
            bar.set_message("(placing the particles)");
            let (send, receive) = channel();
            let scene = self.input.file.clone();
            // Not joined: what is on disk is whole at any moment, and Ctrl-C need not wait for it.
            let _ = std::thread::spawn(move || runs::compute(&scene, beds, threads, &send));
            let mut done = 0;
            while done < missing {
                if interrupt::asked() {
                    bar.finish_and_clear();
                    let kept = taken_up + done;
                    return Err(Failure::Paused(format!(
                        "interrupted; the beds of {kept} of {} draws are kept, and the same command goes on with the others",
                        self.draws.len()
                    )));
                }
                match receive.recv_timeout(Duration::from_millis(50)) {
                    Ok(Message::NoScene(error)) => {
                        return Err(scene_file::failed(&self.input.place, &error, None));
                    }
                    Ok(Message::Ready { has_density }) => self.check_volume(has_density)?,
                    Ok(Message::Observed) => bar.inc(1),
                    Ok(Message::Done(draw, curve)) => {
                        done += 1;
                        // A bed that was full ends before the scene does.
                        bar.inc((per_bed - curve.moments.len()) as u64);
                        bar.set_message(format!("({done} of {missing} beds)"));
                        let chosen = &self.draws[draw];
                        let file = curve.file(&self.belongs_to(chosen));
                        work.put(&series_name(chosen), file.as_bytes())?;
                        curves[draw] = Some(Ok(curve));
                    }
                    Ok(Message::Failed(draw, error)) => {
                        done += 1;
                        curves[draw] = Some(Err(error));
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => {
                        return Err(RunError::new("the simulation ended without a result").into());
                    }
                }
            }
            bar.finish_and_clear();
        }
        let curves: Vec<Result<Curve, BedError>> = curves.into_iter().flatten().collect();
        if let Some(Err(error)) = curves.iter().find(|curve| curve.is_err())
            && curves.iter().all(Result::is_err)
        {
            return Err(scene_file::failed(
                &self.input.place,
                error,
                Some("the beds of all draws failed; this is the first of them"),
            ));
        }
        Ok(curves)
    }

    fn check_volume(&self, has_density: bool) -> Result<(), Failure> {
        match self.plan.target {
            Target::RelativeDensity(_) if !has_density => Err(no_volume(&self.input).into()),
            _ => Ok(()),
        }
    }

    fn dry_run(&self) -> Result<(), Failure> {
        let mut stdout = std::io::stdout().lock();
        let plan = &self.plan;
        writeln!(
            stdout,
            "densify: {} with {} draws of {}",
            plan.scene_name, plan.draws, plan.posterior_name
        )?;
        for line in crate::scene_command::describe(&self.input) {
            writeln!(stdout, "  {line}")?;
        }
        writeln!(
            stdout,
            "  draws         {} instead of the scene's, tau_s at R = {} um",
            self.names.iter().map(|name| name.name()).collect::<Vec<_>>().join(", "),
            significant(1e6 * plan.calibrated_radius_m, 4)
        )?;
        writeln!(
            stdout,
            "  target        {} {}",
            plan.target.name(),
            significant(plan.target.value(), 3)
        )?;
        writeln!(stdout, "  results to    {}", self.out.display())?;
        for line in &self.advice {
            eprintln!("warning: {line}");
        }
        Ok(())
    }
}

fn target(args: &DensifyArgs, input: &SceneInput) -> Result<Target, InputError> {
    if let Some(ratio) = args.contact_ratio {
        return Ok(Target::ContactRatio(ratio));
    }
    if input.file.region.is_none() {
        return Err(no_volume(input));
    }
    Ok(Target::RelativeDensity(args.target.unwrap_or(0.9)))
}

fn no_volume(input: &SceneInput) -> InputError {
    InputError::new(&input.place, Mistake::MissingField)
        .in_field("box")
        .found("a bed that is open on its sides")
        .expected("a bed with a volume, for its relative density")
        .help(
            "give --contact-ratio A/R instead of --target, or box.sides that are periodic or walls",
        )
}

fn check_kinetics(
    posterior: &Path,
    file: &PosteriorFile,
    input: &SceneInput,
) -> Result<(), InputError> {
    let Some(table) = &input.file.sintering else {
        return Err(InputError::new(&input.place, Mistake::MissingField)
            .in_field("sintering")
            .found("missing")
            .expected("the kinetics of the bed")
            .help(format_args!("write [sintering] with kinetics = \"{}\"", file.plan.kinetics)));
    };
    if table.kinetics == file.plan.kinetics {
        return Ok(());
    }
    Err(InputError::new(&input.place, Mistake::Conflict)
        .in_field("sintering.kinetics")
        .found(format_args!("\"{}\"", table.kinetics))
        .expected(format_args!(
            "\"{}\", the kinetics of {}",
            file.plan.kinetics,
            posterior.display()
        ))
        .help(format_args!(
            "calibrate again with --kinetics {}, or write the posterior's kinetics in the scene",
            table.kinetics
        )))
}

/// What is allowed and yet worth saying.
fn advice(file: &PosteriorFile, input: &SceneInput, names: &[ParameterName]) -> Vec<String> {
    let mut advice = Vec::new();
    if !file.is_posterior {
        advice.push("the draws are not of a posterior: the noise was tuned".to_owned());
    }
    advice.extend(file.advice.iter().cloned());
    let (experiment, material) = (&file.plan.experiment, &input.file.material);
    for (what, unit, scene, calibrated) in [
        ("Young's modulus", "Pa", material.youngs_modulus_pa, experiment.youngs_modulus_pa),
        (
            "surface tension",
            "N/m",
            material.surface_tension_n_per_m,
            experiment.surface_tension_n_per_m,
        ),
    ] {
        if (scene / calibrated - 1.0).abs() > 0.01 {
            advice.push(format!(
                "the scene's {what} is {} {unit}, the posterior was calibrated with {} {unit}: another powder?",
                significant(scene, 3),
                significant(calibrated, 3)
            ));
        }
    }
    let (phi, calibrated) = (material.final_contact_ratio, experiment.final_contact_ratio);
    if !names.contains(&ParameterName::Phi) && (phi / calibrated - 1.0).abs() > 1e-3 {
        advice.push(format!(
            "contacts of the scene grow up to a/R = {}, those of the calibrated pair up to {}",
            significant(phi, 4),
            significant(calibrated, 4)
        ));
    }
    advice
}
