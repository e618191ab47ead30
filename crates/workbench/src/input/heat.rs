//! The table `[heat]` of an experiment or a plan: what is known of the heat that a pair gets.
//!
//! A plan file's `[heat]` is that of all its built-in experiments and goes before theirs, field by field. What is still not
//! known then is a parameter with a prior. `crates/guide/pages/heat.md` has every field.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use dem_core::heat::Heat;

use crate::error::{InputError, Mistake, nearest};
use crate::input::data_table::DataTable;
use crate::input::text_file;
use crate::input::toml_fields::{At, Document, Fields};
use crate::pair::heat::{HeatPlan, HistoryPlan, LawPlan, NoHeat};
use crate::pair::parameter::ParameterName;

/// Fields that hold text.
const TEXTS: [&str; 3] = ["history", "mobility", "table"];

/// Fields of numbers that are never calibrated, each with its unit and range.
const NUMBERS: [(&str, &str, [f64; 2]); 13] = [
    ("pulse_energy", "in the unit of all pulses", ENERGIES),
    ("reference_energy", "in the unit of all pulses", ENERGIES),
    ("cooling_radius_m", "m", [1e-9, 1e-2]),
    ("ambient_temperature_k", "K", TEMPERATURES_K),
    ("reference_temperature_k", "K", TEMPERATURES_K),
    ("frozen_below_k", "K", TEMPERATURES_K),
    ("temperature_k", "K", TEMPERATURES_K),
    ("start_temperature_k", "K", TEMPERATURES_K),
    ("hold_temperature_k", "K", TEMPERATURES_K),
    ("rate_k_per_s", "K/s", [1e-9, 1e9]),
    ("hold_s", "s", [0.0, 1e12]),
    ("cooling_rate_k_per_s", "K/s", [1e-9, 1e9]),
    ("start_s", "s", [-1e12, 1e12]),
];

/// Energies of a pulse, in the unit of all pulses of a powder.
pub const PULSE_ENERGIES: RangeInclusive<f64> = ENERGIES[0]..=ENERGIES[1];
const ENERGIES: [f64; 2] = [1e-12, 1e12];

/// Temperatures that are computed with \[K\].
pub(crate) const TEMPERATURES_K: [f64; 2] = [1.0, 1e4];

/// Fields of numbers that may be calibrated instead, by the name of the parameter.
const OPEN: [(&str, ParameterName); 11] = [
    ("amplitude", ParameterName::Amplitude),
    ("cooling_time_s", ParameterName::CoolingTime),
    ("cooling_power", ParameterName::CoolingPower),
    ("activation_energy_j_per_mol", ParameterName::ActivationEnergy),
    ("wlf_c1", ParameterName::WlfC1),
    ("wlf_c2_k", ParameterName::WlfC2),
    ("vogel_b_k", ParameterName::VogelB),
    ("vogel_t0_k", ParameterName::VogelT0),
    ("heating_k", ParameterName::Heating),
    ("threshold_energy", ParameterName::ThresholdEnergy),
    ("energy_power", ParameterName::EnergyPower),
];

/// The shortest table of temperatures.
const SHORTEST: &str = "time_s,temperature_k\n0,300\n10,400";

/// The field that a parameter of the heat is stated in.
pub fn field_of(parameter: ParameterName) -> Option<&'static str> {
    OPEN.iter().find(|(_, name)| *name == parameter).map(|(field, _)| *field)
}

/// What one or several tables `[heat]` say, field by field.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatFields {
    place: Place,
    fields: BTreeMap<&'static str, (Said, Place)>,
}

/// What a field says.
#[derive(Debug, Clone, PartialEq)]
enum Said {
    Number(f64),
    Text(String),
    /// Times and temperatures of a file.
    Table(String, Vec<f64>, Vec<f64>),
}

/// Where it says so.
#[derive(Debug, Clone, PartialEq)]
struct Place {
    file: String,
    path: String,
    line: Option<usize>,
}

impl Place {
    fn error(&self, mistake: Mistake) -> InputError {
        let mut error = InputError::new(&self.file, mistake).in_field(&self.path);
        error.line = self.line;
        error
    }
}

