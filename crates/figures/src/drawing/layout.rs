//! Rows of panels on a page, and their axes.

use super::axis::Axis;
use super::page::Page;
use super::palette::{BLACK, Pen};
use super::panel::Panel;
use super::text::{self, anchor};
use super::ticks::{Direction, TICK_SIZE, Ticks};
use crate::error::{Drawn, PlotError};

/// Size of axis titles in points.
pub(crate) const TITLE_SIZE: f32 = 7.5;
/// Smallest size a title is shrunk to before it is cut.
const LEAST_SIZE: f32 = 5.5;
const TICK_LENGTH: f32 = 2.5;
const EDGE: f32 = 4.0;
/// How far a tick label may stand out beyond its panel.
pub(crate) const OVERHANG: f32 = 10.0;
/// Height of the line that names a panel.
const NAME_LINE: f32 = 10.0;
const AXIS_PEN: Pen = Pen::solid(BLACK, 0.6);
const MINOR_PEN: Pen = Pen::solid(BLACK, 0.4);

/// A panel before it has its place: the axes, and what is written beside them.
#[derive(Debug, Clone)]
pub(crate) struct Spec {
    x: Axis,
    y: Axis,
    /// A line above the panel in two parts; the first is cut if it is too long. Empty for none.
    name: (String, String),
    /// Labels and title of the horizontal axis (false where the panel below carries them).
    x_labels: bool,
    /// Labels and title of the vertical axis (false where the panel to the left carries them).
    y_labels: bool,
    /// No vertical axis at all: densities, whose height says nothing.
    bare: bool,
}

/// Height of a row of panels in points, and its cells, some of them empty.
pub(crate) type Row = (f32, Vec<Option<Spec>>);

impl Spec {
    pub(crate) fn new(x: Axis, y: Axis) -> Spec {
        Spec { x, y, name: Default::default(), x_labels: true, y_labels: true, bare: false }
    }

    /// Adds a line above the panel; its second part is never cut.
    pub(crate) fn named(self, name: String, note: String) -> Spec {
        Spec { name: (name, note), ..self }
    }

    pub(crate) fn x_labels(self, x_labels: bool) -> Spec {
        Spec { x_labels, ..self }
    }

    pub(crate) fn y_labels(self, y_labels: bool) -> Spec {
        Spec { y_labels, ..self }
    }

    pub(crate) fn bare(self) -> Spec {
        Spec { bare: true, y_labels: false, ..self }
    }

    /// Room for tick labels and title left of a panel of a height.
    fn left_room(&self, height: f32) -> f32 {
        if !self.y_labels {
            return 0.0;
        }
        TICK_LENGTH + 2.0 + widest(&self.y.ticks(height, Direction::Up)) + 4.0 + TITLE_SIZE
    }

    /// Whether fewer than two labels of the horizontal axis have room unless they stand upright.
    fn crowded(&self, width: f32, overhang: f32) -> bool {
        let labels = |direction| self.x.ticks(width, direction).labelled.len();
        let flat = labels(Direction::Across { overhang });
        flat < 2 && flat < labels(Direction::Up)
    }

    /// Ticks of the horizontal axis, and how deep their labels reach.
    fn across(&self, width: f32, overhang: f32, upright: bool) -> Across {
        let direction = if upright { Direction::Up } else { Direction::Across { overhang } };
        let ticks = self.x.ticks(width, direction);
        let depth = if upright { widest(&ticks) } else { TICK_SIZE };
        Across { ticks, upright, depth }
    }
}

/// Labels of a horizontal axis.
struct Across {
    ticks: Ticks,
    upright: bool,
    depth: f32,
}

fn widest(ticks: &Ticks) -> f32 {
    ticks.labelled.iter().map(|(_, label)| text::length(label, TICK_SIZE)).fold(0.0, f32::max)
}

/// A row without empty cells.
pub(crate) fn row(height: f32, specs: impl IntoIterator<Item = Spec>) -> Row {
    (height, specs.into_iter().map(Some).collect())
}

