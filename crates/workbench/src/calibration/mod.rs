//! From a plan to a posterior and everything that is recorded of it.

mod ahead;
mod curves;
mod extension;
mod fingerprints;
mod neck_growth;
mod of_pair;
mod other_kinetics;
mod record;
mod run;
mod same_plan;
mod sampling;
mod second_look;
mod sensitivity;
mod stopped;
mod store;

pub(crate) use extension::again;
pub use extension::continued;
pub use run::{Finished, RunOptions, Timings, plan_of_run, resume, run, run_by};
pub use sampling::Calibration;
pub(crate) use sampling::sample;
pub(crate) use store::{Stored, read_stored, refuse_older_layout, refused};
