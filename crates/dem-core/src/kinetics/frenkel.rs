//! Stretching: viscous flow driven by surface tension.

use super::{Kinetic, RateCoefficients};
use crate::lanes::Lanes;
use crate::{PairScene, Sintering, SolveError};

/// Frenkel's law, stage 3 of the paper: `a/R = (t/tau_s)^(1/2)` (eq. 5), as a rate `dx/dt = 1/tau_s`.
///
/// From the adhesive contact: `x = x0 + t/tau_s`, up to `phi^2`. An approximation for small necks
/// that the paper uses up to full coalescence.
///
/// Source: J. Frenkel, J. Phys. (USSR) 9 (1945) 385.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frenkel {
    rate_per_s: f64,
    start: f64,
    end: f64,
}

impl Frenkel {
    pub(crate) fn from_overlap(
        scene: &PairScene,
        sintering: &Sintering,
        start: f64,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            rate_per_s: sintering.checked_stretching_rate()?,
            start,
            end: scene.final_overlap(),
        })
    }

    pub(crate) fn contact_ratios_since(
        &self,
        start_s: f64,
        times_s: &[f64],
        contact_ratio: &mut [f64],
    ) {
        for (ratio, time) in contact_ratio.iter_mut().zip(times_s) {
            *ratio = (self.start + (time - start_s) * self.rate_per_s).min(self.end).sqrt();
        }
    }
}

impl Kinetic for Frenkel {
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        Self::from_overlap(scene, sintering, scene.x0())
    }

    const HAS_SWITCH: bool = false;

    #[inline]
    fn coefficients(&self) -> RateCoefficients<f64> {
        RateCoefficients { stretching: self.rate_per_s, ..RateCoefficients::NONE }
    }

    #[inline(always)]
    fn rate_before_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        Self::rate_after_switch(coefficients, overlap)
    }

    #[inline(always)]
    fn rate_after_switch<L: Lanes>(coefficients: &RateCoefficients<L>, _overlap: L) -> (L, L) {
        (coefficients.stretching, L::splat(1.0))
    }

    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]) {
        self.contact_ratios_since(0.0, times_s, contact_ratio);
    }

    fn time_to_overlap(&self, overlap: f64) -> f64 {
        if overlap > self.end {
            f64::INFINITY
        } else {
            ((overlap - self.start) / self.rate_per_s).max(0.0)
        }
    }
}
