//! `calibrate scene FILE`: many particles through the phases of a scene file.
//!
//! The engine works in a thread of its own and hands over what it observes; this thread writes files, shows progress and
//! listens to Ctrl-C. Unfinished work is in a [`WorkFolder`], from which the same command goes on with the same bits.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use clap::Args as ArgsOf;
use dem_core::bed::{
    Bed, BedError, Mode, Phase, Run, Sample, Scene, Series, Side, write_csv, write_vtk,
};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::Value;

use crate::error::{Failure, RunError};
use crate::interrupt;
use crate::number::significant;
use crate::output::RunFolder;
use crate::run::{announce, make_room, pool, pretty, progress_bar};
use crate::scene_file::{self, SceneInput};
use crate::work_folder::WorkFolder;
use figures::{BedFigure, Figure as _, SeriesFigure, Width};

/// The record of a scene that ran.
pub const SCENE_RECORD: &str = "scene.json";
/// Version of its layout.
pub const SCHEMA_VERSION: u32 = 1;
/// Share of the particles on which two necks meet, from which on the model, a sum of pairs, is said to have ended.
pub const NECKS_MEET: f64 = 0.05;
/// Inertial number below which inertia is not felt.
const INERTIA_FELT: f64 = 1e-3;
/// A checkpoint is written at observations at least so far apart.
const CHECKPOINT_EVERY: Duration = Duration::from_millis(300);

const EXAMPLES: &str = "\
Examples:
  calibrate scene experiments/scenes/pair.toml
  calibrate scene experiments/scenes/powder-bed-1000.toml --vtk
  calibrate scene my-bed.toml --dry-run

Writes series.csv (density, coordination, contact ratios, forces and energies over time), scene.json (summary), pictures of
the bed at the start and at the end (PNG), the curves (PNG and SVG), and with --vtk a file per observation for ParaView. A
run that was interrupted or killed goes on where it was when the same command is given again, to the same bits.";

/// Run a scene of many particles.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
#[command(after_help = EXAMPLES)]
pub struct SceneArgs {
    /// A scene (.toml or .json); experiments/scenes has worked examples
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Folder for the results [default: results/NAME of the scene]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Write a VTK file at every observation
    #[arg(long)]
    pub vtk: bool,

    /// Threads [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Check the scene, print what would be done, and stop; packings are not made
    #[arg(long)]
    pub dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,

    /// Print the summary (or with --dry-run the scene) as JSON
    #[arg(long)]
    pub json: bool,
}

/// What decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ScenePlan {
    name: String,
    scene: Value,
    vtk: bool,
    version: String,
}

/// A bed in a few numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct State {
    /// When \[s\].
    pub time_s: f64,
    /// Mass over density and bed volume; none where the bed has no volume.
    pub relative_density: Option<f64>,
    /// Contacts per particle.
    pub coordination: f64,
    /// Mean contact ratio a/R.
    pub mean_contact_ratio: f64,
    /// Contact ratios that 10, 50 and 90 % of the contacts are below.
    pub contact_ratio_deciles: [f64; 3],
    /// Mean over the contacts of the force that drives the growth, over fa.
    pub mean_driving: f64,
    /// Largest magnitude of it.
    pub largest_driving: f64,
    /// Inertial number.
    pub inertial_number: f64,
    /// Share of the particles on which two necks meet.
    pub necks_meet: f64,
}

impl From<&Sample> for State {
    fn from(sample: &Sample) -> Self {
        Self {
            time_s: sample.time_s,
            relative_density: Some(sample.relative_density).filter(|density| density.is_finite()),
            coordination: sample.coordination,
            mean_contact_ratio: sample.mean_contact_ratio,
            contact_ratio_deciles: sample.contact_ratio_deciles,
            mean_driving: sample.mean_driving,
            largest_driving: sample.largest_driving,
            inertial_number: sample.inertial_number,
            necks_meet: sample.necks_meet,
        }
    }
}

/// A phase as it went.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct PhaseRecord {
    name: String,
    mode: &'static str,
    heated: bool,
    start_s: f64,
    end: State,
}

