//! Beds of many particles: accuracy of the fast ways to sinter one, and cost of a step.

pub(crate) mod accuracy;
pub(crate) mod cost;
mod lammps;
mod packing;
