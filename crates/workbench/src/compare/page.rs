//! A comparison as the sections of its report.

use smc_calib::trust::limits::{INFORMED_BITS, KHAT_LIMIT};

use super::comparison::{Entry, Report};
use super::render;
use crate::number::{probability, significant, with_error};
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, Page, Part};
use crate::plan::{noise_in_words, noise_option, prior_rows, shell_word};

/// The report of a comparison: its record, its figures, the files that it was made of, and the sums of its own.
pub(super) fn page(report: &Report, drawn: &[Drawn], inputs: Option<&Inputs>, sums: &str) -> Page {
    let titles: Vec<&str> = report.comparisons.iter().map(|one| one.title.as_str()).collect();
    let version = env!("CARGO_PKG_VERSION");
    let mut page = Page {
        title: titles.join(", "),
        kind: "Comparison of kinetics and noise".to_owned(),
        version: version.to_owned(),
        summary: report.comparisons.iter().map(render::terminal).collect(),
        advice: report.comparisons.iter().flat_map(|one| one.warnings.clone()).collect(),
        asked: asked(report),
        answer: answer(report),
        model: model(report),
        checked: checked(report),
        cite: page::citation(version),
        ..Page::default()
    };
    for plan in &report.plan.experiments {
        for (_, observable) in plan.observables() {
            let (points, table) = (observable.values.len(), &observable.table);
            page.data.fact(&plan.name, format!("{points} values of {table}"));
        }
        page.cite
            .paragraphs
            .extend(plan.source.iter().map(|source| format!("The data: {source}.")));
    }
    page.repeat.listings.push(command(report, inputs));
    let seed = Some(report.plan.seed);
    page::provenance(&mut page.repeat, (version, seed), inputs, sums);
    page.show(drawn, |name| {
        let which = name.strip_prefix("compare-").unwrap_or(name);
        format!("Best curve of each kinetics on the measurements of {which}.")
    });
    page
}

fn asked(report: &Report) -> Part {
    let mut part = Part::default();
    part.say("Which kinetics do the data support, how strongly, and under which noise?");
    part.fact("Noise models", report.plan.noises.join(", "));
    part.fact(
        "Simulations",
        format!("{} for each model, seed {}", report.plan.samples, report.plan.seed),
    );
    let phi = if report.plan.phi { "calibrated too" } else { "as in the experiment" };
    part.fact("Final contact ratio", phi);
    part
}

fn answer(report: &Report) -> Part {
    let mut part = Part::default();
    for comparison in &report.comparisons {
        comparison
            .verdict
            .iter()
            .for_each(|line| part.say(format!("{}: {line}", comparison.title)));
        let rows = comparison.entries.iter().map(|entry| {
            let tau_s = entry.informed.iter().find(|one| one.name == "tau_s");
            vec![
                entry.kinetics.clone(),
                entry.noise.clone(),
                log_evidence(entry),
                probability(entry.probability),
                significant(entry.error.rmse, 2),
                tau_s.map_or_else(String::new, |one| {
                    let [lower, upper] = one.eti95.map(|end| significant(end, 3));
                    format!("{} ({lower} … {upper})", significant(one.median, 3))
                }),
            ]
        });
        let columns =
            ["kinetics", "errors", "log Z", "probability", "RMSE of the MAP", "tau_s [s], 95 %"];
        part.table(format!("{}: all models", comparison.title), &columns, rows.collect());
    }
    part
}

fn log_evidence(entry: &Entry) -> String {
    let error = entry.log_evidence_se;
    format!("{} ± {}", with_error(entry.log_evidence, error, 2), significant(error, 2))
}

fn model(report: &Report) -> Part {
    let mut part = Part::default();
    for plan in &report.plan.experiments {
        let caption = format!("Priors of {}, the same for every kinetics", plan.title);
        part.table(caption, &["parameter", "unit", "prior"], prior_rows(plan));
    }
    for noise in report.comparisons.first().iter().flat_map(|one| &one.noises) {
        part.fact(format!("{} errors", noise.name), noise_in_words(&noise.noise));
    }
    part
}

fn checked(report: &Report) -> Part {
    let mut part = Part::default();
    part.say(format!(
        "Weights are trustworthy below a k-hat of {KHAT_LIMIT}; a parameter is informed from {INFORMED_BITS} bits."
    ));
    for comparison in &report.comparisons {
        let rows = comparison.entries.iter().map(|entry| {
            let alike = if entry.residuals_independent { "independent" } else { "not independent" };
            vec![
                entry.kinetics.clone(),
                entry.noise.clone(),
                entry.sampling.to_string(),
                format!("{:.0}", entry.ess),
                format!("{:.2}", entry.khat),
                format!("{:.2} ({alike})", entry.residual_lag1),
                entry.informed_parameters.to_string(),
            ]
        });
        let columns = [
            "kinetics",
            "errors",
            "sampling",
            "ESS",
            "k-hat",
            "neighbouring residuals",
            "informed",
        ];
        part.table(format!("{}: diagnostics", comparison.title), &columns, rows.collect());
    }
    part
}

/// The command that makes it again.
fn command(report: &Report, inputs: Option<&Inputs>) -> String {
    let mut words = vec!["calibrate compare".to_owned()];
    if let [plan] = &report.plan.experiments[..] {
        let own = |role: &str| {
            inputs.and_then(|inputs| inputs.by_role(role)).map(|file| shell_word(&file.name))
        };
        match own("experiment") {
            Some(file) => words.push(format!("--experiment {file}")),
            None => words.push(format!("--material {}", plan.name)),
        }
        words.extend(own("priors").map(|file| format!("--prior {file}")));
    }
    let noises: Vec<String> = report
        .comparisons
        .first()
        .iter()
        .flat_map(|one| &one.noises)
        .map(|one| noise_option(&one.noise))
        .collect();
    let noises = noises.join(",");
    words.push(format!(
        "--noise {noises} --samples {} --seed {}",
        report.plan.samples, report.plan.seed
    ));
    words.extend(report.plan.phi.then(|| "--phi".to_owned()));
    words.join(" ")
}
