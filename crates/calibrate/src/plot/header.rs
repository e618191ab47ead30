//! Heading and legend, above the panels, where they hide no data.

use tiny_skia::{PathBuilder, Rect};

use super::drawing::{Drawing, Ink, Pen};
use super::palette::Marker;
use super::panel::push_marker;
use super::text::{self, Anchor};

const HEADING_SIZE: f32 = 8.0;
const ENTRY_SIZE: f32 = 7.0;
const LINE: f32 = 17.0;
const POINT: f32 = 6.0;
const EDGE: f32 = 4.0;
const ROW: f32 = 10.0;

/// How an entry of the legend looks in the panels.
#[derive(Debug, Clone, Copy)]
pub(super) enum Swatch {
    Line(Pen),
    Band(Ink),
    Point { marker: Marker, fill: Ink, outline: Option<Pen> },
    LineAndPoint { pen: Pen, marker: Marker },
}

impl Swatch {
    fn length(self) -> f32 {
        if matches!(self, Swatch::Point { .. }) { POINT } else { LINE }
    }
}

/// Draws heading and legend; returns where the panels begin.
pub(super) fn header(drawing: &mut Drawing, title: &str, entries: &[(String, Swatch)]) -> f32 {
    let room = drawing.width - 2.0 * EDGE;
    let mut y = EDGE;
    if !title.trim().is_empty() {
        let shown = text::shortened(title, HEADING_SIZE, room);
        drawing.text(
            &shown,
            HEADING_SIZE,
            (EDGE, y + HEADING_SIZE),
            Anchor::BOTTOM_LEFT,
            Ink::BLACK,
        );
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
        swatch_at(drawing, *swatch, x, middle);
        drawing.text(&name, ENTRY_SIZE, (x + length + 3.5, middle), Anchor::LEFT, Ink::BLACK);
        x += width + 9.0;
    }
    if x > EDGE {
        y += ROW;
    }
    y + 5.0
}

fn swatch_at(drawing: &mut Drawing, swatch: Swatch, x: f32, y: f32) {
    let length = swatch.length();
    let ends = ((x, y), (x + length, y));
    let point = |drawing: &mut Drawing, marker, fill, outline: Option<Pen>| {
        let mut path = PathBuilder::new();
        push_marker(&mut path, (x + length / 2.0, y), marker, 1.9);
        let path = path.finish();
        drawing.fill(path.clone(), fill);
        if let Some(pen) = outline {
            drawing.stroke(path, pen);
        }
    };
    match swatch {
        Swatch::Line(pen) => drawing.segment(ends.0, ends.1, pen),
        Swatch::Band(ink) => {
            let mut path = PathBuilder::new();
            if let Some(rect) = Rect::from_ltrb(x, y - 3.0, x + length, y + 3.0) {
                path.push_rect(rect);
            }
            drawing.fill(path.finish(), ink);
        }
        Swatch::Point { marker, fill, outline } => point(drawing, marker, fill, outline),
        Swatch::LineAndPoint { pen, marker } => {
            drawing.segment(ends.0, ends.1, pen);
            point(drawing, marker, pen.ink, None);
        }
    }
}
