//! Work against precision, both logarithmic.
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Pen};
use super::panel::Panel;
use super::{Band, Columns, PlotError, Role};

const GUIDE: Pen = Pen::solid(GREY, 0.7);

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

/// Several work-precision panels on one page, with one legend: rows of equally many.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorkPrecisionGrid {
    /// Heading; empty for none.
    pub title: String,
    /// The panels, row by row; their own titles are not drawn. The legend has every name once.
    pub rows: Vec<Vec<WorkPrecisionFigure>>,
}

impl WorkPrecisionGrid {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let all = || self.rows.iter().flatten();
        all().try_for_each(WorkPrecisionFigure::check)?;
        let mut entries: Vec<(String, Swatch)> = Vec::new();
        for entry in all().flat_map(WorkPrecisionFigure::entries) {
            if entries.iter().all(|(name, _)| *name != entry.0) {
                entries.push(entry);
            }
        }
        let top = header(page, &self.title, &entries)?;
        let height = page.of_width(80.0, 110.0);
        let specs: Vec<(f32, Vec<Option<Spec>>)> = self
            .rows
            .iter()
            .map(|row| (height, row.iter().map(|figure| Some(figure.spec())).collect()))
            .collect();
        let panels = layout(page, top, 8.0, &specs)?;
        for (panel, figure) in panels.into_iter().flatten().zip(all()) {
            panel.map_or(Ok(()), |panel| figure.fill(&panel))?;
        }
        Ok(())
    }
}

impl WorkPrecisionFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        self.check()?;
        let top = header(page, &self.title, &self.entries())?;
        let height = page.of_width(140.0, 230.0);
        let panels = layout(page, top, 8.0, &[(height, vec![Some(self.spec())])])?;
        panels.into_iter().flatten().flatten().try_for_each(|panel| self.fill(&panel))
    }

    fn check(&self) -> Result<(), PlotError> {
        let columns = Columns("work precision");
        for s in &self.series {
            columns.need(&format!("error of {}", s.name), &s.error, s.cost.len(), "cost")?;
            columns.allow_band(&format!("band of {}", s.name), &s.band, s.cost.len(), "cost")?;
        }
        Ok(())
    }

    /// The slope of the guide line, if there is one.
    fn guide(&self) -> Option<f64> {
        self.guide_slope.filter(|slope| slope.is_finite())
    }

    fn entries(&self) -> Vec<(String, Swatch)> {
        let series = self.series.iter();
        let mut entries: Vec<_> = series
            .map(|s| (s.name.clone(), Swatch::LineAndPoint(s.role.pen(), s.role.marker())))
            .collect();
        if let Some(slope) = self.guide() {
            let slope = slope.to_string().replace('-', "−");
            entries.push((format!("slope {slope}"), Swatch::Line(GUIDE)));
        }
        entries
    }

    fn spec(&self) -> Spec {
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
        Spec::new(x, y)
    }

    fn fill(&self, panel: &Panel) -> Result<(), PlotError> {
        if let Some(slope) = self.guide() {
            // Through the middle of the panel, as far as it goes; in coordinates, then back to values.
            let (x0, y0) = ((panel.x.low + panel.x.high) / 2.0, (panel.y.low + panel.y.high) / 2.0);
            let half = (panel.x.high - panel.x.low) / 2.0;
            let (xs, ys): (Vec<f64>, Vec<f64>) = [-half, half]
                .iter()
                .map(|dx| (10_f64.powf(x0 + dx), 10_f64.powf(y0 + slope * dx)))
                .unzip();
            panel.line(&xs, &ys, GUIDE)?;
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
