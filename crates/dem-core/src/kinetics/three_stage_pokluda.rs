//! The paper's kinetics with the last stage at constant volume.

use super::three_stage::Switch;
use super::{Kinetic, Pokluda, RateCoefficients, Zipping};
use crate::lanes::Lanes;
use crate::{PairScene, Sintering, SolveError};

/// [`ThreeStage`](super::ThreeStage) with stage 3 replaced by [`Pokluda`]: adhesive contact,
/// [`Zipping`] (eq. 4) up to the same knee, and from its overlap on Frenkel's balance at constant volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThreeStagePokluda {
    zipping: Zipping,
    stretching: Pokluda,
    knee: Switch,
}

impl Kinetic for ThreeStagePokluda {
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        let zipping = Zipping::new(scene, sintering)?;
        let knee = Switch::knee(scene, sintering, &zipping);
        let stretching = Pokluda::from_overlap(scene, sintering, knee.overlap)?;
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
        Pokluda::rate_after_switch(coefficients, overlap)
    }

    #[inline]
    fn limit_overlap(&self) -> f64 {
        self.stretching.limit_overlap()
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
