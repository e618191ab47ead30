//! Second half of a step: each particle gathers its forces and moves.
//!
//! The forces are added in the order of the list, first of the pairs that the particle is the first of,
//! then of those it is the second of, then of the walls: the bits do not depend on the thread.

use std::ops::Range;

use super::contact::{LawConstants, Memory, NoGrowth, Scheme};
use super::friction::Slider;
use super::material::Material;
use super::neighbours::NeighbourList;
use super::region::Wall;
use super::vec3::{Vec3, ZERO, add, cross, dot, scale, sub};

/// Features of a scene that its motion is compiled for.
pub(crate) trait MotionFeatures {
    /// Whether there are walls.
    const WALLS: bool;
    /// Whether there is gravity.
    const GRAVITY: bool;
    /// Whether there is a background drag.
    const DRAG: bool;
    /// Whether there is friction, and with it rotation.
    const FRICTION: bool;
}

/// The features, one by one.
pub(crate) struct Moves<
    const WALLS: bool,
    const GRAVITY: bool,
    const DRAG: bool,
    const FRICTION: bool,
>;

impl<const WALLS: bool, const GRAVITY: bool, const DRAG: bool, const FRICTION: bool> MotionFeatures
    for Moves<WALLS, GRAVITY, DRAG, FRICTION>
{
    const WALLS: bool = WALLS;
    const GRAVITY: bool = GRAVITY;
    const DRAG: bool = DRAG;
    const FRICTION: bool = FRICTION;
}

/// Particles near walls.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct WallList {
    /// Place of the first wall of particle i.
    pub(crate) start: Vec<u32>,
    /// The wall.
    pub(crate) wall: Vec<u8>,
    pub(crate) memory: Vec<Memory>,
    pub(crate) spring: Vec<Vec3>,
}

impl WallList {
    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }
}

/// Input of all particles.
pub(crate) struct MotionInput<'a> {
    pub(crate) list: &'a NeighbourList,
    pub(crate) pair_force: &'a [Vec3],
    pub(crate) pair_torque: &'a [Vec3],
    /// Moments of necks; empty where they have no resistance.
    pub(crate) pair_moment: &'a [Vec3],
    pub(crate) radius: &'a [f64],
    /// Inertial masses.
    pub(crate) mass: &'a [f64],
    pub(crate) wall_start: &'a [u32],
    pub(crate) wall: &'a [u8],
    pub(crate) walls: &'a [Wall],
    pub(crate) material: &'a Material,
    pub(crate) law: LawConstants,
    pub(crate) slider: Slider,
    pub(crate) step_s: f64,
    /// Acceleration by gravity, lowered by the mass scaling.
    pub(crate) gravity: Vec3,
    /// `6 pi eta` of the background \[Pa s\].
    pub(crate) drag: f64,
    /// Whether to stop where the forces were computed, with velocities of that time.
    pub(crate) is_last: bool,
}

/// Output of some particles, each in its place.
pub(crate) struct MotionOutput<'a> {
    pub(crate) position: &'a mut [Vec3],
    pub(crate) half_velocity: &'a mut [Vec3],
    pub(crate) velocity: &'a mut [Vec3],
    pub(crate) spin: &'a mut [Vec3],
    pub(crate) angular_velocity: &'a mut [Vec3],
    pub(crate) wall_memory: &'a mut [Memory],
    pub(crate) wall_spring: &'a mut [Vec3],
}

