//! Work against precision, both logarithmic.

use plotters::style::Color as _;

use crate::columns::{Band, Columns};
use crate::drawing::{Axis, GREY, Look, Page, Panel, Pen, Role, Row, Scale, Spec, Swatch};
use crate::drawing::{header, layout, one_panel, row};
use crate::error::{Drawn, PlotError};
use crate::figure::Figure;

const GUIDE: Pen = Pen::solid(GREY, 0.7);

/// One method of a [`WorkPrecisionFigure`].
#[derive(Debug, Clone, PartialEq)]
pub struct WorkPrecisionSeries {
    /// Name in the legend.
    pub name: String,
    /// Colour, dash and marker.
    pub role: Role,
    /// Work, positive.
    pub cost: Vec<f64>,
    /// Error, positive, one per cost.
    pub error: Vec<f64>,
    /// Interval of the error at each cost; empty for none.
    pub band: Band,
}

impl WorkPrecisionSeries {
    /// Whether it is a line up the panel, which marks a cost.
    fn upright(&self) -> bool {
        self.cost.len() > 1 && self.cost.iter().all(|cost| *cost == self.cost[0])
    }

    /// The parts over which the cost does not fall: a line through all would fold back over itself.
    fn runs(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let falls = |k: &usize| self.cost[*k] < self.cost[*k - 1];
        let breaks: Vec<usize> = (1..self.cost.len()).filter(falls).collect();
        let starts: Vec<usize> = [0].into_iter().chain(breaks.iter().copied()).collect();
        let ends = breaks.into_iter().chain([self.cost.len()]);
        starts.into_iter().zip(ends).map(|(start, end)| start..end)
    }
}

/// Error against cost of several methods, with a guide line of a given slope.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorkPrecisionFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Name of the cost, for example `simulations`.
    pub cost_name: String,
    /// Unit of the cost; empty for a count.
    pub cost_unit: String,
    /// Name of the error.
    pub error_name: String,
    /// Unit of the error; empty for a pure number.
    pub error_unit: String,
    /// The methods, in the order of the legend.
    pub series: Vec<WorkPrecisionSeries>,
    /// Slope of a guide line in the log-log plane, for example -0.5.
    pub guide_slope: Option<f64>,
}

/// Several work-precision panels on one page, with one legend.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct WorkPrecisionGrid {
    /// Heading; empty for none.
    pub title: String,
    /// The panels, row by row. Their own titles are not drawn, and the legend has every name once.
    pub rows: Vec<Vec<WorkPrecisionFigure>>,
}

impl Figure for WorkPrecisionGrid {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let all = || self.rows.iter().flatten();
        all().try_for_each(WorkPrecisionFigure::check)?;
        let every: Vec<(String, Swatch)> = all().flat_map(WorkPrecisionFigure::entries).collect();
        let mut entries: Vec<(&str, Swatch)> = Vec::new();
        for (name, swatch) in &every {
            if entries.iter().all(|(known, _)| known != name) {
                entries.push((name, *swatch));
            }
        }
        let top = header(page, &self.title, &entries)?;
        let height = page.of_width(80.0, 110.0);
        let rows = self.rows.iter().map(|figures| row(height, figures.iter().map(|f| f.spec())));
        let panels = layout(page, top, 8.0, &rows.collect::<Vec<Row>>())?;
        panels.iter().zip(all()).try_for_each(|(panel, figure)| figure.fill(panel))
    }
}

impl Figure for WorkPrecisionFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        self.check()?;
        let entries = self.entries();
        let entries: Vec<_> = entries.iter().map(|(name, swatch)| (&name[..], *swatch)).collect();
        let top = header(page, &self.title, &entries)?;
        one_panel(page, top, self.spec())?.map_or(Ok(()), |panel| self.fill(&panel))
    }
}

impl WorkPrecisionFigure {
    fn check(&self) -> Drawn {
        let columns = Columns("work precision");
        for s in &self.series {
            let each = (s.cost.len(), "cost");
            columns.need(&format!("error of {}", s.name), &s.error, each)?;
            columns.allow_band(&format!("band of {}", s.name), &s.band, each)?;
        }
        Ok(())
    }

    /// Slope of the guide line, if there is one.
    fn guide(&self) -> Option<f64> {
        self.guide_slope.filter(|slope| slope.is_finite())
    }

    fn entries(&self) -> Vec<(String, Swatch)> {
        let series = self.series.iter();
        let mut entries: Vec<_> = series
            .map(|s| {
                let (pen, marker) = (s.role.pen(), s.role.marker());
                let points = Swatch::LineAndPoint(pen, marker);
                (s.name.clone(), if s.upright() { Swatch::Line(pen) } else { points })
            })
            .collect();
        if let Some(slope) = self.guide() {
            let slope = slope.to_string().replace('-', "−");
            entries.push((format!("slope {slope}"), Swatch::Line(GUIDE)));
        }
        entries
    }

    fn spec(&self) -> Spec {
        let costs = self.series.iter().flat_map(|s| &s.cost).copied();
        let errors =
            self.series.iter().flat_map(|s| s.error.iter().copied().chain(s.band.bounds()));
        // Between few whole numbers there is nothing.
        let (least, most) =
            costs.clone().fold((f64::MAX, 0.0_f64), |(l, m), c| (l.min(c), m.max(c)));
        let counts = self.cost_unit.is_empty() && costs.clone().all(|cost| cost.fract() == 0.0);
        let scale = if counts && most < 10.0 * least { Scale::Count } else { Scale::Log };
        Spec::new(
            Axis::holding(&self.cost_name, &self.cost_unit, scale, costs, 0.05),
            Axis::holding(&self.error_name, &self.error_unit, Scale::Log, errors, 0.06),
        )
    }

    fn fill(&self, panel: &Panel) -> Drawn {
        if let Some(slope) = self.guide().filter(|_| panel.x.scale == Scale::Log) {
            // Through the middle of the panel; in coordinates, then back to values.
            let (x0, y0) = ((panel.x.low + panel.x.high) / 2.0, (panel.y.low + panel.y.high) / 2.0);
            let half = (panel.x.high - panel.x.low) / 2.0;
            let xs = [-half, half].map(|dx| 10_f64.powf(x0 + dx));
            let ys = [-half, half].map(|dx| 10_f64.powf(y0 + slope * dx));
            panel.line(&xs, &ys, GUIDE)?;
        }
        for (s, run) in self.series.iter().flat_map(|s| s.runs().map(move |run| (s, run))) {
            let bound = |of: &[f64]| of.get(run.clone()).unwrap_or_default().to_vec();
            let band = Band { lower: bound(&s.band.lower), upper: bound(&s.band.upper) };
            panel.band(&s.cost[run.clone()], &band, s.role.ink().mix(0.15))?;
        }
        for s in &self.series {
            for run in s.runs() {
                panel.line(&s.cost[run.clone()], &s.error[run], s.role.pen())?;
            }
            if s.upright() {
                continue;
            }
            let radius = if Panel::dense(&s.cost) { 0.7 } else { 1.8 };
            let look = Look::filled(s.role.marker(), radius, s.role.ink());
            panel.markers(&s.cost, &s.error, look)?;
        }
        Ok(())
    }
}
