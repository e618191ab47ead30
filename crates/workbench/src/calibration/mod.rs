//! From a plan to a posterior and everything that is recorded of it.

mod ahead;
mod curves;
mod extension;
mod fingerprints;
mod function;
mod in_process;
mod neck_growth;
mod of_pair;
mod options;
mod other_kinetics;
mod record;
mod run;
mod same_plan;
mod sampling;
mod second_look;
mod sensitivity;
mod stopped;
mod store;

pub use extension::continued;
pub(crate) use extension::{again, refuse_population};
pub use options::{Finished, RunOptions, Timings};
pub use run::{plan_of_run, resume, run, run_by, run_function};
pub use sampling::Calibration;
pub(crate) use sampling::{Stages, sample};
pub(crate) use store::{Stored, read_stored, refuse_older_layout, refused};