impl HeatFields {
    /// Reads the `[heat]` of a file: of one with nothing else, or of an experiment's description.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a file without `[heat]`, or one with mistakes in it.
    pub fn open(path: &Path) -> Result<Self, InputError> {
        let (name, text) = (path.display().to_string(), text_file::read(path)?);
        let document = Document::parse(&name, &text)?;
        let Some(heat) = document.top().table("heat")? else {
            return Err(InputError::new(name, Mistake::MissingField)
                .in_field("[heat]")
                .found("missing")
                .expected("a table [heat] with history and mobility")
                .help("crates/guide/pages/heat.md has its fields"));
        };
        Self::read(text_file::folder_of(path), &heat)
    }

    /// Reads a table `[heat]`; files that it names begin at `folder`.
    pub(crate) fn read(folder: &Path, table: &Fields<'_>) -> Result<Self, InputError> {
        let place = |key: &str, line| Place {
            file: table.file_name().to_owned(),
            path: if key.is_empty() { "heat".to_owned() } else { table.path_of(key) },
            line,
        };
        let mut fields = BTreeMap::new();
        let mut say = |key, said, line| fields.insert(key, (said, place(key, Some(line))));
        for key in TEXTS {
            let Some(At { value, line }) = table.text(key)? else { continue };
            let said = match key {
                "table" => temperatures(&folder.join(value))
                    .map_err(|error| error.named_in(table, "table", line))?,
                _ => Said::Text(value.to_owned()),
            };
            say(key, said, line);
        }
        for (key, unit, [least, most]) in NUMBERS {
            let Some(At { value, line }) = table.number(key)? else { continue };
            if !(least..=most).contains(&value) {
                return Err(out_of_range(table, key, At { value, line }, unit, [least, most]));
            }
            say(key, Said::Number(value), line);
        }
        for (key, parameter) in OPEN {
            let Some(At { value, line }) = table.number(key)? else { continue };
            let range = parameter.range();
            if !(range[0]..=range[1]).contains(&value) {
                return Err(out_of_range(table, key, At { value, line }, parameter.unit(), range));
            }
            say(key, Said::Number(value), line);
        }
        table.finish()?;
        Ok(Self { place: place("", table.line()), fields })
    }

    /// The same, with what `others` say where this says nothing.
    pub fn or(mut self, others: &Self) -> Self {
        for (key, said) in &others.fields {
            self.fields.entry(key).or_insert_with(|| said.clone());
        }
        self
    }

    /// The heat that the fields make.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a field that is missing, unknown, or has no meaning beside the others.
    pub fn plan(&self) -> Result<HeatPlan, InputError> {
        let law = self.law()?;
        let history = self.history(&law)?;
        let known: BTreeMap<ParameterName, f64> =
            OPEN.iter().filter_map(|(key, name)| Some((*name, self.number(key)?))).collect();
        let plan = HeatPlan {
            history,
            law,
            frozen_below_k: self.number("frozen_below_k").filter(|_| law.is_of_temperature()),
            start_s: self.number("start_s").unwrap_or(0.0),
            known,
        };
        self.check_used(&plan)?;
        Ok(plan)
    }

    /// The heat of a pair of radius `radius_m` \[m\] by a plan of these fields, where nothing is calibrated.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a number that is not stated, or out of the range of the model.
    pub fn stated(&self, plan: &HeatPlan, radius_m: f64) -> Result<Heat, InputError> {
        plan.at(plan.unrounded(radius_m), |_| None).map_err(|error| match error {
            NoHeat::Open(name) => {
                let mut place = self.place.clone();
                place.path = format!("{}.{}", place.path, field_of(name).unwrap_or(name.name()));
                let (unit, meaning) = (name.unit(), name.meaning());
                place
                    .error(Mistake::MissingField)
                    .found("missing")
                    .expected(format_args!("a number [{unit}]: {meaning}"))
                    .help("nothing is calibrated here: every number of the heat must be stated")
            }
            NoHeat::OutOfRange(_) | NoHeat::Threshold { .. } => {
                self.place.error(Mistake::OutOfRange).found(error)
            }
            _ => self.place.error(Mistake::MissingField).found(error),
        })
    }

    /// Whether they have a cooling time.
    pub fn states_cooling_time(&self) -> bool {
        self.number("cooling_time_s").is_some()
    }

