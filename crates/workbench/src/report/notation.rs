//! Scales and symbols that all figures share.

use figures::Axes;

use crate::pair::parameter::ParameterName;

/// Scale of the axes of time, or of another control variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TimeScale {
    /// Logarithmic where the measured values change early, so that a linear axis would hide it ([`Axes::change_early`]).
    #[default]
    ByData,
    /// Linear.
    Linear,
    /// Logarithmic.
    Log,
}

impl TimeScale {
    /// Whether it is logarithmic for measured values.
    pub(crate) fn is_log(self, control: &[f64], value: &[f64]) -> bool {
        match self {
            Self::ByData => Axes::change_early(control, value),
            Self::Linear => false,
            Self::Log => true,
        }
    }
}

/// How a parameter is written in a figure: symbol and unit.
pub(crate) fn symbol(name: &str, unit: &str) -> (String, String) {
    // A program's parameter may be called like one of a heat.
    let own = |known: &ParameterName| !known.is_of_heat() || known.unit() == unit;
    match ParameterName::from_name(name).filter(own) {
        Some(ParameterName::C1) => ("C_{1}".to_owned(), "Pa^{-1} s^{-1}".to_owned()),
        Some(ParameterName::TauS) => ("τ_{s}".to_owned(), "s".to_owned()),
        Some(ParameterName::DeltaC) => ("δ_{c}".to_owned(), "m".to_owned()),
        Some(ParameterName::Lambda) => ("λ".to_owned(), "s".to_owned()),
        Some(ParameterName::Phi) => ("φ".to_owned(), String::new()),
        Some(ParameterName::T0) => ("t_{0}".to_owned(), "s".to_owned()),
        Some(ParameterName::Amplitude) => ("M".to_owned(), String::new()),
        Some(ParameterName::CoolingTime) => ("t_{c}".to_owned(), "s".to_owned()),
        Some(ParameterName::CoolingPower) => ("n".to_owned(), String::new()),
        Some(ParameterName::ActivationEnergy) => ("E_{a}".to_owned(), "J/mol".to_owned()),
        Some(ParameterName::WlfC1) => ("c_{1}".to_owned(), String::new()),
        Some(ParameterName::WlfC2) => ("c_{2}".to_owned(), "K".to_owned()),
        Some(ParameterName::VogelB) => ("B".to_owned(), "K".to_owned()),
        Some(ParameterName::VogelT0) => ("T_{0}".to_owned(), "K".to_owned()),
        Some(ParameterName::Heating) => ("h".to_owned(), "K".to_owned()),
        Some(ParameterName::ThresholdEnergy) => ("E_{0}".to_owned(), String::new()),
        Some(ParameterName::EnergyPower) => ("p".to_owned(), String::new()),
        None => (name.to_owned(), unit.to_owned()),
    }
}
