//! Several models over one series of measurements, with their residuals.

use plotters::style::Color as _;

use crate::axes::Axes;
use crate::columns::Columns;
use crate::drawing::{Axis, GREY, Look, Marker, Page, Panel, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{header, layout, row};
use crate::error::PlotError;
use crate::figure::Figure;

/// One model of a [`CompareFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCurve {
    /// Name in the legend.
    pub name: String,
    /// Colour and dash: give the same model the same role in every figure.
    pub role: Role,
    /// Values of the model at the grid points.
    pub curve: Vec<f64>,
    /// Values of the model at the measurements, for the residuals.
    pub at_data: Vec<f64>,
}

/// MAP curves of several models over the data, and residuals below.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CompareFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Control values of the measurements, for example times.
    pub control: Vec<f64>,
    /// Measured values, one per control value.
    pub value: Vec<f64>,
    /// Control values of the curves, increasing.
    pub grid: Vec<f64>,
    /// The models, in the order of the legend.
    pub curves: Vec<NamedCurve>,
    /// Names and scales of the axes.
    pub axes: Axes,
}

impl Figure for CompareFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("compare");
        let data = (self.control.len(), "control value");
        columns.need("value", &self.value, data)?;
        for NamedCurve { name, curve, at_data, .. } in &self.curves {
            columns.need(&format!("curve of {name}"), curve, (self.grid.len(), "grid point"))?;
            columns.need(&format!("at_data of {name}"), at_data, data)?;
        }
        let few = !Panel::dense(&self.control);
        // Where curves coincide, each is wider than those above it.
        let last = self.curves.len().saturating_sub(1);
        let pens: Vec<Pen> = (self.curves.iter().enumerate())
            .map(|(place, c)| Pen { width: 0.8 + 0.35 * (last - place) as f32, ..c.role.pen() })
            .collect();
        let mut entries = vec![("measured", Swatch::measurement())];
        entries.extend(self.curves.iter().zip(&pens).map(|(c, pen)| {
            let (pen, marker) = (*pen, c.role.marker());
            let swatch = if few { Swatch::LineAndPoint(pen, marker) } else { Swatch::Line(pen) };
            (c.name.as_str(), swatch)
        }));
        let top = header(page, &self.title, &entries)?;

        let x = self.axes.control_of(&self.control, &self.grid);
        let values = self.curves.iter().flat_map(|c| &c.curve).chain(&self.value);
        let y = self.axes.value(values.copied());
        let residual =
            |at_data: &[f64]| self.value.iter().zip(at_data).map(|(a, b)| a - b).collect();
        let residuals: Vec<Vec<f64>> = self.curves.iter().map(|c| residual(&c.at_data)).collect();
        let left_over = residuals.iter().flatten().copied().chain([0.0]);
        let (name, unit) = (self.axes.residual_name(), &self.axes.value_unit);
        let left_over = Axis::holding(&name, unit, Scale::Linear, left_over, 0.06);
        let heights = page.of_width((125.0, 75.0), (200.0, 110.0));
        let rows = [
            row(heights.0, [Spec::new(x.clone(), y).x_labels(false)]),
            row(heights.1, [Spec::new(x, left_over)]),
        ];
        let panels = layout(page, top, 10.0, &rows)?;
        let [curves, residual] = panels.as_slice() else { return Ok(()) };
        if !few {
            curves.data(&self.control, &self.value)?;
        }
        for (curve, pen) in self.curves.iter().zip(&pens) {
            curves.line(&self.grid, &curve.curve, *pen)?;
        }
        if few {
            curves.data(&self.control, &self.value)?;
        }
        residual.across(0.0, Pen::solid(GREY, 0.5))?;
        for (place, (NamedCurve { role, .. }, values)) in
            self.curves.iter().zip(&residuals).enumerate()
        {
            if few {
                let under = (last - place) as f32;
                residual.line(&self.control, values, Pen { width: 0.6, ..role.pen() })?;
                let look = Look::filled(role.marker(), 1.2 + 0.3 * under, role.ink());
                residual.markers(&self.control, values, look)?;
            } else {
                let look = Look::filled(Marker::Dot, 0.5, role.ink().mix(0.5));
                residual.markers(&self.control, values, look)?;
            }
        }
        Ok(())
    }
}
