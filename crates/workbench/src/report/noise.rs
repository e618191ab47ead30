//! What a run says of its noise: correlation, outliers, and the result under correlated errors beside its own.

use std::fmt::Write as _;

use smc_calib::trust::limits::khat_in_words;
use smc_calib::{DistanceScale, NoiseQuantity, ShapeSummary};

use crate::number::{shown_unit, significant};
use crate::plan::ObservablePlan;
use crate::record::{Method, ObservableRecord, Record, Sensitivity};

/// Probability above which an observation is called an outlier.
const OUTLIER: f64 = 0.5;
/// Most rows that are named.
const NAMED: usize = 10;

/// Correlation length and white share, or the suspected rows; empty for independent normal errors.
pub(super) fn noise_line(plan: &ObservablePlan, found: &ObservableRecord) -> String {
    match &found.noise_shape {
        None => String::new(),
        Some(ShapeSummary::Correlated { scale, length, white_share, .. }) => {
            let range = |q: &NoiseQuantity| {
                let [lower, upper] = q.eti95.map(|end| significant(end, 2));
                format!("{} (95 % {lower} .. {upper})", significant(q.median, 2))
            };
            let control = plan.control_column.as_deref().unwrap_or("the row number");
            let scale = match scale {
                DistanceScale::Log => format!("ln {control}"),
                DistanceScale::Linear => control.to_owned(),
            };
            format!(
                "  errors: correlation length {} in {scale}, white share {}\n",
                range(length),
                range(white_share)
            )
        }
        Some(ShapeSummary::Robust { outliers, .. }) => {
            let suspect: Vec<usize> =
                (0..outliers.len()).filter(|row| outliers[*row] > OUTLIER).collect();
            if suspect.is_empty() {
                return "  errors: no row is an outlier\n".to_owned();
            }
            let mut named: Vec<String> =
                suspect.iter().take(NAMED).map(|row| row_in_words(plan, *row)).collect();
            if suspect.len() > NAMED {
                named.push(format!("{} more", suspect.len() - NAMED));
            }
            format!("  suspect rows of {}: {}\n", plan.table, named.join(", "))
        }
    }
}

/// The unit of a correlation length.
pub(crate) fn length_unit(scale: DistanceScale, plan: &ObservablePlan) -> &str {
    match scale {
        DistanceScale::Log => "1",
        DistanceScale::Linear => or_one(&plan.control_unit),
    }
}

/// The unit of numbers without one is 1.
pub(super) fn or_one(unit: &str) -> &str {
    if unit.is_empty() { "1" } else { unit }
}

/// A row by its line in the table, where that is known, and its control value.
fn row_in_words(plan: &ObservablePlan, row: usize) -> String {
    let control = match (&plan.control_column, shown_unit(&plan.control_unit)) {
        (None, _) => format!("row {}", row + 1),
        (Some(_), unit) => format!("{} {unit}", significant(plan.control[row], 4)),
    };
    match plan.lines.get(row) {
        Some(line) => format!("line {line} ({})", control.trim_end()),
        None => control.trim_end().to_owned(),
    }
}

/// The result under correlated errors, beside the run's own; empty where there is no reason for one.
pub(super) fn beside(record: &Record, width: usize) -> String {
    let mut text = String::new();
    let Some(sensitivity) = &record.sensitivity else {
        let observations = record.plan.observations();
        if record.trust.intervals_too_narrow() && observations > Sensitivity::MOST_OBSERVATIONS {
            let _ = writeln!(
                text,
                "  with correlated errors: not computed beside the result for {observations} observations (up to {}); ask for it: --noise correlated",
                Sensitivity::MOST_OBSERVATIONS
            );
        }
        return text;
    };
    let how = match sensitivity.method {
        Method::Sampled => "sampled again",
        Method::Weighted => "the same runs, weighted",
    };
    if !sensitivity.trusted {
        let simulations = record.plan.simulations();
        let (option, more) = if simulations.of_file {
            ("noise = { kind = \"correlated\", s0 = ABOUT } in the plan", "samples in [sampler]")
        } else {
            ("--noise correlated", "--samples")
        };
        let _ = writeln!(
            text,
            "  with correlated errors ({how}): not known from {} simulations ({:.0} effective samples, k-hat {}); run with {option}, and with more {more} where that is not to be trusted either",
            sensitivity.samples,
            sensitivity.ess,
            khat_in_words(sensitivity.khat)
        );
        return text;
    }
    let (other, own) = (sensitivity.log_evidence, record.log_evidence.value);
    let _ = writeln!(
        text,
        "  with correlated errors ({how}; log evidence {} against {}{}):",
        significant(other, 5),
        significant(own, 5),
        if other < own { ", which the data prefer" } else { "" }
    );
    for (parameter, summary) in sensitivity.parameters.iter().zip(&record.parameters) {
        let _ = writeln!(
            text,
            "    {:<w$} {:>9} {:<9} 95 % {} .. {}; moves by {:+.1} sd, {} times as wide",
            summary.parameter.name,
            significant(parameter.median, 3),
            shown_unit(&summary.parameter.unit),
            significant(parameter.eti95[0], 3),
            significant(parameter.eti95[1], 3),
            parameter.shift,
            significant(parameter.widening, 2),
            w = width.saturating_sub(2),
        );
    }
    for concern in &sensitivity.concerns {
        let _ = writeln!(text, "    there: {concern}");
    }
    text
}

/// The same as a table of `table.md`; empty where there is none.
pub(super) fn beside_markdown(record: &Record) -> String {
    let Some(sensitivity) = &record.sensitivity else { return String::new() };
    if !sensitivity.trusted {
        return format!(
            "\nThe residuals are alike; what correlated errors give is not known from {} simulations: run with `--noise correlated` (`kind = \"correlated\"` in a plan).\n",
            sensitivity.samples
        );
    }
    let mut text = format!(
        "\nWith correlated errors, as the residuals are alike (log evidence {} against {}):\n\n\
         | parameter | median | 95 % interval | moves by [sd] | times as wide |\n|---|---|---|---|---|\n",
        significant(sensitivity.log_evidence, 5),
        significant(record.log_evidence.value, 5),
    );
    for (parameter, summary) in sensitivity.parameters.iter().zip(&record.parameters) {
        let [lower, upper] = parameter.eti95.map(|end| significant(end, 3));
        let _ = writeln!(
            text,
            "| {} [{}] | {} | {lower} … {upper} | {:+.1} | {} |",
            parameter.name,
            summary.parameter.unit,
            significant(parameter.median, 3),
            parameter.shift,
            significant(parameter.widening, 2),
        );
    }
    text
}
