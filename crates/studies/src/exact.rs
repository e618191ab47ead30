//! The exact posterior of a material, or a run of the sampler on it, for programs to read.

use std::io::Write as _;

use serde::Serialize;
use workbench::error::{Failure, RunError};

use crate::args::ExactArgs;
use crate::cases::{Case, Run};
use crate::pair::Calibration;
use crate::timing::Clock;

/// A run of the sampler; moments are in the priors' coordinates (log10 for log-uniform priors).
#[derive(Debug, Serialize)]
struct Printed {
    mean: Vec<f64>,
    sd: Vec<f64>,
    log_evidence: Option<f64>,
    simulations: usize,
    /// Processor time of all threads, without start and end of the program.
    seconds: f64,
}

pub(crate) fn run(args: &ExactArgs) -> Result<(), Failure> {
    let text = match args.samples {
        None => serde_json::to_string(&Case::material(args.material)?.exact),
        Some(samples) => {
            let (seconds, found) = Clock::Process.measure(|| -> Result<_, Failure> {
                let posterior = Calibration::of(args.material)?.posterior(samples, args.seed);
                Ok(Run::of_posterior(posterior.map_err(RunError::new)?).estimate)
            });
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
    let text = text.map_err(RunError::new)?;
    writeln!(std::io::stdout().lock(), "{text}")?;
    Ok(())
}
