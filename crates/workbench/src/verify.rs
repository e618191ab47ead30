//! `--verify`: the posterior against brute-force quadrature of the same model, data, prior and noise.

use std::fmt::Write as _;

use smc_calib::Problem;
use smc_calib::quadrature::{Quadrature, QuadratureSettings, quadrature};

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::model::NeckGrowth;
use crate::number::{significant, with_error};
use crate::plan::Plan;
use crate::posterior_file::PosteriorFile;

/// Root mean square errors that the sampler reaches at [`REACH_SIMULATIONS`]: means in posterior standard
/// deviations, standard deviations relative, log evidence absolute.
const REACH: [f64; 3] = [0.01, 0.01, 0.005];
/// The budget that the reach is stated for; fewer simulations have larger errors, as 1/sqrt(N).
const REACH_SIMULATIONS: f64 = 16_384.0;
/// One run may be off by three times the root mean square.
const RUN: f64 = 3.0;

/// One number against its exact value.
#[derive(Debug, Clone, PartialEq)]
struct Line {
    what: String,
    found: f64,
    exact: f64,
    /// Difference in the unit of the reach.
    error: f64,
    allowed: f64,
}

/// Integrates the plan's posterior and prints the comparison on standard error.
///
/// # Errors
///
/// [`Failure::Run`] where the two differ by more than the sampler may, [`Failure::Input`] for a plan that
/// quadrature cannot do (four parameters, tuned noise).
pub fn run(
    plan: &Plan,
    file: &PosteriorFile,
    pool: &rayon::ThreadPool,
    quiet: bool,
) -> Result<(), Failure> {
    let model = NeckGrowth::of(plan)?;
    if model.names().len() > 3 || !file.is_posterior {
        return Err(InputError::new("--verify", Mistake::Conflict)
            .found(if file.is_posterior {
                "four parameters"
            } else {
                "noise that is tuned, for which there is no posterior to verify"
            })
            .expected("at most three parameters and inferred or fixed noise")
            .into());
    }
    let problem = Problem {
        simulator: &model,
        parameters: plan.parameters.clone(),
        observations: plan.observations()?,
        noise: plan.noise.clone(),
    };
    let exact = pool
        .install(|| quadrature(&problem, &QuadratureSettings::default()))
        .map_err(|error| RunError::new(format_args!("quadrature: {error}")))?;
    let lines = compare(file, &exact);
    let mut text = format!(
        "quadrature ({} evaluations, settled to {}):\n",
        exact.evaluations,
        significant(exact.error, 2)
    );
    for line in &lines {
        let _ = writeln!(
            text,
            "  {:<22} {:>12} exact {:>12}  off by {:>8} (allowed {})",
            line.what,
            with_error(line.found, 1e-4, 4),
            with_error(line.exact, 1e-4, 4),
            significant(line.error, 2),
            significant(line.allowed, 2),
        );
    }
    if !quiet {
        eprint!("{text}");
    }
    match lines.iter().find(|line| line.error.is_nan() || line.error > line.allowed) {
        None => Ok(()),
        Some(line) => Err(RunError::new(format_args!(
            "the posterior differs from quadrature: {} is {}, exactly {}",
            line.what, line.found, line.exact
        ))
        .help("run more simulations (--samples)")
        .into()),
    }
}

fn compare(file: &PosteriorFile, exact: &Quadrature) -> Vec<Line> {
    let simulations = file.counters.simulations as f64;
    let factor = RUN * (REACH_SIMULATIONS / simulations).sqrt().max(1.0);
    let allowed = |reach: f64| factor * reach + exact.error;
    let mut lines = Vec::new();
    for (place, summary) in file.parameters.iter().enumerate() {
        let (mean, sd) = (exact.mean[place], exact.sd[place]);
        let name = &summary.parameter.name;
        let found = &summary.in_coordinate;
        lines.push(Line {
            what: format!("mean of {name} [sd]"),
            found: found.mean,
            exact: mean,
            error: (found.mean - mean).abs() / sd,
            allowed: allowed(REACH[0]),
        });
        lines.push(Line {
            what: format!("sd of {name} [relative]"),
            found: found.sd,
            exact: sd,
            error: (found.sd / sd - 1.0).abs(),
            allowed: allowed(REACH[1]),
        });
    }
    lines.push(Line {
        what: "log evidence".to_owned(),
        found: file.log_evidence.value,
        exact: exact.log_evidence,
        error: (file.log_evidence.value - exact.log_evidence).abs(),
        allowed: allowed(REACH[2]),
    });
    lines
}
