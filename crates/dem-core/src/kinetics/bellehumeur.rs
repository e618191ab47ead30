//! Coalescence of viscoelastic particles.

use super::pokluda::{CBRT_4, Neck, neck_shape, overlap_of};
use super::{Kinetic, RateCoefficients};
use crate::lanes::Lanes;
use crate::{PairScene, Sintering, SolveError};

/// [`Pokluda`](super::Pokluda)'s balance with the stresses of an upper-convected Maxwell melt of relaxation time lambda, in steady
/// flow at each instant. With theta the half angle of the neck, `tau_s = eta a0/gamma` and `alpha = 1`,
///
/// ```text
/// 8 (alpha lambda K1 theta')^2 + (2 alpha lambda K1 + tau_s K1^2/K2) theta' - 1 = 0
/// K1  = sin / ((1 + cos) (2 - cos))
/// K2  = 2^(-5/3) cos sin / ((1 + cos)^(4/3) (2 - cos)^(5/3))
/// a/R = sin [4 / ((1 + cos)^2 (2 - cos))]^(1/3)
/// ```
///
/// It is the balance `tau_s (K1/K2) e = 1 - 2 lambda e - 8 (lambda e)^2` of `e = K1 theta'`, the rate at which the pair becomes
/// shorter: in steady uniaxial flow at the rate 2 e the melt dissipates `1/((1 - 4 lambda e)(1 + 2 lambda e))` times what a
/// Newtonian one does. Elasticity slows the growth down; `lambda = 0` is Pokluda's law. The longer lambda is against tau_s,
/// the slower: up to where the pair would take many times lambda, whatever its viscosity.
///
/// Range: a quasi-steady state holds where the growth is slow against lambda. The law has no fast start by elasticity, which
/// is what zipping describes.
///
/// # Solution
///
/// In [`Pokluda`](super::Pokluda)'s variable w, from `4^(-1/3)` to 1, `e = (dw/dt)/w`, so that
///
/// ```text
/// dt = [P + sqrt(P^2 + 32 lambda^2)]/2 dw/w,   P = 2 lambda + tau_s 3 2^(4/3) w^2/(1 - w^3)
/// ```
///
/// which has no elementary integral. In `l = -ln(1 - w)` the integrand is smooth on the scale of 1 for every lambda: Gauss's
/// rule with ten points on steps of 1 and less is exact to rounding.
///
/// Source: C.T. Bellehumeur, M. Kontopoulou, J. Vlachopoulos, Rheol. Acta 37 (1998) 270.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bellehumeur {
    rate_per_s: f64,
    /// `lambda/tau_s`.
    relaxation: f64,
    start: f64,
    end: f64,
    /// l at the start.
    start_l: f64,
}

/// `3 2^(4/3)`.
const VISCOUS: f64 = 6.0 * super::pokluda::CBRT_2;

/// l of a pair that is merged to rounding.
const MERGED: f64 = 38.0;

/// Gauss's ten points on -1..1, which come in pairs, and their weights.
const GAUSS: [(f64, f64); 5] = [
    (0.148_874_338_981_631_21, 0.295_524_224_714_752_87),
    (0.433_395_394_129_247_2, 0.269_266_719_309_996_35),
    (0.679_409_568_299_024_4, 0.219_086_362_515_982_04),
    (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
    (0.973_906_528_517_171_7, 0.066_671_344_308_688_14),
];

impl Bellehumeur {
    /// `d(t/tau_s)/dl`.
    #[inline]
    fn slowness(&self, l: f64) -> f64 {
        let left = (-l).exp();
        let w = 1.0 - left;
        // (1 - w^3)/(1 - w), so that nothing is lost where the pair is nearly merged.
        let cubes = 1.0 + w + w * w;
        let elastic = self.relaxation * left * cubes;
        let p = 2.0 * elastic + VISCOUS * w * w;
        (p + (p * p + 32.0 * elastic * elastic).sqrt()) / (2.0 * w * cubes)
    }

    /// `t/tau_s` between two places, at most 1 apart.
    fn short_time(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let pair = |(at, weight): (f64, f64)| {
            weight * (self.slowness(middle - half * at) + self.slowness(middle + half * at))
        };
        half * GAUSS.into_iter().map(pair).sum::<f64>()
    }

    /// The place that is reached a time, in tau_s, after another, to which it is near.
    fn place_after(&self, from: f64, time: f64) -> f64 {
        let mut to = from + time / self.slowness(from);
        for _ in 0..20 {
            let change = (time - self.short_time(from, to)) / self.slowness(to);
            to += change;
            if change.abs() <= 1e-15 * to {
                break;
            }
        }
        to
    }
}

/// l of an overlap.
fn place_of(overlap: f64) -> f64 {
    -(1.0 - neck_shape(overlap)).ln()
}

impl Kinetic for Bellehumeur {
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        let rate_per_s = sintering.checked_stretching_rate()?;
        let relaxation = sintering.checked_relaxation()?;
        let start = scene.x0();
        Ok(Self {
            rate_per_s,
            relaxation,
            start,
            end: scene.final_overlap(),
            start_l: place_of(start).min(MERGED),
        })
    }

    const HAS_SWITCH: bool = false;

    #[inline]
    fn coefficients(&self) -> RateCoefficients<f64> {
        RateCoefficients {
            stretching: self.rate_per_s,
            relaxation: self.relaxation,
            ..RateCoefficients::NONE
        }
    }

    #[inline(always)]
    fn rate_before_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        Self::rate_after_switch(coefficients, overlap)
    }

    #[inline(always)]
    fn rate_after_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        let Neck { squared, left, growth } = Neck::at(overlap);
        let elastic = coefficients.relaxation * left;
        let p = L::splat(2.0) * elastic + L::splat(VISCOUS) * squared;
        let root = (p * p + L::splat(32.0) * elastic * elastic).sqrt();
        let numerator = L::splat(4.0 / 3.0 * CBRT_4) * coefficients.stretching * growth;
        (numerator, squared * (p + root))
    }

    #[inline]
    fn limit_overlap(&self) -> f64 {
        CBRT_4
    }

    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]) {
        // The place behind, with its time in tau_s, and the next one ahead, up to 1 from it.
        let (mut behind, mut passed) = (self.start_l, 0.0);
        let mut before = self.start;
        let mut ahead = (behind + 1.0).min(MERGED);
        let mut takes = self.short_time(behind, ahead);
        for (ratio, time_s) in contact_ratio.iter_mut().zip(times_s) {
            let time = time_s * self.rate_per_s;
            while passed + takes < time && ahead < MERGED {
                (behind, passed) = (ahead, passed + takes);
                ahead = (behind + 1.0).min(MERGED);
                takes = self.short_time(behind, ahead);
            }
            let overlap = if before >= self.end {
                self.end
            } else if passed + takes < time {
                CBRT_4
            } else {
                overlap_of(1.0 - (-self.place_after(behind, time - passed)).exp())
            };
            // Rounding must not make a neck shrink.
            before = overlap.clamp(before, self.end.max(before));
            *ratio = before.min(self.end).sqrt();
        }
    }

    fn time_to_overlap(&self, overlap: f64) -> f64 {
        if overlap <= self.start {
            return 0.0;
        }
        if overlap > self.end || overlap >= CBRT_4 {
            return f64::INFINITY;
        }
        let (mut at, to, mut time) = (self.start_l, place_of(overlap), 0.0);
        while at < to {
            let next = (at + 1.0).min(to);
            time += self.short_time(at, next);
            at = next;
        }
        time / self.rate_per_s
    }
}
