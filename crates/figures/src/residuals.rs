//! Residuals: whether the model leaves anything but noise.

use plotters::style::Color as _;

use crate::axes::Axes;
use crate::columns::Columns;
use crate::drawing::{Axis, GREY, Look, Marker, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{header, layout, row};
use crate::error::PlotError;
use crate::figure::Figure;

/// Residuals over the control variable, their autocorrelation, and their normal quantiles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ResidualsFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Control values of the measurements, for example times, increasing.
    pub control: Vec<f64>,
    /// Measurement minus model, one per control value.
    pub residual: Vec<f64>,
    /// Standard deviation of the noise: the band is twice that to both sides.
    pub sigma: f64,
    /// Names and scales of the axes of the measured curve.
    pub axes: Axes,
}

const LIMIT: Pen = Pen::dashed(GREY, 0.8, &[1.2, 1.4]);

impl Figure for ResidualsFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let each = (self.control.len(), "control value");
        Columns("residuals").need("residual", &self.residual, each)?;
        let sigma = if self.sigma.is_finite() { self.sigma.abs() } else { f64::NAN };
        let ink = Role::Posterior.ink();
        let entries = [
            ("measured − model", Swatch::measurement()),
            ("±2σ of the noise", Swatch::Band(ink.mix(0.25))),
            ("95 % if uncorrelated", Swatch::Line(LIMIT)),
        ];
        let top = header(page, &self.title, &entries)?;

        let linear = |name: &str, unit: &str, values: &[f64], margin| {
            Axis::holding(name, unit, Scale::Linear, values.iter().copied(), margin)
        };
        let x = self.axes.control(self.control.iter().copied());
        let values = [self.residual.as_slice(), &[2.2 * sigma, -2.2 * sigma]].concat();
        let y = linear(&self.axes.residual_name(), &self.axes.value_unit, &values, 0.05);

        let correlation = autocorrelation(&self.residual);
        let lags: Vec<f64> = (0..correlation.len()).map(|lag| lag as f64).collect();
        let lag_axis =
            Axis::holding("lag", "observations", Scale::Count, lags.iter().copied(), 0.03);
        let white = 1.96 / (self.residual.len().max(1) as f64).sqrt();
        let values = [correlation.as_slice(), &[0.0, 1.0, -white]].concat();
        let correlation_axis = linear("autocorrelation", "", &values, 0.03);

        let (normal, sorted) = normal_quantiles(&self.residual, sigma);
        let normal_axis = linear("normal quantile", "σ", &normal, 0.05);
        let sorted_axis = linear("residual", "σ", &sorted, 0.05);

        let heights = page.of_width((95.0, 80.0), (140.0, 130.0));
        let below = [Spec::new(lag_axis, correlation_axis), Spec::new(normal_axis, sorted_axis)];
        let rows = [row(heights.0, [Spec::new(x, y)]), row(heights.1, below)];
        let panels = layout(page, top, 10.0, &rows)?;
        let [curve, lag, quantile] = panels.as_slice() else { return Ok(()) };

        let ends = [curve.x.low, curve.x.high];
        let ends = if self.axes.log_control { ends.map(|end| 10_f64.powf(end)) } else { ends };
        curve.between(&ends, &[-2.0 * sigma; 2], &[2.0 * sigma; 2], ink.mix(0.15))?;
        curve.across(0.0, Pen::solid(ink, 0.8))?;
        curve.data(&self.control, &self.residual)?;

        lag.across(white, LIMIT)?;
        lag.across(-white, LIMIT)?;
        lag.across(0.0, Pen::solid(GREY, 0.5))?;
        lag.bars(&lags, &vec![0.0; lags.len()], &correlation, Pen::solid(Role::Data.ink(), 0.9))?;
        lag.markers(&lags, &correlation, Look::filled(Marker::Circle, 1.4, Role::Data.ink()))?;

        quantile.line(&[-10.0, 10.0], &[-10.0, 10.0], Pen::solid(ink, 0.8))?;
        quantile.data(&normal, &sorted)
    }
}

/// Sample autocorrelation up to a quarter of the series, at most 40 lags, about zero: the mean if the model fits.
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
