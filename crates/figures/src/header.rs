//! Heading and legend, above the panels, where they hide no data.

use plotters::element::Rectangle;
use plotters::style::{Color as _, RGBAColor};

use super::PlotError;
use super::canvas::grid;
use super::elements::{Line, Look, Points};
use super::page::Page;
use super::palette::{Marker, Pen, Role, WHITE};
use super::text::{self, anchor};

const HEADING_SIZE: f32 = 8.0;
const ENTRY_SIZE: f32 = 7.0;
const LINE: f32 = 17.0;
const POINT: f32 = 6.0;
const EDGE: f32 = 4.0;
const ROW: f32 = 10.0;
/// Radius of a point in the legend, whatever it is in the panels.
const RADIUS: f32 = 1.9;

/// How an entry of the legend looks in the panels.
#[derive(Debug, Clone, Copy)]
pub(super) enum Swatch {
    Line(Pen),
    Band(RGBAColor),
    Point(Look),
    LineAndPoint(Pen, Marker),
}

impl Swatch {
    /// An open circle, as measurements are drawn.
    pub(super) fn measurement() -> Swatch {
        let outline = Pen::solid(Role::Data.ink(), 0.65);
        Swatch::Point(Look::filled(Marker::Circle, RADIUS, WHITE).outlined(outline))
    }

    fn length(self) -> f32 {
        if matches!(self, Swatch::Point(_)) { POINT } else { LINE }
    }

    fn draw(self, page: &Page, x: f32, y: f32) -> Result<(), PlotError> {
        let (left, middle, right) =
            (grid(x), grid(x + self.length() / 2.0), grid(x + self.length()));
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
pub(super) fn header(
    page: &Page,
    title: &str,
    entries: &[(String, Swatch)],
) -> Result<f32, PlotError> {
    let room = page.width - 2.0 * EDGE;
    let mut y = EDGE;
    if !title.trim().is_empty() {
        let shown = text::shortened(title, HEADING_SIZE, room);
        page.text(&shown, HEADING_SIZE, (EDGE, y + HEADING_SIZE), anchor::BOTTOM_LEFT)?;
        y += HEADING_SIZE + 5.0;
    }
    let mut x = EDGE;
    for (name, swatch) in entries.iter().filter(|(name, _)| !name.trim().is_empty()) {
        let length = swatch.length();
        let name = text::shortened(name, ENTRY_SIZE, room - length - 3.5);
        let width = length + 3.5 + text::length(&name, ENTRY_SIZE);
        if x > EDGE && x + width > EDGE + room {
            x = EDGE;
            y += ROW;
        }
        let middle = y + ROW / 2.0;
        swatch.draw(page, x, middle)?;
        page.text(&name, ENTRY_SIZE, (x + length + 3.5, middle), anchor::LEFT)?;
        x += width + 9.0;
    }
    if x > EDGE {
        y += ROW;
    }
    Ok(y + 5.0)
}
