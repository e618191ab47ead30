//! The page of a figure: plotters' drawing area over the canvas, in points.

use std::cell::{Ref, RefCell};
use std::convert::Infallible;
use std::rc::Rc;

use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{PathElement, Text};
use plotters::prelude::{Color, FontDesc, FontFamily, FontStyle, FontTransform};
use plotters::style::TextStyle;
use plotters::style::text_anchor::Pos;
use tiny_skia::Rect;

use super::canvas::{Backdrop, Canvas, POINTS_PER_MM, grid};
use super::palette::{BLACK, Pen};
use super::{Picture, PlotError, Width, text};

/// More than any figure needs; the page is cut to what is used.
const LONGEST: f32 = 4000.0;

/// The page of one figure. All lengths are in points; the origin is the upper left corner, y points down.
pub(super) struct Page {
    canvas: Rc<RefCell<Canvas>>,
    /// plotters' view of the page, in hundredths of a point.
    pub(super) area: DrawingArea<Canvas, Shift>,
    pub(super) format: Width,
    pub(super) width: f32,
}

impl Page {
    pub(super) fn new(format: Width) -> Page {
        let width = POINTS_PER_MM
            * match format {
                Width::Column => 85.0,
                Width::Full => 170.0,
            };
        let canvas = Rc::new(RefCell::new(Canvas::new(width, LONGEST)));
        Page { area: DrawingArea::from(&canvas), canvas, format, width }
    }

    /// One length at the width of a column, another at that of a page.
    pub(super) fn of_width<T>(&self, column: T, full: T) -> T {
        match self.format {
            Width::Column => column,
            Width::Full => full,
        }
    }

    /// A straight solid line.
    pub(super) fn line(
        &self,
        from: (f32, f32),
        to: (f32, f32),
        pen: &Pen,
    ) -> Result<(), PlotError> {
        let ends = [from, to].map(|(x, y)| (grid(x), grid(y)));
        Ok(self.area.draw(&PathElement::new(ends, pen.style()))?)
    }

    /// A text with its anchor at a point.
    pub(super) fn text(
        &self,
        text: &str,
        size: f32,
        (x, y): (f32, f32),
        anchor: Pos,
    ) -> Result<(), PlotError> {
        let at = (grid(x), grid(y));
        Ok(self.area.draw(&Text::new(text, at, style(size, anchor, FontTransform::None)))?)
    }

    /// A text that reads upwards.
    pub(super) fn turned_text(
        &self,
        text: &str,
        size: f32,
        (x, y): (f32, f32),
        anchor: Pos,
    ) -> Result<(), PlotError> {
        let at = (grid(x), grid(y));
        Ok(self.area.draw(&Text::new(text, at, style(size, anchor, FontTransform::Rotate270)))?)
    }

    /// A text, if its outlines are within bounds and touch no other text; says whether they are.
    pub(super) fn text_where_free(
        &self,
        text: &str,
        size: f32,
        at: (f32, f32),
        anchor: Pos,
        within: &Rect,
    ) -> Result<bool, PlotError> {
        let Some(bounds) = text::outline(text, size, at, anchor, false).map(|path| path.bounds())
        else {
            return Ok(false);
        };
        let inside = within.left() <= bounds.left()
            && bounds.right() <= within.right()
            && within.top() <= bounds.top()
            && bounds.bottom() <= within.bottom();
        let free = self.canvas().texts.iter().all(|t| t.bounds.intersect(&bounds).is_none());
        if inside && free {
            self.text(text, size, at, anchor)?;
        }
        Ok(inside && free)
    }

    /// Puts pixels under all that is drawn, in a rectangle.
    pub(super) fn set_backdrop(
        &self,
        corner: (f32, f32),
        size: (f32, f32),
        draw: impl FnOnce(usize, usize) -> Backdrop,
    ) {
        self.canvas.borrow_mut().set_backdrop(corner, size, draw);
    }

    /// Ends the page at a height.
    pub(super) fn cut(&self, height: f32) {
        self.canvas.borrow_mut().cut(height);
    }

    pub(super) fn canvas(&self) -> Ref<'_, Canvas> {
        self.canvas.borrow()
    }

    pub(super) fn picture(&self) -> Result<Picture, PlotError> {
        self.canvas().picture()
    }
}

/// The canvas draws all text in its own face; the family is a name only.
fn style(size: f32, pos: Pos, transform: FontTransform) -> TextStyle<'static> {
    let size = f64::from(grid(size));
    let font = FontDesc::new(FontFamily::SansSerif, size, FontStyle::Normal).transform(transform);
    TextStyle { font, color: BLACK.to_backend_color(), pos }
}

impl From<DrawingAreaErrorKind<Infallible>> for PlotError {
    fn from(error: DrawingAreaErrorKind<Infallible>) -> PlotError {
        PlotError::Draw(error.to_string())
    }
}
