//! The posterior as the table that a paper prints.

use std::borrow::Borrow;
use std::fmt::Write as _;

use smc_calib::trust::limits::khat_in_words;
use smc_calib::{Coordinate, ShapeSummary};

use super::noise::{beside_markdown, length_unit, noise_line, or_one};
use super::summary::{OF_TABLE3, failing_line, is_uninformed, neck_growth, paper_place};
use crate::careful::{as_far_in_words, counted};
use crate::input::data_table::quoted;
use crate::number::{digits_of, shown_unit, significant, with_error};
use crate::plan::{ObservablePlan, SimulatorPlan};
use crate::record::{ObservableRecord, Record};

/// One line of the posterior table.
struct Row {
    parameter: String,
    unit: String,
    form: &'static str,
    map: Option<f64>,
    median: f64,
    eti95: [f64; 2],
    /// Mean and standard deviation in the coordinate the prior is flat or normal in.
    mean_sd: (f64, f64, Coordinate),
    bits: Option<f64>,
    informed: bool,
    paper: Option<f64>,
    percentile: Option<f64>,
}

fn rows(record: &Record) -> Vec<Row> {
    let neck = neck_growth(record);
    let paper = neck.and_then(|neck| neck.paper.as_ref());
    let mut rows: Vec<Row> = record
        .parameters
        .iter()
        .enumerate()
        .map(|(place, summary)| {
            let (name, moments) = (&summary.parameter.name, &summary.in_coordinate);
            let percentile = paper.and_then(|paper| paper.percentile_si.get(place).copied()?);
            Row {
                parameter: name.clone(),
                unit: summary.parameter.unit.clone(),
                form: "SI",
                map: Some(summary.map),
                median: summary.in_si.median,
                eti95: [summary.in_si.eti95.lower, summary.in_si.eti95.upper],
                mean_sd: (moments.mean, moments.sd, summary.coordinate),
                bits: Some(summary.information_gain_bits),
                informed: !is_uninformed(record, name),
                paper: percentile.and_then(|_| Some(paper?.si[paper_place(name)?])),
                percentile,
            }
        })
        .collect();
    if let Some(product) = neck.and_then(|neck| neck.product.as_ref()) {
        rows.push(Row {
            parameter: product.name.clone(),
            unit: product.unit.clone(),
            form: "SI",
            map: Some(product.map),
            median: product.median,
            eti95: product.eti95,
            mean_sd: (product.mean_log10, product.sd_log10, Coordinate::Log10),
            bits: Some(product.information_gain_bits),
            informed: true,
            paper: product.paper,
            percentile: product.paper_percentile,
        });
    }
    for printed in neck.map_or(&[][..], |neck| &neck.printed) {
        rows.push(Row {
            parameter: printed.name.clone(),
            unit: printed.unit.clone(),
            form: "as printed in Table 3",
            map: Some(printed.map),
            median: printed.median,
            eti95: printed.eti95,
            mean_sd: (printed.mean_log10, printed.sd_log10, Coordinate::Log10),
            bits: None,
            informed: true,
            paper: printed.paper,
            percentile: printed.paper_percentile,
        });
    }
    for (plan, found) in record.observables() {
        let named = |what: &str| match record.plan.observables().count() {
            1 => what.to_owned(),
            _ => format!("{what} of {}", found.label),
        };
        if let Some(sigma) = &found.sigma {
            let (median, moments) = ((sigma.median, sigma.eti95), (sigma.mean, sigma.sd));
            rows.push(noise_row(named("sigma"), &plan.unit, median, moments));
        }
        if let Some(ShapeSummary::Correlated { scale, length, white_share, .. }) =
            &found.noise_shape
        {
            let unit = length_unit(*scale, plan);
            for (what, unit, found) in
                [("correlation length", unit, length), ("white share", "1", white_share)]
            {
                // No standard deviation is computed of them.
                let (median, moments) = ((found.median, found.eti95), (found.mean, f64::NAN));
                rows.push(noise_row(named(what), unit, median, moments));
            }
        }
    }
    rows
}

