//! What parameters a pair takes with its heat, and heats of several experiments of a plan beside each other.

use super::types::{ExperimentPlan, PairPlan, SimulatorPlan};
use crate::error::{InputError, Mistake};
use crate::input::heat::HeatFields;
use crate::input::toml_fields::{At, Fields};
use crate::pair::heat::{HeatPlan, LawPlan};
use crate::pair::parameter::ParameterName;

/// Heats that cannot be meant: of no pair, one amplitude for several energies, one cooling time for several radii, or parameters
/// of different references under one name.
pub(super) fn check_heats(
    fields: &Fields<'_>,
    tables: &[(At<&str>, Fields<'_>)],
    experiments: &[ExperimentPlan],
    heat: Option<&HeatFields>,
) -> Result<(), InputError> {
    if experiments.iter().all(|one| Heated::of(one).is_none()) && heat.is_some() {
        return Err(fields
            .table_error(Mistake::Conflict)
            .in_field("heat")
            .found("a heat, and no experiment of kind = \"builtin\" that has it")
            .help("a program gets its heat from its own input files"));
    }
    beside_each_other(experiments, &|mistake, name, field| {
        let line = tables.iter().find(|(at, _)| at.value == name).map(|(at, _)| at.line);
        let error = fields.table_error(mistake);
        let error = error.in_field(format_args!("experiments.{name}.simulator.{field}"));
        InputError { line, ..error }
    })
}

/// Where an experiment says something of its heat: an error of its name and a field.
type Place<'p> = &'p dyn Fn(Mistake, &str, &str) -> InputError;

/// Refuses heats that cannot share their parameters; `place` is where an experiment has them.
pub(super) fn beside_each_other(
    experiments: &[ExperimentPlan],
    place: Place<'_>,
) -> Result<(), InputError> {
    let heated: Vec<Heated<'_>> = experiments.iter().filter_map(Heated::of).collect();
    for (k, one) in heated.iter().enumerate() {
        let refused = heated[..k].iter().find_map(|other| one.beside(other, place));
        refused.map_or(Ok(()), Err)?;
    }
    Ok(())
}

/// The built-in pairs of a plan, with their experiments.
pub(crate) fn pairs(
    experiments: &[ExperimentPlan],
) -> impl Iterator<Item = (&ExperimentPlan, &PairPlan)> {
    experiments.iter().filter_map(|experiment| match &experiment.simulator {
        SimulatorPlan::Builtin(pair) => Some((experiment, pair)),
        _ => None,
    })
}

impl PairPlan {
    /// Whether a curve of the pair depends on one of the model's parameters, so that it is calibrated where it has a prior.
    pub fn takes(&self, parameter: ParameterName) -> bool {
        let radius_m = self.powder.radius_m;
        parameter.is_used_by(self.kinetics)
            || self.heat.as_ref().is_some_and(|heat| heat.leaves_open(parameter, radius_m))
    }

    /// Whether there is no curve of the pair without a prior of one of the model's parameters.
    pub fn needs(&self, parameter: ParameterName) -> bool {
        let needs = self.heat.as_ref().map(|heat| heat.needs(self.powder.radius_m));
        let by_heat = needs.into_iter().flatten().any(|needed| needed == (parameter, true));
        self.takes(parameter) && (by_heat || !(parameter.is_optional() || parameter.is_of_heat()))
    }
}

/// An experiment with a heat.
struct Heated<'a> {
    name: &'a str,
    pair: &'a PairPlan,
    heat: &'a HeatPlan,
}

impl<'a> Heated<'a> {
    fn of(experiment: &'a ExperimentPlan) -> Option<Self> {
        let SimulatorPlan::Builtin(pair) = &experiment.simulator else { return None };
        Some(Self { name: &experiment.name, pair, heat: pair.heat.as_ref()? })
    }

    fn shares(&self, other: &Self, name: ParameterName) -> bool {
        self.pair.calibrated(name) == other.pair.calibrated(name)
    }

    /// What speaks against calibrating two heats together.
    fn beside(&self, other: &Self, place: Place<'_>) -> Option<InputError> {
        let error = |mistake, field: &str| place(mistake, self.name, field);
        let amplitude = ParameterName::Amplitude;
        let direct = |one: &Self| {
            one.heat.law == LawPlan::Direct && !one.heat.known.contains_key(&amplitude)
        };
        let (own, others) = (self.heat.energy(), other.heat.energy());
        if direct(self) && direct(other) && self.shares(other, amplitude) && own != others {
            let name = self.pair.calibrated(amplitude);
            let energy = |energy: Option<f64>| {
                energy.map_or_else(|| "that is not stated".to_owned(), |energy| energy.to_string())
            };
            let (own, others) = (energy(own), energy(others));
            let refused = error(Mistake::Conflict, "parameters")
                .found(format_args!(
                    "one {name} for a pulse of energy {own} and one of {others} in {}",
                    other.name
                ))
                .expected("an amplitude for each energy, or a law of the energy")
                .help("give it its own: parameters = { amplitude = \"amplitude_2\" } and [parameters.amplitude_2]")
                .help("or choose mobility = \"threshold-power\", \"arrhenius\" or \"wlf\" in [heat]");
            return Some(refused);
        }
        let (own, others) = (self.pair.cooling_radius_m()?, other.pair.cooling_radius_m()?);
        let open = self.pair.takes(ParameterName::CoolingTime);
        (open && own != others && self.shares(other, ParameterName::CoolingTime)).then(|| {
            error(Mistake::MissingField, "heat.cooling_radius_m")
                .found(format_args!(
                    "one cooling_time for R = {own} m and for {others} m in {}",
                    other.name
                ))
                .expected("the radius that the shared cooling_time belongs to [m]")
                .help("state cooling_radius_m in [heat], and cooling_power or a prior of it")
                .help("or give each experiment its own: parameters = { cooling_time = \"...\" }")
        })
    }
}
