//! `calibrate compare`: which kinetics the data support, under which noise; or which of several explanations.

use std::path::PathBuf;

use workbench::compare::explanations::{self, RankedExplanations};
use workbench::compare::{Compared, RECORD, default_noises, render};
use workbench::error::Failure;
use workbench::input::material::Material;
use workbench::output::{RunFolder, pool, pretty};
use workbench::plan::{PairOptions, Planned};

use crate::arguments::{self, NoiseList};
use crate::terminal::{OnInterrupt, Terminal};

const EXAMPLES: &str = "\
Examples:
  calibrate compare
      all three built-in materials
  calibrate compare --material ps --phi
      with the final contact ratio as a fourth parameter
  calibrate compare --material pa12 --noise inferred,correlated:linear
  calibrate compare --experiment experiments/example-my-powder.toml \\
      --prior priors/example-my-powder.toml
  calibrate compare results/ps-phi results/ps-r30-pulse
      two explanations of one table, as finished runs
  calibrate compare --plan experiments/heat/ps-radii.toml
      radii that share tau_s and cooling time by a law of R, or have their own

Runs must be of the same measurements under the same noise model; they may differ in kinetics, heat, priors, and in what \
experiments share. The priors are those of the materials, the same for every kinetics that has the parameter. \
calibrate predict --average DIR predicts with the average of all models by their evidence.";

/// A comparison of kinetics and noise models.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct CompareArgs {
    /// Finished calibrations of the same measurements to rank instead: folders, or their posterior.json, two or more
    #[arg(value_name = "RUN", conflicts_with_all = ["plan", "material", "experiment", "prior", "noise", "phi", "samples", "seed"])]
    runs: Vec<PathBuf>,

    /// A plan of pairs of several radii, calibrated as it stands and with tau_s and the cooling time of one's own for each
    /// radius
    #[arg(long, value_name = "FILE", conflicts_with_all = ["material", "experiment", "prior", "noise", "phi", "samples", "seed"])]
    plan: Option<PathBuf>,

    /// Built-in material [default: all three]
    #[arg(short, long, value_name = "NAME", value_parser = arguments::material())]
    material: Option<Material>,

    /// Own measurements: a description (.toml), a bare table (.csv; needs --material), or the name of
    /// a built-in experiment
    #[arg(short, long, value_name = "FILE")]
    experiment: Option<PathBuf>,

    /// Own priors (.toml) [default: the material's]
    #[arg(short, long, value_name = "FILE", requires = "experiment")]
    prior: Option<PathBuf>,

    /// Noise models, separated by commas, each as for a calibration [default: inferred,correlated,robust]
    #[arg(long, value_name = "LIST", value_parser = arguments::noises)]
    noise: Option<NoiseList>,

    /// Calibrate the final contact ratio phi too, uniform from 1.0 to 1.35 for every kinetics
    #[arg(long)]
    phi: bool,

    /// Simulations per calibration, from 16 to 100000000
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = arguments::samples, allow_negative_numbers = true)]
    samples: usize,

    /// Seed of the random numbers, from 0 to 18446744073709551615
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true)]
    seed: u64,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Logarithmic time axis in the figures [default: where half of what is measured changes within the first tenth of the
    /// time]
    #[arg(long)]
    log_time: bool,

    /// Linear time axes, also where the measurements change early
    #[arg(long, conflicts_with = "log_time")]
    linear_time: bool,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/compare")]
    out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the comparison as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &CompareArgs) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, RECORD)?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    if args.plan.is_some() || !args.runs.is_empty() {
        return rank(args, &folder, &terminal);
    }
    let options = PairOptions {
        material: args.material,
        experiment: args.experiment.clone(),
        prior: args.prior.clone(),
        samples: args.samples,
        seed: args.seed,
        ..PairOptions::default()
    };
    let noises = args.noise.clone().unwrap_or_else(default_noises);
    let (compared, published) = pool(args.threads)?.install(|| {
        let compared = Compared::new(
            &options,
            &noises,
            args.phi,
            arguments::time_scale(args.log_time, args.linear_time),
            &terminal,
        )?;
        let published = compared.publish(&folder)?;
        Ok::<_, Failure>((compared, published))
    })?;
    terminal.announce(&published, &args.out);
    let all = &compared.report.comparisons;
    let warnings =
        all.iter().flat_map(|one| one.warnings.iter().map(|line| format!("{}: {line}", one.name)));
    terminal.advise(&warnings.collect::<Vec<_>>());
    let text = || {
        let comparisons: String =
            compared.report.comparisons.iter().map(render::terminal).collect();
        let out = args.out.display();
        format!(
            "{comparisons}files: {out}/ (compare.md, compare.csv, compare.json, models-*.json, compare-*.png, .svg)\n"
        )
    };
    terminal.print_result(args.json, || pretty(&compared.report), text)
}

/// Ranks finished runs, or the variants of a plan.
fn rank(args: &CompareArgs, folder: &RunFolder, terminal: &Terminal) -> Result<(), Failure> {
    let scale = arguments::time_scale(args.log_time, args.linear_time);
    let (ranked, published) = pool(args.threads)?.install(|| {
        let ranked = match &args.plan {
            Some(plan) => RankedExplanations::of_plan(&Planned::read(plan)?, scale, terminal)?,
            None => RankedExplanations::of_runs(&args.runs, scale)?,
        };
        let published = ranked.publish(folder)?;
        Ok::<_, Failure>((ranked, published))
    })?;
    terminal.announce(&published, &args.out);
    terminal.advise(&ranked.report.ranked().warnings);
    let text = || {
        let out = args.out.display();
        format!(
            "{}files: {out}/ (report.html, compare.md, compare.csv, compare.json, compare-*.png, .svg)\n",
            explanations::text(&ranked.report)
        )
    };
    terminal.print_result(args.json, || pretty(&ranked.report), text)
}
