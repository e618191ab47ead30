//! Frenkel's balance at constant volume.

use std::sync::LazyLock;

use super::{Kinetic, RateCoefficients};
use crate::lanes::{F64x8, Lanes, WIDTH};
use crate::{PairScene, Sintering, SolveError};

/// Pokluda's law: surface tension does the work of viscous flow while two equal spheres keep their
/// volume. With theta the half angle of the neck and `c = cos(theta)`,
///
/// ```text
/// d theta/dt = (1/tau_s) 2^(-5/3) cos sin (2 - cos)^(1/3) / ((1 - cos) (1 + cos)^(1/3))
/// a/R        = sin [4 / ((1 + cos)^2 (2 - cos))]^(1/3)
/// ```
///
/// It starts like [`Frenkel`](super::Frenkel), `x = t/tau_s`, and approaches `2^(1/3)` in
/// infinite time; a smaller phi stops it.
///
/// # Exact solution
///
/// With `2 w^3 = (2 - c)/(1 + c)`, w running from `4^(-1/3)` (no neck) to 1 (merged), both equations
/// become elementary:
///
/// ```text
/// x       = (2^(2/3)/3) (4 w - 1/w^2)
/// dx/dt   = (2^(1/3)/9) (1 + 2 w^3) (1 - w^3) / w^4 / tau_s
/// t/tau_s = 2^(4/3) [F(w) - F(w_start)],   F'(w) = 3w/(1 - w^3),
/// F(w)    = -ln(1 - w) + (1/2) ln(1 + w + w^2) - sqrt(3) atan((2w + 1)/sqrt(3))
/// ```
///
/// The overlap is computed from a series in `exp(-F(w))` with an absolute error of rounding: a/R within 2e-14,
/// which for the smallest necks (a/R = 0.03) is 6e-13 of it.
///
/// Source: O. Pokluda, C.T. Bellehumeur, J. Vlachopoulos, AIChE J. 43 (1997) 3253.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pokluda {
    rate_per_s: f64,
    start: f64,
    end: f64,
    /// `F(w_start)`.
    start_integral: f64,
}

/// `2^(1/3)`.
pub(super) const CBRT_2: f64 = 1.259_921_049_894_873_2;
/// `2^(2/3)`, the overlap of the merged pair.
pub(super) const CBRT_4: f64 = 1.587_401_051_968_199_4;
/// `w` where there is no neck, `4^(-1/3)`.
const EMPTY_NECK: f64 = 0.629_960_524_947_436_6;
/// `2^(4/3)`.
const TIME_SCALE: f64 = 2.0 * CBRT_2;

impl Pokluda {
    pub(crate) fn from_overlap(
        scene: &PairScene,
        sintering: &Sintering,
        start: f64,
    ) -> Result<Self, SolveError> {
        Ok(Self {
            rate_per_s: sintering.checked_stretching_rate()?,
            start,
            end: scene.final_overlap(),
            start_integral: time_integral(neck_shape(start)),
        })
    }

    pub(crate) fn contact_ratios_since(
        &self,
        start_s: f64,
        times_s: &[f64],
        contact_ratio: &mut [f64],
    ) {
        let scale = self.rate_per_s / TIME_SCALE;
        // Rounding must not make a neck shrink.
        let mut before = self.start;
        for (ratios, times) in contact_ratio.chunks_mut(WIDTH).zip(times_s.chunks(WIDTH)) {
            let mut decays = F64x8::splat(0.0);
            for (decay, time) in decays.0.iter_mut().zip(times) {
                *decay = (-(self.start_integral + (time - start_s) * scale)).exp();
            }
            let overlaps = OVERLAP.at(decays);
            for (ratio, overlap) in ratios.iter_mut().zip(overlaps.0) {
                before = overlap.clamp(before, self.end.max(before));
                *ratio = before.min(self.end).sqrt();
            }
        }
    }
}

/// The overlap as a function of the decay `exp(-F(w))`, which falls exponentially in time, from
/// [`LARGEST_DECAY`] without a neck to 0 for the merged pair.
///
/// The function is analytic; its nearest singularity, at `w = 0`, is so far away that the terms of
/// its Chebyshev series fall 5.6 times each: these are exact to rounding.
static OVERLAP: LazyLock<Series> = LazyLock::new(|| {
    let angle = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / TERMS as f64;
    let values: [f64; TERMS] = std::array::from_fn(|k| {
        let decay = 0.5 * LARGEST_DECAY * (1.0 + angle(k).cos());
        overlap_of(neck_shape_at(-decay.ln()))
    });
    Series(std::array::from_fn(|j| {
        let sum: f64 =
            values.iter().enumerate().map(|(k, value)| value * (j as f64 * angle(k)).cos()).sum();
        sum * if j == 0 { 1.0 } else { 2.0 } / TERMS as f64
    }))
});

