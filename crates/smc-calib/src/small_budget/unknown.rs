//! What a process does not know of the likelihood.
//!
//! Between samples the curves of a process are `mean + sd(z) e`, with normal errors e that are alike from observation to observation:
//! their covariance is that of the samples given the process, `V^T K^-1 V / n` (C. E. Rasmussen, C. K. I. Williams (2006), section 9.1),
//! of which the largest principal components are kept. Of their sums those are taken, b_k, whose errors are independent, of variance one,
//! and along which the likelihood of curves near the measured one y is independent too, of variance lambda_k: the principal axes of its
//! curvature in units of the errors.
//!
//! Where the likelihood of curves is normal, its mean over these errors is its value at
//!
//! `mean + sum c_k b_k`, `c_k = v / (v + lambda_k) lambda_k s_k`, with the variance v of the process at z and the slope s_k of the log
//! likelihood along b_k at the mean,
//!
//! times `exp(-sum c_k^2 / (2 v)) prod (1 + v / lambda_k)^(-1/2)` (product of two normal densities; the same, section A.2).
//!
//! Of another likelihood that is Laplace's approximation about the best of all curves that the process thinks possible at z. Where the
//! noise is inferred, a curve far from the measured one has a likelihood that is flatter, by a factor that is the same in all directions
//! (for one group of observations with independent errors; of others this is an approximation), than that of a perfect fit: lambda_k is
//! multiplied by the slope that a perfect fit's curvature gives over the true one, both along the line to the measured curve (in
//! `lambda_k s_k` those at the mean, else those at the best curve), and the determinant has the curvature along that line. There can be
//! two best curves, near the mean and near the measured curve: the larger result counts. With lambda_k of a perfect fit alone the mean
//! was up to ten log units too low.

mod shape;

use nalgebra::{DMatrix, SymmetricEigen};

use self::shape::{SHORT, Shape, curvature};
use crate::gaussian_process::GaussianProcess;
use crate::target::Target;

/// Principal components of the errors of curves that count.
const COMPONENTS: usize = 4;
/// Curvature, over the largest one and one, below which a likelihood does not change along a component: rounding gives as much.
const FLAT: f64 = 1e-9;
/// Times at most that the best curve is looked for again with the flatness at the last one, and the relative change of the flatness
/// from which on it need not be.
const BEST: usize = 20;
const SETTLED: f64 = 0.01;
/// Least of the curvature along the line over all of it, of one: with less the curve is no maximum.
const LEAST_BENT: f64 = -0.9;

/// What a process does not know.
pub(super) enum Unknown {
    /// The log likelihood, as its variance says.
    OfLikelihoods,
    /// The outputs.
    OfCurves {
        /// The measured curve; none where it is not known.
        measured: Option<Vec<f64>>,
        /// Components of the errors.
        components: Vec<Component>,
    },
}

/// A component of the errors of curves.
pub(super) struct Component {
    /// Error, in units of the outputs, where that of the process is one.
    direction: Vec<f64>,
    /// Variance of the likelihood along it about a perfect fit, in squares of that error; infinite where it does not change.
    noise: f64,
}

impl Component {
    /// Log likelihood of outputs moved by so much along it, up and down; not a number where it does not follow from them.
    fn to_both_sides(
        &self,
        target: &dyn Target,
        units: &[f64],
        outputs: &[f64],
        by: f64,
    ) -> [f64; 2] {
        [by, -by].map(|by| {
            let moved = moved(outputs, units, &self.direction, by);
            target.ln_likelihood_of(&moved).unwrap_or(f64::NAN)
        })
    }
}

impl Unknown {
    /// Independent errors of what is predicted, in its units, where that of the process is one.
    pub(super) fn directions(&self) -> Vec<&[f64]> {
        match self {
            Self::OfLikelihoods => vec![&[1.0]],
            Self::OfCurves { components, .. } => {
                components.iter().map(|c| &c.direction[..]).collect()
            }
        }
    }

