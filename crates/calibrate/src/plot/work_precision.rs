//! Work against precision, both logarithmic.
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Pen};
use super::{Band, Columns, PlotError, Role};

/// One method of a [`WorkPrecisionFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct WorkPrecisionSeries {
    /// Name in the legend.
    pub name: String,
    /// What decides its colour, dash and marker.
    pub role: Role,
    /// Work, positive.
    pub cost: Vec<f64>,
    /// Error, positive, one per cost.
    pub error: Vec<f64>,
    /// Interval of the error at each cost; empty for none.
    pub band: Band,
}

/// Error against cost of several methods, with a guide line of a given slope.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorkPrecisionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// What the cost is, for example `simulations`.
    pub cost_name: String,
    /// Unit of the cost; empty for a count.
    pub cost_unit: String,
    /// What the error is.
    pub error_name: String,
    /// Unit of the error; empty for a pure number.
    pub error_unit: String,
    /// The methods, in the order of the legend.
    pub series: Vec<WorkPrecisionSeries>,
    /// Slope of a guide line in the log-log plane, for example -0.5.
    pub guide_slope: Option<f64>,
}

impl WorkPrecisionFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("work precision");
        for s in &self.series {
            columns.need(&format!("error of {}", s.name), &s.error, s.cost.len(), "cost")?;
            columns.allow_band(&format!("band of {}", s.name), &s.band, s.cost.len(), "cost")?;
        }
        let guide_pen = Pen::solid(GREY, 0.7);
        let mut entries: Vec<_> = self
            .series
            .iter()
            .map(|s| (s.name.clone(), Swatch::LineAndPoint(s.role.pen(), s.role.marker())))
            .collect();
        if let Some(slope) = self.guide_slope.filter(|s| s.is_finite()) {
            let slope = slope.to_string().replace('-', "−");
            entries.push((format!("slope {slope}"), Swatch::Line(guide_pen)));
        }
        let top = header(page, &self.title, &entries)?;
        let x = Axis::holding(
            &self.cost_name,
            &self.cost_unit,
            Scale::Log,
            self.series.iter().flat_map(|s| &s.cost).copied(),
            0.05,
        );
        let values = self
            .series
            .iter()
            .flat_map(|s| s.error.iter().chain(&s.band.upper).chain(&s.band.lower));
        let y =
            Axis::holding(&self.error_name, &self.error_unit, Scale::Log, values.copied(), 0.06);
        let height = page.of_width(140.0, 230.0);
        let panels = layout(page, top, 8.0, &[(height, vec![Some(Spec::new(x, y))])])?;
        let Some(panel) = panels.into_iter().flatten().flatten().next() else { return Ok(()) };
        if let Some(slope) = self.guide_slope.filter(|s| s.is_finite()) {
            // Through the middle of the panel, as far as it goes; in coordinates, then back to values.
            let (x0, y0) = ((panel.x.low + panel.x.high) / 2.0, (panel.y.low + panel.y.high) / 2.0);
            let half = (panel.x.high - panel.x.low) / 2.0;
            let (xs, ys): (Vec<f64>, Vec<f64>) = [-half, half]
                .iter()
                .map(|dx| (10_f64.powf(x0 + dx), 10_f64.powf(y0 + slope * dx)))
                .unzip();
            panel.line(&xs, &ys, guide_pen)?;
        }
        for s in &self.series {
            panel.band(&s.cost, &s.band.lower, &s.band.upper, s.role.ink().mix(0.15))?;
        }
        for s in &self.series {
            panel.line(&s.cost, &s.error, s.role.pen())?;
            let radius = if s.cost.len() <= 120 { 1.8 } else { 0.7 };
            panel.markers(
                &s.cost,
                &s.error,
                Look::filled(s.role.marker(), radius, s.role.ink()),
            )?;
        }
        Ok(())
    }
}
