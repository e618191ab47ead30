//! Figures of calibrations and of sintering simulations, drawn from plain numbers as PNG and SVG.
//!
//! A figure is a struct of numbers and names; this crate knows no simulator, no sampler and no files. [`Figure::render`]
//! draws it into a [`Picture`], the bytes of both formats, at the [`Width`] of a paper column or of a page:
//!
//! ```
//! use figures::{Figure as _, FitFigure, Width};
//!
//! let figure = FitFigure {
//!     title: "PS at 120 °C".to_owned(),
//!     control: vec![0.0, 10.0, 20.0, 30.0],
//!     value: vec![0.21, 0.58, 0.79, 0.98],
//!     grid: vec![0.0, 15.0, 30.0],
//!     map: vec![0.2, 0.7, 1.0],
//!     ..FitFigure::default()
//! };
//! let picture = figure.render(Width::Column)?;
//! assert!(picture.svg.starts_with("<svg") && picture.png.starts_with(b"\x89PNG"));
//! # Ok::<(), figures::PlotError>(())
//! ```
//!
//! # Conventions
//!
//! - Lengths are in points (1/72 inch) of the printed picture: a 7 pt label is 7 pt in print.
//! - Text is drawn as outlines of the DejaVu Sans face that is linked into the program. A figure gives the same bytes on
//!   every run, and needs no fonts of the system.
//! - In names, symbols and units `_{..}` lowers and `^{..}` raises: `C_{1}`, `τ_{s}`, `10^{-3}`.
//! - A label covers no data, nothing is drawn over a measurement, and every curve and point has its colour in the legend:
//!   [`broken_rules`] says where a figure does not keep that.
//! - A value that is not finite is left out: a gap in a curve, a missing marker.
//! - plotters draws onto a backend of this crate, a list of fills and strokes at a hundredth of a point; PNG and SVG are
//!   both written from that list.

mod axes;
mod bed;
mod columns;
mod compare;
mod convergence;
mod corner;
mod curves;
mod densification;
mod density;
mod drawing;
mod error;
mod failures;
mod figure;
mod fit;
mod marginals;
mod picture;
mod ranks;
mod recursion;
mod regime_map;
mod residuals;
mod rules;
mod series;
#[cfg(test)]
mod synthetic;
#[cfg(test)]
mod tests;
mod together;
mod work_precision;

pub use axes::Axes;
pub use bed::BedFigure;
pub use columns::Band;
pub use compare::{CompareFigure, NamedCurve};
pub use convergence::{ConvergenceFigure, ConvergenceStage};
pub use corner::{CornerFigure, CornerParameter};
pub use curves::{CurvesFigure, MarkedCurve};
pub use densification::DensificationFigure;
pub use drawing::Role;
pub use error::PlotError;
pub use failures::FailuresFigure;
pub use figure::Figure;
pub use fit::{FitFigure, Knee};
pub use marginals::{MarginalsFigure, MarginalsParameter};
pub use picture::{Picture, Width};
pub use ranks::{RankedQuantity, RanksFigure};
pub use recursion::{RecursionFigure, RecursionParameter};
pub use regime_map::RegimeMapFigure;
pub use residuals::ResidualsFigure;
pub use rules::broken_rules;
pub use series::SeriesFigure;
pub use together::{TogetherCurve, TogetherFigure};
pub use work_precision::{WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries};