/// Rows of so many columns over one horizontal axis, which only the lowest panel of each column labels.
pub(crate) fn grid_of(columns: usize, height: f32, specs: Vec<Spec>) -> Vec<Row> {
    let columns = columns.min(specs.len()).max(1);
    let lowest = specs.len().saturating_sub(columns);
    let specs: Vec<Spec> =
        specs.into_iter().enumerate().map(|(i, spec)| spec.x_labels(i >= lowest)).collect();
    specs
        .chunks(columns)
        .map(|specs| {
            let (height, mut cells) = row(height, specs.to_vec());
            cells.resize(columns, None);
            (height, cells)
        })
        .collect()
}

/// A page with a single panel; always there.
pub(crate) fn one_panel(page: &Page, top: f32, spec: Spec) -> Result<Option<Panel>, PlotError> {
    let height = page.of_width(140.0, 230.0);
    Ok(layout(page, top, 8.0, &[row(height, [spec])])?.pop())
}

/// Lays rows of panels out below `top`, draws their axes and cuts the page below them. Panels of one column of rows with
/// equally many cells have the same edges. Returns the panels row by row.
pub(crate) fn layout(
    page: &Page,
    top: f32,
    gap: f32,
    rows: &[Row],
) -> Result<Vec<Panel>, PlotError> {
    let rows: Vec<&Row> = rows.iter().filter(|(_, cells)| !cells.is_empty()).collect();
    let mut y = top;
    let mut panels = Vec::new();
    for (index, (height, cells)) in rows.iter().enumerate() {
        let columns = cells.len();
        let lefts = left_rooms(&rows, columns);
        let taken = lefts.iter().sum::<f32>() + gap * (columns - 1) as f32 + EDGE + OVERHANG;
        let width = ((page.width - taken) / columns as f32).max(10.0);
        let overhang = if columns == 1 { OVERHANG } else { (gap / 2.0 - 1.0).min(OVERHANG) };
        let specs = || cells.iter().flatten();
        let upright = specs().any(|spec| spec.crowded(width, overhang));
        let depth = specs().map(|spec| spec.across(width, overhang, upright).depth);
        let depth = depth.fold(TICK_SIZE, f32::max);
        if specs().any(|spec| !spec.name.0.is_empty()) {
            y += NAME_LINE;
        }
        let mut x = EDGE;
        for (spec, left) in cells.iter().zip(&lefts) {
            if let Some(spec) = spec {
                let panel = Panel::new(page, (x + left, y), (width, *height), &spec.x, &spec.y);
                let across = Across { depth, ..spec.across(width, overhang, upright) };
                x_axis(page, &panel, spec, &across, overhang)?;
                y_axis(page, &panel, spec, x)?;
                name(page, &panel, spec, gap)?;
                panels.push(panel);
            }
            x += left + width + gap;
        }

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
fn left_rooms(rows: &[&Row], columns: usize) -> Vec<f32> {
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

fn name(page: &Page, panel: &Panel, spec: &Spec, gap: f32) -> Drawn {
    let (name, note) = &spec.name;
    let room = panel.right - panel.left + gap / 2.0 - text::length(note, TICK_SIZE);
    let line = format!("{}{note}", text::shortened(name, TICK_SIZE, room));
    page.text(&line, TICK_SIZE, (panel.left, panel.top - 4.0), anchor::BOTTOM_LEFT)
}

fn x_axis(page: &Page, panel: &Panel, spec: &Spec, across: &Across, overhang: f32) -> Drawn {
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
        let y = bottom + TICK_LENGTH + 3.5 + across.depth + 3.0;
        page.text(&title, size, ((left + right) / 2.0, y), anchor::TOP)?;
    }
    Ok(())
}

fn y_axis(page: &Page, panel: &Panel, spec: &Spec, title_left: f32) -> Drawn {
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

/// A title and the size at which it fits; at the smallest size the name is cut, never the unit.
fn fitted(ticks: &Ticks, room: f32) -> (String, f32) {
    let (name, unit) = (&ticks.name, &ticks.unit);
    let long = text::length(name, TITLE_SIZE) + text::length(unit, TITLE_SIZE);
    let size = (TITLE_SIZE * room / long.max(1.0)).clamp(LEAST_SIZE, TITLE_SIZE);
    let name = text::shortened(name, size, room - text::length(unit, size));
    (text::shortened(&format!("{name}{unit}"), size, room), size)
}
