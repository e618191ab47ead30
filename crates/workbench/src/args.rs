//! The command line as it is typed. What follows from it is checked elsewhere; nothing here opens a
//! file.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args as ArgsOf, Parser, Subcommand};
use clap_complete::Shell;
use dem_core::{Kinetics, SolverKind};
use smc_calib::{FixedSigma, Noise};

use crate::material::Material;
use figures::Width;

const AFTER_HELP: &str = "\
Examples:
  calibrate --material ps                       measured neck growth of polystyrene -> results/ps/
  calibrate --material pa12 --dry-run           say what would be done, and stop
  calibrate --material ps --experiment my.csv   own measurements of a built-in powder
  calibrate --experiment experiments/example-my-powder.toml --prior priors/example-my-powder.toml
                                                own powder, own measurements, own priors
  calibrate --plan experiments/external/impact.toml
                                                own simulation program, own measurements of any kind
  calibrate --resume results/impact             go on after an interruption
  calibrate inspect results/ps/posterior.json   print a posterior again
  calibrate plot results/ps --width full        draw its figures again
  calibrate compare --material ps               which kinetics do the data support?
  calibrate table3                              the paper's Table 3, all three materials

All quantities are SI. Exit codes: 0 done, 1 the run failed, 2 a mistake in what was given,
130 interrupted.";

/// What `calibrate` alone prints.
pub const SHORT_HELP: &str = "\
Posteriors of sintering parameters from measured neck growth.

  calibrate --material ps        calibrate polystyrene and write results/ps/
  calibrate --help               everything else

Built-in materials: ps, pa12, peek.";

/// Posteriors of sintering parameters (C1, tau_s, delta_c) from the measured neck growth of two
/// particles
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(
    name = "calibrate",
    version,
    override_usage = "calibrate --material <NAME> [OPTIONS]\n       calibrate --experiment <FILE> [--prior <FILE>] [OPTIONS]\n       calibrate --plan <FILE> [OPTIONS]\n       calibrate --resume <DIR>\n       calibrate <COMMAND>",
    after_help = AFTER_HELP,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    disable_help_subcommand = true,
    infer_subcommands = false,
    max_term_width = 100
)]
pub struct Args {
    /// A command other than the main job.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The main job.
    #[command(flatten)]
    pub run: RunArgs,
}

impl Args {
    /// Whether nothing was asked for.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let run = &self.run;
        let asked = run.material.is_some() || run.experiment.is_some();
        self.command.is_none() && !asked && run.plan.is_none() && run.resume.is_none()
    }
}

/// The commands beside the main job.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Command {
    /// Compute one neck growth curve, without calibrating anything
    Simulate(SimulateArgs),
    /// Print the posterior of a run that was saved
    Inspect(InspectArgs),
    /// Draw the figures of a saved run again, without simulating anything
    Plot(PlotArgs),
    /// Compare the five kinetics on measured data: evidence, errors, prediction of left-out points
    Compare(CompareArgs),
    /// Regenerate Table 3 of the paper: calibrate PS, PA12 and PEEK 450PF and report
    Table3(Table3Args),
    /// Read experiment, prior or posterior files and say what is wrong with them, without running
    Check(CheckArgs),
    /// Predict sintering times of a pair from a saved posterior, with their intervals
    Predict(PredictArgs),
    /// Run a powder bed for draws of a posterior: density over time, time to a target density
    Densify(crate::densify::DensifyArgs),
    /// Run a scene of many particles: series, pictures, VTK files
    Scene(crate::scene_command::SceneArgs),
    /// Check the sampler by simulation-based calibration: made data, ranks, coverage
    Validate(crate::validation::ValidateArgs),
    /// Say how far the run of a plan is: done, running, failed by cause, time left
    Status(StatusArgs),
    /// Write what the run of a plan has so far as tables, also while it runs
    Export(ExportArgs),
    /// Make given runs of a plan; what a job on a cluster calls
    #[command(hide = true)]
    RunTask(RunTaskArgs),
    /// Print the completion script for a shell
    Completions(CompletionsArgs),
}

/// The main job: calibrate one material.
#[derive(Debug, Clone, PartialEq, ArgsOf)]
pub struct RunArgs {
    /// Built-in material: its powder, measurements and priors
    #[arg(short, long, value_name = "NAME", value_parser = material_parser(), help_heading = "What to calibrate")]
    pub material: Option<Material>,

