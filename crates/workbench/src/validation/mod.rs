//! Simulation-based calibration of a plan of one pair with the built-in simulator.
//!
//! Data sets are drawn from the priors and the noise model at the plan's own observation times, calibrated with the
//! same model and sampler as the main job, and the truth is ranked within each posterior ([`smc_calib::sbc`]).

mod figure;
mod ranks;

use std::fs;
use std::path::Path;

use figures::{Figure as _, Width};
use smc_calib::sbc::{self, Study, intervals, quantities};
use smc_calib::{CalibrateError, Noise, Settings};

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::output::write_file;
use crate::plan::Plan;
use crate::simulator::Experiments;
use crate::watch::Watch;

pub use ranks::{Ranks, Verdict};

/// The size of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Number of data sets that are made and calibrated.
    pub data_sets: usize,
    /// Seed of the data sets and of the calibrations.
    pub seed: u64,
}

/// Makes and calibrates the data sets.
///
/// # Errors
///
/// [`Failure::Input`] for a plan of anything but one pair, or whose noise has no prior (fixed or tuned); [`Failure::Run`] for a calibration that fails.
pub fn study(plan: &Plan, size: Size, watch: &dyn Watch) -> Result<Ranks, Failure> {
    let (_, measured) = plan.pair()?;
    let noise = &measured.noise;
    let drawn =
        matches!(noise, Noise::Inferred { .. } | Noise::Correlated { .. } | Noise::Robust { .. });
    if !drawn {
        return Err(InputError::new(&plan.name, Mistake::Conflict)
            .in_field("noise")
            .found("noise whose size has no prior")
            .expected("a noise model from whose prior data sets can be drawn")
            .help("write noise = { kind = \"inferred\", nu0 = 4, s0 = 0.05 } in the plan; correlated and robust will do too")
            .into());
    }
    let times = &measured.control;
    watch.begin((size.data_sets * plan.sampler.samples) as u64, 0, "simulations");
    let study = Study {
        simulator: &Experiments::new(plan, None, watch)?,
        parameters: plan.parameters.clone(),
        control: times.clone(),
        noise: noise.clone(),
        origin: None,
        settings: Settings { seed: size.seed, draws: 1024, ..plan.sampler.clone() },
        data_sets: size.data_sets,
    };
    let outcomes = sbc::run(&study);
    watch.end();
    let outcomes = outcomes.map_err(|error| match error {
        CalibrateError::Interrupted { .. } => Failure::Interrupted,
        error => RunError::new(error).into(),
    })?;
    let Size { data_sets, seed } = size;
    let samples = plan.sampler.samples;
    let of_noise = match noise {
        Noise::Correlated { .. } => ", correlated noise",
        Noise::Robust { .. } => ", robust noise",
        _ => "",
    };
    Ok(Ranks::new(
        format!(
            "{}{of_noise}, {data_sets} data sets at {} observation times, {samples} simulations each, seed {seed}",
            plan.name,
            times.len()
        ),
        &intervals(&study.parameters, noise),
        &quantities(&study.parameters, noise),
        &outcomes,
    ))
}

/// Writes `sbc-NAME.md`, `.csv`, `.png` and `.svg` into a folder; `text` is the table.
///
/// # Errors
///
/// [`Failure`] for a folder that cannot be written.
pub fn write(ranks: &Ranks, text: &str, folder: &Path, name: &str) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| {
        InputError::new(folder.display().to_string(), Mistake::Unwritable)
            .found(error)
            .expected("a folder that can be written")
    })?;
    let file = |ending: &str| folder.join(format!("sbc-{name}.{ending}"));
    write_file(&file("md"), text.as_bytes())?;
    write_file(&file("csv"), ranks.csv().as_bytes())?;
    let picture = figure::figure(ranks).render(Width::Full).map_err(RunError::new)?;
    write_file(&file("png"), &picture.png)?;
    write_file(&file("svg"), picture.svg.as_bytes())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    fn small(noise: Noise, samples: usize, data_sets: usize) -> Ranks {
        let options =
            PairOptions { material: Some(Material::Ps), samples, noise, ..PairOptions::default() };
        let plan = options.plan().expect("a plan").plan;
        let size = Size { data_sets, seed: 7 };
        let ranks = study(&plan, size, &Unwatched::default()).expect("runs");
        for ranked in &ranks.ranked {
            assert!(ranked.p_value > 1e-3, "{}: p = {}", ranked.name, ranked.p_value);
        }
        for covered in &ranks.covered {
            assert!(covered.score.abs() < 3.9, "{covered:?}");
        }
        ranks
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn a_small_study_of_the_shipped_sampler_passes() {
        let ranks = small(Noise::default(), 8192, 60);
        assert_eq!(ranks.ranked.len(), 9);
        assert!(ranks.markdown(1.0, 1).contains("| sigma |"));
        let picture = figure::figure(&ranks).render(Width::Full).expect("a figure");
        assert!(picture.svg.ends_with("</svg>\n") && picture.png.starts_with(b"\x89PNG"));
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn a_small_study_with_data_of_correlated_errors_passes() {
        let ranks = small(Noise::correlated(), 8192, 60);
        assert_eq!(ranks.ranked.len(), 10);
        let names: Vec<&str> = ranks.ranked.iter().map(|r| r.name.as_str()).collect();
        assert!(names.ends_with(&["correlation length", "white share"]), "{names:?}");
        assert_eq!(ranks.covered.len(), 2 * 6);
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn a_small_study_with_data_of_robust_errors_passes() {
        assert_eq!(small(Noise::robust(), 8192, 60).ranked.len(), 8);
    }

    #[test]
    #[ignore = "half an hour"]
    fn two_thousand_data_sets_of_correlated_errors_stay_inside_the_bands() {
        let ranks = small(Noise::correlated(), 16_384, 2000);
        assert_eq!(ranks.verdict(), Verdict::Passed);
    }

    #[test]
    fn noise_without_a_prior_is_refused() {
        let noise = Noise::Fixed { sigma: smc_calib::FixedSigma::Absolute(0.02) };
        let options = PairOptions { material: Some(Material::Ps), noise, ..PairOptions::default() };
        let plan = options.plan().expect("a plan").plan;
        let failure = study(&plan, Size { data_sets: 2, seed: 1 }, &Unwatched::default());
        assert!(matches!(failure, Err(Failure::Input(_))), "{failure:?}");
    }
}
