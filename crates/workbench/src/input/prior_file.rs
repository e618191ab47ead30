//! A file of priors: what is assumed of the parameters before the experiment.
//!
//! TOML with one table per parameter:
//!
//! | table | | parameter | unit |
//! |---|---|---|---|
//! | `[tau_s]` | required | sintering time | s |
//! | `[c1]` | required by kinetics with stage 2 | fluidity C1 | 1/(Pa s) |
//! | `[delta_c]` | required by kinetics with stage 2 | cut-off distance of the adhesive traction | m |
//! | `[lambda]` | optional | relaxation time of the kinetics `bellehumeur`; from a thousandth of tau_s to ten times it where not given | s |
//! | `[phi]` | optional | final contact ratio, calibrated instead of taken from the experiment | 1 |
//! | `[t0]` | optional | time of first contact in the table's clock, calibrated instead of zero; may be negative | s |
//! | `[cooling_time]`, `[activation_energy]`, ... | where a `[heat]` leaves them open | [`ParameterName::is_of_heat`] | |
//!
//! and in each the field `distribution` with what belongs to it, all required:
//!
//! | `distribution` | fields |
//! |---|---|
//! | `"log-uniform"` | `lower`, `upper` |
//! | `"uniform"` | `lower`, `upper` |
//! | `"log-normal"` | `median`, `sd_log10` (decades) |
//! | `"normal"` | `mean`, `sd`; for others than t0 only where mean > 8 sd, as they are positive |
//! | `"truncated-normal"` | `mean`, `sd`, `lower`, `upper` |
//!
//! `title` and `source` at the top are optional text. Other fields are refused.

use std::path::Path;

use dem_core::Kinetics;
use serde_json::json;
use smc_calib::{Parameter, Prior, PriorError, PriorSpec};

use crate::error::{InputError, Mistake};
use crate::input::experiment::is_toml;
use crate::input::heat::field_of;
use crate::input::material::Material;
use crate::input::text_file;
use crate::input::toml_fields::{At, Document, Fields};
use crate::pair::heat::HeatPlan;
use crate::pair::parameter::ParameterName;

/// Checked priors.
#[derive(Debug, Clone, PartialEq)]
pub struct PriorFile {
    /// The file, or `built-in`.
    pub file_name: String,
    /// Priors in the order of [`ParameterName::ALL`]; that of tau_s is always there.
    priors: [Option<Prior>; ParameterName::ALL.len()],
}

impl PriorFile {
    /// The default priors of a material, compiled in and read by the same code as a user's.
    pub fn of_material(material: Material) -> Result<Self, InputError> {
        let text = match material {
            Material::Ps => include_str!("../../built-in/prior-ps.toml"),
            Material::Pa12 => include_str!("../../built-in/prior-pa12.toml"),
            Material::Peek => include_str!("../../built-in/prior-peek.toml"),
        };
        Self::parse(&format!("built-in priors/{material}.toml"), text)
    }

    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let text = text_file::read(path)?;
        if !is_toml(path) && path.extension().is_some() {
            return Err(InputError::new(name, Mistake::Syntax)
                .found("not a .toml file")
                .expected("priors in TOML")
                .help("see priors/ps.toml for how it looks"));
        }
        Self::parse(&name, &text)
    }

    /// Reads text; `name` is what errors call it.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let document = Document::parse(name, text)?;
        let fields = document.top();
        fields.text("title")?;
        fields.text("source")?;
        let mut priors = [const { None }; ParameterName::ALL.len()];
        for (place, parameter) in priors.iter_mut().zip(ParameterName::ALL) {
            if let Some(table) = fields.table(parameter.name())? {
                *place = Some(prior(parameter, &table)?);
            }
        }
        fields.finish()?;
        if priors[ParameterName::TauS as usize].is_none() {
            return Err(missing(name, ParameterName::TauS));
        }
        Ok(Self { file_name: name.to_owned(), priors })
    }

    /// The prior of a parameter, if the file gives one.
    pub fn get(&self, parameter: ParameterName) -> Option<&Prior> {
        self.priors[parameter as usize].as_ref()
    }

    /// The parameters to calibrate under these kinetics and this heat of a pair of a radius \[m\], in the order of
    /// [`ParameterName::ALL`]. Priors that they have no use for are left alone.
    ///
    /// # Errors
    ///
    /// [`InputError`] where they have a parameter that the file gives no prior for, or where the heat states what has a prior.
    pub fn parameters(
        &self,
        kinetics: Kinetics,
        heat: Option<(&HeatPlan, f64)>,
    ) -> Result<Vec<Parameter>, InputError> {
        let needs = heat.map_or_else(Vec::new, |(heat, radius_m)| heat.needs(radius_m));
        let mut found = Vec::new();
        for parameter in ParameterName::ALL {
            let by_heat = needs.iter().find(|(name, _)| *name == parameter);
            if by_heat.is_none() && !parameter.is_used_by(kinetics) {
                continue;
            }
            let known = heat.and_then(|(heat, _)| heat.known.get(&parameter));
            let default = || parameter.default_prior(self.get(ParameterName::TauS)?);
            match (self.get(parameter).cloned().or_else(default), known) {
                (Some(prior), None) => {
                    found.push(Parameter::new(parameter.name(), parameter.unit(), prior));
                }
                (Some(_), Some(known)) => return Err(self.stated(parameter, *known)),
                (None, Some(_)) => {}
                (None, None) if by_heat.is_some_and(|(_, needed)| !needed) => {}
                (None, None) if parameter.is_optional() => {}
                (None, None) if by_heat.is_some() => {
                    return Err(missing(&self.file_name, parameter).help(format_args!(
                        "or state {} in [heat] of the experiment",
                        field_of(parameter).unwrap_or_default()
                    )));
                }
                (None, None) => {
                    return Err(missing(&self.file_name, parameter).help(format_args!(
                        "or choose kinetics without it: --kinetics frenkel, pokluda or bellehumeur, not {kinetics}"
                    )));
                }
            }
        }
        Ok(found)
    }

    /// A prior of what the heat states.
    fn stated(&self, parameter: ParameterName, known: f64) -> InputError {
        let field = field_of(parameter).unwrap_or_default();
        InputError::new(&self.file_name, Mistake::Conflict)
            .in_field(format_args!("[{}]", parameter.name()))
            .found(format_args!("a prior for what [heat] states: {field} = {known}"))
            .help(format_args!(
                "take {field} out of [heat] to calibrate it, or the prior out of this file"
            ))
    }
}

