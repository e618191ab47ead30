//! Constants of mobility laws from the literature.

use super::mobility::MobilityLaw;

/// Polystyrene: c1 = 13.7, c2 = 50.0 K at its glass transition, 373 K.
///
/// J.D. Ferry, *Viscoelastic Properties of Polymers*, 3rd ed., Wiley 1980, table 11-II. The constants hold from the glass
/// transition to some 100 K above it, for high molar mass; their reference is the glass transition, where m = 1.
pub const PS_WLF: MobilityLaw = MobilityLaw::Wlf { c1: 13.7, c2_k: 50.0, reference_k: 373.0 };

/// The constants c1 = 17.44 and c2 = 51.6 K that M.L. Williams, R.F. Landel, J.D. Ferry, J. Am. Chem. Soc. 77 (1955) 3701 give
/// for polymers whose own are not known, at the glass transition.
#[must_use]
pub fn universal_wlf(glass_transition_k: f64) -> MobilityLaw {
    MobilityLaw::Wlf { c1: 17.44, c2_k: 51.6, reference_k: glass_transition_k }
}
