//! Beds of many particles: accuracy of the fast ways to sinter one, laws of densification, packings by adhesion and friction,
//! and cost of a step.

pub(crate) mod accuracy;
pub(crate) mod cost;
mod lammps;
pub(crate) mod laws;
pub(crate) mod necks;
mod packing;
pub(crate) mod settling;