    /// Own measurements: a description (.toml), a bare table (.csv; needs --material), or the name of
    /// a built-in experiment [default: the material's]
    #[arg(short, long, value_name = "FILE", help_heading = "What to calibrate")]
    pub experiment: Option<PathBuf>,

    /// Own priors (.toml) [default: the material's]
    #[arg(short, long, value_name = "FILE", help_heading = "What to calibrate")]
    pub prior: Option<PathBuf>,

    /// Calibrate any simulator, as a plan file (.toml or .json) says: parameters, experiments, commands,
    /// executor; see crates/workbench/docs/plan-files.md
    #[arg(long, value_name = "FILE", conflicts_with_all = NOT_WITH_A_PLAN, help_heading = "What to calibrate")]
    pub plan: Option<PathBuf>,

    /// Go on with a run of a plan that was interrupted, from its folder; nothing that finished is run again
    #[arg(long, value_name = "DIR", conflicts_with_all = NOT_WITH_A_PLAN, conflicts_with_all = ["out", "dry_run"], help_heading = "What to calibrate")]
    pub resume: Option<PathBuf>,

    /// Fit only the observations from T0 to T1, in seconds; either may be left out, as in 0.5:
    /// [default: all]
    #[arg(long, value_name = "T0:T1", value_parser = parse_window, allow_hyphen_values = true, help_heading = "What to calibrate")]
    pub window: Option<[f64; 2]>,

    /// How the neck grows
    #[arg(long, value_name = "NAME", default_value = "three-stage", value_parser = kinetics_parser(), help_heading = "Model")]
    pub kinetics: Kinetics,

    /// How the curve is computed; auto takes the cheapest solver within --tolerance
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = solver_parser(), help_heading = "Model")]
    pub solver: SolverArg,

    /// Largest error of a/R allowed to the solver
    #[arg(long, value_name = "A/R", default_value = "1e-4", value_parser = parse_tolerance, help_heading = "Model")]
    pub tolerance: f64,

    /// How measurements scatter: inferred, inferred:NU0,S0, fixed:SIGMA, fixed:table (the column
    /// sigma), fixed-relative:SHARE of the value, ess-target:SHARE (GrainLearning's tuning; the result
    /// is not a posterior). inferred stands for inferred:4,0.05
    #[arg(long, value_name = "MODEL", default_value = "inferred", value_parser = parse_noise, help_heading = "Model")]
    pub noise: Noise,

    /// Simulations in total
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = parse_samples, help_heading = "Sampling")]
    pub samples: usize,

    /// Adaptive stages, over which the proposal is refined [default: 8; up to 1000 simulations 20
    /// small ones, placed by a Gaussian process]
    #[arg(long, value_name = "N", value_parser = parse_iterations, help_heading = "Sampling")]
    pub iterations: Option<usize>,

    /// Stop refining early once the effective sample size reaches N [default: use all samples]
    #[arg(long, value_name = "N", value_parser = parse_ess, help_heading = "Sampling")]
    pub ess: Option<f64>,

    /// Seed of the random numbers; the same seed gives the same bits, for any number of threads
    #[arg(short, long, value_name = "N", default_value_t = 1, help_heading = "Sampling")]
    pub seed: u64,

    /// Threads [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = parse_threads, help_heading = "Sampling")]
    pub threads: Option<usize>,

    /// Folder for the results [default: results/NAME of the material or experiment]
    #[arg(short, long, value_name = "DIR", help_heading = "Output")]
    pub out: Option<PathBuf>,

    /// What Ctrl-C does to jobs on a cluster: detach leaves them running for --resume, cancel ends them.
    /// Runs on this machine are ended in any case
    #[arg(long, value_name = "WHAT", default_value = "detach", value_parser = on_interrupt_parser(), help_heading = "Output")]
    pub on_interrupt: OnInterrupt,

    /// Print the plan and stop: what would be read, run and written
    #[arg(long, help_heading = "Output")]
    pub dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long, help_heading = "Output")]
    pub quiet: bool,

    /// Print the summary (or with --dry-run the plan) as JSON
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    /// Hold the posterior against quadrature afterwards, and fail where they differ
    #[arg(long, help_heading = "Output")]
    pub verify: bool,
}

