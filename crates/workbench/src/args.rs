//! The command line as it is typed. What follows from it is checked elsewhere; nothing here opens a
//! file.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args as ArgsOf, Parser};
use dem_core::{Kinetics, SolverKind};
use smc_calib::{FixedSigma, Noise};

use crate::material::Material;
use figures::Width;

/// The main job alone.
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(name = "calibrate")]
pub struct Args {
    /// The main job.
    #[command(flatten)]
    pub run: RunArgs,
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
