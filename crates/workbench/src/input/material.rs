//! The built-in materials: the powders of Table 1, each with its experiment, prior and the paper's
//! result.

use std::fmt;

use dem_core::printed::{self, PrintedTable3};
use dem_core::{Powder, Sintering, paper};
use serde::{Deserialize, Serialize};

/// A built-in material.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Material {
    /// Polystyrene.
    Ps,
    /// Polyamide 12.
    Pa12,
    /// PEEK 450PF.
    Peek,
}

impl Material {
    /// All of them, in the order of the paper's tables.
    pub const ALL: [Self; 3] = [Self::Ps, Self::Pa12, Self::Peek];

    /// The names a user types, in the order of [`ALL`](Self::ALL).
    pub const NAMES: [&'static str; 3] = ["ps", "pa12", "peek"];

    /// The name a user types.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The material of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|material| material.name() == name)
    }

    /// The name for a heading.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ps => "PS (polystyrene)",
            Self::Pa12 => "PA12 (polyamide 12)",
            Self::Peek => "PEEK 450PF",
        }
    }

    /// R, E and gamma of Table 1, the density of Table 2.
    pub fn powder(self) -> Powder {
        match self {
            Self::Ps => paper::PS,
            Self::Pa12 => paper::PA12,
            Self::Peek => paper::PEEK_450PF,
        }
    }

    /// Name of the built-in experiment that the material is calibrated on.
    pub fn experiment_name(self) -> &'static str {
        match self {
            Self::Ps => "ps-r30",
            Self::Pa12 => "pa12-r32",
            Self::Peek => "peek-450pf-r25",
        }
    }

    /// The paper's result as printed in Table 3.
    pub fn table3(self) -> PrintedTable3 {
        match self {
            Self::Ps => paper::PS_TABLE3,
            Self::Pa12 => paper::PA12_TABLE3,
            Self::Peek => paper::PEEK_450PF_TABLE3,
        }
    }

    /// The paper's result in SI, through [`printed::from_printed`] at the radius of Table 1.
    pub fn table3_sintering(self) -> Sintering {
        printed::from_printed(&self.table3(), self.powder().radius_m)
    }

    /// The same for a pair of another radius \[m\]: tau_s is proportional to it.
    pub fn table3_sintering_at(self, radius_m: f64) -> Sintering {
        self.table3_sintering().at_radius(self.powder().radius_m, radius_m)
    }
}

impl fmt::Display for Material {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