/// What the run took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct WorkRecord {
    steps: u64,
    neighbour_lists: u64,
    quasi_static_steps: u64,
    quasi_static_rejected: u64,
    newton_iterations: u64,
    conjugate_gradient_iterations: u64,
    /// Sum of the errors of a/R of all quasi-static steps.
    quasi_static_error: f64,
}

/// `scene.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct SceneRecord {
    schema_version: u32,
    plan: ScenePlan,
    particles: usize,
    observations: usize,
    /// When the first heated phase began \[s\].
    heated_from_s: Option<f64>,
    phases: Vec<PhaseRecord>,
    start: Option<State>,
    end: Option<State>,
    /// Where necks begin to meet on more than one particle in twenty: the model ends there.
    model_ends: Option<State>,
    /// Load on a particle at the bottom over its adhesive force.
    load_over_adhesion: Option<f64>,
    work: WorkRecord,
    advice: Vec<String>,
}

/// What the working thread says.
enum Message {
    /// The packing was made; the start, and observations that were there already.
    Placed {
        start: BedFigure,
        observed: usize,
    },
    /// An observation, with the files of this moment.
    Observed {
        sample: Sample,
        checkpoint: Option<Vec<u8>>,
        vtk: Option<Vec<u8>>,
        number: usize,
    },
    /// The end.
    Done(Box<Run>),
    Failed(BedError),
}

/// Runs the command.
///
/// # Errors
///
/// [`Failure`] with the reason; work done so far is kept for the same command.
pub fn run(args: &SceneArgs) -> Result<(), Failure> {
    let input = scene_file::read(&args.file)?;
    let out = args.out.clone().unwrap_or_else(|| Path::new("results").join(input.folder_name()));
    let folder = RunFolder::prepare(&out, SCENE_RECORD)?;
    let plan = ScenePlan {
        name: input.file.name.clone(),
        scene: input.identity()?,
        vtk: args.vtk,
        version: env!("CARGO_PKG_VERSION").to_owned(),
    };
    if args.dry_run {
        return dry_run(&input, &plan, &out, args.json);
    }
    interrupt::listen();
    let threads = pool(args.threads.map(usize::from))?;
    let start = Instant::now();
    let work = WorkFolder::open(&folder, &serde_json::to_string(&plan).map_err(RunError::new)?)?;
    work.mention_others(args.quiet);
    let checkpoint = work.get("checkpoint");
    let total: usize = input.file.phases.iter().map(|phase| phase.outputs + 1).sum();
    let (send, receive) = channel();
    let job = Job { file: input.clone(), checkpoint, vtk: args.vtk };
    let cores = threads.current_num_threads();
    // Not joined: what is on disk is whole at any moment, and Ctrl-C need not wait for it.
    let _ = std::thread::spawn(move || threads.install(|| job.work(&send)));
    let bar = progress_bar(total as u64, "observations", args.quiet);
    let observed = observe(&receive, &input, &work, &bar, total);
    bar.finish_and_clear();
    let Observed { run, first } = observed?;
    let seconds = start.elapsed().as_secs_f64();
    let record = record(&input, plan, &run);

    let staging = folder.stage()?;
    let write = |name: &str, bytes: &[u8]| staging.write(&out, name, bytes).map_err(make_room);
    write(SCENE_RECORD, pretty(&record)?.as_bytes())?;
    let mut csv = Vec::new();
    write_csv(run.series(), &mut csv).map_err(RunError::new)?;
    write("series.csv", &csv)?;
    let drawn = |error| RunError::new(format_args!("figure: {error}"));
    let picture = series_figure(&input.file.name, run.series(), &input.file.phases)
        .render(Width::Column)
        .map_err(drawn)?;
    write("series.png", &picture.png)?;
    write("series.svg", picture.svg.as_bytes())?;
    let last = bed_figure(run.bed(), &input.file.name);
    let range = colour_range([&first, &last]);
    for (name, figure) in [("bed-start.png", first), ("bed.png", last)] {
        write(name, &BedFigure { range, ..figure }.png(Width::Column).map_err(drawn)?)?;
    }
    for number in (0..total).filter(|_| args.vtk) {
        let name = vtk_name(number);
        let frame = work.get(&name).ok_or_else(|| {
            RunError::new(format_args!("{name} of the unfinished run is gone"))
                .help("run the command again")
        })?;
        write(&format!("vtk/{name}"), &frame)?;
    }
    let timings = serde_json::json!({ "threads": cores, "seconds": seconds });
    write("timings.json", pretty(&timings)?.as_bytes())?;
    interrupt::check()?;
    let published = staging.publish()?;
    work.finish();
    announce(&published, &out, args.quiet);
    let mut stdout = std::io::stdout().lock();
    if args.json {
        write!(stdout, "{}", pretty(&record)?)?;
    } else if !args.quiet {
        write!(stdout, "{}", summary(&record, seconds, &out))?;
    }
    if args.quiet {
        for line in &record.advice {
            eprintln!("warning: {line}");
        }
    }
    Ok(())
}

