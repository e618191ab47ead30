//! The figures of a calibration, drawn into memory as PNG and SVG.
//!
//! Figures are drawn with plotters onto a backend of their own ([`Picture`] holds what it writes): lines are placed to a
//! hundredth of a point, and both formats come from one list of strokes and fills.
//!
//! A figure is a plain struct of numbers: it knows neither the simulator nor the sampler. [`Figure::render`] turns it
//! into a [`Picture`] at the width of a paper column or of a page.
//!
//! Every length is in points (1/72 inch) of the *printed* picture, so a 7.5 pt label is 7.5 pt in print. Text is drawn as
//! outlines of the DejaVu Sans face linked into the program: a picture looks the same on every machine and the same
//! figure gives the same bytes.
//!
//! In names and symbols `_{..}` lowers and `^{..}` raises: `C_{1}`, `τ_{s}`, `10^{-3}`. Everything else is drawn as it
//! stands.
//!
//! Values which are not finite are skipped: a gap in a curve, a missing marker, an interval that is not drawn.

mod axis;
mod bed;
mod canvas;
mod compare;
mod convergence;
mod corner;
mod densification;
mod density;
mod elements;
mod fit;
mod header;
mod layout;
mod page;
mod palette;
mod panel;
mod recursion;
mod regime_map;
mod residuals;
mod series;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tests;
mod text;
mod work_precision;

pub use bed::BedFigure;
pub use compare::{CompareFigure, NamedCurve};
pub use convergence::{ConvergenceFigure, ConvergenceStage};
pub use corner::{CornerFigure, CornerParameter};
pub use densification::DensificationFigure;
pub use fit::{FitFigure, Knee};
pub use palette::Role;
pub use recursion::{RecursionFigure, RecursionParameter};
pub use regime_map::RegimeMapFigure;
pub use residuals::ResidualsFigure;
pub use series::SeriesFigure;
pub use work_precision::{WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries};

/// One figure as bytes of both formats, drawn from the same list of strokes and fills.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// A PNG file: 8-bit RGB, 300 dots per inch at the chosen width.
    pub png: Vec<u8>,
    /// An SVG document with all text as outlines.
    pub svg: String,
}

/// Width of the printed picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Width {
    /// One column of a two-column page, 85 mm.
    Column,
    /// The full width of a page, 170 mm.
    Full,
}

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
        /// What each value belongs to.
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
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many can be drawn.
        most: usize,
    },
    /// plotters refused to draw.
    #[error("the figure could not be drawn: {0}")]
    Draw(String),
    /// The picture could not be encoded.
    #[error("the picture could not be encoded as PNG: {0}")]
    Encode(String),
}

/// What the axes of a measured curve are called.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axes {
    /// Name of the control variable, for example `time t`.
    pub control_name: String,
    /// Its unit; empty for a pure number.
    pub control_unit: String,
    /// Name of the measured quantity.
    pub value_name: String,
    /// Its unit; empty for a pure number.
    pub value_unit: String,
    /// Whether both axes begin at zero.
    pub from_zero: bool,
}

impl Default for Axes {
    /// Neck growth: contact ratio over time, both from zero.
    fn default() -> Self {
        Self {
            control_name: "time t".to_owned(),
            control_unit: "s".to_owned(),
            value_name: "contact ratio a/R".to_owned(),
            value_unit: String::new(),
            from_zero: true,
        }
    }
}

/// A lower and an upper bound per point of a grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Band {
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds, as many as lower ones.
    pub upper: Vec<f64>,
}

/// Anything that can be drawn.
pub trait Figure {
    /// Draws the figure at a width, as PNG and SVG.
    ///
    /// # Errors
    ///
    /// [`PlotError::Length`] if columns do not match, [`PlotError::TooMany`] if the figure has more panels than fit.
    fn render(&self, width: Width) -> Result<Picture, PlotError>;

    /// The picture before it is encoded, which tests look into.
    #[cfg(test)]
    #[allow(private_interfaces, reason = "compiled for the tests of this module only")]
    fn page(&self, width: Width) -> Result<page::Page, PlotError>;
}

macro_rules! figures {
    ($($figure:ty),*) => {
        $(impl Figure for $figure {
            fn render(&self, width: Width) -> Result<Picture, PlotError> {
                let page = page::Page::new(width);
                self.draw(&page)?;
                page.picture()
            }

            #[cfg(test)]
            #[allow(private_interfaces, reason = "compiled for the tests of this module only")]
            fn page(&self, width: Width) -> Result<page::Page, PlotError> {
                let page = page::Page::new(width);
                self.draw(&page)?;
                Ok(page)
            }
        })*
    };
}

figures!(
    CompareFigure,
    ConvergenceFigure,
    CornerFigure,
    DensificationFigure,
    FitFigure,
    RecursionFigure,
    RegimeMapFigure,
    ResidualsFigure,
    SeriesFigure,
    WorkPrecisionFigure,
    WorkPrecisionGrid
);

/// Checks the columns of a figure, named for its messages.
struct Columns(&'static str);

impl Columns {
    fn need(
        &self,
        field: &str,
        values: &[f64],
        expected: usize,
        per: &'static str,
    ) -> Result<(), PlotError> {
        if values.len() == expected {
            return Ok(());
        }
        Err(PlotError::Length {
            figure: self.0,
            field: field.to_owned(),
            per,
            found: values.len(),
            expected,
        })
    }

    /// As [`Columns::need`], but the column may be left empty.
    fn allow(
        &self,
        field: &str,
        values: &[f64],
        expected: usize,
        per: &'static str,
    ) -> Result<(), PlotError> {
        if values.is_empty() { Ok(()) } else { self.need(field, values, expected, per) }
    }

    fn allow_band(
        &self,
        field: &str,
        band: &Band,
        expected: usize,
        per: &'static str,
    ) -> Result<(), PlotError> {
        if band.lower.is_empty() && band.upper.is_empty() {
            return Ok(());
        }
        self.need(&format!("{field}.lower"), &band.lower, expected, per)?;
        self.need(&format!("{field}.upper"), &band.upper, expected, per)
    }

    fn at_most(&self, what: &'static str, found: usize, most: usize) -> Result<(), PlotError> {
        if found <= most {
            Ok(())
        } else {
            Err(PlotError::TooMany { figure: self.0, what, found, most })
        }
    }
}
