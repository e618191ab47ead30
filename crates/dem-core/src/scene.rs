//! The pair scene: two equal spheres and one relative coordinate.

use crate::contact_law::ContactLaw;
use crate::{Powder, SceneError, paper};

/// Dissipation of the contact. The quasi-static results do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damping {
    /// Coefficient of restitution e of the loading branch, in (0, 1]:
    /// `gamma_n = -2 ln e sqrt(K1 m_eff / (pi^2 + ln^2 e))`.
    Restitution(f64),
    /// The normal dissipation coefficient gamma_n itself \[kg/s\], not negative.
    Coefficient(f64),
}

impl Damping {
    /// gamma_n \[kg/s\], checked.
    fn coefficient(self, k1: f64, effective_mass_kg: f64) -> Result<f64, SceneError> {
        match self {
            Self::Restitution(e) => {
                between("damping (restitution)", e, 1e-12, 1.0, "a restitution is in (0, 1]")?;
                let log = e.ln();
                Ok(-2.0
                    * log
                    * (k1 * effective_mass_kg / (std::f64::consts::PI.powi(2) + log * log)).sqrt())
            }
            Self::Coefficient(gamma_n) => {
                let critical = 2.0 * (k1 * effective_mass_kg).sqrt();
                between(
                    "damping (coefficient)",
                    gamma_n,
                    0.0,
                    1e3 * critical,
                    "use 0 up to a thousand times critical damping, 2 sqrt(K1 m_eff)",
                )?;
                Ok(gamma_n)
            }
        }
    }
}

/// Description of a pair scene; [`build`](Self::build) checks it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairSpec {
    /// The particles.
    pub powder: Powder,
    /// Final contact ratio phi, where coalescence stops; `2^(1/3)` is two spheres merged into one.
    pub final_contact_ratio: f64,
    /// Loading stiffness K1 \[N/m\]; a numerical stiffness, 3e-4 in Table 2.
    pub k1: f64,
    /// Largest unloading stiffness over K1, above 1; 10 in Table 2.
    pub k2_max_over_k1: f64,
    /// Cohesion stiffness over K1, not negative; 1 in Table 2.
    pub kc_over_k1: f64,
    /// Adhesive force over `K1 R`; 1e-3, see [`paper::ADHESION_OVER_K1_RADIUS`].
    pub adhesion_over_k1_radius: f64,
    /// Dissipation; a restitution of 0.1 by default.
    pub damping: Damping,
}

impl PairSpec {
    /// The system of Table 2 for a powder and a final contact ratio.
    #[must_use]
    pub fn new(powder: Powder, final_contact_ratio: f64) -> Self {
        Self {
            powder,
            final_contact_ratio,
            k1: paper::K1_N_PER_M,
            k2_max_over_k1: paper::K2_MAX_OVER_K1,
            kc_over_k1: paper::KC_OVER_K1,
            adhesion_over_k1_radius: paper::ADHESION_OVER_K1_RADIUS,
            damping: Damping::Restitution(0.1),
        }
    }

    fn check_fields(&self) -> Result<(), SceneError> {
        let Powder { radius_m, youngs_modulus_pa, surface_tension_n_per_m, density_kg_per_m3 } =
            self.powder;
        between("radius_m", radius_m, 1e-12, 1e3, "give the radius in metres, 1e-12 to 1e3")?;
        between(
            "youngs_modulus_pa",
            youngs_modulus_pa,
            1e-6,
            1e18,
            "give Young's modulus in pascal, 1e-6 to 1e18",
        )?;
        between(
            "surface_tension_n_per_m",
            surface_tension_n_per_m,
            1e-12,
            1e6,
            "give the surface tension in N/m, 1e-12 to 1e6",
        )?;
        between(
            "density_kg_per_m3",
            density_kg_per_m3,
            1e-12,
            1e12,
            "give the density in kg/m3, 1e-12 to 1e12",
        )?;
        between(
            "final_contact_ratio",
            self.final_contact_ratio,
            1e-3,
            10.0,
            "a/R of the merged pair is 2^(1/3) = 1.26, or less where coalescence stops earlier",
        )?;
        between("k1", self.k1, 1e-15, 1e15, "give the loading stiffness in N/m, 1e-15 to 1e15")?;
        between(
            "k2_max_over_k1",
            self.k2_max_over_k1,
            1.0 + 1e-6,
            1e6,
            "the unloading stiffness must exceed the loading stiffness, by at most 1e6 times",
        )?;
        between("kc_over_k1", self.kc_over_k1, 0.0, 1e6, "use 0 to 1e6")?;
        between(
            "adhesion_over_k1_radius",
            self.adhesion_over_k1_radius,
            1e-9,
            1.0,
            "use 1e-9 to 1; the paper's value is 1e-3",
        )
    }

