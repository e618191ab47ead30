//! The closing summary of a plan's run, and its tables in the terminal.

use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use super::posterior_file::PlanPosterior;
use crate::number::{shown_unit, significant, with_error};
use crate::summary::{Diagnosis, INFORMED_BITS};
use crate::tables::quoted;

fn diagnosis(file: &PlanPosterior) -> Diagnosis<'_> {
    Diagnosis {
        is_posterior: file.is_posterior,
        simulations: file.counters.simulations,
        ess: file.ess.importance,
        khat: file.khat,
        evidence: &file.log_evidence,
    }
}

/// Whether the sampler's own diagnostics let the result be trusted.
#[must_use]
pub fn trusted(file: &PlanPosterior) -> bool {
    diagnosis(file).trusted()
}

/// The summary as text, about ten lines.
#[must_use]
pub fn text(file: &PlanPosterior, seconds: Option<f64>, out: Option<&Path>) -> String {
    let plan = &file.plan;
    let mut text = String::new();
    let took = seconds.map_or_else(String::new, |s| format!(" in {} s", significant(s, 2)));
    let failed: usize = file.failures.iter().map(|failure| failure.count).sum();
    let _ = writeln!(
        text,
        "{}: {} observations of {} observable{}, {} samples{}{took}",
        plan.title,
        plan.observations(),
        file.observables.len(),
        if file.observables.len() == 1 { "" } else { "s" },
        file.counters.simulations,
        if failed > 0 { format!(" ({failed} failed)") } else { String::new() },
    );
    for summary in &file.parameters {
        let si = &summary.in_si;
        let mut line = format!(
            "  {:<12} {:>9} {:<9} 95 % {} .. {}",
            summary.parameter.name,
            significant(si.median, 3),
            shown_unit(&summary.parameter.unit),
            significant(si.eti95.lower, 3),
            significant(si.eti95.upper, 3),
        );
        if summary.information_gain_bits < INFORMED_BITS {
            let _ = write!(line, "; NOT INFORMED ({:.2} bits)", summary.information_gain_bits);
        }
        let _ = writeln!(text, "{line}");
    }
    for (plan, found) in file.observables() {
        let noise = found.sigma.map_or_else(String::new, |sigma| {
            format!("; noise sigma {}", significant(sigma.median, 2))
        });
        let _ = writeln!(
            text,
            "  fit of {}: RMSE {} {}(MAP){noise}",
            found.label,
            significant(found.map_error.rmse, 2),
            if shown_unit(&plan.unit).is_empty() {
                String::new()
            } else {
                format!("{} ", plan.unit)
            },
        );
    }
    let _ = writeln!(text, "  sampling: {}", diagnosis(file).line());
    for failure in &file.failures {
        let _ = writeln!(text, "  failed {} times: {}", failure.count, failure.cause);
    }
    for line in &file.advice {
        let _ = writeln!(text, "  careful: {line}");
    }
    if let Some(out) = out {
        let _ = writeln!(
            text,
            "  files: {}/ (posterior.json, table.md, samples.csv, draws.csv, corner.png, ...)",
            out.display()
        );
    }
    text
}

/// The summary as JSON: the same facts for a program to read.
#[derive(Debug, Serialize)]
struct Short<'a> {
    name: &'a str,
    is_posterior: bool,
    trusted: bool,
    parameters: &'a [smc_calib::ParameterSummary],
    observables: Vec<ShortObservable<'a>>,
    log_evidence: &'a smc_calib::Evidence,
    ess: &'a smc_calib::EffectiveSampleSize,
    khat: f64,
    failures: &'a [smc_calib::Failure],
    advice: &'a [String],
    out: Option<String>,
}

#[derive(Debug, Serialize)]
struct ShortObservable<'a> {
    label: &'a str,
    sigma: &'a Option<smc_calib::SigmaSummary>,
    map_error: crate::posterior_file::FitError,
}

/// The summary as JSON.
///
/// # Errors
///
/// None in practice: the summary is plain data.
pub fn json(file: &PlanPosterior, out: Option<&Path>) -> Result<String, serde_json::Error> {
    serde_json::to_string_pretty(&Short {
        name: &file.plan.name,
        is_posterior: file.is_posterior,
        trusted: trusted(file),
        parameters: &file.parameters,
        observables: file
            .observables
            .iter()
            .map(|found| ShortObservable {
                label: &found.label,
                sigma: &found.sigma,
                map_error: found.map_error,
            })
            .collect(),
        log_evidence: &file.log_evidence,
        ess: &file.ess,
        khat: file.khat,
        failures: &file.failures,
        advice: &file.advice,
        out: out.map(|path| path.display().to_string()),
    })
}

