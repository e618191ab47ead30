//! The engine: velocity Verlet for many particles.
//!
//! Between steps it holds positions at a time and velocities half a step ahead. A step drifts,
//! computes the [forces](super::forces) of all pairs and lets the [particles](super::motion) gather them. The
//! neighbour list is made anew when particles have moved by half of its skin, and not before.

use super::contact::{Grows, Growth, LawConstants, Memory, NoGrowth, Scheme};
use super::error::{BedError, field, within};
use super::forces::{PairInput, PairOutput, Pays, pair_forces};
use super::friction::Slider;
use super::material::{ContactConstants, Friction, Growing, Material};
use super::motion::{MotionInput, MotionOutput, Moves, WallList, motion};
use super::neighbours::{MOST_PARTICLES, NeighbourList, image_of, index_of, sort_and_list};
use super::particles::Particles;
use super::region::{Region, Wall};
use super::vec3::{Vec3, ZERO, add, cross, dot, norm, scale, sub};
use crate::Kinetics;
use crate::kinetics::{Frenkel, Pokluda, RegimeMap, ThreeStage, ThreeStagePokluda};

/// What a bed is made of, besides its particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surroundings {
    /// The box.
    pub region: Region,
    /// Acceleration of gravity \[m/s2\]; `[0, 0, 0]` where there is none.
    pub gravity_m_per_s2: [f64; 3],
    /// Viscosity of a fluid that drags on each particle by Stokes' law, `-6 pi eta R v` \[Pa s\]; 0 where
    /// there is none.
    pub drag_viscosity_pa_s: f64,
    /// Friction between particles and with walls.
    pub friction: Option<Friction>,
}

impl Surroundings {
    /// Nothing around the particles at all.
    pub const NOTHING: Self = Self {
        region: Region::OPEN,
        gravity_m_per_s2: [0.0; 3],
        drag_viscosity_pa_s: 0.0,
        friction: None,
    };
}

/// The particles of a scene, as they start.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start {
    /// Centres \[m\].
    pub position_m: Vec<[f64; 3]>,
    /// Radii \[m\].
    pub radius_m: Vec<f64>,
    /// Velocities \[m/s\]; empty where all are at rest.
    pub velocity_m_per_s: Vec<[f64; 3]>,
    /// Angular velocities \[1/s\]; empty where none rotates. Not used without friction.
    pub angular_velocity_per_s: Vec<[f64; 3]>,
}

/// How a bed is driven through a phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// How contacts grow; `None` while nothing is heated.
    pub growing: Option<Growing>,
    /// Time step over the collision time of the smallest particles; 0.02 is usual.
    pub step_over_collision_time: f64,
    /// Factor on all masses as far as inertia goes, 1 or more; weights stay as they are.
    pub mass_scaling: f64,
}

impl Default for Drive {
    fn default() -> Self {
        Self { growing: None, step_over_collision_time: 0.02, mass_scaling: 1.0 }
    }
}

/// The pairs: one array per quantity, in the order of the list.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Pairs {
    pub(crate) memory: Vec<Memory>,
    pub(crate) plastic_before: Vec<f64>,
    pub(crate) force: Vec<Vec3>,
    /// Empty where all radii are equal.
    pub(crate) constants: Vec<ContactConstants>,
    /// Empty without friction.
    pub(crate) spring: Vec<Vec3>,
    /// Empty without friction.
    pub(crate) torque: Vec<Vec3>,
}

/// What a run has cost so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Steps taken.
    pub steps: u64,
    /// Neighbour lists made.
    pub rebuilds: u64,
    /// Times that the true displacements were looked at.
    pub displacement_checks: u64,
}

/// Particles in motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Bed {
    pub(crate) material: Material,
    pub(crate) law: LawConstants,
    pub(crate) around: Surroundings,
    pub(crate) walls: Vec<Wall>,
    pub(crate) drive: Drive,
    pub(crate) step_s: f64,
    pub(crate) time_s: f64,
    /// Steps since `phase_start_s`.
    pub(crate) phase_steps: u64,
    pub(crate) phase_start_s: f64,
    pub(crate) particles: Particles,
    pub(crate) equal: bool,
    pub(crate) list: NeighbourList,
    pub(crate) pairs: Pairs,
    pub(crate) wall_list: WallList,
    pub(crate) skin: f64,
    /// Positions when the list was made.
    pub(crate) listed_position: Vec<Vec3>,
    /// No particle has moved further than this since then.
    pub(crate) travelled: f64,
    /// Largest speed, half a step ahead.
    pub(crate) fastest: f64,
    pub(crate) work: Work,
}

