//! Explanations as the sections of a report.

use super::ranked::ExplanationsReport;
use super::text::{self, MEANING, Table};
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, Page, Part};
use crate::plan::{noise_in_words, prior_rows};

/// The report of a ranking: its record, its figures, the files and the command that it was made by, and the sums of its own.
pub(super) fn page(
    report: &ExplanationsReport,
    drawn: &[Drawn],
    (inputs, command): (Option<&Inputs>, &str),
    sums: &str,
) -> Page {
    let found = report.ranked();
    let version = env!("CARGO_PKG_VERSION");
    let mut page = Page {
        title: found.title.clone(),
        kind: "Comparison of explanations".to_owned(),
        version: version.to_owned(),
        summary: text::text(report),
        advice: found.warnings.clone(),
        asked: asked(report),
        answer: answer(report),
        model: model(report),
        cite: page::citation(version),
        ..Page::default()
    };
    let plans = &report.plan.experiments;
    for (_, observable) in plans.iter().take(1).flat_map(|plan| plan.observables()) {
        let (points, table) = (observable.values.len(), &observable.table);
        page.data.fact(table, format!("{points} values"));
    }
    let mut sources: Vec<&String> = plans.iter().filter_map(|plan| plan.source.as_ref()).collect();
    sources.dedup();
    page.cite.paragraphs.extend(sources.iter().map(|source| format!("The data: {source}.")));
    page.repeat.listings.push(command.to_owned());
    let seed = plans.first().map(|plan| plan.sampler.seed);
    page::provenance(&mut page.repeat, (version, seed), inputs, sums);
    page.show(drawn, |name| {
        let which = name.strip_prefix("compare-").unwrap_or(name);
        format!("Best curve of each explanation on the measurements of {which}.")
    });
    page
}

fn asked(report: &ExplanationsReport) -> Part {
    let mut part = Part::default();
    part.say("Which explanation of the same measurements do they support, and how strongly?");
    let found = report.ranked();
    for (one, plan) in found.explanations.iter().zip(&report.plan.experiments) {
        part.fact(&one.name, format!("{} ({} simulations)", plan.title, plan.budget()));
    }
    for (one, run) in found.explanations.iter().zip(&report.plan.runs) {
        part.fact(format!("Run of {}", one.name), run);
    }
    part
}

fn put(part: &mut Part, caption: &str, (columns, rows): Table) {
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    part.table(caption, &columns, rows);
}

fn answer(report: &ExplanationsReport) -> Part {
    let mut part = Part::default();
    let found = report.ranked();
    found.verdict.iter().for_each(|line| part.say(line));
    part.say(MEANING);
    put(&mut part, "Explanations by evidence", text::ranking(found));
    put(&mut part, "How the measurements are met", text::fits(found));
    put(&mut part, "Parameters under each explanation", text::parameters(found));
    part
}

fn model(report: &ExplanationsReport) -> Part {
    let mut part = Part::default();
    let found = report.ranked();
    for (one, plan) in found.explanations.iter().zip(&report.plan.experiments) {
        let caption = format!("Priors of \"{}\"", one.name);
        part.table(caption, &["parameter", "unit", "prior"], prior_rows(plan));
    }
    for (experiment, observable) in
        report.plan.experiments.iter().take(1).flat_map(|plan| plan.observables())
    {
        part.fact(
            format!("Errors of {} of {}", observable.name, experiment.name),
            noise_in_words(&observable.noise),
        );
    }
    part
}
