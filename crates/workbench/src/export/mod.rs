//! A run for other programs: its tables so far, also while it runs, and its posterior for ArviZ, R and CmdStan's readers.

mod groups;
mod of_run;
mod replay;
mod tables;

pub use groups::{Attributes, Group, Groups, Values, Variable};
pub use tables::{Exported, export};

#[cfg(test)]
mod tests;