/// Up to so many particles without images every pair is in the list, once and for all.
const ALL_PAIRS: usize = 4;

/// Skin of the neighbour list over the mean radius: a list of a dense bed then has about half again as
/// many pairs as there are contacts, and rests as long as nothing moves by a twentieth of a diameter.
const SKIN_OVER_RADIUS: f64 = 0.2;

impl Bed {
    /// Checks and places the particles.
    ///
    /// Contacts may start with an overlap up to the adhesive contact's, x0 effective radii; with `fa/(K1 R)`
    /// or more they are in force balance.
    ///
    /// # Errors
    ///
    /// [`BedError`] that names the particle or field.
    pub fn new(material: Material, around: Surroundings, start: &Start) -> Result<Self, BedError> {
        around.region.check()?;
        let n = start.position_m.len();
        if n == 0 || n >= MOST_PARTICLES {
            return Err(field("particles", n, "a bed has 1 to 134217727 particles"));
        }
        if start.radius_m.len() != n {
            return Err(field(
                "radius_m",
                start.radius_m.len(),
                "give one radius for each particle",
            ));
        }
        let vectors = |name: &str, values: &[Vec3]| -> Result<Vec<Vec3>, BedError> {
            if values.is_empty() {
                return Ok(vec![ZERO; n]);
            }
            if values.len() != n {
                return Err(field(name, values.len(), "give none, or one for each particle"));
            }
            match values.iter().flatten().find(|value| !value.is_finite()) {
                Some(value) => Err(field(name, value, "must be finite")),
                None => Ok(values.to_vec()),
            }
        };
        for (i, &radius) in start.radius_m.iter().enumerate() {
            let name = format!("radius_m of particle {i}");
            within(&name, radius, 1e-9, 1e3, "give the radius in metres, 1e-9 to 1e3")?;
        }
        vectors("position_m", &start.position_m)?;
        let velocity = vectors("velocity_m_per_s", &start.velocity_m_per_s)?;
        let spin = vectors("angular_velocity_per_s", &start.angular_velocity_per_s)?;
        for (name, value) in [
            ("gravity_m_per_s2", norm(around.gravity_m_per_s2)),
            ("drag.viscosity_pa_s", around.drag_viscosity_pa_s),
        ] {
            within(name, value, 0.0, 1e6, "use 0 to 1e6")?;
        }
        if let Some(friction) = &around.friction {
            friction.check()?;
        }
        let walls = around.region.walls();
        for (particle, (&position_m, &radius_m)) in
            start.position_m.iter().zip(&start.radius_m).enumerate()
        {
            for wall in &walls {
                let overlap = (radius_m - wall.distance(position_m)) / (2.0 * radius_m);
                if overlap > material.law().adhesion * (1.0 + 1e-6) {
                    let axis = wall.axis;
                    return Err(BedError::OutsideBox { particle, position_m, radius_m, axis });
                }
            }
        }
        let mean = start.radius_m.iter().sum::<f64>() / n as f64;
        let largest = start.radius_m.iter().copied().fold(0.0, f64::max);
        let few = n <= ALL_PAIRS && !around.region.has_images() && walls.is_empty();
        let skin = if few { f64::INFINITY } else { SKIN_OVER_RADIUS * mean };
        for axis in 0..3 {
            let size_m = around.region.size_m[axis];
            let needed_m = 2.0 * (2.0 * largest + skin);
            if around.region.sides[axis] == super::Side::Periodic && size_m <= needed_m {
                return Err(BedError::PeriodicSideTooShort { axis, size_m, needed_m });
            }
        }
        let mut particles = Particles::at_rest(
            start.position_m.clone(),
            velocity,
            start.radius_m.clone(),
            material.spec().powder.density_kg_per_m3,
            around.friction.is_some(),
        );
        if around.friction.is_some() {
            particles.angular_velocity_per_s = spin;
        }
        let mut bed = Self {
            law: LawConstants::new(*material.law()),
            material,
            around,
            walls,
            drive: Drive::default(),
            step_s: 0.0,
            time_s: 0.0,
            phase_steps: 0,
            phase_start_s: 0.0,
            equal: start.radius_m.iter().all(|&radius| radius == start.radius_m[0]),
            particles,
            list: NeighbourList::default(),
            pairs: Pairs::default(),
            wall_list: WallList::default(),
            skin,
            listed_position: Vec::new(),
            travelled: 0.0,
            fastest: 0.0,
            work: Work::default(),
        };
        bed.list.start = vec![0; n + 1];
        bed.wall_list.start = vec![0; n + 1];
        bed.rebuild()?;
        bed.first_contacts()?;
        bed.begin(&Drive::default())?;
        Ok(bed)
    }

