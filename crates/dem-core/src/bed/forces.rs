//! First half of a step: the forces of the pairs.
//!
//! Every pair is computed once, from the positions of its two particles and its own memory, and writes
//! its force in its own place: the bits do not depend on the thread.

use std::marker::PhantomData;
use std::ops::Range;

use super::contact::{Growth, LawConstants, Memory, Scheme};
use super::friction::Slider;
use super::heat_clock::StepPace;
use super::material::{ContactConstants, effective_radius};
use super::necks::{NeckLaw, NeckSprings};
use super::neighbours::{NeighbourList, image_of, index_of};
use super::vec3::{Vec3, ZERO, add, cross, dot, scale, sub};

/// Features of a scene that its pairs are compiled for.
pub(crate) trait PairFeatures {
    /// Whether pairs see each other across periodic sides.
    const IMAGES: bool;
    /// Whether all particles have one radius.
    const EQUAL: bool;
    /// Whether there is friction, and with it rotation.
    const FRICTION: bool;
    /// Growth of the plastic overlap.
    type G: Growth;
}

/// The features, one by one.
pub(crate) struct Pays<const IMAGES: bool, const EQUAL: bool, const FRICTION: bool, G>(
    PhantomData<G>,
);

impl<const IMAGES: bool, const EQUAL: bool, const FRICTION: bool, G: Growth> PairFeatures
    for Pays<IMAGES, EQUAL, FRICTION, G>
{
    const IMAGES: bool = IMAGES;
    const EQUAL: bool = EQUAL;
    const FRICTION: bool = FRICTION;
    type G = G;
}

/// Input of all pairs.
pub(crate) struct PairInput<'a> {
    pub(crate) list: &'a NeighbourList,
    pub(crate) position: &'a [Vec3],
    pub(crate) velocity: &'a [Vec3],
    pub(crate) spin: &'a [Vec3],
    pub(crate) radius: &'a [f64],
    /// The vectors to the images of the box.
    pub(crate) shifts: &'a [Vec3; 32],
    pub(crate) law: LawConstants,
    pub(crate) k1: f64,
    pub(crate) step_s: f64,
    pub(crate) pace: StepPace,
    /// The scheme of all pairs, where all radii are equal.
    pub(crate) scheme: Scheme,
    /// Sum of two radii, where all are equal.
    pub(crate) diameter: f64,
    /// The constants of each pair, where the radii differ.
    pub(crate) constants: &'a [ContactConstants],
    pub(crate) slider: Slider,
    pub(crate) necks: NeckLaw,
    /// Whether no new contacts are made.
    pub(crate) closed: bool,
}

/// Output of the pairs of some particles, each in its place.
pub(crate) struct PairOutput<'a> {
    pub(crate) memory: &'a mut [Memory],
    pub(crate) plastic_before: &'a mut [f64],
    pub(crate) force: &'a mut [Vec3],
    pub(crate) spring: &'a mut [Vec3],
    pub(crate) torque: &'a mut [Vec3],
    pub(crate) turn: &'a mut [Vec3],
    pub(crate) moment: &'a mut [Vec3],
}

impl<'a> PairOutput<'a> {
    fn split_at(self, at: usize) -> (Self, Self) {
        fn split<T>(values: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
            let at = at.min(values.len());
            values.split_at_mut(at)
        }
        let (memory, memory_after) = split(self.memory, at);
        let (plastic_before, plastic_before_after) = split(self.plastic_before, at);
        let (force, force_after) = split(self.force, at);
        let (spring, spring_after) = split(self.spring, at);
        let (torque, torque_after) = split(self.torque, at);
        let (turn, turn_after) = split(self.turn, at);
        let (moment, moment_after) = split(self.moment, at);
        (
            Self { memory, plastic_before, force, spring, torque, turn, moment },
            Self {
                memory: memory_after,
                plastic_before: plastic_before_after,
                force: force_after,
                spring: spring_after,
                torque: torque_after,
                turn: turn_after,
                moment: moment_after,
            },
        )
    }
}

/// The pass for the features.
pub(crate) fn pair_forces<F: PairFeatures>(
    input: &PairInput<'_>,
    output: PairOutput<'_>,
    rows: Range<usize>,
    grain: usize,
) {
    if rows.len() > grain {
        let middle = rows.start + rows.len() / 2;
        let pairs = input.list.start[middle] - input.list.start[rows.start];
        let (before, after) = output.split_at(pairs as usize);
        rayon::join(
            || pair_forces::<F>(input, before, rows.start..middle, grain),
            || pair_forces::<F>(input, after, middle..rows.end, grain),
        );
        return;
    }
    rows_forces::<F>(input, output, rows);
}

