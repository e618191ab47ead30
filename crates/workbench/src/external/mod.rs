//! Calibration of any simulator, by a plan file: parameters, experiments, observables, and where the runs are made.
//!
//! Data flows one way: [`plan_file`] reads a plan, [`driver`] runs it, [`report`] writes what was found. The runs
//! themselves are kept by the crate `campaign`.

pub mod data_table;
pub mod describe;
pub mod driver;
pub mod export;
pub mod plan;
pub mod plan_file;
pub mod posterior_file;
mod problem;
pub mod report;
pub mod run_task;
pub mod sample_table;
mod simulator;
pub mod status;
mod store;
pub mod summary;
mod template;

/// The folder of the results in the folder of a run.
pub const REPORT: &str = "report";
