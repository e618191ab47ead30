//! The material of a bed and the constants of its contacts.

use serde::{Deserialize, Serialize};

use super::error::{BedError, field, within};
use crate::densification::Approach;
use crate::kinetics::{RateCoefficients, WithLaw, with_law};
use crate::{
    ContactLaw, Damping, Kinetic, Kinetics, PairScene, PairSpec, Sintering, SolveError, paper,
};

/// Friction after S. Luding, Granular Matter 10 (2008) 235: a tangential spring xi with a slider and a
/// dashpot,
///
/// ```text
/// f_t = -k_t xi - gamma_t v_t   while |f_t| <= mu (f_n + fa),   f_n + fa = f_ep - gamma_n v_n,
/// ```
///
/// and on the slider, at that limit, the spring is shortened to fit. mu is the ratio at which a contact slides: of the
/// tangential force to the normal one with which the surfaces press each other, the adhesive force fa included (B.V.
/// Derjaguin, Z. Physik 88 (1934) 661). An adhesive contact without load holds mu fa; one that is pulled by fa or more
/// slides freely.
///
/// In a scene file `[friction]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Coefficient of friction mu, 0 to 10.
    pub coefficient: f64,
    /// Tangential stiffness over K1, up to 1; 2/7 gives a tangential period equal to the normal one.
    #[serde(default = "two_sevenths")]
    pub tangential_stiffness_over_k1: f64,
    /// Tangential dissipation over the normal one, 0 to 1.
    #[serde(default = "half")]
    pub tangential_damping_over_normal: f64,
}

fn two_sevenths() -> f64 {
    2.0 / 7.0
}
fn half() -> f64 {
    0.5
}

impl Friction {
    /// No friction; what its springs would be.
    pub(crate) const NONE: Self = Self {
        coefficient: 0.0,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 0.5,
    };

    pub(crate) fn check(&self) -> Result<(), BedError> {
        within("friction.coefficient", self.coefficient, 0.0, 10.0, "use 0 to 10")?;
        within(
            "friction.tangential_stiffness_over_k1",
            self.tangential_stiffness_over_k1,
            1e-6,
            1.0,
            "use 1e-6 to 1; 2/7 is usual",
        )?;
        within(
            "friction.tangential_damping_over_normal",
            self.tangential_damping_over_normal,
            0.0,
            1.0,
            "use 0 to 1",
        )
    }
}

/// Largest overlap, in effective radii, that adhesion alone may give a contact: the particles of a bed are hard.
const LARGEST_ADHESIVE_OVERLAP: f64 = 0.02;
const LEAST_ADHESIVE_OVERLAP: f64 = 1e-9;

/// Growth of contacts: the kinetics, its parameters, and the radius of the calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growing {
    /// The law.
    pub kinetics: Kinetics,
    /// Its parameters.
    pub sintering: Sintering,
    /// The radius that `tau_s` belongs to \[m\].
    pub calibrated_radius_m: f64,
}

/// The material of all particles of a bed: the pair of the calibration at other radii.
///
/// The contact law is dimensionless and the same for all contacts. Quantities that depend on the radius are
/// evaluated for the effective radius `R = 2 Ri Rj/(Ri + Rj)` of a contact, and `2 Ri` at a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    spec: PairSpec,
    law: ContactLaw,
    approach: Approach,
    /// The adhesive force over the effective radius \[N/m\], where it does not go by K1.
    adhesion_n_per_m: Option<f64>,
    /// Resistance of sintered necks to shear and rolling over that of one viscosity for all motions; 0 for none.
    neck_viscosity: f64,
}

impl Material {
    /// # Errors
    ///
    /// [`BedError::Material`] as for a pair.
    pub fn new(spec: PairSpec) -> Result<Self, BedError> {
        let law = *spec.build()?.law();
        let approach = Approach::default();
        Ok(Self { spec, law, approach, adhesion_n_per_m: None, neck_viscosity: 0.0 })
    }

    /// The same with another law of the approach of two particles.
    #[must_use]
    pub fn with_approach(self, approach: Approach) -> Self {
        Self { approach, ..self }
    }

    /// The same with sintered necks that resist shear, rolling and twist: in `c_n/3`, `c_n a^2/4` and `c_n a^2/6` of a neck of radius a, with the
    /// resistance c_n to its own growth, times `neck_viscosity`. 1 is a Newtonian neck of one viscosity; 0 (the default) turns and
    /// slides freely.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`] for one that is not 0 or 1e-6 to 1e6.
    pub fn with_neck_viscosity(self, neck_viscosity: f64) -> Result<Self, BedError> {
        if neck_viscosity != 0.0 {
            let remedy = "use 1 for a Newtonian neck, 1e-6 to 1e6 times that, or 0 for none";
            within("sintering.neck_viscosity", neck_viscosity, 1e-6, 1e6, remedy)?;
        }
        Ok(Self { neck_viscosity, ..self })
    }

    /// Resistance of sintered necks to shear and rolling, over that of one viscosity for all motions; 0 for none.
    #[must_use]
    pub fn neck_viscosity(&self) -> f64 {
        self.neck_viscosity
    }

