//! The parameters that are calibrated.

use crate::SolveError;

/// The sintering parameters, SI: the three of the paper in the form of eqs. 3 to 5 (not as printed in Table 3: see
/// [`printed`](crate::printed)), and a relaxation time. A law looks at those that it has, and at no other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sintering {
    /// Fluidity C1, the viscoelastic compliance rate \[1/(Pa s)\].
    pub c1: f64,
    /// Characteristic (viscous) sintering time tau_s \[s\], of the radius it was calibrated at.
    pub tau_s: f64,
    /// Cut-off distance of the adhesive traction delta_c \[m\].
    pub delta_c: f64,
    /// Relaxation time of the melt lambda \[s\], of [`Bellehumeur`](crate::kinetics::Bellehumeur)'s law; 0 for a melt without elasticity.
    pub lambda: f64,
}

impl Sintering {
    /// The same material at another radius: `tau_s = eta R/gamma` scales with the radius, C1,
    /// delta_c and lambda belong to the material.
    #[must_use]
    pub fn at_radius(self, calibrated_radius_m: f64, radius_m: f64) -> Self {
        Self { tau_s: self.tau_s * (radius_m / calibrated_radius_m), ..self }
    }

    pub(crate) fn checked_stretching_rate(&self) -> Result<f64, SolveError> {
        positive("tau_s", self.tau_s, "the sintering time must be positive and finite")?;
        let rate = 1.0 / self.tau_s;
        in_range("1/tau_s", rate, "raise tau_s")?;
        Ok(rate)
    }

    /// `lambda/tau_s`.
    pub(crate) fn checked_relaxation(&self) -> Result<f64, SolveError> {
        if !(0.0..f64::INFINITY).contains(&self.lambda) {
            let remedy = "the relaxation time must be finite and not negative";
            return Err(SolveError::Field { field: "lambda", value: self.lambda, remedy });
        }
        let relaxation = self.lambda / self.tau_s;
        in_range("lambda/tau_s", relaxation, "lower lambda or raise tau_s")?;
        Ok(relaxation)
    }
}

pub(crate) fn positive(
    field: &'static str,
    value: f64,
    remedy: &'static str,
) -> Result<(), SolveError> {
    if value > 0.0 && value.is_finite() {
        Ok(())
    } else {
        Err(SolveError::Field { field, value, remedy })
    }
}

/// Numbers the laws compute with: beyond these bounds products of a few of them overflow.
pub(crate) const LARGEST: f64 = 1e60;

pub(crate) fn in_range(
    quantity: &'static str,
    value: f64,
    remedy: &'static str,
) -> Result<(), SolveError> {
    if value.is_finite() && value <= LARGEST {
        Ok(())
    } else {
        Err(SolveError::Derived { quantity, value, remedy })
    }
}
