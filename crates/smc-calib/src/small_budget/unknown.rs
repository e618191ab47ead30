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
//! times `exp(-sum c_k^2 / (2 v e_k)) prod (1 + v e_k / lambda_k)^(-1/2)` (product of two normal densities; the same, section A.2).
//!
//! Of another likelihood that is Laplace's approximation about the best of all curves that the process thinks possible at z. Where the
//! noise is inferred a curve far from the measured one has a likelihood that is flatter, by a factor that is the same in all directions,
//! than that of a perfect fit: lambda_k is that of a perfect fit times the slope, along the line from the measured curve to the best
//! one, that a perfect fit's curvature gives over the true slope; and the determinant has the curvature along that line. With lambda_k of
//! a perfect fit alone the mean was up to ten log units too low.

use crate::cholesky::dot;
use crate::gaussian_process::GaussianProcess;
use crate::target::Target;

/// Principal components of the errors of curves that count.
const COMPONENTS: usize = 4;
/// Step of the second differences of the likelihood, in units of the outputs.
const STEP: f64 = 1e-3;
/// Times that the best curve is looked for again with the flatness at the last one.
const BEST: usize = 3;
/// Least that the curvature along one line takes from the determinant, of one.
const LEAST_BENT: f64 = -0.9;

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
        let derivatives = |direction: &[f64]| {
            let y = y.as_ref()?;
            derivatives(|by| target.ln_likelihood_of(&moved(y, &process.units, direction, by)))
        };
        let components = process.principal(rows, COMPONENTS.min(m)).into_iter();
        let components = components.map(|(direction, variance)| {
            let curved = derivatives(&direction).filter(|[_, curvature]| *curvature > 0.0);
            let noise = curved.map_or(f64::INFINITY, |[_, curvature]| 1.0 / curvature);
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
        let off = apart(measured, predicted, units);
        // The best curve, and the log of the mean over its value, where the likelihood is of this shape there.
        let best = |shape: Shape| {
            let (mut at, mut factor, mut squares) = (predicted.to_vec(), 0.0, 0.0);
            for Component { direction, variance: own, noise } in components {
                let (v, noise) = (variance * own, noise * shape.flatter);
                let step = v / (v + noise) * dot(direction, &off);
                if v > 0.0 && noise.is_finite() {
                    factor -= 0.5 * step * step / v + 0.5 * (v / noise).ln_1p();
                    squares += step * step / v / (1.0 + v / noise);
                    at = moved(&at, units, direction, step);
                }
            }
            (at, factor - 0.5 * (shape.bent * squares).max(LEAST_BENT).ln_1p())
        };
        let (mut at, mut factor) = best(Shape { flatter: 1.0, bent: 0.0 });
        for _ in 0..BEST {
            let Some(shape) = Shape::at(target, measured, &at, units) else { break };
            (at, factor) = best(shape);
        }
        target.ln_likelihood_of(&at).map(|ln_l| ln_l + factor)
    }
}

/// How a likelihood near some outputs differs from a normal one with the curvature of a perfect fit.
struct Shape {
    /// Times that it is as flat: the slope along the line to the measured curve by that curvature, over the true slope.
    flatter: f64,
    /// Curvature along that line beyond that of a normal one of this slope, over the square of the slope.
    bent: f64,
}

impl Shape {
    /// None where slopes are not positive, or the outputs nearly measured.
    fn at(target: &dyn Target, measured: &[f64], outputs: &[f64], units: &[f64]) -> Option<Self> {
        let mut along = apart(measured, outputs, units);
        let length = dot(&along, &along).sqrt();
        if length < STEP {
            return None;
        }
        along.iter_mut().for_each(|a| *a /= length);
        let at = |by: f64| target.ln_likelihood_of(&moved(outputs, units, &along, by));
        let [_, of_perfect_fit] = derivatives(|by| at(length + by))?;
        let [slope, curvature] = derivatives(at)?;
        let flatter = length * of_perfect_fit / slope;
        let bent = (curvature - slope / length) / (slope * slope);
        (slope > 0.0 && of_perfect_fit > 0.0).then_some(Self { flatter, bent })
    }
}

