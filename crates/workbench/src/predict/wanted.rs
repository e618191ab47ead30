//! What is to be predicted.

use crate::error::{InputError, Mistake};
use crate::input::heat::HeatFields;

/// What is to be predicted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Contact ratios whose times are asked for.
    pub targets: Vec<f64>,
    /// Times \[s\] whose contact ratios are asked for.
    pub after_s: Vec<f64>,
    /// Radius of the pair \[m\]; the calibrated one where there is none.
    pub radius_m: Option<f64>,
    /// Whether contact ratios are given as measured, with noise, too.
    pub with_noise: bool,
    /// Another heat than that of the calibration.
    pub heat: Option<HeatFields>,
    /// Another energy of its pulse.
    pub pulse_energy: Option<f64>,
    /// A contact ratio whose energy is asked for, and the probability with which it is to be enough.
    pub enough: Option<(f64, f64)>,
}

impl Wanted {
    pub(super) fn checked(&self) -> Result<(), InputError> {
        let nothing = || InputError::new("predict", Mistake::MissingField);
        let of_heat = self.heat.is_some() || self.pulse_energy.is_some() || self.enough.is_some();
        if self.targets.is_empty() && self.after_s.is_empty() && !of_heat {
            return Err(nothing()
                .found("nothing to predict")
                .expected("--contact-ratio A/R, --coalescence PERCENT or --after SECONDS")
                .help("calibrate predict --posterior results/pa12 --contact-ratio 0.9"));
        }
        if self.with_noise && self.after_s.is_empty() {
            return Err(nothing().found("--with-noise without a time").expected(
                "--after SECONDS: a contact ratio is measured, a sintering time is not",
            ));
        }
        Ok(())
    }
}