impl MotionOutput<'_> {
    fn split_at(self, particles: usize, walls: usize) -> (Self, Self) {
        fn split<T>(values: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
            let at = at.min(values.len());
            values.split_at_mut(at)
        }
        let (position, position_after) = split(self.position, particles);
        let (half_velocity, half_velocity_after) = split(self.half_velocity, particles);
        let (velocity, velocity_after) = split(self.velocity, particles);
        let (spin, spin_after) = split(self.spin, particles);
        let (angular_velocity, angular_velocity_after) = split(self.angular_velocity, particles);
        let (wall_memory, wall_memory_after) = split(self.wall_memory, walls);
        let (wall_spring, wall_spring_after) = split(self.wall_spring, walls);
        (
            Self {
                position,
                half_velocity,
                velocity,
                spin,
                angular_velocity,
                wall_memory,
                wall_spring,
            },
            Self {
                position: position_after,
                half_velocity: half_velocity_after,
                velocity: velocity_after,
                spin: spin_after,
                angular_velocity: angular_velocity_after,
                wall_memory: wall_memory_after,
                wall_spring: wall_spring_after,
            },
        )
    }
}

/// The pass for the features. Returns the largest squared speed; infinite where one is not a number.
pub(crate) fn motion<F: MotionFeatures>(
    input: &MotionInput<'_>,
    output: MotionOutput<'_>,
    rows: Range<usize>,
    grain: usize,
) -> f64 {
    if rows.len() > grain {
        let half = rows.len() / 2;
        let middle = rows.start + half;
        let walls =
            if F::WALLS { input.wall_start[middle] - input.wall_start[rows.start] } else { 0 };
        let (before, after) = output.split_at(half, walls as usize);
        let (a, b) = rayon::join(
            || motion::<F>(input, before, rows.start..middle, grain),
            || motion::<F>(input, after, middle..rows.end, grain),
        );
        return a.max(b);
    }
    rows_motion::<F>(input, output, rows)
}

fn rows_motion<F: MotionFeatures>(
    input: &MotionInput<'_>,
    output: MotionOutput<'_>,
    rows: Range<usize>,
) -> f64 {
    let h = input.step_s;
    let wall_offset = if F::WALLS { input.wall_start[rows.start] as usize } else { 0 };
    let MotionOutput {
        position,
        half_velocity,
        velocity,
        spin,
        angular_velocity,
        wall_memory,
        wall_spring,
    } = output;
    let mut fastest: f64 = 0.0;
    for (at, i) in rows.enumerate() {
        let (mut force, mut turn) = gathered::<F>(input, i);
        let mass = input.mass[i];
        if F::WALLS {
            for k in input.wall_start[i] as usize..input.wall_start[i + 1] as usize {
                let here = Body {
                    position: position[at],
                    velocity: half_velocity[at],
                    spin: if F::FRICTION { spin[at] } else { ZERO },
                    radius: input.radius[i],
                    mass,
                };
                let mut no_spring = ZERO;
                let spring =
                    if F::FRICTION { &mut wall_spring[k - wall_offset] } else { &mut no_spring };
                let memory = &mut wall_memory[k - wall_offset];
                let (push, torque) = wall_force::<F>(input, k, &here, memory, spring);
                force = add(force, push);
                turn = add(turn, torque);
            }
        }
        let mut kick = scale(force, h / mass);
        if F::GRAVITY {
            kick = add(kick, scale(input.gravity, h));
        }
        let before = half_velocity[at];
        let after = if F::DRAG {
            let half = 0.5 * h * input.drag * input.radius[i] / mass;
            let after = scale(add(scale(before, 1.0 - half), kick), 1.0 / (1.0 + half));
            if input.is_last {
                velocity[at] = scale(add(before, scale(kick, 0.5)), 1.0 / (1.0 + half));
            }
            after
        } else {
            if input.is_last {
                velocity[at] = add(before, scale(kick, 0.5));
            }
            add(before, kick)
        };
        half_velocity[at] = after;
        if F::FRICTION {
            rotate::<F>(input, i, turn, &mut spin[at], &mut angular_velocity[at]);
        }
        if !input.is_last {
            position[at] = add(position[at], scale(after, h));
        }
        let squared = dot(after, after);
        fastest = fastest.max(if squared.is_nan() { f64::INFINITY } else { squared });
    }
    fastest
}

