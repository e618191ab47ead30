//! Figures written as files.

use figures::{Band, Figure, Width};
use rayon::prelude::*;

use crate::error::RunError;
use crate::output::WriteFile;
use crate::output::page::Drawn;
use crate::watch::{Unwatched, Watch};

/// Figures by the names of their files.
pub type NamedFigures = Vec<(String, Box<dyn Figure + Send + Sync>)>;

/// A band between its lower and its upper ends.
pub(super) fn band([lower, upper]: &[Vec<f64>; 2]) -> Band {
    Band { lower: lower.clone(), upper: upper.clone() }
}

/// Writes figures as PNG and SVG, and gives what was written, in their order.
///
/// # Errors
///
/// [`RunError`] for a figure that cannot be drawn, or what `write` says.
pub fn draw_all(
    figures: &NamedFigures,
    width: Width,
    write: &WriteFile<'_>,
) -> Result<Vec<Drawn>, RunError> {
    draw_watched(figures, width, write, &Unwatched::default())
}

/// As [`draw_all`]; each figure is a piece of the work.
pub(crate) fn draw_watched(
    figures: &NamedFigures,
    width: Width,
    write: &WriteFile<'_>,
    watch: &dyn Watch,
) -> Result<Vec<Drawn>, RunError> {
    figures
        .par_iter()
        .map(|(name, figure)| {
            let picture = figure
                .render(width)
                .map_err(|error| RunError::new(format_args!("figure {name}: {error}")))?;
            write(&format!("{name}.png"), &picture.png)?;
            write(&format!("{name}.svg"), picture.svg.as_bytes())?;
            watch.advance();
            Ok(Drawn { name: name.clone(), picture })
        })
        .collect()
}
