//! The adhesive force that a scene states, and what it goes together with.

use serde::{Deserialize, Serialize};

use super::error::{BedError, field, within};
use super::phase::Mode;
use super::place::solid_m3;
use super::scene_file::SceneFile;
use super::vec3::norm;

/// `[adhesion]`: the adhesive force fa of two particles of the mean radius, by one of two fields. Of other particles it goes
/// by their effective radius.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AdhesionTable {
    /// The force \[N\].
    pub force_n: Option<f64>,
    /// The force over the weight of a particle, the Bond number.
    pub bond_number: Option<f64>,
}

impl SceneFile {
    /// The adhesive force of two particles of a radius \[N\], where it is stated.
    pub(super) fn adhesion_n(&self, radius_m: f64) -> Option<f64> {
        let table = self.adhesion.as_ref()?;
        let acceleration = self.gravity.as_ref().map_or([0.0; 3], |g| g.acceleration_m_per_s2);
        let weight = self.material.density_kg_per_m3 * solid_m3(&[radius_m]) * norm(acceleration);
        table.force_n.or_else(|| Some(table.bond_number? * weight))
    }

    /// An error of the adhesive force with the fields of this file; `phase`: the index of the one whose stiffness it is about.
    pub(super) fn in_words_of_the_file(&self, error: BedError, phase: Option<usize>) -> BedError {
        match (error, &self.adhesion) {
            (BedError::Field { remedy, .. }, Some(AdhesionTable { force_n: Some(force), .. })) => {
                field("adhesion.force_n", force, remedy)
            }
            (BedError::Field { remedy, .. }, Some(AdhesionTable { bond_number: Some(n), .. })) => {
                field("adhesion.bond_number", n, remedy)
            }
            (BedError::Adhesion { place, k1, overlap, needed_k1 }, _) => {
                let of = |index: usize| self.phases[index].field_name(index, "k1_n_per_m");
                BedError::Adhesion { place: phase.map_or(place, of), k1, overlap, needed_k1 }
            }
            (other, _) => other,
        }
    }

    /// Checks adhesion against gravity, and friction against the modes.
    pub(super) fn check_forces(&self) -> Result<(), BedError> {
        let gravity = self.gravity.as_ref().map_or(0.0, |g| norm(g.acceleration_m_per_s2));
        within("gravity.acceleration_m_per_s2", gravity, 0.0, 1e6, "use 0 to 1e6 m/s2")?;
        let pulls = gravity > 0.0;
        match &self.adhesion {
            None if pulls => {
                let remedy = "with gravity the ratio of the adhesive force to the weight decides: give adhesion.bond_number, \
                              or adhesion.force_n";
                return Err(field("adhesion", "left out", remedy));
            }
            None => {}
            Some(AdhesionTable { force_n: Some(force), bond_number: None }) => {
                within("adhesion.force_n", *force, 1e-30, 1e6, "give it in newton, above 0")?;
            }
            Some(AdhesionTable { force_n: None, bond_number: Some(number) }) => {
                within("adhesion.bond_number", *number, 1e-6, 1e12, "use 1e-6 to 1e12")?;
                if !pulls {
                    let remedy =
                        "the Bond number needs the weight: give [gravity], or adhesion.force_n";
                    return Err(field("adhesion.bond_number", number, remedy));
                }
            }
            Some(_) => {
                let remedy = "give one of adhesion.force_n and adhesion.bond_number";
                return Err(field("adhesion", "none or both of its fields", remedy));
            }
        }
        let still = self.phases.iter().find(|phase| phase.mode == Mode::QuasiStatic);
        if let (Some(_), Some(phase)) = (&self.friction, still) {
            let remedy = "a balance of forces has no friction: use mode = \"dynamic\" in every phase (mass_scaling makes it \
                          shorter), or leave [friction] out";
            let with = format!("given with the quasi-static phase {}", phase.name);
            return Err(field("friction", with, remedy));
        }
        Ok(())
    }
}