/// What the working thread does.
struct Job {
    file: SceneInput,
    checkpoint: Option<Vec<u8>>,
    vtk: bool,
}

impl Job {
    fn work(&self, send: &Sender<Message>) {
        let last = match self.through(send) {
            Ok(run) => Message::Done(Box::new(run)),
            Err(error) => Message::Failed(error),
        };
        // Nobody listens once the user has interrupted.
        let _ = send.send(last);
    }

    fn through(&self, send: &Sender<Message>) -> Result<Run, BedError> {
        let scene: Scene = self.file.file.build()?;
        let name = &self.file.file.name;
        // A checkpoint that cannot be read is as good as none.
        let resumed = self.checkpoint.as_ref().and_then(|bytes| scene.resume(bytes).ok());
        let mut run = resumed.unwrap_or_else(|| scene.start());
        let start = bed_figure(scene.bed(), name);
        let _ = send.send(Message::Placed { start, observed: run.series().samples.len() });
        let mut stored = Instant::now();
        while let Some(progress) = run.advance()? {
            let checkpoint = (stored.elapsed() >= CHECKPOINT_EVERY).then(|| {
                stored = Instant::now();
                run.checkpoint()
            });
            let vtk = self.vtk.then(|| {
                let mut bytes = Vec::new();
                // Memory takes everything.
                let _ = write_vtk(run.bed(), &mut bytes);
                bytes
            });
            let number = run.series().samples.len() - 1;
            let sample = progress.sample;
            if send.send(Message::Observed { sample, checkpoint, vtk, number }).is_err() {
                break;
            }
        }
        Ok(run)
    }
}

struct Observed {
    run: Run,
    first: BedFigure,
}

/// Takes what the working thread hands over, until it is done or the user asks to stop.
fn observe(
    receive: &Receiver<Message>,
    input: &SceneInput,
    work: &WorkFolder,
    bar: &ProgressBar,
    total: usize,
) -> Result<Observed, Failure> {
    let mut first = BedFigure::default();
    let mut kept = String::from("nothing was computed yet");
    let mut some_kept = false;
    bar.set_message("(placing the particles)");
    loop {
        if interrupt::asked() {
            return Err(Failure::Paused(format!("interrupted; {kept}")));
        }
        match receive.recv_timeout(Duration::from_millis(50)) {
            Ok(Message::Placed { start, observed }) => {
                first = start;
                bar.set_message("");
                if observed > 0 {
                    if !bar.is_hidden() {
                        eprintln!("note: going on after {observed} of {total} observations");
                    }
                    bar.set_position(observed as u64);
                    bar.reset_eta();
                    kept = kept_in_words(observed, total);
                    some_kept = true;
                }
            }
            Ok(Message::Observed { sample, checkpoint, vtk, number }) => {
                if let Some(bytes) = vtk {
                    work.put(&vtk_name(number), &bytes)?;
                }
                if let Some(bytes) = checkpoint {
                    work.put("checkpoint", &bytes)?;
                    kept = kept_in_words(number + 1, total);
                    some_kept = true;
                }
                bar.set_position(number as u64 + 1);
                bar.set_message(format!(
                    "(t = {} s, a/R {})",
                    significant(sample.time_s, 3),
                    significant(sample.mean_contact_ratio, 3)
                ));
            }
            Ok(Message::Done(run)) => return Ok(Observed { run: *run, first }),
            Ok(Message::Failed(error)) => {
                return Err(scene_file::failed(&input.place, &error, some_kept.then_some(&kept)));
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(RunError::new("the simulation ended without a result").into());
            }
        }
    }
}

