//! Laws of neck growth in equilibrium: one file per law.
//!
//! A law is the rate `dx/dt` of the overlap `x = delta/R = (a/R)^2` of a pair in force balance. Every
//! run starts at the adhesive contact, `x0 = max(fa/(K1 R), (a0/R)^2)` (eq. 3), so that each law
//! carries the time offset of that start; and each stops at the final overlap `phi^2`.
//!
//! The solvers are monomorphised over [`Kinetic`]; the enum [`Kinetics`] only dispatches once per run.

mod bellehumeur;
mod frenkel;
mod pokluda;
mod regime_map;
mod three_stage;
mod three_stage_pokluda;
mod zipping;

pub use bellehumeur::Bellehumeur;
pub use frenkel::Frenkel;
pub use pokluda::Pokluda;
pub use regime_map::{RegimeMap, Regimes};
pub use three_stage::{ThreeStage, knee_contact_ratio};
pub use three_stage_pokluda::ThreeStagePokluda;
pub use zipping::{Zipping, zipping_rate_per_s};

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::lanes::Lanes;
use crate::{PairScene, Sintering, SolveError};

/// A growth law of the pair in force balance. Overlaps in radii, times in seconds.
pub trait Kinetic: Copy + Send + Sync {
    /// The law for a scene and its parameters.
    ///
    /// # Errors
    ///
    /// A [`SolveError`] for a parameter (that this law uses) which is not positive and finite, or
    /// for a rate that does not fit into a number.
    fn new(scene: &PairScene, sintering: &Sintering) -> Result<Self, SolveError>;

    /// Whether the law has a first branch.
    const HAS_SWITCH: bool;

    /// Coefficients of the rate.
    fn coefficients(&self) -> RateCoefficients<f64>;

    /// `dx/dt` \[1/s\] of the first branch as numerator and denominator, smooth beyond the switch.
    fn rate_before_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L);

    /// `dx/dt` \[1/s\] of the second branch as numerator and denominator.
    fn rate_after_switch<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L);

    /// `dx/dt` \[1/s\] as numerator and denominator, for a solver that divides anyway.
    #[inline(always)]
    fn rate_fraction<L: Lanes>(coefficients: &RateCoefficients<L>, overlap: L) -> (L, L) {
        if Self::HAS_SWITCH {
            L::choose_pair(
                overlap,
                coefficients.switch,
                || Self::rate_before_switch(coefficients, overlap),
                || Self::rate_after_switch(coefficients, overlap),
            )
        } else {
            Self::rate_after_switch(coefficients, overlap)
        }
    }

    /// `dx/dt` \[1/s\].
    #[inline]
    fn rate(&self, overlap: f64) -> f64 {
        let (numerator, denominator) = Self::rate_fraction(&self.coefficients(), overlap);
        numerator / denominator
    }

    /// Overlap that the law approaches; infinite where only phi ends the growth.
    #[inline]
    fn limit_overlap(&self) -> f64 {
        f64::INFINITY
    }

    /// Time that the overlap rests at `x0` before the rate applies \[s\]; 0 for all but [`RegimeMap`].
    #[inline]
    fn rest_s(&self) -> f64 {
        0.0
    }

    /// Exact contact ratios `a/R = sqrt(x)` at sorted times \[s\]. Allocates nothing.
    ///
    /// `contact_ratio` must be as long as `times_s`.
    fn contact_ratios(&self, times_s: &[f64], contact_ratio: &mut [f64]);

    /// Time \[s\] at which the overlap is reached: 0 at or below the start, infinite where it never is.
    fn time_to_overlap(&self, overlap: f64) -> f64;
}

/// Coefficients of a rate, of one curve or of several side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateCoefficients<L> {
    /// Overlap at which the first branch gives way to the second; 0 where there is only the second.
    pub switch: L,
    /// `(2/7) B` of [`Zipping`] \[1/s\].
    pub zipping: L,
    /// `1/tau_s` \[1/s\].
    pub stretching: L,
    /// `lambda/tau_s` of [`Bellehumeur`].
    pub relaxation: L,
}