/// A number of the noise, by median, 95 % interval, mean and standard deviation.
fn noise_row(
    parameter: String,
    unit: &str,
    (median, eti95): (f64, [f64; 2]),
    (mean, sd): (f64, f64),
) -> Row {
    Row {
        parameter,
        unit: or_one(unit).to_owned(),
        form: "noise",
        map: None,
        median,
        eti95,
        mean_sd: (mean, sd, Coordinate::Linear),
        bits: None,
        informed: true,
        paper: None,
        percentile: None,
    }
}

/// The posterior as a Markdown table.
pub fn markdown(record: &Record) -> String {
    let plan = &record.plan;
    let mut text = format!("# {}\n\n", plan.title);
    if !record.is_posterior {
        text.push_str(
            "**Not a posterior**: the noise was tuned to a wished-for effective sample size, and the proposals were not \
             corrected for.\n\n",
        );
    }
    for experiment in &plan.experiments {
        let observations = experiment.width();
        let _ = match &experiment.simulator {
            SimulatorPlan::Builtin(pair) => writeln!(
                text,
                "{}: {} kinetics, {observations} observations, R = {} µm.\n",
                experiment.name,
                pair.kinetics,
                significant(1e6 * pair.powder.radius_m, 3),
            ),
            SimulatorPlan::Command(_) | SimulatorPlan::Function { .. } => {
                writeln!(text, "{}: {observations} observations.\n", experiment.name)
            }
        };
    }
    let (simulations, seed) = (record.counters.simulations, plan.sampler.seed);
    let _ = writeln!(text, "{simulations} simulations, seed {seed}.\n");
    if let Some(earlier) = &plan.proposal {
        let _ = writeln!(text, "Begun from {}: {}.\n", earlier.result(), earlier.taken());
    }
    let (columns, rows) = posterior_cells(record);
    text.push_str(&markdown_table(&columns, &rows));
    if neck_growth(record).is_some_and(|neck| !neck.printed.is_empty()) {
        let _ = writeln!(text, "\nAs printed in Table 3: {OF_TABLE3}.");
    }
    text.push_str(&observables_markdown(record));
    text.push_str(&beside_markdown(record));
    let evidence = record.trust.evidence(&record.log_evidence).replace("+-", "±");
    let _ = writeln!(
        text,
        "\n{evidence}; effective sample size {:.0}; k-hat {}.",
        record.ess.importance,
        khat_in_words(record.khat)
    );
    for failure in &record.failures {
        let _ = writeln!(text, "\n> failed {} times: {}", failure.count, failure.cause);
    }
    if let Some(line) = failing_line(record) {
        let _ = writeln!(text, "\n> {}", line.replace("+-", "±"));
    }
    for line in &record.advice {
        let _ = writeln!(text, "\n> {line}");
    }
    text
}

