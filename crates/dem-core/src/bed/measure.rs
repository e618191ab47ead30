//! Observations of a bed between steps.

use super::closure::Law;
use super::engine::Bed;
use super::material::effective_radius;
use super::neighbours::index_of;
use super::region::Side;
use super::vec3::{Vec3, ZERO, dot, norm, scale};

/// A contact of two particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactState {
    /// The particles, by their places in [`Particles`](super::Particles).
    pub particles: [usize; 2],
    /// Unit vector from the second particle to the first.
    pub normal: [f64; 3],
    /// Effective radius `R = 2 Ri Rj/(Ri + Rj)` \[m\], the unit of the contact ratio: the radius of equal particles, and
    /// between one and two of the smaller radius for unequal ones.
    pub effective_radius_m: f64,
    /// Overlap over R, `x = (a/R)^2`.
    pub overlap: f64,
    /// By how much the centres have come nearer than the sum of the radii \[m\].
    pub approach_m: f64,
    /// Plastic overlap over R.
    pub plastic_overlap: f64,
    /// Driving factor of the growth, `(f_ep - gamma_n v_n)/fa`; 1 for a contact without load.
    pub driving: f64,
    /// Rate of the overlap over R \[1/s\].
    pub rate_per_s: f64,
}

impl ContactState {
    /// Contact ratio a/R, the neck radius over the effective radius; it ends at [`final_contact_ratio`](super::final_contact_ratio).
    #[must_use]
    pub fn contact_ratio(&self) -> f64 {
        self.overlap.sqrt()
    }
}

/// Energies of a bed \[J\].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// Kinetic energy of translation, with the mass scaling.
    pub translation_j: f64,
    /// Kinetic energy of rotation.
    pub rotation_j: f64,
    /// Elastic energy of the overlaps, `K2 (delta - delta0)^2 / 2`.
    pub elastic_j: f64,
    /// Elastic energy of the springs of friction and of necks that resist, `k_t xi^2/2` and `k_t a^2 theta^2/8`.
    pub springs_j: f64,
    /// Energy of adhesion, `-fa delta`.
    pub adhesion_j: f64,
    /// Potential energy of gravity, `-m g . r`.
    pub gravity_j: f64,
}

impl Energies {
    /// Sum of all energies.
    #[must_use]
    pub fn total_j(&self) -> f64 {
        self.translation_j
            + self.rotation_j
            + self.elastic_j
            + self.springs_j
            + self.adhesion_j
            + self.gravity_j
    }
}

/// The state of a bed in a few numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time \[s\].
    pub time_s: f64,
    /// Mass over density and bed volume; NaN where the bed has no volume, see [`Bed::bed_volume_m3`].
    pub relative_density: f64,
    /// Contacts per particle, walls not counted.
    pub coordination: f64,
    /// Mean contact ratio a/R over the contacts of particles; 0 without contacts.
    pub mean_contact_ratio: f64,
    /// Quantiles of the contact ratio at 10, 50 and 90 %.
    pub contact_ratio_deciles: [f64; 3],
    /// Mean driving factor, `(f_ep - gamma_n v_n)/fa`.
    pub mean_driving: f64,
    /// Largest magnitude of the driving factor.
    pub largest_driving: f64,
    /// Inertial number, `sqrt(<(dx/dt)^2> m d/fa)`: the rate of strain of the contacts against the time in
    /// which fa moves a particle by its size. Inertia is not felt while it is below 1e-3.
    pub inertial_number: f64,
    /// Share of the particles on which two necks meet: above [`NECKS_MEET`](super::NECKS_MEET) the model, a sum of pairs, ends.
    pub necks_meet: f64,
    /// The law of densification that holds; from the hand-over on only `time_s` and `relative_density` go on, and all else
    /// is as it was there.
    pub law: Law,
    /// Energies.
    pub energies: Energies,
}

/// Error of the mean contact ratio by inertia, of a run that is observed in these states.
///
/// A contact lags behind its balance by the time `sqrt(m x R/fa)` in which fa moves its two particles by their
/// overlap. With the inertial number I that is `I/(2 sqrt 2)` of a/R; the estimate takes I itself at its
/// largest, three times as much, because particles without contacts lag by more.
#[must_use]
pub fn inertia_error(samples: &[Sample]) -> f64 {
    samples.iter().map(|sample| sample.inertial_number).fold(0.0, f64::max)
}