/// Options that a plan file says itself.
const NOT_WITH_A_PLAN: [&str; 13] = [
    "material",
    "experiment",
    "prior",
    "window",
    "kinetics",
    "solver",
    "tolerance",
    "noise",
    "samples",
    "iterations",
    "ess",
    "seed",
    "verify",
];

/// What Ctrl-C does to jobs on a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum OnInterrupt {
    /// They run on.
    #[default]
    Detach,
    /// They are ended.
    Cancel,
}

impl Default for RunArgs {
    /// The documented defaults, with nothing to calibrate yet.
    fn default() -> Self {
        Args::try_parse_from(["calibrate"]).map(|args| args.run).expect(
            "every option of the main job has a default or may be left out, as a test holds",
        )
    }
}

const SIMULATE_EXAMPLES: &str = "\
Examples:
  calibrate simulate --material pa12 --table3
  calibrate simulate --material pa12 --c1 1.2e-5 --tau-s 3.8 --delta-c 9.5e-8 --t-end 10 --points 50
  calibrate simulate --material ps --table3 --solver verlet --from-contact --out ps.csv

The curve goes to standard output (or --out) as CSV: time_s, overlap_m, plastic_overlap_m, contact_ratio.
Which solver ran and why, and what happens when, goes to standard error.";

/// One curve.
#[derive(Debug, Clone, PartialEq, ArgsOf)]
#[command(after_help = SIMULATE_EXAMPLES)]
pub struct SimulateArgs {
    /// Built-in material: its powder, final contact ratio and observation times
    #[arg(short, long, value_name = "NAME", value_parser = material_parser(), help_heading = "Particles")]
    pub material: Option<Material>,

    /// Take powder, final contact ratio and times from a description (.toml) or a built-in experiment
    #[arg(short, long, value_name = "FILE", help_heading = "Particles")]
    pub experiment: Option<PathBuf>,

    /// Final contact ratio a/R, where coalescence stops [default: the experiment's]
    #[arg(long, value_name = "A/R", value_parser = parse_phi, allow_negative_numbers = true, help_heading = "Particles")]
    pub phi: Option<f64>,

    /// Fluidity C1, in 1/(Pa s)
    #[arg(long, value_name = "C1", value_parser = parse_positive, allow_negative_numbers = true, help_heading = "Sintering")]
    pub c1: Option<f64>,

    /// Sintering time tau_s, in s
    #[arg(long, value_name = "S", value_parser = parse_positive, allow_negative_numbers = true, help_heading = "Sintering")]
    pub tau_s: Option<f64>,

    /// Cut-off distance of the adhesive traction delta_c, in m
    #[arg(long, value_name = "M", value_parser = parse_positive, allow_negative_numbers = true, help_heading = "Sintering")]
    pub delta_c: Option<f64>,

    /// Take C1, tau_s and delta_c from Table 3 of the paper, converted to SI
    #[arg(long, conflicts_with_all = ["c1", "tau_s", "delta_c"], help_heading = "Sintering")]
    pub table3: bool,

    /// How the neck grows
    #[arg(long, value_name = "NAME", default_value = "three-stage", value_parser = kinetics_parser(), help_heading = "Model")]
    pub kinetics: Kinetics,

    /// How the curve is computed; auto takes the cheapest solver within --tolerance
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = solver_parser(), help_heading = "Model")]
    pub solver: SolverArg,

    /// Largest error of a/R allowed to the solver
    #[arg(long, value_name = "A/R", default_value = "1e-4", value_parser = parse_tolerance, help_heading = "Model")]
    pub tolerance: f64,

    /// Time step of verlet over the collision time [default: 0.02]
    #[arg(long, value_name = "DT/TC", value_parser = parse_positive, allow_negative_numbers = true, help_heading = "Model")]
    pub step: Option<f64>,

    /// Let verlet start at first contact, as the paper's runs did, instead of in adhesive equilibrium
    #[arg(long, help_heading = "Model")]
    pub from_contact: bool,

    /// Times of the curve: a CSV file with a column time_s
    #[arg(long, value_name = "FILE", conflicts_with_all = ["t_end", "points"], help_heading = "Times")]
    pub times: Option<PathBuf>,

    /// Last time of the curve, in s [default: the last observation's]
    #[arg(long, value_name = "S", value_parser = parse_positive, allow_negative_numbers = true, help_heading = "Times")]
    pub t_end: Option<f64>,

    /// Points of the curve, evenly spaced from 0
    #[arg(long, value_name = "N", default_value_t = 201, value_parser = parse_points, help_heading = "Times")]
    pub points: usize,

    /// Write the curve to a file [default: standard output]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub out: Option<PathBuf>,

    /// Write JSON, with what happens when, instead of CSV
    #[arg(long, help_heading = "Output")]
    pub json: bool,

    /// Say nothing but errors on standard error
    #[arg(short, long, help_heading = "Output")]
    pub quiet: bool,
}

