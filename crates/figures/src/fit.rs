//! The fit: measurements, what the posterior predicts, and the curves it is compared with.
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{Marker, Pen, WHITE};
use super::panel::Panel;
use super::{Axes, Band, Columns, PlotError, Role};

/// Where zipping hands over to stretching: the contact ratio a_ve/R, with a central interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knee {
    /// When it is reached \[s\].
    pub time_s: f64,
    /// Median, or any other point estimate.
    pub ratio: f64,
    /// Lower end of the interval.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

/// Neck growth: data, posterior predictive mean and bands, MAP curve, the paper's curve and the best Frenkel curve.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FitFigure {
    /// Heading, for example the material; empty for none.
    pub title: String,
    /// Times of the measurements (s).
    pub time_s: Vec<f64>,
    /// Measured contact ratios a/R, one per time.
    pub contact_ratio: Vec<f64>,
    /// Times at which the curves are given (s), increasing.
    pub grid_s: Vec<f64>,
    /// Posterior mean of the curve, one per grid time (empty: not drawn, as for every curve and band here).
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
    /// Best Frenkel curve.
    pub frenkel: Vec<f64>,
    /// Knee of our posterior.
    pub knee: Option<Knee>,
    /// Knee of the paper's parameters, a_ve/R.
    pub paper_knee: Option<f64>,
    /// What the axes are called.
    pub axes: Axes,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}

impl FitFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("fit");
        columns.need("contact_ratio", &self.contact_ratio, self.time_s.len(), "time")?;
        for (field, values) in [
            ("mean", &self.mean),
            ("map", &self.map),
            ("paper", &self.paper),
            ("frenkel", &self.frenkel),
        ] {
            columns.allow(field, values, self.grid_s.len(), "grid time")?;
        }
        for (field, band) in [
            ("band50", &self.band50),
            ("band90", &self.band90),
            ("predictive90", &self.predictive90),
        ] {
            columns.allow_band(field, band, self.grid_s.len(), "grid time")?;
        }

        let posterior = Role::Posterior.ink();
        let bands = [
            (&self.predictive90, posterior.mix(0.13), "90 % with noise"),
            (&self.band90, posterior.mix(0.25), "90 %"),
            (&self.band50, posterior.mix(0.35), "50 %"),
        ];
        let curves = [
            (&self.mean, Role::Posterior, "posterior mean"),
            (&self.frenkel, Role::Frenkel, "Frenkel"),
            (&self.paper, Role::Paper, "paper"),
            (&self.map, Role::Map, "MAP"),
        ];

        let mut entries = Vec::new();
        if !self.time_s.is_empty() {
            entries.push(("measured".to_owned(), Swatch::measurement()));
        }
        for (values, role, name) in &curves {
            if !values.is_empty() {
                entries.push(((*name).to_owned(), Swatch::Line(role.pen())));
            }
        }
        for (band, ink, name) in bands.iter().rev() {
            if !band.lower.is_empty() {
                entries.push(((*name).to_owned(), Swatch::Band(ink.mix(1.6))));
            }
        }
        if self.knee.is_some() {
            entries.push(("knee a_{ve}/R".to_owned(), knee_swatch(Role::Posterior)));
        }
        if self.paper_knee.is_some() {
            entries.push(("knee, paper".to_owned(), knee_swatch(Role::Paper)));
        }
        let top = header(page, &self.title, &entries)?;

        let scale = if self.log_time { Scale::Log } else { Scale::Linear };
        let times = self.time_s.iter().chain(&self.grid_s).copied();
        let axes = &self.axes;
        let x = Axis::holding(&axes.control_name, &axes.control_unit, scale, times, 0.02);
        let x = if self.log_time || !axes.from_zero { x } else { x.starting_at(0.0) };
        // Data, mean and bands set the range; a comparison curve may leave it, as Frenkel's does.
        let own =
            [&self.contact_ratio, &self.mean, &self.map, &self.band90.lower, &self.band90.upper];
        let mut heights: Vec<f64> =
            own.into_iter().flatten().copied().filter(|v| v.is_finite()).collect();
        let reach = if axes.from_zero {
            heights.iter().copied().fold(0.0, f64::max) * 1.15
        } else {
            f64::INFINITY
        };
        let lower = if axes.from_zero { &[][..] } else { &self.predictive90.lower };
        heights.extend(lower.iter().copied().filter(|v| v.is_finite()));
        let others = [&self.predictive90.upper, &self.paper, &self.frenkel];
        heights.extend(
            others
                .into_iter()
                .flatten()
                .copied()
                .filter(|v| reach == 0.0 || !axes.from_zero || (0.0..=reach).contains(v)),
        );
        if axes.from_zero {
            heights.push(0.0);
        }
        let y = Axis::holding(&axes.value_name, &axes.value_unit, Scale::Linear, heights, 0.04);
        let y = if axes.from_zero { y.starting_at(0.0) } else { y };
        let height = page.of_width(140.0, 230.0);
        let panels = layout(page, top, 8.0, &[(height, vec![Some(Spec::new(x, y))])])?;
        let Some(panel) = panels.into_iter().flatten().flatten().next() else { return Ok(()) };

        if Panel::dense(&self.time_s) {
            panel.data(&self.time_s, &self.contact_ratio)?;
        }
        for (band, ink, _) in &bands {
            panel.band(&self.grid_s, &band.lower, &band.upper, *ink)?;
        }
        for (values, role, _) in &curves {
            panel.line(&self.grid_s, values, role.pen())?;
        }
        if !Panel::dense(&self.time_s) {
            panel.data(&self.time_s, &self.contact_ratio)?;
        }
        if let Some(knee) = self.paper_knee {
            let at = crossing(&self.grid_s, &self.paper, knee).unwrap_or(f64::NAN);
            let ink = Role::Paper.ink();
            panel.markers(
                &[at],
                &[knee],
                Look::filled(Marker::Diamond, 2.3, ink).outlined(Pen::solid(WHITE, 0.5)),
            )?;
        }
        if let Some(knee) = self.knee {
            let at = knee.time_s;
            panel.bars(&[at], &[knee.lower], &[knee.upper], Pen::solid(posterior, 1.6))?;
            panel.markers(
                &[at],
                &[knee.ratio],
                Look::filled(Marker::Diamond, 2.3, posterior).outlined(Pen::solid(WHITE, 0.5)),
            )?;
        }
        Ok(())
    }
}

fn knee_look(role: Role) -> Look {
    Look::filled(Marker::Diamond, 2.3, role.ink()).outlined(Pen::solid(WHITE, 0.5))
}

fn knee_swatch(role: Role) -> Swatch {
    Swatch::Point(knee_look(role))
}

/// Where a curve first rises through a level, by linear interpolation.
fn crossing(xs: &[f64], ys: &[f64], level: f64) -> Option<f64> {
    let points = || xs.iter().copied().zip(ys.iter().copied());
    points().zip(points().skip(1)).find_map(|((x0, y0), (x1, y1))| {
        let crosses = y0 <= level && level <= y1 && y1 > y0;
        crosses.then(|| x0 + (x1 - x0) * (level - y0) / (y1 - y0))
    })
}