fn kept_in_words(observed: usize, total: usize) -> String {
    format!("{observed} of {total} observations are kept, and the same command goes on from there")
}

fn vtk_name(number: usize) -> String {
    format!("bed-{number:05}.vtk")
}

/// The bed as it is.
#[must_use]
pub fn bed_figure(bed: &Bed, name: &str) -> BedFigure {
    let particles = bed.particles();
    let mut figure = BedFigure {
        title: format!("{name}, t = {} s", significant(bed.time_s(), 3)),
        position_m: particles.position_m.clone(),
        radius_m: particles.radius_m.clone(),
        ..BedFigure::default()
    };
    let mut sums = vec![(0.0, 0.0); particles.len()];
    for contact in bed.contacts() {
        let [i, j] = contact.particles;
        let length = particles.radius_m[i] + particles.radius_m[j]
            - contact.overlap * contact.effective_radius_m;
        figure.contacts.push((i, contact.normal.map(|part| -part * length), j));
        for particle in [i, j] {
            sums[particle].0 += contact.contact_ratio();
            sums[particle].1 += 1.0;
        }
    }
    figure.contact_ratio = sums.into_iter().map(|(sum, count)| sum / count).collect();
    let region = &bed.surroundings().region;
    if region.sides != [Side::Open; 3] {
        let mut frame = [[0.0; 3], region.size_m];
        for axis in 0..3 {
            let low = |part: f64, (p, r): (&[f64; 3], &f64)| part.min(p[axis] - r);
            let high = |part: f64, (p, r): (&[f64; 3], &f64)| part.max(p[axis] + r);
            let all = || particles.position_m.iter().zip(&particles.radius_m);
            // A box is drawn up to the bed's surface, not up to the sky.
            if region.sides[axis] != Side::Periodic {
                frame[1][axis] = all().fold(f64::NEG_INFINITY, high);
            }
            if region.sides[axis] == Side::Open {
                frame[0][axis] = all().fold(f64::INFINITY, low);
            }
        }
        figure.frame_m = Some(frame);
    }
    figure
}

/// A scale from 0 that holds the contact ratios of all figures.
fn colour_range<'a>(figures: impl IntoIterator<Item = &'a BedFigure>) -> [f64; 2] {
    let ratios = figures.into_iter().flat_map(|figure| figure.contact_ratio.iter().copied());
    let largest = ratios.filter(|ratio| ratio.is_finite()).fold(0.0, f64::max);
    [0.0, if largest > 0.0 { (largest * 20.0).ceil() / 20.0 } else { 1.0 }]
}

fn series_figure(name: &str, series: &Series, phases: &[Phase]) -> SeriesFigure {
    let column =
        |pick: &dyn Fn(&Sample) -> f64| -> Vec<f64> { series.samples.iter().map(pick).collect() };
    SeriesFigure {
        title: name.to_owned(),
        time_s: column(&|sample| sample.time_s),
        relative_density: column(&|sample| sample.relative_density),
        coordination: column(&|sample| sample.coordination),
        mean_contact_ratio: column(&|sample| sample.mean_contact_ratio),
        contact_ratio_10: column(&|sample| sample.contact_ratio_deciles[0]),
        contact_ratio_90: column(&|sample| sample.contact_ratio_deciles[2]),
        heated_from_s: heated_from_s(series, phases).filter(|&time| time > 0.0),
        model_ends_s: model_ends(series).map(|sample| sample.time_s),
    }
}

