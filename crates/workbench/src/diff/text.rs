//! Two calibrations side by side as text, and as the sections of a report.

use super::numbers::{Diff, Moved};
use crate::number::{digits_of, shown_unit, significant, with_error};
use crate::output::inputs::Inputs;
use crate::output::on_one_line;
use crate::output::page::{self, Drawn, MOST_ROWS, Page};
use crate::plan::shell_word;

/// A difference in a unit, which has its space before it, with its standard error where that is known.
fn with_se(value: Option<f64>, error: Option<f64>, unit: &str) -> String {
    match (value, error) {
        (Some(value), Some(error)) => {
            let (value, error) =
                (signed(value, with_error(value, error, 2)), significant(error, 2));
            format!("{value} ± {error}{unit}")
        }
        (Some(value), None) => {
            format!("{}{unit} (error unknown)", signed(value, significant(value, 2)))
        }
        (None, _) => "–".to_owned(),
    }
}

/// A number as it is shown, with its sign where that is a plus too.
fn signed(value: f64, shown: String) -> String {
    if value.is_sign_negative() { shown } else { format!("+{shown}") }
}

/// Median and 95 % interval of the first run or the other.
fn value(moved: &Moved, place: usize) -> String {
    let eti95 = moved.eti95[place];
    let digits = digits_of(eti95);
    let [lower, upper] = eti95.map(|end| significant(end, digits));
    let median = significant(moved.median[place], digits);
    let [one, other] = &moved.units;
    // The same unit is named once, behind both.
    let unit = if one == other { "" } else { shown_unit(&moved.units[place]) };
    format!("{median} ({lower} .. {upper}) {unit}").trim_end().to_owned()
}

/// The unit that both have, as it is shown; empty where they have not.
fn same_unit(moved: &Moved) -> &str {
    let [one, other] = &moved.units;
    if one == other { shown_unit(one) } else { "" }
}

/// The unit of a parameter, or both.
fn unit(moved: &Moved) -> String {
    let [one, other] = &moved.units;
    if one == other { one.clone() } else { format!("{one}, {other}") }
}

/// The comparison as text.
pub fn text(diff: &Diff) -> String {
    let [one, other] = names(diff);
    let titles = diff.titles.each_ref().map(|title| on_one_line(title));
    let mut text = format!("{one} ({}) and {other} ({})\n", titles[0], titles[1]);
    match diff.plans.len() {
        0 => text.push_str("  plans: the same\n"),
        _ => text.push_str("  plans differ in\n"),
    }
    for field in diff.plans.iter().take(MOST_ROWS) {
        let or_none = |value: &Option<String>| {
            value.as_deref().map_or_else(|| "nothing".to_owned(), on_one_line)
        };
        let (was, is) = (or_none(&field.one), or_none(&field.other));
        text.push_str(&format!("    {}: {was} -> {is}\n", field.field));
    }
    if diff.plans.len() > MOST_ROWS {
        text.push_str(&format!("    and {} more\n", diff.plans.len() - MOST_ROWS));
    }
    for moved in &diff.parameters {
        let by = match (moved.shift_sd, moved.widening) {
            (Some(_), Some(widening)) => format!(
                "moves by {}, {} times as wide",
                with_se(moved.shift_sd, moved.shift_se, " sd"),
                significant(widening, 2)
            ),
            _ => moved.not_comparable.as_deref().map_or_else(String::new, on_one_line),
        };
        text.push_str(&format!(
            "  {:<10} {}; {by}\n",
            moved.name,
            on_one_line(
                format!("{} -> {} {}", value(moved, 0), value(moved, 1), same_unit(moved))
                    .trim_end()
            ),
        ));
    }
    for (run, names) in [&one, &other].into_iter().zip(&diff.only) {
        if !names.is_empty() {
            text.push_str(&format!("  only in {run}: {}\n", names.join(", ")));
        }
    }
    text.push_str(&format!("  {}\n", evidence(diff)));
    if let Some(words) = errors(diff) {
        text.push_str(&format!("  errors: {words}\n"));
    }
    for line in &diff.advice {
        text.push_str(&format!("  trust: {line}\n"));
    }
    text
}

