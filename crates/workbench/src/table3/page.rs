//! The regenerated Table 3 as the sections of its report.

use super::record::Report;
use super::render::{form, terminal};
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::page::{self, Drawn, Page, Part};
use crate::plan::{noise_in_words, prior_rows};

/// The report: the record and its figures.
pub(super) fn page(report: &Report, drawn: &[Drawn]) -> Page {
    let version = env!("CARGO_PKG_VERSION");
    let mut page = Page {
        title: "Table 3 regenerated".to_owned(),
        kind: "PS, PA12 and PEEK 450PF".to_owned(),
        version: version.to_owned(),
        summary: terminal(report),
        answer: answer(report),
        model: model(report),
        checked: checked(report),
        cite: page::citation(version),
        ..Page::default()
    };
    page.asked.say(
        "Which C1, tau_s and delta_c do the paper's own measurements give, with which intervals, and how far are its values from that?",
    );
    for (material, plan) in report.materials.iter().zip(&report.plan.materials) {
        let advice = material.advice.iter().map(|line| format!("{}: {line}", material.title));
        page.advice.extend(advice);
        for (_, observable) in plan.observables() {
            let (points, table) = (observable.values.len(), &observable.table);
            page.data.fact(&material.title, format!("{points} values of {table}"));
        }
        let source = plan.source.iter().map(|source| format!("{}: {source}.", material.title));
        page.cite.paragraphs.extend(source);
    }
    let (samples, seed) = (report.plan.samples, report.plan.seed);
    page.repeat.listings.push(format!("calibrate table3 --samples {samples} --seed {seed}"));
    page::provenance(&mut page.repeat, (version, Some(seed)), Some(&Inputs::default()), "");
    page.show(drawn, |name| caption(name).to_owned());
    page
}

/// What a figure shows.
fn caption(name: &str) -> &'static str {
    match name {
        "figure2" => "Figure 2 of the paper: which mechanism drives the contact, for PEEK 450PF.",
        "figure4" => "Figure 4 of the paper: polystyrene, measured and computed.",
        "figure5" => "Figure 5 of the paper: PA12, measured and computed.",
        "figure6" => "Figure 6 of the paper: PEEK 450PF, measured and computed.",
        _ => "A pair of PA12 that was not fitted, as its other pair predicts it.",
    }
}

fn answer(report: &Report) -> Part {
    let mut part = Part::default();
    for material in &report.materials {
        let rows = material.rows.iter().map(|row| {
            let [lower, upper] = row.eti95().map(|end| significant(end, 3));
            vec![
                row.parameter.clone(),
                form(row.form).to_owned(),
                row.unit.clone(),
                significant(row.paper, 3),
                significant(row.map, 3),
                significant(row.median(), 3),
                format!("{lower} … {upper}"),
                format!("{:.1} %", row.paper_percentile),
            ]
        });
        let columns = [
            "parameter",
            "form",
            "unit",
            "paper",
            "MAP",
            "median",
            "95 % interval",
            "paper's percentile",
        ];
        part.table(&material.title, &columns, rows.collect());
    }
    let or_dash = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| significant(v, 3));
    let rows = report.statements.iter().map(|one| {
        let posterior = one.posterior.as_ref().map(|estimate| {
            let [lower, upper] = estimate.eti95.map(|end| significant(end, 3));
            format!("{} ({lower} … {upper})", significant(estimate.median, 3))
        });
        vec![
            format!("{}: {} {}", one.material, one.quantity, one.unit).trim_end().to_owned(),
            one.words.clone(),
            or_dash(one.paper_parameters),
            or_dash(one.map),
            posterior.unwrap_or_else(|| "–".to_owned()),
        ]
    });
    let columns =
        ["quantity", "the paper says", "its parameters give", "our MAP", "our posterior, 95 %"];
    part.table("Statements of the paper's section 4", &columns, rows.collect());
    part
}

fn model(report: &Report) -> Part {
    let mut part = Part::default();
    for (material, plan) in report.materials.iter().zip(&report.plan.materials) {
        part.table(
            format!("Priors of {}", material.title),
            &["parameter", "unit", "prior"],
            prior_rows(plan),
        );
        for (_, observable) in plan.observables() {
            part.fact(format!("Noise of {}", material.title), noise_in_words(&observable.noise));
        }
    }
    let rows = report.readings.iter().map(|reading| {
        let rmse = reading.rmse.map(|rmse| significant(rmse, 2)).join(", ");
        vec![reading.name.clone(), reading.meaning.clone(), significant(reading.rms_ln, 2), rmse]
    });
    let columns = ["reading", "meaning", "RMS of ln(value / statement)", "RMSE of PS, PA12, PEEK"];
    part.table("Ways to read the printed table", &columns, rows.collect());
    part
}

fn checked(report: &Report) -> Part {
    let mut part = Part::default();
    let rows = report.materials.iter().map(|material| {
        let [evidence, error] = material.log_evidence;
        vec![
            material.title.clone(),
            if material.converged { "converged" } else { "not converged" }.to_owned(),
            format!("{:.0}", material.ess),
            format!("{:.2}", material.khat),
            format!("{evidence:.2} ± {}", significant(error, 2)),
        ]
    });
    let columns = ["material", "sampling", "ESS", "k-hat", "log evidence"];
    part.table("Diagnostics", &columns, rows.collect());
    for material in &report.materials {
        let rows = material.fits.iter().map(|fit| {
            vec![fit.curve.clone(), significant(fit.error.rmse, 2), significant(fit.error.max, 2)]
        });
        let columns = ["curve", "RMSE of a/R", "largest error"];
        part.table(format!("{}: errors of curves", material.title), &columns, rows.collect());
    }
    let check = &report.unfitted;
    part.fact(
        format!("{}, not fitted", check.predicted),
        format!(
            "{:.0} % of its measurements are inside the 90 % band that {} gives; RMSE {}",
            100.0 * check.coverage[1],
            check.fitted,
            significant(check.error.rmse, 2)
        ),
    );
    part
}
