//! The heat that is asked for beside a posterior: that of the calibration, or another one.

use crate::careful::Careful;
use crate::error::{InputError, Mistake};
use crate::input::heat::{HeatFields, field_of};
use crate::pair::heat::{HeatPlan, HistoryPlan, LawPlan, NoHeat};
use crate::pair::parameter::ParameterName;
use crate::plan::PairPlan;

/// The heat to compute for: that of the calibration, with another history or another energy where that is wanted.
///
/// Numbers that `fields` leave open are those of the calibration. A cooling time and the radius that it belongs to are one statement:
/// both are those of `fields`, whose time belongs to the pair that is asked for where they have no radius, or both of the calibration.
///
/// # Errors
///
/// [`InputError`] for a heat that the posterior says nothing of.
pub fn heat_of(
    pair: &PairPlan,
    fields: Option<&HeatFields>,
    pulse_energy: Option<f64>,
) -> Result<Option<HeatPlan>, InputError> {
    let mut heat = match fields {
        None => pair.heat.clone(),
        Some(fields) => Some(asked(pair, fields)?),
    };
    if let Some(energy) = pulse_energy {
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
        let place = fields.filter(|_| pulse_energy.is_none()).map(HeatFields::file_name);
        return Err(no_law(place.unwrap_or("--pulse-energy")));
    }
    let stated = fields.is_some_and(HeatFields::states_cooling_time);
    let calibrated_m = pair.cooling_radius_m();
    if let HistoryPlan::Pulse { cooling_radius_m, .. } = &mut heat.history
        && let Some(of) = calibrated_m.filter(|_| !stated)
    {
        if let Some(other) = cooling_radius_m.filter(|other| *other != of) {
            return Err(InputError::new(
                fields.map_or("--heat", HeatFields::file_name),
                Mistake::Conflict,
            )
            .in_field("heat.cooling_radius_m")
            .found(format_args!("{other} m, and no cooling_time_s that belongs to it"))
            .expected(format_args!("{of} m, the radius of the calibrated cooling time"))
            .help("leave it out, or state cooling_time_s too"));
        }
        *cooling_radius_m = Some(of);
    }
    Ok(Some(heat))
}

/// A heat of the user's, with what the calibration knows and the file does not say.
fn asked(pair: &PairPlan, fields: &HeatFields) -> Result<HeatPlan, InputError> {
    let mut heat = fields.plan()?;
    let Some(own) = &pair.heat else { return Ok(heat) };
    if own.law != heat.law {
        let words = |law: &LawPlan| match serde_json::to_value(law) {
            Ok(value) => value.to_string(),
            Err(_) => law.name().to_owned(),
        };
        return Err(InputError::new(fields.file_name(), Mistake::Conflict)
            .in_field("heat.mobility")
            .found(words(&heat.law))
            .expected(format_args!("{}, which the posterior was calibrated with", words(&own.law)))
            .help("C1, tau_s and the constants of the law belong to it"));
    }
    heat.complete_with(own);
    Ok(heat)
}

/// What to say of an energy that lies outside of those that pairs were calibrated with; nothing where they had none.
pub(crate) fn outside_energies<'p>(
    calibrated: impl IntoIterator<Item = &'p PairPlan>,
    energy: f64,
) -> Option<String> {
    let energies = calibrated.into_iter().filter_map(|pair| pair.heat.as_ref()?.energy());
    let (lowest, highest) = energies
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), energy| (a.min(energy), b.max(energy)));
    (lowest <= highest && !(lowest..=highest).contains(&energy))
        .then(|| Careful::OutsideEnergies { energy, lowest, highest }.to_string())
}

fn no_pulse(option: &str) -> InputError {
    InputError::new(option, Mistake::Conflict)
        .found("an energy, and no pulse that has it")
        .expected("a posterior, or a --heat, with history = \"pulse\"")
}

/// A direct amplitude says nothing of other energies.
pub(crate) fn no_law(option: &str) -> InputError {
    InputError::new(option, Mistake::Conflict)
        .found("another energy than the calibrated one, and mobility = \"direct\"")
        .expected("a law of the amplitude over the energy")
        .help("calibrate with mobility = \"threshold-power\", \"arrhenius\" or \"wlf\"")
}

/// Numbers of a heat that a draw cannot give; `place` is where it is asked for.
pub fn refused(place: &str, error: &NoHeat) -> InputError {
    let refused = InputError::new(place, Mistake::MissingField).found(error);
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
