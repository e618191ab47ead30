//! The measured curve.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Measured values in the order in which they are assimilated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observations {
    control: Vec<f64>,
    values: Vec<f64>,
    sigma: Option<Vec<f64>>,
}

/// Why observations were refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ObservationError {
    /// No observations.
    #[error("there are no observations; give at least one")]
    Empty,
    /// Two columns of different length.
    #[error(
        "{what} has {got} entries but there are {expected} observed values; give one per observation"
    )]
    Length {
        /// Name of the column.
        what: &'static str,
        /// Its length.
        got: usize,
        /// Number of observed values.
        expected: usize,
    },
    /// NaN or infinity.
    #[error("{what} of observation {index} is {value}; it must be finite")]
    NotFinite {
        /// Name of the column.
        what: &'static str,
        /// Observation, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The control variable goes back.
    #[error(
        "control value {value} of observation {index} is below the one before it ({previous}); sort the rows"
    )]
    Unsorted {
        /// Observation, from 0.
        index: usize,
        /// The value.
        value: f64,
        /// The value before it.
        previous: f64,
    },
    /// A standard deviation that is not positive.
    #[error("noise standard deviation of observation {index} is {value}; it must be positive")]
    Sigma {
        /// Observation, from 0.
        index: usize,
        /// The value.
        value: f64,
    },
}

impl Observations {
    /// Values measured at ascending control values (times).
    ///
    /// # Errors
    /// Empty, unequal lengths, not finite, or unsorted.
    pub fn new(control: Vec<f64>, values: Vec<f64>) -> Result<Self, ObservationError> {
        if values.is_empty() {
            return Err(ObservationError::Empty);
        }
        if control.len() != values.len() {
            return Err(ObservationError::Length {
                what: "the control variable",
                got: control.len(),
                expected: values.len(),
            });
        }
        for (what, column) in [("control value", &control), ("value", &values)] {
            if let Some((index, &value)) = column.iter().enumerate().find(|(_, v)| !v.is_finite()) {
                return Err(ObservationError::NotFinite { what, index, value });
            }
        }
        for (i, pair) in control.windows(2).enumerate() {
            if pair[1] < pair[0] {
                return Err(ObservationError::Unsorted {
                    index: i + 1,
                    value: pair[1],
                    previous: pair[0],
                });
            }
        }
        Ok(Self { control, values, sigma: None })
    }

    /// Adds one noise standard deviation per observation, for fixed noise per point.
    ///
    /// # Errors
    /// Wrong length, or a value that is not positive and finite.
    pub fn with_sigma(mut self, sigma: Vec<f64>) -> Result<Self, ObservationError> {
        if sigma.len() != self.values.len() {
            return Err(ObservationError::Length {
                what: "the noise column",
                got: sigma.len(),
                expected: self.values.len(),
            });
        }
        if let Some((index, &value)) =
            sigma.iter().enumerate().find(|(_, s)| !(s.is_finite() && **s > 0.0))
        {
            return Err(ObservationError::Sigma { index, value });
        }
        self.sigma = Some(sigma);
        Ok(self)
    }

    /// Number of observations.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Never true: construction refuses an empty set.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The control variable (times), ascending.
    pub fn control(&self) -> &[f64] {
        &self.control
    }

    /// The measured values.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Noise standard deviation per observation, where it was given.
    pub fn sigma(&self) -> Option<&[f64]> {
        self.sigma.as_deref()
    }
}
