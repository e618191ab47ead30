//! Figures written as files.

use figures::{Figure, Width};
use rayon::prelude::*;

use crate::error::RunError;
use crate::output::WriteFile;

/// Figures by the names of their files.
pub type NamedFigures = Vec<(String, Box<dyn Figure + Send + Sync>)>;

/// Writes figures as PNG and SVG.
///
/// # Errors
///
/// [`RunError`] for a figure that cannot be drawn, or what `write` says.
pub fn draw_all(
    figures: &NamedFigures,
    width: Width,
    write: &WriteFile<'_>,
) -> Result<(), RunError> {
    figures
        .par_iter()
        .map(|(name, figure)| {
            let picture = figure
                .render(width)
                .map_err(|error| RunError::new(format_args!("figure {name}: {error}")))?;
            write(&format!("{name}.png"), &picture.png)?;
            write(&format!("{name}.svg"), picture.svg.as_bytes())
        })
        .collect()
}
