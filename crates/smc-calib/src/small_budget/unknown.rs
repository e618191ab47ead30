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

use crate::gaussian_process::GaussianProcess;
use crate::target::Target;

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
    /// Directions of the errors of what is predicted, in its units, and the standard deviation along each per that of the process.
    pub(super) fn directions(&self) -> Vec<(&[f64], f64)> {
        match self {
            Self::OfLikelihoods => vec![(&[1.0], 1.0)],
            Self::OfCurves { components, .. } => {
                components.iter().map(|c| (&c.direction[..], c.variance.sqrt())).collect()
            }
        }
    }

    /// Of a process through these rows of outputs, from which the target's log likelihood follows.
    pub(super) fn of_curves<'v>(
        target: &dyn Target,
        process: &GaussianProcess,
        rows: impl Iterator<Item = &'v [f64]>,
    ) -> Self {
        let m = process.units.len();
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
    pub(super) fn sd(
        &self,
        target: &dyn Target,
        process: &GaussianProcess,
        z: &[f64],
        predicted: &[f64],
    ) -> f64 {
        let (sd, units) = (process.variance(z).sqrt(), &process.units);
        let Self::OfCurves { components, .. } = self else { return sd * units[0] };
        let along = |c: &Component| {
            let at = |by: f64| {
                let moved = moved(predicted, units, &c.direction, by);
                target.ln_likelihood_of(&moved).unwrap_or(f64::NAN)
            };
            let sd = sd * c.variance.sqrt();
            (0.5 * (at(sd) - at(-sd))).powi(2)
        };
        components.iter().map(along).sum::<f64>().sqrt()
    }

    /// Log of the likelihood's mean at z; none where the measured curve is not known.
    pub(super) fn ln_mean(
        &self,
        target: &dyn Target,
        process: &GaussianProcess,
        z: &[f64],
        predicted: &[f64],
    ) -> Option<f64> {
        let Self::OfCurves { measured: Some(measured), components } = self else { return None };
        let (variance, units) = (process.variance(z), &process.units);
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
        target.ln_likelihood_of(&at).map(|ln_l| ln_l + factor)
    }
}

/// Outputs moved along a direction, in their units.
pub(super) fn moved(outputs: &[f64], units: &[f64], direction: &[f64], by: f64) -> Vec<f64> {
    let parts = outputs.iter().zip(units).zip(direction);
    parts.map(|((o, unit), b)| o + by * unit * b).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::SimError;
    use crate::gaussian_process::{Covariance, Data};
    use crate::normal::ln_density;

    /// Three values of one parameter, measured with known errors.
    pub(in crate::small_budget) struct Three;

    const MEASURED: [f64; 3] = [0.4, 0.1, 0.9];
    const SIGMA: f64 = 0.3;

    impl Target for Three {
        fn dimension(&self) -> usize {
            1
        }

        fn kept(&self) -> usize {
            3
        }

        fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
            kept.copy_from_slice(&[(3.0 * z[0]).sin(), (2.0 * z[0]).cos(), (3.0 * z[0]).cos()]);
            Ok(self.ln_likelihood_of(kept).unwrap_or(f64::NAN))
        }

        fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
            let each = kept.iter().zip(MEASURED).map(|(k, y)| ln_density((k - y) / SIGMA));
            Some(each.sum())
        }

        fn measured(&self) -> Option<Vec<f64>> {
            Some(MEASURED.to_vec())
        }
    }

    fn at(process: &GaussianProcess, z: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; 3];
        process.predict(z, &mut values);
        values
    }

    /// Mean and variance of a function of the errors of the curves at z, over a fine grid of all components.
    fn over_errors(
        process: &GaussianProcess,
        unknown: &Unknown,
        z: &[f64],
        value: impl Fn(f64) -> f64,
    ) -> [f64; 2] {
        let Unknown::OfCurves { components, .. } = unknown else { panic!("curves") };
        assert!(components.len() <= 3);
        let (predicted, sd) = (at(process, z), process.variance(z).sqrt());
        let units = &process.units;
        let mut sums = [0.0; 3];
        let steps = 81_i32;
        for number in 0..steps.pow(components.len() as u32) {
            let (mut at, mut weight, mut rest) = (predicted.clone(), 1.0, number);
            for c in components {
                let x = f64::from(rest % steps - steps / 2) / 5.0;
                at = moved(&at, units, &c.direction, sd * c.variance.sqrt() * x);
                weight *= (-0.5 * x * x).exp();
                rest /= steps;
            }
            let value = value(Three.ln_likelihood_of(&at).expect("a likelihood"));
            sums = [sums[0] + weight, sums[1] + weight * value, sums[2] + weight * value * value];
        }
        let mean = sums[1] / sums[0];
        [mean, sums[2] / sums[0] - mean * mean]
    }

    #[test]
    fn mean_and_sd_are_those_over_all_errors_of_the_curves() {
        let z: Vec<f64> = (0..9).map(|i| 0.4 * f64::from(i) - 1.6).collect();
        let mut values = vec![0.0; 27];
        for (z, kept) in z.iter().zip(values.chunks_exact_mut(3)) {
            Three.ln_likelihood(&[*z], kept).expect("never fails");
        }
        let process = GaussianProcess::new(Data {
            d: 1,
            z: &z,
            weights: &[1.0; 9],
            chosen: &(0..9).collect::<Vec<_>>(),
            values: &values,
            nuggets: &[1e-3; 9],
            offsets: vec![0.0; 3],
            units: vec![0.7; 3],
            covariance: Covariance::Search,
        });
        let process = process.expect("nine samples");
        let unknown = Unknown::of_curves(&Three, &process, values.chunks_exact(3));
        let mut unsure = 0;
        for z in [-2.4, -1.9, -0.9, 0.6, 1.7, 2.2].map(|z| [z]) {
            let predicted = at(&process, &z);
            let found = unknown.ln_mean(&Three, &process, &z, &predicted).expect("measured");
            let plain = Three.ln_likelihood_of(&predicted).expect("a likelihood");
            let [mean, _] = over_errors(&process, &unknown, &z, |l| (l - found).exp());
            assert!((mean - 1.0).abs() < 1e-3, "{z:?}: {mean}, log {found}");
            unsure += usize::from((found - plain).abs() > 0.5);
            // Of a quadratic the variance is that of its slope, and half the square of its curvature.
            let sd = unknown.sd(&Three, &process, &z, &predicted);
            let [_, variance] = over_errors(&process, &unknown, &z, |l| l);
            let Unknown::OfCurves { components, .. } = &unknown else { panic!("curves") };
            let v = process.variance(&z);
            let bent: f64 = components.iter().map(|c| (v * c.variance / c.noise).powi(2)).sum();
            let exact = sd * sd + 0.5 * bent;
            assert!((variance / exact - 1.0).abs() < 0.01, "{z:?}: {variance} {exact}");
        }
        assert!(unsure > 0, "nothing is unknown");
    }
}
