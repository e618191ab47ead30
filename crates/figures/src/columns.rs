//! Columns of numbers that belong together, and the check that they do.

use crate::error::{Drawn, PlotError};

/// A lower and an upper bound per point of a grid; both empty for no band.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Band {
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds, as many as lower ones.
    pub upper: Vec<f64>,
}

impl Band {
    /// All bounds, the lower ones first.
    pub(crate) fn bounds(&self) -> impl Iterator<Item = f64> {
        self.lower.iter().chain(&self.upper).copied()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.lower.is_empty() && self.upper.is_empty()
    }
}

/// Checks the columns of the figure that it names.
pub(crate) struct Columns(pub(crate) &'static str);

impl Columns {
    /// Refuses a column that has not one value for each of `count` things.
    pub(crate) fn need(
        &self,
        field: &str,
        values: &[f64],
        (count, per): (usize, &'static str),
    ) -> Drawn {
        if values.len() == count {
            return Ok(());
        }
        let (figure, field, found) = (self.0, field.to_owned(), values.len());
        Err(PlotError::Length { figure, field, per, found, expected: count })
    }

    /// As [`Columns::need`], but the column may be empty.
    pub(crate) fn allow(&self, field: &str, values: &[f64], count: (usize, &'static str)) -> Drawn {
        if values.is_empty() { Ok(()) } else { self.need(field, values, count) }
    }

    /// As [`Columns::allow`], for both bounds of a band.
    pub(crate) fn allow_band(
        &self,
        field: &str,
        band: &Band,
        count: (usize, &'static str),
    ) -> Drawn {
        if band.is_empty() {
            return Ok(());
        }
        self.need(&format!("{field}.lower"), &band.lower, count)?;
        self.need(&format!("{field}.upper"), &band.upper, count)
    }

    /// Refuses more than `most` things.
    pub(crate) fn at_most(&self, what: &'static str, found: usize, most: usize) -> Drawn {
        if found <= most {
            return Ok(());
        }
        Err(PlotError::TooMany { figure: self.0, what, found, most })
    }
}
