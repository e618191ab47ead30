//! The beds whose cost is measured, by the names of what they have.

use dem_core::bed::{
    Bed, BedError, Drive, Friction, Growing, Material, Region, Side, Start, Surroundings,
    jammed_packing,
};
use dem_core::{Kinetics, PairSpec, Sintering, paper};

/// Parts of a scene, joined by `+`, as in `sintering+friction`.
pub(super) struct Scene<'a>(pub(super) &'a str);

impl Scene<'_> {
    fn has(&self, part: &str) -> bool {
        self.0.split('+').any(|own| own == part)
    }

    /// Region and particles: a pair, a chain or a jammed packing.
    pub(super) fn start(&self, particles: usize) -> Result<(Region, Start), BedError> {
        let radius_m = paper::PA12.radius_m;
        let mut start = Start::default();
        let row = |i: usize| [i as f64 * (2.0 - 1e-3) * radius_m, 0.0, 0.0];
        if particles == 2 || self.has("chain") {
            start.position_m = (0..particles).map(row).collect();
            start.radius_m = vec![radius_m; particles];
            return Ok((Region::OPEN, start));
        }
        let side = if self.has("walls") { Side::Walls } else { Side::Periodic };
        // Large periodic packings are copies of one of 2000 at most.
        let copies = (1..).find(|k| particles <= 2000 * k * k * k).unwrap_or(1);
        let count = particles / (copies * copies * copies);
        let size = (count as f64 * 7.5).cbrt() * radius_m;
        // Two radii that differ by a hair cost as much as any two.
        let unequal = if self.has("unequal") { 1.0001 } else { 1.0 };
        let radii: Vec<f64> =
            (0..count).map(|i| radius_m * if i % 2 == 0 { 1.0 } else { unequal }).collect();
        let cube = Region::new([size; 3], side);
        let (mut region, positions) = jammed_packing(&cube, &radii, 3e-4, 1)?;
        let shifts = (0..copies)
            .flat_map(|x| (0..copies).flat_map(move |y| (0..copies).map(move |z| [x, y, z])));
        for shift in shifts {
            for (position, &radius) in positions.iter().zip(&radii) {
                let at = |axis: usize| position[axis] + shift[axis] as f64 * region.size_m[axis];
                start.position_m.push([at(0), at(1), at(2)]);
                start.radius_m.push(radius);
            }
        }
        region.size_m = region.size_m.map(|size| size * copies as f64);
        if self.has("open") {
            region.sides = [Side::Open; 3];
        }
        Ok((region, start))
    }

    /// The bed, about to be driven.
    pub(super) fn bed(&self, particles: usize) -> Result<Bed, BedError> {
        let (region, start) = self.start(particles)?;
        let mut spec = PairSpec::new(paper::PA12, 2f64.cbrt());
        if self.has("stiff") {
            spec.k1 *= 100.0;
        }
        let friction = Friction {
            coefficient: 0.3,
            tangential_stiffness_over_k1: 2.0 / 7.0,
            tangential_damping_over_normal: 0.5,
        };
        let surroundings = Surroundings {
            region,
            gravity_m_per_s2: if self.has("gravity") { [0.0, 0.0, -1e-3] } else { [0.0; 3] },
            drag_viscosity_pa_s: if self.has("drag") { 1e-3 } else { 0.0 },
            friction: self.has("friction").then_some(friction),
        };
        let mut bed = Bed::new(Material::new(spec)?, surroundings, &start)?;
        let growing = Growing {
            kinetics: Kinetics::ThreeStage,
            sintering: SINTERING,
            calibrated_radius_m: paper::PA12.radius_m,
        };
        bed.begin(&Drive {
            growing: self.has("sintering").then_some(growing),
            ..Drive::default()
        })?;
        Ok(bed)
    }
}

/// Sintering about as fast as that of PA12.
pub(super) const SINTERING: Sintering =
    Sintering { c1: 2.4e-5, tau_s: 3.81, delta_c: 9.5e-8, lambda: 0.0 };
