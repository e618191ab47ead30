//! What is to be predicted.

use crate::error::{InputError, Mistake};
use crate::input::heat::{HeatFields, PULSE_ENERGIES};
use crate::input::observation_table::LARGEST_CONTACT_RATIO;

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
        self.check_energies()
    }

    /// Refuses an energy, a contact ratio or a probability that no pulse can have.
    fn check_energies(&self) -> Result<(), InputError> {
        let refused = |option: &str, found: f64, expected: String| {
            Err(InputError::new(option, Mistake::OutOfRange).found(found).expected(expected))
        };
        match (self.pulse_energy, self.enough) {
            (Some(energy), _) if !PULSE_ENERGIES.contains(&energy) => {
                let (least, most) = (PULSE_ENERGIES.start(), PULSE_ENERGIES.end());
                refused("--pulse-energy", energy, format!("{least:e} to {most:e}"))
            }
            (_, Some((ratio, _))) if !(ratio > 0.0 && ratio <= LARGEST_CONTACT_RATIO) => {
                let expected = format!("a contact ratio above 0, at most {LARGEST_CONTACT_RATIO}");
                refused("--energy-for", ratio, expected)
            }
            (_, Some((_, share))) if !(share > 0.0 && share < 1.0) => {
                refused("--probability", share, "above 0 and below 1".to_owned())
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Wanted;

    #[test]
    fn energies_contact_ratios_and_probabilities_that_no_pulse_can_have_are_refused() {
        let enough = |ratio, share| Wanted { enough: Some((ratio, share)), ..Wanted::default() };
        let at = |energy| Wanted { pulse_energy: Some(energy), ..Wanted::default() };
        for (wanted, place) in [
            (at(0.0), "--pulse-energy"),
            (at(-23.0), "--pulse-energy"),
            (at(f64::NAN), "--pulse-energy"),
            (enough(0.0, 0.95), "--energy-for"),
            (enough(3.0, 0.95), "--energy-for"),
            (enough(1.0, 1.0), "--probability"),
            (enough(1.0, f64::NAN), "--probability"),
        ] {
            let error = wanted.checked().expect_err(place).to_string();
            assert!(error.contains(place) && error.contains("expected"), "{error}");
        }
        assert_eq!(at(23.0).checked().and(enough(1.0, 0.95).checked()), Ok(()));
    }
}
