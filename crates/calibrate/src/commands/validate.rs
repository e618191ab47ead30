//! `calibrate validate`: does the sampler hold the truth as often as it says?

use std::path::PathBuf;
use std::time::Instant;

use workbench::error::{Failure, InputError, RunError};
use workbench::input::material::Material;
use workbench::output::pool;
use workbench::plan::{PairOptions, Planned};
use workbench::validation::{self, Size, Verdict};

use crate::arguments;
use crate::terminal::{OnInterrupt, Terminal};

/// Simulation-based calibration: does the sampler hold the truth as often as it says?
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub(crate) struct ValidateArgs {
    /// Built-in material: its times, priors and powder [default: ps]
    #[arg(short, long, value_name = "NAME", value_parser = arguments::material())]
    material: Option<Material>,

    /// Own times and powder: a description (.toml), a bare table (.csv; needs --material), or the name of
    /// a built-in experiment
    #[arg(short, long, value_name = "FILE")]
    experiment: Option<PathBuf>,

    /// Own priors (.toml) [default: the material's]
    #[arg(short, long, value_name = "FILE", requires = "experiment")]
    prior: Option<PathBuf>,

    /// A plan file (.toml or .json) of one pair with the built-in simulator and inferred, correlated or robust noise
    #[arg(long, value_name = "FILE", conflicts_with_all = ["material", "experiment", "prior", "samples"])]
    plan: Option<PathBuf>,

    /// Number of data sets that are made and calibrated, from 100 to 1000000
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = arguments::data_sets, allow_negative_numbers = true)]
    data_sets: usize,

    /// Simulations per calibration, from 256 to 1000000 [default: 16384, or the plan's]
    #[arg(short = 'n', long, value_name = "N", value_parser = arguments::samples_of_many, allow_negative_numbers = true)]
    samples: Option<usize>,

    /// Seed of the data sets and of the calibrations, from 0 to 18446744073709551615
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = arguments::seed, allow_negative_numbers = true)]
    seed: u64,

    /// Threads, from 1 to 1024 [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = arguments::threads, allow_negative_numbers = true)]
    threads: Option<usize>,

    /// Folder for the table and the figure
    #[arg(short, long, value_name = "DIR", default_value = "results/validation")]
    out: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &ValidateArgs) -> Result<(), Failure> {
    let planned = args.planned()?;
    let size = Size { data_sets: args.data_sets, seed: args.seed };
    let terminal = Terminal::new(false, OnInterrupt::Detach);
    let pool = pool(args.threads)?;
    let start = Instant::now();
    let ranks = pool.install(|| validation::study(&planned.plan, size, &terminal))?;
    let text = ranks.markdown(start.elapsed().as_secs_f64(), pool.current_num_threads());
    validation::write(&ranks, &text, &args.out, &planned.plan.name)?;
    eprint!("{text}");
    match ranks.verdict() {
        Verdict::Passed => Ok(()),
        Verdict::Failed(why) => Err(RunError::new(format_args!("validation failed: {why}")).into()),
    }
}

impl ValidateArgs {
    fn planned(&self) -> Result<Planned, InputError> {
        if let Some(file) = &self.plan {
            return Planned::read(file);
        }
        let by_default = self.experiment.is_none().then_some(Material::Ps);
        let default = PairOptions::default();
        let options = PairOptions {
            material: self.material.or(by_default),
            experiment: self.experiment.clone(),
            prior: self.prior.clone(),
            samples: self.samples.unwrap_or(default.samples),
            ..default
        };
        options.plan()
    }
}
