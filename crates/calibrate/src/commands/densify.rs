//! `calibrate densify`: a powder bed for the draws of a posterior.

use std::path::PathBuf;

use workbench::densify::{DensifyJob, DensifyOptions, Target};
use workbench::error::Failure;
use workbench::output::{pool, pretty};
use workbench::watch::Watch as _;

use crate::arguments;
use crate::terminal::{self, OnInterrupt, Terminal};

const EXAMPLES: &str = "\
Examples:
  calibrate densify --posterior results/pa12 \\
      --scene experiments/scenes/packing-200.toml
  calibrate densify --posterior results/pa12 --scene my-bed.toml \\
      --draws 100 --target 0.85
  calibrate densify --posterior results/pa12 --contact-ratio 0.9 \\
      --scene experiments/scenes/pair.toml
  calibrate densify --posterior results/ps-power --of e29 \\
      --pulse-energy 25 --scene experiments/scenes/ps-pulse.toml

Takes draws of the posterior, evenly spread over the sintering time of their pair, runs the scene with the parameters of each, \
and writes densify.json (all of it), densify.csv (bands over time), draws.csv (a row per draw), series/ (the bed of each draw) \
and the fan chart densify.png and .svg. Finished draws are kept: the same command goes on with the others after an \
interruption, and another target is read from the same beds. Under a heat that ends, the summary says where the bed freezes.";

/// A powder bed for draws of a posterior.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct DensifyArgs {
    /// A posterior.json, or the folder it is in; draws.csv must be beside it
    #[arg(short, long, value_name = "FILE")]
    posterior: PathBuf,

    /// A scene (.toml or .json) with a heated phase; its kinetics must be the posterior's, its sintering
    /// parameters are replaced by those of each draw
    #[arg(short, long, value_name = "FILE")]
    scene: PathBuf,

    /// The experiment of a posterior of several
    #[arg(long, value_name = "NAME")]
    of: Option<String>,

    /// Under this heat: a file with a heat section, or an experiment's description. What it leaves open is taken from the posterior
    /// [default: the scene's, or else the one that was calibrated with]
    #[arg(long, value_name = "FILE")]
    heat: Option<PathBuf>,

    /// Under a pulse of this energy, from 1e-12 to 1e12 in the unit of the calibrated ones
    #[arg(long, value_name = "E", value_parser = arguments::pulse_energy, allow_negative_numbers = true)]
    pulse_energy: Option<f64>,

    /// Draws of the posterior, from 2 to 100000
    #[arg(short = 'n', long, value_name = "N", default_value_t = 50, value_parser = arguments::draws, allow_negative_numbers = true)]
    draws: usize,

    /// When is this relative density reached? Above 0, at most 1 [default: 0.9]
    #[arg(short, long, value_name = "DENSITY", value_parser = arguments::density, allow_negative_numbers = true)]
    target: Option<f64>,

    /// When is this mean contact ratio a/R reached? Above 0, at most 2. For beds without a volume, as the pair
    #[arg(short, long, value_name = "A/R", value_parser = arguments::contact_ratio, conflicts_with = "target", allow_negative_numbers = true)]
    contact_ratio: Option<f64>,

    /// Seed of the choice of draws, from 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true)]
    seed: u64,

    /// Threads, from 1 to 1024, each of which computes one bed at a time [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Folder for the results [default: results/SCENE-POSTERIOR]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Check everything, print what would be done, and stop
    #[arg(long)]
    dry_run: bool,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &DensifyArgs) -> Result<(), Failure> {
    let contact_ratio = args.contact_ratio.map(Target::ContactRatio);
    let job = DensifyJob::read(&DensifyOptions {
        posterior: args.posterior.clone(),
        scene: args.scene.clone(),
        draws: args.draws,
        target: contact_ratio.or(args.target.map(Target::RelativeDensity)),
        seed: args.seed,
        of: args.of.clone(),
        heat: args.heat.clone(),
        pulse_energy: args.pulse_energy,
        out: args.out.clone(),
    })?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    if args.dry_run {
        terminal::report(&job.describe())?;
        job.advice().iter().for_each(|line| terminal.warn(line));
        return Ok(());
    }
    let found = job.run(pool(args.threads)?, &terminal)?;
    terminal.announce(&found.published, job.out());
    let text = || found.report.text(Some((found.seconds, job.out())));
    terminal.print_result(args.json, || pretty(&found.report), text)?;
    terminal.advise(&found.report.advice);
    Ok(())
}
