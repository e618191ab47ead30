//! The calibration workbench as a library: input files, plans, calibration, records, reports. It has no command line and
//! prints nothing.

pub mod calibration;
pub mod checksums;
pub mod data_table;
pub mod error;
pub mod experiment;
pub mod export;
pub mod frenkel_fit;
mod json_document;
pub mod material;
pub mod model;
pub mod number;
pub mod observation_table;
pub mod output;
pub mod parameter;
pub mod plan;
pub mod prior_file;
pub mod product;
pub mod record;
pub mod report;
pub mod run_task;
pub mod sample_table;
mod simulator;
pub mod status;
pub mod text_file;
mod toml_fields;
pub mod watch;
pub mod weighted;
