//! A panel: a rectangle with two axes, and what is drawn into it.

use tiny_skia::{PathBuilder, Rect};

use super::axis::{Axis, Direction, TICK_SIZE};
use super::drawing::{Drawing, Ink, Pen};
use super::palette::Marker;
use super::text::{self, Anchor};

/// Size of axis titles in points.
pub(super) const TITLE_SIZE: f32 = 7.5;
/// Smallest size a title is shrunk to before it is cut.
const LEAST_SIZE: f32 = 5.5;
/// So many measurements get a marker with an outline each.
const FEW: usize = 120;
const TICK_LENGTH: f32 = 2.5;
const EDGE: f32 = 4.0;
/// How far a tick label may stand out beyond its panel.
const OVERHANG: f32 = 10.0;
const AXIS_PEN: Pen = Pen::solid(Ink::BLACK, 0.6);
const MINOR_PEN: Pen = Pen::solid(Ink::BLACK, 0.4);

/// What the layout needs to know of a panel.
#[derive(Debug, Clone)]
pub(super) struct Spec {
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Labels and title of the horizontal axis (false where the panel below carries them).
    pub(super) x_labels: bool,
    /// The same for the vertical axis.
    pub(super) y_labels: bool,
    /// No vertical axis at all: densities, whose height says nothing.
    pub(super) bare: bool,
}

impl Spec {
    pub(super) fn new(x: Axis, y: Axis) -> Spec {
        Spec { x, y, x_labels: true, y_labels: true, bare: false }
    }

    pub(super) fn x_labels(mut self, shown: bool) -> Spec {
        self.x_labels = shown;
        self
    }

    pub(super) fn y_labels(mut self, shown: bool) -> Spec {
        self.y_labels = shown;
        self
    }

    pub(super) fn bare(mut self) -> Spec {
        self.bare = true;
        self.y_labels = false;
        self
    }

    fn left_room(&self, height: f32) -> f32 {
        if !self.y_labels {
            return 0.0;
        }
        let widest = self
            .y
            .ticks(height, Direction::Up)
            .labelled
            .iter()
            .map(|(_, label)| text::length(label, TICK_SIZE))
            .fold(0.0, f32::max);
        TICK_LENGTH + 2.0 + widest + 4.0 + TITLE_SIZE
    }

    fn bottom_room(&self) -> f32 {
        if self.x_labels {
            TICK_LENGTH + 3.5 + TICK_SIZE + 3.0 + TITLE_SIZE + 2.0
        } else {
            TICK_LENGTH
        }
    }
}

/// A rectangle on the page with its axes.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    pub(super) left: f32,
    pub(super) top: f32,
    pub(super) right: f32,
    pub(super) bottom: f32,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

/// Lays rows of panels out below `top`, draws their axes and sets the height of the picture. Panels of one column of
/// rows with equally many cells have the same edges.
pub(super) fn layout(
    drawing: &mut Drawing,
    top: f32,
    gap: f32,
    rows: &[(f32, Vec<Option<Spec>>)],
) -> Vec<Vec<Option<Panel>>> {
    let mut y = top;
    let mut panels = Vec::with_capacity(rows.len());
    for (index, (height, cells)) in rows.iter().enumerate() {
        let columns = cells.len();
        let mut lefts = vec![0.0_f32; columns];
        for (other_height, other) in rows.iter().filter(|(_, other)| other.len() == columns) {
            for (left, spec) in lefts.iter_mut().zip(other) {
                if let Some(spec) = spec {
                    *left = left.max(spec.left_room(*other_height));
                }
            }
        }
        // The left edge is common to all rows.
        for (other_height, other) in rows {
            if let Some(Some(spec)) = other.first() {
                lefts[0] = lefts[0].max(spec.left_room(*other_height));
            }
        }
        lefts[0] = lefts[0].max(OVERHANG);
        let taken: f32 =
            lefts.iter().sum::<f32>() + gap * (columns - 1) as f32 + 2.0 * EDGE + OVERHANG - EDGE;
        let width = ((drawing.width - taken) / columns as f32).max(10.0);
        let mut x = EDGE;
        let mut row = Vec::with_capacity(columns);
        for (column, spec) in cells.iter().enumerate() {
            x += lefts[column];
            if let Some(spec) = spec {
                let panel = Panel {
                    left: x,
                    top: y,
                    right: x + width,
                    bottom: y + height,
                    x: spec.x.clone(),
                    y: spec.y.clone(),
                };
                let free = if columns == 1 { OVERHANG } else { (gap / 2.0 - 1.0).min(OVERHANG) };
                panel.axes(drawing, spec, free, x - lefts[column]);
                row.push(Some(panel));
            } else {
                row.push(None);
            }
            x += width + gap;
        }
        panels.push(row);
        // Labels may hang into an empty cell below.
        let below =
            rows.get(index + 1).map(|(_, cells)| cells).filter(|below| below.len() == columns);
        let crowded = |column: usize| below.is_none_or(|below| below[column].is_some());
        let bottom = (0..columns)
            .filter(|&column| crowded(column))
            .filter_map(|column| cells[column].as_ref().map(Spec::bottom_room))
            .fold(0.0, f32::max);
        y += height + bottom + if index + 1 < rows.len() { gap.min(8.0) } else { EDGE - 2.0 };
    }
    drawing.height = y;
    panels
}

