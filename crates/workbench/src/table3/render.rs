//! The report as Markdown, CSV, LaTeX and for the terminal.

use std::fmt::Write as _;

use smc_calib::trust::limits::{INFORMED_BITS, khat_in_words};

use super::readings::{Quantity, STATED};
use super::record::{CURVES, Form, MaterialReport, Report, ReportPlan, Row};
use crate::number::{percentile, significant, with_error};

/// `document.tex`, a document around `table3.tex`: `pdflatex document.tex`.
pub const DOCUMENT: &str = "\
\\documentclass{article}
\\usepackage[margin=25mm]{geometry}
\\begin{document}
\\noindent\\small
\\input{table3}
\\end{document}
";

/// `README.md`: what the folder holds, the command that made it, and the revision.
pub fn readme(plan: &ReportPlan, revision: &str) -> String {
    format!(
        "# Table 3, regenerated

Made by

    calibrate table3 --samples {} --seed {}

from source at revision {revision}. The same command from the same source gives the same bytes, for any
number of threads; other versions of the sampler give the same numbers within their Monte Carlo errors, which
`table3.json` holds.

| file | what it is |
|---|---|
| `table3.md`, `table3.csv`, `table3.tex` | the table: paper, MAP, median, 95 % interval, percentile |
| `table3.json` | everything in full precision, with Monte Carlo errors |
| `report.md` | errors, the paper's statements, the check that was not fitted, how the table is read |
| `figure2`, `figure4`, `figure5`, `figure6` | the figures of the paper redone (`.svg`, `.png`; only `.svg` is kept in the repository) |
| `pa12-r30` | the pair that was not fitted |
| `document.tex` | a document around `table3.tex`: `pdflatex document.tex` |

How Table 3 of the paper must be read, and the evidence for it: `crates/guide/pages/reading-table3.md`.
",
        plan.samples, plan.seed
    )
}

pub(super) fn form(form: Form) -> &'static str {
    match form {
        Form::Printed => "as printed",
        Form::Si => "SI",
    }
}

fn bits(row: &Row) -> String {
    row.information_gain_bits.map_or_else(
        || "–".to_owned(),
        |bits| {
            let not = if bits < INFORMED_BITS { " (not informed)" } else { "" };
            format!("{bits:.1}{not}")
        },
    )
}

/// Parameters that the data of a material do not inform.
fn uninformed(material: &MaterialReport) -> Vec<&Row> {
    material
        .rows
        .iter()
        .filter(|row| row.information_gain_bits.is_some_and(|bits| bits < INFORMED_BITS))
        .collect()
}

/// The table as Markdown.
pub fn table_markdown(report: &Report) -> String {
    let mut text = String::from(
        "# Table 3, regenerated\n\n\
         \"As printed\" is the form of the paper's Table 3 (its tau_s is the sintering time in seconds times the radius in\n\
         metres); SI is the form of eqs. 3 to 5. The percentile is the posterior probability of a value below the paper's.\n\n",
    );
    for material in &report.materials {
        let _ = writeln!(text, "## {}\n", material.title);
        text.push_str("| parameter | form | unit | paper | MAP | median | 95 % interval | paper's percentile | information [bits] |\n");
        text.push_str("|---|---|---|---|---|---|---|---|---|\n");
        for row in &material.rows {
            let [lower, upper] = row.eti95();
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} … {} | {:.1} % | {} |",
                row.parameter,
                form(row.form),
                row.unit,
                significant(row.paper, 3),
                significant(row.map, 3),
                significant(row.median(), 3),
                significant(lower, 3),
                significant(upper, 3),
                row.paper_percentile,
                bits(row),
            );
        }
        let [evidence, error] = material.log_evidence;
        let _ = writeln!(
            text,
            "\nSampling: {}; {:.0} effective samples, k-hat {}, log evidence {} ± {}.",
            if material.converged { "converged" } else { "NOT TO BE TRUSTED" },
            material.ess,
            khat_in_words(material.khat),
            with_error(evidence, error, 2),
            significant(error, 2),
        );
        for row in uninformed(material) {
            let _ = writeln!(text, "\n> The data do not inform {}.", row.parameter);
        }
        for line in &material.advice {
            let _ = writeln!(text, "\n> {line}");
        }
        text.push('\n');
    }
    text
}