    /// The same with an adhesive force that does not depend on K1: `fa = adhesion_n_per_m R`, R the effective radius
    /// of a contact, for the present approach and whatever K1 may become.
    ///
    /// # Errors
    ///
    /// [`BedError::Adhesion`] where K1 is too soft for it, or [`BedError::Field`] for one that is not positive.
    pub fn with_adhesion(self, adhesion_n_per_m: f64) -> Result<Self, BedError> {
        within("adhesion_n_per_m", adhesion_n_per_m, 1e-30, 1e30, "give a positive force")?;
        Self { adhesion_n_per_m: Some(adhesion_n_per_m), ..self }.with_spec(self.spec)
    }

    /// The same with another description of the pair; a stated adhesive force stays as it is.
    pub(crate) fn with_spec(self, mut spec: PairSpec) -> Result<Self, BedError> {
        if let Some(adhesion_n_per_m) = self.adhesion_n_per_m {
            let overlap = adhesion_n_per_m / (spec.k1 * self.approach.factor());
            if overlap > LARGEST_ADHESIVE_OVERLAP {
                let needed_k1 = spec.k1 * overlap / LARGEST_ADHESIVE_OVERLAP;
                let place = "material.k1_n_per_m".to_owned();
                return Err(BedError::Adhesion { place, k1: spec.k1, overlap, needed_k1 });
            }
            if overlap < LEAST_ADHESIVE_OVERLAP {
                let remedy = "so small a force is not followed with this K1: lower k1_n_per_m";
                return Err(field("adhesion_n_per_m", adhesion_n_per_m, remedy));
            }
            spec.adhesion_over_k1_radius = overlap;
        }
        Ok(Self { law: *spec.build()?.law(), spec, ..self })
    }

    /// The same with another loading stiffness.
    pub(crate) fn with_k1(self, k1_n_per_m: f64) -> Result<Self, BedError> {
        self.with_spec(PairSpec { k1: k1_n_per_m, ..self.spec })
    }

    /// K1 with which adhesion alone gives a contact the overlap of the pair of the calibration, 1e-3 R, where the force is
    /// stated.
    pub(crate) fn pair_k1_n_per_m(&self) -> Option<f64> {
        let adhesion_n_per_m = self.adhesion_n_per_m?;
        Some(adhesion_n_per_m / (paper::ADHESION_OVER_K1_RADIUS * self.approach.factor()))
    }

    /// Adhesive force fa of two particles of a radius \[N\].
    #[must_use]
    pub fn adhesion_n(&self, radius_m: f64) -> f64 {
        self.law.adhesion * self.spec.k1 * self.overlap_unit(radius_m, radius_m)
    }

    /// Whether the adhesive force does not go by K1.
    pub(crate) fn has_stated_adhesion(&self) -> bool {
        self.adhesion_n_per_m.is_some()
    }

    /// The law of the approach of two particles.
    #[must_use]
    pub fn approach(&self) -> Approach {
        self.approach
    }

    /// Unit of the overlap of two particles \[m\]: `(a/R)^2` units are their approach.
    pub(crate) fn overlap_unit(&self, radius_i: f64, radius_j: f64) -> f64 {
        self.approach.factor() * effective_radius(radius_i, radius_j)
    }

    /// Unit of the overlap of a particle and a wall \[m\].
    pub(crate) fn wall_unit(&self, radius: f64) -> f64 {
        self.approach.factor() * (2.0 * radius)
    }

    /// The pair that this material was described by.
    #[must_use]
    pub fn spec(&self) -> &PairSpec {
        &self.spec
    }

    /// The contact law in units of the effective radius and of K1 times it.
    #[must_use]
    pub fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// Loading stiffness K1 \[N/m\].
    #[must_use]
    pub fn k1_n_per_m(&self) -> f64 {
        self.spec.k1
    }

    /// The pair of equal particles with a given radius.
    ///
    /// # Errors
    ///
    /// [`BedError::Material`], for instance where a contact of that radius would start coalesced.
    pub fn pair_of_radius(&self, radius_m: f64) -> Result<PairScene, BedError> {
        let mut spec = self.spec;
        spec.powder.radius_m = radius_m;
        Ok(spec.build()?)
    }

    /// Plastic overlap at which the growth of a contact ends: in balance with the final neck of its two particles.
    fn end_plastic(&self, radius_i: f64, radius_j: f64) -> f64 {
        let law = &self.law;
        let ratio = final_contact_ratio(self.spec.final_contact_ratio, radius_i, radius_j);
        // A final neck below the adhesive contact is that of the adhesive contact.
        law.equilibrium_plastic_overlap((ratio * ratio).max(law.adhesion))
    }

    /// Normal dissipation over effective mass, `c = gamma_n/m_eff` \[1/s\].
    pub(crate) fn dissipation(&self, effective_mass_kg: f64) -> f64 {
        match self.spec.damping {
            Damping::Restitution(e) => {
                let log = e.ln();
                -2.0 * log
                    * (self.spec.k1
                        / effective_mass_kg
                        / (std::f64::consts::PI.powi(2) + log * log))
                        .sqrt()
            }
            Damping::Coefficient(gamma_n) => gamma_n / effective_mass_kg,
        }
    }