    /// Of a process through these rows of outputs, from which the target's log likelihood follows.
    pub(super) fn of_curves<'v>(
        target: &dyn Target,
        process: &GaussianProcess,
        rows: impl Iterator<Item = &'v [f64]>,
    ) -> Self {
        let principal = process.principal(rows, COMPONENTS.min(process.units.len())).into_iter();
        let errors: Vec<Vec<f64>> = principal
            .filter(|(_, variance)| *variance > 0.0)
            .map(|(direction, variance)| direction.iter().map(|b| variance.sqrt() * b).collect())
            .collect();
        let measured = target.measured();
        let axes = measured.as_ref().and_then(|y| {
            axes(&errors, |direction| {
                curvature(|by| target.ln_likelihood_of(&moved(y, &process.units, direction, by)))
            })
        });
        let as_they_are = || {
            let of = |direction| Component { direction, noise: f64::INFINITY };
            errors.iter().cloned().map(of).collect()
        };
        Self::OfCurves { measured, components: axes.unwrap_or_else(as_they_are) }
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
            let [up, down] = c.to_both_sides(target, units, predicted, sd);
            (0.5 * (up - down)).powi(2)
        };
        components.iter().map(along).sum::<f64>().sqrt()
    }

    /// Mean square of what the log likelihood is off by where these values are predicted with errors of variance v: of curves that of
    /// the parabola through it and through one standard deviation to either side, along each component.
    pub(super) fn mean_square(
        &self,
        target: &dyn Target,
        units: &[f64],
        predicted: &[f64],
        v: f64,
    ) -> f64 {
        let Self::OfCurves { components, .. } = self else { return v * units[0] * units[0] };
        let here = target.ln_likelihood_of(predicted).unwrap_or(f64::NAN);
        let (mut variance, mut mean) = (0.0, 0.0);
        for component in components {
            let both = component.to_both_sides(target, units, predicted, v.sqrt());
            let [up, down] = both.map(|ln_l| ln_l - here);
            // Of g e + h e^2 / 2 with e of variance v: the mean h v / 2, and a variance of g^2 v + (h v)^2 / 2.
            let bent = 0.5 * (up + down);
            variance += (0.5 * (up - down)).powi(2) + 2.0 * bent * bent;
            mean += bent;
        }
        variance + mean * mean
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
        let (v, units) = (process.variance(z), &process.units);
        let here = Shape::at(target, measured, predicted).unwrap_or(Shape::OF_PERFECT_FIT);
        let known = components.iter().filter(|c| v > 0.0 && c.noise.is_finite());
        // How far the prediction is from the measured curve along each component, by a slope that a perfect fit's curvature gives.
        let missed = known.map(|Component { direction, noise }| {
            let step = SHORT * noise.sqrt();
            let at = |by| target.ln_likelihood_of(&moved(predicted, units, direction, by));
            Some((
                direction,
                *noise,
                noise * here.flatter * (at(step)? - at(-step)?) / (2.0 * step),
            ))
        });
        let missed: Vec<_> = missed.collect::<Option<_>>()?;
        // The best curve, and the log of the mean over its value, where the likelihood is of this shape there.
        let best = |shape: Shape| {
            let (mut at, mut factor, mut squares) = (predicted.to_vec(), 0.0, 0.0);
            for (direction, noise, missed) in &missed {
                let unsure = v / (noise * shape.flatter);
                let step = unsure / (1.0 + unsure) * missed;
                factor -= 0.5 * step * step / v + 0.5 * unsure.ln_1p();
                squares += step * step / v / (1.0 + unsure);
                at = moved(&at, units, direction, step);
            }
            (at, factor - 0.5 * (shape.bent * squares).max(LEAST_BENT).ln_1p())
        };
        // From a likelihood as flat as a perfect fit's and from one as flat as at the prediction: there may be two best curves.
        let found = [Shape::OF_PERFECT_FIT, here].map(|mut shape| {
            let (mut at, mut factor) = best(shape);
            for _ in 0..BEST {
                let next = Shape::at(target, measured, &at).unwrap_or(Shape::OF_PERFECT_FIT);
                let settled = (next.flatter / shape.flatter - 1.0).abs() < SETTLED;
                (at, factor) = best(next);
                if settled {
                    break;
                }
                shape = next;
            }
            target.ln_likelihood_of(&at).map(|ln_l| ln_l + factor)
        });
        Some(found[0]?.max(found[1]?)).filter(|mean| !mean.is_nan())
    }
}