impl Panel {
    fn width(&self) -> f32 {
        self.right - self.left
    }

    fn height(&self) -> f32 {
        self.bottom - self.top
    }

    fn axes(&self, drawing: &mut Drawing, spec: &Spec, overhang: f32, title_left: f32) {
        let across = self.x.ticks(self.width(), Direction::Across { overhang });
        drawing.segment((self.left, self.bottom), (self.right, self.bottom), AXIS_PEN);
        let along = |c: f64| {
            self.left + ((c - self.x.low) / (self.x.high - self.x.low)) as f32 * self.width()
        };
        for (c, label) in &across.labelled {
            let x = along(*c);
            drawing.segment((x, self.bottom), (x, self.bottom + TICK_LENGTH), AXIS_PEN);
            if spec.x_labels {
                drawing.text(
                    label,
                    TICK_SIZE,
                    (x, self.bottom + TICK_LENGTH + 3.5),
                    Anchor::TOP,
                    Ink::BLACK,
                );
            }
        }
        for c in &across.minor {
            drawing.segment(
                (along(*c), self.bottom),
                (along(*c), self.bottom + TICK_LENGTH * 0.6),
                MINOR_PEN,
            );
        }
        if spec.x_labels {
            let (title, size) = fitted(
                &across.name,
                &across.unit,
                self.width() + 2.0 * overhang.min(self.left - 2.0),
            );
            let y = self.bottom + TICK_LENGTH + 3.5 + TICK_SIZE + 3.0;
            drawing.text(
                &title,
                size,
                ((self.left + self.right) / 2.0, y),
                Anchor::TOP,
                Ink::BLACK,
            );
        }
        if spec.bare {
            return;
        }
        let up = self.y.ticks(self.height(), Direction::Up);
        drawing.segment((self.left, self.top), (self.left, self.bottom), AXIS_PEN);
        let along = |c: f64| {
            self.bottom - ((c - self.y.low) / (self.y.high - self.y.low)) as f32 * self.height()
        };
        for (c, label) in &up.labelled {
            let y = along(*c);
            drawing.segment((self.left - TICK_LENGTH, y), (self.left, y), AXIS_PEN);
            if spec.y_labels {
                drawing.text(
                    label,
                    TICK_SIZE,
                    (self.left - TICK_LENGTH - 2.0, y),
                    Anchor::RIGHT,
                    Ink::BLACK,
                );
            }
        }
        for c in &up.minor {
            drawing.segment(
                (self.left - TICK_LENGTH * 0.6, along(*c)),
                (self.left, along(*c)),
                MINOR_PEN,
            );
        }
        if spec.y_labels {
            let (title, size) = fitted(&up.name, &up.unit, self.height() + 4.0);
            drawing.text(
                &title,
                size,
                (title_left, (self.top + self.bottom) / 2.0),
                Anchor::TURNED,
                Ink::BLACK,
            );
        }
    }

    /// Place of a point on the page, if it has one; it may lie outside the panel.
    pub(super) fn at(&self, x: f64, y: f64) -> Option<(f32, f32)> {
        let (x, y) = (self.x.share(x)?, self.y.share(y)?);
        // Far outside is as good as farther outside, and finite in single precision.
        let (x, y) = (x.clamp(-1e3, 1e3) as f32, y.clamp(-1e3, 1e3) as f32);
        Some((self.left + x * self.width(), self.bottom - y * self.height()))
    }

    pub(super) fn holds(&self, (x, y): (f32, f32)) -> bool {
        let slack = 0.5;
        (self.left - slack..=self.right + slack).contains(&x)
            && (self.top - slack..=self.bottom + slack).contains(&y)
    }

