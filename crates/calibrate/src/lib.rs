//! The library behind the command `calibrate`.

pub mod args;
pub mod error;
pub mod experiment;
pub mod material;
pub mod observation_table;
pub mod plot;
pub mod prior_file;
pub mod text_file;
mod toml_fields;
