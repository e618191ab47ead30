//! `calibrate population`: how much several calibrations differ, and what the next one will be.

use std::path::PathBuf;

use workbench::error::Failure;
use workbench::output::{RunFolder, pool};
use workbench::population::{PopulationJob, PopulationOptions};
use workbench::{record, report};

use crate::arguments;
use crate::terminal::{OnInterrupt, Terminal};

const EXAMPLES: &str = "\
Examples:
  calibrate population results/pa12-r32 results/pa12-r30 \\
      results/pa12-r29-3 results/pa12-r28-9
  calibrate population results/a results/b --spread 0.1 --out results/powder
  calibrate population results/a results/b --spread tau_s=0.05 --independent
  calibrate predict --posterior results/population --contact-ratio 0.9
      what the next pair will do: not one of those that were measured

Each run is a finished calibration of another pair (or experiment) with the same parameters; noise and priors may differ. The mean \
of each parameter is taken as uniform over the range that all priors have in common. In the folder, draws.csv and posterior.json are \
those of the next one, populations.csv has the sampled populations, population.csv their summary with each member's.";

/// A population of finished calibrations.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct PopulationArgs {
    /// Folders of finished calibrations, or their posterior.json: two or more
    #[arg(value_name = "RUN", required = true, num_args = 1..)]
    runs: Vec<PathBuf>,

    /// Half-normal prior of the spread between members: its standard deviation in decades, above 0, at most 10, or
    /// NAME=VALUE for one parameter, separated by commas [default: 0.3; of a parameter that is not logarithmic a tenth of the range of
    /// its mean]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = arguments::spread, allow_negative_numbers = true)]
    spread: Vec<(Option<String>, f64)>,

    /// LKJ prior of the correlations: its eta, above 0, at most 1000. 1 makes all correlation matrices alike probable
    #[arg(long, value_name = "N", default_value_t = PopulationOptions::CORRELATION, value_parser = arguments::eta, allow_negative_numbers = true)]
    lkj: f64,

    /// Take the parameters as independent of each other between members
    #[arg(long, conflicts_with = "lkj")]
    independent: bool,

    /// Radius of the next pair in metres, from 1e-9 to 1e-2 [default: the mean of the radii]; every tau_s is moved to it
    /// in proportion
    #[arg(short, long, value_name = "M", value_parser = arguments::radius, allow_negative_numbers = true)]
    radius_m: Option<f64>,

    /// Evaluations of the posterior, from 16 to 100000000
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = arguments::samples, allow_negative_numbers = true)]
    samples: usize,

    /// Seed of the random numbers, from 0 to 18446744073709551615
    #[arg(short, long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true)]
    seed: u64,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Folder for the results
    #[arg(short, long, value_name = "DIR", default_value = "results/population")]
    out: PathBuf,

    /// Say nothing but warnings and errors
    #[arg(short, long)]
    quiet: bool,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &PopulationArgs) -> Result<(), Failure> {
    let folder = RunFolder::prepare(&args.out, record::FILE_NAME)?;
    let terminal = Terminal::new(args.quiet, OnInterrupt::Detach);
    let options = PopulationOptions {
        runs: args.runs.clone(),
        spread: args.spread.clone(),
        correlation: (!args.independent).then_some(args.lkj),
        radius_m: args.radius_m,
        samples: args.samples,
        seed: args.seed,
    };
    let (found, published) = pool(args.threads)?
        .install(|| PopulationJob::read(&options)?.publish(&folder, &terminal))?;
    terminal.announce(&published, &args.out);
    terminal.advise(&found.advice);
    let text = || report::text(&found, None, Some(&args.out));
    terminal.print_result(args.json, || report::json(&found, Some(&args.out)), text)
}