/// The table as CSV, in full precision.
pub fn table_csv(report: &Report) -> String {
    let mut text = String::from(
        "material,parameter,form,unit,paper,map,median,eti95_lower,eti95_upper,paper_percentile,information_gain_bits\n",
    );
    for material in &report.materials {
        for row in &material.rows {
            let [lower, upper] = row.eti95();
            let _ = writeln!(
                text,
                "{},{},{},{},{:e},{:e},{:e},{lower:e},{upper:e},{},{}",
                material.name,
                row.parameter,
                form(row.form),
                row.unit,
                row.paper,
                row.map,
                row.median(),
                row.paper_percentile,
                row.information_gain_bits.map_or_else(String::new, |bits| bits.to_string()),
            );
        }
    }
    text
}

/// A number as LaTeX sets it.
fn tex_number(value: f64) -> String {
    let text = significant(value, 3);
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("${mantissa}\\times10^{{{exponent}}}$"),
        None => format!("${text}$"),
    }
}

/// The table as a LaTeX `tabular`, to be `\input` where it is wanted; no package is needed.
pub fn table_latex(report: &Report) -> String {
    let mut text = String::from(
        "% C1, tau_s and delta_c: the paper's Table 3 beside the posterior. \\input this file; no package is needed.\n\
         \\begin{tabular}{lllllll}\n\\hline\n\
         & & paper & MAP & median & 95\\,\\% interval & percentile \\\\\n\\hline\n",
    );
    for material in &report.materials {
        let title = material.title.split(" (").next().unwrap_or(&material.title);
        for wanted in [Form::Printed, Form::Si] {
            let heading = match wanted {
                Form::Printed => format!("{title}, as printed"),
                Form::Si => format!("{title}, SI"),
            };
            let _ = writeln!(text, "\\multicolumn{{7}}{{l}}{{\\emph{{{heading}}}}} \\\\");
            for row in material.rows.iter().filter(|row| row.form == wanted) {
                let (symbol, unit) = match (row.parameter.as_str(), wanted) {
                    ("c1", Form::Printed) => ("$C_1$", "Pa$^{-1}$\\,s$^{-1}$\\,m$^{-1}$"),
                    ("c1", Form::Si) => ("$C_1$", "Pa$^{-1}$\\,s$^{-1}$"),
                    ("tau_s", Form::Printed) => ("$\\tau_s$", "s\\,m"),
                    ("tau_s", Form::Si) => ("$\\tau_s$", "s"),
                    _ => ("$\\delta_c$", "m"),
                };
                let [lower, upper] = row.eti95();
                let _ = writeln!(
                    text,
                    "{symbol} & {unit} & {} & {} & {} & {} \\ldots\\ {} & {:.1} \\\\",
                    tex_number(row.paper),
                    tex_number(row.map),
                    tex_number(row.median()),
                    tex_number(lower),
                    tex_number(upper),
                    row.paper_percentile,
                );
            }
        }
        text.push_str("\\hline\n");
    }
    text.push_str("\\end{tabular}\n");
    text
}

/// Errors, statements, the check that was not fitted, and the readings, as Markdown.
pub fn report_markdown(report: &Report) -> String {
    let mut text = String::from("# What Table 3 is worth\n\n");
    errors(&mut text, report);
    statements(&mut text, report);
    unfitted(&mut text, report);
    readings(&mut text, report);
    text
}

fn errors(text: &mut String, report: &Report) {
    text.push_str(
        "## Fit errors\n\n\
         Root mean square (and largest) difference from the measurements, in a/R.\n\n| curve |",
    );
    for material in &report.materials {
        let _ = write!(text, " {} |", material.title);
    }
    text.push_str("\n|---|");
    text.push_str(&"---|".repeat(report.materials.len()));
    text.push('\n');
    for curve in CURVES {
        let _ = write!(text, "| {curve} |");
        for material in &report.materials {
            match material.fit(curve) {
                Some(error) => {
                    let _ = write!(text, " {:.4} ({:.3}) |", error.rmse, error.max);
                }
                None => text.push_str(" – |"),
            }
        }
        text.push('\n');
    }
    text.push_str(
        "\nThe paper claims \"an increase in the modelling accuracy compared with traditional ones\". In numbers:\n\n",
    );
    for material in &report.materials {
        let _ = writeln!(text, "- {}", accuracy(material));
    }
    text.push_str(
        "\nMore parameters fit better by themselves; whether the data pay for them is what `calibrate compare` answers.\n\n",
    );
}