    /// Gives the contacts that there are at the start the plastic overlap at which they balance.
    fn first_contacts(&mut self) -> Result<(), BedError> {
        let law = self.law.law;
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                let j = index_of(self.list.other[k]);
                let (radius_i, radius_j) = (self.particles.radius_m[i], self.particles.radius_m[j]);
                let radius = 2.0 * radius_i * radius_j / (radius_i + radius_j);
                let overlap = (radius_i + radius_j - norm(self.distance(i, k))) / radius;
                if overlap < 0.0 {
                    continue;
                }
                let allowed = self.material.pair_of_radius(radius)?.x0() * (1.0 + 1e-6);
                if overlap > allowed {
                    let [a, b] = [i, j].map(|i| self.particles.id[i] as usize);
                    let (first, second) = (a.min(b), a.max(b));
                    return Err(BedError::OverlappingStart { first, second, overlap, allowed });
                }
                let plastic = law.equilibrium_plastic_overlap(overlap.max(law.adhesion));
                self.pairs.memory[k] = Memory { overlap, drift: 0.0, plastic, pull: 0.0 };
                self.pairs.plastic_before[k] = plastic;
            }
            for k in self.wall_list.row(i) {
                let wall = &self.walls[self.wall_list.wall[k] as usize];
                let radius = self.particles.radius_m[i];
                let overlap =
                    (radius - wall.distance(self.particles.position_m[i])) / (2.0 * radius);
                if overlap >= 0.0 {
                    self.wall_list.memory[k] =
                        Memory { overlap, drift: 0.0, plastic: 0.0, pull: 0.0 };
                }
            }
        }
        Ok(())
    }

    /// Vector from the second particle of a pair to the first one, i.
    pub(crate) fn distance(&self, i: usize, k: usize) -> Vec3 {
        let entry = self.list.other[k];
        let d = sub(self.particles.position_m[i], self.particles.position_m[index_of(entry)]);
        if self.around.region.has_images() {
            add(d, self.around.region.image_shifts()[image_of(entry)])
        } else {
            d
        }
    }

    /// Constants of a pair.
    pub(crate) fn constants(&self, i: usize, k: usize) -> Result<ContactConstants, BedError> {
        let j = index_of(self.list.other[k]);
        let particle = |i: usize| (self.particles.radius_m[i], self.particles.inertia[i]);
        self.material.contact(self.drive.growing.as_ref(), particle(i), particle(j))
    }

    /// Constants of all pairs of equal particles.
    pub(crate) fn equal_constants(&self) -> Result<ContactConstants, BedError> {
        let particle = (self.particles.radius_m[0], self.particles.inertia[0]);
        self.material.contact(self.drive.growing.as_ref(), particle, particle)
    }

    pub(crate) fn fill_constants(&mut self) -> Result<(), BedError> {
        if self.equal {
            return Ok(());
        }
        let mut constants = Vec::with_capacity(self.list.other.len());
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                constants.push(self.constants(i, k)?);
            }
        }
        self.pairs.constants = constants;
        Ok(())
    }

    /// Starts a phase from positions and velocities: chooses the step and puts the velocities half of it
    /// ahead.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`], [`BedError::Sintering`] for the drive; [`BedError::UnstableStep`].
    pub fn begin(&mut self, drive: &Drive) -> Result<(), BedError> {
        let step = drive.step_over_collision_time;
        within("step_over_collision_time", step, 1e-9, 1.0, "use 1e-9 to 1; 0.02 is usual")?;
        within("mass_scaling", drive.mass_scaling, 1.0, 1e18, "use 1 to 1e18")?;
        let rescale = drive.mass_scaling / self.drive.mass_scaling;
        if rescale != 1.0 {
            for mass in &mut self.particles.inertia {
                *mass *= rescale;
            }
        }
        self.drive = *drive;
        let fresh_s = step * self.collision_time_s();
        self.begin_with_step(fresh_s)
    }

    /// Like [`begin`](Self::begin), with a step given in seconds instead; for a driver that makes steps
    /// end on its observation times.
    pub(crate) fn begin_with_step(&mut self, step_s: f64) -> Result<(), BedError> {
        self.step_s = step_s;
        self.phase_start_s = self.time_s;
        self.phase_steps = 0;
        self.fill_constants()?;
        self.check_stability()?;
        self.set_off()
    }

    /// Collision time of two of the smallest particles, `pi / sqrt(omega^2 - (c/2)^2)` \[s\], with the mass
    /// scaling; undamped where the damping is overcritical.
    #[must_use]
    pub fn collision_time_s(&self) -> f64 {
        let smallest = self.particles.inertia.iter().copied().fold(f64::INFINITY, f64::min);
        let undamped = 2.0 * self.material.k1_n_per_m() / smallest;
        let half = 0.5 * self.material.dissipation(0.5 * smallest);
        let squared = undamped - half * half;
        std::f64::consts::PI / if squared > 0.0 { squared } else { undamped }.sqrt()
    }

    /// The step \[s\].
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The time that positions belong to \[s\].
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The particles, with velocities as of the end of the last [`advance`](Self::advance).
    #[must_use]
    pub fn particles(&self) -> &Particles {
        &self.particles
    }

    /// The material.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Another material, of the same law but for its stiffness; takes effect when a phase
    /// [begins](Self::begin).
    pub(crate) fn set_material(&mut self, material: Material) {
        self.law = LawConstants::new(*material.law());
        self.material = material;
    }

    /// What is around the particles.
    #[must_use]
    pub fn surroundings(&self) -> &Surroundings {
        &self.around
    }

    /// What the run has cost so far.
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Bytes held for the particles and their contacts.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        fn of<T>(values: &Vec<T>) -> usize {
            values.capacity() * size_of::<T>()
        }
        let (p, l, c, w) = (&self.particles, &self.list, &self.pairs, &self.wall_list);
        of(&p.position_m)
            + of(&p.half_velocity)
            + of(&p.velocity_m_per_s)
            + of(&p.spin)
            + of(&p.angular_velocity_per_s)
            + of(&p.radius_m)
            + of(&p.inertia)
            + of(&p.id)
            + of(&self.listed_position)
            + of(&l.start)
            + of(&l.other)
            + of(&l.reverse_start)
            + of(&l.reverse)
            + of(&c.memory)
            + of(&c.plastic_before)
            + of(&c.force)
            + of(&c.constants)
            + of(&c.spring)
            + of(&c.torque)
            + of(&w.start)
            + of(&w.wall)
            + of(&w.memory)
            + of(&w.spring)
    }

    /// Largest stable step \[s\] and the contacts of the particle that decides.
    ///
    /// By Gershgorin's theorem no frequency of the contact network exceeds
    /// `omega^2 = max_i (2 z_i + w_i) k/m_i` with z contacts and w wall contacts, all on their stiffest branch,
    /// `k = K2max` (and `7/2 k_t` with friction); the step must stay below `2/omega`. For a pair that is
    /// `2 sqrt(m_eff/K2max)`. The damping of the other contacts, known from the step before only, adds
    /// `h c (z - 2) < 2`.
    #[must_use]
    pub fn step_limit_s(&self) -> (f64, usize) {
        let mut contacts = vec![(0usize, 0usize); self.particles.len()];
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    contacts[i].0 += 1;
                    contacts[index_of(self.list.other[k])].0 += 1;
                }
            }
            contacts[i].1 =
                self.wall_list.row(i).filter(|&k| self.wall_list.memory[k].is_contact()).count();
        }
        let k1 = self.material.k1_n_per_m();
        let tangential = self
            .around
            .friction
            .map_or(0.0, |friction| 3.5 * friction.tangential_stiffness_over_k1);
        let stiffness = k1 * (self.law.law.k2_max + tangential);
        let mut limit = (f64::INFINITY, 0);
        for (&(pairs, walls), &mass) in contacts.iter().zip(&self.particles.inertia) {
            // A particle without contacts may make one any time.
            let weight = (2 * pairs + walls).max(2) as f64;
            let elastic = 2.0 / (weight * stiffness / mass).sqrt();
            let damping = self.material.dissipation(0.5 * mass) * (pairs + walls) as f64
                - 2.0 * self.material.dissipation(0.5 * mass);
            let damped = if damping > 0.0 { 2.0 / damping } else { f64::INFINITY };
            let step = elastic.min(damped);
            if step < limit.0 {
                limit = (step, pairs + walls);
            }
        }
        limit
    }

    fn check_stability(&self) -> Result<(), BedError> {
        let (limit_s, contacts) = self.step_limit_s();
        if self.step_s < limit_s {
            return Ok(());
        }
        Err(BedError::UnstableStep {
            step_s: self.step_s,
            step_over_collision_time: self.step_s / self.collision_time_s(),
            limit_s,
            contacts,
            time_s: self.time_s,
        })
    }

    /// Velocities half a step ahead, out of velocities; contacts as they were half a step before.
    fn set_off(&mut self) -> Result<(), BedError> {
        let n = self.particles.len();
        let mut force = vec![ZERO; n];
        // Over the first half step, in which growth may relax what a contact carries.
        let mut first_force = vec![ZERO; n];
        let mut torque = vec![ZERO; n];
        let first_pull = first_pull(self.drive.growing.map(|growing| growing.kinetics));
        let slider = self.slider();
        let k1 = self.material.k1_n_per_m();
        let equal = if self.equal { Some(self.equal_constants()?) } else { None };
        let scheme_of = |bed: &Self, k: usize| {
            Scheme::new(equal.as_ref().unwrap_or_else(|| &bed.pairs.constants[k]), k1, bed.step_s)
        };
        for i in 0..n {
            for k in self.list.row(i) {
                let mut memory = self.pairs.memory[k];
                if !memory.is_contact() {
                    continue;
                }
                let j = index_of(self.list.other[k]);
                let scheme = scheme_of(self, k);
                let d = self.distance(i, k);
                let normal = scale(d, 1.0 / norm(d));
                let v = &self.particles.velocity_m_per_s;
                let rate = dot(sub(v[j], v[i]), normal) * scheme.inverse_radius;
                scheme.settle(&self.law, &mut memory, rate);
                self.pairs.memory[k] = memory;
                let mut total = scale(normal, -memory.pull * scheme.force_scale);
                let first = first_pull(&scheme, &self.law, &memory) - memory.pull;
                let relaxed = scale(normal, -first * scheme.force_scale);
                first_force[i] = add(first_force[i], relaxed);
                first_force[j] = sub(first_force[j], relaxed);
                if self.around.friction.is_some() {
                    let tangential = scale(self.pairs.spring[k], -slider.stiffness);
                    total = add(total, tangential);
                    let radii = (self.particles.radius_m[i], self.particles.radius_m[j]);
                    let turn = scale(cross(normal, tangential), -norm(d) / (radii.0 + radii.1));
                    torque[i] = add(torque[i], scale(turn, radii.0));
                    torque[j] = add(torque[j], scale(turn, radii.1));
                }
                force[i] = add(force[i], total);
                force[j] = sub(force[j], total);
            }
            for k in self.wall_list.row(i) {
                let mut memory = self.wall_list.memory[k];
                if !memory.is_contact() {
                    continue;
                }
                let wall = self.walls[self.wall_list.wall[k] as usize];
                let scheme = self.wall_scheme(i);
                let v = self.particles.velocity_m_per_s[i][wall.axis];
                scheme.settle(&self.law, &mut memory, -wall.inward * v * scheme.inverse_radius);
                self.wall_list.memory[k] = memory;
                force[i][wall.axis] -= wall.inward * memory.pull * scheme.force_scale;
                if self.around.friction.is_some() {
                    let tangential = scale(self.wall_list.spring[k], -slider.stiffness);
                    force[i] = add(force[i], tangential);
                    let mut normal = ZERO;
                    normal[wall.axis] = wall.inward;
                    let arm = wall.distance(self.particles.position_m[i]);
                    torque[i] = add(torque[i], scale(cross(normal, tangential), -arm));
                }
            }
        }
        let half = 0.5 * self.step_s;
        let gravity = self.gravity();
        let mut fastest: f64 = 0.0;
        for i in 0..n {
            let (mass, radius) = (self.particles.inertia[i], self.particles.radius_m[i]);
            let v = self.particles.velocity_m_per_s[i];
            let drag = scale(v, -self.drag() * radius);
            // From here on the acceleration.
            force[i] = add(scale(add(force[i], drag), 1.0 / mass), gravity);
            let first = add(force[i], scale(first_force[i], 1.0 / mass));
            let ahead = add(v, scale(first, half));
            fastest = fastest.max(dot(ahead, ahead));
            self.particles.half_velocity[i] = ahead;
            if self.around.friction.is_some() {
                let w = self.particles.angular_velocity_per_s[i];
                let drag = scale(w, -4.0 / 3.0 * self.drag() * radius.powi(3));
                let change = scale(add(torque[i], drag), half / (0.4 * mass * radius * radius));
                self.particles.spin[i] = add(w, change);
            }
        }
        self.fastest = fastest.sqrt();
        // What the overlap would have changed by in the step before, by the same acceleration.
        let acceleration = force;
        let before = |i: usize, particles: &Particles| {
            sub(particles.half_velocity[i], scale(acceleration[i], self.step_s))
        };
        for i in 0..n {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    let j = index_of(self.list.other[k]);
                    let scheme = scheme_of(self, k);
                    let d = self.distance(i, k);
                    let approach =
                        dot(sub(before(j, &self.particles), before(i, &self.particles)), d)
                            / norm(d);
                    self.pairs.memory[k].drift = approach * self.step_s * scheme.inverse_radius;
                }
            }
            for k in self.wall_list.row(i) {
                if self.wall_list.memory[k].is_contact() {
                    let wall = self.walls[self.wall_list.wall[k] as usize];
                    let approach = -wall.inward * before(i, &self.particles)[wall.axis];
                    self.wall_list.memory[k].drift =
                        approach * self.step_s * self.wall_scheme(i).inverse_radius;
                }
            }
        }
        Ok(())
    }

    pub(crate) fn wall_scheme(&self, i: usize) -> Scheme {
        let constants =
            self.material.wall_contact(self.particles.radius_m[i], self.particles.inertia[i]);
        Scheme::new(&constants, self.material.k1_n_per_m(), self.step_s)
    }

    pub(crate) fn slider(&self) -> Slider {
        let none = Friction {
            coefficient: 0.0,
            tangential_stiffness_over_k1: 1.0,
            tangential_damping_over_normal: 0.0,
        };
        Slider::new(&self.around.friction.unwrap_or(none), self.material.k1_n_per_m())
    }

    /// Acceleration by gravity: the weight over the scaled mass.
    pub(crate) fn gravity(&self) -> Vec3 {
        scale(self.around.gravity_m_per_s2, 1.0 / self.drive.mass_scaling)
    }

    fn drag(&self) -> f64 {
        6.0 * std::f64::consts::PI * self.around.drag_viscosity_pa_s
    }

    /// Makes a number of steps.
    ///
    /// The bits do not depend on how a number of steps is divided into calls, nor on the number of
    /// threads.
    ///
    /// # Errors
    ///
    /// [`BedError::RunAway`] for particles too fast for the step, [`BedError::UnstableStep`] where contacts
    /// have become so many that the step is no longer stable.
    pub fn advance(&mut self, steps: u64) -> Result<(), BedError> {
        if steps == 0 {
            return Ok(());
        }
        let h = self.step_s;
        for (position, &velocity) in
            self.particles.position_m.iter_mut().zip(&self.particles.half_velocity)
        {
            *position = add(*position, scale(velocity, h));
        }
        let shifts = self.around.region.image_shifts();
        let passes = Passes::choose(self);
        let smallest = self.particles.radius_m.iter().copied().fold(f64::INFINITY, f64::min);
        let allowed_m = 0.25 * smallest;
        for step in 1..=steps {
            let displacement_m = self.fastest * h;
            if displacement_m > allowed_m || displacement_m.is_nan() {
                let time_s = self.time_s;
                return Err(BedError::RunAway { time_s, displacement_m, allowed_m });
            }
            self.travelled += displacement_m;
            if self.travelled > 0.5 * self.skin {
                self.look_at_displacements()?;
            }
            self.step(&passes, &shifts, step == steps)?;
            self.phase_steps += 1;
            self.work.steps += 1;
            self.time_s = self.phase_start_s + self.phase_steps as f64 * h;
        }
        Ok(())
    }

    fn look_at_displacements(&mut self) -> Result<(), BedError> {
        self.work.displacement_checks += 1;
        let mut furthest: f64 = 0.0;
        for (&now, &then) in self.particles.position_m.iter().zip(&self.listed_position) {
            let moved = sub(now, then);
            furthest = furthest.max(dot(moved, moved));
        }
        self.travelled = furthest.sqrt();
        // Near the limit it would have to be looked at in every step.
        if self.travelled > 0.45 * self.skin {
            self.rebuild()?;
            self.check_stability()?;
        }
        Ok(())
    }

    fn step(
        &mut self,
        passes: &Passes,
        shifts: &[Vec3; 32],
        is_last: bool,
    ) -> Result<(), BedError> {
        let n = self.particles.len();
        let threads = rayon::current_num_threads();
        let grain = if threads == 1 { n } else { n.div_ceil(4 * threads).max(512) };
        let k1 = self.material.k1_n_per_m();
        let slider = self.slider();
        let step_s = self.step_s;
        let input = PairInput {
            list: &self.list,
            position: &self.particles.position_m,
            velocity: &self.particles.half_velocity,
            spin: &self.particles.spin,
            radius: &self.particles.radius_m,
            shifts,
            law: self.law,
            k1,
            step_s,
            scheme: passes.scheme,
            diameter: 2.0 * self.particles.radius_m[0],
            constants: &self.pairs.constants,
            slider,
        };
        let output = PairOutput {
            memory: &mut self.pairs.memory,
            plastic_before: &mut self.pairs.plastic_before,
            force: &mut self.pairs.force,
            spring: &mut self.pairs.spring,
            torque: &mut self.pairs.torque,
        };
        (passes.pairs)(&input, output, 0..n, grain);
        let gravity = self.gravity();
        let drag = self.drag();
        let input = MotionInput {
            list: &self.list,
            pair_force: &self.pairs.force,
            pair_torque: &self.pairs.torque,
            radius: &self.particles.radius_m,
            mass: &self.particles.inertia,
            wall_start: &self.wall_list.start,
            wall: &self.wall_list.wall,
            walls: &self.walls,
            material: &self.material,
            law: self.law,
            slider,
            step_s,
            gravity,
            drag,
            is_last,
        };
        let output = MotionOutput {
            position: &mut self.particles.position_m,
            half_velocity: &mut self.particles.half_velocity,
            velocity: &mut self.particles.velocity_m_per_s,
            spin: &mut self.particles.spin,
            angular_velocity: &mut self.particles.angular_velocity_per_s,
            wall_memory: &mut self.wall_list.memory,
            wall_spring: &mut self.wall_list.spring,
        };
        self.fastest = (passes.motion)(&input, output, 0..n, grain).sqrt();
        Ok(())
    }

    /// Makes the neighbour list anew; contacts keep what they remember.
    pub(crate) fn rebuild(&mut self) -> Result<(), BedError> {
        self.work.rebuilds += 1;
        let old = std::mem::take(&mut self.list);
        let old_walls = std::mem::take(&mut self.wall_list);
        let (list, order) = sort_and_list(&mut self.particles, &self.around.region, self.skin);
        let n = self.particles.len();
        let mut place = vec![0u32; n];
        for (new, &before) in order.iter().enumerate() {
            place[before as usize] = new as u32;
        }
        let pairs = list.other.len();
        let spins = if self.around.friction.is_some() { pairs } else { 0 };
        let mut fresh = Pairs {
            memory: vec![Memory::APART; pairs],
            plastic_before: vec![0.0; pairs],
            force: vec![ZERO; pairs],
            constants: Vec::new(),
            spring: vec![ZERO; spins],
            torque: vec![ZERO; spins],
        };
        for i in 0..n {
            for k in old.row(i) {
                if !self.pairs.memory[k].is_contact() {
                    continue;
                }
                let (a, b) = (place[i] as usize, place[index_of(old.other[k])] as usize);
                // A contact is always near enough to be in the new list.
                let Some(to) = list.find(a.min(b), a.max(b)) else { continue };
                fresh.memory[to] = self.pairs.memory[k];
                fresh.plastic_before[to] = self.pairs.plastic_before[k];
                if spins > 0 {
                    let sign = if a < b { 1.0 } else { -1.0 };
                    fresh.spring[to] = scale(self.pairs.spring[k], sign);
                }
            }
        }
        self.pairs = fresh;
        self.list = list;
        self.wall_list = self.list_walls(&old_walls, &order);
        self.listed_position.clone_from(&self.particles.position_m);
        self.travelled = 0.0;
        self.fill_constants()
    }

    fn list_walls(&self, old: &WallList, order: &[u32]) -> WallList {
        let mut list = WallList { start: vec![0], ..WallList::default() };
        for (i, &before) in order.iter().enumerate() {
            for (index, wall) in self.walls.iter().enumerate() {
                let reach = self.particles.radius_m[i] + self.skin;
                if wall.distance(self.particles.position_m[i]) >= reach {
                    continue;
                }
                let same = old.row(before as usize).find(|&k| old.wall[k] as usize == index);
                list.wall.push(index as u8);
                list.memory.push(same.map_or(Memory::APART, |k| old.memory[k]));
                if self.around.friction.is_some() {
                    list.spring.push(same.map_or(ZERO, |k| old.spring[k]));
                }
            }
            list.start.push(list.wall.len() as u32);
        }
        list
    }
}

