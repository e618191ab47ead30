//! Errors of a heat.

use thiserror::Error;

/// A mobility law or a history that cannot be computed with; every message names the field, its value and the remedy.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum HeatError {
    /// A number is outside its range.
    #[error("{field} = {value}: {remedy}")]
    Field {
        /// The field, as it is called in [`MobilityLaw`](super::MobilityLaw), [`History`](super::History) or [`Heat`](super::Heat).
        field: &'static str,
        /// Its value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// A row of a table of temperatures is wrong.
    #[error("row {row} of the temperature table: {field} = {value}: {remedy}")]
    Row {
        /// Its place, from 1.
        row: usize,
        /// `time_s` or `temperature_k`.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// A table of temperatures without rows.
    #[error("the temperature table is empty: give at least one row of time and temperature")]
    NoRows,
}

/// NaN is outside every range.
pub(super) fn within(
    field: &'static str,
    value: f64,
    (low, high): (f64, f64),
    remedy: &'static str,
) -> Result<(), HeatError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(HeatError::Field { field, value, remedy })
    }
}

/// Temperatures that are taken \[K\]. Those of a fit are effective ones and may be beyond anything physical.
pub(super) const TEMPERATURES_K: (f64, f64) = (1e-3, 1e6);

pub(super) fn temperature(field: &'static str, value_k: f64) -> Result<(), HeatError> {
    within(field, value_k, TEMPERATURES_K, "give a temperature in kelvin, 1e-3 to 1e6")
}