    /// The same without the numbers of parameters that `others` have; the radius of a cooling time goes with it.
    pub(crate) fn without(&self, others: impl Fn(ParameterName) -> bool) -> Self {
        let mut left = self.clone();
        for (field, _) in OPEN.iter().filter(|(_, name)| others(*name)) {
            left.fields.remove(field);
        }
        if self.states_cooling_time() && !left.states_cooling_time() {
            left.fields.remove("cooling_radius_m");
        }
        left
    }

    /// Name of the file that they are in.
    pub fn file_name(&self) -> &str {
        &self.place.file
    }

    fn number(&self, key: &str) -> Option<f64> {
        match self.fields.get(key)? {
            (Said::Number(value), _) => Some(*value),
            _ => None,
        }
    }

    fn needed(&self, key: &str, why: &str) -> Result<f64, InputError> {
        self.number(key).ok_or_else(|| self.missing(key, why))
    }

    fn missing(&self, key: &str, why: &str) -> InputError {
        let mut place = self.place.clone();
        place.path = format!("{}.{key}", place.path);
        let unit = NUMBERS.iter().find(|(name, ..)| *name == key).map(|(_, unit, _)| *unit);
        let error = place.error(Mistake::MissingField).found("missing");
        match unit {
            Some(unit) => error.expected(format_args!("a number [{unit}], {why}")),
            None => error.expected(why),
        }
    }

    /// One of a closed list of names.
    fn name<'n>(&self, key: &str, names: &[&'n str]) -> Result<Option<&'n str>, InputError> {
        let Some((Said::Text(text), place)) = self.fields.get(key) else { return Ok(None) };
        match names.iter().find(|name| *name == text) {
            Some(name) => Ok(Some(name)),
            None => Err(place
                .error(Mistake::UnknownName)
                .found(format_args!("\"{text}\""))
                .expected(format_args!("one of {}", names.join(", ")))
                .help_if(
                    nearest(text, names.iter().copied())
                        .map(|near| format!("did you mean \"{near}\"?")),
                )),
        }
    }

    fn law(&self) -> Result<LawPlan, InputError> {
        let Some(name) = self.name("mobility", &LawPlan::NAMES)? else {
            return Err(self.missing(
                "mobility",
                "what the temperature does: \"direct\", \"threshold-power\", \"arrhenius\", \"wlf\" or \"vogel\"",
            ));
        };
        let reference = || self.needed("reference_temperature_k", "where the mobility is 1");
        Ok(match name {
            "direct" => LawPlan::Direct,
            "threshold-power" => LawPlan::ThresholdPower {
                reference_energy: self.needed("reference_energy", "where the amplitude is 1")?,
            },
            "arrhenius" => LawPlan::Arrhenius { reference_temperature_k: reference()? },
            "wlf" => LawPlan::Wlf { reference_temperature_k: reference()? },
            _ => LawPlan::Vogel { reference_temperature_k: reference()? },
        })
    }

    fn history(&self, law: &LawPlan) -> Result<HistoryPlan, InputError> {
        const NAMES: [&str; 4] = ["constant", "pulse", "ramp-and-hold", "table"];
        let Some(name) = self.name("history", &NAMES)? else {
            return Err(
                self.missing("history", "\"constant\", \"pulse\", \"ramp-and-hold\" or \"table\"")
            );
        };
        if name != "pulse" && !law.is_of_temperature() {
            let (_, place) = &self.fields["mobility"];
            return Err(place
                .error(Mistake::Conflict)
                .found(format_args!("\"{}\" with history = \"{name}\"", law.name()))
                .expected("arrhenius, wlf or vogel, which make a mobility of a temperature")
                .help("direct and threshold-power are laws of pulses"));
        }
        Ok(match name {
            "constant" => HistoryPlan::Constant {
                temperature_k: self.needed("temperature_k", "that of the experiment")?,
            },
            "pulse" => HistoryPlan::Pulse {
                energy: match law {
                    LawPlan::Direct => self.number("pulse_energy"),
                    _ => Some(self.needed("pulse_energy", "which the law goes with")?),
                },
                ambient_temperature_k: match law.is_of_temperature() {
                    true => Some(self.needed("ambient_temperature_k", "that the pair cools to")?),
                    false => None,
                },
                cooling_radius_m: self.number("cooling_radius_m"),
            },
            "ramp-and-hold" => HistoryPlan::RampAndHold {
                start_temperature_k: self.needed("start_temperature_k", "at the beginning")?,
                rate_k_per_s: self.needed("rate_k_per_s", "of the heating")?,
                hold_temperature_k: self.needed("hold_temperature_k", "that is held")?,
                cool_down: match self.number("hold_s").or(self.number("cooling_rate_k_per_s")) {
                    None => None,
                    Some(_) => Some([
                        self.needed("hold_s", "after which it cools")?,
                        self.needed("cooling_rate_k_per_s", "after the hold")?,
                    ]),
                },
            },
            _ => match self.fields.get("table") {
                Some((Said::Table(file, time_s, temperature_k), _)) => HistoryPlan::Table {
                    file: file.clone(),
                    time_s: time_s.clone(),
                    temperature_k: temperature_k.clone(),
                },
                _ => {
                    return Err(
                        self.missing("table", "a file with the columns time_s and temperature_k")
                    );
                }
            },
        })
    }

    /// Refuses what the history and the law do not use: most likely a part of another one.
    fn check_used(&self, plan: &HeatPlan) -> Result<(), InputError> {
        let history: &[&str] = match plan.history {
            HistoryPlan::Constant { .. } => &["temperature_k"],
            HistoryPlan::Pulse { .. } => &["pulse_energy", "cooling_radius_m", "cooling_power"],
            HistoryPlan::RampAndHold { .. } => {
                const OVEN: [&str; 5] = [
                    "start_temperature_k",
                    "rate_k_per_s",
                    "hold_temperature_k",
                    "hold_s",
                    "cooling_rate_k_per_s",
                ];
                &OVEN
            }
            HistoryPlan::Table { .. } => &["table"],
        };
        let law: &[&str] = match plan.law {
            LawPlan::Direct => &[],
            LawPlan::ThresholdPower { .. } => &["reference_energy"],
            _ => &["reference_temperature_k", "frozen_below_k"],
        };
        // Of a pulse with a law of temperature.
        let both: &[&str] = match (&plan.history, plan.law.is_of_temperature()) {
            (HistoryPlan::Pulse { .. }, true) => &["ambient_temperature_k"],
            _ => &[],
        };
        let needs = plan.needs(0.0);
        let open = needs.iter().filter_map(|(name, _)| field_of(*name));
        let used: Vec<&str> = ["history", "mobility", "start_s"]
            .iter()
            .chain(history)
            .chain(law)
            .chain(both)
            .copied()
            .chain(open)
            .collect();
        let unused = self.fields.iter().find(|(key, _)| !used.contains(key));
        let Some((key, (_, place))) = unused else { return Ok(()) };
        Err(place
            .error(Mistake::Conflict)
            .found(format_args!(
                "{key}, which history = \"{}\" with mobility = \"{}\" does not use",
                plan.history.name(),
                plan.law.name()
            ))
            .help("leave it out, or choose the history and the mobility that it belongs to"))
    }
}

