//! Runs of simulators in a directory where nothing is lost.
//!
//! A [`Campaign`] is a directory that holds what is run, every parameter set before its run starts, and every outcome; an
//! [`Executor`] makes the runs: [`Local`] processes, a function on threads ([`InProcess`]), or a cluster
//! ([`slurm::Slurm`]); [`Simulated`] is a cluster of simulated time. After a crash the directory is opened again and only
//! what is missing is run.
//!
//! ```
//! use std::collections::BTreeMap;
//! use campaign::{Campaign, CampaignSpec, CommandSpec, Executor, InProcess, Stop, Task};
//!
//! let spec = CampaignSpec {
//!     parameter_names: vec!["c1".into()],
//!     commands: vec![CommandSpec::in_process("square")],
//!     seed: 1,
//! };
//! let dir = tempfile::tempdir()?;
//! let dir = dir.path().join("squares");
//! let campaign = Campaign::create(&dir, &spec, &BTreeMap::new())?;
//! let tasks: Vec<Task> = (0..4)
//!     .map(|number| Task { number, command: 0, parameters: vec![number as f64] })
//!     .collect();
//! let mut threads = InProcess::new(2, |task: &Task| Ok(vec![task.parameters[0].powi(2)]))?;
//! threads.run(&campaign, &tasks, &mut |_| (), &Stop::new())?;
//! drop(campaign);
//!
//! let (campaign, damage) = Campaign::open(&dir)?;
//! assert!(damage.is_empty());
//! let outcome = campaign.outcome(3).expect("it was run");
//! assert_eq!(outcome.values(), Some(&[9.0][..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod attempt;
mod campaign;
mod contents;
mod create;
pub mod durable;
mod error;
mod executor;
mod feed;
mod files;
mod folder;
mod holder;
mod in_process;
pub mod inputs;
mod journal;
mod judge;
mod leftover;
mod local;
mod lock;
mod machine;
mod mailbox;
mod mend;
pub mod numbers;
mod outage;
mod outcome;
mod persistent;
mod process;
mod record;
mod results;
mod seal;
mod simulated;
pub mod slurm;
mod spec;
mod state;
mod status;
mod strays;
mod streams;
pub mod table;
mod task;
pub mod template;
mod worker;

pub use campaign::{Campaign, Collected};
pub use contents::{Contents, contents};
pub use error::{CampaignError, Damage, ExecutorError};
pub use executor::{Event, Executor, Request, Stop};
pub use feed::Feed;
pub use folder::ANSWER;
pub use holder::Holder;
pub use in_process::{Fault, InProcess};
pub use local::Local;
pub use outcome::{FailureKind, Outcome};
pub use persistent::ask_worker;
pub use simulated::{Account, RunTimes, Simulated, SimulatedRun};
pub use spec::{
    Call, CampaignSpec, CommandSpec, Interpolation, Keep, LostRuns, OutputSpec, ResultSpec,
    SpecError, TryLater,
};
pub use status::{Status, status};
pub use table::Format;
pub use task::Task;
pub use worker::{Worker, run_task};