    /// The constants of a contact of two particles (masses with their mass scaling).
    pub(crate) fn contact(
        &self,
        growing: Option<&Growing>,
        (radius_i, mass_i): (f64, f64),
        (radius_j, mass_j): (f64, f64),
    ) -> Result<ContactConstants, BedError> {
        let radius = effective_radius(radius_i, radius_j);
        let effective_mass = mass_i * mass_j / (mass_i + mass_j);
        let pair = self.pair_of_radius(radius)?;
        let rate = match growing {
            Some(growing) => rate_at_radius(&pair, growing)?,
            None => RateCoefficients::NONE,
        };
        Ok(ContactConstants {
            unit: self.overlap_unit(radius_i, radius_j),
            frequency_squared: self.spec.k1 / effective_mass,
            dissipation: self.dissipation(effective_mass),
            start: pair.x0(),
            end_plastic: self.end_plastic(radius_i, radius_j),
            rate,
        })
    }

    /// The constants of a contact with a wall, which does not grow.
    pub(crate) fn wall_contact(&self, radius: f64, mass: f64) -> ContactConstants {
        ContactConstants {
            unit: self.wall_unit(radius),
            frequency_squared: self.spec.k1 / mass,
            dissipation: self.dissipation(mass),
            start: self.law.adhesion,
            end_plastic: self.law.equilibrium_plastic_overlap(self.law.plastic_overlap_max),
            rate: RateCoefficients::NONE,
        }
    }
}

/// Effective radius of two particles, `2 Ri Rj/(Ri + Rj)`: two spheres that overlap by delta meet in a circle of radius
/// `sqrt(delta R)` while delta is small, whatever their ratio.
pub(crate) fn effective_radius(radius_i: f64, radius_j: f64) -> f64 {
    2.0 * radius_i * radius_j / (radius_i + radius_j)
}

/// Contact ratio a/R, in effective radii, at which the coalescence of two particles ends: `phi Rmin/R = phi (Ri + Rj)/(2 Rmax)`.
///
/// The neck is there as long as it is a waist, that is until it is as wide as the smaller particle. With its volume kept the smaller one is then a
/// hemisphere on the other, `2/3 pi a^3 = 4/3 pi Rmin^3`: `a = 2^(1/3) Rmin`, and what follows, the flattening of
/// that hemisphere into the larger particle, is not the growth of a neck. Where coalescence stops earlier,
/// `phi < 2^(1/3)`, the same share of that neck is reached. Equal particles end at phi.
#[must_use]
pub fn final_contact_ratio(phi: f64, radius_i: f64, radius_j: f64) -> f64 {
    // Exactly phi where they are equal.
    phi * (0.5 * (radius_i / radius_i.max(radius_j) + radius_j / radius_i.max(radius_j)))
}

/// Refuses a final contact ratio of equal particles that would need more than their matter: merged into one they have the radius
/// `2^(1/3)`, which may be written as 1.26.
pub(crate) fn check_final_contact_ratio(phi: f64) -> Result<(), BedError> {
    let remedy = "two equal particles merge into a sphere of 2^(1/3) = 1.26 radii, and a wider neck would need more than their \
                  volume: use 1.26, or less where coalescence stops earlier";
    within("material.final_contact_ratio", phi, 1e-3, 1.26, remedy)
}

/// The growth law of a pair of another radius than the calibrated one.
fn rate_at_radius(
    pair: &PairScene,
    growing: &Growing,
) -> Result<RateCoefficients<f64>, SolveError> {
    struct Coefficients<'a> {
        pair: &'a PairScene,
        sintering: Sintering,
    }
    impl WithLaw for Coefficients<'_> {
        type Output = Result<RateCoefficients<f64>, SolveError>;
        fn run<K: Kinetic>(self) -> Self::Output {
            Ok(K::new(self.pair, &self.sintering)?.coefficients())
        }
    }
    let sintering = if pair.radius_m() == growing.calibrated_radius_m {
        growing.sintering
    } else {
        growing.sintering.at_radius(growing.calibrated_radius_m, pair.radius_m())
    };
    with_law(growing.kinetics, Coefficients { pair, sintering })
}

/// Constants of a contact besides the contact law. SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactConstants {
    /// Unit of overlaps: the effective radius times the factor of the approach.
    pub(crate) unit: f64,
    /// `omega^2 = K1/m_eff`.
    pub(crate) frequency_squared: f64,
    /// `c = gamma_n/m_eff`.
    pub(crate) dissipation: f64,
    /// Overlap x0 of the adhesive contact, in effective radii.
    pub(crate) start: f64,
    /// Plastic overlap at which growth ends.
    pub(crate) end_plastic: f64,
    /// Growth of the overlap.
    pub(crate) rate: RateCoefficients<f64>,
}
