//! The simulator against known answers and independent references.

mod bad_input;
mod contact_law;
mod convergence;
mod heat;
mod heated;
mod kinetics;
mod names;
mod paper_statements;
mod reference;
mod restitution;
