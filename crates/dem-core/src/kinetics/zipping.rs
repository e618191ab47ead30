//! Zipping: adhesive traction between the surfaces, accommodated by viscoelastic deformation.

use crate::lanes::Lanes;
use crate::sintering::{in_range, positive};
use crate::{PairScene, Powder, Sintering, SolveError};

/// Stage 2 of the paper:
/// `a/R = (63 pi^3/16)^(1/7) (delta_c/R)^(2/7) (2 C1 gamma t/R)^(1/7)` (eq. 4).
///
/// That is `x^(7/2) = B t` with `B = (63 pi^3/16) (delta_c/R)^2 (2 C1 gamma/R)`, and without explicit
/// time `dx/dt = (2/7) B x^(-5/2)`, which from the adhesive contact gives `x^(7/2) = x0^(7/2) + B t`.
///
/// Source: Y.Y. Lin, C.Y. Hui, A. Jagota, J. Colloid Interface Sci. 237 (2001) 267.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Zipping {
    /// `B` \[1/s\].
    pub(crate) b_per_s: f64,
    /// `x0^(7/2)`.
    pub(crate) start_power: f64,
}

impl Zipping {
    pub(crate) fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError> {
        positive("c1", sintering.c1, "the fluidity must be positive and finite")?;
        positive("delta_c", sintering.delta_c, "the cut-off distance must be positive and finite")?;
        let b_per_s = zipping_rate_per_s(scene.powder(), sintering);
        in_range("zipping rate B", b_per_s, "lower c1 or delta_c")?;
        // Below it numbers carry fewer digits, and the solvers would disagree in them.
        if b_per_s < f64::MIN_POSITIVE {
            return Err(SolveError::Derived {
                quantity: "zipping rate B [1/s]",
                value: b_per_s,
                remedy: "raise c1 or delta_c",
            });
        }
        Ok(Self { b_per_s, start_power: seven_halves(scene.x0()) })
    }

    /// `(2/7) B` \[1/s\].
    #[inline]
    #[must_use]
    pub fn rate_coefficient(&self) -> f64 {
        2.0 / 7.0 * self.b_per_s
    }

    /// `dx/dt = (2/7) B x^(-5/2)` \[1/s\], as numerator and denominator.
    #[inline(always)]
    #[must_use]
    pub fn rate_fraction<L: Lanes>(rate_coefficient: L, overlap: L) -> (L, L) {
        (rate_coefficient, overlap * overlap * overlap.sqrt())
    }

    /// Contact ratio `(x0^(7/2) + B t)^(1/7)`.
    #[inline]
    #[must_use]
    pub fn contact_ratio(&self, time_s: f64) -> f64 {
        (self.start_power + self.b_per_s * time_s).powf(1.0 / 7.0)
    }

    /// Time from the adhesive contact to an overlap, `(x^(7/2) - x0^(7/2))/B` \[s\].
    #[must_use]
    pub fn time_to_overlap(&self, overlap: f64) -> f64 {
        let growth = seven_halves(overlap) - self.start_power;
        if growth <= 0.0 { 0.0 } else { growth / self.b_per_s }
    }
}

/// Rate of zipping `B = (63 pi^3/16) (delta_c/R)^2 (2 C1 gamma/R)` in `x^(7/2) = B t` \[1/s\] (eq. 4).
#[must_use]
pub fn zipping_rate_per_s(powder: &Powder, sintering: &Sintering) -> f64 {
    let cut_off = sintering.delta_c / powder.radius_m;
    63.0 * std::f64::consts::PI.powi(3) / 16.0
        * cut_off
        * cut_off
        * (2.0 * sintering.c1 * powder.surface_tension_n_per_m / powder.radius_m)
}

/// `x^(7/2)`.
#[inline]
pub(crate) fn seven_halves(overlap: f64) -> f64 {
    overlap * overlap * overlap * overlap.sqrt()
}
