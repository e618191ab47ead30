//! A check that was not fitted: what the posterior of one PA12 pair says of another one.
//!
//! C1 and delta_c belong to the material, `tau_s = eta R/gamma` to the radius: for the other pair it is multiplied
//! by the ratio of the radii (Table 1 calls the 32.1 um of the fitted pair 31.5 um; the other one, 30.4 um, is
//! scaled alike).

use std::path::PathBuf;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use smc_calib::{Draw, Posterior, SimError, normal};

use super::Calibrated;
use crate::args::RunArgs;
use crate::calibration::Calibration;
use crate::error::{Failure, RunError};
use crate::material::Material;
use crate::model::NeckGrowth;
use crate::plan::Planned;
use crate::posterior_file::FitError;
use crate::weighted::Weighted;
use figures::{Band, FitFigure};

/// Name of the built-in experiment that is predicted.
pub const EXPERIMENT: &str = "pa12-r30";
/// Times of the curve in the figure.
const GRID: usize = 201;

/// The prediction and how it fared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unfitted {
    /// The experiment that was fitted.
    pub fitted: String,
    /// The experiment that is predicted.
    pub predicted: String,
    /// Radius in the model of the fitted pair \[m\].
    pub fitted_radius_m: f64,
    /// Radius in the model of the predicted pair \[m\].
    pub predicted_radius_m: f64,
    /// Share of the measurements inside the 50, 90 and 95 % predictive band, noise included.
    pub coverage: [f64; 3],
    /// Share of the measurements inside the 90 % band of the curve alone.
    pub curve_coverage90: f64,
    /// Errors of the posterior mean curve.
    pub error: FitError,
    /// Where the largest one is \[s\].
    pub largest_at_s: f64,
    /// Errors of the posterior mean curve where tau_s is *not* transferred.
    pub error_without_transfer: FitError,
    /// Errors of the same curve on the pair that was fitted.
    pub error_of_fit: FitError,
    /// Median of the noise standard deviation that the fitted pair taught.
    pub sigma: f64,
    /// tau_s transferred to the predicted pair: 2.5 %, 50 % and 97.5 % quantile \[s\].
    pub tau_s_predicted: [f64; 3],
    /// tau_s calibrated on the predicted pair alone, likewise \[s\].
    pub tau_s_own: [f64; 3],
    /// Each measurement.
    pub points: Vec<Point>,
}

/// One measurement of the predicted pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Time \[s\].
    pub time_s: f64,
    /// Measured a/R.
    pub measured: f64,
    /// Predicted mean.
    pub mean: f64,
    /// 90 % predictive band, noise included.
    pub noisy90: [f64; 2],
    /// Predictive probability of a smaller value.
    pub rank: f64,
}