/// Gain of three stages over one parameter, in a sentence.
pub fn accuracy(material: &MaterialReport) -> String {
    let rmse = |curve: &str| material.fit(curve).map_or(f64::NAN, |error| error.rmse);
    let [paper, map, _, frenkel, pokluda, frenkel_paper] = CURVES.map(rmse);
    let change = |of: f64, against: f64| {
        let percent = 100.0 * (1.0 - of / against);
        if percent.abs() < 2.0 {
            "as large as".to_owned()
        } else if percent > 0.0 {
            format!("{percent:.0} % smaller than")
        } else {
            format!("{:.0} % larger than", -percent)
        }
    };
    format!(
        "{}: the error of the paper's parameters is {} that of the best Frenkel curve, and {} that of Frenkel's curve with \
         the paper's tau_s. Our MAP's is {} the best Frenkel curve's and {} that of the best Pokluda curve.",
        material.title,
        change(paper, frenkel),
        change(paper, frenkel_paper),
        change(map, frenkel),
        change(map, pokluda),
    )
}

fn statements(text: &mut String, report: &Report) {
    text.push_str(
        "## The statements of section 4\n\n\
         Each quantity of the three-stage curve with the paper's parameters (through the map of Table 3) and under our \
         posterior; the percentile is the posterior probability of a value below the stated one. PS at phi = 1.08, the \
         others at 2^(1/3).\n\n\
         | material | quantity | the paper says | number | with its parameters | our MAP | our median | 95 % interval | percentile |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let number = |value: Option<f64>, unit: &str| match value {
        Some(value) => format!("{} {unit}", significant(value, 3)).trim_end().to_owned(),
        None => "–".to_owned(),
    };
    for statement in &report.statements {
        let unit = statement.unit.as_str();
        let (median, interval) = statement.posterior.map_or_else(
            || ("–".to_owned(), "–".to_owned()),
            |posterior| {
                let [lower, upper] = posterior.eti95.map(|end| significant(end, 3));
                let condition = if posterior.probability < 0.995 {
                    format!(" (exists with probability {:.2})", posterior.probability)
                } else {
                    String::new()
                };
                (number(Some(posterior.median), unit), format!("{lower} … {upper}{condition}"))
            },
        );
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {median} | {interval} | {} |",
            statement.material,
            statement.quantity,
            statement.words,
            number(statement.stated, unit),
            number(statement.paper_parameters, unit),
            number(statement.map, unit),
            statement.percentile.map_or_else(|| "–".to_owned(), |p| format!("{p:.0} %")),
        );
    }
    text.push('\n');
}

fn unfitted(text: &mut String, report: &Report) {
    let check = &report.unfitted;
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let [half, ninety, ninety_five] = check.coverage.map(percent);
    let outside: Vec<String> = check
        .points
        .iter()
        .filter(|point| (point.rank - 0.5).abs() > 0.45)
        .map(|point| format!("{} s", significant(point.time_s, 3)))
        .collect();
    let _ = writeln!(
        text,
        "## A pair that was not fitted\n\n\
         The posterior of `{}` predicts `{}`: C1 and delta_c stay, tau_s is multiplied by the ratio of the radii, \
         {:.2} µm / {:.2} µm. Figure `pa12-r30`.\n\n\
         | | |\n|---|---|\n\
         | measurements inside the 50 % predictive band | {half} |\n\
         | inside the 90 % band | {ninety} |\n\
         | inside the 95 % band | {ninety_five} |\n\
         | inside the 90 % band of the curve alone, without noise | {} |\n\
         | RMSE of the posterior mean curve | {:.4} |\n\
         | largest error | {:.3} at {} s |\n\
         | RMSE where tau_s is not transferred | {:.4} |\n\
         | RMSE on the pair that was fitted | {:.4} |\n\
         | tau_s of that pair, transferred: median, 95 % | {} |\n\
         | tau_s calibrated on the predicted pair alone | {} |\n\
         | noise sigma that it taught (median) | {:.4} |\n\n\
         Outside the 90 % band: {}. At t = 0 the measured pair has a/R = 0 where every curve starts at the adhesive contact, \
         0.032. Neighbouring rows of both series are not independent (they were smoothed), so a coverage of n rows is \
         worth less than n trials.{}\n",
        check.fitted,
        check.predicted,
        1e6 * check.predicted_radius_m,
        1e6 * check.fitted_radius_m,
        percent(check.curve_coverage90),
        check.error.rmse,
        check.error.max,
        significant(check.largest_at_s, 3),
        check.error_without_transfer.rmse,
        check.error_of_fit.rmse,
        seconds(&check.tau_s_predicted),
        seconds(&check.tau_s_own),
        check.sigma,
        if outside.is_empty() { "no row".to_owned() } else { outside.join(", ") },
        if check.error_without_transfer.rmse < check.error.rmse {
            " The smaller pair sintered no faster than the larger one, so the transfer tau_s ~ R makes this prediction \
             worse: two pairs whose radii differ by 5 % cannot tell it from the scatter between pairs."
        } else {
            ""
        },
    );
}

