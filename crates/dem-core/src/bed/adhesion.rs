//! The adhesive force that a scene states, and what it goes together with.

use serde::{Deserialize, Serialize};

use super::error::{BedError, field, within};

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

impl AdhesionTable {
    /// The force \[N\], where a particle has a weight.
    pub(super) fn force_of(&self, weight_n: f64) -> Option<f64> {
        self.force_n.or_else(|| Some(self.bond_number? * weight_n))
    }

    /// An error of the force with the field that states it.
    pub(super) fn named(&self, error: BedError) -> BedError {
        match (error, self.force_n, self.bond_number) {
            (BedError::Field { remedy, .. }, Some(force), _) => {
                field("adhesion.force_n", force, remedy)
            }
            (BedError::Field { remedy, .. }, None, Some(number)) => {
                field("adhesion.bond_number", number, remedy)
            }
            (other, ..) => other,
        }
    }
}

/// Checks adhesion against gravity, whose weights pull or do not.
pub(super) fn check_adhesion(table: Option<&AdhesionTable>, pulls: bool) -> Result<(), BedError> {
    match table {
        None if pulls => {
            let remedy = "with gravity the ratio of the adhesive force to the weight decides: give adhesion.bond_number, \
                          or adhesion.force_n";
            Err(field("adhesion", "left out", remedy))
        }
        None => Ok(()),
        Some(AdhesionTable { force_n: Some(force), bond_number: None }) => {
            within("adhesion.force_n", *force, 1e-30, 1e6, "give it in newton, above 0")
        }
        Some(AdhesionTable { force_n: None, bond_number: Some(number) }) => {
            within("adhesion.bond_number", *number, 1e-6, 1e12, "use 1e-6 to 1e12")?;
            if pulls {
                return Ok(());
            }
            let remedy = "the Bond number needs the weight: give [gravity], or adhesion.force_n";
            Err(field("adhesion.bond_number", number, remedy))
        }
        Some(AdhesionTable { force_n, .. }) => {
            let remedy = "give one of adhesion.force_n and adhesion.bond_number";
            let given = if force_n.is_some() {
                "both force_n and bond_number"
            } else {
                "neither force_n nor bond_number"
            };
            Err(field("adhesion", given, remedy))
        }
    }
}
