//! The energy of a pulse that is enough.

use dem_core::heat::Heat;
use dem_core::time_to_contact_ratio;
use serde::Serialize;
use smc_calib::Weighted;

use super::drawn::{Drawn, Predicted};
use crate::error::InputError;
use crate::pair::asked_heat::no_law;

/// The energy of a pulse that reaches a contact ratio.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnoughEnergy {
    /// The contact ratio a/R that is reached, however late.
    pub contact_ratio: f64,
    /// The probability with which the energy is to be enough.
    pub probability: f64,
    /// The energy that is enough with this probability, in the unit of the pulses; 0 where any is, none where no energy is.
    pub energy: Option<f64>,
    /// The least energy that is enough, over the draws; none where it is not known with 95 % probability that there is one.
    pub least_energy: Option<Predicted>,
}

/// Energies are asked for, and there is no pulse with a law of them.
pub(super) fn no_law_for_energies() -> InputError {
    no_law("--energy-for").found("no pulse whose amplitude goes with its energy")
}

/// Bisections of a factor of two between energies: to 1e-9 of them.
const BISECTIONS: usize = 30;
/// Most doublings, or halvings, of the calibrated energy.
const DOUBLINGS: usize = 60;

/// The least energy that is enough: 0 where any is, infinite where none is. `reached` says whether an energy is; nothing where it is
/// more than the model takes. More energy is never worse.
fn least(calibrated: f64, reached: impl Fn(f64) -> Option<bool>) -> f64 {
    let is_enough = |energy: &f64| reached(*energy) == Some(true);
    let halves = (0..DOUBLINGS as i32).map(|k| calibrated * 0.5f64.powi(k));
    let doubles = (0..DOUBLINGS as i32).map(|k| calibrated * 2f64.powi(k));
    let (mut low, mut high, mut found) = if is_enough(&calibrated) {
        match halves.into_iter().find(|energy| !is_enough(energy)) {
            Some(low) => (low, 2.0 * low, true),
            None => return 0.0,
        }
    } else {
        match doubles.into_iter().find(|energy| reached(*energy) != Some(false)) {
            Some(high) => (0.5 * high, high, is_enough(&high)),
            None => return f64::INFINITY,
        }
    };
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        match reached(middle) {
            Some(false) => low = middle,
            Some(true) => (high, found) = (middle, true),
            None => high = middle,
        }
    }
    if found { high } else { f64::INFINITY }
}

/// The energy that is enough for a contact ratio; `heated` gives the heat of a draw at an energy.
pub(super) fn enough(
    drawn: &[Drawn],
    (contact_ratio, probability): (f64, f64),
    calibrated: f64,
    heated: impl Fn(usize, f64) -> Option<Heat>,
) -> EnoughEnergy {
    let mut least_energies = Vec::with_capacity(drawn.len());
    for (place, Drawn { scene, sintering, kinetics, weight, .. }) in drawn.iter().enumerate() {
        let needed = time_to_contact_ratio(scene, *kinetics, sintering, contact_ratio);
        let found = needed.map_or(f64::INFINITY, |needed| {
            least(calibrated, |energy| {
                heated(place, energy).map(|heat| heat.reduced_time_at_end() >= needed)
            })
        });
        least_energies.push((found, *weight));
    }
    let all: f64 = least_energies.iter().map(|(_, weight)| weight).sum();
    let without: f64 = least_energies
        .iter()
        .filter(|(energy, _)| energy.is_infinite())
        .map(|(_, weight)| weight)
        .sum();
    let finite = || least_energies.iter().copied().filter(|(energy, _)| energy.is_finite());
    // The quantile over all draws, by that over those which have an energy.
    let share = probability * all / (all - without);
    let energy = (share <= 1.0).then(|| Weighted::new(finite()).quantile(share));
    let least_energy = if without <= 0.05 * all { Predicted::of(finite()) } else { None };
    let energy = energy.filter(|energy| energy.is_finite());
    EnoughEnergy { contact_ratio, probability, energy, least_energy }
}

#[cfg(test)]
mod tests {
    use super::least;

    #[test]
    fn the_least_energy_is_that_of_the_powder_wherever_the_search_begins_and_up_to_the_end_of_the_model()
     {
        for begin in [1e-6, 0.3, 27.9, 28.1, 2900.0, 1e12] {
            let found = least(begin, |energy| Some(energy >= 28.0));
            assert!((found / 28.0 - 1.0).abs() < 2e-9, "{begin}: {found}");
            // The model ends at 40, and at 20.
            let up_to = |end: f64| move |energy: f64| (energy <= end).then_some(energy >= 28.0);
            if begin < 40.0 {
                let found = least(begin, up_to(40.0));
                assert!((found / 28.0 - 1.0).abs() < 2e-9, "{begin}: {found}");
            }
            if begin < 20.0 {
                assert!(least(begin, up_to(20.0)).is_infinite());
            }
            assert!(least(begin, |_| Some(false)).is_infinite());
            assert!(least(begin, |_| None).is_infinite());
            assert!(least(begin, |_| Some(true)).abs() < f64::MIN_POSITIVE);
        }
    }
}