    /// Checks every field and what follows from them.
    ///
    /// # Errors
    ///
    /// [`SceneError`] with the field, its value and the remedy.
    pub fn build(&self) -> Result<PairScene, SceneError> {
        self.check_fields()?;
        let effective_mass_kg = self.powder.mass_kg() / 2.0;
        let dissipation_kg_per_s = self.damping.coefficient(self.k1, effective_mass_kg)?;
        let final_overlap = self.final_contact_ratio * self.final_contact_ratio;
        let law = ContactLaw {
            adhesion: self.adhesion_over_k1_radius,
            k2_max: self.k2_max_over_k1,
            kc: self.kc_over_k1,
            plastic_overlap_max: final_overlap,
        };
        if law.stiffening() * law.adhesion >= 0.5 {
            return Err(SceneError::FoldedEquilibrium {
                k2_max_over_k1: self.k2_max_over_k1,
                final_contact_ratio: self.final_contact_ratio,
                adhesion_over_k1_radius: self.adhesion_over_k1_radius,
            });
        }
        let start_overlap = law.adhesion.max(self.powder.adhesive_contact_ratio().powi(2));
        if start_overlap >= final_overlap {
            return Err(SceneError::StartsCoalesced {
                final_contact_ratio: self.final_contact_ratio,
                start_contact_ratio: start_overlap.sqrt(),
            });
        }
        Ok(PairScene {
            powder: self.powder,
            law,
            k1: self.k1,
            final_contact_ratio: self.final_contact_ratio,
            start_overlap,
            effective_mass_kg,
            dissipation_kg_per_s,
        })
    }
}

fn between(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
    remedy: &'static str,
) -> Result<(), SceneError> {
    // Not `value < low || value > high`: NaN must fail.
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(SceneError::Field { field, value, remedy })
    }
}

/// A checked pair scene.
#[derive(Debug, Clone, PartialEq)]
pub struct PairScene {
    powder: Powder,
    law: ContactLaw,
    k1: f64,
    final_contact_ratio: f64,
    start_overlap: f64,
    effective_mass_kg: f64,
    dissipation_kg_per_s: f64,
}

impl PairScene {
    /// The particles.
    #[must_use]
    pub fn powder(&self) -> &Powder {
        &self.powder
    }

    /// Particle radius R \[m\].
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.powder.radius_m
    }

    /// The contact law, in lengths of R and forces of `K1 R`.
    #[must_use]
    pub fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// Final contact ratio phi.
    #[must_use]
    pub fn final_contact_ratio(&self) -> f64 {
        self.final_contact_ratio
    }

    /// Final overlap `phi^2` in radii.
    #[must_use]
    pub fn final_overlap(&self) -> f64 {
        self.law.plastic_overlap_max
    }

    /// Overlap at t = 0 in radii, `x0 = max(fa/(K1 R), (a0/R)^2)`.
    #[must_use]
    pub fn x0(&self) -> f64 {
        self.start_overlap
    }

    /// Contact ratio at t = 0.
    #[must_use]
    pub fn start_contact_ratio(&self) -> f64 {
        self.start_overlap.sqrt()
    }

    /// Loading stiffness K1 \[N/m\].
    #[must_use]
    pub fn k1_n_per_m(&self) -> f64 {
        self.k1
    }

    /// Effective mass of the pair, `m_i m_j/(m_i + m_j)` \[kg\].
    #[must_use]
    pub fn effective_mass_kg(&self) -> f64 {
        self.effective_mass_kg
    }

    /// Normal dissipation coefficient gamma_n \[kg/s\].
    #[must_use]
    pub fn dissipation_kg_per_s(&self) -> f64 {
        self.dissipation_kg_per_s
    }

    /// Collision time `t_c = pi / sqrt(K1/m_eff - (gamma_n/(2 m_eff))^2)` \[s\], about 1e-3 s here;
    /// with overcritical damping, where a collision does not end, the undamped one.
    #[must_use]
    pub fn collision_time_s(&self) -> f64 {
        let undamped = self.k1 / self.effective_mass_kg;
        let half = self.dissipation_kg_per_s / (2.0 * self.effective_mass_kg);
        let squared = undamped - half * half;
        let frequency = if squared > 0.0 { squared } else { undamped };
        std::f64::consts::PI / frequency.sqrt()
    }

    /// Largest stable step of the Verlet solver, `2 sqrt(m_eff/K2max)` \[s\].
    ///
    /// The K2max branch decides, not K1. Damping, being integrated by the trapezoidal rule, leaves
    /// the limit where it is.
    #[must_use]
    pub fn step_limit_s(&self) -> f64 {
        2.0 * (self.effective_mass_kg / (self.law.k2_max * self.k1)).sqrt()
    }

    /// Time by which the inertia of the soft contact lets the pair lag behind its equilibrium,
    /// `sqrt(2 m_eff x R / fa)`: the time that fa needs to pull the pair through the overlap \[s\].
    #[must_use]
    pub fn inertial_lag_s(&self, overlap: f64) -> f64 {
        (2.0 * self.effective_mass_kg * overlap / (self.law.adhesion * self.k1)).sqrt()
    }
}