fn rows_forces<F: PairFeatures>(input: &PairInput<'_>, output: PairOutput<'_>, rows: Range<usize>) {
    let offset = input.list.start[rows.start] as usize;
    let PairOutput { memory, plastic_before, force, spring, torque, turn, moment } = output;
    let equal_squared = input.diameter * input.diameter;
    let mut nothing = 0.0;
    for i in rows {
        let position = input.position[i];
        for k in input.list.row(i) {
            let entry = input.list.other[k];
            let at = k - offset;
            let j = index_of(entry);
            let mut d = sub(position, input.position[j]);
            if F::IMAGES {
                d = add(d, input.shifts[image_of(entry)]);
            }
            let squared = dot(d, d);
            let memory = &mut memory[at];
            let (reach, reach_squared) = if F::EQUAL {
                (input.diameter, equal_squared)
            } else {
                let reach = input.radius[i] + input.radius[j];
                (reach, reach * reach)
            };
            if squared > reach_squared {
                if memory.is_contact() {
                    *memory = Memory::APART;
                    force[at] = ZERO;
                    if F::FRICTION {
                        spring[at] = ZERO;
                        torque[at] = ZERO;
                        // Empty where necks have no resistance.
                        for of_neck in [&mut *turn, &mut *moment] {
                            of_neck.iter_mut().skip(at).take(1).for_each(|it| *it = ZERO);
                        }
                    }
                }
                continue;
            }
            let local;
            let scheme = if F::EQUAL {
                &input.scheme
            } else {
                local = Scheme::new(&input.constants[k], input.k1, input.step_s).paced(input.pace);
                &local
            };
            let distance = squared.sqrt();
            let overlap = (reach - distance) * scheme.inverse_unit;
            if !memory.is_contact() {
                if input.closed {
                    continue;
                }
                *memory = touch(input, scheme, &Meeting { i, j, d, reach, overlap });
            }
            let before = if F::G::GROWS { &mut plastic_before[at] } else { &mut nothing };
            scheme.advance::<F::G>(&input.law, overlap, memory, before);
            let along = -memory.pull * scheme.force_scale / distance;
            let mut total = scale(d, along);
            if F::FRICTION {
                let grip =
                    Grip { i, j, normal: scale(d, 1.0 / distance), distance, memory, scheme };
                let mut none = (ZERO, ZERO);
                let (turn, moment) = if F::G::NECKS {
                    (&mut turn[at], &mut moment[at])
                } else {
                    (&mut none.0, &mut none.1)
                };
                let springs = NeckSprings { shift: &mut spring[at], turn };
                let tangential;
                (tangential, torque[at], *moment) = tangential_force::<F>(input, &grip, springs);
                total = add(total, tangential);
            }
            force[at] = total;
        }
    }
}

/// A contact as its tangential force sees it.
struct Grip<'a> {
    i: usize,
    j: usize,
    /// From j to i.
    normal: Vec3,
    distance: f64,
    memory: &'a Memory,
    scheme: &'a Scheme,
}

/// Tangential force on the first particle, its torque over the radius of either, and the moment of the neck on the first.
#[inline(always)]
fn tangential_force<F: PairFeatures>(
    input: &PairInput<'_>,
    grip: &Grip<'_>,
    springs: NeckSprings<'_>,
) -> (Vec3, Vec3, Vec3) {
    let &Grip { i, j, normal, distance, memory, scheme } = grip;
    let arm = distance / (input.radius[i] + input.radius[j]);
    let turning = add(
        scale(input.spin[i], input.radius[i] * arm),
        scale(input.spin[j], input.radius[j] * arm),
    );
    let relative = add(sub(input.velocity[i], input.velocity[j]), cross(normal, turning));
    let damping = scheme.damping * input.step_s * input.k1;
    let (tangential, moment) = if F::G::NECKS {
        let resistance = scheme.resistance::<F::G>(&input.law, memory.overlap);
        let radius = effective_radius(input.radius[i], input.radius[j]);
        let neck = (resistance, damping, memory.overlap * radius * radius);
        let rolling = sub(input.spin[i], input.spin[j]);
        input.necks.step(springs, normal, [relative, rolling], neck, input.step_s)
    } else {
        let pressing = (input.law.law.adhesion - memory.pull) * scheme.force_scale;
        let (shift, step_s) = (springs.shift, input.step_s);
        (input.slider.force(shift, normal, relative, pressing, damping, step_s), ZERO)
    };
    (tangential, scale(cross(normal, tangential), -arm), moment)
}

/// Two particles that meet in a step.
struct Meeting {
    i: usize,
    j: usize,
    /// Vector from j to i at the end of the step.
    d: Vec3,
    /// Sum of the radii.
    reach: f64,
    /// At the end of the step, in effective radii.
    overlap: f64,
}

/// The memory, before the step, of a contact that the step has made.
#[cold]
#[inline(never)]
fn touch(input: &PairInput<'_>, scheme: &Scheme, meeting: &Meeting) -> Memory {
    let &Meeting { i, j, d, reach, overlap } = meeting;
    let moved = scale(sub(input.velocity[i], input.velocity[j]), input.step_s);
    let before = sub(d, moved);
    let before = (reach - dot(before, before).sqrt()) * scheme.inverse_unit;
    scheme.touching(&input.law, before.min(0.0), overlap)
}