impl RateCoefficients<f64> {
    /// No growth.
    pub(crate) const NONE: Self =
        Self { switch: 0.0, zipping: 0.0, stretching: 0.0, relaxation: 0.0 };
}

/// The kinetics by name; serialised as that [name](Self::name).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Kinetics {
    /// The paper's: adhesive contact, zipping up to the knee, then stretching ([`ThreeStage`]).
    #[default]
    ThreeStage,
    /// Stretching alone ([`Frenkel`]).
    Frenkel,
    /// Frenkel's law at constant volume ([`Pokluda`]).
    Pokluda,
    /// The paper's with stage 3 at constant volume ([`ThreeStagePokluda`]).
    ThreeStagePokluda,
    /// `max(a0, a1, a2)` of Fig. 2 and Lin et al. ([`RegimeMap`]).
    RegimeMap,
    /// Pokluda's law for a viscoelastic melt ([`Bellehumeur`]).
    Bellehumeur,
}

impl Kinetics {
    /// All of them, the default first.
    pub const ALL: [Self; 6] = [
        Self::ThreeStage,
        Self::Frenkel,
        Self::Pokluda,
        Self::ThreeStagePokluda,
        Self::RegimeMap,
        Self::Bellehumeur,
    ];

    /// The name a user types.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ThreeStage => "three-stage",
            Self::Frenkel => "frenkel",
            Self::Pokluda => "pokluda",
            Self::ThreeStagePokluda => "three-stage-pokluda",
            Self::RegimeMap => "regime-map",
            Self::Bellehumeur => "bellehumeur",
        }
    }

    /// Whether C1 and delta_c enter the law; `frenkel`, `pokluda` and `bellehumeur` are without.
    #[must_use]
    pub fn uses_c1_delta_c(self) -> bool {
        !matches!(self, Self::Frenkel | Self::Pokluda | Self::Bellehumeur)
    }

    /// Whether lambda enters the law.
    #[must_use]
    pub fn uses_lambda(self) -> bool {
        self == Self::Bellehumeur
    }

    /// Whether two particles that keep their volume take for ever to become one: `2^(1/3)` is never reached.
    #[must_use]
    pub fn only_approaches_the_merged_pair(self) -> bool {
        matches!(self, Self::Pokluda | Self::ThreeStagePokluda | Self::Bellehumeur)
    }

    /// Whether C1 and delta_c can be told apart by the curve. In `regime-map` they enter only as the
    /// product `C1 delta_c^2`, so that a calibration can know the product but neither factor.
    #[must_use]
    pub fn separates_c1_from_delta_c(self) -> bool {
        matches!(self, Self::ThreeStage | Self::ThreeStagePokluda)
    }
}

impl fmt::Display for Kinetics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that is not one of a closed list.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what} '{value}': use one of {choices}")]
pub struct UnknownName {
    /// Kind of thing that was named.
    pub what: &'static str,
    /// The unknown name.
    pub value: String,
    /// The known names.
    pub choices: String,
}

impl FromStr for Kinetics {
    type Err = UnknownName;

    fn from_str(value: &str) -> Result<Self, UnknownName> {
        Self::ALL.into_iter().find(|kinetics| kinetics.name() == value).ok_or_else(|| UnknownName {
            what: "kinetics",
            value: value.to_owned(),
            choices: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// Generic work over the type that a [`Kinetics`] names.
pub(crate) trait WithLaw {
    type Output;
    fn run<K: Kinetic>(self) -> Self::Output;
}

/// The one place where the name becomes a type.
pub(crate) fn with_law<W: WithLaw>(kinetics: Kinetics, work: W) -> W::Output {
    match kinetics {
        Kinetics::ThreeStage => work.run::<ThreeStage>(),
        Kinetics::Frenkel => work.run::<Frenkel>(),
        Kinetics::Pokluda => work.run::<Pokluda>(),
        Kinetics::ThreeStagePokluda => work.run::<ThreeStagePokluda>(),
        Kinetics::RegimeMap => work.run::<RegimeMap>(),
        Kinetics::Bellehumeur => work.run::<Bellehumeur>(),
    }
}
