//! `calibrate bench`: run time against error.
//!
//! Each study writes a table (CSV and Markdown) and log-log figures (PNG and SVG), each with the machine, the
//! revision and the date it was made at.

mod calibration;
mod cases;
mod cpu_time;
mod decided;
#[cfg(feature = "stiff-reference")]
mod draws;
mod exact;
mod growth;
mod instructions;
mod paths;
mod report;
mod rivals;
mod sampler;
mod savings;
#[cfg(feature = "stiff-reference")]
mod simulator;
mod spread;
mod timing;
#[cfg(feature = "stiff-reference")]
mod validity;

use crate::args::{BenchArgs, BenchStudy, SimulatorBenchArgs};
use crate::error::Failure;

/// Runs one study.
///
/// # Errors
///
/// [`Failure`]: files that cannot be written, or a method that fails where it must not.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    match &args.study {
        BenchStudy::Simulator(args) => simulator(args),
        BenchStudy::Calibration(args) if args.full => sampler::run(args),
        BenchStudy::Calibration(args) => calibration::run(args),
        BenchStudy::Exact(args) => exact::run(args),
        BenchStudy::Savings(args) => savings::run(args),
        BenchStudy::Growth(args) => growth::run(args),
        BenchStudy::Paths(args) => paths::run(args),
    }
}

#[cfg(feature = "stiff-reference")]
fn simulator(args: &SimulatorBenchArgs) -> Result<(), Failure> {
    simulator::run(args)?;
    validity::run(&args.out)
}

#[cfg(not(feature = "stiff-reference"))]
fn simulator(_: &SimulatorBenchArgs) -> Result<(), Failure> {
    Err(crate::error::RunError::new(
        "this program was built without the references to measure errors against",
    )
    .help("cargo run --release --features stiff-reference -- bench simulator")
    .into())
}
