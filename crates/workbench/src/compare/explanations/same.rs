//! Whether calibrations are of the same measurements under the same noise model: otherwise their evidences say nothing of each other.

use std::collections::BTreeSet;
use std::path::Path;

use smc_calib::Settings;

use super::super::noises;
use super::explained::Explained;
use crate::error::{InputError, Mistake};
use crate::input::text_file::folder_of;
use crate::output::inputs::Inputs;
use crate::plan::{ObservablePlan, PROGRAM, Plan, SimulatorPlan};
use crate::record::locate;

/// For each explanation the places of its observables in the order of the first one's. `given` are the runs, where they are such.
///
/// # Errors
///
/// [`InputError`] that names the run, the measurement, and what to do.
pub(super) fn places(
    explained: &[Explained],
    given: &[String],
) -> Result<Vec<Vec<usize>>, InputError> {
    let Some((first, others)) = explained.split_first() else { return Ok(Vec::new()) };
    let mut places = vec![(0..first.record.plan.observables().count()).collect()];
    let all: Vec<Compared> = explained
        .iter()
        .enumerate()
        .map(|(k, one)| Compared::of(given.get(k).unwrap_or(&one.name), &one.record.plan))
        .collect();
    for (k, other) in others.iter().enumerate() {
        let (before, Compared { run, .. }) = (&all[..=k], &all[k + 1]);
        for one in before {
            if let Some(found) = one.once_more(&all[k + 1]) {
                return Err(InputError::new(run, Mistake::Duplicate)
                    .found(found)
                    .expected("another explanation, as each counts once in the probabilities")
                    .help("leave one of the two out"));
            }
        }
        places.push(beside(first, other, (all[0].run, run))?);
    }
    Ok(places)
}

/// A calibration as others are held against it.
struct Compared<'a> {
    run: &'a str,
    plan: &'a Plan,
    explanation: Plan,
    /// Sums of its programs; nothing where it has none, or they are not known.
    programs: Option<BTreeSet<String>>,
}

impl<'a> Compared<'a> {
    fn of(run: &'a str, plan: &'a Plan) -> Self {
        let programs = plan.commands().next().and_then(|_| programs(run));
        Self { run, plan, explanation: explanation(plan), programs }
    }

    /// What to say of a calibration of this explanation: the same one, or another with other settings of the sampler.
    fn once_more(&self, other: &Self) -> Option<String> {
        let Self { run, plan, .. } = self;
        if *plan == other.plan {
            return Some(format!("the calibration of {run} once more"));
        }
        let is_same = plan.function().is_none()
            && self.explanation == other.explanation
            && self.programs == other.programs;
        is_same.then(|| {
            let words = |plan: &Plan| {
                format!("seed {} and {} simulations", plan.sampler.seed, plan.budget())
            };
            format!(
                "the explanation of {run} once more: model, priors and measurements are the same, with {} where {run} has {}",
                words(other.plan),
                words(plan)
            )
        })
    }
}

/// What of a plan is an explanation of its measurements: neither the settings of the sampler, nor names, sources and words.
fn explanation(plan: &Plan) -> Plan {
    let mut plan = Plan {
        name: String::new(),
        title: String::new(),
        source: None,
        prior_source: None,
        sampler: Settings::default(),
        design: None,
        proposal: None,
        version: String::new(),
        ..plan.clone()
    };
    for experiment in &mut plan.experiments {
        experiment.name = String::new();
        if let SimulatorPlan::Builtin(pair) = &mut experiment.simulator {
            (pair.experiment, pair.material) = (String::new(), None);
            (pair.final_contact_ratio_reason, pair.solver.reason) = (None, String::new());
        }
        for observable in &mut experiment.observables {
            (observable.table, observable.table_read) = (String::new(), None);
            observable.lines = Vec::new();
        }
    }
    plan
}

/// The sums of the programs of a run, and of the files that they were given; nothing where they are not known.
fn programs(run: &str) -> Option<BTreeSet<String>> {
    let record = locate(Path::new(run));
    let files = Inputs::read(folder_of(&record)).ok()??.files.into_iter();
    Some(files.filter(|file| file.role == PROGRAM).map(|file| file.sha256).collect())
}

fn beside(
    first: &Explained,
    other: &Explained,
    (one, run): (&str, &str),
) -> Result<Vec<usize>, InputError> {
    let refused = |found: String| {
        InputError::new(run, Mistake::Conflict)
            .found(found)
            .expected(format_args!("the measurements of {one}, all of them and no others"))
            .help("evidences of other data say nothing of each other: calibrate the same rows of the same tables (--window takes rows away)")
    };
    let (plan, other) = (&first.record.plan, &other.record.plan);
    let (here, there) = (plan.observables().count(), other.observables().count());
    if here != there {
        return Err(refused(format!("{there} observables, where {one} has {here}")));
    }
    let mut taken = Vec::new();
    for (experiment, observable) in plan.observables() {
        let label = plan.label(experiment, observable);
        let same = |own: &ObservablePlan| {
            (&own.control, &own.values, &own.sigma)
                == (&observable.control, &observable.values, &observable.sigma)
        };
        let mut all = other.observables().map(|(_, own)| own).enumerate();
        let found = all.find(|(place, own)| !taken.contains(place) && same(own));
        let Some((place, own)) = found else {
            return Err(refused(format!(
                "no measurements like {label} of {} ({} rows of {})",
                one,
                observable.values.len(),
                observable.table
            )));
        };
        if own.noise != observable.noise {
            let [own, theirs] = [own, observable].map(|one| noises::name(&one.noise));
            return Err(InputError::new(run, Mistake::Conflict)
                .found(format_args!("{own} errors of {label}, where {one} has {theirs} ones"))
                .expected("one noise model of each measurement in all runs")
                .help("the noise would be compared together with the explanation: calibrate both with the same --noise"));
        }
        taken.push(place);
    }
    Ok(taken)
}
