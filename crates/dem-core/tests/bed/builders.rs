//! Beds shared by tests.

use dem_core::bed::{Bed, Growing, Material, Start, Surroundings};
use dem_core::{Damping, Kinetics, PairSpec, Sintering, paper};

const PHI: f64 = 1.259_921_049_894_873_2;

/// PA12, Table 3 in SI to two digits.
pub(crate) const PA12_SINTERING: Sintering =
    Sintering { c1: 2.4e-5, tau_s: 3.81, delta_c: 9.5e-8, lambda: 0.0 };

pub(crate) fn spec() -> PairSpec {
    PairSpec::new(paper::PA12, PHI)
}

pub(crate) fn material(change: impl FnOnce(&mut PairSpec)) -> Material {
    let mut spec = spec();
    change(&mut spec);
    Material::new(spec).expect("valid")
}

/// Negligible adhesion and no dissipation; the contact stays on its first branch.
pub(crate) fn elastic() -> Material {
    material(|spec| {
        spec.adhesion_over_k1_radius = 1e-9;
        spec.damping = Damping::Restitution(1.0);
    })
}

pub(crate) fn growing(kinetics: Kinetics) -> Growing {
    Growing { kinetics, sintering: PA12_SINTERING, calibrated_radius_m: paper::PA12.radius_m }
}

/// Equal particles at positions in radii.
pub(crate) fn start(radius_m: f64, positions: &[[f64; 3]]) -> Start {
    Start {
        position_m: positions.iter().map(|r| r.map(|x| x * radius_m)).collect(),
        radius_m: vec![radius_m; positions.len()],
        ..Start::default()
    }
}

pub(crate) fn free(material: Material, start: &Start) -> Bed {
    Bed::new(material, Surroundings::NOTHING, start).expect("valid")
}

/// Positions in the order of the scene.
pub(crate) fn positions(bed: &Bed) -> Vec<[f64; 3]> {
    in_scene_order(bed, &bed.particles().position_m)
}

pub(crate) fn velocities(bed: &Bed) -> Vec<[f64; 3]> {
    in_scene_order(bed, &bed.particles().velocity_m_per_s)
}

pub(crate) fn in_scene_order<T: Copy>(bed: &Bed, values: &[T]) -> Vec<T> {
    let mut ordered: Vec<_> = bed.particles().id.iter().zip(values).collect();
    ordered.sort_by_key(|(id, _)| **id);
    ordered.into_iter().map(|(_, value)| *value).collect()
}

/// A box of jittered simple cubic lattice, `n` to the side, just not touching, with random velocities
/// of so many radii per second.
pub(crate) fn cloud(radius_m: f64, n: usize, speed: f64) -> Start {
    let mut state = 1u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut start = Start::default();
    for x in 0..n {
        for y in 0..n {
            for z in 0..n {
                let mut at = |i: usize| (1.1 + 2.1 * i as f64 + 0.09 * random()) * radius_m;
                start.position_m.push([at(x), at(y), at(z)]);
                start.radius_m.push(radius_m);
            }
        }
    }
    for _ in 0..start.position_m.len() {
        let mut v = || 2.0 * speed * radius_m * random();
        start.velocity_m_per_s.push([v(), v(), v()]);
    }
    start
}
