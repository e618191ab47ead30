//! The paper's kinetics.

use super::{Frenkel, Kinetic, RateCoefficients, Zipping};
use crate::lanes::Lanes;
use crate::{PairScene, Sintering, SolveError};

/// The paper's three stages: adhesive contact `x0` (eq. 3), [`Zipping`] (eq. 4) up to the knee
/// `a_ve`, then [`Frenkel`]'s stretching (eq. 5) from there.
///
/// The *rates* switch; it is not the maximum of three curves: after the knee x grows linearly from
/// where stage 2 left it,
///
/// - `x = (x0^(7/2) + B t)^(2/7)` up to `t_ve`,
/// - `x = x_ve + (t - t_ve)/tau_s` after it, up to `phi^2`.
///
/// Where fast stretching follows slow zipping, the time since the knee carries the rounding of the knee's time:
/// a relative error of a/R of `1e-15 t_ve/(tau_s x)`, below 1e-13 as long as `t_ve < 100 tau_s x`.
///
/// C1 shows in how long the knee takes, delta_c in its height, tau_s in the slope after it. Stage 2
/// is absent where `a_ve` is below the starting contact, stage 3 where it is above phi.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThreeStage {
    zipping: Zipping,
    stretching: Frenkel,
    knee: Switch,
}

/// The point at which one branch of a law gives way to the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Switch {
    /// Overlap, between the start and the end of the scene.
    pub(crate) overlap: f64,
    pub(crate) time_s: f64,
}

impl Switch {
    /// The knee of a scene, not below its start and not beyond its end.
    pub(crate) fn knee(scene: &PairScene, sintering: &Sintering, zipping: &Zipping) -> Self {
        let ratio = knee_contact_ratio(sintering.delta_c, scene.radius_m());
        let overlap = (ratio * ratio).clamp(scene.x0(), scene.final_overlap());
        Self { overlap, time_s: zipping.time_to_overlap(overlap) }
    }

    /// Fills the places before the switch with `zipping` and returns how many there are.
    pub(crate) fn zip(
        &self,
        zipping: &Zipping,
        times_s: &[f64],
        contact_ratio: &mut [f64],
    ) -> usize {
        let before = times_s.partition_point(|&time| time < self.time_s);
        let highest = self.overlap.sqrt();
        for (ratio, &time) in contact_ratio[..before].iter_mut().zip(times_s) {
            *ratio = zipping.contact_ratio(time).min(highest);
        }
        before
    }
}

/// Contact ratio of the knee, `a_ve/R = (63 pi^3)^(1/5) (delta_c/(8R))^(2/5)`: where eqs. 4 and 5 cross
/// for `tau_s = R/(8 C1 gamma)` (Lin et al.). It depends on delta_c alone.
#[must_use]
pub fn knee_contact_ratio(delta_c_m: f64, radius_m: f64) -> f64 {
    let cut_off = delta_c_m / (8.0 * radius_m);
    (63.0 * std::f64::consts::PI.powi(3) * cut_off * cut_off).powf(0.2)
}

impl Kinetic for ThreeStage {
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        let zipping = Zipping::new(scene, sintering)?;
        let knee = Switch::knee(scene, sintering, &zipping);
        let stretching = Frenkel::from_overlap(scene, sintering, knee.overlap)?;
        Ok(Self { zipping, stretching, knee })
    }

    const HAS_SWITCH: bool = true;

    #[inline]
    fn coefficients(&self) -> RateCoefficients<f64> {
        RateCoefficients {
            switch: self.knee.overlap,
            zipping: self.zipping.rate_coefficient(),
            ..self.stretching.coefficients()
        }
    }

    #[inline(always)]
    fn rate_before_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        Zipping::rate_fraction(coefficients.zipping, overlap)
    }

    #[inline(always)]
    fn rate_after_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        Frenkel::rate_after_switch(coefficients, overlap)
    }

    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]) {
        let before = self.knee.zip(&self.zipping, times_s, contact_ratio);
        self.stretching.contact_ratios_since(
            self.knee.time_s,
            &times_s[before..],
            &mut contact_ratio[before..],
        );
    }

    fn time_to_overlap(&self, overlap: f64) -> f64 {
        if overlap <= self.knee.overlap {
            self.zipping.time_to_overlap(overlap)
        } else {
            self.knee.time_s + self.stretching.time_to_overlap(overlap)
        }
    }
}
