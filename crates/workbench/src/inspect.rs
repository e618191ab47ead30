//! `calibrate inspect FILE`: a saved posterior as tables in the terminal.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use smc_calib::{ParameterSummary, StageRecord};

use crate::args::InspectArgs;
use crate::check::Understood;
use crate::error::{Failure, InputError, RunError};
use crate::external;
use crate::external::posterior_file::{AnyPosterior, read_any};
use crate::number::{significant, with_error};
use crate::posterior_file::PosteriorFile;
use crate::summary;

/// Prints a posterior.
///
/// # Errors
///
/// [`Failure::Input`] for a file that is not one.
pub fn run(args: &InspectArgs) -> Result<(), Failure> {
    let file = read_any(&args.file)?;
    let mut out = std::io::stdout().lock();
    let text = match (&file, args.json) {
        (AnyPosterior::Pair(file), true) => summary::json(file, None).map_err(RunError::new)?,
        (AnyPosterior::Plan(file), true) => {
            external::summary::json(file, None).map_err(RunError::new)?
        }
        (AnyPosterior::Pair(file), false) => {
            format!("{}\n{}", summary::text(file, None, None), details(file).trim_end())
        }
        (AnyPosterior::Plan(file), false) => format!(
            "{}\n{}",
            external::summary::text(file, None, None),
            external::summary::details(file).trim_end()
        ),
    };
    writeln!(out, "{text}")?;
    Ok(())
}

/// What `calibrate check` says of a posterior.
///
/// # Errors
///
/// [`InputError`] for a file that is not one.
pub fn understand(path: &Path) -> Result<Understood, InputError> {
    let (headline, warnings) = match read_any(path)? {
        AnyPosterior::Pair(file) => (
            format!(
                "a posterior of {} ({} kinetics, {} simulations, {})",
                file.plan.title,
                file.plan.kinetics,
                file.counters.simulations,
                trust(summary::trusted(&file))
            ),
            file.advice,
        ),
        AnyPosterior::Plan(file) => (
            format!(
                "a posterior of {} ({} samples, {})",
                file.plan.title,
                file.counters.simulations,
                trust(external::summary::trusted(&file))
            ),
            file.advice,
        ),
    };
    Ok(Understood { headline, details: Vec::new(), warnings })
}

fn trust(trusted: bool) -> &'static str {
    if trusted { "to be trusted" } else { "not to be trusted" }
}

fn interval(lower: f64, upper: f64) -> String {
    format!("{} .. {}", significant(lower, 4), significant(upper, 4))
}

/// One line per parameter, SI.
pub(crate) fn parameter_table(parameters: &[ParameterSummary]) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<10}{:>12}{:>12}{:>26}{:>26}{:>8}{:>7}",
        "SI", "MAP", "median", "50 % interval", "95 % interval", "bits", "k-hat"
    );
    for summary in parameters {
        let si = &summary.in_si;
        let _ = writeln!(
            text,
            "{:<10}{:>12}{:>12}{:>26}{:>26}{:>8.2}{:>7.2}",
            summary.parameter.name,
            significant(summary.map, 4),
            significant(si.median, 4),
            interval(si.eti50.lower, si.eti50.upper),
            interval(si.eti95.lower, si.eti95.upper),
            summary.information_gain_bits,
            summary.khat,
        );
    }
    text
}

fn details(file: &PosteriorFile) -> String {
    let mut text = parameter_table(&file.parameters);
    if let Some(sigma) = &file.sigma {
        let _ = writeln!(
            text,
            "{:<10}{:>12}{:>12}{:>26}{:>26}",
            "sigma",
            "",
            significant(sigma.median, 4),
            interval(sigma.eti50[0], sigma.eti50[1]),
            interval(sigma.eti95[0], sigma.eti95[1]),
        );
    }
    if !file.printed.is_empty() {
        let _ = writeln!(
            text,
            "\n{:<10}{:>12}{:>12}{:>26}{:>26}{:>12}{:>12}",
            "Table 3", "MAP", "median", "50 % interval", "95 % interval", "paper", "percentile"
        );
        for printed in &file.printed {
            let or_nothing = |value: Option<String>| value.unwrap_or_default();
            let _ = writeln!(
                text,
                "{:<10}{:>12}{:>12}{:>26}{:>26}{:>12}{:>12}",
                printed.name,
                significant(printed.map, 4),
                significant(printed.median, 4),
                interval(printed.eti50[0], printed.eti50[1]),
                interval(printed.eti95[0], printed.eti95[1]),
                or_nothing(printed.paper.map(|paper| significant(paper, 3))),
                or_nothing(printed.paper_percentile.map(|p| format!("{p:.1} %"))),
            );
        }
    }
    text.push_str(&moments_and_correlation(&file.parameters, &file.correlation));
    text.push_str(&stages(&file.stages));
    for failure in &file.failures {
        let _ = writeln!(text, "failed {} times: {}", failure.count, failure.cause);
    }
    text
}

/// Mean and standard deviation with their errors, and the correlation.
pub(crate) fn moments_and_correlation(
    parameters: &[ParameterSummary],
    correlation: &[Vec<f64>],
) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "\nmean and sd in the priors' coordinates, with Monte Carlo standard errors"
    );
    for summary in parameters {
        let m = &summary.in_coordinate;
        let _ = writeln!(
            text,
            "{:<10} mean {} +- {}, sd {} +- {} ({})",
            summary.parameter.name,
            with_error(m.mean, m.mean_se, 3),
            significant(m.mean_se, 2),
            with_error(m.sd, m.sd_se, 3),
            significant(m.sd_se, 2),
            match summary.coordinate {
                smc_calib::Coordinate::Log10 => "log10",
                smc_calib::Coordinate::Linear => "linear",
            }
        );
    }
    if parameters.len() > 1 {
        let _ = writeln!(text, "\ncorrelation in the priors' coordinates");
        for (summary, row) in parameters.iter().zip(correlation) {
            let row: String = row.iter().map(|value| format!("{value:>8.3}")).collect();
            let _ = writeln!(text, "{:<10}{row}", summary.parameter.name);
        }
    }
    text
}

/// What each stage did.
pub(crate) fn stages(stages: &[StageRecord]) -> String {
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
