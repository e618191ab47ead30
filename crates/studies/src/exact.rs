//! The exact posterior of a material, or a run of the sampler on it, for programs to read.

use std::io::Write as _;

use serde::Serialize;

use super::cases::{self, Case};
use super::cpu_time::{Of, measured};
use crate::args::ExactArgs;
use workbench::error::{Failure, RunError};

/// A run of the sampler; moments are in the priors' coordinates (log10 for log-uniform priors).
#[derive(Debug, Serialize)]
struct Printed {
    mean: Vec<f64>,
    sd: Vec<f64>,
    log_evidence: Option<f64>,
    simulations: usize,
    /// Processor time without start and end of the program, of all threads.
    seconds: f64,
}

pub(super) fn run(args: &ExactArgs) -> Result<(), Failure> {
    let text = match args.samples {
        None => serde_json::to_string(&Case::material(args.material)?.exact),
        Some(samples) => {
            let (seconds, found) =
                measured(Of::Process, || cases::run_material(args.material, samples, args.seed));
            let found = found?;
            serde_json::to_string(&Printed {
                seconds,
                mean: found.mean,
                sd: found.sd,
                log_evidence: found.log_evidence,
                simulations: found.simulations,
            })
        }
    };
    let text = text.map_err(|error| RunError::new(error.to_string()))?;
    writeln!(std::io::stdout().lock(), "{text}")?;
    Ok(())
}
