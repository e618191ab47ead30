//! The trait of everything that can be drawn.

use crate::drawing::Page;
use crate::error::PlotError;
use crate::picture::{Picture, Width};

/// A figure that can be drawn. Only the figures of this crate implement it.
pub trait Figure {
    /// Checks the columns and draws onto an empty page.
    #[doc(hidden)]
    fn draw(&self, page: &Page) -> Result<(), PlotError>;

    /// Draws the figure at a width, as PNG and SVG.
    ///
    /// # Errors
    ///
    /// [`PlotError::Length`] if columns do not match, [`PlotError::TooMany`] if the figure has more panels than fit.
    fn render(&self, width: Width) -> Result<Picture, PlotError> {
        let page = Page::new(width);
        self.draw(&page)?;
        page.picture()
    }
}
