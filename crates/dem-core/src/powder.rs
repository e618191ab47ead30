//! A powder: equal spheres of one material.

use serde::{Deserialize, Serialize};

/// A powder: equal spheres of one material. [`PairSpec::build`](crate::PairSpec::build) checks the ranges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Powder {
    /// Particle radius R \[m\].
    pub radius_m: f64,
    /// Young's modulus E \[Pa\].
    pub youngs_modulus_pa: f64,
    /// Surface tension gamma \[N/m\].
    pub surface_tension_n_per_m: f64,
    /// Density rho \[kg/m3\].
    pub density_kg_per_m3: f64,
}

impl Powder {
    /// Mass of one particle, `4/3 pi R^3 rho` \[kg\].
    #[must_use]
    pub fn mass_kg(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * self.radius_m.powi(3) * self.density_kg_per_m3
    }

    /// Adhesive contact ratio of JKR, `a0/R = (9 pi C0 W / (2R))^(1/3)` with `C0 = 1/(2E)` and
    /// `W = 2 gamma` (eq. 3). About 0.02 for polymers.
    #[must_use]
    pub fn adhesive_contact_ratio(&self) -> f64 {
        let instantaneous_compliance = 1.0 / (2.0 * self.youngs_modulus_pa);
        let work_of_adhesion = 2.0 * self.surface_tension_n_per_m;
        (9.0 * std::f64::consts::PI * instantaneous_compliance * work_of_adhesion
            / (2.0 * self.radius_m))
            .cbrt()
    }
}
