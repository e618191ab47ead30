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
}

impl ParameterName {
    /// All of them, in the order in which they are calibrated.
    pub const ALL: [Self; 6] =
        [Self::C1, Self::TauS, Self::DeltaC, Self::Lambda, Self::Phi, Self::T0];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::C1 => "c1",
            Self::TauS => "tau_s",
            Self::DeltaC => "delta_c",
            Self::Lambda => "lambda",
            Self::Phi => "phi",
            Self::T0 => "t0",
        }
    }

    /// SI unit; `1` for phi.
    pub fn unit(self) -> &'static str {
        match self {
            Self::C1 => "1/(Pa s)",
            Self::TauS | Self::Lambda | Self::T0 => "s",
            Self::DeltaC => "m",
            Self::Phi => "1",
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
        }
    }

    /// Whether it is calibrated only where it has a prior: otherwise phi is the experiment's and t0 is zero.
    pub fn is_optional(self) -> bool {
        matches!(self, Self::Phi | Self::T0)
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

    /// Whether a curve under these kinetics depends on it.
    pub fn is_used_by(self, kinetics: Kinetics) -> bool {
        match self {
            Self::C1 | Self::DeltaC => kinetics.uses_c1_delta_c(),
            Self::Lambda => kinetics.uses_lambda(),
            Self::TauS | Self::Phi | Self::T0 => true,
        }
    }
}