/// When the first heated phase began.
#[must_use]
pub fn heated_from_s(series: &Series, phases: &[Phase]) -> Option<f64> {
    let first = phases.iter().position(|phase| phase.heated)?;
    series.phase_start_s.get(first).copied()
}

/// The first observation at which necks meet on too many particles.
fn model_ends(series: &Series) -> Option<&Sample> {
    series.samples.iter().find(|sample| sample.necks_meet > NECKS_MEET)
}

fn record(input: &SceneInput, plan: ScenePlan, run: &Run) -> SceneRecord {
    let series = run.series();
    let phases = input
        .file
        .phases
        .iter()
        .enumerate()
        .filter_map(|(index, phase)| {
            let end = series.phase.iter().rposition(|&of| of == index)?;
            Some(PhaseRecord {
                name: phase.name.clone(),
                mode: match phase.mode {
                    Mode::Dynamic => "dynamic",
                    Mode::QuasiStatic => "quasi-static",
                },
                heated: phase.heated,
                start_s: *series.phase_start_s.get(index)?,
                end: State::from(&series.samples[end]),
            })
        })
        .collect();
    let (work, report) = (run.bed().work(), &series.quasi_static);
    SceneRecord {
        schema_version: SCHEMA_VERSION,
        plan,
        particles: run.bed().particles().len(),
        observations: series.samples.len(),
        heated_from_s: heated_from_s(series, &input.file.phases),
        phases,
        start: series.samples.first().map(State::from),
        end: series.samples.last().map(State::from),
        model_ends: model_ends(series).map(State::from),
        load_over_adhesion: run.bed().load_over_adhesion(),
        work: WorkRecord {
            steps: work.steps,
            neighbour_lists: work.rebuilds,
            quasi_static_steps: report.steps,
            quasi_static_rejected: report.rejected,
            newton_iterations: report.newton,
            conjugate_gradient_iterations: report.conjugate_gradients,
            quasi_static_error: report.error_estimate,
        },
        advice: advice(input, series),
    }
}

fn advice(input: &SceneInput, series: &Series) -> Vec<String> {
    let mut advice = Vec::new();
    let phases = &input.file.phases;
    // The first observation of a phase is of the contacts as they were placed.
    let inertial = series
        .samples
        .iter()
        .zip(&series.phase)
        .skip(1)
        .filter(|(_, phase)| phases[**phase].heated && phases[**phase].mode == Mode::Dynamic)
        .map(|(sample, _)| sample.inertial_number)
        .fold(0.0, f64::max);
    if inertial > INERTIA_FELT {
        advice.push(format!(
            "inertia is felt: the inertial number reaches {} in a heated phase, above {INERTIA_FELT}; mode = \
             \"quasi-static\" leaves it out",
            significant(inertial, 2)
        ));
    }
    if let Some(end) = model_ends(series) {
        advice.push(format!(
            "from t = {} s (a/R {}) necks meet on more than {} % of the particles: what follows is outside the model",
            significant(end.time_s, 3),
            significant(end.mean_contact_ratio, 3),
            100.0 * NECKS_MEET
        ));
    }
    advice
}

fn in_words(state: &State) -> String {
    let density = state
        .relative_density
        .map_or_else(String::new, |density| format!("density {}, ", significant(density, 4)));
    format!(
        "{density}coordination {}, a/R {} ({} .. {})",
        significant(state.coordination, 3),
        significant(state.mean_contact_ratio, 3),
        significant(state.contact_ratio_deciles[0], 3),
        significant(state.contact_ratio_deciles[2], 3),
    )
}

