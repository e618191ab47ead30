//! The heat of an experiment as it is planned: what is known of it, and which of its numbers are calibrated.
//!
//! A heat is a history (how the temperature goes with time) and a law (what it does to the rates of growth). Its numbers are
//! either known or parameters with priors; [`HeatPlan::at`] puts the values of a parameter vector in.

use std::collections::BTreeMap;

use dem_core::heat::{self, CoolDown, Heat, HeatError, History, Mobility, MobilityLaw};
use serde::{Deserialize, Serialize};

use crate::pair::parameter::ParameterName;

/// The heat of a pair. All SI; energies of pulses in one unit of the user's.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeatPlan {
    /// How the temperature goes with time.
    pub history: HistoryPlan,
    /// What the temperature, or a pulse, does to the rates of growth.
    pub law: LawPlan,
    /// Temperature below which nothing moves \[K\]; none where the law alone decides.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frozen_below_k: Option<f64>,
    /// Time after first contact at which the history begins \[s\].
    pub start_s: f64,
    /// The numbers that are known, by the names of the model's parameters.
    pub known: BTreeMap<ParameterName, f64>,
}

/// How the temperature goes with time.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum HistoryPlan {
    /// One temperature throughout.
    Constant {
        /// The temperature \[K\].
        temperature_k: f64,
    },
    /// Heated at once, then cooling exponentially towards the surroundings.
    Pulse {
        /// Energy of the pulse, in the unit of all pulses of the powder.
        energy: Option<f64>,
        /// Temperature of the surroundings \[K\]; not used by laws that claim no temperature.
        ambient_temperature_k: Option<f64>,
        /// Radius that the cooling time belongs to \[m\]; that of the pair where there is none.
        cooling_radius_m: Option<f64>,
    },
    /// Heated at a constant rate, then held.
    RampAndHold {
        /// Temperature at the beginning \[K\].
        start_temperature_k: f64,
        /// Rate of heating \[K/s\].
        rate_k_per_s: f64,
        /// Temperature that is held \[K\].
        hold_temperature_k: f64,
        /// Duration of the hold \[s\] and rate of cooling after it \[K/s\]; held without an end where there are none.
        cool_down: Option<[f64; 2]>,
    },
    /// Temperatures at given times, linear between them.
    Table {
        /// The file that they were read from.
        file: String,
        /// Times \[s\], increasing.
        time_s: Vec<f64>,
        /// Temperatures \[K\].
        temperature_k: Vec<f64>,
    },
}

/// What a temperature, or a pulse, does to the rates of growth.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LawPlan {
    /// An amplitude of the pulse's own, m = M exp(-t/t_c); no temperature is claimed.
    Direct,
    /// The same with an amplitude that goes with a power of the energy above a threshold, M = ((E - E0)/(E_ref - E0))^p.
    ThresholdPower {
        /// The energy E_ref at which the amplitude is 1.
        reference_energy: f64,
    },
    /// m = exp(-(E_a/R_g)(1/T - 1/T_ref)).
    Arrhenius {
        /// The temperature T_ref at which m is 1 \[K\].
        reference_temperature_k: f64,
    },
    /// log10 m = c1 (T - T_ref)/(c2 + T - T_ref).
    Wlf {
        /// The temperature T_ref at which m is 1 \[K\].
        reference_temperature_k: f64,
    },
    /// ln m = -B/(T - T_0) + B/(T_ref - T_0).
    Vogel {
        /// The temperature T_ref at which m is 1 \[K\].
        reference_temperature_k: f64,
    },
}

impl LawPlan {
    /// Names of the laws in files.
    pub const NAMES: [&'static str; 5] = ["direct", "threshold-power", "arrhenius", "wlf", "vogel"];

    /// Its name in files.
    pub fn name(&self) -> &'static str {
        Self::NAMES[match self {
            Self::Direct => 0,
            Self::ThresholdPower { .. } => 1,
            Self::Arrhenius { .. } => 2,
            Self::Wlf { .. } => 3,
            Self::Vogel { .. } => 4,
        }]
    }