type PairPass =
    for<'a, 'b, 'c> fn(&'a PairInput<'b>, PairOutput<'c>, std::ops::Range<usize>, usize);
type MotionPass =
    for<'a, 'b, 'c> fn(&'a MotionInput<'b>, MotionOutput<'c>, std::ops::Range<usize>, usize) -> f64;

/// The two passes for what a scene has.
struct Passes {
    pairs: PairPass,
    motion: MotionPass,
    scheme: Scheme,
}

impl Passes {
    fn choose(bed: &Bed) -> Self {
        let images = bed.around.region.has_images();
        let friction = bed.around.friction.is_some();
        let equal = bed.equal;
        let pairs = match bed.drive.growing.map(|growing| growing.kinetics) {
            None => pair_pass::<NoGrowth>(images, equal, friction),
            Some(Kinetics::ThreeStage) => pair_pass::<Grows<ThreeStage>>(images, equal, friction),
            Some(Kinetics::Frenkel) => pair_pass::<Grows<Frenkel>>(images, equal, friction),
            Some(Kinetics::Pokluda) => pair_pass::<Grows<Pokluda>>(images, equal, friction),
            Some(Kinetics::ThreeStagePokluda) => {
                pair_pass::<Grows<ThreeStagePokluda>>(images, equal, friction)
            }
            Some(Kinetics::RegimeMap) => pair_pass::<Grows<RegimeMap>>(images, equal, friction),
        };
        let walls = !bed.walls.is_empty();
        let gravity = bed.around.gravity_m_per_s2 != ZERO;
        let drag = bed.around.drag_viscosity_pa_s > 0.0;
        // Checked when the phase began.
        let scheme = match bed.equal_constants() {
            Ok(constants) => Scheme::new(&constants, bed.material.k1_n_per_m(), bed.step_s),
            Err(_) => bed.wall_scheme(0),
        };
        Self { pairs, motion: motion_pass(walls, gravity, drag, friction), scheme }
    }
}

