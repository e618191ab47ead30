//! The plan of a calibration: everything that decides its result, checked, and nothing else.
//!
//! A plan comes from options ([`PairOptions`]: a material, or experiments of one powder) or from a plan file
//! ([`Planned::read`]), and is written as a plan file again ([`Planned::toml`]). How the runs are executed is apart, in
//! [`ExecutorPlan`]: the same plan gives the same bytes on threads, local processes and a cluster.

mod command;
mod earlier;
mod executor;
mod file;
mod function;
mod heats;
mod input_files;
mod made_of;
mod observable;
mod options;
mod pair;
mod pair_file;
mod population;
mod proposal;
mod sampler;
mod template;
mod together;
mod toml;
mod types;
mod words;

pub use earlier::EarlierPosterior;
pub use function::{FunctionOptions, Measured};
pub(crate) use heats::pairs;
pub(crate) use made_of::{PLAN, PROGRAM};
pub use options::command_line;
pub(crate) use options::{noise_option, shell_word};
pub use pair::{PairOptions, sampler_for};
pub use population::{PopulationPlan, PopulationRun};
pub(crate) use template::with_folder;
pub use types::{
    Design, ExecutorPlan, ExperimentPlan, ObservablePlan, PairPlan, Plan, Planned, SAMPLES,
    SimulatorPlan, SolverPlan,
};
pub(crate) use types::{run_number, sample_of};
pub use words::{Understood, dry_run, noise_in_words, prior_in_words, understood};
pub(crate) use words::{prior_rows, short};