    /// A curve through the points, broken where one is missing and cut off at the edges.
    pub(super) fn line(&self, drawing: &mut Drawing, xs: &[f64], ys: &[f64], pen: Pen) {
        let mut path = PathBuilder::new();
        let mut last: Option<(f32, f32)> = None;
        let mut pen_at: Option<(f32, f32)> = None;
        for (&x, &y) in xs.iter().zip(ys) {
            let here = self.at(x, y);
            if let (Some(from), Some(to)) = (last, here)
                && let Some((a, b)) = self.cut(from, to)
            {
                if pen_at != Some(a) {
                    path.move_to(a.0, a.1);
                }
                path.line_to(b.0, b.1);
                pen_at = Some(b);
            }
            last = here;
        }
        drawing.stroke(path.finish(), pen);
    }

    /// The part of a segment inside the panel (Liang and Barsky).
    fn cut(&self, from: (f32, f32), to: (f32, f32)) -> Option<((f32, f32), (f32, f32))> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let (mut enter, mut leave) = (0.0_f32, 1.0_f32);
        for (towards, room) in [
            (-dx, from.0 - self.left),
            (dx, self.right - from.0),
            (-dy, from.1 - self.top),
            (dy, self.bottom - from.1),
        ] {
            if towards == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if towards < 0.0 {
                enter = enter.max(room / towards);
            } else {
                leave = leave.min(room / towards);
            }
        }
        if enter > leave {
            return None;
        }
        let point = |s: f32| {
            // Ends stay exactly where they are, so that the next segment joins.
            if s <= 0.0 {
                from
            } else if s >= 1.0 {
                to
            } else {
                (from.0 + s * dx, from.1 + s * dy)
            }
        };
        Some((point(enter), point(leave)))
    }

    /// The area between two curves; a lone point between gaps becomes a bar.
    pub(super) fn band(
        &self,
        drawing: &mut Drawing,
        xs: &[f64],
        lower: &[f64],
        upper: &[f64],
        ink: Ink,
    ) {
        let mut run: Vec<(f32, f32, f32)> = Vec::new();
        let clamp = |y: f32| y.clamp(self.top, self.bottom);
        let mut close = |run: &mut Vec<(f32, f32, f32)>| {
            let mut path = PathBuilder::new();
            match run.as_slice() {
                [] => {}
                &[(x, low, high)] => {
                    if let Some(rect) =
                        Rect::from_ltrb(x - 1.5, high.min(low), x + 1.5, high.max(low))
                    {
                        path.push_rect(rect);
                    }
                }
                many => {
                    for (i, &(x, low, _)) in many.iter().enumerate() {
                        if i == 0 { path.move_to(x, low) } else { path.line_to(x, low) }
                    }
                    for &(x, _, high) in many.iter().rev() {
                        path.line_to(x, high);
                    }
                    path.close();
                }
            }
            drawing.fill(path.finish(), ink);
            run.clear();
        };
        for ((&x, &low), &high) in xs.iter().zip(lower).zip(upper) {
            // A bound with no place on a logarithmic axis lies below it.
            let floor = |v: f64| {
                if v <= 0.0 && self.y.coordinate(v).is_none() && v.is_finite() {
                    10_f64.powf(self.y.low)
                } else {
                    v
                }
            };
            match (self.at(x, floor(low)), self.at(x, floor(high))) {
                (Some((x, low)), Some((_, high)))
                    if (self.left - 0.5..=self.right + 0.5).contains(&x) =>
                {
                    run.push((x.clamp(self.left, self.right), clamp(low), clamp(high)));
                }
                _ => close(&mut run),
            }
        }
        close(&mut run);
    }

    /// Points that lie within the panel, filled with one ink and outlined with another.
    #[expect(clippy::too_many_arguments, reason = "two columns and the look of a point")]
    pub(super) fn markers(
        &self,
        drawing: &mut Drawing,
        xs: &[f64],
        ys: &[f64],
        marker: Marker,
        radius: f32,
        fill: Ink,
        outline: Option<Pen>,
    ) {
        let mut path = PathBuilder::new();
        for (&x, &y) in xs.iter().zip(ys) {
            if let Some(at) = self.at(x, y).filter(|&at| self.holds(at)) {
                push_marker(&mut path, at, marker, radius);
            }
        }
        let path = path.finish();
        drawing.fill(path.clone(), fill);
        if let Some(pen) = outline {
            drawing.stroke(path, pen);
        }
    }

    /// Whether so many measurements belong below the curves rather than above.
    pub(super) fn dense(xs: &[f64]) -> bool {
        xs.len() > FEW
    }

    /// Measurements: open circles, smaller and without outline where there are many.
    pub(super) fn data(&self, drawing: &mut Drawing, xs: &[f64], ys: &[f64]) {
        let ink = super::Role::Data.ink();
        if xs.len() <= FEW {
            self.markers(
                drawing,
                xs,
                ys,
                Marker::Circle,
                1.7,
                Ink::WHITE.with_opacity(0.85),
                Some(Pen::solid(ink, 0.65)),
            );
        } else {
            let (radius, opacity) = if xs.len() <= 600 { (1.0, 0.6) } else { (0.6, 0.45) };
            let marker = if radius < 1.0 { Marker::Dot } else { Marker::Circle };
            self.markers(drawing, xs, ys, marker, radius, ink.with_opacity(opacity), None);
        }
    }

    /// Vertical bars with the given ends.
    pub(super) fn bars(
        &self,
        drawing: &mut Drawing,
        xs: &[f64],
        lower: &[f64],
        upper: &[f64],
        pen: Pen,
    ) {
        let mut path = PathBuilder::new();
        for ((&x, &low), &high) in xs.iter().zip(lower).zip(upper) {
            if let (Some(a), Some(b)) = (self.at(x, low), self.at(x, high))
                && let Some((a, b)) = self.cut(a, b)
            {
                path.move_to(a.0, a.1);
                path.line_to(b.0, b.1);
            }
        }
        drawing.stroke(path.finish(), pen);
    }

    /// Writes a label into the panel if it fits there and touches no other text.
    pub(super) fn label(
        &self,
        drawing: &mut Drawing,
        text: &str,
        at: (f32, f32),
        anchor: Anchor,
    ) -> bool {
        let Some(bounds) = text::outline(text, TITLE_SIZE, at, anchor).map(|path| path.bounds())
        else {
            return false;
        };
        let inside = bounds.left() > self.left + 1.0
            && bounds.right() < self.right
            && bounds.top() > self.top
            && bounds.bottom() < self.bottom - 1.0;
        let free = drawing.texts.iter().all(|other| other.bounds.intersect(&bounds).is_none());
        if inside && free {
            drawing.text(text, TITLE_SIZE, at, anchor, Ink::BLACK);
        }
        inside && free
    }

    /// A line across the whole panel.
    pub(super) fn across(&self, drawing: &mut Drawing, y: f64, pen: Pen) {
        if let Some(share) = self.y.share(y).filter(|s| (0.0..=1.0).contains(s)) {
            let y = self.bottom - share as f32 * self.height();
            drawing.segment((self.left, y), (self.right, y), pen);
        }
    }

    /// A line up the whole panel.
    pub(super) fn upright(&self, drawing: &mut Drawing, x: f64, pen: Pen) {
        if let Some(share) = self.x.share(x).filter(|s| (0.0..=1.0).contains(s)) {
            let x = self.left + share as f32 * self.width();
            drawing.segment((x, self.top), (x, self.bottom), pen);
        }
    }
}

