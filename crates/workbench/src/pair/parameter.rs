//! The parameters of the neck growth model.

use dem_core::Kinetics;
use serde::{Deserialize, Serialize};
use smc_calib::{Prior, PriorSpec};

/// A parameter of the neck growth model.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterName {
    /// Fluidity C1 \[1/(Pa s)\].
    C1,
    /// Sintering time tau_s \[s\].
    TauS,
    /// Cut-off distance delta_c \[m\].
    DeltaC,
    /// Relaxation time lambda \[s\] of the melt.
    Lambda,
    /// Final contact ratio phi.
    Phi,
    /// Time of first contact t0 \[s\] in the table's clock: growth at time t is that of t - t0.
    T0,
    /// Mobility right after a pulse, over that of C1 and tau_s.
    Amplitude,
    /// Time constant \[s\] that a pulse cools with.
    CoolingTime,
    /// Power of R that the cooling time goes with.
    CoolingPower,
    /// Activation energy \[J/mol\] of an Arrhenius mobility.
    ActivationEnergy,
    /// First constant of the WLF law.
    WlfC1,
    /// Second constant of the WLF law \[K\].
    WlfC2,
    /// Constant B of the Vogel law \[K\].
    VogelB,
    /// Vogel temperature \[K\].
    VogelT0,
    /// Heating of a pulse per unit of its energy \[K\].
    Heating,
    /// Energy of a pulse below which nothing moves, in the unit of the pulses.
    ThresholdEnergy,
    /// Power of the energy above the threshold that the mobility goes with.
    EnergyPower,
}

impl ParameterName {
    /// All of them, in the order in which they are calibrated.
    pub const ALL: [Self; 17] = [
        Self::C1,
        Self::TauS,
        Self::DeltaC,
        Self::Lambda,
        Self::Phi,
        Self::T0,
        Self::Amplitude,
        Self::CoolingTime,
        Self::CoolingPower,
        Self::ActivationEnergy,
        Self::WlfC1,
        Self::WlfC2,
        Self::VogelB,
        Self::VogelT0,
        Self::Heating,
        Self::ThresholdEnergy,
        Self::EnergyPower,
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::C1 => "c1",
            Self::TauS => "tau_s",
            Self::DeltaC => "delta_c",
            Self::Lambda => "lambda",
            Self::Phi => "phi",
            Self::T0 => "t0",
            Self::Amplitude => "amplitude",
            Self::CoolingTime => "cooling_time",
            Self::CoolingPower => "cooling_power",
            Self::ActivationEnergy => "activation_energy",
            Self::WlfC1 => "wlf_c1",
            Self::WlfC2 => "wlf_c2",
            Self::VogelB => "vogel_b",
            Self::VogelT0 => "vogel_t0",
            Self::Heating => "heating",
            Self::ThresholdEnergy => "threshold_energy",
            Self::EnergyPower => "energy_power",
        }
    }

    /// SI unit; `1` for bare numbers, among them energies of pulses.
    pub fn unit(self) -> &'static str {
        match self {
            Self::C1 => "1/(Pa s)",
            Self::TauS | Self::Lambda | Self::T0 | Self::CoolingTime => "s",
            Self::DeltaC => "m",
            Self::ActivationEnergy => "J/mol",
            Self::WlfC2 | Self::VogelB | Self::VogelT0 | Self::Heating => "K",
            Self::Phi
            | Self::Amplitude
            | Self::CoolingPower
            | Self::WlfC1
            | Self::ThresholdEnergy
            | Self::EnergyPower => "1",
        }
    }

    /// What it is, in a few words.
    pub fn meaning(self) -> &'static str {
        match self {
            Self::C1 => "fluidity",
            Self::TauS => "sintering time",
            Self::DeltaC => "cut-off distance",
            Self::Lambda => "relaxation time",
            Self::Phi => "final contact ratio",
            Self::T0 => "time of first contact in the clock of the table",
            Self::Amplitude => "mobility right after the pulse",
            Self::CoolingTime => "time constant of cooling",
            Self::CoolingPower => "power of R that the cooling time goes with",
            Self::ActivationEnergy => "activation energy of the mobility",
            Self::WlfC1 => "first constant of the WLF law",
            Self::WlfC2 => "second constant of the WLF law",
            Self::VogelB => "constant B of the Vogel law",
            Self::VogelT0 => "Vogel temperature",
            Self::Heating => "heating per unit of pulse energy",
            Self::ThresholdEnergy => "pulse energy below which nothing moves",
            Self::EnergyPower => "power of the energy above the threshold",
        }
    }

    /// The parameter of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|parameter| parameter.name() == name)
    }

    /// The sizes that are computed with, beside 0: far wider than any material, and such that no result overflows.
    pub fn range(self) -> [f64; 2] {
        match self {
            Self::C1 => [1e-30, 1e30],
            Self::TauS | Self::Lambda | Self::T0 => [1e-15, 1e15],
            Self::DeltaC => [1e-15, 1e3],
            Self::Phi => [0.1, 2.0],
            Self::Amplitude | Self::CoolingTime => [1e-15, 1e15],
            Self::CoolingPower => [0.0, 4.0],
            Self::ActivationEnergy => [1.0, 1e7],
            Self::WlfC1 => [1e-3, 1e3],
            Self::WlfC2 | Self::VogelT0 => [1e-3, 1e4],
            Self::VogelB => [1e-3, 1e6],
            Self::Heating => [1e-12, 1e12],
            Self::ThresholdEnergy => [1e-12, 1e12],
            Self::EnergyPower => [1e-3, 100.0],
        }
    }

    /// Whether it is calibrated only where it has a prior: otherwise phi is the experiment's, t0 is zero and an amplitude is 1.
    pub fn is_optional(self) -> bool {
        matches!(self, Self::Phi | Self::T0 | Self::Amplitude)
    }

    /// Whether it belongs to a heat, and is calibrated only where an experiment leaves it open.
    pub fn is_of_heat(self) -> bool {
        self as usize > Self::T0 as usize
    }

    /// The prior that is taken where none is given: lambda from a thousandth of tau_s to ten times it, as far as the prior of tau_s goes
    /// (2.5 % and 97.5 %), each power of ten as probable as any other. lambda/tau_s is the surface tension over the elastic
    /// modulus of the melt times R; at a thousandth of tau_s it makes no difference that could be measured, at ten times tau_s it alone
    /// decides.
    pub fn default_prior(self, tau_s: &Prior) -> Option<Prior> {
        if self != Self::Lambda {
            return None;
        }
        let [least, most] = self.range();
        let lower = (1e-3 * tau_s.quantile(0.025)).clamp(least, 1e-2 * most);
        let upper = (10.0 * tau_s.quantile(0.975)).clamp(10.0 * lower, most);
        Prior::new(PriorSpec::LogUniform { lower, upper }).ok()
    }

    /// Whether it can be negative: first contact may lie before the clock of the table starts.
    pub fn may_be_negative(self) -> bool {
        self == Self::T0
    }

    /// Whether a curve under these kinetics depends on it, whatever the heat.
    pub fn is_used_by(self, kinetics: Kinetics) -> bool {
        match self {
            Self::C1 | Self::DeltaC => kinetics.uses_c1_delta_c(),
            Self::Lambda => kinetics.uses_lambda(),
            Self::TauS | Self::Phi | Self::T0 => true,
            _ => false,
        }
    }
}
