//! The library behind the command `calibrate`.

pub mod args;
pub mod bench;
pub mod calibration;
pub mod check;
pub mod error;
pub mod experiment;
pub mod figures;
pub mod frenkel_fit;
pub mod inspect;
pub mod material;
pub mod model;
pub mod number;
pub mod observation_table;
pub mod output;
pub mod plan;
pub mod plot;
pub mod posterior_file;
pub mod predict;
pub mod prior_file;
pub mod run;
pub mod simulate;
pub mod summary;
pub mod tables;
pub mod text_file;
mod toml_fields;
pub mod verify;
pub mod weighted;
