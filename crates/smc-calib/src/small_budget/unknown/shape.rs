//! Shape of a likelihood along a line to the measured curve.

use crate::target::Target;

/// First step of the curvature about the measured curve, and the fall of the log likelihood over the second one, by which it is taken:
/// well above rounding, and well within what is a parabola.
const STEP: f64 = 1e-3;
const FALL: f64 = 1e-4;
/// Step of slopes along a component, in standard deviations of the likelihood of a perfect fit, and along the line to the measured
/// curve, of its length.
pub(super) const SHORT: f64 = 1e-2;
/// Slope along the line to the measured curve below which outputs count as measured.
const MEASURED: f64 = 1e-4;

/// How a likelihood near some outputs differs from a normal one with the curvature of a perfect fit.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Times that it is as flat: the slope along the line to the measured curve by that curvature, over the true slope.
    pub(super) flatter: f64,
    /// Curvature along that line beyond that of a normal one of this slope, over the square of the slope.
    pub(super) bent: f64,
}

impl Shape {
    pub(super) const OF_PERFECT_FIT: Self = Self { flatter: 1.0, bent: 0.0 };

    /// None where a slope or the perfect fit's curvature is not positive, or where the outputs are nearly the measured ones.
    pub(super) fn at(target: &dyn Target, measured: &[f64], outputs: &[f64]) -> Option<Self> {
        let on_line = |share: f64| {
            let of = |(o, y): (&f64, &f64)| o + share * (y - o);
            let at: Vec<f64> = outputs.iter().zip(measured).map(of).collect();
            target.ln_likelihood_of(&at)
        };
        let [before, here, after] = [on_line(-SHORT)?, on_line(0.0)?, on_line(SHORT)?];
        let slope = (after - before) / (2.0 * SHORT);
        let bend = (2.0 * here - before - after) / (SHORT * SHORT);
        if slope < MEASURED {
            return None;
        }
        let shape = Self {
            flatter: curvature(|by| on_line(1.0 + by))? / slope,
            bent: (bend - slope) / (slope * slope),
        };
        (shape.flatter > 0.0 && shape.flatter.is_finite() && shape.bent.is_finite())
            .then_some(shape)
    }
}

/// Minus the second derivative of a log likelihood at zero, near which it is a parabola.
pub(super) fn curvature(at: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    let here = at(0.0)?;
    let fall = |step: f64| Some(2.0 * here - at(step)? - at(-step)?);
    let step = STEP * (FALL / fall(STEP)?.max(f64::MIN_POSITIVE)).sqrt().clamp(1e-6, 1e3);
    Some(fall(step)? / (step * step))
}
