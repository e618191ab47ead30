//! The command `calibrate` from end to end, each test in a folder of its own.

mod sandbox;

mod bad_input;
mod determinism;
mod files;
mod main_job;
mod predict;
mod readme;
mod simulate;
