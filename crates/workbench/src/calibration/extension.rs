//! More simulations for a run that is there: all that it has made count, and none is made again.

use std::path::{Path, PathBuf};

use campaign::Campaign;
use smc_calib::Noise;

use super::store::{self, Stored};
use crate::error::{Failure, InputError, Mistake};
use crate::output::CAMPAIGN;
use crate::plan::{ExecutorPlan, Plan, Planned};
use crate::record;

/// The kinds of warnings that the files of a plan were given, which are not read again.
const OF_INPUT: [&str; 5] = [
    "above-final-contact-ratio",
    "other-radius",
    "below-adhesive-contact",
    "delta-c-above-radius",
    "tau-s-far-from-times",
];

/// A plan of the same run with more samples.
fn extended(name: &Path, plan: &Plan, samples: usize) -> Result<Plan, InputError> {
    let place = name.display();
    let refused = |found: &str, help: &str| {
        Err(InputError::new(place.to_string(), Mistake::Conflict).found(found).help(help))
    };
    if plan.design.is_some() {
        return refused(
            "a run of given parameter sets (design), which no sampler can add to",
            "add sets to the design, and run the plan with another --out",
        );
    }
    let tuned = |noise: &Noise| matches!(noise, Noise::EssTarget { .. });
    if plan.observables().any(|(_, observable)| tuned(&observable.noise)) {
        return refused(
            "a run with tuned noise (ess-target), whose result is that of its newest iteration alone",
            "run it anew with more samples",
        );
    }
    let has = plan.sampler.samples;
    let sampler = plan.sampler.extended(samples).map_err(|_| {
        InputError::new("--samples", Mistake::OutOfRange)
            .found(samples)
            .expected(format_args!("more than the {has} simulations that the run in {place} has"))
            .help(format_args!("twice as many: --samples {}", 2 * has))
    })?;
    Ok(Plan { sampler, ..plan.clone() })
}

/// Gives a run of programs more samples; its result stays until there is that of all. The number that an unfinished run has
/// already lets it go on: the same command twice is one extension.
pub(super) fn extend(
    dir: &Path,
    campaign: &mut Campaign,
    stored: &mut Stored,
    samples: usize,
) -> Result<(), Failure> {
    if samples == stored.plan.sampler.samples && !record::is_reported(dir, &stored.plan) {
        return Ok(());
    }
    stored.plan = extended(dir, &stored.plan, samples)?;
    store::replace_plan(dir, campaign, stored)
}

/// The plan of a run that was computed in this program, with more samples, and the folder of the run. The built-in simulator
/// makes its simulations once more to the same bits, which takes milliseconds in closed form.
///
/// # Errors
///
/// [`InputError`] for a folder without such a run, and for no more samples than it has.
pub fn continued(from: &Path, samples: usize) -> Result<(Planned, PathBuf), InputError> {
    let file = record::locate(from);
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    };
    if folder.join(CAMPAIGN).is_dir() {
        let name = folder.display();
        return Err(InputError::new(name.to_string(), Mistake::Conflict)
            .found("a run of programs, whose runs are kept")
            .help(format_args!("extend it: calibrate --resume {name} --samples {samples}")));
    }
    let record = record::read(from)?;
    let plan = extended(&folder, &record.plan, samples)?;
    let plan = Plan { version: env!("CARGO_PKG_VERSION").to_owned(), ..plan };
    let of_input = |line: &String| {
        OF_INPUT.iter().any(|kind| line.ends_with(&format!("(see careful.md, \"{kind}\")")))
    };
    let warnings = record.advice.into_iter().filter(of_input).collect();
    let executor = ExecutorPlan::Threads { threads: None };
    let planned = Planned { plan, executor, warnings, path: None, text: String::new() };
    Ok((planned.warned(), folder))
}