    /// Whether the law is one of temperatures.
    pub fn is_of_temperature(&self) -> bool {
        !matches!(self, Self::Direct | Self::ThresholdPower { .. })
    }
}

impl HistoryPlan {
    /// Its name in files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Constant { .. } => "constant",
            Self::Pulse { .. } => "pulse",
            Self::RampAndHold { .. } => "ramp-and-hold",
            Self::Table { .. } => "table",
        }
    }
}

/// Why there is no heat at a parameter vector.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoHeat {
    /// A number that is neither known nor calibrated.
    #[error("{} ({}) of the heat is neither known nor calibrated", .0.name(), .0.meaning())]
    Open(ParameterName),
    /// A law of the energy needs the energy of the pulse.
    #[error("the pulse has no energy, which its law needs")]
    NoEnergy,
    /// Temperatures of a pulse need the temperature of the surroundings.
    #[error("the pulse has no ambient temperature, which its law needs")]
    NoAmbient,
    /// A law of pulses with a history of temperatures.
    #[error("the law of the mobility is one of pulses, and the history one of temperatures")]
    NoTemperature,
    /// A threshold that the reference is not above.
    #[error(
        "the threshold energy {threshold} is not below the reference energy {reference_energy}"
    )]
    Threshold {
        /// The threshold.
        threshold: f64,
        /// The reference.
        reference_energy: f64,
    },
    /// A number outside the range of the model.
    #[error(transparent)]
    OutOfRange(#[from] HeatError),
}

/// Share of the growth of a heat, in reduced time, that is so little that nothing moves any more: of a neck that grows as a power of
/// it below one, less than a hundredth of its size.
const NOTHING_LEFT: f64 = 1e-2;

/// How much of the growth of a heat a run of a bed has seen, in reduced time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrowthSeen {
    /// Reduced time for which it has grown, in its heated phases \[s\].
    pub reduced_time_s: f64,
    /// Reduced time after infinite time \[s\]; none where growth never ends.
    pub in_all_s: Option<f64>,
    /// Reduced time when the last heated phase ended \[s\].
    #[serde(skip)]
    passed_s: f64,
}

impl GrowthSeen {
    /// Of heated phases, each from one time after first contact to another \[s\], in order.
    pub fn of(heat: &Heat, heated_s: &[[f64; 2]]) -> Self {
        let in_all_s = Some(heat.reduced_time_at_end()).filter(|end| end.is_finite());
        let reduced: Vec<[f64; 2]> =
            heated_s.iter().map(|ends| ends.map(|time_s| heat.reduced_time(time_s))).collect();
        Self {
            reduced_time_s: reduced.iter().map(|[from, to]| to - from).sum(),
            in_all_s,
            passed_s: reduced.last().map_or(0.0, |[_, to]| *to),
        }
    }

    /// Whether its heat has ended: less than a hundredth of all its growth was to come after the last heated phase.
    pub fn is_frozen(&self) -> bool {
        self.in_all_s.is_some_and(|all| self.passed_s >= (1.0 - NOTHING_LEFT) * all)
    }
}

impl HeatPlan {
    /// The model's parameters that a curve of a pair of radius `radius_m` depends on, with whether it cannot do without.
    pub fn needs(&self, radius_m: f64) -> Vec<(ParameterName, bool)> {
        use ParameterName as P;
        let mut needed = match self.law {
            LawPlan::Direct => vec![(P::Amplitude, false)],
            LawPlan::ThresholdPower { .. } => {
                vec![(P::ThresholdEnergy, true), (P::EnergyPower, true)]
            }
            LawPlan::Arrhenius { .. } => vec![(P::ActivationEnergy, true)],
            LawPlan::Wlf { .. } => vec![(P::WlfC1, true), (P::WlfC2, true)],
            LawPlan::Vogel { .. } => vec![(P::VogelB, true), (P::VogelT0, true)],
        };
        if let HistoryPlan::Pulse { cooling_radius_m, .. } = self.history {
            needed.push((P::CoolingTime, true));
            let another = cooling_radius_m.is_some_and(|of| of != radius_m);
            if cooling_radius_m.is_some() {
                needed.push((P::CoolingPower, another));
            }
            if self.law.is_of_temperature() {
                needed.push((P::Heating, true));
            }
        }
        needed
    }

