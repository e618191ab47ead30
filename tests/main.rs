//! The command `calibrate` from end to end, each test in a folder of its own.

mod sandbox;

mod bad_input;
mod files;
mod simulate;