fn missing(file: &str, parameter: ParameterName) -> InputError {
    let example = match parameter {
        ParameterName::C1 => "lower = 1e-8, upper = 1e-2",
        ParameterName::TauS => "lower = 0.5, upper = 50.0",
        ParameterName::DeltaC => "lower = 1e-8, upper = 3e-6",
        ParameterName::Lambda => "lower = 1e-3, upper = 10.0",
        ParameterName::Phi => "lower = 1.0, upper = 1.35",
        ParameterName::T0 => "lower = 0.01, upper = 10.0",
        ParameterName::Amplitude => "lower = 1e-3, upper = 10.0",
        ParameterName::CoolingTime => "lower = 0.01, upper = 10.0",
        ParameterName::CoolingPower => "lower = 0.5, upper = 2.5",
        ParameterName::ActivationEnergy => "lower = 3e4, upper = 3e5",
        ParameterName::WlfC1 => "lower = 5.0, upper = 30.0",
        ParameterName::WlfC2 => "lower = 20.0, upper = 200.0",
        ParameterName::VogelB => "lower = 500.0, upper = 5000.0",
        ParameterName::VogelT0 => "lower = 200.0, upper = 400.0",
        ParameterName::Heating => "lower = 1.0, upper = 100.0",
        ParameterName::ThresholdEnergy => "lower = 1.0, upper = 18.0",
        ParameterName::EnergyPower => "lower = 0.5, upper = 4.0",
    };
    let name = parameter.name();
    InputError::new(file, Mistake::MissingField)
        .in_field(format_args!("[{name}]"))
        .found("missing")
        .expected(format_args!("a prior for {name} [{}]", parameter.unit()))
        .help(format_args!("add {name} = {{ distribution = \"log-uniform\", {example} }}"))
}

/// The families of priors by the names that a user types, each with the numbers that it is given by.
pub(crate) const DISTRIBUTIONS: [(&str, &[&str]); 5] = [
    ("log-uniform", &["lower", "upper"]),
    ("uniform", &["lower", "upper"]),
    ("log-normal", &["median", "sd_log10"]),
    ("normal", &["mean", "sd"]),
    ("truncated-normal", &["mean", "sd", "lower", "upper"]),
];

fn prior(parameter: ParameterName, fields: &Fields<'_>) -> Result<Prior, InputError> {
    let prior = any_prior(fields)?;
    check_support(parameter, fields, prior.spec())?;
    Ok(prior)
}

/// A prior of any parameter. Fields of the table that belong to something else must have been asked for before.
pub(crate) fn any_prior(fields: &Fields<'_>) -> Result<Prior, InputError> {
    let names = DISTRIBUTIONS.map(|(name, _)| name);
    let families = DISTRIBUTIONS.map(|family| (family.0, family));
    let Some(At { value: (name, keys), .. }) = fields.choice("distribution", &families)? else {
        return Err(fields
            .missing("distribution")
            .expected(format_args!("one of {}", names.join(", ")))
            .help("add distribution = \"log-uniform\""));
    };
    let mut spec = serde_json::Map::from_iter([("kind".to_owned(), json!(name))]);
    for &key in keys {
        let Some(number) = fields.number(key)? else {
            let (last, others) = keys.split_last().unwrap_or((&"", &[]));
            let given_by = format!("{} and {last}", others.join(", "));
            let expected = format_args!("a number, as {name} is given by {given_by}");
            return Err(fields.missing(key).expected(expected));
        };
        spec.insert(key.to_owned(), json!(number.value));
    }
    fields.finish()?;
    let spec = serde_json::from_value(spec.into())
        .map_err(|error| fields.table_error(Mistake::WrongType).found(error))?;
    Prior::new(spec).map_err(|error| refused(fields, &error))
}

