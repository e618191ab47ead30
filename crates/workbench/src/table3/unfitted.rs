//! The prediction of a pair that was not fitted: what the posterior of one PA12 pair says of another one.
//!
//! C1 and delta_c belong to the material, `tau_s = eta R/gamma` to the radius: for the other pair it is multiplied
//! by the ratio of the radii (Table 1 calls the 32.1 um of the fitted pair 31.5 um; the other one, 30.4 um, is
//! scaled alike).

use std::path::PathBuf;

use dem_core::Sintering;
use rayon::prelude::*;
use serde::Serialize;
use smc_calib::{Draw, Posterior, SimError, normal};

use super::calibrated::Calibrated;
use crate::calibration::Calibration;
use crate::error::{Failure, RunError};
use crate::input::material::Material;
use crate::pair::model::NeckGrowth;
use crate::plan::PairOptions;
use crate::record::{FitError, Pair};
use crate::watch::Watch;
use figures::{Band, FitFigure};
use smc_calib::Weighted;

/// Name of the built-in experiment that is predicted.
pub(crate) const EXPERIMENT: &str = "pa12-r30";
/// Times of the curve in the figure.
const GRID: usize = 201;

/// The prediction beside the measurements.
#[derive(Debug, Clone, PartialEq, Serialize)]
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
    /// Time of the largest error \[s\].
    pub largest_at_s: f64,
    /// Errors of the posterior mean curve where tau_s is *not* transferred.
    pub error_without_transfer: FitError,
    /// Errors of the same curve on the pair that was fitted.
    pub error_of_fit: FitError,
    /// Median of the noise standard deviation of the fitted pair.
    pub sigma: f64,
    /// tau_s transferred to the predicted pair: 2.5 %, 50 % and 97.5 % quantile \[s\].
    pub tau_s_predicted: [f64; 3],
    /// tau_s calibrated on the predicted pair alone, likewise \[s\].
    pub tau_s_own: [f64; 3],
    /// Each measurement.
    pub points: Vec<Point>,
}

/// One measurement of the predicted pair.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
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
pub(crate) fn predict(
    calibrated: &[Calibrated],
    watch: &dyn Watch,
) -> Result<(Unfitted, FitFigure), Failure> {
    let one = calibrated
        .iter()
        .find(|one| one.material == Material::Pa12)
        .ok_or_else(|| RunError::new("PA12 was not calibrated"))?;
    let sampler = &one.calibration.record.plan.sampler;
    let options = PairOptions {
        material: Some(Material::Pa12),
        experiment: Some(PathBuf::from(EXPERIMENT)),
        samples: sampler.samples,
        seed: sampler.seed,
        ..PairOptions::default()
    };
    let own = Calibration::run(&options.plan()?, watch)?;
    let predicted = own.record.pair()?;
    let pair = Predicted {
        one,
        fitted: one.calibration.record.pair()?,
        model: NeckGrowth::of(&own.record.plan)?,
        radius_m: predicted.plan.powder.radius_m,
        measured: &predicted.measured.values,
    };
    let failed = |error: SimError| RunError::new(error.to_string());
    Ok((pair.judged(&own.posterior).map_err(failed)?, pair.figure().map_err(failed)?))
}

/// The pair that is predicted.
struct Predicted<'a> {
    /// The calibration that predicts.
    one: &'a Calibrated,
    /// The pair that was fitted.
    fitted: Pair<'a>,
    /// Model of the predicted pair at the times of its measurements.
    model: NeckGrowth,
    radius_m: f64,
    measured: &'a [f64],
}

