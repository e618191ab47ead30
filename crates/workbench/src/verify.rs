//! A posterior against quadrature of the same model, data, prior and noise.

use std::fmt::Write as _;
use std::path::Path;

use smc_calib::Problem;
use smc_calib::quadrature::{Quadrature, QuadratureSettings, quadrature};

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::number::{significant, with_error};
use crate::pair::model::NeckGrowth;
use crate::record::Record;

/// Root mean square errors that the sampler reaches at [`REACH_SIMULATIONS`]: means in posterior standard
/// deviations, standard deviations relative, log evidence absolute.
const REACH: [f64; 3] = [0.01, 0.01, 0.005];
/// Simulations at which it reaches them; fewer have larger errors, as 1/sqrt(N).
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

/// A posterior beside its quadrature.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    lines: Vec<Line>,
    evaluations: usize,
    error: f64,
    /// Samples of the posterior.
    samples: usize,
}

/// Integrates the posterior of a plan with one pair by quadrature, on the current thread pool.
///
/// # Errors
///
/// [`Failure::Input`] for a plan that quadrature cannot do (a program, four parameters, tuned noise).
pub fn verify(record: &Record) -> Result<Verification, Failure> {
    let plan = &record.plan;
    let (_, measured) = plan.pair()?;
    let refused = |found: &str| {
        InputError::new("--verify", Mistake::Conflict)
            .found(found)
            .expected("at most three parameters and inferred or fixed noise")
    };
    if !record.is_posterior {
        return Err(
            refused("noise that is tuned, for which there is no posterior to verify").into()
        );
    }
    if plan.parameters.len() > 3 {
        return Err(refused("four parameters").into());
    }
    let problem = Problem {
        simulator: &NeckGrowth::of(plan)?,
        parameters: plan.parameters.clone(),
        observations: measured.observations()?,
        noise: measured.noise.clone(),
    };
    let exact = quadrature(&problem, &QuadratureSettings::default())
        .map_err(|error| RunError::new(format_args!("quadrature: {error}")))?;
    Ok(Verification {
        lines: compare(record, &exact),
        evaluations: exact.evaluations,
        error: exact.error,
        samples: plan.budget(),
    })
}

impl Verification {
    /// The numbers side by side.
    pub fn text(&self) -> String {
        let mut text = format!(
            "quadrature ({} evaluations, settled to {}):\n",
            self.evaluations,
            significant(self.error, 2)
        );
        for line in &self.lines {
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
        text
    }

    /// Refuses a posterior, of the run in `folder`, that is off by more than the sampler may be.
    ///
    /// # Errors
    ///
    /// [`RunError`] with the first number that differs.
    pub fn passed(&self, folder: &Path) -> Result<(), RunError> {
        match self.lines.iter().find(|line| line.error.is_nan() || line.error > line.allowed) {
            None => Ok(()),
            Some(line) => Err(RunError::new(format_args!(
                "the posterior differs from quadrature: {} is {}, exactly {}",
                line.what, line.found, line.exact
            ))
            .help(format_args!(
                "run more simulations: calibrate --continue-from {} --samples {}",
                folder.display(),
                2 * self.samples
            ))),
        }
    }
}

fn compare(record: &Record, exact: &Quadrature) -> Vec<Line> {
    let simulations = record.counters.simulations as f64;
    let factor = RUN * (REACH_SIMULATIONS / simulations).sqrt().max(1.0);
    let line = |what: String, found: f64, exact_value: f64, error: f64, reach: f64| {
        let allowed = factor * reach + exact.error;
        Line { what, found, exact: exact_value, error, allowed }
    };
    let mut lines = Vec::new();
    for (place, summary) in record.parameters.iter().enumerate() {
        let (mean, sd) = (exact.mean[place], exact.sd[place]);
        let (name, found) = (&summary.parameter.name, &summary.in_coordinate);
        let off = (found.mean - mean).abs() / sd;
        lines.push(line(format!("mean of {name} [sd]"), found.mean, mean, off, REACH[0]));
        let off = (found.sd / sd - 1.0).abs();
        lines.push(line(format!("sd of {name} [relative]"), found.sd, sd, off, REACH[1]));
    }
    let (found, wanted) = (record.log_evidence.value, exact.log_evidence);
    lines.push(line("log evidence".to_owned(), found, wanted, (found - wanted).abs(), REACH[2]));
    lines
}
