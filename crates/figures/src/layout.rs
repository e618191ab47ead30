//! Rows of panels on a page, and their axes.

use super::PlotError;
use super::axis::{Axis, Direction, TICK_SIZE, Ticks};
use super::page::Page;
use super::palette::{BLACK, Pen};
use super::panel::Panel;
use super::text::{self, anchor};

/// Size of axis titles in points.
pub(super) const TITLE_SIZE: f32 = 7.5;
/// Smallest size a title is shrunk to before it is cut.
const LEAST_SIZE: f32 = 5.5;
const TICK_LENGTH: f32 = 2.5;
const EDGE: f32 = 4.0;
/// How far a tick label may stand out beyond its panel.
pub(super) const OVERHANG: f32 = 10.0;
const AXIS_PEN: Pen = Pen::solid(BLACK, 0.6);
const MINOR_PEN: Pen = Pen::solid(BLACK, 0.4);

/// What the layout needs to know of a panel.
#[derive(Debug, Clone)]
pub(super) struct Spec {
    x: Axis,
    y: Axis,
    /// Labels and title of the horizontal axis (false where the panel below carries them).
    x_labels: bool,
    /// The same for the vertical axis.
    y_labels: bool,
    /// No vertical axis at all: densities, whose height says nothing.
    bare: bool,
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

    /// Room for tick labels and title left of a panel of a height.
    fn left_room(&self, height: f32) -> f32 {
        if self.y_labels {
            let labels = widest(&self.y.ticks(height, Direction::Up));
            TICK_LENGTH + 2.0 + labels + 4.0 + TITLE_SIZE
        } else {
            0.0
        }
    }

    /// Whether fewer than two labels of the horizontal axis have room unless they stand upright.
    fn crowded(&self, width: f32, overhang: f32) -> bool {
        let labels = |direction| self.x.ticks(width, direction).labelled.len();
        let flat = labels(Direction::Across { overhang });
        flat < 2 && flat < labels(Direction::Up)
    }

    /// Ticks of the horizontal axis, and how deep their labels reach.
    fn across(&self, width: f32, overhang: f32, upright: bool) -> Across {
        if upright {
            let ticks = self.x.ticks(width, Direction::Up);
            let depth = widest(&ticks);
            Across { ticks, upright, depth }
        } else {
            let ticks = self.x.ticks(width, Direction::Across { overhang });
            Across { ticks, upright, depth: TICK_SIZE }
        }
    }
}

struct Across {
    ticks: Ticks,
    upright: bool,
    depth: f32,
}

fn widest(ticks: &Ticks) -> f32 {
    ticks.labelled.iter().map(|(_, label)| text::length(label, TICK_SIZE)).fold(0.0, f32::max)
}

/// Lays rows of panels out below `top`, draws their axes and cuts the page below them. Panels of one column of rows with
/// equally many cells have the same edges.
pub(super) fn layout(
    page: &Page,
    top: f32,
    gap: f32,
    rows: &[(f32, Vec<Option<Spec>>)],
) -> Result<Vec<Vec<Option<Panel>>>, PlotError> {
    let mut y = top;
    let mut panels = Vec::with_capacity(rows.len());
    for (index, (height, cells)) in rows.iter().enumerate() {
        let columns = cells.len();
        let lefts = left_rooms(rows, columns);
        let taken = lefts.iter().sum::<f32>() + gap * (columns - 1) as f32 + EDGE + OVERHANG;
        let width = ((page.width - taken) / columns as f32).max(10.0);
        let overhang = if columns == 1 { OVERHANG } else { (gap / 2.0 - 1.0).min(OVERHANG) };
        let upright = cells.iter().flatten().any(|spec| spec.crowded(width, overhang));
        let across: Vec<Option<Across>> = cells
            .iter()
            .map(|cell| cell.as_ref().map(|spec| spec.across(width, overhang, upright)))
            .collect();
        let depth = across.iter().flatten().map(|a| a.depth).fold(TICK_SIZE, f32::max);

        let mut x = EDGE;
        let mut row = Vec::with_capacity(columns);
        for ((spec, across), left) in cells.iter().zip(&across).zip(&lefts) {
            let panel = match (spec, across) {
                (Some(spec), Some(across)) => {
                    let panel = Panel::new(page, (x + left, y), (width, *height), &spec.x, &spec.y);
                    x_axis(page, &panel, spec, across, overhang, depth)?;
                    y_axis(page, &panel, spec, x)?;
                    Some(panel)
                }
                _ => None,
            };
            row.push(panel);
            x += left + width + gap;
        }
        panels.push(row);

        // Labels may hang into an empty cell below.
        let below = rows.get(index + 1).map(|(_, cells)| cells);
        let free = |column: usize| {
            below.is_some_and(|below| below.len() == columns && below[column].is_none())
        };
        let labelled = cells
            .iter()
            .enumerate()
            .any(|(column, cell)| !free(column) && cell.as_ref().is_some_and(|c| c.x_labels));
        y += height + TICK_LENGTH;
        if labelled {
            y += 3.5 + depth + 3.0 + TITLE_SIZE + 2.0;
        }
        y += if below.is_some() { gap.min(8.0) } else { EDGE - 2.0 };
    }
    page.cut(y);
    Ok(panels)
}