type FirstPull = fn(&Scheme, &LawConstants, &Memory) -> f64;

fn first_pull(kinetics: Option<Kinetics>) -> FirstPull {
    match kinetics {
        None => Scheme::first_pull::<NoGrowth>,
        Some(Kinetics::ThreeStage) => Scheme::first_pull::<Grows<ThreeStage>>,
        Some(Kinetics::Frenkel) => Scheme::first_pull::<Grows<Frenkel>>,
        Some(Kinetics::Pokluda) => Scheme::first_pull::<Grows<Pokluda>>,
        Some(Kinetics::ThreeStagePokluda) => Scheme::first_pull::<Grows<ThreeStagePokluda>>,
        Some(Kinetics::RegimeMap) => Scheme::first_pull::<Grows<RegimeMap>>,
    }
}

fn pair_pass<G: Growth>(images: bool, equal: bool, friction: bool) -> PairPass {
    match (images, equal, friction) {
        (false, false, false) => pair_forces::<Pays<false, false, false, G>>,
        (false, false, true) => pair_forces::<Pays<false, false, true, G>>,
        (false, true, false) => pair_forces::<Pays<false, true, false, G>>,
        (false, true, true) => pair_forces::<Pays<false, true, true, G>>,
        (true, false, false) => pair_forces::<Pays<true, false, false, G>>,
        (true, false, true) => pair_forces::<Pays<true, false, true, G>>,
        (true, true, false) => pair_forces::<Pays<true, true, false, G>>,
        (true, true, true) => pair_forces::<Pays<true, true, true, G>>,
    }
}

