//! Calibrations held against known answers.
#![allow(clippy::unwrap_used, missing_docs)]

mod batches;
mod conjugate;
mod correlated;
mod determinism;
mod draws;
mod extended;
mod failures;
mod few_observations;
mod files;
mod first_proposal;
mod joint;
mod modes;
mod noise;
mod overlap;
mod priors;
mod quadrature;
mod references;
mod revised;
mod small_budget;
mod stress;
mod support;
