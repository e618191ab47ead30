//! Residuals: is what the model leaves over noise?
use plotters::style::Color as _;

use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, layout};
use super::page::Page;
use super::palette::{GREY, Marker, Pen};
use super::{Axes, Columns, PlotError, Role};

/// Residuals against time, their autocorrelation, and their normal quantiles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidualsFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the measurements (s), increasing.
    pub time_s: Vec<f64>,
    /// Measurement minus model (a/R), one per time.
    pub residual: Vec<f64>,
    /// Standard deviation of the noise (a/R): the band is twice that to both sides.
    pub sigma: f64,
    /// What the axes of the measured curve are called.
    pub axes: Axes,
    /// Logarithmic time axis (times <= 0 are left out).
    pub log_time: bool,
}

impl ResidualsFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        Columns("residuals").need("residual", &self.residual, self.time_s.len(), "time")?;
        let sigma = if self.sigma.is_finite() { self.sigma.abs() } else { f64::NAN };
        let ink = Role::Posterior.ink();
        let entries = [
            ("measured − model".to_owned(), Swatch::measurement()),
            ("±2σ of the noise".to_owned(), Swatch::Band(ink.mix(0.25))),
            ("95 % if uncorrelated".to_owned(), Swatch::Line(Pen::dashed(GREY, 0.8, &[1.2, 1.4]))),
        ];
        let top = header(page, &self.title, &entries)?;

        let scale = if self.log_time { Scale::Log } else { Scale::Linear };
        let axes = &self.axes;
        let times = self.time_s.iter().copied();
        let x = Axis::holding(&axes.control_name, &axes.control_unit, scale, times, 0.02);
        let x = if self.log_time || !axes.from_zero { x } else { x.starting_at(0.0) };
        let residuals = self.residual.iter().copied().chain([2.2 * sigma, -2.2 * sigma]);
        let name = match axes.value_name.strip_prefix("contact ratio ") {
            Some(symbol) => format!("residual of {symbol}"),
            None => format!("residual of {}", axes.value_name),
        };
        let y = Axis::holding(&name, &axes.value_unit, Scale::Linear, residuals, 0.05);

        let correlation = autocorrelation(&self.residual);
        let lags: Vec<f64> = (0..correlation.len()).map(|lag| lag as f64).collect();
        let white = 1.96 / (self.residual.len().max(1) as f64).sqrt();
        let lag_axis =
            Axis::holding("lag", "observations", Scale::Count, lags.iter().copied(), 0.03);
        let correlation_axis = Axis::holding(
            "autocorrelation",
            "",
            Scale::Linear,
            correlation.iter().copied().chain([0.0, 1.0, -white]),
            0.03,
        );

        let (normal, sorted) = normal_quantiles(&self.residual, sigma);
        let normal_axis =
            Axis::holding("normal quantile", "σ", Scale::Linear, normal.iter().copied(), 0.05);
        let sorted_axis =
            Axis::holding("residual", "σ", Scale::Linear, sorted.iter().copied(), 0.05);

        let heights = page.of_width((95.0, 80.0), (140.0, 130.0));
        let rows = [
            (heights.0, vec![Some(Spec::new(x, y))]),
            (
                heights.1,
                vec![
                    Some(Spec::new(lag_axis, correlation_axis)),
                    Some(Spec::new(normal_axis, sorted_axis)),
                ],
            ),
        ];
        let panels: Vec<_> =
            layout(page, top, 10.0, &rows)?.into_iter().flatten().flatten().collect();
        let [time, lag, quantile] = panels.as_slice() else { return Ok(()) };

        let ends = if self.log_time {
            [10_f64.powf(time.x.low), 10_f64.powf(time.x.high)]
        } else {
            [time.x.low, time.x.high]
        };
        time.band(&ends, &[-2.0 * sigma; 2], &[2.0 * sigma; 2], ink.mix(0.15))?;
        time.across(0.0, Pen::solid(ink, 0.8))?;
        time.data(&self.time_s, &self.residual)?;

        for level in [white, -white] {
            lag.across(level, Pen::dashed(GREY, 0.8, &[1.2, 1.4]))?;
        }
        lag.across(0.0, Pen::solid(GREY, 0.5))?;
        lag.bars(&lags, &vec![0.0; lags.len()], &correlation, Pen::solid(Role::Data.ink(), 0.9))?;
        lag.markers(&lags, &correlation, Look::filled(Marker::Circle, 1.4, Role::Data.ink()))?;

        quantile.line(&[-10.0, 10.0], &[-10.0, 10.0], Pen::solid(ink, 0.8))?;
        quantile.data(&normal, &sorted)?;
        Ok(())
    }
}

/// Sample autocorrelation up to a quarter of the series, at most 40 lags; about the mean zero that a model which fits has.
fn autocorrelation(residual: &[f64]) -> Vec<f64> {
    let r: Vec<f64> = residual.iter().copied().filter(|r| r.is_finite()).collect();
    let largest = r.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest == 0.0 {
        return Vec::new();
    }
    let r: Vec<f64> = r.iter().map(|v| v / largest).collect();
    let power: f64 = r.iter().map(|v| v * v).sum();
    let lags = (r.len() / 4).clamp(1, 40).min(r.len() - 1);
    (0..=lags).map(|lag| r.iter().zip(&r[lag..]).map(|(a, b)| a * b).sum::<f64>() / power).collect()
}

/// Standard normal quantiles at (i - 1/2)/n, and the sorted residuals over sigma.
fn normal_quantiles(residual: &[f64], sigma: f64) -> (Vec<f64>, Vec<f64>) {
    let mut sorted: Vec<f64> =
        residual.iter().map(|r| r / sigma).filter(|r| r.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    ((0..sorted.len()).map(|i| normal_quantile((i as f64 + 0.5) / n)).collect(), sorted)
}

/// Inverse of the standard normal distribution, to 4.5e-4, which is a hundredth of a point of the picture.
fn normal_quantile(p: f64) -> f64 {
    if p > 0.5 {
        return -normal_quantile(1.0 - p);
    }
    // Abramowitz and Stegun 26.2.23.
    let t = (-2.0 * p.max(1e-300).ln()).sqrt();
    let top = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let below = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    -(t - top / below)
}