fn motion_pass(walls: bool, gravity: bool, drag: bool, friction: bool) -> MotionPass {
    match (walls, gravity, drag, friction) {
        (false, false, false, false) => motion::<Moves<false, false, false, false>>,
        (false, false, false, true) => motion::<Moves<false, false, false, true>>,
        (false, false, true, false) => motion::<Moves<false, false, true, false>>,
        (false, false, true, true) => motion::<Moves<false, false, true, true>>,
        (false, true, false, false) => motion::<Moves<false, true, false, false>>,
        (false, true, false, true) => motion::<Moves<false, true, false, true>>,
        (false, true, true, false) => motion::<Moves<false, true, true, false>>,
        (false, true, true, true) => motion::<Moves<false, true, true, true>>,
        (true, false, false, false) => motion::<Moves<true, false, false, false>>,
        (true, false, false, true) => motion::<Moves<true, false, false, true>>,
        (true, false, true, false) => motion::<Moves<true, false, true, false>>,
        (true, false, true, true) => motion::<Moves<true, false, true, true>>,
        (true, true, false, false) => motion::<Moves<true, true, false, false>>,
        (true, true, false, true) => motion::<Moves<true, true, false, true>>,
        (true, true, true, false) => motion::<Moves<true, true, true, false>>,
        (true, true, true, true) => motion::<Moves<true, true, true, true>>,
    }
}
