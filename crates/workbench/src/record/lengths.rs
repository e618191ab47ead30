//! Whether the lists of a record are as long as its plan has it: what reads them counts on that.

use super::{ExperimentRecord, ObservableRecord, Record};
use crate::error::{InputError, Mistake};
use crate::plan::ObservablePlan;

/// Refuses a record whose lists do not go together; `name` is what errors call it.
pub(super) fn check(name: &str, record: &Record) -> Result<(), InputError> {
    match wrong(record) {
        None => Ok(()),
        Some(field) => Err(InputError::new(name, Mistake::Damaged)
            .in_field(field)
            .found("a list that is not as long as its plan, or has other names")
            .expected("a posterior.json as this program writes it")
            .help("it was edited or damaged: run the calibration again or copy the file again")),
    }
}

/// The first field that does not go with the plan.
fn wrong(record: &Record) -> Option<&'static str> {
    let plan = &record.plan;
    let (n, values) = (plan.parameters.len(), plan.observations());
    let square = |rows: &[Vec<f64>]| rows.len() == n && rows.iter().all(|row| row.len() == n);
    let names = plan.parameters.iter().map(|one| &one.name);
    let experiments = plan.experiments.len() == record.experiments.len()
        && plan.experiments.iter().zip(&record.experiments).all(|(plan, found)| {
            plan.name == found.name && plan.observables.len() == found.observables.len()
        });
    let checks = [
        ("parameters", names.eq(record.parameters.iter().map(|one| &one.parameter.name))),
        ("correlation", square(&record.correlation)),
        ("correlation_si", square(&record.correlation_si)),
        ("map", record.map.theta.len() == n && record.map.outputs.len() == values),
        ("experiments", experiments),
        ("path", record.path.iter().all(|point| point.parameters.len() == n)),
        ("path", record.path.iter().all(|point| point.index < values)),
        ("population", population(record)),
        ("curves", record.experiments.iter().all(curves)),
        ("observables", record.observables().all(|(plan, found)| observable(plan, found))),
    ];
    checks.into_iter().find(|(_, holds)| !holds).map(|(field, _)| field)
}

fn population(record: &Record) -> bool {
    let (plan, found) = match (&record.plan.population, &record.population) {
        (None, None) => return true,
        (Some(plan), Some(found)) => (plan, found),
        _ => return false,
    };
    let n = record.plan.parameters.len();
    let of_members = found.members.iter().all(|member| {
        let lengths = [member.outside.len(), member.alone.len(), member.shrunk.len()];
        lengths == [n; 3]
    });
    let of_next = found.next.as_ref().is_none_or(|next| {
        let points = next.time_s.len();
        let band = |band: &[Vec<f64>; 2]| band.iter().all(|end| end.len() == points);
        next.control.len() == next.values.len()
            && next.mean.len() == points
            && band(&next.curve50)
            && band(&next.curve90)
    });
    n > 0
        && found.mean.len() == n
        && found.spread.len() == n
        && found.members.len() == plan.runs.len()
        && of_members
        && of_next
}

fn observable(plan: &ObservablePlan, found: &ObservableRecord) -> bool {
    let values = plan.values.len();
    values > 0
        && plan.control.len() == values
        && plan.sigma.as_ref().is_none_or(|sigma| sigma.len() == values)
        && (plan.lines.is_empty() || plan.lines.len() == values)
        && found.map.len() == values
        && found.residuals.values.len() == values
        && found.residuals.whitened.len() <= values
        && found.predictive.len() <= values
        && found.predictive.iter().all(|band| band.index < values)
}

fn curves(experiment: &ExperimentRecord) -> bool {
    experiment.neck_growth.as_ref().is_none_or(|neck| {
        let curves = &neck.curves;
        let points = curves.time_s.len();
        let as_long = |curve: &Option<Vec<f64>>| curve.as_ref().is_none_or(|it| it.len() == points);
        let band = |band: &[Vec<f64>; 2]| band.iter().all(|end| end.len() == points);
        points > 0
            && curves.mean.len() == points
            && curves.map.len() == points
            && as_long(&curves.paper)
            && as_long(&curves.frenkel)
            && [&curves.curve50, &curves.curve90].into_iter().chain(&curves.noisy90).all(band)
    })
}
