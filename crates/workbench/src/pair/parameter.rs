//! The parameters of the neck growth model.

use dem_core::Kinetics;
use serde::{Deserialize, Serialize};

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
    /// Final contact ratio phi.
    Phi,
}

impl ParameterName {
    /// All of them, in the order in which they are calibrated.
    pub const ALL: [Self; 4] = [Self::C1, Self::TauS, Self::DeltaC, Self::Phi];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::C1 => "c1",
            Self::TauS => "tau_s",
            Self::DeltaC => "delta_c",
            Self::Phi => "phi",
        }
    }

    /// SI unit; `1` for phi.
    pub fn unit(self) -> &'static str {
        match self {
            Self::C1 => "1/(Pa s)",
            Self::TauS => "s",
            Self::DeltaC => "m",
            Self::Phi => "1",
        }
    }

    /// The parameter of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|parameter| parameter.name() == name)
    }

    /// Whether a curve under these kinetics depends on it; phi always bounds the curve and need not be calibrated.
    pub fn is_used_by(self, kinetics: Kinetics) -> bool {
        match self {
            Self::C1 | Self::DeltaC => kinetics.uses_c1_delta_c(),
            Self::TauS | Self::Phi => true,
        }
    }
}
