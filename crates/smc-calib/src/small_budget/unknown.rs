//! What a process does not know of the likelihood.
//!
//! Between samples the curves of a process are `mean + sd(z) e`, with normal errors e that are alike from observation to observation:
//! their covariance is that of the samples given the process, `V^T K^-1 V / n` (C. E. Rasmussen, C. K. I. Williams (2006), section 9.1),
//! of which the largest principal components b_k, of variance e_k, are kept.
//!
//! Where the likelihood of curves is normal, of variance lambda_k along b_k about the measured curve y, its mean over these errors is
//! its value at
//!
//! `mean + sum c_k b_k`, `c_k = v e_k / (v e_k + lambda_k) b_k (y - mean)`, with the variance v of the process at z,
//!
//! times `exp(-sum c_k^2 / (2 v e_k)) prod (1 + v e_k / lambda_k)^(-1/2)` (product of two normal densities; the same, section A.2). Of
//! another likelihood that is Laplace's approximation, with the curvature at the measured curve itself: that of a perfect fit.

use super::StandIn;
use crate::pool::Pool;

/// Principal components of the errors of curves that count.
const COMPONENTS: usize = 4;
/// Step of the second differences of the likelihood, in units of the outputs.
const STEP: f64 = 1e-3;

/// What a process does not know.
pub(super) enum Unknown {
    /// The log likelihood, as its variance says.
    OfLikelihoods,
    /// The outputs.
    OfCurves {
        /// The measured curve, in units of the outputs; none where it is not known.
        measured: Option<Vec<f64>>,
        /// Principal components of the errors.
        components: Vec<Component>,
    },
}

/// A principal component of the errors of curves.
pub(super) struct Component {
    /// Direction, of length one in units of the outputs.
    direction: Vec<f64>,
    /// Variance along it, per variance of the process.
    variance: f64,
    /// Variance of the likelihood along it.
    noise: f64,
}

impl Unknown {
    /// Of a process through samples of the pool.
    pub(super) fn new(stand_in: &StandIn<'_>, pool: &Pool) -> Self {
        if !stand_in.outputs {
            return Self::OfLikelihoods;
        }
        let m = pool.kept_width;
        let rows = stand_in.chosen.iter().map(|i| &pool.kept[i * m..(i + 1) * m]);
        let (process, target) = (&stand_in.process, stand_in.target);
        let y = target.measured();
        let curvature = |direction: &[f64]| -> Option<f64> {
            let y = y.as_ref()?;
            let at = |by: f64| target.ln_likelihood_of(&moved(y, &process.units, direction, by));
            Some((2.0 * at(0.0)? - at(STEP)? - at(-STEP)?) / (STEP * STEP))
        };
        let components = process.principal(rows, COMPONENTS.min(m)).into_iter();
        let components = components.map(|(direction, variance)| {
            let curvature = curvature(&direction).filter(|curvature| *curvature > 0.0);
            let noise = curvature.map_or(f64::INFINITY, |curvature| 1.0 / curvature);
            Component { direction, variance, noise }
        });
        let components = components.filter(|c| c.variance > 0.0).collect();
        let measured = y.map(|y| y.iter().zip(&process.units).map(|(y, unit)| y / unit).collect());
        Self::OfCurves { measured, components }
    }

    /// Standard deviation of the log likelihood at z, where the process predicts these values; of curves to first order.
    pub(super) fn sd(&self, stand_in: &StandIn<'_>, z: &[f64], predicted: &[f64]) -> f64 {
        let (sd, units) = (stand_in.process.variance(z).sqrt(), &stand_in.process.units);
        let Self::OfCurves { components, .. } = self else { return sd * units[0] };
        let along = |c: &Component| {
            let at = |by: f64| {
                let moved = moved(predicted, units, &c.direction, by);
                stand_in.target.ln_likelihood_of(&moved).unwrap_or(f64::NAN)
            };
            let sd = sd * c.variance.sqrt();
            (0.5 * (at(sd) - at(-sd))).powi(2)
        };
        components.iter().map(along).sum::<f64>().sqrt()
    }

    /// Log of the likelihood's mean at z; none where the measured curve is not known.
    pub(super) fn ln_mean(
        &self,
        stand_in: &StandIn<'_>,
        z: &[f64],
        predicted: &[f64],
    ) -> Option<f64> {
        let Self::OfCurves { measured: Some(measured), components } = self else { return None };
        let (variance, units) = (stand_in.process.variance(z), &stand_in.process.units);
        let off =
            measured.iter().zip(predicted.iter().zip(units)).map(|(y, (p, unit))| y - p / unit);
        let off: Vec<f64> = off.collect();
        let (mut at, mut factor) = (predicted.to_vec(), 0.0);
        for Component { direction, variance: own, noise } in components {
            let v = variance * own;
            let along: f64 = direction.iter().zip(&off).map(|(b, off)| b * off).sum();
            let step = v / (v + noise) * along;
            if step != 0.0 {
                factor -= 0.5 * step * step / v + 0.5 * (v / noise).ln_1p();
                at = moved(&at, units, direction, step);
            }
        }
        stand_in.target.ln_likelihood_of(&at).map(|ln_l| ln_l + factor)
    }
}

/// Outputs moved along a direction, in their units.
fn moved(outputs: &[f64], units: &[f64], direction: &[f64], by: f64) -> Vec<f64> {
    let parts = outputs.iter().zip(units).zip(direction);
    parts.map(|((o, unit), b)| o + by * unit * b).collect()
}