/// A saved run.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct InspectArgs {
    /// A posterior.json, or the folder it is in
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
}

/// The run of a plan.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct StatusArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,

    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

const EXPORT_NOTES: &str = "\
Writes samples.csv (every sample so far: parameters, state, log likelihood, its weight where its stage is
complete, simulated values), runs.csv (every run: state, cause, attempts, seconds) and
samples-grainlearning.txt (the parameter sets as GrainLearning and yade-batch read them).";

/// Tables of a run.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
#[command(after_help = EXPORT_NOTES)]
pub struct ExportArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,

    /// Folder for the tables [default: export in the folder of the run]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Runs to make.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct RunTaskArgs {
    /// Folder of the run
    #[arg(value_name = "DIR")]
    pub dir: PathBuf,

    /// Numbers of the runs, as in 1-20,33
    #[arg(long, value_name = "LIST")]
    pub tasks: String,
}

const PREDICT_EXAMPLES: &str = "\
Examples:
  calibrate predict --posterior results/pa12 --contact-ratio 0.9
  calibrate predict --posterior results/pa12 --coalescence 60 --coalescence 100
  calibrate predict --posterior results/pa12 --after 1,2,5 --radius-m 25e-6";

/// What to predict from a saved posterior.
#[derive(Debug, Clone, PartialEq, ArgsOf)]
#[command(after_help = PREDICT_EXAMPLES)]
pub struct PredictArgs {
    /// A posterior.json, or the folder it is in; draws.csv must be beside it
    #[arg(short, long, value_name = "FILE")]
    pub posterior: PathBuf,

    /// When is this contact ratio a/R reached?
    #[arg(short, long, value_name = "A/R", value_delimiter = ',', value_parser = parse_target, allow_negative_numbers = true)]
    pub contact_ratio: Vec<f64>,

    /// When is this much coalescence reached, in percent of a/R = 1?
    #[arg(long, value_name = "PERCENT", value_delimiter = ',', value_parser = parse_percent, allow_negative_numbers = true)]
    pub coalescence: Vec<f64>,

    /// What is a/R after this time in seconds?
    #[arg(short, long, value_name = "S", value_delimiter = ',', value_parser = parse_positive, allow_negative_numbers = true)]
    pub after: Vec<f64>,

    /// Radius of the pair in metres [default: the one that was calibrated]; tau_s moves in proportion
    #[arg(short, long, value_name = "M", value_parser = parse_positive, allow_negative_numbers = true)]
    pub radius_m: Option<f64>,

    /// Write the predictions as CSV too
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,

    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

const PLOT_EXAMPLES: &str = "\
Examples:
  calibrate plot results/ps
  calibrate plot results/ps/posterior.json --log-time --width full --out figures

Draws fit, corner, recursion, convergence and residuals (.png and .svg) from posterior.json and samples.csv.
Without options they are the files of the run itself, byte for byte.";

/// Figures of a saved run.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
#[command(after_help = PLOT_EXAMPLES)]
pub struct PlotArgs {
    /// A posterior.json, or the folder it is in; samples.csv must be beside it
    #[arg(value_name = "FILE")]
    pub file: PathBuf,

    /// Logarithmic time axes, for stages that span decades
    #[arg(long)]
    pub log_time: bool,

    /// Printed width: column is 85 mm, full is 170 mm
    #[arg(long, value_name = "WIDTH", default_value = "column", value_parser = width_parser())]
    pub width: Width,

    /// Folder for the figures [default: the folder of the run]
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,

