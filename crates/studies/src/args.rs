//! The command line of the studies.

use std::path::PathBuf;

use clap::{Args as ArgsOf, Parser, Subcommand};
use workbench::args::{material_parser, parse_samples};
use workbench::material::Material;

/// Benchmarks and validation studies of the calibration workbench
#[derive(Debug, Clone, PartialEq, Eq, Parser)]
#[command(name = "studies", version)]
pub(crate) struct Args {
    /// What to measure.
    #[command(subcommand)]
    pub(crate) study: Study,
}

/// The benchmarks by name.
#[derive(Debug, Clone, PartialEq, Eq, Subcommand)]
pub(crate) enum Study {
    /// Every solver: time per curve against error of a/R (some minutes)
    Simulator(SimulatorArgs),
    /// Six ways to a posterior: error against simulations and time (some minutes)
    Calibration(CalibrationArgs),
    /// Print the exact posterior of a material, or what one run says of it, as JSON
    Exact(ExactArgs),
    /// What a scene does not need, and what leaving it out saves
    Savings(SavingsArgs),
    /// How cost grows with samples, observations, dimensions and threads (half a minute)
    Growth(GrowthArgs),
    /// Time and instructions of the hot paths (some minutes)
    Paths(PathsArgs),
}

/// Time per curve against error.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct SimulatorArgs {
    /// Folder for tables and figures
    #[arg(short, long, value_name = "DIR", default_value = "results/benchmarks")]
    pub(crate) out: PathBuf,

    /// Parameter vectors drawn from each prior
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(crate) draws: usize,
}

/// How cost grows.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct GrowthArgs {
    /// Folder for the table and the figure
    #[arg(short, long, value_name = "DIR", default_value = "results/benchmarks")]
    pub(crate) out: PathBuf,
}

/// Time and instructions of the hot paths.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct PathsArgs {
    /// Folder for the table
    #[arg(short, long, value_name = "DIR", default_value = "results/benchmarks")]
    pub(crate) out: PathBuf,

    /// Run one path that often and stop: what the instructions are counted of
    #[arg(long, num_args = 2, value_names = ["PATH", "TIMES"], hide = true)]
    pub(crate) only: Option<Vec<String>>,
}

/// What leaving out saves.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct SavingsArgs {
    /// Folder for the table
    #[arg(short, long, value_name = "DIR", default_value = "results/benchmarks")]
    pub(crate) out: PathBuf,

    /// Run one scene that often and stop: what the instructions are counted of
    #[arg(long, value_name = "SCENE", num_args = 2, value_names = ["SCENE", "TIMES"], hide = true)]
    pub(crate) only: Option<Vec<String>>,
}

/// Error of posteriors against work.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct CalibrationArgs {
    /// Folder for tables and figures
    #[arg(short, long, value_name = "DIR", default_value = "results/benchmarks")]
    pub(crate) out: PathBuf,

    /// Runs of each method [default: 20; with --full 1000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub(crate) seeds: Option<u64>,

    /// Hold the sampler alone against its promises instead: error, honest error bars, unbiased evidence
    #[arg(long)]
    pub(crate) full: bool,

    /// One problem only
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Option<String>,
}

/// One exact posterior.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct ExactArgs {
    /// Built-in material
    #[arg(short, long, value_name = "NAME", value_parser = material_parser())]
    pub(crate) material: Material,

    /// Run the sampler with N simulations instead, and say what it finds and how long it took
    #[arg(short = 'n', long, value_name = "N", value_parser = parse_samples)]
    pub(crate) samples: Option<usize>,

    /// Seed of that run
    #[arg(short, long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}
