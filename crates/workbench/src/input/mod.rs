//! Input files: experiments and their tables, priors, scenes.

pub mod columns;
pub mod data_table;
pub mod experiment;
pub(crate) mod files_read;
pub mod heat;
pub(crate) mod json_document;
pub mod material;
pub mod observation_table;
pub mod prior_file;
pub mod sample_table;
pub mod scene_file;
pub mod spreadsheet;
pub mod text_file;
pub(crate) mod toml_fields;