/// Force of the pairs on a particle, and their torque.
#[inline(always)]
fn gathered<F: MotionFeatures>(input: &MotionInput<'_>, i: usize) -> (Vec3, Vec3) {
    let mut force = ZERO;
    for pair in &input.pair_force[input.list.row(i)] {
        force = add(force, *pair);
    }
    for &pair in input.list.reverse_row(i) {
        force = sub(force, input.pair_force[pair as usize]);
    }
    let mut turn = ZERO;
    if F::FRICTION {
        for pair in &input.pair_torque[input.list.row(i)] {
            turn = add(turn, *pair);
        }
        for &pair in input.list.reverse_row(i) {
            turn = add(turn, input.pair_torque[pair as usize]);
        }
        turn = scale(turn, input.radius[i]);
        if !input.pair_moment.is_empty() {
            for moment in &input.pair_moment[input.list.row(i)] {
                turn = add(turn, *moment);
            }
            for &pair in input.list.reverse_row(i) {
                turn = sub(turn, input.pair_moment[pair as usize]);
            }
        }
    }
    (force, turn)
}

/// Kicks the rotation of a particle by one step.
#[inline(always)]
fn rotate<F: MotionFeatures>(
    input: &MotionInput<'_>,
    i: usize,
    turn: Vec3,
    spin: &mut Vec3,
    angular_velocity: &mut Vec3,
) {
    let h = input.step_s;
    // Moment of inertia 2/5 m R^2; drag torque 8 pi eta R^3.
    let inertia = 0.4 * input.mass[i] * input.radius[i] * input.radius[i];
    let kick = scale(turn, h / inertia);
    let half = if F::DRAG {
        0.5 * h * (4.0 / 3.0 * input.drag * input.radius[i].powi(3)) / inertia
    } else {
        0.0
    };
    if input.is_last {
        *angular_velocity = scale(add(*spin, scale(kick, 0.5)), 1.0 / (1.0 + half));
    }
    *spin = scale(add(scale(*spin, 1.0 - half), kick), 1.0 / (1.0 + half));
}

/// A particle as its walls see it.
pub(crate) struct Body {
    position: Vec3,
    velocity: Vec3,
    spin: Vec3,
    radius: f64,
    mass: f64,
}

/// Force and torque of a wall on a particle.
#[inline(always)]
fn wall_force<F: MotionFeatures>(
    input: &MotionInput<'_>,
    k: usize,
    body: &Body,
    memory: &mut Memory,
    spring: &mut Vec3,
) -> (Vec3, Vec3) {
    let wall = &input.walls[input.wall[k] as usize];
    let distance = wall.distance(body.position);
    if distance > body.radius {
        *memory = Memory::APART;
        *spring = ZERO;
        return (ZERO, ZERO);
    }
    let constants = input.material.wall_contact(body.radius, body.mass);
    let scheme = Scheme::new(&constants, input.material.k1_n_per_m(), input.step_s);
    let overlap = (body.radius - distance) * scheme.inverse_unit;
    if !memory.is_contact() {
        let before = distance - wall.inward * body.velocity[wall.axis] * input.step_s;
        let before = (body.radius - before) * scheme.inverse_unit;
        *memory = scheme.touching(&input.law, before.min(0.0), overlap);
    }
    scheme.advance::<NoGrowth>(&input.law, overlap, memory, &mut 0.0);
    let mut normal = ZERO;
    normal[wall.axis] = wall.inward;
    let mut force = scale(normal, -memory.pull * scheme.force_scale);
    let mut torque = ZERO;
    if F::FRICTION {
        let relative = add(body.velocity, cross(normal, scale(body.spin, distance)));
        let tangential = input.slider.force(
            spring,
            normal,
            relative,
            (input.law.law.adhesion - memory.pull) * scheme.force_scale,
            scheme.damping * input.step_s * input.material.k1_n_per_m(),
            input.step_s,
        );
        force = add(force, tangential);
        torque = scale(cross(normal, tangential), -distance);
    }
    (force, torque)
}