/// The runs as they were named.
fn names(diff: &Diff) -> [String; 2] {
    diff.plan.runs.each_ref().map(|run| on_one_line(&run.display().to_string()))
}

/// What the standard errors of the differences leave out; none where they leave out nothing, or where there are none.
fn errors(diff: &Diff) -> Option<String> {
    let seed = diff.same_seed?;
    let [one, other] = &diff.plan.sha256;
    if one == other {
        return Some("both are one result".to_owned());
    }
    let shown = diff.evidence.difference_se.is_some()
        || diff.parameters.iter().any(|moved| moved.shift_se.is_some());
    shown.then(|| format!(
        "both runs have the seed {seed}, so that their errors may be alike: those of the differences take them as independent, and \
         may be too large or too small; another --seed makes them independent"
    ))
}

fn evidence(diff: &Diff) -> String {
    let evidence = &diff.evidence;
    let [a, b] = evidence.log_evidence.map(|value| format!("{value:.3}"));
    match &evidence.not_comparable {
        Some(why) => format!("log evidence {a} and {b}: not to be compared, {why}"),
        None => format!(
            "log evidence {a} -> {b}: {}; a Bayes factor of {} for the other",
            with_se(evidence.difference, evidence.difference_se, ""),
            significant(evidence.difference.unwrap_or_default().exp(), 2)
        ),
    }
}

/// The report of the comparison.
pub(super) fn page(diff: &Diff, drawn: &[Drawn], inputs: &Inputs) -> Page {
    let version = env!("CARGO_PKG_VERSION");
    let [one, other] = names(diff);
    let mut page = Page {
        title: format!("{one} and {other}"),
        kind: "Two calibrations side by side".to_owned(),
        version: version.to_owned(),
        summary: text(diff),
        advice: diff.advice.clone(),
        cite: page::citation(version),
        ..Page::default()
    };
    page.asked.say("What differs between the plans of two calibrations, and what did that do to their answers?");
    page.data.fact(&one, &diff.titles[0]);
    page.data.fact(&other, &diff.titles[1]);
    let rows = diff.parameters.iter().map(|moved| {
        vec![
            format!("{} [{}]", moved.name, unit(moved)),
            value(moved, 0),
            value(moved, 1),
            with_se(moved.shift_sd, moved.shift_se, ""),
            moved.widening.map_or_else(|| "–".to_owned(), |wider| significant(wider, 2)),
        ]
    });
    let columns = ["parameter", &one, &other, "moves by [sd]", "times as wide"];
    page.answer.table("Parameters: median and 95 % interval", &columns, rows.collect());
    page.answer.fact("Evidence", evidence(diff));
    if let Some(words) = errors(diff) {
        page.answer.fact("Errors of the differences", words);
    }
    let rows = diff.plans.iter().take(MOST_ROWS).map(|field| {
        let or_dash = |value: &Option<String>| value.clone().unwrap_or_else(|| "–".to_owned());
        vec![field.field.clone(), or_dash(&field.one), or_dash(&field.other)]
    });
    page.model.table("What differs in the plans", &["field", &one, &other], rows.collect());
    for (run, trusted) in [&one, &other].into_iter().zip(diff.trusted) {
        page.checked
            .fact(run, if trusted { "to be trusted" } else { "not to be trusted as it stands" });
    }
    let [one, other] = diff.plan.runs.each_ref().map(|run| shell_word(&run.display().to_string()));
    page.repeat.listings.push(format!("calibrate diff {one} {other}"));
    page::provenance(&mut page.repeat, (version, None), Some(inputs), "");
    page.show(drawn, |_| "Marginal posterior of each parameter under both runs.".to_owned());
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_a_sign_and_their_standard_error() {
        assert_eq!(with_se(Some(0.5), Some(0.012), " sd"), "+0.500 ± 0.012 sd");
        assert_eq!(with_se(Some(-1.0), Some(0.1), ""), "-1.00 ± 0.10");
        assert_eq!(with_se(Some(0.5), None, " sd"), "+0.50 sd (error unknown)");
        assert_eq!(with_se(None, Some(0.1), ""), "–");
    }
}
