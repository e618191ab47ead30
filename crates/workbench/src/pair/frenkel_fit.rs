//! The best Frenkel curve: least squares in tau_s, the one-parameter model that the paper compares with.

use dem_core::{Kinetics, Sintering};
use smc_calib::SimError;

use crate::pair::model::NeckGrowth;

/// The sintering time \[s\] of the Frenkel curve (at the plan's phi) with the least sum of squares.
///
/// The sum has several minima in tau_s, as curves leave and join the plateau: a scan of ten decades
/// around the last observation, then golden-section search in the best bracket, to 1e-10 in ln tau_s.
///
/// None without an observation after first contact, where every tau_s fits alike.
pub(crate) fn best_tau_s(model: &NeckGrowth, observed: &[f64]) -> Result<Option<f64>, SimError> {
    if model.last_s() <= 0.0 {
        return Ok(None);
    }
    best_tau_s_of(Kinetics::Frenkel, model, observed).map(Some)
}

/// The same for other kinetics whose only parameter is tau_s (`pokluda`).
pub(crate) fn best_tau_s_of(
    kinetics: Kinetics,
    model: &NeckGrowth,
    observed: &[f64],
) -> Result<f64, SimError> {
    let of_kinetics = model.with_kinetics(kinetics);
    let best = least_squares(model.last_s(), observed, |sintering, curve| {
        of_kinetics.curve(sintering, curve)
    })?;
    Ok(best.tau_s)
}

/// A sintering time with the least sum of squares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Best {
    /// The sintering time \[s\].
    pub(crate) tau_s: f64,
    /// The sum of squares of the residuals.
    pub(crate) sum_of_squares: f64,
}

/// The same for any curve that depends on tau_s alone, with the last observation at `last_s` \[s\] after first contact.
pub(crate) fn least_squares<E>(
    last_s: f64,
    observed: &[f64],
    mut curve_of: impl FnMut(&Sintering, &mut [f64]) -> Result<(), E>,
) -> Result<Best, E> {
    const SCAN: usize = 400;
    let mut curve = vec![0.0; observed.len()];
    let mut cost = |ln_tau: f64| -> Result<f64, E> {
        curve_of(
            &Sintering { c1: 1.0, tau_s: ln_tau.exp(), delta_c: 1.0, lambda: 0.0 },
            &mut curve,
        )?;
        Ok(observed.iter().zip(&curve).map(|(o, c)| (o - c) * (o - c)).sum())
    };
    let last = last_s.max(f64::MIN_POSITIVE);
    let centre = last.ln();
    let half_width = 5.0 * std::f64::consts::LN_10;
    let step = 2.0 * half_width / SCAN as f64;
    let at = |k: usize| centre - half_width + step * k as f64;
    let mut best = (0, f64::INFINITY);
    for k in 0..=SCAN {
        let value = cost(at(k))?;
        if value < best.1 {
            best = (k, value);
        }
    }
    let (mut lower, mut upper) = (at(best.0) - step, at(best.0) + step);
    let ratio = (5f64.sqrt() - 1.0) / 2.0;
    let (mut left, mut right) = (upper - ratio * (upper - lower), lower + ratio * (upper - lower));
    let (mut at_left, mut at_right) = (cost(left)?, cost(right)?);
    while upper - lower > 1e-10 {
        if at_left <= at_right {
            (upper, right, at_right) = (right, left, at_left);
            left = upper - ratio * (upper - lower);
            at_left = cost(left)?;
        } else {
            (lower, left, at_left) = (left, right, at_right);
            right = lower + ratio * (upper - lower);
            at_right = cost(right)?;
        }
    }
    let middle: f64 = 0.5 * (lower + upper);
    Ok(Best { tau_s: middle.exp(), sum_of_squares: at_left.min(at_right) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;

    #[test]
    fn exact_frenkel_data_give_back_their_sintering_time() {
        let options = PairOptions { material: Some(Material::Pa12), ..PairOptions::default() };
        let plan = options.plan().expect("a plan").plan;
        let model = NeckGrowth::of(&plan).expect("a model");
        let mut data = vec![0.0; model.times_s().len()];
        let sintering = dem_core::Sintering { c1: 1.0, tau_s: 3.25, delta_c: 1.0, lambda: 0.0 };
        model.with_kinetics(Kinetics::Frenkel).curve(&sintering, &mut data).expect("a curve");
        let tau = best_tau_s(&model, &data).expect("a fit").expect("times after zero");
        assert!((tau / 3.25 - 1.0).abs() < 1e-6, "{tau}");
    }
}
