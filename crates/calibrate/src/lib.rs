//! The library behind the command `calibrate`.

pub mod args;
pub mod check;
pub mod error;
pub mod experiment;
pub mod material;
pub mod observation_table;
pub mod output;
pub mod plot;
pub mod prior_file;
pub mod simulate;
pub mod calibration;
pub mod figures;
pub mod frenkel_fit;
pub mod inspect;
pub mod model;
pub mod number;
pub mod plan;
pub mod posterior_file;
pub mod run;
pub mod summary;
pub mod tables;
pub mod weighted;
pub mod text_file;
mod toml_fields;