/// The posterior table as Markdown.
#[must_use]
pub fn markdown(file: &PlanPosterior) -> String {
    let plan = &file.plan;
    let mut text = format!("# {}\n\n", plan.title);
    let _ = writeln!(
        text,
        "{} observations, {} samples, seed {}.\n",
        plan.observations(),
        file.counters.simulations,
        plan.sampler.seed
    );
    text.push_str(
        "| parameter | unit | MAP | median | 95 % interval | mean ± sd | information [bits] |\n",
    );
    text.push_str("|---|---|---|---|---|---|---|\n");
    for summary in &file.parameters {
        let moments = &summary.in_coordinate;
        let coordinate = match summary.coordinate {
            smc_calib::Coordinate::Log10 => " (log10)",
            smc_calib::Coordinate::Linear => "",
        };
        let not =
            if summary.information_gain_bits < INFORMED_BITS { " (not informed)" } else { "" };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} … {} | {} ± {}{coordinate} | {:.2}{not} |",
            summary.parameter.name,
            summary.parameter.unit,
            significant(summary.map, 3),
            significant(summary.in_si.median, 3),
            significant(summary.in_si.eti95.lower, 3),
            significant(summary.in_si.eti95.upper, 3),
            with_error(moments.mean, moments.sd, 2),
            significant(moments.sd, 2),
            summary.information_gain_bits,
        );
    }
    text.push_str("\n| observable | points | RMSE of the MAP | noise sigma, 95 % | residuals |\n");
    text.push_str("|---|---|---|---|---|\n");
    for (plan, found) in file.observables() {
        let sigma = found.sigma.map_or_else(
            || "as the table states".to_owned(),
            |sigma| {
                if sigma.fixed {
                    format!("{} (given)", significant(sigma.median, 3))
                } else {
                    format!(
                        "{} ({} … {})",
                        significant(sigma.median, 2),
                        significant(sigma.eti95[0], 2),
                        significant(sigma.eti95[1], 2)
                    )
                }
            },
        );
        let _ = writeln!(
            text,
            "| {} | {} | {} {} | {sigma} | {} |",
            found.label,
            plan.values.len(),
            significant(found.map_error.rmse, 2),
            shown_unit(&plan.unit),
            if found.residuals.independent { "independent" } else { "not independent" },
        );
    }
    let evidence = diagnosis(file).evidence().replace("+-", "±");
    let _ = writeln!(
        text,
        "\n{evidence}; effective sample size {:.0}; k-hat {:.2}.",
        file.ess.importance, file.khat
    );
    for failure in &file.failures {
        let _ = writeln!(text, "\n> failed {} times: {}", failure.count, failure.cause);
    }
    for line in &file.advice {
        let _ = writeln!(text, "\n> {line}");
    }
    text
}

/// The posterior table as CSV, in full precision.
#[must_use]
pub fn csv(file: &PlanPosterior) -> String {
    let mut text = String::from(
        "parameter,unit,map,median,eti95_lower,eti95_upper,mean,sd,mean_sd_coordinate,information_gain_bits\n",
    );
    for summary in &file.parameters {
        let (si, moments) = (&summary.in_si, &summary.in_coordinate);
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{}",
            summary.parameter.name,
            quoted(&summary.parameter.unit),
            summary.map,
            si.median,
            si.eti95.lower,
            si.eti95.upper,
            moments.mean,
            moments.sd,
            match summary.coordinate {
                smc_calib::Coordinate::Log10 => "log10",
                smc_calib::Coordinate::Linear => "linear",
            },
            summary.information_gain_bits,
        );
    }
    text
}

/// What `calibrate inspect` prints below the summary.
#[must_use]
pub fn details(file: &PlanPosterior) -> String {
    let mut text = crate::inspect::parameter_table(&file.parameters);
    text.push_str(&crate::inspect::moments_and_correlation(&file.parameters, &file.correlation));
    text.push_str(&crate::inspect::stages(&file.stages));
    text
}
