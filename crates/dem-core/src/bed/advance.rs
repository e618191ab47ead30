//! The steps of a bed: the pair pass, the motion pass, and a look at the neighbour list.

use super::contact::{Grows, Growth, NoGrowth, Scheme, Sintered};
use super::engine::Bed;
use super::error::BedError;
use super::forces::{PairInput, PairOutput, Pays, pair_forces};
use super::motion::{MotionInput, MotionOutput, Moves, motion};
use super::vec3::{Vec3, ZERO, add, dot, scale, sub};
use crate::Kinetic;
use crate::kinetics::{WithLaw, with_law};

impl Bed {
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
        let (step_s, pace) = (self.step_s, self.step_pace());
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
            pace,
            scheme: passes.scheme.paced(pace),
            diameter: 2.0 * self.particles.radius_m[0],
            constants: &self.pairs.constants,
            slider,
            necks: self.neck_law(),
            closed: self.closed,
        };
        let output = PairOutput {
            memory: &mut self.pairs.memory,
            plastic_before: &mut self.pairs.plastic_before,
            force: &mut self.pairs.force,
            spring: &mut self.pairs.spring,
            torque: &mut self.pairs.torque,
            turn: &mut self.pairs.turn,
            moment: &mut self.pairs.moment,
        };
        (passes.pairs)(&input, output, 0..n, grain);
        let gravity = self.gravity();
        let drag = self.drag();
        let input = MotionInput {
            list: &self.list,
            pair_force: &self.pairs.force,
            pair_torque: &self.pairs.torque,
            pair_moment: &self.pairs.moment,
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
}

type PairPass =
    for<'a, 'b, 'c> fn(&'a PairInput<'b>, PairOutput<'c>, std::ops::Range<usize>, usize);
type MotionPass =
    for<'a, 'b, 'c> fn(&'a MotionInput<'b>, MotionOutput<'c>, std::ops::Range<usize>, usize) -> f64;

/// The two passes of a step, compiled for the features of the scene.
struct Passes {
    pairs: PairPass,
    motion: MotionPass,
    scheme: Scheme,
}

impl Passes {
    fn choose(bed: &Bed) -> Self {
        let images = bed.around.region.has_images();
        let friction = bed.rotates();
        let has = PairPasses { images, equal: bed.equal, friction, necks: bed.has_necks() };
        let pairs = match bed.drive.growing {
            None => has.pass::<NoGrowth>(),
            Some(growing) => with_law(growing.kinetics, has),
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

/// The features that choose a pair pass, besides the growth.
struct PairPasses {
    images: bool,
    equal: bool,
    friction: bool,
    necks: bool,
}

impl PairPasses {
    fn pass<G: Growth>(self) -> PairPass {
        if self.necks && G::GROWS {
            return match (self.images, self.equal) {
                (false, false) => pair_forces::<Pays<false, false, true, Sintered<G>>>,
                (false, true) => pair_forces::<Pays<false, true, true, Sintered<G>>>,
                (true, false) => pair_forces::<Pays<true, false, true, Sintered<G>>>,
                (true, true) => pair_forces::<Pays<true, true, true, Sintered<G>>>,
            };
        }
        match (self.images, self.equal, self.friction) {
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
}

impl WithLaw for PairPasses {
    type Output = PairPass;
    fn run<K: Kinetic>(self) -> PairPass {
        self.pass::<Grows<K>>()
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
