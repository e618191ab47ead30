//! Several models over one series of measurements, with their residuals.
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Marker, Pen};
use super::panel::Panel;
use super::{Columns, PlotError, Role};

/// One model of a [`CompareFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCurve {
    /// Name in the legend.
    pub name: String,
    /// What decides its colour and dash: the same model gets the same role in every figure.
    pub role: Role,
    /// Model at the grid times (a/R).
    pub curve: Vec<f64>,
    /// Model at the times of the measurements (a/R), for the residuals.
    pub at_data: Vec<f64>,
}

/// MAP curves of several models over the data, and residuals below.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CompareFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the measurements (s).
    pub time_s: Vec<f64>,
    /// Measured contact ratios a/R, one per time.
    pub contact_ratio: Vec<f64>,
    /// Times of the curves (s), increasing.
    pub grid_s: Vec<f64>,
    /// The models, in the order of the legend.
    pub curves: Vec<NamedCurve>,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}

impl CompareFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("compare");
        columns.need("contact_ratio", &self.contact_ratio, self.time_s.len(), "time")?;
        for curve in &self.curves {
            columns.need(
                &format!("curve of {}", curve.name),
                &curve.curve,
                self.grid_s.len(),
                "grid time",
            )?;
            columns.need(
                &format!("at_data of {}", curve.name),
                &curve.at_data,
                self.time_s.len(),
                "time",
            )?;
        }
        let mut entries = vec![("measured".to_owned(), Swatch::measurement())];
        let few = !Panel::dense(&self.time_s);
        entries.extend(self.curves.iter().map(|c| {
            let swatch = if few {
                Swatch::LineAndPoint(c.role.pen(), c.role.marker())
            } else {
                Swatch::Line(c.role.pen())
            };
            (c.name.clone(), swatch)
        }));
        let top = header(page, &self.title, &entries)?;

        let scale = if self.log_time { Scale::Log } else { Scale::Linear };
        let x = Axis::holding(
            "time t",
            "s",
            scale,
            self.time_s.iter().chain(&self.grid_s).copied(),
            0.02,
        );
        let x = if self.log_time { x } else { x.starting_at(0.0) };
        let all = self
            .curves
            .iter()
            .flat_map(|c| &c.curve)
            .chain(&self.contact_ratio)
            .copied()
            .chain([0.0]);
        let y = Axis::holding("contact ratio a/R", "", Scale::Linear, all, 0.04).starting_at(0.0);
        let residuals: Vec<Vec<f64>> = self
            .curves
            .iter()
            .map(|c| {
                self.contact_ratio
                    .iter()
                    .zip(&c.at_data)
                    .map(|(measured, model)| measured - model)
                    .collect()
            })
            .collect();
        let left_over = Axis::holding(
            "residual of a/R",
            "",
            Scale::Linear,
            residuals.iter().flatten().copied().chain([0.0]),
            0.06,
        );
        let heights = page.of_width((125.0, 75.0), (200.0, 110.0));
        let rows = [
            (heights.0, vec![Some(Spec::new(x.clone(), y).x_labels(false))]),
            (heights.1, vec![Some(Spec::new(x, left_over))]),
        ];
        let panels: Vec<_> =
            layout(page, top, 10.0, &rows)?.into_iter().flatten().flatten().collect();
        let [curves, residual] = panels.as_slice() else { return Ok(()) };
        curves.data(&self.time_s, &self.contact_ratio)?;
        for curve in &self.curves {
            curves.line(&self.grid_s, &curve.curve, curve.role.pen())?;
        }
        residual.across(0.0, Pen::solid(GREY, 0.5))?;
        for (curve, values) in self.curves.iter().zip(&residuals) {
            let (ink, xs) = (curve.role.ink(), &self.time_s);
            if few {
                residual.line(xs, values, Pen { width: 0.6, ..curve.role.pen() })?;
                residual.markers(xs, values, Look::filled(curve.role.marker(), 1.3, ink))?;
            } else {
                residual.markers(xs, values, Look::filled(Marker::Dot, 0.5, ink.mix(0.5)))?;
            }
        }
        Ok(())
    }
}