/// Room left of each panel of a row of so many. The left edge of the first is common to all rows.
fn left_rooms(rows: &[(f32, Vec<Option<Spec>>)], columns: usize) -> Vec<f32> {
    let mut lefts = vec![0.0_f32; columns];
    lefts[0] = OVERHANG;
    for (height, cells) in rows {
        let known = if cells.len() == columns { columns } else { 1 };
        for (left, spec) in lefts.iter_mut().zip(cells).take(known) {
            *left = left.max(spec.as_ref().map_or(0.0, |spec| spec.left_room(*height)));
        }
    }
    lefts
}

fn x_axis(
    page: &Page,
    panel: &Panel,
    spec: &Spec,
    across: &Across,
    overhang: f32,
    depth: f32,
) -> Result<(), PlotError> {
    let Panel { left, right, bottom, .. } = *panel;
    page.line((left, bottom), (right, bottom), &AXIS_PEN)?;
    for &c in &across.ticks.minor {
        let x = panel.along(c);
        page.line((x, bottom), (x, bottom + TICK_LENGTH * 0.6), &MINOR_PEN)?;
    }
    for (c, label) in &across.ticks.labelled {
        let x = panel.along(*c);
        page.line((x, bottom), (x, bottom + TICK_LENGTH), &AXIS_PEN)?;
        if !spec.x_labels {
            continue;
        }
        if across.upright {
            page.turned_text(label, TICK_SIZE, (x, bottom + TICK_LENGTH + 2.0), anchor::RIGHT)?;
        } else {
            page.text(label, TICK_SIZE, (x, bottom + TICK_LENGTH + 3.5), anchor::TOP)?;
        }
    }
    if spec.x_labels {
        let room = right - left + 2.0 * overhang.min(left - 2.0);
        let (title, size) = fitted(&across.ticks, room);
        let y = bottom + TICK_LENGTH + 3.5 + depth + 3.0;
        page.text(&title, size, ((left + right) / 2.0, y), anchor::TOP)?;
    }
    Ok(())
}

fn y_axis(page: &Page, panel: &Panel, spec: &Spec, title_left: f32) -> Result<(), PlotError> {
    if spec.bare {
        return Ok(());
    }
    let Panel { left, top, bottom, .. } = *panel;
    let ticks = spec.y.ticks(bottom - top, Direction::Up);
    page.line((left, top), (left, bottom), &AXIS_PEN)?;
    for &c in &ticks.minor {
        let y = panel.up(c);
        page.line((left - TICK_LENGTH * 0.6, y), (left, y), &MINOR_PEN)?;
    }
    for (c, label) in &ticks.labelled {
        let y = panel.up(*c);
        page.line((left - TICK_LENGTH, y), (left, y), &AXIS_PEN)?;
        if spec.y_labels {
            page.text(label, TICK_SIZE, (left - TICK_LENGTH - 2.0, y), anchor::RIGHT)?;
        }
    }
    if spec.y_labels {
        let (title, size) = fitted(&ticks, bottom - top + 4.0);
        page.turned_text(&title, size, (title_left, (top + bottom) / 2.0), anchor::TOP)?;
    }
    Ok(())
}

/// A title at the size at which it fits; at the smallest size the name is cut, never the unit.
fn fitted(ticks: &Ticks, room: f32) -> (String, f32) {
    let (name, unit) = (&ticks.name, &ticks.unit);
    let long = text::length(name, TITLE_SIZE) + text::length(unit, TITLE_SIZE);
    let size = (TITLE_SIZE * room / long.max(1.0)).clamp(LEAST_SIZE, TITLE_SIZE);
    let name = text::shortened(name, size, room - text::length(unit, size));
    (text::shortened(&format!("{name}{unit}"), size, room), size)
}