pub(super) fn push_marker(path: &mut PathBuilder, (x, y): (f32, f32), marker: Marker, r: f32) {
    let mut polygon = |points: &[(f32, f32)]| {
        for (i, (dx, dy)) in points.iter().enumerate() {
            if i == 0 {
                path.move_to(x + dx * r, y + dy * r)
            } else {
                path.line_to(x + dx * r, y + dy * r)
            }
        }
        path.close();
    };
    match marker {
        Marker::Circle => path.push_circle(x, y, r),
        Marker::Dot => polygon(&[
            (-0.5, -0.87),
            (0.5, -0.87),
            (1.0, 0.0),
            (0.5, 0.87),
            (-0.5, 0.87),
            (-1.0, 0.0),
        ]),
        Marker::Square => polygon(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)]),
        Marker::Triangle => polygon(&[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)]),
        Marker::Down => polygon(&[(0.0, 1.2), (-1.1, -0.8), (1.1, -0.8)]),
        Marker::Diamond => polygon(&[(0.0, -1.35), (1.1, 0.0), (0.0, 1.35), (-1.1, 0.0)]),
        Marker::Cross => polygon(&[
            (-0.35, -1.2),
            (0.35, -1.2),
            (0.35, -0.35),
            (1.2, -0.35),
            (1.2, 0.35),
            (0.35, 0.35),
            (0.35, 1.2),
            (-0.35, 1.2),
            (-0.35, 0.35),
            (-1.2, 0.35),
            (-1.2, -0.35),
            (-0.35, -0.35),
        ]),
    }
}

/// A title at the size at which it fits; at the smallest size the name is cut, never the unit.
fn fitted(name: &str, unit: &str, room: f32) -> (String, f32) {
    let long = text::length(name, TITLE_SIZE) + text::length(unit, TITLE_SIZE);
    let size = (TITLE_SIZE * room / long.max(1.0)).clamp(LEAST_SIZE, TITLE_SIZE);
    let name = text::shortened(name, size, room - text::length(unit, size));
    (text::shortened(&format!("{name}{unit}"), size, room), size)
}
