//! Benchmarks and validation studies: `cargo run --release -p studies -- NAME`.
//!
//! Each study writes a table (CSV and Markdown) and log-log figures (PNG and SVG), each with the machine, the
//! revision and the date it was made at.

mod args;
mod calibration;
mod cases;
mod cpu_time;
mod decided;
mod draws;
mod exact;
mod growth;
mod instructions;
mod paths;
mod report;
mod rivals;
mod sampler;
mod savings;
mod simulator;
mod spread;
mod timing;
mod validity;

use std::process::ExitCode;

use clap::Parser as _;
use workbench::error::Failure;

use crate::args::{Args, Study};

fn main() -> ExitCode {
    match run(&Args::parse().study) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

fn run(study: &Study) -> Result<(), Failure> {
    match study {
        Study::Simulator(args) => {
            simulator::run(args)?;
            validity::run(&args.out)
        }
        Study::Calibration(args) if args.full => sampler::run(args),
        Study::Calibration(args) => calibration::run(args),
        Study::Exact(args) => exact::run(args),
        Study::Savings(args) => savings::run(args),
        Study::Growth(args) => growth::run(args),
        Study::Paths(args) => paths::run(args),
    }
}