/// The prediction and its figure.
///
/// # Errors
///
/// [`Failure`] for a curve that cannot be computed.
pub fn predict(calibrated: &[Calibrated]) -> Result<(Unfitted, FitFigure), Failure> {
    let one = calibrated
        .iter()
        .find(|one| one.material == Material::Pa12)
        .ok_or_else(|| RunError::new("PA12 was not calibrated"))?;
    let sampler = &one.planned.plan.sampler;
    let args = RunArgs {
        material: Some(Material::Pa12),
        experiment: Some(PathBuf::from(EXPERIMENT)),
        samples: sampler.samples,
        seed: sampler.seed,
        ..RunArgs::default()
    };
    let other = Planned::from_args(&args)?;
    let own = Calibration::run(&other, &mut (), &|| true)?.posterior;
    let other = other.plan;
    let model = NeckGrowth::of(&other)?;
    let fitted_radius_m = one.planned.plan.experiment.radius_m;
    let radius_m = other.experiment.radius_m;
    let failed = |error: SimError| RunError::new(error.to_string());

    let (times, measured) = (&other.experiment.time_s, &other.experiment.contact_ratio);
    let at_data = curves(one, &model, fitted_radius_m, radius_m).map_err(failed)?;
    let means: Vec<f64> = (0..times.len()).map(|i| mean(&at_data, i)).collect();
    let points: Vec<Point> = (0..times.len())
        .map(|i| {
            let rank = at_data
                .iter()
                .map(|(curve, sigma)| normal::cdf((measured[i] - curve[i]) / sigma))
                .sum::<f64>()
                / at_data.len() as f64;
            Point {
                time_s: times[i],
                measured: measured[i],
                mean: means[i],
                noisy90: band(&at_data, i, true),
                rank,
            }
        })
        .collect();
    let share = |inside: &dyn Fn(&Point) -> bool| {
        points.iter().filter(|point| inside(point)).count() as f64 / points.len() as f64
    };
    let coverage = [0.5, 0.9, 0.95].map(|p| share(&|point| (point.rank - 0.5).abs() <= 0.5 * p));
    let inside_curve = (0..times.len())
        .filter(|&i| {
            let [lower, upper] = band(&at_data, i, false);
            (lower..=upper).contains(&measured[i])
        })
        .count();
    let without = curves(one, &model, radius_m, radius_m).map_err(failed)?;
    let without: Vec<f64> = (0..times.len()).map(|i| mean(&without, i)).collect();
    let largest = points.iter().max_by(|a, b| {
        let off = |point: &Point| (point.measured - point.mean).abs();
        off(a).total_cmp(&off(b))
    });
    let file = &one.calibration.file;
    let unfitted = Unfitted {
        fitted: one.planned.plan.experiment.name.clone(),
        predicted: EXPERIMENT.to_owned(),
        fitted_radius_m,
        predicted_radius_m: radius_m,
        coverage,
        curve_coverage90: inside_curve as f64 / times.len() as f64,
        error: FitError::of(measured, &means),
        largest_at_s: largest.map_or(0.0, |point| point.time_s),
        error_without_transfer: FitError::of(measured, &without),
        error_of_fit: file.fit.posterior_mean,
        sigma: file.sigma.map_or(0.0, |sigma| sigma.median),
        tau_s_predicted: tau_s(&one.calibration.posterior).map(|t| t * radius_m / fitted_radius_m),
        tau_s_own: tau_s(&own),
        points,
    };

    let last = 1.02 * times.last().copied().unwrap_or(1.0);
    let grid_s: Vec<f64> = (0..GRID).map(|k| last * k as f64 / (GRID - 1) as f64).collect();
    let on_grid = model.at_times(grid_s.clone());
    let drawn = curves(one, &on_grid, fitted_radius_m, radius_m).map_err(failed)?;
    let column = |noisy: bool| -> Band {
        let ends: Vec<[f64; 2]> =
            (0..GRID).into_par_iter().map(|i| band(&drawn, i, noisy)).collect();
        Band {
            lower: ends.iter().map(|end| end[0]).collect(),
            upper: ends.iter().map(|end| end[1]).collect(),
        }
    };
    let single = |sintering: dem_core::Sintering| {
        let mut curve = vec![0.0; GRID];
        let there = sintering.at_radius(fitted_radius_m, radius_m);
        on_grid.curve(&there, &mut curve).map(|()| curve).map_err(failed)
    };
    let theta = &one.calibration.posterior.map.theta;
    let figure = FitFigure {
        title: "PA12 R = 30.4 µm, predicted from R = 32.1 µm".to_owned(),
        control: times.clone(),
        value: measured.clone(),
        mean: (0..GRID).map(|i| mean(&drawn, i)).collect(),
        band90: column(false),
        predictive90: column(true),
        map: single(model.sintering(theta))?,
        paper: single(Material::Pa12.table3_sintering())?,
        grid: grid_s,
        ..FitFigure::default()
    };
    Ok((unfitted, figure))
}

/// The curves of the posterior draws with tau_s taken from one radius to the other, each with its sigma.
fn curves(
    one: &Calibrated,
    model: &NeckGrowth,
    from_radius_m: f64,
    to_radius_m: f64,
) -> Result<Vec<(Vec<f64>, f64)>, SimError> {
    let posterior = &one.calibration.posterior;
    posterior
        .draws
        .par_iter()
        .map(|draw: &Draw| {
            let theta = &posterior.samples[draw.sample].theta;
            let sintering = model.sintering(theta).at_radius(from_radius_m, to_radius_m);
            let mut curve = vec![0.0; model.times_s().len()];
            model.curve(&sintering, &mut curve)?;
            Ok((curve, draw.sigma.unwrap_or(0.0)))
        })
        .collect()
}

/// Median and 95 % interval of tau_s.
fn tau_s(posterior: &Posterior) -> [f64; 3] {
    let summary = posterior.parameters.iter().find(|summary| summary.parameter.name == "tau_s");
    summary.map_or([f64::NAN; 3], |summary| {
        let si = &summary.in_si;
        [si.eti95.lower, si.median, si.eti95.upper]
    })
}

fn mean(curves: &[(Vec<f64>, f64)], i: usize) -> f64 {
    curves.iter().map(|(curve, _)| curve[i]).sum::<f64>() / curves.len() as f64
}

/// 90 % band of the curves, or of new measurements; their noise is stratified by the golden-ratio sequence.
fn band(curves: &[(Vec<f64>, f64)], i: usize, noisy: bool) -> [f64; 2] {
    let values = curves.iter().enumerate().map(|(k, (curve, sigma))| {
        let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
        let noise = if noisy { sigma * normal::quantile(u) } else { 0.0 };
        (curve[i] + noise, 1.0)
    });
    Weighted::new(values).interval(0.9)
}
