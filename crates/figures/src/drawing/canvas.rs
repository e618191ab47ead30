//! Where plotters draws: a list of fills and strokes.
//!
//! plotters counts in whole pixels. A pixel of this backend is a hundredth of a point, far below what is printed, so
//! curves stay smooth. PNG and SVG are written from the same list.

use std::convert::Infallible;
use std::ops::Range;

use plotters::prelude::{Color as _, DrawingBackend, FontTransform};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind,
};
use tiny_skia::{Path, PathBuilder, Rect};

use super::backdrop::Backdrop;
use super::length::{PER_POINT, grid, points};
use super::palette::Pen;
use super::text;

/// One drawn element of a figure.
pub(crate) enum Mark {
    Fill(Path, BackendColor),
    Stroke { path: Path, color: BackendColor, width: u32, dash: &'static [f32] },
    Text(Path, BackendColor, String),
}

/// A text as it was drawn, with the bounds of its outlines in points.
#[derive(Debug, Clone)]
pub(crate) struct TextBox {
    pub(crate) text: String,
    pub(crate) bounds: Rect,
}

/// Numbers of the marks that checks of a figure look at.
#[derive(Debug, Default)]
pub(crate) struct Traces {
    /// All marks of the legend.
    pub(crate) legend: Range<usize>,
    /// Curves, those of the legend among them.
    pub(crate) curves: Vec<usize>,
    /// Points, those of the legend among them.
    pub(crate) points: Vec<usize>,
    /// Measurements.
    pub(crate) measured: Vec<usize>,
}

/// A picture under construction, in hundredths of a point. The origin is the upper left corner, y points down.
pub(crate) struct Canvas {
    /// Width and height that plotters may draw on; the picture is cut to what is used.
    pub(super) size: (u32, u32),
    pub(crate) marks: Vec<Mark>,
    pub(crate) texts: Vec<TextBox>,
    pub(super) backdrop: Option<Backdrop>,
    pub(crate) traces: Traces,
}

impl Canvas {
    /// An empty picture of a size in points.
    pub(super) fn new(width: f32, height: f32) -> Canvas {
        let size = (grid(width) as u32, grid(height) as u32);
        Canvas {
            size,
            marks: Vec::new(),
            texts: Vec::new(),
            backdrop: None,
            traces: Traces::default(),
        }
    }

    /// Width and height in points.
    pub(crate) fn size_in_points(&self) -> (f32, f32) {
        (points(self.size.0 as i32), points(self.size.1 as i32))
    }

    /// Leaves out what lies below a height in points.
    pub(super) fn cut(&mut self, height: f32) {
        self.size.1 = grid(height) as u32;
    }

    pub(super) fn fill(&mut self, path: Option<Path>, color: BackendColor) {
        self.marks.extend(path.map(|path| Mark::Fill(path, color)));
    }

    /// Draws a line with the dashes of its pen, which plotters' styles do not have.
    pub(super) fn stroke(&mut self, path: Option<Path>, pen: &Pen) {
        let (color, width) = (pen.ink.to_backend_color(), pen.style().stroke_width);
        self.marks.extend(path.map(|path| Mark::Stroke { path, color, width, dash: pen.dash }));
    }
}

/// Outcome of drawing onto the canvas, which never fails.
pub(super) type Marked = Result<(), DrawingErrorKind<Infallible>>;

/// Only what the figures draw has a method of its own; for other elements plotters falls back on single pixels.
impl DrawingBackend for Canvas {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.size
    }

    fn ensure_prepared(&mut self) -> Marked {
        Ok(())
    }

    fn present(&mut self) -> Marked {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Marked {
        self.draw_rect((x, y), (x + 1, y + 1), &color, true)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        (left, top): BackendCoord,
        (right, bottom): BackendCoord,
        style: &S,
        fill: bool,
    ) -> Marked {
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        if fill {
            self.fill_polygon(corners, style)
        } else {
            self.draw_path(corners.into_iter().chain([(left, top)]), style)
        }
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Marked {
        let mut outline = PathBuilder::new();
        push_corners(&mut outline, path);
        let (color, width) = (style.color(), style.stroke_width());
        let path = outline.finish();
        self.marks.extend(path.map(|path| Mark::Stroke { path, color, width, dash: &[] }));
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        corners: I,
        style: &S,
    ) -> Marked {
        let mut outline = PathBuilder::new();
        push_corners(&mut outline, corners);
        outline.close();
        self.fill(outline.finish(), style.color());
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Marked {
        let turned = matches!(style.transform(), FontTransform::Rotate270);
        let (size, at) = (style.size() as f32, (x as f32, y as f32));
        let Some(path) = text::outline(text, size, at, style.anchor(), turned) else {
            return Ok(());
        };
        let b = path.bounds();
        let [left, top, right, bottom] =
            [b.left(), b.top(), b.right(), b.bottom()].map(|at| at / PER_POINT);
        if let Some(bounds) = Rect::from_ltrb(left, top, right, bottom) {
            self.texts.push(TextBox { text: text.to_owned(), bounds });
        }
        self.marks.push(Mark::Text(path, style.color(), text.to_owned()));
        Ok(())
    }
}

/// Appends a line through points of plotters.
pub(super) fn push_corners(
    outline: &mut PathBuilder,
    corners: impl IntoIterator<Item = BackendCoord>,
) {
    for (i, (x, y)) in corners.into_iter().enumerate() {
        let (x, y) = (x as f32, y as f32);
        if i == 0 { outline.move_to(x, y) } else { outline.line_to(x, y) }
    }
}
