//! The knee of the kinetics, and the time to a contact ratio.

use crate::heat::Heat;
use crate::kinetics::{WithLaw, Zipping, knee_contact_ratio, with_law};
use crate::{Kinetic, Kinetics, PairScene, Sintering};

/// The knee between stages 2 and 3 of the `three-stage` kinetics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knee {
    /// Contact ratio `a_ve/R` of the knee, wherever it lies.
    pub contact_ratio: f64,
    /// Time at which the contact reaches it \[s\]: 0 where stage 2 is absent, infinite where stage 3 is.
    pub time_s: f64,
    /// Whether zipping happens at all: the knee is above the starting contact.
    pub has_zipping: bool,
    /// Whether stretching happens at all: the knee is below the final contact ratio.
    pub has_stretching: bool,
}

/// The knee of `three-stage` and `three-stage-pokluda`.
///
/// Parameters that no run would accept give a knee of NaN without either stage.
#[must_use]
pub fn knee(scene: &PairScene, sintering: &Sintering) -> Knee {
    let contact_ratio = knee_contact_ratio(sintering.delta_c, scene.radius_m());
    let Ok(zipping) = Zipping::new(scene, sintering) else {
        let nan = f64::NAN;
        return Knee { contact_ratio: nan, time_s: nan, has_zipping: false, has_stretching: false };
    };
    let has_zipping = contact_ratio > scene.start_contact_ratio();
    let has_stretching = contact_ratio < scene.final_contact_ratio();
    let time_s = if has_stretching {
        zipping.time_to_overlap(contact_ratio * contact_ratio)
    } else {
        f64::INFINITY
    };
    Knee { contact_ratio, time_s, has_zipping, has_stretching }
}

/// Time \[s\] at which the quasi-static pair reaches a contact ratio; the inverse of the closed form.
///
/// `None` where it never does (beyond phi, or at `2^(1/3)`, which Pokluda's law only approaches),
/// and for parameters that no run would accept. 0 at or below the starting contact.
#[must_use]
pub fn time_to_contact_ratio(
    scene: &PairScene,
    kinetics: Kinetics,
    sintering: &Sintering,
    target: f64,
) -> Option<f64> {
    struct Inverse<'a> {
        scene: &'a PairScene,
        sintering: &'a Sintering,
        overlap: f64,
    }
    impl WithLaw for Inverse<'_> {
        type Output = Option<f64>;
        fn run<K: Kinetic>(self) -> Option<f64> {
            Some(K::new(self.scene, self.sintering).ok()?.time_to_overlap(self.overlap))
        }
    }
    // phi itself is reached, whatever the rounding of its square.
    let overlap =
        if target == scene.final_contact_ratio() { scene.final_overlap() } else { target * target };
    let time = with_law(kinetics, Inverse { scene, sintering, overlap })?;
    (target >= 0.0 && time.is_finite()).then_some(time)
}

/// [`time_to_contact_ratio`] under a heat, to which the parameters are those of m = 1: `None` also where the pair freezes below the
/// target.
#[must_use]
pub fn heated_time_to_contact_ratio(
    scene: &PairScene,
    law: (Kinetics, &Sintering),
    heat: &Heat,
    target: f64,
) -> Option<f64> {
    heat.time(time_to_contact_ratio(scene, law.0, law.1, target)?)
}
