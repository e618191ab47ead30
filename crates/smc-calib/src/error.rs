//! Why a calibration could not be done.

use crate::{NoiseError, SimError, StageRecord};
use thiserror::Error;

/// Why a calibration could not be done.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum CalibrateError {
    /// No parameters, or numbers of parameters that differ.
    #[error(
        "the simulator takes {simulator} parameters but {problem} priors were given; give one prior per parameter, at least one"
    )]
    Parameters {
        /// Number of parameters of the simulator.
        simulator: usize,
        /// Number of priors of the problem.
        problem: usize,
    },
    /// Numbers of observables that differ.
    #[error(
        "the simulator gives {simulator} observables but there are {observations} observations; they must be as many"
    )]
    Observables {
        /// Number of observables of the simulator.
        simulator: usize,
        /// Number of observations of the problem.
        observations: usize,
    },
    /// The noise model does not fit.
    #[error(transparent)]
    Noise(#[from] NoiseError),
    /// A setting outside its range.
    #[error("setting {setting} is {value}; it must be {range}")]
    Setting {
        /// Name.
        setting: &'static str,
        /// Value.
        value: f64,
        /// Allowed range.
        range: &'static str,
    },
    /// A given parameter set that cannot be weighted.
    #[error("given parameter set {}: {problem}", set + 1)]
    Design {
        /// Number of the set, from 0.
        set: usize,
        /// The problem with it.
        problem: String,
    },
    /// An earlier posterior that cannot be the first proposal.
    #[error("the first proposal: {problem}")]
    FirstProposal {
        /// The problem with it.
        problem: String,
    },
    /// A member of a population that cannot be used.
    #[error("member {member} of the population: {problem}")]
    Member {
        /// Its name.
        member: String,
        /// The problem with it.
        problem: String,
    },
    /// The simulator said that it cannot run at all.
    #[error("the simulator cannot run, stopped after {simulations} simulations: {cause}")]
    Fatal {
        /// The simulator's message.
        cause: String,
        /// Simulations done.
        simulations: usize,
    },
    /// Too many failures.
    #[error(
        "{failed} of {simulations} simulations failed (most often: {commonest}); narrow the priors to where the simulator works, or raise max_failed_share"
    )]
    TooManyFailures {
        /// Failed.
        failed: usize,
        /// Done.
        simulations: usize,
        /// The commonest cause.
        commonest: String,
    },
    /// No sample has a likelihood above zero.
    #[error(
        "none of the {simulations} simulated samples has a likelihood above zero: the evidence is zero; widen the noise or move the priors"
    )]
    ZeroEvidence {
        /// Done.
        simulations: usize,
    },
    /// The simulator was interrupted, or the observer asked to stop before anything could be said.
    #[error("stopped on request after {} simulations, before there was a posterior", .stages.last().map_or(0, |s| s.total))]
    Interrupted {
        /// The stages that were finished.
        stages: Vec<StageRecord>,
    },
}

impl CalibrateError {
    /// Error of a run that was ended by `error` after so many simulations; the caller
    /// adds the finished stages ([`CalibrateError::after`]).
    pub(crate) fn ended_by(error: SimError, simulations: usize) -> Self {
        match error {
            SimError::Interrupted => Self::Interrupted { stages: Vec::new() },
            SimError::Fatal { cause } | SimError::Recoverable { cause } => {
                Self::Fatal { cause, simulations }
            }
        }
    }

    /// The same after these stages.
    pub(crate) fn after(self, done: &[StageRecord]) -> Self {
        match self {
            Self::Interrupted { .. } => Self::Interrupted { stages: done.to_vec() },
            other => other,
        }
    }
}
