//! Failures of the workbench as exceptions of Python.

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use workbench::error::{Failure, InputError, Mistake, RunError};

create_exception!(
    calibrate,
    InputMistake,
    PyValueError,
    "A mistake in what was given: where, what was seen, what was expected, what to do."
);
create_exception!(
    calibrate,
    RunFailed,
    PyRuntimeError,
    "A calibration that could not succeed although its input was right, with the cause and what to do."
);

/// A failure as the exception that a user meets.
pub(crate) fn raised(failure: Failure) -> PyErr {
    match failure {
        Failure::Input(error) => mistaken(&error),
        Failure::Run(error) => failed(&error),
        Failure::Interrupted | Failure::Paused(_) => {
            PyKeyboardInterrupt::new_err(failure.to_string())
        }
        Failure::OutputClosed | Failure::InputReported => RunFailed::new_err(failure.to_string()),
    }
}

/// A mistake of the user's.
pub(crate) fn mistaken(error: &InputError) -> PyErr {
    InputMistake::new_err(error.to_string())
}

/// A run that failed.
pub(crate) fn failed(error: &RunError) -> PyErr {
    RunFailed::new_err(error.to_string())
}

/// A mistake in an argument of this name.
pub(crate) fn argument(
    name: &str,
    found: impl std::fmt::Display,
    expected: impl std::fmt::Display,
) -> PyErr {
    mistaken(&InputError::new(name, Mistake::OutOfRange).found(found).expected(expected))
}