/// A mistake in a field, at its line or, where it is not there, at that of its table.
fn mistake_in(fields: &Fields<'_>, key: &str, mistake: Mistake) -> InputError {
    let mut input = fields.table_error(mistake).in_field(fields.path_of(key));
    input.line = fields.line_of(key).or(input.line);
    input
}

fn refused(fields: &Fields<'_>, error: &PriorError) -> InputError {
    let at = |key: &str, mistake| mistake_in(fields, key, mistake);
    match error {
        PriorError::NotFinite { field, value } => {
            at(field, Mistake::NotFinite).found(value).expected("a finite number")
        }
        PriorError::NotPositive { field, value } => {
            let mistake = if *value < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
            at(field, mistake).found(value).expected("a number > 0").help(match *field {
                "sd" => "a standard deviation is above zero",
                _ => "a logarithmic prior has no zero; choose the smallest value that makes sense",
            })
        }
        PriorError::Bounds { lower, upper } if lower < upper => at("upper", Mistake::OutOfRange)
            .found(format_args!("{lower:e} to {upper:e}"))
            .expected("bounds whose difference is a number"),
        PriorError::Bounds { lower, upper } => at("lower", Mistake::Bounds)
            .found(format_args!("lower = {lower}, upper = {upper}"))
            .expected("lower below upper")
            .help(if lower == upper { "widen the range" } else { "swap them" }),
        other => fields.table_error(Mistake::OutOfRange).found(other),
    }
}

/// All parameters but t0 are positive, phi is a contact ratio, and none is of a size that no number of the result could hold.
pub(crate) fn check_support(
    parameter: ParameterName,
    fields: &Fields<'_>,
    spec: &PriorSpec,
) -> Result<(), InputError> {
    check_sign(parameter, fields, spec)?;
    let [least, most] = parameter.range();
    // An end within the tails is as good as reached: 5 sds of a logarithm, 8 sds of what cannot be negative.
    let ends = match *spec {
        PriorSpec::Uniform { lower, upper }
        | PriorSpec::LogUniform { lower, upper }
        | PriorSpec::TruncatedNormal { lower, upper, .. } => [("lower", lower), ("upper", upper)],
        PriorSpec::Normal { mean, sd } => [("mean", mean), ("sd", 8.0 * sd)],
        PriorSpec::LogNormal { median, sd_log10 } => {
            let decades = 10f64.powf(5.0 * sd_log10);
            [("sd_log10", median / decades), ("sd_log10", median * decades)]
        }
    };
    let far = ends.into_iter().find(|(_, end)| {
        *end != 0.0 && (end.abs() > most || (end.abs() < least && !parameter.may_be_negative()))
    });
    let Some((key, end)) = far else { return Ok(()) };
    let (name, unit) = (parameter.name(), parameter.unit());
    Err(mistake_in(fields, key, Mistake::OutOfRange)
        .found(if key == "sd_log10" {
            format!("a prior that goes to {end:e}")
        } else {
            format!("{end:e}")
        })
        .expected(format_args!("a {name} between {least:e} and {most:e} {unit}"))
        .help("a slip of the exponent? a prior of several decades is wide"))
}

fn check_sign(
    parameter: ParameterName,
    fields: &Fields<'_>,
    spec: &PriorSpec,
) -> Result<(), InputError> {
    if parameter.may_be_negative() {
        return Ok(());
    }
    let name = parameter.name();
    let at = |key: &str, mistake| mistake_in(fields, key, mistake);
    let bounds = match *spec {
        PriorSpec::Uniform { lower, upper }
        | PriorSpec::LogUniform { lower, upper }
        | PriorSpec::TruncatedNormal { lower, upper, .. } => Some([lower, upper]),
        PriorSpec::Normal { mean, sd } => {
            if mean <= 8.0 * sd {
                return Err(at("mean", Mistake::Negative)
                    .found(format_args!("mean = {mean}, sd = {sd}"))
                    .expected(format_args!("mean > 8 sd, as {name} cannot be negative"))
                    .help(
                        "use log-normal (median, sd_log10), or truncated-normal with lower = 0",
                    ));
            }
            None
        }
        PriorSpec::LogNormal { .. } => None,
    };
    let Some([lower, upper]) = bounds else { return Ok(()) };
    if lower < 0.0 {
        return Err(at("lower", Mistake::Negative)
            .found(lower)
            .expected(format_args!("a number >= 0, as {name} cannot be negative")));
    }
    if parameter == ParameterName::Phi {
        for (key, bound) in [("lower", lower), ("upper", upper)] {
            if let Err((expected, help)) = crate::input::experiment::checked_phi(bound) {
                return Err(at(key, Mistake::OutOfRange)
                    .found(bound)
                    .expected(expected)
                    .help(help));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