const TERMS: usize = 24;

/// A little above `exp(-F(4^(-1/3)))`.
const LARGEST_DECAY: f64 = 1.273;

/// A Chebyshev series on `0..LARGEST_DECAY`.
struct Series([f64; TERMS]);

impl Series {
    /// Clenshaw's recurrence, for several arguments at once.
    #[inline]
    fn at(&self, decays: F64x8) -> F64x8 {
        let z = decays * F64x8::splat(2.0 / LARGEST_DECAY) - F64x8::splat(1.0);
        let twice = z + z;
        let (mut b1, mut b2) = (F64x8::splat(0.0), F64x8::splat(0.0));
        for &coefficient in self.0[1..].iter().rev() {
            (b1, b2) = (twice * b1 - b2 + F64x8::splat(coefficient), b1);
        }
        z * b1 - b2 + F64x8::splat(self.0[0])
    }
}

/// `w` of an overlap: the root of `4 w - 1/w^2 = 3 x / 2^(2/3)`; 1 beyond the merged pair.
#[inline(always)]
pub(super) fn neck_shape<L: Lanes>(overlap: L) -> L {
    let target = (L::splat(3.0 / CBRT_4) * overlap).min(L::splat(3.0));
    // A parabola through both ends with the slope of the first, within 0.003, that three
    // iterations of Newton's method refine to rounding.
    let curve = L::splat(1.0 / 12.0) + target * L::splat(0.013_337_719_450_284_8);
    let mut w = L::splat(EMPTY_NECK) + target * curve;
    for _ in 0..3 {
        // (4 w - 1/w^2 - target) / (4 + 2/w^3), with w^3 above and below.
        let cubed = w * w * w;
        let four = L::splat(4.0);
        w = w - ((four * w - target) * cubed - w) / (four * cubed + L::splat(2.0));
    }
    w
}

/// What the rate of stretching has of the neck.
pub(super) struct Neck<L> {
    /// `w^2`.
    pub(super) squared: L,
    /// `1 - w^3`, 0 for the merged pair.
    pub(super) left: L,
    /// `(1 + 2 w^3) (1 - w^3)`.
    pub(super) growth: L,
}

impl<L: Lanes> Neck<L> {
    #[inline(always)]
    pub(super) fn at(overlap: L) -> Self {
        let w = neck_shape(overlap);
        let squared = w * w;
        let cubed = squared * w;
        let one = L::splat(1.0);
        let left = (one - cubed).max(L::splat(0.0));
        Self { squared, left, growth: (one + L::splat(2.0) * cubed) * left }
    }
}

/// Overlap of `w`.
#[inline]
pub(super) fn overlap_of(w: f64) -> f64 {
    CBRT_4 / 3.0 * (4.0 * w - 1.0 / (w * w))
}

/// `F(w)`; infinite for the merged pair.
fn time_integral(w: f64) -> f64 {
    -(1.0 - w).ln() + bounded_part(w)
}

fn bounded_part(w: f64) -> f64 {
    let root_3 = 3f64.sqrt();
    0.5 * (1.0 + w + w * w).ln() - root_3 * ((2.0 * w + 1.0) / root_3).atan()
}

/// Inverse of [`time_integral`].
///
/// In `l = -ln(1 - w)` the slope of F is `3w/(1 + w + w^2)`, between 0.93 and 1 for every w that
/// occurs, so that Newton's method converges from anywhere.
fn neck_shape_at(integral: f64) -> f64 {
    let mut l = (integral - bounded_part(1.0)).max(0.0);
    for _ in 0..12 {
        let w = 1.0 - (-l).exp();
        let slope = 3.0 * w / (1.0 + w + w * w);
        let change = (l + bounded_part(w) - integral) / slope.max(0.9);
        l = (l - change).max(0.9);
        if change.abs() <= 1e-15 * l {
            break;
        }
    }
    1.0 - (-l).exp()
}

impl Kinetic for Pokluda {
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
    fn rate_after_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        let Neck { squared, growth, .. } = Neck::at(overlap);
        (L::splat(CBRT_2 / 9.0) * coefficients.stretching * growth, squared * squared)
    }

    #[inline]
    fn limit_overlap(&self) -> f64 {
        CBRT_4
    }

    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]) {
        self.contact_ratios_since(0.0, times_s, contact_ratio);
    }

    fn time_to_overlap(&self, overlap: f64) -> f64 {
        if overlap <= self.start {
            return 0.0;
        }
        if overlap > self.end || overlap >= CBRT_4 {
            return f64::INFINITY;
        }
        let integral = time_integral(neck_shape(overlap)) - self.start_integral;
        (TIME_SCALE * integral / self.rate_per_s).max(0.0)
    }
}