    /// Say nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

const COMPARE_EXAMPLES: &str = "\
Examples:
  calibrate compare                             all three built-in materials
  calibrate compare --material ps --phi         with the final contact ratio as a fourth parameter
  calibrate compare --experiment experiments/example-my-powder.toml --prior priors/example-my-powder.toml

The priors are those of the materials, the same for every kinetics that has the parameter.";

/// A comparison of kinetics.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
#[command(after_help = COMPARE_EXAMPLES)]
pub struct CompareArgs {
    /// Built-in material [default: all three]
    #[arg(short, long, value_name = "NAME", value_parser = material_parser())]
    pub material: Option<Material>,

    /// Own measurements: a description (.toml), a bare table (.csv; needs --material), or the name of
    /// a built-in experiment
    #[arg(short, long, value_name = "FILE")]
    pub experiment: Option<PathBuf>,

    /// Own priors (.toml) [default: the material's]
    #[arg(short, long, value_name = "FILE", requires = "experiment")]
    pub prior: Option<PathBuf>,

    /// Calibrate the final contact ratio phi too, uniform from 1.0 to 1.35 for every kinetics
    #[arg(long)]
    pub phi: bool,

    /// Simulations per calibration
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = parse_samples)]
    pub samples: usize,

    /// Seed of the random numbers
    #[arg(short, long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Threads [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,

    /// Logarithmic time axis in the figures
    #[arg(long)]
    pub log_time: bool,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/compare")]
    pub out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,

    /// Print the comparison as JSON
    #[arg(long)]
    pub json: bool,
}

const TABLE3_NOTES: &str = "\
Writes table3.md, .csv, .json and .tex (the table), report.md (errors, statements of the paper, the check that
was not fitted, how the table is read), and Figures 2, 4, 5 and 6 of the paper. The same seed gives the same bytes.";

/// The paper's Table 3.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
#[command(after_help = TABLE3_NOTES)]
pub struct Table3Args {
    /// Simulations per calibration
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = parse_samples)]
    pub samples: usize,

    /// Seed of the random numbers
    #[arg(short, long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Threads [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = parse_threads)]
    pub threads: Option<usize>,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/table3")]
    pub out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Files to validate.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct CheckArgs {
    /// Descriptions, priors and plans (.toml), observation tables (.csv), posteriors (.json)
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,

    /// Say nothing about files that are right
    #[arg(short, long)]
    pub quiet: bool,
}

/// Shell completions.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// A solver, or the choice left to the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SolverArg {
    /// The cheapest within the tolerance.
    #[default]
    Auto,
    /// This one.
    Forced(SolverKind),
}

/// Parses the name of a built-in material.
pub fn material_parser() -> impl TypedValueParser<Value = Material> {
    PossibleValuesParser::new(Material::NAMES)
        .try_map(|name| Material::from_name(&name).ok_or("unknown material"))
}

fn width_parser() -> impl TypedValueParser<Value = Width> {
    PossibleValuesParser::new(["column", "full"]).map(|name| match name.as_str() {
        "full" => Width::Full,
        _ => Width::Column,
    })
}

fn on_interrupt_parser() -> impl TypedValueParser<Value = OnInterrupt> {
    PossibleValuesParser::new(["detach", "cancel"]).map(|name| match name.as_str() {
        "cancel" => OnInterrupt::Cancel,
        _ => OnInterrupt::Detach,
    })
}

fn kinetics_parser() -> impl TypedValueParser<Value = Kinetics> {
    PossibleValuesParser::new(Kinetics::ALL.map(Kinetics::name))
        .try_map(|name| Kinetics::from_str(&name))
}

fn solver_parser() -> impl TypedValueParser<Value = SolverArg> {
    let names = std::iter::once("auto").chain(SolverKind::ALL.map(SolverKind::name));
    PossibleValuesParser::new(names.collect::<Vec<_>>()).try_map(|name| {
        if name == "auto" {
            Ok(SolverArg::Auto)
        } else {
            SolverKind::from_str(&name).map(SolverArg::Forced)
        }
    })
}

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err("expected a finite number".to_owned()),
        Err(_) if text.contains(',') => {
            Err(format!("write decimals with a point: {}", text.replace(',', ".")))
        }
        Err(_) => Err("expected a number, as in 1.5e-3, without unit".to_owned()),
    }
}

fn parse_positive(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 { Ok(value) } else { Err("expected a number > 0".to_owned()) }
}