impl Predicted<'_> {
    /// The prediction beside the measurements; `own` is the posterior of the predicted pair alone.
    fn judged(&self, own: &Posterior) -> Result<Unfitted, SimError> {
        let (times, measured) = (self.model.times_s(), self.measured);
        let curves = self.curves(&self.model, self.fitted.plan.powder.radius_m)?;
        let means = curves.means();
        let points: Vec<Point> = (0..times.len())
            .map(|i| Point {
                time_s: times[i],
                measured: measured[i],
                mean: means[i],
                noisy90: curves.band(i, true),
                rank: curves.rank(i, measured[i]),
            })
            .collect();
        let share = |inside: &dyn Fn(usize) -> bool| {
            (0..points.len()).filter(|&i| inside(i)).count() as f64 / points.len() as f64
        };
        let inside_curve = |i: usize| {
            let [lower, upper] = curves.band(i, false);
            (lower..=upper).contains(&measured[i])
        };
        let without = self.curves(&self.model, self.radius_m)?.means();
        let off = |point: &Point| (point.measured - point.mean).abs();
        let largest = points.iter().max_by(|a, b| off(a).total_cmp(&off(b)));
        let fitted_radius_m = self.fitted.plan.powder.radius_m;
        let transferred = |t: f64| t * self.radius_m / fitted_radius_m;
        Ok(Unfitted {
            fitted: self.one.material.experiment_name().to_owned(),
            predicted: EXPERIMENT.to_owned(),
            fitted_radius_m,
            predicted_radius_m: self.radius_m,
            coverage: [0.5, 0.9, 0.95].map(|p| share(&|i| (points[i].rank - 0.5).abs() <= 0.5 * p)),
            curve_coverage90: share(&inside_curve),
            error: FitError::of(measured, &means),
            largest_at_s: largest.map_or(0.0, |point| point.time_s),
            error_without_transfer: FitError::of(measured, &without),
            error_of_fit: self.fitted.neck_growth.fit.posterior_mean,
            sigma: self.fitted.found.sigma.map_or(0.0, |sigma| sigma.median),
            tau_s_predicted: tau_s(&self.one.calibration.posterior).map(transferred),
            tau_s_own: tau_s(own),
            points,
        })
    }

    fn figure(&self) -> Result<FitFigure, SimError> {
        let times = self.model.times_s();
        let last = 1.02 * times.last().copied().unwrap_or(1.0);
        let grid_s: Vec<f64> = (0..GRID).map(|k| last * k as f64 / (GRID - 1) as f64).collect();
        let on_grid = self.model.at_times(grid_s.clone());
        let curves = self.curves(&on_grid, self.fitted.plan.powder.radius_m)?;
        let band = |noisy: bool| -> Band {
            let ends: Vec<[f64; 2]> =
                (0..GRID).into_par_iter().map(|i| curves.band(i, noisy)).collect();
            Band {
                lower: ends.iter().map(|end| end[0]).collect(),
                upper: ends.iter().map(|end| end[1]).collect(),
            }
        };
        let single = |sintering: Sintering| {
            let mut curve = vec![0.0; GRID];
            let there = sintering.at_radius(self.fitted.plan.powder.radius_m, self.radius_m);
            on_grid.curve(&there, &mut curve).map(|()| curve)
        };
        Ok(FitFigure {
            title: "PA12 R = 30.4 µm, predicted from R = 32.1 µm".to_owned(),
            control: times.to_vec(),
            value: self.measured.to_vec(),
            mean: curves.means(),
            band90: band(false),
            predictive90: band(true),
            map: single(self.model.sintering(&self.one.calibration.posterior.map.theta))?,
            paper: single(Material::Pa12.table3_sintering())?,
            grid: grid_s,
            ..FitFigure::default()
        })
    }

    /// The curves of the posterior draws, tau_s transferred from a radius to that of the predicted pair.
    fn curves(&self, model: &NeckGrowth, from_radius_m: f64) -> Result<Curves, SimError> {
        let posterior = &self.one.calibration.posterior;
        let curves = posterior.draws.par_iter().map(|draw: &Draw| {
            let sintering =
                model.sintering(posterior.theta(draw)).at_radius(from_radius_m, self.radius_m);
            let mut curve = vec![0.0; model.times_s().len()];
            model.curve(&sintering, &mut curve)?;
            Ok((curve, draw.sigma.unwrap_or(0.0)))
        });
        Ok(Curves(curves.collect::<Result<_, _>>()?))
    }
}

/// Curves of posterior draws, each with its sigma.
struct Curves(Vec<(Vec<f64>, f64)>);

impl Curves {
    fn means(&self) -> Vec<f64> {
        let points = self.0.first().map_or(0, |(curve, _)| curve.len());
        let mean = |i: usize| self.0.iter().map(|(curve, _)| curve[i]).sum::<f64>();
        (0..points).map(|i| mean(i) / self.0.len() as f64).collect()
    }

    /// Predictive probability of a value below the measured one.
    fn rank(&self, i: usize, measured: f64) -> f64 {
        let below = self.0.iter().map(|(curve, sigma)| normal::cdf((measured - curve[i]) / sigma));
        below.sum::<f64>() / self.0.len() as f64
    }

    /// 90 % band of the curves, or of new measurements; their noise is stratified by the golden-ratio sequence.
    fn band(&self, i: usize, noisy: bool) -> [f64; 2] {
        let values = self.0.iter().enumerate().map(|(k, (curve, sigma))| {
            let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
            let noise = if noisy { sigma * normal::quantile(u) } else { 0.0 };
            (curve[i] + noise, 1.0)
        });
        Weighted::new(values).interval(0.9)
    }
}

/// Median and 95 % interval of tau_s.
fn tau_s(posterior: &Posterior) -> [f64; 3] {
    let summary = posterior.parameters.iter().find(|summary| summary.parameter.name == "tau_s");
    summary.map_or([f64::NAN; 3], |summary| {
        let si = &summary.in_si;
        [si.eti95.lower, si.median, si.eti95.upper]
    })
}
