//! A calibration as one file to keep, and the same calibration once more from that file.
//!
//! An archive is a ZIP file with the results under `results/`, the files of the user that they were made of under `inputs/`, and
//! `ro-crate-metadata.json`, which describes both as an [RO-Crate 1.1](https://w3id.org/ro/crate/1.1). [`pack`] writes one,
//! [`reproduce`] reads it as something that may come from anybody.

mod description;
mod names;
mod pack;
mod programs;
mod reproduce;
mod unpack;

pub use pack::{Packed, pack};
pub use reproduce::{Likeness, Outcome, Reproduction, reproduce};
pub use unpack::{Limits, Unpacked, unpack};
