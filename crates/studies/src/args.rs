//! The command line of the studies.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args as ArgsOf, Parser, Subcommand};
use workbench::input::material::Material;

/// Benchmarks and validation studies of the calibration workbench. Each answers one question and writes report.md,
/// table.csv and figures to results/benchmarks/NAME
#[derive(Debug, Clone, PartialEq, Parser)]
#[command(name = "studies", version)]
pub(crate) struct Args {
    /// Folder for the folders of the studies [default: results/benchmarks; noise: results]
    #[arg(short, long, value_name = "DIR", global = true)]
    pub(crate) out: Option<PathBuf>,

    /// The question.
    #[command(subcommand)]
    pub(crate) study: Study,
}

/// The studies by name.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub(crate) enum Study {
    /// Which solver? Time per curve against error of a/R, for every solver (2 minutes)
    Simulator(SimulatorArgs),
    /// Where is each solver valid? Error over time step and sintering time (1 minute)
    Validity,
    /// What does a scene not need, and what does leaving it out save? (10 seconds)
    Savings(OnlyArgs),
    /// Where do simulator and sampler spend their time? Time and instructions of the hot paths (5 minutes)
    Paths(OnlyArgs),
    /// How does the cost of a calibration grow with samples, observations, dimensions and threads? (1 minute)
    Growth,
    /// Is another method closer? Error against work of this sampler and of four rivals (1 minute for 20 seeds)
    Calibration(CalibrationArgs),
    /// What are correlated and robust noise worth? Coverage, prediction, outliers, cost (1 hour)
    Noise(NoiseArgs),
    /// Does the sampler keep its promises? Errors, honest error bars, unbiased evidence over 1000 seeds (20 minutes)
    Sampler(CalibrationArgs),
    /// What do 50 to 300 simulations give, with and without a surrogate that places them? (30 minutes)
    SmallBudget(SmallBudgetArgs),
    /// Is more always better? Error and time from 32 simulations to 65 536 (an hour)
    Budgets(BudgetsArgs),
    /// What do the examples of PyVBMC, BOBE and GPry give, at their numbers of calls and at half? (2 minutes)
    Specialists(SpecialistsArgs),
    /// What is an earlier posterior worth as the first proposal, right or wrong? (30 minutes)
    Proposal(ProposalArgs),
    /// Does a population of pairs predict the next one? Four PA12 pairs, each left out in turn (2 minutes)
    Population,
    /// Prints the exact posterior of a material, or what one run of the sampler finds, as JSON (1 second)
    Exact(ExactArgs),
    /// What do mass scaling and the quasi-static mode cost in accuracy for a bed? (30 seconds)
    BedAccuracy(BedAccuracyArgs),
    /// How far are laws of densification apart? A bed by kinetics and by approach, and closed formulas (1 minute)
    BedLaws,
    /// How do beds settle by adhesion and friction, and does the numerical stiffness matter? (8 minutes)
    BedSettling,
    /// What does the resistance of sintered necks to shear and rolling do to densification? (2 minutes)
    BedNecks,
    /// Prints the speed and memory of steps of one bed (seconds); bed/instructions.sh and bed/lammps.sh make tables
    BedCost(BedCostArgs),
    /// What does a run cost beside the simulator? Runs of a command that does nothing (1 minute)
    Overhead(OverheadArgs),
    /// How far does a campaign scale? Driver, memory and idle slots on a cluster of simulated time (10 minutes)
    CampaignScale(CampaignScaleArgs),
}

/// Time per curve against error.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct SimulatorArgs {
    /// Parameter vectors drawn from each prior
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(crate) draws: usize,
}

/// A study whose instructions are counted by running parts of it again under callgrind.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct OnlyArgs {
    /// Run one part that often and stop; callgrind counts the instructions of such runs
    #[arg(long, num_args = 2, value_names = ["PART", "TIMES"], hide = true)]
    pub(crate) only: Option<Vec<String>>,
}

/// Errors over many seeds.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct CalibrationArgs {
    /// Runs of each method on each problem [default: calibration 20, sampler 1000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..))]
    pub(crate) seeds: Option<u64>,

    /// One problem only
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Option<String>,
}

/// Noise models against each other.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct NoiseArgs {
    /// Data sets of each origin
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(crate) data_sets: usize,

    /// Simulations of a calibration
    #[arg(long, value_name = "N", default_value_t = 16_384)]
    pub(crate) samples: usize,

    /// One part only
    #[arg(long, value_name = "NAME", value_enum)]
    pub(crate) only: Option<NoisePart>,
}

