//! Heading and legend, above the panels, where they hide no data.

use plotters::element::Rectangle;
use plotters::style::{Color as _, RGBAColor};

use super::elements::{Line, Look, Points};
use super::length::grid;
use super::page::Page;
use super::palette::{Marker, Pen, Role, WHITE};
use super::text::{self, anchor};
use crate::error::{Drawn, PlotError};

const HEADING_SIZE: f32 = 8.0;
const ENTRY_SIZE: f32 = 7.0;
/// Lengths of a line and of a point in the legend.
const LINE: f32 = 14.0;
const POINT: f32 = 6.0;
/// Space between the mark and the name of an entry.
const SPACE: f32 = 3.5;
const EDGE: f32 = 4.0;
/// Height of a row of the legend.
const ROW: f32 = 10.0;
/// Radius of all points in the legend.
const RADIUS: f32 = 1.9;

/// Mark of an entry of the legend.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Swatch {
    Line(Pen),
    Band(RGBAColor),
    Point(Look),
    LineAndPoint(Pen, Marker),
    /// An upright interval with its ends and its middle.
    Interval(Pen),
}

impl Swatch {
    /// An open circle, as measurements are drawn.
    pub(crate) fn measurement() -> Swatch {
        let outline = Pen::solid(Role::Data.ink(), 0.65);
        Swatch::Point(Look::filled(Marker::Circle, RADIUS, WHITE).outlined(outline))
    }

    fn length(self) -> f32 {
        if matches!(self, Swatch::Point(_) | Swatch::Interval(_)) { POINT } else { LINE }
    }

    fn draw(self, page: &Page, x: f32, y: f32) -> Drawn {
        let [left, middle, right] = [0.0, 0.5, 1.0].map(|share| grid(x + share * self.length()));
        let line = |pen| Line { points: vec![(left, grid(y)), (right, grid(y))], pen };
        let point = |look: Look| Points {
            at: vec![(middle, grid(y))],
            look: Look { radius: RADIUS, ..look },
        };
        match self {
            Swatch::Line(pen) => page.area.draw(&line(pen))?,
            Swatch::Band(ink) => {
                let corners = [(left, grid(y - 3.0)), (right, grid(y + 3.0))];
                page.area.draw(&Rectangle::new(corners, ink.filled()))?;
            }
            Swatch::Interval(pen) => {
                let stroke = |points: [(f32, f32); 2]| Line {
                    points: points.map(|(x, y)| (grid(x), grid(y))).to_vec(),
                    pen,
                };
                let middle = x + POINT / 2.0;
                page.area.draw(&stroke([(middle, y - 3.6), (middle, y + 3.6)]))?;
                for (up, half) in [(-3.6, 1.6), (0.0, 2.6), (3.6, 1.6)] {
                    page.area.draw(&stroke([(middle - half, y + up), (middle + half, y + up)]))?;
                }
            }
            Swatch::Point(look) => page.area.draw(&point(look))?,
            Swatch::LineAndPoint(pen, marker) => {
                page.area.draw(&line(pen))?;
                page.area.draw(&point(Look::filled(marker, RADIUS, pen.ink)))?;
            }
        }
        Ok(())
    }
}

/// Draws heading and legend; returns where the panels begin.
pub(crate) fn header(
    page: &Page,
    title: &str,
    entries: &[(&str, Swatch)],
) -> Result<f32, PlotError> {
    let room = page.width - 2.0 * EDGE;
    let mut y = EDGE;
    if !title.trim().is_empty() {
        let shown = text::shortened(title, HEADING_SIZE, room);
        page.text(&shown, HEADING_SIZE, (EDGE, y + HEADING_SIZE), anchor::BOTTOM_LEFT)?;
        y += HEADING_SIZE + 5.0;
    }
    let first = page.canvas().marks.len();
    let mut x = EDGE;
    for (name, swatch) in entries.iter().filter(|(name, _)| !name.trim().is_empty()) {
        let length = swatch.length() + SPACE;
        let name = text::shortened(name, ENTRY_SIZE, room - length);
        let width = length + text::length(&name, ENTRY_SIZE);
        if x > EDGE && x + width > EDGE + room {
            x = EDGE;
            y += ROW;
        }
        let middle = y + ROW / 2.0;
        swatch.draw(page, x, middle)?;
        page.text(&name, ENTRY_SIZE, (x + length, middle), anchor::LEFT)?;
        x += width + 7.0;
    }
    page.legend_from(first);
    if x > EDGE {
        y += ROW;
    }
    Ok(y + 5.0)
}
