//! A run for other programs: its tables so far, also while it runs, and its posterior for ArviZ, R and CmdStan's readers.

mod csv;
mod curves;
mod files;
mod groups;
mod inference_data;
mod observed;
mod of_run;
mod replay;
mod tables;
mod zarr;

pub use files::{Format, Written, export_posterior};
pub use groups::{Attributes, Group, Groups, Values, Variable};
pub use tables::{Exported, export};

#[cfg(test)]
mod tests;