/// Parts of the study of noise models.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum NoisePart {
    /// How often intervals hold the truth.
    Coverage,
    /// The last third of each curve from the first two.
    Prediction,
    /// Moved rows.
    Outliers,
    /// Time of a likelihood.
    Cost,
}

impl NoisePart {
    /// All parts.
    pub(crate) const ALL: [Self; 4] =
        [Self::Coverage, Self::Prediction, Self::Outliers, Self::Cost];
}

impl NoiseArgs {
    /// The command that makes a part.
    pub(crate) fn command(&self, part: &str) -> String {
        let Self { data_sets, samples, .. } = self;
        format!("noise --only {part} --data-sets {data_sets} --samples {samples}")
    }
}

/// Errors of small budgets.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct SmallBudgetArgs {
    /// Runs of each sampler on each problem
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) seeds: u64,

    /// Simulations of a run
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_values_t = [50, 100, 300])]
    pub(crate) samples: Vec<usize>,

    /// Only the problems whose name has this in it; may be given again for further ones
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Vec<String>,
}

/// Error over the number of simulations.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct BudgetsArgs {
    /// Runs of each number of simulations; those of this commit that are in the output folder are not made again
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) seeds: u64,

    /// Fewest simulations
    #[arg(long, value_name = "N", default_value_t = 32)]
    pub(crate) least: usize,

    /// Most simulations
    #[arg(long, value_name = "N", default_value_t = 65_536)]
    pub(crate) most: usize,

    /// Only the problems whose name has this in it; may be given again for further ones
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Vec<String>,
}

/// Problems of other packages.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct SpecialistsArgs {
    /// Runs on each problem
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) seeds: u64,

    /// Only the problems whose name has this in it
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Option<String>,
}

/// Earlier posteriors.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct ProposalArgs {
    /// Runs of each kind
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) seeds: u64,

    /// Simulations of a run of the closed form
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_values_t = [60, 100])]
    pub(crate) samples: Vec<usize>,

    /// One material only
    #[arg(long, value_name = "NAME")]
    pub(crate) only: Option<String>,

    /// Leave out the runs of verlet
    #[arg(long)]
    pub(crate) closed_form_only: bool,
}

/// One exact posterior.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct ExactArgs {
    /// Built-in material
    #[arg(short, long, value_name = "NAME", value_parser = material_parser())]
    pub(crate) material: Material,

    /// Run the sampler with N simulations instead, and print what it finds and how long it took
    #[arg(short = 'n', long, value_name = "N")]
    pub(crate) samples: Option<usize>,

    /// Seed of that run
    #[arg(short, long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Ways to sinter a bed.
#[derive(Debug, Clone, PartialEq, ArgsOf)]
pub(crate) struct BedAccuracyArgs {
    /// Time of heating \[s\]
    #[arg(long, value_name = "S", default_value_t = 0.5)]
    pub(crate) duration: f64,

    /// Seed of the packing
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}

/// Steps of one bed.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct BedCostArgs {
    /// Parts of the bed, joined by `+`: normal, open, unequal, walls, gravity, drag, friction, sintering, chain,
    /// stiff; or pair-solver
    pub(crate) scene: String,

    /// Particles; 2 make a pair
    pub(crate) particles: usize,

    /// Steps
    pub(crate) steps: u64,

    /// Threads
    #[arg(default_value_t = 1)]
    pub(crate) threads: usize,

    /// Write the same packing for LAMMPS into a folder instead, as data.bed and in.bed
    #[arg(long, value_name = "DIR")]
    pub(crate) lammps: Option<PathBuf>,
}

/// Runs of a command that does nothing.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct OverheadArgs {
    /// Runs of each way
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub(crate) runs: usize,

    /// Runs at a time
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) parallel: usize,
}

/// Campaigns on a cluster of simulated time.
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub(crate) struct CampaignScaleArgs {
    /// Make one campaign and print what it took as JSON: slots, runs, hundredths of the standard deviation of the logarithm of
    /// run times, overlap
    #[arg(long, num_args = 4, value_names = ["SLOTS", "RUNS", "SIGMA", "OVERLAP"], hide = true)]
    pub(crate) one: Option<Vec<usize>>,
}

fn material_parser() -> impl TypedValueParser<Value = Material> {
    PossibleValuesParser::new(Material::NAMES)
        .try_map(|name| Material::from_name(&name).ok_or("unknown material"))
}
