//! The regime map of Fig. 2.

use super::zipping::seven_halves;
use super::{Frenkel, Kinetic, RateCoefficients, Zipping, zipping_rate_per_s};
use crate::lanes::Lanes;
use crate::sintering::in_range;
use crate::{PairScene, Powder, Sintering, SolveError};

/// The map of Fig. 2 and of Lin et al.: `a = max(a0, a1, a2)` with eqs. 3, 4 and 5 in explicit time,
/// `x = max(x0, (B t)^(2/7), t/tau_s)`, up to `phi^2`.
///
/// Zipping and stretching cross at `x = (B tau_s)^(2/5)`, at the time `x tau_s`. Here C1 and delta_c
/// enter only as the product `C1 delta_c^2` (in B): data cannot tell them apart.
///
/// The contact rests at x0 for `t0 = min(x0^(7/2)/B, x0 tau_s)`, until the first branch overtakes it.
/// The rates without explicit time, `dx/dt = (2/7) B x^(-5/2)` below the crossing and `1/tau_s` above
/// it, give the same curve from then on. The Verlet solver takes these rates from the start: its curve
/// is the map moved to the left by t0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegimeMap {
    zipping: Zipping,
    stretching: Frenkel,
    start: f64,
    end: f64,
    crossing: f64,
    rest_s: f64,
}

/// The three lines of Fig. 2 in explicit time, without start and end: `a0/R` (eq. 3), `a1/R` (eq. 4) and `a2/R` (eq. 5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Regimes {
    /// Adhesive contact ratio `a0/R`.
    pub adhesive: f64,
    zipping_rate_per_s: f64,
    tau_s: f64,
}

impl Regimes {
    /// The lines of a powder. Parameters must be positive.
    #[must_use]
    pub fn new(powder: &Powder, sintering: &Sintering) -> Self {
        Self {
            adhesive: powder.adhesive_contact_ratio(),
            zipping_rate_per_s: zipping_rate_per_s(powder, sintering),
            tau_s: sintering.tau_s,
        }
    }

    /// Contact ratio of zipping, `a1/R = (B t)^(1/7)`.
    #[must_use]
    pub fn zipping(&self, time_s: f64) -> f64 {
        (self.zipping_rate_per_s * time_s).powf(1.0 / 7.0)
    }

    /// Contact ratio of stretching, `a2/R = (t/tau_s)^(1/2)`.
    #[must_use]
    pub fn stretching(&self, time_s: f64) -> f64 {
        (time_s / self.tau_s).sqrt()
    }

    /// Time of p1, where zipping leaves the adhesive contact, `(a0/R)^7/B` \[s\].
    #[must_use]
    pub fn p1_s(&self) -> f64 {
        self.adhesive.powi(7) / self.zipping_rate_per_s
    }

    /// Time of p2, where stretching overtakes zipping, `B^(2/5) tau_s^(7/5)` \[s\].
    #[must_use]
    pub fn p2_s(&self) -> f64 {
        self.tau_s.powf(1.4) * self.zipping_rate_per_s.powf(0.4)
    }
}

impl Kinetic for RegimeMap {
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        let zipping = Zipping { start_power: 0.0, ..Zipping::new(scene, sintering)? };
        let stretching = Frenkel::from_overlap(scene, sintering, 0.0)?;
        let start = scene.x0();
        let crossing = (zipping.b_per_s * sintering.tau_s).powf(0.4);
        in_range("crossing of zipping and stretching", crossing, "lower c1, delta_c or tau_s")?;
        let rest_s = (seven_halves(start) / zipping.b_per_s).min(start * sintering.tau_s);
        Ok(Self { zipping, stretching, start, end: scene.final_overlap(), crossing, rest_s })
    }

    const HAS_SWITCH: bool = true;

    #[inline]
    fn coefficients(&self) -> RateCoefficients<f64> {
        RateCoefficients {
            switch: self.crossing,
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

    #[inline]
    fn rest_s(&self) -> f64 {
        self.rest_s
    }

    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]) {
        let (lowest, highest) = (self.start.sqrt(), self.end.sqrt());
        let crossing_s = self.stretching.time_to_overlap(self.crossing);
        let before = times_s.partition_point(|&time| time < crossing_s);
        for (ratio, &time) in contact_ratio[..before].iter_mut().zip(times_s) {
            *ratio = self.zipping.contact_ratio(time).clamp(lowest, highest);
        }
        let (times_s, contact_ratio) = (&times_s[before..], &mut contact_ratio[before..]);
        self.stretching.contact_ratios_since(0.0, times_s, contact_ratio);
        for ratio in contact_ratio {
            *ratio = ratio.max(lowest);
        }
    }

    fn time_to_overlap(&self, overlap: f64) -> f64 {
        if overlap <= self.start {
            0.0
        } else if overlap > self.end {
            f64::INFINITY
        } else {
            self.zipping.time_to_overlap(overlap).min(self.stretching.time_to_overlap(overlap))
        }
    }
}
