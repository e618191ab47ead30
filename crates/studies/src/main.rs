//! Benchmarks and validation studies, one question each: `cargo run --release -p studies -- NAME`.

mod args;
mod bed;
mod budgets;
mod calibration;
mod campaign_scale;
mod cases;
mod decided;
mod exact;
mod growth;
mod instructions;
mod noise;
mod overhead;
mod pair;
mod paths;
mod population;
mod proposal;
mod quantile;
mod report;
mod rivals;
mod sampler;
mod savings;
mod seeds;
mod simulator;
mod small_budget;
mod specialists;
mod spread;
mod stiff_reference;
#[cfg(test)]
mod tests;
mod timing;
mod validity;

use std::path::Path;
use std::process::ExitCode;

use clap::Parser as _;
use workbench::error::Failure;

use crate::args::{Args, Study};

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::OutputClosed) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            ExitCode::from(failure.code())
        }
    }
}

fn run(Args { out, study }: &Args) -> Result<(), Failure> {
    let default = match study {
        Study::Noise(_) => "results",
        _ => "results/benchmarks",
    };
    let out = out.as_deref().unwrap_or(Path::new(default));
    match study {
        Study::Simulator(args) => simulator::run(args, out),
        Study::Validity => validity::run(out),
        Study::Savings(args) => savings::run(args, out),
        Study::Paths(args) => paths::run(args, out),
        Study::Growth => growth::run(out),
        Study::Calibration(args) => calibration::run(args, out),
        Study::Noise(args) => noise::run(args, out),
        Study::Sampler(args) => sampler::run(args, out),
        Study::SmallBudget(args) => small_budget::run(args, out),
        Study::Budgets(args) => budgets::run(args, out),
        Study::Specialists(args) => specialists::run(args, out),
        Study::Population => population::run(out),
        Study::Proposal(args) => proposal::run(args, out),
        Study::Exact(args) => exact::run(args),
        Study::BedAccuracy(args) => bed::accuracy::run(args, out),
        Study::BedLaws => bed::laws::run(out),
        Study::BedNecks => bed::necks::run(out),
        Study::BedSettling => bed::settling::run(out),
        Study::BedCost(args) => bed::cost::run(args),
        Study::Overhead(args) => overhead::run(args, out),
        Study::CampaignScale(args) => campaign_scale::run(args, out),
    }
}