/// A table as Markdown.
pub(crate) fn markdown_table<C: Borrow<str>>(columns: &[C], rows: &[Vec<String>]) -> String {
    let mut text = format!("| {} |\n|{}\n", columns.join(" | "), "---|".repeat(columns.len()));
    for row in rows {
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// Rows with their columns below each other, each row on a line of its own.
pub(crate) fn aligned<R: AsRef<[String]>>(rows: &[R]) -> String {
    let cell = |row: &R, column: usize| row.as_ref().get(column).map_or(0, |c| c.chars().count());
    let columns = rows.iter().map(|row| row.as_ref().len()).max().unwrap_or(0);
    let width = |column: usize| rows.iter().map(|row| cell(row, column)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |row: &R| {
        let cells = row.as_ref().iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

/// The posterior table: headings, and the cells as they are read.
pub(super) fn posterior_cells(record: &Record) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let rows = rows(record);
    let with_paper = rows.iter().any(|row| row.paper.is_some());
    let mut columns = vec![
        "parameter",
        "unit",
        "form",
        "MAP",
        "median",
        "95 % interval",
        "mean ± sd",
        "information [bits]",
    ];
    if with_paper {
        columns.extend(["paper", "paper's percentile"]);
    }
    (columns, rows.iter().map(|row| cells(row, with_paper)).collect())
}

fn cells(row: &Row, with_paper: bool) -> Vec<String> {
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "–".to_owned());
    let (mean, sd, coordinate) = row.mean_sd;
    // A standard deviation that does not exist is stored as the largest number there is.
    let values = if sd < f64::MAX {
        format!("{} ± {}", with_error(mean, sd, 2), significant(sd, 2))
    } else if sd.is_nan() {
        significant(mean, 3)
    } else {
        format!("{} (no finite sd)", significant(mean, 3))
    };
    let log10 = if coordinate == Coordinate::Log10 { " (log10)" } else { "" };
    let bits = row
        .bits
        .map(|bits| format!("{bits:.2}{}", if row.informed { "" } else { " (not informed)" }));
    let digits = digits_of(row.eti95);
    let [lower, upper] = row.eti95.map(|end| significant(end, digits));
    let mut cells = vec![
        row.parameter.clone(),
        row.unit.clone(),
        row.form.to_owned(),
        or_dash(row.map.map(|map| significant(map, digits))),
        significant(row.median, digits),
        format!("{lower} … {upper}"),
        format!("{values}{log10}"),
        or_dash(bits),
    ];
    if with_paper {
        cells.push(or_dash(row.paper.map(|paper| significant(paper, 3))));
        cells.push(or_dash(row.percentile.map(|percentile| format!("{percentile:.1} %"))));
    }
    cells
}

/// How well each observable is met: headings and cells.
pub(super) fn observable_cells(record: &Record) -> (Vec<&'static str>, Vec<Vec<String>>) {
    let mut columns =
        vec!["observable", "points", "RMSE of the MAP", "errors", "noise sigma, 95 %", "residuals"];
    let checked = record.observables().any(|(_, found)| found.check.is_some());
    columns.extend(checked.then_some("as far off again"));
    let row = |(plan, found): (&ObservablePlan, &ObservableRecord)| {
        let sigma = match &found.sigma {
            None => "as the table states".to_owned(),
            Some(sigma) if sigma.fixed => format!("{} (given)", significant(sigma.median, 3)),
            Some(sigma) => {
                let [lower, upper] = sigma.eti95.map(|end| significant(end, 2));
                format!("{} ({lower} … {upper})", significant(sigma.median, 2))
            }
        };
        let rmse = format!("{} {}", significant(found.map_error.rmse, 2), shown_unit(&plan.unit));
        let alike = if found.residuals.independent { "independent" } else { "not independent" };
        let mut cells = vec![
            found.label.clone(),
            plan.values.len().to_string(),
            rmse.trim_end().to_owned(),
            plan.noise.kind().to_owned(),
            sigma,
            alike.to_owned(),
        ];
        if checked {
            let ess = record.ess.importance;
            let words =
                found.check.map(|check| as_far_in_words(check.as_far, counted(&check, ess)));
            cells.push(words.unwrap_or_default());
        }
        cells
    };
    (columns, record.observables().map(row).collect())
}

/// The same as Markdown, and what else is to be said of the errors.
fn observables_markdown(record: &Record) -> String {
    let (columns, rows) = observable_cells(record);
    let mut text = format!("\n{}", markdown_table(&columns, &rows));
    for (plan, found) in record.observables() {
        let line = noise_line(plan, found);
        if !line.is_empty() {
            let _ = writeln!(text, "\n{}: {}.", found.label, line.trim());
        }
    }
    text
}

/// The posterior table as CSV, in full precision.
pub fn csv(record: &Record) -> String {
    let mut text = String::from(
        "parameter,unit,form,map,median,eti95_lower,eti95_upper,mean,sd,mean_sd_coordinate,information_gain_bits,paper,paper_percentile\n",
    );
    let or_empty = |value: Option<f64>| {
        value.filter(|value| value.is_finite()).map_or_else(String::new, |value| value.to_string())
    };
    for row in rows(record) {
        let (mean, sd, coordinate) = row.mean_sd;
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{},{},{}",
            quoted(&row.parameter),
            quoted(&row.unit),
            row.form,
            or_empty(row.map),
            row.median,
            row.eti95[0],
            row.eti95[1],
            or_empty(Some(mean)),
            or_empty(Some(sd)),
            match coordinate {
                Coordinate::Log10 => "log10",
                Coordinate::Linear => "linear",
            },
            or_empty(row.bits),
            or_empty(row.paper),
            or_empty(row.percentile),
        );
    }
    text
}
