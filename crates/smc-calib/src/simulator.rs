//! Simulators: functions from parameters to a vector of observables.

use rayon::prelude::*;
use thiserror::Error;

/// A simulator: maps parameters (in SI) to the observables at the observation points.
///
/// It is called from several threads at once. The same parameters must give the same outputs.
///
/// A calibration takes its simulations through [`Simulator::simulate_batch`], stage by stage, and all of them where
/// [`Settings::map_simulations`](crate::Settings::map_simulations) is 0; the local search for the MAP calls
/// [`Simulator::simulate`].
pub trait Simulator: Sync {
    /// Number of parameters, the length of `theta`.
    fn parameters(&self) -> usize;

    /// Number of observables, the length of `out`.
    fn observables(&self) -> usize;

    /// Runs the simulation at `theta` and fills `out`.
    ///
    /// # Errors
    /// [`SimError::Recoverable`] gives this sample weight zero; [`SimError::Fatal`] and [`SimError::Interrupted`] stop the
    /// run.
    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError>;

    /// Tells that [`simulate_batch`](Self::simulate_batch) will be called for these samples, so that their simulations may
    /// begin: a stage is announced while earlier ones are still to be asked for, where
    /// [`Settings::overlap`](crate::Settings::overlap) is above 0, and only then. Stages are announced in order.
    fn announce(&self, first: usize, thetas: &[f64]) {
        let _ = (first, thetas);
    }

    /// The samples whose answers have changed since they were given, now that so many samples are in: the sampler asks for them
    /// again, and goes on with the new answers. What had been placed by the old ones stays.
    ///
    /// It is asked after each stage.
    fn revised(&self, samples: usize) -> Vec<usize> {
        let _ = samples;
        Vec::new()
    }

    /// Whether answers to samples that are in will change later: failures among them are not judged until then.
    fn will_revise(&self) -> bool {
        false
    }

    /// Runs the parameter sets of samples `first`, `first + 1`, .., given row by row in `thetas`, and fills
    /// `outputs` row by row; one result per row, in order.
    ///
    /// The sampler calls it once per stage, in order, from one thread (several times in a row only where the
    /// outputs of a stage would take more than 64 MB and are not kept whole: more than 512 observations, or more than
    /// 60 million numbers in all). Sample numbers count from 0 and have no gaps, so `first` names what is to be run:
    /// with the same seed, settings and outputs the same numbers have the same parameters, to the bit. A run that
    /// was interrupted is resumed by calibrating again and answering with the outputs that were stored.
    ///
    /// Without an own implementation the rows are simulated in parallel.
    ///
    /// # Errors
    /// Per row as [`Simulator::simulate`]; one fatal row ends the calibration with
    /// [`CalibrateError::Fatal`](crate::CalibrateError::Fatal), one interrupted row with
    /// [`CalibrateError::Interrupted`](crate::CalibrateError::Interrupted), whichever comes first.
    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let _ = first;
        let (d, m) = (self.parameters(), self.observables());
        let mut results = vec![Ok(()); thetas.len() / d];
        let block = parallel_block(results.len());
        results
            .par_chunks_mut(block)
            .zip(outputs.par_chunks_mut(block * m))
            .zip(thetas.par_chunks(block * d))
            .for_each(|((results, outputs), thetas)| {
                let rows = outputs.chunks_exact_mut(m).zip(thetas.chunks_exact(d));
                for (result, (out, theta)) in results.iter_mut().zip(rows) {
                    *result = self.simulate(theta, out);
                }
            });
        results
    }
}

/// Rows that one parallel task works on: up to 16, fewer where there are few rows. No result depends on it.
pub(crate) fn parallel_block(rows: usize) -> usize {
    (rows / (8 * rayon::current_num_threads())).clamp(1, 16)
}

/// Outputs at these parameters; none where the simulation fails or an output is not finite. An error where no further one can run.
pub(crate) fn outputs_at(
    simulator: &dyn Simulator,
    theta: &[f64],
    rows: usize,
) -> Result<Option<Vec<f64>>, SimError> {
    let mut outputs = vec![0.0; rows];
    match simulator.simulate(theta, &mut outputs) {
        Ok(()) => Ok(outputs.iter().all(|o| o.is_finite()).then_some(outputs)),
        Err(error) if error.is_recoverable() => Ok(None),
        Err(error) => Err(error),
    }
}

/// Why one simulation failed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SimError {
    /// These parameters cannot be simulated; others may: the sample gets weight zero.
    #[error("simulation failed: {cause}")]
    Recoverable {
        /// Cause, in the same words for the same kind of failure: failures are counted by cause.
        cause: String,
    },
    /// No simulation can succeed (a missing program, a full disk): the run stops.
    #[error("the simulator cannot run: {cause}")]
    Fatal {
        /// Cause.
        cause: String,
    },
    /// The run is to end: the simulation was not made, or was broken off. No failure of the model.
    #[error("interrupted")]
    Interrupted,
}

impl SimError {
    /// A failure of this sample only.
    pub fn recoverable(cause: impl Into<String>) -> Self {
        Self::Recoverable { cause: cause.into() }
    }

    /// A failure that stops the run.
    pub fn fatal(cause: impl Into<String>) -> Self {
        Self::Fatal { cause: cause.into() }
    }

    /// Whether the run may go on without this sample.
    pub fn is_recoverable(&self) -> bool {
        matches!(self, Self::Recoverable { .. })
    }

    /// Cause of the failure; "interrupted" for an interruption.
    pub fn cause(&self) -> &str {
        match self {
            Self::Recoverable { cause } | Self::Fatal { cause } => cause,
            Self::Interrupted => "interrupted",
        }
    }
}

/// A closure as a [`Simulator`].
pub struct FnSimulator<F> {
    parameters: usize,
    observables: usize,
    simulate: F,
}

impl<F> FnSimulator<F>
where
    F: Fn(&[f64], &mut [f64]) -> Result<(), SimError> + Sync,
{
    /// Wraps `simulate(theta, out)`, which takes `parameters` numbers and fills `observables`.
    pub fn new(parameters: usize, observables: usize, simulate: F) -> Self {
        Self { parameters, observables, simulate }
    }
}

impl<F> Simulator for FnSimulator<F>
where
    F: Fn(&[f64], &mut [f64]) -> Result<(), SimError> + Sync,
{
    fn parameters(&self) -> usize {
        self.parameters
    }

    fn observables(&self) -> usize {
        self.observables
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        (self.simulate)(theta, out)
    }
}
