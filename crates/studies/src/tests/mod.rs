//! Solvers and samplers against references of other programs, and over everything a user could type.
#![allow(clippy::unwrap_used)]

mod noise;
mod stiff_reference;
mod stress;
