//! The points that a posterior is drawn from and shown by.

use std::path::Path;

use smc_calib::Posterior;

use super::samples::{read_draws, read_samples};
use crate::error::InputError;
use crate::record::Record;

/// Parameters of a posterior with their shares of it, as [`Posterior::points`]: what figures need beside the record.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointColumns {
    /// One column per parameter \[SI\].
    pub parameters: Vec<Vec<f64>>,
    /// Shares of the posterior.
    pub weights: Vec<f64>,
}

impl PointColumns {
    /// Those of a posterior.
    pub fn of(posterior: &Posterior) -> Self {
        let column = |j: usize| posterior.points().map(|point| point.theta[j]).collect();
        Self {
            parameters: (0..posterior.parameters.len()).map(column).collect(),
            weights: posterior.points().map(|point| point.weight).collect(),
        }
    }

    /// Reads them beside a `posterior.json`.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a file that is missing or cut off.
    pub fn read(record: &Record, folder: &Path) -> Result<Self, InputError> {
        if record.drawn_by_process {
            let parameters = read_draws(record, folder)?;
            let count = parameters.first().map_or(0, Vec::len);
            return Ok(Self { parameters, weights: vec![1.0 / count as f64; count] });
        }
        let samples = read_samples(record, folder)?;
        let weights = samples.weights.clone();
        Ok(Self { parameters: samples.estimated().to_vec(), weights })
    }
}
