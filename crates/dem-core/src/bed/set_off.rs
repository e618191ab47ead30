//! The first half step of a phase: from velocities at one time to velocities half a step ahead.

use super::contact::{Grows, LawConstants, Memory, NoGrowth, Scheme};
use super::engine::Bed;
use super::error::BedError;
use super::material::ContactConstants;
use super::neighbours::index_of;
use super::vec3::{Vec3, ZERO, add, cross, dot, norm, scale, sub};
use crate::kinetics::{WithLaw, with_law};
use crate::{Kinetic, Kinetics};

/// Forces and torques on the particles at the start of a phase.
struct StartForces {
    force: Vec<Vec3>,
    /// Change of the mean force over the first half step by growth, which may relax a contact.
    relaxed: Vec<Vec3>,
    torque: Vec<Vec3>,
}

impl Bed {
    /// Puts the velocities half a step ahead, and gives the contacts the drift of the step before.
    pub(super) fn set_off(&mut self) -> Result<(), BedError> {
        let equal = if self.equal { Some(self.equal_constants()?) } else { None };
        let forces = self.start_forces(equal.as_ref());
        let acceleration = self.half_kick(forces);
        self.drift_before(equal.as_ref(), &acceleration);
        Ok(())
    }

    /// The scheme of a pair; `equal` are the constants of all pairs where all radii are equal.
    fn pair_scheme(&self, equal: Option<&ContactConstants>, k: usize) -> Scheme {
        let constants = equal.unwrap_or_else(|| &self.pairs.constants[k]);
        Scheme::new(constants, self.material.k1_n_per_m(), self.step_s).paced(self.step_pace())
    }

    /// Settles every contact at the velocities of the start and sums the forces.
    fn start_forces(&mut self, equal: Option<&ContactConstants>) -> StartForces {
        let n = self.particles.len();
        let zero = vec![ZERO; n];
        let mut forces = StartForces { force: zero.clone(), relaxed: zero.clone(), torque: zero };
        let first_pull = first_pull(self.drive.growing.map(|growing| growing.kinetics));
        for i in 0..n {
            for k in self.list.row(i) {
                let mut memory = self.pairs.memory[k];
                if !memory.is_contact() {
                    continue;
                }
                let j = index_of(self.list.other[k]);
                let scheme = self.pair_scheme(equal, k);
                let d = self.distance(i, k);
                let normal = scale(d, 1.0 / norm(d));
                let v = &self.particles.velocity_m_per_s;
                let rate = dot(sub(v[j], v[i]), normal) * scheme.inverse_unit;
                scheme.settle(&self.law, &mut memory, rate);
                self.pairs.memory[k] = memory;
                let mut total = scale(normal, -memory.pull * scheme.force_scale);
                let first = first_pull(&scheme, &self.law, &memory) - memory.pull;
                let relaxed = scale(normal, -first * scheme.force_scale);
                forces.relaxed[i] = add(forces.relaxed[i], relaxed);
                forces.relaxed[j] = sub(forces.relaxed[j], relaxed);
                if self.rotates() {
                    let tangential = scale(self.pairs.spring[k], -self.slider().stiffness);
                    total = add(total, tangential);
                    let radii = (self.particles.radius_m[i], self.particles.radius_m[j]);
                    let turn = scale(cross(normal, tangential), -norm(d) / (radii.0 + radii.1));
                    forces.torque[i] = add(forces.torque[i], scale(turn, radii.0));
                    forces.torque[j] = add(forces.torque[j], scale(turn, radii.1));
                }
                forces.force[i] = add(forces.force[i], total);
                forces.force[j] = sub(forces.force[j], total);
            }
            self.start_forces_of_walls(i, &mut forces);
        }
        forces
    }

