//! `calibrate inspect FILE`: a saved posterior as tables in the terminal.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use crate::args::InspectArgs;
use crate::check::Understood;
use crate::error::{Failure, InputError, RunError};
use crate::number::{significant, with_error};
use crate::posterior_file::{self, PosteriorFile};
use crate::summary;

/// Prints a posterior.
///
/// # Errors
///
/// [`Failure::Input`] for a file that is not one.
pub fn run(args: &InspectArgs) -> Result<(), Failure> {
    let file = posterior_file::read(&args.file)?;
    let mut out = std::io::stdout().lock();
    if args.json {
        let text = summary::json(&file, None).map_err(RunError::new)?;
        writeln!(out, "{text}")?;
    } else {
        write!(out, "{}\n{}", summary::text(&file, None, None), details(&file))?;
    }
    Ok(())
}

/// What `calibrate check` says of a posterior.
///
/// # Errors
///
/// [`InputError`] for a file that is not one.
pub fn understand(path: &Path) -> Result<Understood, InputError> {
    let file = posterior_file::read(path)?;
    Ok(Understood {
        headline: format!(
            "a posterior of {} ({} kinetics, {} simulations, {})",
            file.plan.title,
            file.plan.kinetics,
            file.counters.simulations,
            if summary::trusted(&file) { "to be trusted" } else { "not to be trusted" }
        ),
        details: Vec::new(),
        warnings: file.advice.clone(),
    })
}

fn details(file: &PosteriorFile) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<10}{:>12}{:>12}{:>26}{:>26}{:>8}{:>7}",
        "SI", "MAP", "median", "50 % interval", "95 % interval", "bits", "k-hat"
    );
    let interval =
        |lower: f64, upper: f64| format!("{} .. {}", significant(lower, 4), significant(upper, 4));
    for summary in &file.parameters {
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
    let _ = writeln!(
        text,
        "\nmean and sd in the priors' coordinates, with Monte Carlo standard errors"
    );
    for summary in &file.parameters {
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
    if file.parameters.len() > 1 {
        let _ = writeln!(text, "\ncorrelation in the priors' coordinates");
        for (summary, row) in file.parameters.iter().zip(&file.correlation) {
            let row: String = row.iter().map(|value| format!("{value:>8.3}")).collect();
            let _ = writeln!(text, "{:<10}{row}", summary.parameter.name);
        }
    }
    let _ = writeln!(
        text,
        "\n{:>5}{:>12}{:>9}{:>12}{:>10}{:>16}{:>8}",
        "stage", "simulations", "failed", "components", "beta", "log evidence", "ESS"
    );
    for stage in &file.stages {
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
    for failure in &file.failures {
        let _ = writeln!(text, "failed {} times: {}", failure.count, failure.cause);
    }
    text
}