fn summary(record: &SceneRecord, seconds: f64, out: &Path) -> String {
    let mut lines = vec![format!(
        "{}: {} particles, {} observations, in {} s",
        record.plan.name,
        record.particles,
        record.observations,
        significant(seconds, 2)
    )];
    if let Some(start) = &record.start {
        lines.push(format!("  start         {}", in_words(start)));
    }
    for phase in &record.phases {
        lines.push(format!("  {:<13} {}", phase.name, in_words(&phase.end)));
        if phase.heated {
            lines.push(format!(
                "                driven by {} fa on average, {} at most, at t = {} s",
                significant(phase.end.mean_driving, 3),
                significant(phase.end.largest_driving, 3),
                significant(phase.end.time_s, 3)
            ));
        }
    }
    if let Some(load) = record.load_over_adhesion {
        lines.push(format!(
            "  load          {} fa on a particle at the bottom",
            significant(load, 2)
        ));
    }
    let work = &record.work;
    let mut took = Vec::new();
    if work.steps > 0 {
        took.push(format!("{} steps", work.steps));
    }
    if work.quasi_static_steps > 0 {
        took.push(format!(
            "{} quasi-static steps (a/R within about {})",
            work.quasi_static_steps,
            significant(work.quasi_static_error, 1)
        ));
    }
    lines.push(format!("  work          {}", took.join(", ")));
    for line in &record.advice {
        lines.push(format!("  careful: {line}"));
    }
    lines.push(format!("  results in {}", out.display()));
    lines.push(String::new());
    lines.join("\n")
}

/// The scene in words, for `--dry-run` and `check`.
#[must_use]
pub fn describe(input: &SceneInput) -> Vec<String> {
    let (file, outline) = (&input.file, &input.outline);
    let mut lines = vec![format!(
        "particles     {}, mean radius {} um",
        outline.particles,
        significant(1e6 * outline.mean_radius_m, 4)
    )];
    let material = &file.material;
    lines.push(format!(
        "material      E {} GPa, gamma {} mN/m, rho {} kg/m3, phi {}, K1 {} N/m",
        significant(1e-9 * material.youngs_modulus_pa, 3),
        significant(1e3 * material.surface_tension_n_per_m, 4),
        significant(material.density_kg_per_m3, 4),
        significant(material.final_contact_ratio, 4),
        significant(material.k1_n_per_m, 3)
    ));
    if let Some(table) = &file.sintering {
        lines.push(format!(
            "sintering     {}: C1 {} 1/(Pa s), tau_s {} s at R = {} um, delta_c {} m",
            table.kinetics,
            significant(table.c1, 4),
            significant(table.tau_s, 4),
            significant(1e6 * table.calibrated_radius_m, 4),
            significant(table.delta_c, 4)
        ));
    }
    let mut around = Vec::new();
    if let Some(region) = &file.region {
        around.push(format!(
            "box {:?}{}",
            region.sides,
            if region.free { ", free to shrink" } else { "" }
        ));
    }
    if let Some(gravity) = &file.gravity {
        around.push(format!("gravity {:?} m/s2", gravity.acceleration_m_per_s2));
    }
    if file.drag.is_some() {
        around.push("drag".to_owned());
    }
    if file.friction.is_some() {
        around.push("friction".to_owned());
    }
    if !around.is_empty() {
        lines.push(format!("around        {}", around.join(", ")));
    }
    for phase in &file.phases {
        lines.push(format!(
            "phase         {}: {} s, {}, {}, {} observations",
            phase.name,
            significant(phase.duration_s, 4),
            if phase.heated { "heated" } else { "not heated" },
            match phase.mode {
                Mode::Dynamic if phase.mass_scaling > 1.0 =>
                    format!("dynamic with masses times {}", significant(phase.mass_scaling, 4)),
                Mode::Dynamic => "dynamic".to_owned(),
                Mode::QuasiStatic => "quasi-static".to_owned(),
            },
            phase.outputs + 1
        ));
    }
    lines
}

fn dry_run(input: &SceneInput, plan: &ScenePlan, out: &Path, json: bool) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    if json {
        write!(stdout, "{}", pretty(plan)?)?;
        return Ok(());
    }
    writeln!(stdout, "scene: {}", plan.name)?;
    for line in describe(input) {
        writeln!(stdout, "  {line}")?;
    }
    writeln!(stdout, "  results to    {}", out.display())?;
    Ok(())
}