/// Slope of a log likelihood at zero, and minus its second derivative.
fn derivatives(at: impl Fn(f64) -> Option<f64>) -> Option<[f64; 2]> {
    let [before, here, after] = [at(-STEP)?, at(0.0)?, at(STEP)?];
    Some([(after - before) / (2.0 * STEP), (2.0 * here - before - after) / (STEP * STEP)])
}

/// The measured curve, which is in units of the outputs, minus these outputs, in their units.
fn apart(measured: &[f64], outputs: &[f64], units: &[f64]) -> Vec<f64> {
    measured.iter().zip(outputs.iter().zip(units)).map(|(y, (o, unit))| y - o / unit).collect()
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
        target: &dyn Target,
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
            let value = value(target.ln_likelihood_of(&at).expect("a likelihood"));
            sums = [sums[0] + weight, sums[1] + weight * value, sums[2] + weight * value * value];
        }
        let mean = sums[1] / sums[0];
        [mean, sums[2] / sums[0] - mean * mean]
    }

    /// A process through the curves at nine points, and these.
    fn through_nine() -> (GaussianProcess, Vec<f64>) {
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
        (process.expect("nine samples"), values)
    }

    #[test]
    fn mean_and_sd_are_those_over_all_errors_of_the_curves() {
        let (process, values) = through_nine();
        let unknown = Unknown::of_curves(&Three, &process, values.chunks_exact(3));
        let mut unsure = 0;
        for z in [-2.4, -1.9, -0.9, 0.6, 1.7, 2.2].map(|z| [z]) {
            let predicted = at(&process, &z);
            let found = unknown.ln_mean(&Three, &process, &z, &predicted).expect("measured");
            let plain = Three.ln_likelihood_of(&predicted).expect("a likelihood");
            let [mean, _] = over_errors(&Three, &process, &unknown, &z, |l| (l - found).exp());
            assert!((mean - 1.0).abs() < 1e-3, "{z:?}: {mean}, log {found}");
            unsure += usize::from((found - plain).abs() > 0.5);
            // Of a quadratic the variance is that of its slope, and half the square of its curvature.
            let sd = unknown.sd(&Three, &process, &z, &predicted);
            let [_, variance] = over_errors(&Three, &process, &unknown, &z, |l| l);
            let Unknown::OfCurves { components, .. } = &unknown else { panic!("curves") };
            let v = process.variance(&z);
            let bent: f64 = components.iter().map(|c| (v * c.variance / c.noise).powi(2)).sum();
            let exact = sd * sd + 0.5 * bent;
            assert!((variance / exact - 1.0).abs() < 0.01, "{z:?}: {variance} {exact}");
        }
        assert!(unsure > 0, "nothing is unknown");
    }

    /// The same values, measured with errors whose size is inferred.
    struct Inferred;

    impl Target for Inferred {
        fn dimension(&self) -> usize {
            1
        }

        fn kept(&self) -> usize {
            3
        }

        fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
            Three.ln_likelihood(z, kept)?;
            Ok(self.ln_likelihood_of(kept).unwrap_or(f64::NAN))
        }

        fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
            let squares: f64 = kept.iter().zip(MEASURED).map(|(k, y)| (k - y).powi(2)).sum();
            Some(-12.0 * (0.04 + squares).ln())
        }

        fn measured(&self) -> Option<Vec<f64>> {
            Some(MEASURED.to_vec())
        }
    }

    #[test]
    fn where_the_noise_is_inferred_the_mean_is_that_over_all_errors_too() {
        let (process, values) = through_nine();
        let unknown = Unknown::of_curves(&Inferred, &process, values.chunks_exact(3));
        // Far from all samples curves are possible that fit perfectly and that are bad, and Laplace's approximation is one.
        for (z, most) in
            [-2.4, -1.9, -0.9, 0.6, 1.7, 2.2].into_iter().zip([0.2, 0.01, 1e-6, 1e-6, 1e-6, 0.2])
        {
            let z = [z];
            let predicted = at(&process, &z);
            let found = unknown.ln_mean(&Inferred, &process, &z, &predicted).expect("measured");
            let [mean, _] = over_errors(&Inferred, &process, &unknown, &z, |l| (l - found).exp());
            assert!(mean.ln().abs() < most, "{z:?}: {mean}, log {found}");
        }
    }
}
