//! `proposal`: reads an earlier posterior, and makes it the first proposal of a plan.

use std::path::Path;

use smc_calib::trust::limits::FEWEST_EFFECTIVE_SAMPLES;
use smc_calib::{CalibrateError, FirstProposal, Parameter, Verdict};

use super::earlier::EarlierPosterior;
use super::types::Plan;
use crate::careful::Careful;
use crate::error::{InputError, Mistake};
use crate::output::checksums;
use crate::record::{self, Record};
use crate::report::PointColumns;

/// Largest share of the earlier posterior outside the new priors that is not warned of.
const OUTSIDE: f64 = 0.5;

/// Where a plan names the earlier result.
pub(super) struct Named<'a> {
    /// The text that names it.
    pub(super) from: &'a str,
    /// Its path.
    pub(super) path: &'a Path,
    /// An error in the option or field.
    pub(super) place: &'a dyn Fn(Mistake) -> InputError,
}

/// Makes the result that is named the first proposal of a plan. Where `kept` is what a run that goes on has begun from under the
/// same name, it is that: the result itself may have been moved or changed.
pub(super) fn begin_from(
    plan: &mut Plan,
    named: &Named<'_>,
    kept: Option<&EarlierPosterior>,
    warnings: &mut Vec<String>,
) -> Result<(), InputError> {
    if let Some(kept) = kept.filter(|kept| kept.from == named.from) {
        plan.proposal = Some(kept.clone());
        return Ok(());
    }
    let refused = if plan.design.is_some() {
        Some("an earlier posterior beside a design, whose sets are given")
    } else if plan.is_tuned() {
        Some(
            "an earlier posterior beside tuned noise (ess-target), which weights samples as draws from the prior",
        )
    } else {
        None
    };
    if let Some(found) = refused {
        return Err((named.place)(Mistake::Conflict).found(found).help("leave one of them out"));
    }
    let (earlier, said) = read(plan, named)?;
    plan.proposal = Some(earlier);
    warnings.extend(said);
    Ok(())
}

/// Reads the result; and the reasons to be careful with it.
fn read(plan: &Plan, named: &Named<'_>) -> Result<(EarlierPosterior, Vec<String>), InputError> {
    let Named { from, path, place } = *named;
    let named_here = |error: InputError| {
        let option = place(Mistake::MissingFile);
        let field = option.field.as_deref().map_or_else(String::new, |field| format!(", {field}"));
        error.help(format_args!(
            "it is the earlier result of {}{field}: the folder of a finished calibration, or its posterior.json",
            option.source_name
        ))
    };
    if !path.exists() {
        return Err(place(Mistake::MissingFile)
            .found(format_args!("{}, which is not there", path.display()))
            .expected("the folder of a finished calibration, or its posterior.json"));
    }
    let record = record::read(path).map_err(named_here)?;
    let file = record::locate(path);
    let folder = file.parent().unwrap_or(Path::new("."));
    let points = PointColumns::read(&record, folder).map_err(named_here)?;
    let theirs = |own: &Parameter| {
        let same =
            |(_, other): &(usize, &Parameter)| other.name == own.name && other.unit == own.unit;
        parameters(&record).enumerate().find(same).map(|(place, _)| place)
    };
    let places: Vec<Option<usize>> = plan.parameters.iter().map(theirs).collect();
    let columns: Vec<Option<&[f64]>> =
        places.iter().map(|at| at.map(|at| points.parameters[at].as_slice())).collect();
    let chosen = |there: bool| {
        let own = plan.parameters.iter().zip(&places).filter(move |(_, at)| at.is_some() == there);
        own.map(|(own, _)| own.name.clone()).collect::<Vec<_>>()
    };
    let left_out = parameters(&record).enumerate().filter(|(at, _)| !places.contains(&Some(*at)));
    let left_out = left_out.map(|(_, other)| {
        match plan.parameters.iter().find(|own| own.name == other.name) {
            Some(own) => format!("{} (in {} there, in {} here)", other.name, other.unit, own.unit),
            None => other.name.clone(),
        }
    });
    let left_out: Vec<String> = left_out.collect();
    let settings = &plan.sampler;
    let fitted = FirstProposal::fitted(&plan.parameters, &columns, &points.weights, settings);
    let first = fitted.map_err(|error| {
        let names = plan.parameter_names().join(", ");
        let refused = place(Mistake::Conflict);
        match error {
            CalibrateError::FirstProposal { .. } if columns.iter().all(Option::is_none) => refused
                .found(format_args!("{from}, with the parameters {}", left_out.join(", ")))
                .expected(format_args!("one of {names} among them, in the same unit"))
                .help("parameters are matched by name"),
            CalibrateError::FirstProposal { problem } => refused
                .found(format_args!("{from}: {problem}"))
                .help("widen the priors to where it is, or leave it out"),
            other => refused.found(other),
        }
    })?;
    let mut said = Vec::new();
    // What is fitted to a few weighted samples is doubtful, however well a process knows means and intervals.
    let few = record.trust.effective_samples < FEWEST_EFFECTIVE_SAMPLES;
    let by_few = !record.drawn_by_process && (few || record.trust.has_heavy_tail());
    if by_few || record.trust.verdict == Verdict::Untrusted || !record.is_posterior {
        said.push(Careful::UntrustedProposal { from: from.to_owned() }.to_string());
    }
    if first.outside_priors > OUTSIDE {
        let (from, share) = (from.to_owned(), first.outside_priors);
        said.push(Careful::ProposalOutsidePriors { from, share }.to_string());
    }
    let earlier = EarlierPosterior {
        from: from.to_owned(),
        run: record.plan.name.clone(),
        seed: record.plan.sampler.seed,
        simulations: record.counters.simulations,
        sha256: checksums::of_file(&file)?,
        parameters: chosen(true),
        from_prior: chosen(false),
        left_out,
        first,
    };
    Ok((earlier, said))
}

fn parameters(record: &Record) -> impl Iterator<Item = &Parameter> {
    record.parameters.iter().map(|summary| &summary.parameter)
}
