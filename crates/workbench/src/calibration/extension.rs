//! More simulations for a run that is there: all that it has made count, and none is made again.

use std::path::{Path, PathBuf};

use campaign::Campaign;
use smc_calib::Posterior;

use super::store::{self, Stored};
use crate::error::{Failure, InputError, Mistake};
use crate::input::text_file::folder_of;
use crate::output::CAMPAIGN;
use crate::output::inputs::Inputs;
use crate::plan::{ExecutorPlan, Plan, Planned};
use crate::record::{self, Record};
use crate::report::read_samples;
use crate::watch::Watch;

/// The kinds of warnings that the files of a plan were given, which are not read again.
const OF_INPUT: [&str; 7] = [
    "above-final-contact-ratio",
    "other-radius",
    "below-adhesive-contact",
    "delta-c-above-radius",
    "tau-s-far-from-times",
    "untrusted-proposal",
    "proposal-outside-priors",
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
    if plan.is_tuned() {
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

/// The plan of a run of programs with the number of samples that is asked for; none where it stays. The number that an
/// unfinished run has already, or one whose failed runs are `retried`, lets it go on: the same command twice is one extension.
/// Nothing in the folder is changed.
pub(super) fn planned(
    dir: &Path,
    plan: &Plan,
    samples: Option<usize>,
    retried: bool,
) -> Result<Option<Plan>, InputError> {
    let Some(samples) = samples else { return Ok(None) };
    if samples == plan.sampler.samples && (retried || !record::is_reported(dir, plan)) {
        return Ok(None);
    }
    extended(dir, plan, samples).map(Some)
}

/// Gives a run of programs that plan; its result stays until there is that of all.
pub(super) fn extend(
    dir: &Path,
    campaign: &mut Campaign,
    stored: &mut Stored,
    plan: Plan,
) -> Result<(), Failure> {
    stored.plan = plan;
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
    let folder = folder_of(&file).to_owned();
    if folder.join(CAMPAIGN).is_dir() {
        let name = folder.display();
        let has = store::read_stored(&folder).map_or(0, |stored| stored.plan.sampler.samples);
        let more = if samples > has { samples } else { 2 * has };
        return Err(InputError::new(name.to_string(), Mistake::Conflict)
            .found("a run of programs, whose runs are kept")
            .help(format_args!("extend it: calibrate --resume {name} --samples {more}")));
    }
    let record = record::read(from)?;
    refuse_population(&record, &folder.display().to_string())?;
    let plan = extended(&folder, &record.plan, samples)?;
    // What was read for the run that is extended: its files may be others by now.
    let inputs = Inputs::read(&folder)?;
    let planned = Planned { inputs, ..again(&Record { plan, ..record }, None, String::new()) };
    Ok((planned.warned(), folder))
}

/// Refuses a population, which no plan makes again.
pub(crate) fn refuse_population(record: &Record, name: &str) -> Result<(), InputError> {
    match &record.plan.population {
        None => Ok(()),
        Some(_) => Err(InputError::new(name, Mistake::Conflict)
            .found("a population of several calibrations")
            .expected("a calibration")
            .help("run it again from its members: calibrate population RUN RUN ...")),
    }
}

/// The plan of a record for another run by this version, with the plan file that it came from, where its programs' files
/// begin, and the text of that.
pub(crate) fn again(record: &Record, path: Option<PathBuf>, text: String) -> Planned {
    let plan = Plan { version: env!("CARGO_PKG_VERSION").to_owned(), ..record.plan.clone() };
    let of_input = |line: &&String| {
        OF_INPUT.iter().any(|kind| line.ends_with(&format!("(see careful.md, \"{kind}\")")))
    };
    let warnings = record.advice.iter().filter(of_input).cloned().collect();
    let executor = match plan.commands().next() {
        Some(_) => ExecutorPlan::Local { parallel: None },
        None => ExecutorPlan::Threads { threads: None },
    };
    Planned { plan, executor, warnings, path, text, inputs: None }
}

/// Holds the first samples of an extended run against those of the run in `earlier`, to the bit, and says so where they are
/// others: this result is then as good, and the other one no part of it.
pub(super) fn compare(earlier: &Path, posterior: &Posterior, watch: &dyn Watch) {
    let name = earlier.display();
    let read = record::read(earlier).and_then(|record| {
        let samples = read_samples(&record, earlier)?;
        Ok((record.plan.version, samples))
    });
    let (version, samples) = match read {
        Ok(read) => read,
        Err(error) => {
            watch.warn(&format!(
                "the simulations of {name} cannot be compared with the first of these: {error}"
            ));
            return;
        }
    };
    let column = |(j, column): (usize, &Vec<f64>)| {
        let own = posterior.samples.iter().map(|sample| sample.theta[j]);
        column.iter().zip(own).position(|(theirs, own)| theirs.to_bits() != own.to_bits())
    };
    let Some(first) = samples.parameters.iter().enumerate().filter_map(column).min() else {
        return;
    };
    let now = env!("CARGO_PKG_VERSION");
    let by = if version == now {
        "on another kind of machine, or by another build of this version".to_owned()
    } else {
        format!("by version {version} of calibrate, this is {now}")
    };
    watch.warn(&format!(
        "the simulations of {name} are not the first of this run, from number {} on: they were made {by}. The result is that of \
         {} simulations made now, and none of the earlier ones counts",
        first + 1,
        posterior.samples.len()
    ));
}