impl Bed {
    /// The contacts of particles, in the order of the neighbour list.
    pub fn contacts(&self) -> impl Iterator<Item = ContactState> + '_ {
        let alpha = self.law.law.adhesion;
        (0..self.particles.len()).flat_map(move |i| {
            self.list.row(i).filter_map(move |k| {
                let memory = &self.pairs.memory[k];
                if !memory.is_contact() {
                    return None;
                }
                let j = index_of(self.list.other[k]);
                let (a, b) = (self.particles.radius_m[i], self.particles.radius_m[j]);
                let d = self.distance(i, k);
                Some(ContactState {
                    particles: [i, j],
                    normal: scale(d, 1.0 / norm(d)),
                    effective_radius_m: effective_radius(a, b),
                    overlap: memory.overlap,
                    approach_m: memory.overlap * self.material.overlap_unit(a, b),
                    plastic_overlap: memory.plastic,
                    driving: (alpha - memory.pull) / alpha,
                    rate_per_s: memory.drift / self.step_s,
                })
            })
        })
    }

    /// The force on each wall of the box, in the order of [`Region::walls`](super::Region::walls) \[N\].
    #[must_use]
    pub fn wall_forces_n(&self) -> Vec<[f64; 3]> {
        let mut forces = vec![ZERO; self.walls.len()];
        let k1 = self.material.k1_n_per_m();
        for i in 0..self.particles.len() {
            for k in self.wall_list.row(i) {
                let index = self.wall_list.wall[k] as usize;
                let memory = &self.wall_list.memory[k];
                if memory.is_contact() {
                    let wall = &self.walls[index];
                    let scale = k1 * self.material.wall_unit(self.particles.radius_m[i]);
                    forces[index][wall.axis] += wall.inward * memory.pull * scale;
                }
            }
        }
        forces
    }

    /// Energies at the end of the last [`advance`](Self::advance).
    #[must_use]
    pub fn energies(&self) -> Energies {
        let mut energies = Energies::default();
        let p = &self.particles;
        for i in 0..p.len() {
            let mass = p.inertia[i];
            let v = p.velocity_m_per_s[i];
            energies.translation_j += 0.5 * mass * dot(v, v);
            if let Some(&w) = p.angular_velocity_per_s.get(i) {
                energies.rotation_j += 0.2 * mass * p.radius_m[i].powi(2) * dot(w, w);
            }
            energies.gravity_j -= mass * dot(self.gravity(), p.position_m[i]);
            for k in self.wall_list.row(i) {
                let memory = &self.wall_list.memory[k];
                if memory.is_contact() {
                    let unit = self.material.wall_unit(p.radius_m[i]);
                    self.add_contact_energy(&mut energies, unit, memory.overlap, memory.plastic);
                    if let Some(&spring) = self.wall_list.spring.get(k) {
                        energies.springs_j += self.slider().energy_j(spring);
                    }
                }
            }
            for k in self.list.row(i).filter(|&k| self.pairs.memory[k].is_contact()) {
                energies.springs_j += self.spring_energy_j(i, k);
            }
        }
        for contact in self.contacts() {
            let ContactState { particles: [i, j], overlap, plastic_overlap, .. } = contact;
            let unit = self.material.overlap_unit(p.radius_m[i], p.radius_m[j]);
            self.add_contact_energy(&mut energies, unit, overlap, plastic_overlap);
        }
        energies
    }

    /// Energy of the tangential springs of a contact of two particles.
    fn spring_energy_j(&self, i: usize, k: usize) -> f64 {
        let Some(&spring) = self.pairs.spring.get(k) else { return 0.0 };
        let held = self.slider().energy_j(spring);
        let Some(&turn) = self.pairs.turn.get(k) else { return held };
        let radius = &self.particles.radius_m;
        let effective = effective_radius(radius[i], radius[index_of(self.list.other[k])]);
        let neck_squared_m2 = self.pairs.memory[k].overlap * effective * effective;
        held + self.neck_law().turn_energy_j(turn, neck_squared_m2)
    }

    fn add_contact_energy(&self, energies: &mut Energies, unit_m: f64, x: f64, p: f64) {
        let unit = self.material.k1_n_per_m() * unit_m * unit_m;
        energies.elastic_j += unit * 0.5 * self.law.stiffness(p) * (x - p) * (x - p);
        energies.adhesion_j -= unit * self.law.law.adhesion * x;
    }

    /// Volume of the bed \[m3\]: the base times the height on the axis of gravity, and that of the box
    /// otherwise.
    ///
    /// The height is twice that of the centre of mass above the lower wall, which is the height of a bed of
    /// uniform density, and smooth where the topmost particle is not. `None` where the bed is not bounded on its sides.
    #[must_use]
    pub fn bed_volume_m3(&self) -> Option<f64> {
        let region = &self.around.region;
        let mut volume = 1.0;
        for axis in 0..3 {
            let along_gravity = self.around.gravity_m_per_s2[axis] < 0.0;
            volume *= match region.sides[axis] {
                Side::Open => return None,
                Side::LowerWall => self.height_m(axis),
                Side::Walls if along_gravity => self.height_m(axis),
                Side::Walls | Side::Periodic => region.size_m[axis],
            };
        }
        Some(volume)
    }

    /// Mass over density and bed volume; `None` where the bed has no volume.
    pub(crate) fn relative_density(&self) -> Option<f64> {
        Some(self.particles.solid_volume_m3() / self.bed_volume_m3()?)
    }

    /// Whether the volume of the bed follows its particles: a free box, or a bed with a surface.
    pub(crate) fn can_shrink(&self, free_box: bool) -> bool {
        let surface = (0..3).any(|axis| match self.around.region.sides[axis] {
            Side::LowerWall => true,
            Side::Walls => self.around.gravity_m_per_s2[axis] < 0.0,
            Side::Open | Side::Periodic => false,
        });
        self.bed_volume_m3().is_some() && (free_box || surface)
    }

    fn height_m(&self, axis: usize) -> f64 {
        let p = &self.particles;
        let mut moment = 0.0;
        let mut mass = 0.0;
        for (position, m) in p.position_m.iter().zip(&p.inertia) {
            moment += m * position[axis];
            mass += m;
        }
        2.0 * moment / mass
    }

    /// The state in a few numbers.
    #[must_use]
    pub fn sample(&self) -> Sample {
        let n = self.particles.len();
        let mut ratios: Vec<f64> = Vec::with_capacity(3 * n);
        let (mut driving, mut largest, mut rate) = (0.0, 0.0f64, 0.0);
        for contact in self.contacts() {
            ratios.push(contact.contact_ratio());
            driving += contact.driving;
            largest = largest.max(contact.driving.abs());
            rate += contact.rate_per_s * contact.rate_per_s;
        }
        let count = ratios.len().max(1) as f64;
        // An empty sum is -0.0.
        let mean_contact_ratio = (0.0 + ratios.iter().sum::<f64>()) / count;
        ratios.sort_unstable_by(f64::total_cmp);
        let below = |share: f64| {
            ratios.get((share * (ratios.len().max(1) - 1) as f64).round() as usize).copied()
        };
        let mass = self.particles.inertia.iter().sum::<f64>() / n as f64;
        let radius = self.particles.radius_m.iter().sum::<f64>() / n as f64;
        let adhesion = self.material.adhesion_n(radius);
        Sample {
            time_s: self.time_s,
            relative_density: self.relative_density().unwrap_or(f64::NAN),
            coordination: 2.0 * ratios.len() as f64 / n as f64,
            mean_contact_ratio,
            contact_ratio_deciles: [0.1, 0.5, 0.9].map(|share| below(share).unwrap_or(0.0)),
            mean_driving: driving / count,
            largest_driving: largest,
            inertial_number: (rate / count * mass * 2.0 * radius / adhesion).sqrt(),
            necks_meet: self.necks_meet(),
            law: Law::Pairs,
            energies: self.energies(),
        }
    }

    /// Share of the particles with two contacts whose necks touch: the contact circles, seen from the
    /// centre under `asin(a/R)`, reach each other.
    pub(crate) fn necks_meet(&self) -> f64 {
        let n = self.particles.len();
        let mut necks: Vec<Vec<(Vec3, f64)>> = vec![Vec::new(); n];
        for contact in self.contacts() {
            let neck = contact.contact_ratio() * contact.effective_radius_m;
            for (side, &i) in contact.particles.iter().enumerate() {
                let sign = if side == 0 { -1.0 } else { 1.0 };
                let angle = (neck / self.particles.radius_m[i]).min(1.0).asin();
                necks[i].push((scale(contact.normal, sign), angle));
            }
        }
        let meet = necks.iter().filter(|necks| {
            necks.iter().enumerate().any(|(at, (a, width))| {
                necks[at + 1..].iter().any(|(b, other)| dot(*a, *b).acos() < width + other)
            })
        });
        meet.count() as f64 / n as f64
    }

    /// Chance difference of the mean contact ratios of two beds of this number of particles though the same law
    /// rules them; 0 without contacts.
    ///
    /// The standard error of the mean, as if contacts were drawn by chance, together with the chance
    /// that small contacts are there at all: the number m of those below half the mean, and one more, is uncertain by its root,
    /// and each takes its share of the mean away. Both beds have it, so that their difference has the root of twice its square.
    #[must_use]
    pub fn chance_of_mean_contact_ratio(&self) -> f64 {
        let ratios: Vec<f64> = self.contacts().map(|contact| contact.contact_ratio()).collect();
        if ratios.is_empty() {
            return 0.0;
        }
        let count = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / count;
        let variance = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / count;
        let small = 1.0 + ratios.iter().filter(|&&ratio| ratio < 0.5 * mean).count() as f64;
        (2.0 * (variance / count + small * (mean / count).powi(2))).sqrt()
    }
}
