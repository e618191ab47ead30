//! The heat that is predicted for, and the energy of a pulse that is enough.

use std::path::Path;

use dem_core::heat::Heat;
use dem_core::time_to_contact_ratio;
use serde::Serialize;
use smc_calib::Weighted;

use super::drawn::{Drawn, Predicted};
use super::wanted::Wanted;
use crate::error::{InputError, Mistake};
use crate::input::heat::{HeatFields, field_of};
use crate::input::text_file;
use crate::input::toml_fields::Document;
use crate::pair::heat::{HeatPlan, HistoryPlan, LawPlan, NoHeat};
use crate::pair::parameter::ParameterName;
use crate::plan::PairPlan;

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

/// Reads the `[heat]` of a file: of one with nothing else, or of an experiment's description.
///
/// # Errors
///
/// [`InputError`] for a file without `[heat]`, or one with mistakes in it.
pub fn read_heat(path: &Path) -> Result<HeatFields, InputError> {
    let (name, text) = (path.display().to_string(), text_file::read(path)?);
    let document = Document::parse(&name, &text)?;
    let Some(heat) = document.top().table("heat")? else {
        return Err(InputError::new(name, Mistake::MissingField)
            .in_field("[heat]")
            .found("missing")
            .expected("a table [heat] with history and mobility")
            .help("crates/guide/pages/heat.md has its fields"));
    };
    HeatFields::read(text_file::folder_of(path), &heat)
}

/// The heat to predict for: that of the calibration, with another history or another energy where that is wanted.
///
/// # Errors
///
/// [`InputError`] for a heat that the posterior says nothing of.
pub(super) fn heat_of(pair: &PairPlan, wanted: &Wanted) -> Result<Option<HeatPlan>, InputError> {
    let mut heat = match &wanted.heat {
        None => pair.heat.clone(),
        Some(fields) => Some(asked(pair, fields.plan()?)?),
    };
    if let Some(energy) = wanted.pulse_energy {
        let other = heat.as_ref().and_then(|heat| heat.with_energy(energy));
        heat = Some(other.ok_or_else(|| no_pulse("--pulse-energy"))?);
    }
    let Some(mut heat) = heat else { return Ok(None) };
    let own = pair.heat.as_ref();
    let of_another = own.and_then(HeatPlan::energy) != heat.energy();
    if heat.law == LawPlan::Direct
        && own.is_some_and(|own| own.law == LawPlan::Direct)
        && of_another
    {
        return Err(no_law());
    }
    // Without a radius of its own a calibrated cooling time is that of the calibrated pair.
    if let HistoryPlan::Pulse { cooling_radius_m, .. } = &mut heat.history {
        cooling_radius_m.get_or_insert(pair.powder.radius_m);
    }
    Ok(Some(heat))
}

/// A heat of the user's, with what the calibration knows and the file does not say.
fn asked(pair: &PairPlan, mut heat: HeatPlan) -> Result<HeatPlan, InputError> {
    let Some(own) = &pair.heat else { return Ok(heat) };
    if own.law != heat.law {
        let words = |law: &LawPlan| match serde_json::to_value(law) {
            Ok(value) => value.to_string(),
            Err(_) => law.name().to_owned(),
        };
        return Err(InputError::new("--heat", Mistake::Conflict)
            .in_field("heat.mobility")
            .found(words(&heat.law))
            .expected(format_args!("{}, which the posterior was calibrated with", words(&own.law)))
            .help("C1, tau_s and the constants of the law belong to it"));
    }
    heat.frozen_below_k = heat.frozen_below_k.or(own.frozen_below_k);
    for (name, value) in &own.known {
        heat.known.entry(*name).or_insert(*value);
    }
    if let (
        HistoryPlan::Pulse {
            energy: own_energy,
            ambient_temperature_k: own_ambient_k,
            cooling_radius_m: of,
        },
        HistoryPlan::Pulse { energy, ambient_temperature_k, cooling_radius_m },
    ) = (&own.history, &mut heat.history)
    {
        *energy = energy.or(*own_energy);
        *ambient_temperature_k = ambient_temperature_k.or(*own_ambient_k);
        *cooling_radius_m = cooling_radius_m.or(*of);
    }
    Ok(heat)
}

fn no_pulse(option: &str) -> InputError {
    InputError::new(option, Mistake::Conflict)
        .found("an energy, and no pulse that has it")
        .expected("a posterior, or a --heat, with history = \"pulse\"")
}

/// Energies are asked for, and there is no pulse with a law of them.
pub(super) fn no_law_for_energies() -> InputError {
    InputError { source_name: "--energy-for".into(), ..no_law() }
        .found("no pulse whose amplitude goes with its energy")
}

/// A direct amplitude says nothing of other energies.
fn no_law() -> InputError {
    InputError::new("--pulse-energy", Mistake::Conflict)
        .found("another energy than the calibrated one, and mobility = \"direct\"")
        .expected("a law of the amplitude over the energy")
        .help("calibrate with mobility = \"threshold-power\", \"arrhenius\" or \"wlf\"")
}

/// Numbers of a heat that a draw cannot give.
pub(super) fn refused(error: &NoHeat) -> InputError {
    let refused = InputError::new("--heat", Mistake::MissingField).found(error);
    match error {
        NoHeat::Open(ParameterName::CoolingPower) => refused
            .expected("the power of R that the cooling time goes with: the radius is another one")
            .help("state cooling_power in [heat] of a file for --heat: 1 for a film of gas, 2 for conduction"),
        NoHeat::Open(name) => {
            refused.help(format_args!("state {} in [heat]", field_of(*name).unwrap_or_default()))
        }
        _ => refused,
    }
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
    let mut energies = Vec::with_capacity(drawn.len());
    for (place, Drawn { scene, sintering, kinetics, weight, .. }) in drawn.iter().enumerate() {
        let needed = time_to_contact_ratio(scene, *kinetics, sintering, contact_ratio);
        let found = needed.map_or(f64::INFINITY, |needed| {
            least(calibrated, |energy| {
                heated(place, energy).map(|heat| heat.reduced_time_at_end() >= needed)
            })
        });
        energies.push((found, *weight));
    }
    let least = energies;
    let all: f64 = least.iter().map(|(_, weight)| weight).sum();
    let without: f64 =
        least.iter().filter(|(energy, _)| energy.is_infinite()).map(|(_, weight)| weight).sum();
    let finite = || least.iter().copied().filter(|(energy, _)| energy.is_finite());
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
