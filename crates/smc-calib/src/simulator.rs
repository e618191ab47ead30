//! What is calibrated: a function from parameters to a vector of observables.

use thiserror::Error;

/// A simulator: maps parameters (in SI) to the observables at the observation points.
///
/// It is called from several threads at once. The same parameters must give the same outputs.
pub trait Simulator: Sync {
    /// Number of parameters, the length of `theta`.
    fn parameters(&self) -> usize;

    /// Number of observables, the length of `out`.
    fn observables(&self) -> usize;

    /// Runs the simulation at `theta` and fills `out`.
    ///
    /// # Errors
    /// [`SimError::Recoverable`] gives this sample weight zero; [`SimError::Fatal`] stops the run.
    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError>;
}

/// Why one simulation failed.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum SimError {
    /// These parameters cannot be simulated; others may: the sample gets weight zero.
    #[error("simulation failed: {cause}")]
    Recoverable {
        /// What went wrong, in words that are the same for the same kind of failure: failures are counted by them.
        cause: String,
    },
    /// No simulation can succeed (a missing program, a full disk): the run stops.
    #[error("the simulator cannot run: {cause}")]
    Fatal {
        /// What went wrong.
        cause: String,
    },
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

    /// What went wrong.
    pub fn cause(&self) -> &str {
        match self {
            Self::Recoverable { cause } | Self::Fatal { cause } => cause,
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
