//! `calibrate validate`: simulation-based calibration of one material.
//!
//! Data sets are drawn from the priors and the noise model at the material's own observation times, calibrated with the
//! same model and sampler as the main job, and the truth is ranked within each posterior ([`smc_calib::sbc`]).

mod figure;
mod report;

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args as ArgsOf, Parser as _};
use figures::{Figure as _, Width};
use smc_calib::sbc::{Outcome, Study, quantities};
use smc_calib::{Noise, Settings, Simulator as _};

use crate::args::Args;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::model::NeckGrowth;
use crate::output::write_file;
use crate::plan::Planned;
use crate::run::pool;

pub use report::{Report, Verdict};

/// Simulation-based calibration: does the sampler hold the truth as often as it says?
#[derive(Debug, Clone, PartialEq, Eq, ArgsOf)]
pub struct ValidateArgs {
    /// Built-in material: its times, priors and powder
    #[arg(short, long, value_name = "NAME", default_value = "ps", value_parser = ["ps", "pa12", "peek"])]
    pub material: String,

    /// Number of data sets that are made and calibrated
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    pub data_sets: u32,

    /// Simulations per calibration; by default those of the main job
    #[arg(short = 'n', long, value_name = "N", default_value_t = 16_384, value_parser = clap::value_parser!(u32).range(256..=1_000_000))]
    pub samples: u32,

    /// Seed of the data sets and of the calibrations
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,

    /// Number of threads [default: all cores]
    #[arg(short = 'j', long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Folder for the table and the figure
    #[arg(short, long, value_name = "DIR", default_value = "results/validation")]
    pub out: PathBuf,
}

/// Runs the study and writes `sbc-NAME.md`, `.csv`, `.png` and `.svg`.
///
/// # Errors
///
/// [`Failure::Input`] for settings that do not fit; [`Failure::Run`] where a rank leaves its band, a coverage is off by more
/// than Monte Carlo error, or a file cannot be written.
pub fn run(args: &ValidateArgs) -> Result<(), Failure> {
    let pool = pool(args.threads.map(usize::from))?;
    let start = Instant::now();
    let report = pool.install(|| study(args))?;
    let seconds = start.elapsed().as_secs_f64();
    std::fs::create_dir_all(&args.out).map_err(|error| {
        InputError::new(args.out.display().to_string(), Mistake::OutOfRange)
            .found(error)
            .expected("a folder that can be written")
    })?;
    let name = |ending: &str| args.out.join(format!("sbc-{}.{ending}", args.material));
    let text = report.markdown(seconds, pool.current_num_threads());
    write_file(&name("md"), text.as_bytes())?;
    write_file(&name("csv"), report.csv().as_bytes())?;
    let picture = figure::ranks(&report).render(Width::Full).map_err(RunError::new)?;
    write_file(&name("png"), &picture.png)?;
    write_file(&name("svg"), picture.svg.as_bytes())?;
    eprint!("{text}");
    match report.verdict() {
        Verdict::Passed => Ok(()),
        Verdict::Failed(why) => Err(RunError::new(format_args!("validation failed: {why}")).into()),
    }
}

/// Makes and calibrates the data sets.
///
/// # Errors
///
/// As [`run`].
pub fn study(args: &ValidateArgs) -> Result<Report, Failure> {
    let main_job =
        Args::try_parse_from(["calibrate", "--material", &args.material]).map_err(RunError::new)?;
    let planned = Planned::from_args(&main_job.run)?;
    let plan = &planned.plan;
    let model = NeckGrowth::of(plan)?;
    let Noise::Inferred { nu0, s0 } = plan.noise else {
        return Err(RunError::new("the material's noise is not inferred").into());
    };
    let study = Study {
        simulator: &model,
        parameters: plan.parameters.clone(),
        control: plan.experiment.time_s.clone(),
        noise: (nu0, s0),
        settings: Settings {
            samples: args.samples as usize,
            seed: args.seed,
            draws: 1024,
            ..plan.sampler.clone()
        },
        data_sets: args.data_sets as usize,
    };
    let outcomes: Vec<Outcome> = smc_calib::sbc::run(&study).map_err(RunError::new)?;
    let parameters: Vec<String> = study.parameters.iter().map(|p| p.name.clone()).collect();
    Ok(Report::new(
        format!(
            "{}, {} data sets at {} observation times, {} simulations each, seed {}",
            args.material,
            args.data_sets,
            model.observables(),
            args.samples,
            args.seed
        ),
        &parameters,
        &quantities(&study.parameters),
        &outcomes,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_study_of_the_shipped_sampler_passes() {
        let args = ValidateArgs {
            material: "ps".to_owned(),
            data_sets: 120,
            samples: 4096,
            seed: 7,
            threads: None,
            out: PathBuf::new(),
        };
        let report = study(&args).expect("runs");
        assert_eq!(report.ranked.len(), 9);
        for ranked in &report.ranked {
            assert!(ranked.p_value > 1e-3, "{}: p = {}", ranked.name, ranked.p_value);
        }
        for covered in &report.covered {
            assert!(covered.score.abs() < 3.9, "{covered:?}");
        }
        assert!(report.markdown(1.0, 1).contains("| sigma |"));
        let picture = figure::ranks(&report).render(Width::Full).expect("a figure");
        assert!(picture.svg.ends_with("</svg>\n") && picture.png.starts_with(b"\x89PNG"));
    }
}