pub(crate) fn parse_target(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 && value <= crate::observation_table::LARGEST_CONTACT_RATIO {
        Ok(value)
    } else {
        Err("expected a contact ratio above 0, at most 2".to_owned())
    }
}

fn parse_percent(text: &str) -> Result<f64, String> {
    let value = number(text.trim_end_matches('%'))?;
    parse_target(&(value / 100.0).to_string())
        .map(|_| value)
        .map_err(|_| "expected percent of a/R = 1, above 0, at most 200".to_owned())
}

fn parse_phi(text: &str) -> Result<f64, String> {
    crate::experiment::checked_phi(number(text)?)
        .map_err(|(expected, help)| format!("expected {expected}; {help}"))
}

fn parse_tolerance(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if (1e-12..=0.1).contains(&value) {
        Ok(value)
    } else {
        Err("expected an error of a/R between 1e-12 and 0.1".to_owned())
    }
}

fn count(text: &str, range: std::ops::RangeInclusive<usize>) -> Result<usize, String> {
    let plain = text.replace('_', "");
    let value = plain.parse::<usize>().ok().or_else(|| {
        // 1e5 is how people write large numbers.
        let value = plain.parse::<f64>().ok()?;
        (value.fract() == 0.0 && (0.0..9e15).contains(&value)).then_some(value as usize)
    });
    match value {
        Some(value) if range.contains(&value) => Ok(value),
        _ => Err(format!("expected a whole number from {} to {}", range.start(), range.end())),
    }
}

/// At least two sub-nets of eight points each: with fewer there is no standard error to report.
pub fn parse_samples(text: &str) -> Result<usize, String> {
    count(text, 16..=100_000_000)
}

fn parse_iterations(text: &str) -> Result<usize, String> {
    count(text, 1..=1000)
}

fn parse_threads(text: &str) -> Result<usize, String> {
    count(text, 1..=1024)
}

fn parse_points(text: &str) -> Result<usize, String> {
    count(text, 2..=1_000_000)
}

fn parse_ess(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value >= 1.0 { Ok(value) } else { Err("expected a number of at least 1".to_owned()) }
}

/// A window `T0:T1` \[s\]; an end that is left out is infinite.
fn parse_window(text: &str) -> Result<[f64; 2], String> {
    let Some((start, end)) = text.split_once(':') else {
        return Err("expected two times with a colon between, as in 0.0:1.5".to_owned());
    };
    let bound = |text: &str, open: f64| match text.trim() {
        "" => Ok(open),
        text => number(text),
    };
    let window = [bound(start, 0.0)?, bound(end, f64::INFINITY)?];
    if window[0] < window[1] {
        Ok(window)
    } else {
        Err(match window[0] > window[1] {
            true => format!("expected a start before its end; did you mean {end}:{start}?"),
            false => "expected a start before its end, as in 0.0:1.5".to_owned(),
        })
    }
}