    fn start_forces_of_walls(&mut self, i: usize, forces: &mut StartForces) {
        for k in self.wall_list.row(i) {
            let mut memory = self.wall_list.memory[k];
            if !memory.is_contact() {
                continue;
            }
            let wall = self.walls[self.wall_list.wall[k] as usize];
            let scheme = self.wall_scheme(i);
            let v = self.particles.velocity_m_per_s[i][wall.axis];
            scheme.settle(&self.law, &mut memory, -wall.inward * v * scheme.inverse_unit);
            self.wall_list.memory[k] = memory;
            forces.force[i][wall.axis] -= wall.inward * memory.pull * scheme.force_scale;
            if self.rotates() {
                let tangential = scale(self.wall_list.spring[k], -self.slider().stiffness);
                forces.force[i] = add(forces.force[i], tangential);
                let mut normal = ZERO;
                normal[wall.axis] = wall.inward;
                let arm = wall.distance(self.particles.position_m[i]);
                forces.torque[i] = add(forces.torque[i], scale(cross(normal, tangential), -arm));
            }
        }
    }

    /// Kicks by half a step; returns the accelerations.
    fn half_kick(&mut self, forces: StartForces) -> Vec<Vec3> {
        let StartForces { mut force, relaxed, torque } = forces;
        let half = 0.5 * self.step_s;
        let gravity = self.gravity();
        let mut fastest: f64 = 0.0;
        for i in 0..self.particles.len() {
            let (mass, radius) = (self.particles.inertia[i], self.particles.radius_m[i]);
            let v = self.particles.velocity_m_per_s[i];
            let drag = scale(v, -self.drag() * radius);
            // From here on the acceleration.
            force[i] = add(scale(add(force[i], drag), 1.0 / mass), gravity);
            let first = add(force[i], scale(relaxed[i], 1.0 / mass));
            let ahead = add(v, scale(first, half));
            fastest = fastest.max(dot(ahead, ahead));
            self.particles.half_velocity[i] = ahead;
            if self.rotates() {
                let w = self.particles.angular_velocity_per_s[i];
                let drag = scale(w, -4.0 / 3.0 * self.drag() * radius.powi(3));
                let change = scale(add(torque[i], drag), half / (0.4 * mass * radius * radius));
                self.particles.spin[i] = add(w, change);
            }
        }
        self.fastest = fastest.sqrt();
        force
    }

    /// The change of every overlap in the step before, had the acceleration been the same.
    fn drift_before(&mut self, equal: Option<&ContactConstants>, acceleration: &[Vec3]) {
        let step_s = self.step_s;
        let half_velocity = &self.particles.half_velocity;
        let before: Vec<Vec3> = half_velocity
            .iter()
            .zip(acceleration)
            .map(|(&ahead, &acceleration)| sub(ahead, scale(acceleration, step_s)))
            .collect();
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    let j = index_of(self.list.other[k]);
                    let scheme = self.pair_scheme(equal, k);
                    let d = self.distance(i, k);
                    let approach = dot(sub(before[j], before[i]), d) / norm(d);
                    self.pairs.memory[k].drift = approach * step_s * scheme.inverse_unit;
                }
            }
            for k in self.wall_list.row(i) {
                if self.wall_list.memory[k].is_contact() {
                    let wall = self.walls[self.wall_list.wall[k] as usize];
                    let approach = -wall.inward * before[i][wall.axis];
                    self.wall_list.memory[k].drift =
                        approach * step_s * self.wall_scheme(i).inverse_unit;
                }
            }
        }
    }
}

type FirstPull = fn(&Scheme, &LawConstants, &Memory) -> f64;

/// [`Scheme::first_pull`] for the kinetics.
fn first_pull(kinetics: Option<Kinetics>) -> FirstPull {
    struct Pull;
    impl WithLaw for Pull {
        type Output = FirstPull;
        fn run<K: Kinetic>(self) -> FirstPull {
            Scheme::first_pull::<Grows<K>>
        }
    }
    match kinetics {
        None => Scheme::first_pull::<NoGrowth>,
        Some(kinetics) => with_law(kinetics, Pull),
    }
}
