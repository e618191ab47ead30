//! Frenkel's balance at constant volume.

use super::Kinetic;
use crate::{PairScene, Sintering, SolveError};

/// Pokluda's law: surface tension does the work of viscous flow while two equal spheres keep their
/// volume. With theta the half angle of the neck and `c = cos(theta)`,
///
/// ```text
/// d theta/dt = (1/tau_s) 2^(-5/3) cos sin (2 - cos)^(1/3) / ((1 - cos) (1 + cos)^(1/3))
/// a/R        = sin [4 / ((1 + cos)^2 (2 - cos))]^(1/3)
/// ```
///
/// It starts like [`Frenkel`](super::Frenkel), `x = t/tau_s`, and ends at `2^(1/3)` by itself, in
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
const CBRT_2: f64 = 1.259_921_049_894_873_2;
/// `2^(2/3)`, the overlap of the merged pair.
const CBRT_4: f64 = 1.587_401_051_968_199_4;
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
        for (ratio, time) in contact_ratio.iter_mut().zip(times_s) {
            let overlap = if self.start_integral.is_finite() {
                overlap_of(neck_shape_at(self.start_integral + (time - start_s) * scale))
            } else {
                self.start
            };
            *ratio = overlap.max(self.start).min(self.end).sqrt();
        }
    }
}

/// `w` of an overlap: the root of `4 w - 1/w^2 = 3 x / 2^(2/3)`, 1 beyond the merged pair.
#[inline]
fn neck_shape(overlap: f64) -> f64 {
    let target = (3.0 / CBRT_4) * overlap;
    if target >= 3.0 {
        return 1.0;
    }
    // A parabola through both ends with the slope of the first, within 0.005, that three
    // iterations of Newton's method refine to rounding.
    let mut w = EMPTY_NECK + target * (1.0 / 12.0 + target * 0.013_337_719_450_284_8);
    for _ in 0..3 {
        let inverse = 1.0 / w;
        let inverse_squared = inverse * inverse;
        w -= (4.0 * w - inverse_squared - target) / (4.0 + 2.0 * inverse_squared * inverse);
    }
    w
}

/// Overlap of `w`.
#[inline]
fn overlap_of(w: f64) -> f64 {
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

    #[inline]
    fn switch_overlap(&self) -> f64 {
        0.0
    }

    #[inline]
    fn rate_before_switch(&self, overlap: f64) -> f64 {
        self.rate_after_switch(overlap)
    }

    #[inline]
    fn rate_after_switch(&self, overlap: f64) -> f64 {
        let w = neck_shape(overlap);
        let squared = w * w;
        let cubed = squared * w;
        CBRT_2 / 9.0 * self.rate_per_s * (1.0 + 2.0 * cubed) * (1.0 - cubed) / (squared * squared)
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