/// A noise model as typed.
fn parse_noise(text: &str) -> Result<Noise, String> {
    let (kind, value) = match text.split_once(':') {
        Some((kind, value)) => (kind.trim(), Some(value.trim())),
        None => (text.trim(), None),
    };
    let share = |value: &str| {
        let share = parse_positive(value)?;
        if share < 1.0 { Ok(share) } else { Err("expected a share between 0 and 1".to_owned()) }
    };
    match (kind, value) {
        ("inferred", None) => Ok(Noise::default()),
        ("inferred", Some(value)) => {
            let (nu0, s0) =
                value.split_once(',').ok_or("expected inferred:NU0,S0, as in inferred:4,0.05")?;
            Ok(Noise::Inferred { nu0: parse_positive(nu0)?, s0: parse_positive(s0)? })
        }
        ("fixed", Some("table")) => Ok(Noise::Fixed { sigma: FixedSigma::PerPoint }),
        ("fixed", Some(value)) => {
            Ok(Noise::Fixed { sigma: FixedSigma::Absolute(parse_positive(value)?) })
        }
        ("fixed-relative", Some(value)) => {
            Ok(Noise::Fixed { sigma: FixedSigma::Relative(parse_positive(value)?) })
        }
        ("ess-target", Some(value)) => Ok(Noise::EssTarget { share: share(value)? }),
        ("fixed", None) => Err("expected a standard deviation of a/R, as in fixed:0.03".to_owned()),
        ("fixed-relative", None) => {
            Err("expected a share of the value, as in fixed-relative:0.05".to_owned())
        }
        ("ess-target", None) => {
            Err("expected a share of the samples, as in ess-target:0.2".to_owned())
        }
        _ => {
            let kinds = ["inferred", "fixed", "fixed-relative", "ess-target"];
            Err(match crate::error::nearest(kind, kinds) {
                Some(near) => format!("unknown noise model; did you mean {near}?"),
                None => format!("unknown noise model; use one of {}", kinds.join(", ")),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn parse(line: &str) -> Result<Args, clap::Error> {
        Args::try_parse_from(std::iter::once("calibrate").chain(line.split_whitespace()))
    }

    fn refused(line: &str) -> String {
        let error = parse(line).expect_err(line);
        assert_eq!(error.exit_code(), 2, "{line}");
        error.to_string()
    }

    #[test]
    fn the_command_line_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn the_main_job_needs_a_material_and_has_the_documented_defaults() {
        let args = parse("--material ps").expect("valid");
        assert_eq!(args.command, None);
        let run = args.run;
        assert_eq!(run.material, Some(Material::Ps));
        assert_eq!((run.samples, run.iterations, run.tolerance), (16_384, None, 1e-4));
        assert_eq!((run.kinetics, run.solver), (Kinetics::ThreeStage, SolverArg::Auto));
        assert_eq!(run.noise, Noise::Inferred { nu0: 4.0, s0: 0.05 });
        assert_eq!((run.window, run.ess, run.threads, run.out), (None, None, None, None));
        assert!(parse("").expect("nothing").is_empty());
    }

    #[test]
    fn noise_models_are_read_as_typed() {
        let noise = |text: &str| parse_noise(text);
        let fixed = |sigma| Ok(Noise::Fixed { sigma });
        assert_eq!(noise("inferred:6,0.02"), Ok(Noise::Inferred { nu0: 6.0, s0: 0.02 }));
        assert_eq!(noise("fixed:0.03"), fixed(FixedSigma::Absolute(0.03)));
        assert_eq!(noise("fixed:table"), fixed(FixedSigma::PerPoint));
        assert_eq!(noise("fixed-relative:0.05"), fixed(FixedSigma::Relative(0.05)));
        assert_eq!(noise("ess-target:0.2"), Ok(Noise::EssTarget { share: 0.2 }));
        for wrong in
            ["fixed", "fixed:", "fixed:-1", "fixed:nan", "ess-target:2", "infered", "", ":"]
        {
            assert!(noise(wrong).is_err(), "{wrong}");
        }
        assert!(noise("infered").expect_err("misspelt").contains("mean inferred?"));
    }

    #[test]
    fn windows_may_be_open_and_never_backwards() {
        assert_eq!(parse_window("0.5:2"), Ok([0.5, 2.0]));
        assert_eq!(parse_window("0.5:"), Ok([0.5, f64::INFINITY]));
        assert_eq!(parse_window(":2"), Ok([0.0, 2.0]));
        assert!(parse_window("2:1").expect_err("backwards").contains("mean 1:2?"));
        assert!(!parse_window("0:0").expect_err("empty").contains("mean"));
        for wrong in ["", "1", "a:b", "nan:1", "1:1", "1-2"] {
            assert!(parse_window(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn mistakes_on_the_command_line_exit_2_and_offer_a_remedy() {
        assert!(refused("--material pekk").contains("peek"));
        assert!(refused("--material ps --kinetics frenkle").contains("frenkel"));
        assert!(refused("--material ps --solver verlett").contains("verlet"));
        assert!(refused("--materiel ps").contains("--material"));
        assert!(refused("--material ps --samples 0").contains("from 16 to"));
        assert!(refused("--material ps --samples 1.5").contains("whole number"));
        assert!(refused("--material ps --tolerance 0").contains("1e-12"));
        assert!(refused("--material ps --window 2:1").contains("1:2"));
        assert!(refused("--material ps --resume").contains("--resume"));
        assert!(refused("simulate --material ps --tau-s -1").contains("> 0"));
        assert!(refused("simulate --material ps --tau-s 1,5").contains("1.5"));
        assert!(refused("simulate --table3 --c1 1").contains("--c1"));
        assert!(refused("check").contains("FILE"));
        assert_eq!(parse("--material ps --samples 1e5").expect("1e5").run.samples, 100_000);
    }
}