fn seconds([lower, median, upper]: &[f64; 3]) -> String {
    let [lower, median, upper] = [lower, median, upper].map(|value| significant(*value, 3));
    format!("{median} s, {lower} … {upper} s")
}

/// Name of a stated quantity.
fn quantity_name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::KneeTime => "knee [s]",
        Quantity::KneeHeight => "knee a/R",
        Quantity::TimeToOne => "a/R = 1 [s]",
        Quantity::EndTime => "end [s]",
    }
}

fn readings(text: &mut String, report: &Report) {
    text.push_str(
        "## How Table 3 is read\n\n\
         Each reading turns the printed numbers into SI parameters of eqs. 3 to 5; the columns are what the curves \
         then do, below what the paper says they do; the typical factor is the exponential of the root mean square of\n\
         ln(value/statement), and the RMSE that from the measurements. The derivation is in `crates/guide/pages/reading-table3.md`.\n\n| reading |",
    );
    for (material, quantity, _) in STATED {
        let _ = write!(text, " {material} {} |", quantity_name(quantity));
    }
    text.push_str(" typical factor | RMSE ps, pa12, peek |\n|---|");
    text.push_str(&"---|".repeat(STATED.len() + 2));
    text.push_str("\n| **the paper says** |");
    for (_, _, stated) in STATED {
        let _ = write!(text, " **{stated}** |");
    }
    text.push_str(" | |\n");
    for reading in &report.readings {
        let _ = write!(text, "| {} |", reading.name);
        for value in &reading.values {
            let _ = write!(text, " {} |", significant(*value, 3));
        }
        let [ps, pa12, peek] = reading.rmse;
        let _ = writeln!(
            text,
            " {} | {ps:.3}, {pa12:.3}, {peek:.3} |",
            significant(reading.rms_ln.exp(), 3)
        );
    }
    text.push('\n');
    for reading in &report.readings {
        let _ = writeln!(text, "- {}: {}.", reading.name, reading.meaning);
    }
}

/// The table for the terminal.
pub fn terminal(report: &Report) -> String {
    let mut text = String::new();
    for material in &report.materials {
        let _ = writeln!(text, "{}", material.title);
        for row in &material.rows {
            let [lower, upper] = row.eti95();
            let not = match row.information_gain_bits {
                Some(bits) if bits < INFORMED_BITS => "; NOT INFORMED",
                _ => "",
            };
            let _ = writeln!(
                text,
                "  {:<8} {:<10} {:>9} {:<9} 95 % {} .. {}; paper {} ({}){not}",
                row.parameter,
                form(row.form),
                significant(row.median(), 3),
                row.unit,
                significant(lower, 3),
                significant(upper, 3),
                significant(row.paper, 3),
                percentile(row.paper_percentile),
            );
        }
        let [paper, map, _, frenkel, pokluda, _] =
            CURVES.map(|curve| material.fit(curve).map_or(f64::NAN, |error| error.rmse));
        let _ = writeln!(
            text,
            "  RMSE of a/R: paper {}, MAP {}, best Frenkel {}, best Pokluda {}",
            significant(paper, 2),
            significant(map, 2),
            significant(frenkel, 2),
            significant(pokluda, 2),
        );
    }
    let check = &report.unfitted;
    let _ = writeln!(
        text,
        "{} predicted from {}: {:.0} % of its rows inside the 90 % band, RMSE {}",
        check.predicted,
        check.fitted,
        100.0 * check.coverage[1],
        significant(check.error.rmse, 2),
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_set_in_mathematics() {
        assert_eq!(tex_number(2.1e-6), "$2.10\\times10^{-6}$");
        assert_eq!(tex_number(21.2), "$21.2$");
    }
}
