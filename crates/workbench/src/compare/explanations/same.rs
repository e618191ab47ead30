//! Whether calibrations are of the same measurements under the same noise model: otherwise their evidences say nothing of each other.

use super::super::noises;
use super::explained::Explained;
use crate::error::{InputError, Mistake};
use crate::plan::ObservablePlan;

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
    for (k, other) in others.iter().enumerate() {
        let run = given.get(k + 1).unwrap_or(&other.name);
        let same_plan = explained[..=k].iter().position(|one| one.record.plan == other.record.plan);
        if let Some(twin) = same_plan {
            return Err(InputError::new(run, Mistake::Duplicate)
                .found(format_args!(
                    "the calibration of {} once more",
                    given.get(twin).unwrap_or(run)
                ))
                .expected("another explanation")
                .help("leave one of the two out"));
        }
        places.push(beside(first, other, (given.first().unwrap_or(&first.name), run))?);
    }
    Ok(places)
}

fn beside(
    first: &Explained,
    other: &Explained,
    (one, run): (&String, &String),
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