fn out_of_range(
    table: &Fields<'_>,
    key: &str,
    At { value, line }: At<f64>,
    unit: &str,
    [least, most]: [f64; 2],
) -> InputError {
    let mistake = if value < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
    table
        .error(key, line, mistake)
        .found(value)
        .expected(format_args!("a number between {least:e} and {most:e} [{unit}]"))
        .help_if(
            (unit == "K" && value < least).then_some("temperatures are in kelvin: 0 C is 273.15 K"),
        )
}

/// Reads a table of temperatures.
fn temperatures(path: &Path) -> Result<Said, InputError> {
    let name = path.display().to_string();
    let text = text_file::read(path)?;
    let table = DataTable::parse(&name, &text, SHORTEST)?;
    let (time_s, temperature_k) = (table.column("time_s")?, table.column("temperature_k")?);
    if let Some(row) = time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(table
            .mistake_in(row + 1, "time_s", Mistake::Unsorted)
            .expected(format_args!("a time after {} s", time_s[row])));
    }
    let [least, most] = TEMPERATURES_K;
    if let Some(row) = temperature_k.iter().position(|value| !(least..=most).contains(value)) {
        return Err(table
            .mistake_in(row, "temperature_k", Mistake::OutOfRange)
            .expected(format_args!("a temperature between {least} and {most:e} K"))
            .help("temperatures are in kelvin: 0 C is 273.15 K"));
    }
    Ok(Said::Table(name, time_s, temperature_k))
}

#[cfg(test)]
mod tests;