/// The principal axes of a curvature, which it has along any direction, in the span of these errors; none without one.
fn axes(errors: &[Vec<f64>], curvature: impl Fn(&[f64]) -> Option<f64>) -> Option<Vec<Component>> {
    let n = errors.len();
    if n == 0 {
        return Some(Vec::new());
    }
    let sum = |j: usize, k: usize, sign: f64| -> Vec<f64> {
        errors[j].iter().zip(&errors[k]).map(|(a, b)| a + sign * b).collect()
    };
    let mut matrix = DMatrix::zeros(n, n);
    for j in 0..n {
        matrix[(j, j)] = curvature(&errors[j])?;
        for k in 0..j {
            let both = curvature(&sum(j, k, 1.0))? - curvature(&sum(j, k, -1.0))?;
            (matrix[(j, k)], matrix[(k, j)]) = (0.25 * both, 0.25 * both);
        }
    }
    if matrix.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(matrix);
    let flat = FLAT * eigen.eigenvalues.max().max(1.0);
    let axis = |k: usize| {
        let mut direction = vec![0.0; errors[0].len()];
        for (error, share) in errors.iter().zip(eigen.eigenvectors.column(k).iter()) {
            direction.iter_mut().zip(error).for_each(|(d, e)| *d += share * e);
        }
        let curvature = eigen.eigenvalues[k];
        let noise = if curvature > flat { 1.0 / curvature } else { f64::INFINITY };
        Component { direction, noise }
    };
    Some((0..n).map(axis).collect())
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
                at = moved(&at, units, &c.direction, sd * x);
                weight *= (-0.5 * x * x).exp();
                rest /= steps;
            }
            let value = value(target.ln_likelihood_of(&at).expect("a likelihood"));
            sums = [sums[0] + weight, sums[1] + weight * value, sums[2] + weight * value * value];
        }
        let mean = sums[1] / sums[0];
        [mean, sums[2] / sums[0] - mean * mean]
    }

    fn nine_points() -> Vec<f64> {
        (0..9).map(|i| 0.4 * f64::from(i) - 1.6).collect()
    }

    /// A process through these values at nine points.
    fn process_through(values: &[f64]) -> GaussianProcess {
        let process = GaussianProcess::new(Data {
            d: 1,
            z: &nine_points(),
            weights: &[1.0; 9],
            chosen: &(0..9).collect::<Vec<_>>(),
            values,
            nuggets: &[1e-3; 9],
            offsets: vec![0.0; 3],
            units: vec![0.2, 0.7, 2.0],
            covariance: Covariance::Search,
        });
        process.expect("nine samples")
    }

    /// A process through the curves at nine points, and these.
    fn through_nine() -> (GaussianProcess, Vec<f64>) {
        let mut values = vec![0.0; 27];
        for (z, kept) in nine_points().iter().zip(values.chunks_exact_mut(3)) {
            Three.ln_likelihood(&[*z], kept).expect("never fails");
        }
        (process_through(&values), values)
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
            let bent: f64 = components.iter().map(|c| (v / c.noise).powi(2)).sum();
            let exact = sd * sd + 0.5 * bent;
            assert!((variance / exact - 1.0).abs() < 0.01, "{z:?}: {variance} {exact}");
            let [square, _] = over_errors(&Three, &process, &unknown, &z, |l| (l - plain).powi(2));
            let found = unknown.mean_square(&Three, &process.units, &predicted, v);
            assert!((found / square - 1.0).abs() < 0.01, "{z:?}: {found} {square}");
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
        // Far from all samples curves that fit and curves that do not are both likely, which no one normal density describes.
        let mut unsure = 0;
        for (z, most) in [
            (-2.4, 0.2),
            (-2.2, 0.2),
            (-2.0, 0.02),
            (-1.9, 0.01),
            (-0.9, 1e-6),
            (0.6, 1e-6),
            (1.7, 1e-4),
            (1.9, 0.01),
            (2.2, 0.2),
        ] {
            let z = [z];
            let predicted = at(&process, &z);
            let found = unknown.ln_mean(&Inferred, &process, &z, &predicted).expect("measured");
            let [mean, _] = over_errors(&Inferred, &process, &unknown, &z, |l| (l - found).exp());
            let plain = Inferred.ln_likelihood_of(&predicted).expect("a likelihood");
            assert!(mean.ln().abs() < most, "{z:?}: {mean}, log {found}");
            unsure += usize::from((found - plain).abs() > 0.5);
        }
        assert!(unsure > 3, "little is unknown");
    }

    #[test]
    fn outputs_that_never_change_leave_nothing_unknown() {
        let values = [0.0; 27];
        let process = process_through(&values);
        let unknown = Unknown::of_curves(&Inferred, &process, values.chunks_exact(3));
        assert!(unknown.directions().is_empty());
        let (z, predicted) = ([0.3], [0.0; 3]);
        let found = unknown.ln_mean(&Inferred, &process, &z, &predicted);
        assert_eq!(found, Inferred.ln_likelihood_of(&predicted));
    }

    #[test]
    fn where_nearly_everything_is_unknown_the_mean_is_that_over_all_errors_too() {
        let (process, values) = through_nine();
        let unknown = Unknown::of_curves(&Inferred, &process, values.chunks_exact(3));
        let Unknown::OfCurves { measured, components } = unknown else { panic!("curves") };
        // Of one component a million times as unsure as the likelihood is wide the mean is an integral along a line.
        let first = components.into_iter().next().expect("a component");
        let (z, v) = ([30.0], process.variance(&[30.0]));
        let by = (1e6 * first.noise / v).sqrt();
        let direction: Vec<f64> = first.direction.iter().map(|b| by * b).collect();
        let wide = Component { direction: direction.clone(), noise: first.noise / (by * by) };
        let unknown = Unknown::OfCurves { measured, components: vec![wide] };
        let along = |from: &[f64], x: f64| moved(from, &process.units, &direction, x * v.sqrt());
        let predicted = along(&MEASURED, 0.3);
        let found = unknown.ln_mean(&Inferred, &process, &z, &predicted).expect("measured");
        let (mut sum, step) = (0.0, 1e-4);
        for k in -60_000..60_000 {
            let x = step * f64::from(k);
            let ln_l = Inferred.ln_likelihood_of(&along(&predicted, x)).expect("a likelihood");
            sum += step * (ln_l - found - 0.5 * x * x).exp();
        }
        let mean = sum / std::f64::consts::TAU.sqrt();
        assert!(mean.ln().abs() < 0.1, "{mean}");
    }
}
