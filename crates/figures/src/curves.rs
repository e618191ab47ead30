//! Curves by name over one axis, each with a mark where something happens on it.

use crate::columns::Columns;
use crate::drawing::{Axis, Look, Page, Pen, Role, Scale, Spec, Swatch, WHITE, header, one_panel};
use crate::error::PlotError;
use crate::figure::Figure;

/// A curve of a [`CurvesFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct MarkedCurve {
    /// Name in the legend.
    pub name: String,
    /// Colour and dash.
    pub role: Role,
    /// Horizontal values, increasing.
    pub x: Vec<f64>,
    /// Vertical values, one for each.
    pub y: Vec<f64>,
    /// A point to mark.
    pub mark: Option<(f64, f64)>,
}

/// Curves over a pure number, linear on both axes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CurvesFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the horizontal axis.
    pub x_name: String,
    /// Name of the vertical axis.
    pub y_name: String,
    /// The curves, in the order of the legend.
    pub curves: Vec<MarkedCurve>,
    /// What the marks are, in the legend.
    pub mark_name: String,
}

impl Figure for CurvesFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("curves");
        for MarkedCurve { name, x, y, .. } in &self.curves {
            columns.need(&format!("y of {name}"), y, (x.len(), "x"))?;
        }
        let look = |role: Role| {
            Look::filled(role.marker(), 2.4, role.ink()).outlined(Pen::solid(WHITE, 0.5))
        };
        let mut entries: Vec<_> =
            self.curves.iter().map(|c| (c.name.as_str(), Swatch::Line(c.role.pen()))).collect();
        if let Some(marked) = self.curves.iter().find(|curve| curve.mark.is_some()) {
            entries.push((self.mark_name.as_str(), Swatch::Point(look(marked.role))));
        }
        let top = header(page, &self.title, &entries)?;
        let marks = || self.curves.iter().filter_map(|curve| curve.mark);
        let across = self.curves.iter().flat_map(|c| &c.x).copied().chain(marks().map(|m| m.0));
        let up = self.curves.iter().flat_map(|c| &c.y).copied().chain(marks().map(|m| m.1));
        let x = Axis::holding(&self.x_name, "", Scale::Linear, across, 0.02).starting_at(0.0);
        let y = Axis::holding(&self.y_name, "", Scale::Linear, up, 0.04);
        let Some(panel) = one_panel(page, top, Spec::new(x, y))? else { return Ok(()) };
        for curve in &self.curves {
            panel.line(&curve.x, &curve.y, curve.role.pen())?;
        }
        for curve in &self.curves {
            if let Some((x, y)) = curve.mark {
                panel.mark(x, y, look(curve.role))?;
            }
        }
        Ok(())
    }
}
