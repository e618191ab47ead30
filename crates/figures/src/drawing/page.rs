//! The page of a figure: plotters' drawing area over the canvas, in points.

use std::cell::{Ref, RefCell};
use std::rc::Rc;

use plotters::coord::Shift;
use plotters::drawing::DrawingArea;
use plotters::element::{PathElement, Text};
use plotters::prelude::{Color, FontDesc, FontFamily, FontStyle, FontTransform};
use plotters::style::TextStyle;
use plotters::style::text_anchor::Pos;
use tiny_skia::Rect;

use super::backdrop::Backdrop;
use super::canvas::Canvas;
use super::length::{POINTS_PER_MM, grid};
use super::palette::{BLACK, Pen};
use super::png::pixels;
use super::text;
use crate::error::{Drawn, PlotError};
use crate::picture::{Picture, Width};

/// More than any figure needs; the page is cut to what is used.
const LONGEST: f32 = 4000.0;

/// A place on the page: distances from the left and from the top, in points.
pub(crate) type At = (f32, f32);

/// The page of one figure. All lengths are in points; the origin is the upper left corner, y points down.
pub struct Page {
    canvas: Rc<RefCell<Canvas>>,
    /// plotters' view of the page, in hundredths of a point.
    pub(super) area: DrawingArea<Canvas, Shift>,
    format: Width,
    pub(crate) width: f32,
}

impl Page {
    /// An empty page.
    pub(crate) fn new(format: Width) -> Page {
        let width = POINTS_PER_MM
            * match format {
                Width::Column => 85.0,
                Width::Full => 170.0,
            };
        let canvas = Rc::new(RefCell::new(Canvas::new(width, LONGEST)));
        Page { area: DrawingArea::from(&canvas), canvas, format, width }
    }

    /// The first value at the width of a column, the second at that of a page.
    pub(crate) fn of_width<T>(&self, column: T, full: T) -> T {
        match self.format {
            Width::Column => column,
            Width::Full => full,
        }
    }

    /// A straight solid line.
    pub(super) fn line(&self, from: At, to: At, pen: &Pen) -> Drawn {
        let ends = [from, to].map(|(x, y)| (grid(x), grid(y)));
        Ok(self.area.draw(&PathElement::new(ends, pen.style()))?)
    }

    /// A text with its anchor at a place.
    pub(crate) fn text(&self, text: &str, size: f32, at: At, anchor: Pos) -> Drawn {
        self.write(text, size, at, anchor, FontTransform::None)
    }

    /// A text that reads upwards.
    pub(super) fn turned_text(&self, text: &str, size: f32, at: At, anchor: Pos) -> Drawn {
        self.write(text, size, at, anchor, FontTransform::Rotate270)
    }

    /// The canvas draws all text in its own face; the family is a name only.
    fn write(&self, text: &str, size: f32, (x, y): At, pos: Pos, turn: FontTransform) -> Drawn {
        let size = f64::from(grid(size));
        let font = FontDesc::new(FontFamily::SansSerif, size, FontStyle::Normal).transform(turn);
        let style = TextStyle { font, color: BLACK.to_backend_color(), pos };
        Ok(self.area.draw(&Text::new(text, (grid(x), grid(y)), style))?)
    }

    /// A text, if its outlines lie within bounds and touch no other text; says whether they do.
    pub(crate) fn text_where_free(
        &self,
        text: &str,
        size: f32,
        at: At,
        anchor: Pos,
        within: &Rect,
    ) -> Result<bool, PlotError> {
        let Some(path) = text::outline(text, size, at, anchor, false) else { return Ok(false) };
        let bounds = path.bounds();
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

    /// Puts pixels under all that is drawn, in a rectangle given by its upper left corner and its size. `draw` gets the
    /// size in pixels times `samples`, which are averaged.
    pub(crate) fn set_backdrop(
        &self,
        (left, top): At,
        (width, height): At,
        samples: usize,
        draw: impl FnOnce(usize, usize) -> Vec<[f32; 3]>,
    ) {
        let (across, down) = (pixels(width).max(1), pixels(height).max(1));
        let colours = draw(across * samples, down * samples);
        let corner = (pixels(left), pixels(top));
        let backdrop = Backdrop::averaged(&colours, across, samples, corner);
        self.canvas.borrow_mut().backdrop = Some(backdrop);
    }

    /// Ends the page at a height.
    pub(super) fn cut(&self, height: f32) {
        self.canvas.borrow_mut().cut(height);
    }

    /// Notes that all marks from this one on make the legend.
    pub(super) fn legend_from(&self, first: usize) {
        let mut canvas = self.canvas.borrow_mut();
        canvas.traces.legend = first..canvas.marks.len();
    }

    /// The drawing so far.
    pub(crate) fn canvas(&self) -> Ref<'_, Canvas> {
        self.canvas.borrow()
    }

    /// The page as PNG and SVG.
    pub(crate) fn picture(&self) -> Result<Picture, PlotError> {
        let canvas = self.canvas();
        Ok(Picture { png: canvas.png()?, svg: canvas.svg() })
    }
}