    /// The radius that the cooling time of a pulse belongs to \[m\]: that of the pair where none is stated.
    pub fn cooling_radius_m(&self, pair_radius_m: f64) -> Option<f64> {
        match self.history {
            HistoryPlan::Pulse { cooling_radius_m, .. } => {
                Some(cooling_radius_m.unwrap_or(pair_radius_m))
            }
            _ => None,
        }
    }

    /// Whether a parameter is to be calibrated where it has a prior: the heat depends on it and it is not known.
    pub fn leaves_open(&self, name: ParameterName, radius_m: f64) -> bool {
        !self.known.contains_key(&name)
            && self.needs(radius_m).iter().any(|(needed, _)| *needed == name)
    }

    /// What the heat cannot do without and does not say.
    pub fn leaves_unstated(&self, radius_m: f64) -> Vec<ParameterName> {
        let needs = self.needs(radius_m).into_iter();
        needs
            .filter(|(name, needed)| *needed && !self.known.contains_key(name))
            .map(|(name, _)| name)
            .collect()
    }

    /// The heat on one line.
    pub fn in_words(&self) -> String {
        let history = match &self.history {
            HistoryPlan::Constant { temperature_k } => format!("constant {temperature_k} K"),
            HistoryPlan::Pulse { energy: Some(energy), .. } => format!("pulse of energy {energy}"),
            HistoryPlan::Pulse { energy: None, .. } => "pulse".to_owned(),
            HistoryPlan::RampAndHold {
                start_temperature_k,
                rate_k_per_s,
                hold_temperature_k,
                ..
            } => {
                format!(
                    "{start_temperature_k} K to {hold_temperature_k} K by {rate_k_per_s} K/s, held"
                )
            }
            HistoryPlan::Table { file, time_s, .. } => {
                format!("{} temperatures of {file}", time_s.len())
            }
        };
        let known = self.known.iter().map(|(name, value)| format!(", {} {value}", name.name()));
        format!("{history}, mobility {}{}", self.law.name(), known.collect::<String>())
    }

    /// The energy of the pulse.
    pub fn energy(&self) -> Option<f64> {
        match self.history {
            HistoryPlan::Pulse { energy, .. } => energy,
            _ => None,
        }
    }

    /// The same heat with another energy of its pulse; none where it has no pulse.
    pub fn with_energy(&self, energy: f64) -> Option<Self> {
        let mut other = self.clone();
        match &mut other.history {
            HistoryPlan::Pulse { energy: own, .. } => *own = Some(energy),
            _ => return None,
        }
        Some(other)
    }

    /// Takes over from another heat of the same law what this one leaves open, but for the radius of a cooling time.
    pub fn complete_with(&mut self, other: &Self) {
        self.frozen_below_k = self.frozen_below_k.or(other.frozen_below_k);
        for (name, value) in &other.known {
            self.known.entry(*name).or_insert(*value);
        }
        if let (
            HistoryPlan::Pulse {
                energy: other_energy, ambient_temperature_k: other_ambient_k, ..
            },
            HistoryPlan::Pulse { energy, ambient_temperature_k, .. },
        ) = (&other.history, &mut self.history)
        {
            *energy = energy.or(*other_energy);
            *ambient_temperature_k = ambient_temperature_k.or(*other_ambient_k);
        }
    }

    /// The radius that the cooling time belongs to where `radius_m` differs from it by rounding alone, as a mean of equal radii does.
    pub fn unrounded(&self, radius_m: f64) -> f64 {
        let of = self.cooling_radius_m(radius_m).unwrap_or(radius_m);
        if (radius_m / of - 1.0).abs() < 1e-9 { of } else { radius_m }
    }

    /// The file of a table of temperatures.
    pub fn table_file(&self) -> Option<&str> {
        match &self.history {
            HistoryPlan::Table { file, .. } => Some(file),
            _ => None,
        }
    }

