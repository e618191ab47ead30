//! A saved posterior as tables in the terminal.

use std::fmt::Write as _;

use smc_calib::{ParameterSummary, StageRecord, Verdict};

use super::summary::{OF_TABLE3, neck_growth};
use crate::number::{significant, with_error};
use crate::plan::Understood;
use crate::record::Record;

/// A posterior as `calibrate check` describes it.
pub fn understood(record: &Record) -> Understood {
    let trusted = match record.trust.verdict {
        _ if record.trusted() => "to be trusted",
        Verdict::Rough => "rough",
        Verdict::Converged | Verdict::Untrusted => "not to be trusted",
    };
    Understood {
        headline: format!(
            "a posterior of {} ({} simulations, {trusted})",
            record.plan.title, record.counters.simulations
        ),
        details: Vec::new(),
        warnings: record.advice.clone(),
    }
}

/// The tables that `calibrate inspect` prints below the summary.
pub fn details(record: &Record) -> String {
    let mut text = parameter_table(&record.parameters);
    for (_, found) in record.observables() {
        if let Some(sigma) = &found.sigma {
            let several = record.plan.observables().count() > 1;
            let name =
                if several { format!("sigma of {} ", found.label) } else { "sigma".to_owned() };
            text.push_str(&row([
                &name,
                "",
                &significant(sigma.median, 4),
                &interval(sigma.eti50[0], sigma.eti50[1]),
                &interval(sigma.eti95[0], sigma.eti95[1]),
            ]));
            text.push('\n');
        }
    }
    let printed = neck_growth(record).map_or(&[][..], |neck| &neck.printed);
    if !printed.is_empty() {
        let head = row(["Table 3", "MAP", "median", "50 % interval", "95 % interval"]);
        let _ = writeln!(text, "\n{head}{:>12}{:>12}", "paper", "percentile");
    }
    for printed in printed {
        let shared = row([
            &printed.name,
            &significant(printed.map, 4),
            &significant(printed.median, 4),
            &interval(printed.eti50[0], printed.eti50[1]),
            &interval(printed.eti95[0], printed.eti95[1]),
        ]);
        let _ = writeln!(
            text,
            "{shared}{:>12}{:>12}",
            printed.paper.map_or_else(String::new, |paper| significant(paper, 3)),
            printed.paper_percentile.map_or_else(String::new, |p| format!("{p:.1} %")),
        );
    }
    if !printed.is_empty() {
        let _ = writeln!(text, "{OF_TABLE3}");
    }
    text.push_str(&moments(&record.parameters, record.errors_known()));
    text.push_str(&correlation(&record.parameters, &record.correlation));
    text.push_str(&stages(&record.stages));
    text
}

/// The columns that all tables of values begin with: name, MAP, median, 50 % and 95 % interval.
fn row([name, map, median, half, most]: [&str; 5]) -> String {
    format!("{name:<10}{map:>12}{median:>12}{half:>26}{most:>26}")
}

fn interval(lower: f64, upper: f64) -> String {
    format!("{} .. {}", significant(lower, 4), significant(upper, 4))
}

/// One line per parameter, SI.
fn parameter_table(parameters: &[ParameterSummary]) -> String {
    let mut text = String::new();
    let head = row(["SI", "MAP", "median", "50 % interval", "95 % interval"]);
    let _ = writeln!(text, "{head}{:>8}{:>7}", "bits", "k-hat");
    for summary in parameters {
        let si = &summary.in_si;
        let shared = row([
            &summary.parameter.name,
            &significant(summary.map, 4),
            &significant(si.median, 4),
            &interval(si.eti50.lower, si.eti50.upper),
            &interval(si.eti95.lower, si.eti95.upper),
        ]);
        let _ =
            writeln!(text, "{shared}{:>8.2}{:>7.2}", summary.information_gain_bits, summary.khat);
    }
    text
}

/// Mean and standard deviation, with their errors where these are known.
fn moments(parameters: &[ParameterSummary], errors_known: bool) -> String {
    let errors = match errors_known {
        true => "with Monte Carlo standard errors",
        false => "their errors unknown",
    };
    let mut text = format!("\nmean and sd in the priors' coordinates, {errors}\n");
    let shown = |value, error| match errors_known {
        true => format!("{} +- {}", with_error(value, error, 3), significant(error, 2)),
        false => with_error(value, error, 3),
    };
    for summary in parameters {
        let m = &summary.in_coordinate;
        let _ = writeln!(
            text,
            "{:<10} mean {}, sd {} ({})",
            summary.parameter.name,
            shown(m.mean, m.mean_se),
            shown(m.sd, m.sd_se),
            match summary.coordinate {
                smc_calib::Coordinate::Log10 => "log10",
                smc_calib::Coordinate::Linear => "linear",
            }
        );
    }
    text
}

/// The correlation of several parameters.
fn correlation(parameters: &[ParameterSummary], correlation: &[Vec<f64>]) -> String {
    let mut text = String::new();
    if parameters.len() > 1 {
        let _ = writeln!(text, "\ncorrelation in the priors' coordinates");
        for (summary, row) in parameters.iter().zip(correlation) {
            let row: String = row.iter().map(|value| format!("{value:>8.3}")).collect();
            let _ = writeln!(text, "{:<10}{row}", summary.parameter.name);
        }
    }
    text
}

/// One line per stage of the sampler.
fn stages(stages: &[StageRecord]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "\n{:>5}{:>12}{:>9}{:>12}{:>10}{:>16}{:>8}",
        "stage", "simulations", "failed", "components", "beta", "log evidence", "ESS"
    );
    for stage in stages {
        let _ = writeln!(
            text,
            "{:>5}{:>12}{:>9}{:>12}{:>10}{:>16}{:>8.0}",
            stage.stage,
            stage.simulations,
            stage.failed,
            stage.proposal.components.len(),
            significant(stage.beta, 3),
            with_error(stage.log_evidence, stage.log_evidence_se, 3),
            stage.ess,
        );
    }
    text
}
