//! Explanations for the terminal, as Markdown and as CSV.

use std::fmt::Write as _;

use super::super::strength::{Strength, bayes_factor};
use super::ranked::{Explanation, Explanations, ExplanationsReport, FitOf};
use crate::careful::{as_far_in_words, counted};
use crate::number::{digits_of, probability, significant, with_error};
use crate::report::{aligned, markdown_table};

/// Headings and rows of a table.
pub(super) type Table = (Vec<String>, Vec<Vec<String>>);

/// The explanations, the most probable first.
fn by_evidence(ranking: &Explanations) -> Vec<&Explanation> {
    let mut sorted: Vec<&Explanation> = ranking.explanations.iter().collect();
    sorted.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    sorted
}

/// The ranking, the most probable first.
pub(super) fn ranking(ranking: &Explanations) -> Table {
    let columns = ["explanation", "log Z", "probability", "K", "ESS", "k-hat", "informed"];
    let row = |one: &Explanation| {
        let (log, error) = (one.log_evidence, one.log_evidence_se);
        vec![
            one.name.clone(),
            format!("{} ± {}", with_error(log, error, 2), significant(error, 2)),
            probability(one.probability),
            match one.strength {
                Strength::None => "1 (best)".to_owned(),
                strength => format!("{} ({strength})", bayes_factor(-one.log_bayes_factor)),
            },
            format!("{:.0}", one.ess),
            format!("{:.2}", one.khat),
            one.informed_parameters.to_string(),
        ]
    };
    (columns.map(str::to_owned).to_vec(), by_evidence(ranking).into_iter().map(row).collect())
}

/// How each observable is met: root mean square error of the best curve, and how often data made by the posterior are as far off.
pub(super) fn fits(ranking: &Explanations) -> Table {
    let labels = ranking.explanations.first().into_iter().flat_map(|one| &one.fits);
    let mut columns = vec!["RMSE (as far off again)".to_owned()];
    columns.extend(labels.map(|fit| fit.label.clone()));
    let cell = |fit: &FitOf, ess: f64| {
        let rmse = significant(fit.error.rmse, 2);
        let check = |check: smc_calib::PredictiveCheck| {
            format!("{rmse} ({})", as_far_in_words(check.as_far, counted(&check, ess)))
        };
        fit.check.map_or_else(|| rmse.clone(), check)
    };
    let row = |one: &Explanation| {
        [one.name.clone()]
            .into_iter()
            .chain(one.fits.iter().map(|fit| cell(fit, one.ess)))
            .collect()
    };
    (columns, by_evidence(ranking).into_iter().map(row).collect())
}

/// Median and 95 % interval of each parameter under each explanation.
pub(super) fn parameters(ranking: &Explanations) -> Table {
    let mut names: Vec<&str> = Vec::new();
    for one in ranking.explanations.iter().flat_map(|one| &one.informed) {
        if !names.contains(&one.name.as_str()) {
            names.push(&one.name);
        }
    }
    let mut columns = vec!["median, 95 %".to_owned()];
    columns.extend(ranking.explanations.iter().map(|one| one.name.clone()));
    let cell = |one: &Explanation, name: &str| {
        let found = one.informed.iter().find(|informed| informed.name == name);
        found.map_or_else(String::new, |found| {
            let digits = digits_of(found.eti95);
            let [lower, upper] = found.eti95.map(|end| significant(end, digits));
            format!("{} ({lower} .. {upper})", significant(found.median, digits))
        })
    };
    let row = |name: &&str| {
        let cells = ranking.explanations.iter().map(|one| cell(one, name));
        [(*name).to_owned()].into_iter().chain(cells).collect()
    };
    (columns, names.iter().map(row).collect())
}

/// A table with its columns below each other.
fn indented((columns, rows): Table) -> String {
    let all: Vec<Vec<String>> = std::iter::once(columns).chain(rows).collect();
    aligned(&all).lines().map(|line| format!("  {line}\n")).collect()
}

/// The ranking for the terminal.
pub fn text(report: &ExplanationsReport) -> String {
    let found = report.ranked();
    let mut text =
        format!("{}: {} observations, {} errors\n", found.title, found.observations, found.noise);
    text.push_str(&indented(ranking(found)));
    text.push_str(&indented(fits(found)));
    for line in &found.verdict {
        let _ = writeln!(text, "  {line}");
    }
    for line in &found.warnings {
        let _ = writeln!(text, "  careful: {line}");
    }
    text
}

/// What the columns mean.
pub(super) const MEANING: &str = "log Z is the natural logarithm of the evidence with its Monte Carlo error, the probability that of an explanation where all are as likely \
     beforehand, K the Bayes factor of the best to it with the words of Kass and Raftery (J. Am. Stat. Assoc. 90 (1995) 773). \"As far off again\" is the \
     probability that data made by the posterior are as far from their curves as the measurements; informed is the number of parameters that the data inform.";

/// The ranking as Markdown.
pub(super) fn markdown(report: &ExplanationsReport, command: &str) -> String {
    let found = report.ranked();
    let mut text = format!("# {}: explanations compared\n\n{MEANING}\n\n", found.title);
    let _ = writeln!(text, "Made by `{command}`.\n");
    for line in &found.verdict {
        let _ = writeln!(text, "**{line}**\n");
    }
    for (columns, rows) in [ranking(found), fits(found), parameters(found)] {
        text.push_str(&markdown_table(&columns, &rows));
        text.push('\n');
    }
    for line in &found.warnings {
        let _ = writeln!(text, "> {line}\n");
    }
    text
}

/// The ranking as CSV, in full precision: a row for each explanation and observable.
pub(super) fn csv(report: &ExplanationsReport) -> String {
    let mut text = String::from(
        "explanation,log_evidence,log_evidence_se,probability,log_bayes_factor,strength,observable,rmse,as_far_off,ess,khat\n",
    );
    for one in &report.ranked().explanations {
        for fit in &one.fits {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{}",
                crate::input::data_table::quoted(&one.name),
                one.log_evidence,
                one.log_evidence_se,
                one.probability,
                one.log_bayes_factor,
                one.strength,
                fit.label,
                fit.error.rmse,
                fit.check.map_or_else(String::new, |check| check.as_far.to_string()),
                one.ess,
                one.khat
            );
        }
    }
    text
}
