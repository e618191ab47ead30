//! The end of the pairs: where the necks of the particles meet, and what follows.
//!
//! A bed is a sum of pairs as long as the necks of a particle are apart. Where they meet on more than [`NECKS_MEET`] of the
//! particles, or where the pores close ([`CLOSED`]), the density goes on by the [closed laws](crate::densification) of open
//! and then of closed pores, from the density of the bed there, one cell and then one pore for each particle; or the run
//! ends. These laws are isotropic and free: they know no sides that stay where they are, and no resistance of necks. The rates before and after are
//! recorded ([`EndRates`]). A bed whose volume does not follow its particles (open sides, a box that is not free), or that does not fill its
//! volume ([`LEAST_CLOSING`]), has no such law: its pairs go on, and make no new contacts.

use serde::{Deserialize, Serialize};

use super::engine::Bed;
use super::material::Growing;
use crate::densification::CLOSED;

/// Share of the particles on which two necks meet, above which the model, a sum of pairs, has ended.
pub const NECKS_MEET: f64 = 0.05;

/// Least relative density at the end of the pairs from which on the closed laws hold: below it the particles are a cluster in
/// a box, not a bed that fills it. Settled beds of sticky particles have 0.47 and more before they sinter.
pub const LEAST_CLOSING: f64 = 0.5;

/// A step of the quasi-static mode is repeated where it goes further beyond [`CLOSED`].
const BEYOND: f64 = 0.005;

/// `sintering.when_necks_meet`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum WhenNecksMeet {
    /// The density goes on by Scherer's cell until its pores close and by Mackenzie and Shuttleworth's law from there.
    #[default]
    Closure,
    /// The run ends.
    Stop,
}

/// The law by which a bed densifies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// The contacts of the particles.
    #[default]
    Pairs,
    /// Open pores, Scherer's cell.
    Cell,
    /// Closed pores, Mackenzie and Shuttleworth.
    Pores,
}

impl Law {
    pub(crate) const ALL: [Self; 3] = [Self::Pairs, Self::Cell, Self::Pores];

    /// The closed law that holds at a density.
    pub(crate) fn at(relative_density: f64) -> Self {
        if relative_density < CLOSED { Self::Cell } else { Self::Pores }
    }

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pairs => "pairs",
            Self::Cell => "cell",
            Self::Pores => "pores",
        }
    }
}

/// Rates of the relative density where the pairs end, per tau_s of a particle of the mean volume. The closed laws are those of a bed that shrinks
/// alike in all directions and whose necks resist nothing: sides that stay where they are, and necks that resist, make the two rates differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndRates {
    /// By the contacts.
    pub by_pairs: f64,
    /// By the closed law that follows.
    pub by_closed_law: f64,
}

impl Bed {
    /// Whether the pairs have ended.
    pub(crate) fn pairs_have_ended(&self) -> bool {
        self.relative_density().is_some_and(|density| density >= CLOSED)
            || self.necks_meet() > NECKS_MEET
    }

    /// Whether the density is so far beyond the closing of the pores that the way there was too long.
    pub(crate) fn is_overfull(&self) -> bool {
        self.relative_density().is_some_and(|density| density > CLOSED + BEYOND)
    }

    /// tau_s of the closed laws \[s\]: that of a particle of the mean volume, so that there are as many cells, and pores, as
    /// particles.
    pub(crate) fn closure_tau_s(&self, growing: &Growing) -> f64 {
        let radii = &self.particles.radius_m;
        let volume = radii.iter().map(|radius| radius.powi(3)).sum::<f64>() / radii.len() as f64;
        growing.sintering.at_radius(growing.calibrated_radius_m, volume.cbrt()).tau_s
    }
}