    /// The heat of a pair of radius `radius_m` \[m\], with the values of the calibrated parameters.
    ///
    /// # Errors
    ///
    /// [`NoHeat`] for a number that is not known or out of range.
    pub fn at(
        &self,
        radius_m: f64,
        calibrated: impl Fn(ParameterName) -> Option<f64>,
    ) -> Result<Heat, NoHeat> {
        use ParameterName as P;
        let value = |name: P| {
            let value = self.known.get(&name).copied().or_else(|| calibrated(name));
            value.ok_or(NoHeat::Open(name))
        };
        let history = match &self.history {
            HistoryPlan::Pulse { energy, ambient_temperature_k, cooling_radius_m } => {
                let mut cooling_s = value(P::CoolingTime)?;
                if let Some(of) = cooling_radius_m.filter(|of| *of != radius_m) {
                    cooling_s = heat::at_radius(cooling_s, of, radius_m, value(P::CoolingPower)?);
                }
                let energy = energy.ok_or(NoHeat::NoEnergy);
                match self.law {
                    LawPlan::Direct => {
                        let amplitude = value(P::Amplitude).unwrap_or(1.0);
                        return Ok(Heat::direct(amplitude, cooling_s, self.start_s)?);
                    }
                    LawPlan::ThresholdPower { reference_energy } => {
                        let threshold = value(P::ThresholdEnergy)?;
                        if threshold >= reference_energy {
                            return Err(NoHeat::Threshold { threshold, reference_energy });
                        }
                        let over = (energy? - threshold).max(0.0) / (reference_energy - threshold);
                        let amplitude = over.powf(value(P::EnergyPower)?);
                        return Ok(Heat::direct(amplitude, cooling_s, self.start_s)?);
                    }
                    _ => History::Pulse {
                        ambient_k: ambient_temperature_k.ok_or(NoHeat::NoAmbient)?,
                        rise_k: value(P::Heating)? * energy?,
                        cooling_s,
                    },
                }
            }
            HistoryPlan::Constant { temperature_k } => {
                History::Constant { temperature_k: *temperature_k }
            }
            HistoryPlan::RampAndHold {
                start_temperature_k,
                rate_k_per_s,
                hold_temperature_k,
                cool_down,
            } => History::RampAndHold {
                start_k: *start_temperature_k,
                rate_k_per_s: *rate_k_per_s,
                hold_k: *hold_temperature_k,
                then: cool_down.map(|[hold_s, rate_k_per_s]| CoolDown { hold_s, rate_k_per_s }),
            },
            HistoryPlan::Table { time_s, temperature_k, .. } => {
                History::Table(time_s.iter().copied().zip(temperature_k.iter().copied()).collect())
            }
        };
        Ok(Heat::new(&history, &self.mobility(value)?, self.start_s)?)
    }

    /// The mobility over temperature.
    fn mobility(
        &self,
        value: impl Fn(ParameterName) -> Result<f64, NoHeat>,
    ) -> Result<Mobility, NoHeat> {
        use ParameterName as P;
        let law = match self.law {
            LawPlan::Arrhenius { reference_temperature_k: reference_k } => MobilityLaw::Arrhenius {
                activation_energy_j_per_mol: value(P::ActivationEnergy)?,
                reference_k,
            },
            LawPlan::Wlf { reference_temperature_k: reference_k } => {
                MobilityLaw::Wlf { c1: value(P::WlfC1)?, c2_k: value(P::WlfC2)?, reference_k }
            }
            LawPlan::Vogel { reference_temperature_k: reference_k } => {
                MobilityLaw::Vogel { b_k: value(P::VogelB)?, t0_k: value(P::VogelT0)?, reference_k }
            }
            LawPlan::Direct | LawPlan::ThresholdPower { .. } => return Err(NoHeat::NoTemperature),
        };
        let mobility = Mobility::new(law)?;
        Ok(match self.frozen_below_k {
            Some(frozen_below_k) => mobility.frozen_below(frozen_below_k)?,
            None => mobility,
        })
    }
}

#[cfg(test)]
mod tests;
