//! Why a figure cannot be drawn.

use std::convert::Infallible;

use plotters::drawing::DrawingAreaErrorKind;

/// Why a figure cannot be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// Two columns that belong together differ in length.
    #[error(
        "figure {figure}: `{field}` has {found} values where {expected} are needed; give one per {per}"
    )]
    Length {
        /// Name of the figure.
        figure: &'static str,
        /// Field of the figure's struct.
        field: String,
        /// Item that has one value: the field needs one value for each.
        per: &'static str,
        /// Length of the field.
        found: usize,
        /// Length it should have.
        expected: usize,
    },
    /// More panels than fit on a page.
    #[error("figure {figure}: {found} {what}, but only {most} fit; leave some out")]
    TooMany {
        /// Name of the figure.
        figure: &'static str,
        /// Name of the items.
        what: &'static str,
        /// Number given.
        found: usize,
        /// Largest number that can be drawn.
        most: usize,
    },
    /// plotters refused to draw.
    #[error("the figure could not be drawn: {0}")]
    Draw(String),
    /// The picture could not be encoded.
    #[error("the picture could not be encoded as PNG: {0}")]
    Encode(String),
}

impl From<DrawingAreaErrorKind<Infallible>> for PlotError {
    fn from(error: DrawingAreaErrorKind<Infallible>) -> PlotError {
        PlotError::Draw(error.to_string())
    }
}

/// Outcome of drawing something.
pub(crate) type Drawn = Result<(), PlotError>;
