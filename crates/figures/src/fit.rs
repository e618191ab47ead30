//! The fit: measurements, posterior predictive bands, and the curves they are compared with.

use plotters::style::Color as _;

use crate::axes::Axes;
use crate::columns::{Band, Columns};
use crate::drawing::{Axis, BLACK, Look, Marker, Page, Panel, Pen, Role, Spec, Swatch, WHITE};
use crate::drawing::{header, one_panel};
use crate::error::{Drawn, PlotError};
use crate::figure::Figure;

/// Transition from zipping to stretching in neck growth: the contact ratio a_ve/R, with a central interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knee {
    /// Time at which it is reached \[s\].
    pub time_s: f64,
    /// Median, or any other point estimate.
    pub ratio: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

/// An observable over its control variable: data, posterior mean and bands, MAP curve, and curves to compare with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitFigure {
    /// Heading, for example the material; empty for none.
    pub title: String,
    /// Control values of the measurements, for example times.
    pub control: Vec<f64>,
    /// Measured values, one per control value.
    pub value: Vec<f64>,
    /// Control values at which the curves are given, increasing.
    pub grid: Vec<f64>,
    /// Posterior mean of the curve, one per grid point (empty: not drawn, as for every curve and band here).
    pub mean: Vec<f64>,
    /// Central 50 % of the curve under the posterior.
    pub band50: Band,
    /// Central 90 % of the curve under the posterior.
    pub band90: Band,
    /// Central 90 % of a new measurement: the curve with noise.
    pub predictive90: Band,
    /// Curve of the maximum a posteriori.
    pub map: Vec<f64>,
    /// Curve of the paper's parameters.
    pub paper: Vec<f64>,
    /// Best curve of Frenkel's model.
    pub frenkel: Vec<f64>,
    /// Knee of the posterior.
    pub knee: Option<Knee>,
    /// Knee of the paper's parameters, a_ve/R; drawn where the paper's curve reaches it.
    pub paper_knee: Option<f64>,
    /// Names and scales of the axes.
    pub axes: Axes,
}

impl Figure for FitFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        self.check()?;
        let top = header(page, &self.title, &self.entries())?;
        let x = self.axes.control_of(&self.control, &self.grid);
        let Some(panel) = one_panel(page, top, Spec::new(x, self.value_axis()))? else {
            return Ok(());
        };
        let dense = Panel::dense(&self.control);
        if dense {
            panel.data(&self.control, &self.value)?;
        }
        for (band, opacity, _) in self.bands() {
            panel.band(&self.grid, band, Role::Posterior.ink().mix(opacity))?;
        }
        for (values, pen, _) in self.curves() {
            panel.line(&self.grid, values, pen)?;
        }
        self.draw_knees(&panel)?;
        // Nothing covers a measurement.
        if !dense {
            panel.data(&self.control, &self.value)?;
        }
        Ok(())
    }
}

impl FitFigure {
    fn check(&self) -> Drawn {
        let columns = Columns("fit");
        columns.need("value", &self.value, (self.control.len(), "control value"))?;
        let points = (self.grid.len(), "grid point");
        columns.allow("mean", &self.mean, points)?;
        columns.allow("map", &self.map, points)?;
        columns.allow("paper", &self.paper, points)?;
        columns.allow("frenkel", &self.frenkel, points)?;
        columns.allow_band("band50", &self.band50, points)?;
        columns.allow_band("band90", &self.band90, points)?;
        columns.allow_band("predictive90", &self.predictive90, points)
    }

    /// The bands from the widest to the narrowest, with opacity and name.
    fn bands(&self) -> [(&Band, f64, &'static str); 3] {
        [
            (&self.predictive90, 0.13, "with noise"),
            (&self.band90, 0.25, "90 %"),
            (&self.band50, 0.35, "50 %"),
        ]
    }

    /// The curves in the order of drawing. Where they coincide, each is wider than those above it.
    fn curves(&self) -> [(&[f64], Pen, &'static str); 4] {
        let wide = |role: Role, width: f32| Pen { width, ..role.pen() };
        [
            (&self.mean, wide(Role::Posterior, 2.4), "mean"),
            (&self.frenkel, wide(Role::Frenkel, 1.8), "Frenkel"),
            (&self.paper, wide(Role::Paper, 1.2), "paper"),
            (&self.map, wide(Role::Map, 0.8), "MAP"),
        ]
    }

    fn entries(&self) -> Vec<(&'static str, Swatch)> {
        let mut entries = Vec::new();
        if !self.control.is_empty() {
            entries.push(("measured", Swatch::measurement()));
        }
        let curves = self.curves().into_iter().filter(|(values, ..)| !values.is_empty());
        entries.extend(curves.map(|(_, pen, name)| (name, Swatch::Line(pen))));
        for (_, opacity, name) in self.bands().into_iter().rev().filter(|(b, ..)| !b.is_empty()) {
            // Bands lie on top of each other: they look darker than one band alone.
            entries.push((name, Swatch::Band(Role::Posterior.ink().mix(opacity).mix(1.6))));
        }
        if self.knee.is_some() {
            entries.push(("knee", Swatch::Interval(KNEE)));
        }
        if self.paper_knee.is_some() {
            entries.push(("paper’s", Swatch::Point(paper_knee_look())));
        }
        entries
    }

    /// Data, mean, MAP and the band of the curve set the range; the other curves may leave it, as Frenkel's does.
    fn value_axis(&self) -> Axis {
        let own = || {
            let columns = [&self.value, &self.mean, &self.map].into_iter().flatten().copied();
            columns.chain(self.band90.bounds()).filter(|v| v.is_finite())
        };
        let reach = own().fold(0.0, f64::max) * 1.15;
        let all = !self.axes.from_zero || reach == 0.0;
        let others = self.paper.iter().chain(&self.frenkel).copied();
        let others = others.chain(self.predictive90.bounds());
        self.axes.value(own().chain(others.filter(|v| all || (0.0..=reach).contains(v))))
    }

    fn draw_knees(&self, panel: &Panel) -> Drawn {
        if let Some(ratio) = self.paper_knee {
            let at = crossing(&self.grid, &self.paper, ratio).unwrap_or(f64::NAN);
            panel.mark(at, ratio, paper_knee_look())?;
        }
        if let Some(Knee { time_s, ratio, lower, upper }) = self.knee {
            panel.interval(time_s, [lower, ratio, upper], KNEE)?;
        }
        Ok(())
    }
}

/// The interval of the knee: a bar with its ends and its middle, which leaves room for what lies under it.
const KNEE: Pen = Pen::solid(BLACK, 1.1);

/// Open, as the paper's knee is a point without an interval.
fn paper_knee_look() -> Look {
    Look::filled(Marker::Diamond, 2.3, WHITE.mix(0.0)).outlined(Pen::solid(Role::Paper.ink(), 1.0))
}

/// Where a curve first rises through a level, by linear interpolation.
fn crossing(xs: &[f64], ys: &[f64], level: f64) -> Option<f64> {
    let points = || xs.iter().copied().zip(ys.iter().copied());
    points().zip(points().skip(1)).find_map(|((x0, y0), (x1, y1))| {
        let crosses = y0 <= level && level <= y1 && y1 > y0;
        crosses.then(|| x0 + (x1 - x0) * (level - y0) / (y1 - y0))
    })
}
