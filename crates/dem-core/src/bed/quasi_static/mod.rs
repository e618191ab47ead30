//! Force balance at every instant: the motion of a bed without inertia.
//!
//! A contact that grows is a spring in series with a dashpot: `dp/dt = g D`, `D = f/alpha`, with the spring
//! `f = kappa (x - p)`. Over a step of any length, with p taken implicitly, it is a softer spring,
//!
//! ```text
//! f1 = kappa (x1 - p0)/(1 + s),   s = kappa g dt/alpha,
//! ```
//!
//! so that one balance of forces gives the positions at the end of the step: no step is ever unstable,
//! and none depends on K1. `g` is the mean rate over the step, `1/g = mean of 1/(rate G)` over the overlaps passed
//! through (Simpson's rule, in two parts where the rate bends): exact for a pair to the error of that rule, so that
//! the steps of the singular start grow geometrically.
//!
//! Where the contacts leave a particle or a group free to move, a background drag holds it that is a ten-thousandth
//! of the drag of the contacts: it makes the balance unique and hardly changes it. Particles that nothing [carries](carried)
//! against gravity fall against that drag onto what is near below them; a fall that goes on ends the run.
//!
//! Contacts are made and broken between steps only. Within a step every contact carries a force that rises
//! with its overlap, also where it opens: so there is one balance (the minimum of a function that is convex apart from
//! the rotation of the contacts), and [Newton's method](balance) finds it. A step in which particles meet, or part,
//! by more than a little is cut where they do. A new contact starts as the contact of its overlap that
//! carries nothing. Damping, drag and friction, which act on velocities or need a history of sliding, are left out. Necks that
//! resist shear and rolling, where the scene has them, are dashpots over the step, and the turns of the particles unknowns beside their shifts.
//!
//! The step is chosen so that the change of D over it, times half the growth in it, which is the error of the implicit rule,
//! moves the contact ratios by no more than the tolerance in root mean square.

mod balance;
mod carried;
mod network;
mod settings;
mod shear;

pub use settings::{QuasiStaticReport, QuasiStaticSettings};

use super::contact::{Grows, Memory};
use super::engine::Bed;
use super::error::{BedError, field, within};
use super::material::ContactConstants;
use super::neighbours::index_of;
use super::region::Side;
use super::vec3::{Vec3, ZERO, dot, norm, scale, sub};
use crate::Kinetic;
use crate::kinetics::{WithLaw, with_law};
use balance::{RateOf, Step, rate_of};

/// Largest overlap of a new contact, in effective radii, over the tolerance of a/R.
const NEW_OVERLAP: f64 = 50.0;

/// Length of the first step over the time in which the start overlap would double.
const FIRST: f64 = 0.1;

/// Fall of a particle that nothing carries, in mean radii, beyond which it is taken to be one that does not end.
const FURTHEST_FALL: f64 = 10.0;

impl Bed {
    /// Advances to a time through states of force balance; at the present time it only balances the bed. It ends before that
    /// time where the settings say so.
    ///
    /// Velocities are zero afterwards. Contacts keep their state, so that modes may alternate.
    ///
    /// # Errors
    ///
    /// [`BedError::NothingCarries`], [`BedError::NoBalance`], [`BedError::NoRest`], [`BedError::WorkLimit`], [`BedError::Field`].
    pub fn advance_quasi_static(
        &mut self,
        until_s: f64,
        settings: &QuasiStaticSettings,
        report: &mut QuasiStaticReport,
    ) -> Result<(), BedError> {
        self.check_quasi_static(settings)?;
        self.stop_motion();
        let rate = self.rate();
        let ends = settings.ends_where_necks_meet && rate.is_some();
        let equal = self.equal_constants()?;
        let still = Step { length_s: 0.0, rate, settings, equal: &equal };
        if report.balanced_at_s != Some(self.time_s) {
            self.come_to_rest(&still, report).map_err(|error| self.cause(error))?;
        }
        let mut step_s = report.next_step_s.unwrap_or_else(|| self.first_step_s(rate, &equal));
        let (mut strain_rate, mut fallen_m) = (0.0, 0.0);
        let mut balanced = self.clone();
        // In the time of growth: a balance of forces knows no other.
        let (mut now_s, last_s) = (self.growth_time_s(self.time_s), self.growth_time_s(until_s));
        while now_s < last_s {
            let left_s = last_s - now_s;
            let this_s = without_sliver(step_s, left_s);
            if report.steps + report.rejected >= settings.max_work {
                let (max_work, time_s) = (settings.max_work, self.time_s);
                return Err(BedError::WorkLimit { max_work, time_s });
            }
            let step = Step { length_s: this_s, ..still };
            let taken = self.quasi_static_step(&step, strain_rate, report);
            let (error, mean_error, strain) = match taken {
                Ok(Taken::Whole { error, mean_error, strain })
                    if error <= settings.tolerance && !(ends && self.is_overfull()) =>
                {
                    (error, mean_error, strain)
                }
                failed if this_s < 1e-12 * last_s => {
                    return Err(self
                        .cause(failed.err().unwrap_or(BedError::NoRest { time_s: self.time_s })));
                }
                failed => {
                    self.clone_from(&balanced);
                    report.rejected += 1;
                    step_s = this_s
                        * match failed {
                            Ok(Taken::Whole { error, .. }) => {
                                (0.5 * settings.tolerance / error).sqrt().clamp(0.1, 0.7)
                            }
                            Ok(Taken::Cut { share }) => share,
                            Err(BedError::NoBalance { .. }) => 0.25,
                            Err(error) => return Err(error),
                        };
                    continue;
                }
            };
            now_s = if this_s == left_s { last_s } else { now_s + this_s };
            self.time_s =
                if this_s == left_s { until_s } else { self.time_of_growth_s(now_s, until_s) };
            report.steps += 1;
            report.mean_error += mean_error;
            report.squared_error += error * error;
            report.error_estimate = report.mean_error.abs() + report.squared_error.sqrt();
            let growth = (0.5 * settings.tolerance / error.max(1e-300)).sqrt().clamp(0.5, 2.0);
            step_s = if this_s < step_s { step_s.max(this_s * growth) } else { this_s * growth };
            strain_rate = strain / this_s;
            fallen_m = self.fallen_m(fallen_m, this_s)?;
            if ends && self.pairs_have_ended() {
                break;
            }
            balanced.clone_from(self);
        }
        // Time goes on where nothing grows.
        self.time_s = if now_s < last_s { self.time_s } else { self.time_s.max(until_s) };
        report.balanced_at_s = Some(self.time_s);
        report.next_step_s = step_s.is_finite().then_some(step_s);
        self.particles.velocity_m_per_s.fill(ZERO);
        // The next phase starts its clock here.
        self.phase_start_s = self.time_s;
        self.phase_steps = 0;
        Ok(())
    }

    /// A balance of forces knows no velocities, no springs of friction and necks, and no rotation but that within a step.
    fn stop_motion(&mut self) {
        self.particles.velocity_m_per_s.fill(ZERO);
        self.particles.half_velocity.fill(ZERO);
        self.fastest = 0.0;
        let (particles, pairs) = (&mut self.particles, &mut self.pairs);
        for values in [
            &mut particles.spin,
            &mut particles.angular_velocity_per_s,
            &mut pairs.spring,
            &mut pairs.torque,
            &mut pairs.turn,
            &mut pairs.moment,
            &mut self.wall_list.spring,
        ] {
            values.fill(ZERO);
        }
    }

    fn check_quasi_static(&self, settings: &QuasiStaticSettings) -> Result<(), BedError> {
        within("tolerance", settings.tolerance, 1e-9, 0.1, "use 1e-9 to 0.1")?;
        within("balance", settings.balance, 1e-9, 0.1, "use 1e-9 to 0.1 of fa")?;
        if settings.free_box && self.around.region.sides != [Side::Periodic; 3] {
            let remedy = "a box that shrinks freely is periodic on all sides";
            return Err(field("box.free", "true", remedy));
        }
        Ok(())
    }

    fn rate(&self) -> Option<RateOf> {
        struct Rate;
        impl WithLaw for Rate {
            type Output = RateOf;
            fn run<K: Kinetic>(self) -> RateOf {
                rate_of::<Grows<K>>
            }
        }
        self.drive.growing.map(|growing| with_law(growing.kinetics, Rate))
    }

    /// A step in which the fastest contact grows by a part of itself.
    fn first_step_s(&self, rate: Option<RateOf>, equal: &ContactConstants) -> f64 {
        let Some(rate) = rate else { return f64::INFINITY };
        let mut shortest = f64::INFINITY;
        for (k, memory) in self.pairs.memory.iter().enumerate() {
            if memory.is_contact() {
                let constants = self.contact_constants(equal, k);
                let x = memory.overlap.max(constants.start);
                shortest = shortest.min(FIRST * x / rate(&constants.rate, x));
            }
        }
        shortest
    }

    /// How far particles that nothing carries have fallen without a pause, by the furthest of each step.
    fn fallen_m(&self, so_far_m: f64, step_s: f64) -> Result<f64, BedError> {
        let Some(loose) = self.loose() else { return Ok(0.0) };
        let fallen = |(moved, is_loose): (&Vec3, &bool)| if *is_loose { norm(*moved) } else { 0.0 };
        let moved = self.particles.velocity_m_per_s.iter().zip(&loose.is_loose);
        let so_far_m = so_far_m + step_s * moved.map(fallen).fold(0.0, f64::max);
        if so_far_m > FURTHEST_FALL * self.mean_radius() {
            return Err(loose.error(self.time_s));
        }
        Ok(so_far_m)
    }

    /// Balance without growth, repeated until no contact opens or closes and all particles are carried.
    fn come_to_rest(
        &mut self,
        still: &Step<'_>,
        report: &mut QuasiStaticReport,
    ) -> Result<(), BedError> {
        /// From then on contacts only open.
        const CLOSING: u32 = 20;
        /// With what is not at rest by then something is wrong.
        const MOST: u32 = 1000;
        let mut was_carried = false;
        for round in 1..=MOST {
            self.particles.half_velocity.fill(ZERO);
            let strain = self.balance(still, 0.0, report)?;
            let share = self.meeting(still, strain);
            if share < 1.0 {
                let moves = self.particles.half_velocity.clone();
                self.displace(&moves, share - 1.0, strain);
            }
            self.particles.half_velocity.fill(ZERO);
            self.follow()?;
            let may_close = round <= CLOSING;
            let changed = self.take(still, may_close).changed;
            let loose = self.loose();
            was_carried |= loose.is_none();
            match loose {
                Some(loose) if !may_close && !was_carried => return Err(loose.error(self.time_s)),
                Some(_) if may_close => {}
                _ if changed == 0 && share == 1.0 => return Ok(()),
                _ => {}
            }
        }
        Err(BedError::NoRest { time_s: self.time_s })
    }

    fn quasi_static_step(
        &mut self,
        step: &Step<'_>,
        strain_rate: f64,
        report: &mut QuasiStaticReport,
    ) -> Result<Taken, BedError> {
        // Start from the displacements of the step before.
        let moves: Vec<Vec3> =
            self.particles.velocity_m_per_s.iter().map(|&v| scale(v, step.length_s)).collect();
        self.particles.half_velocity.fill(ZERO);
        self.displace(&moves, 1.0, strain_rate * step.length_s);
        let strain = self.balance(step, strain_rate * step.length_s, report)?;
        self.follow()?;
        let share = self.meeting(step, strain);
        if share < 1.0 {
            return Ok(Taken::Cut { share });
        }
        let particles = &mut self.particles;
        for (v, moved) in particles.velocity_m_per_s.iter_mut().zip(&mut particles.half_velocity) {
            *v = scale(*moved, 1.0 / step.length_s);
            *moved = ZERO;
        }
        let Changes { error, mean_error, .. } = self.take(step, true);
        Ok(Taken::Whole { error, mean_error, strain })
    }

    /// The share of a step after which the first particles meet or part, or leave what the neighbour list sees: 1 where none
    /// of those that do overlap, or are apart, by more than they may.
    fn meeting(&self, step: &Step<'_>, strain: f64) -> f64 {
        let allowed = self.law.law.adhesion.max(NEW_OVERLAP * step.settings.tolerance);
        let moved = &self.particles.half_velocity;
        let furthest = moved.iter().map(|&by| norm(by)).fold(0.0, f64::max);
        let mut share = if furthest > 0.5 * self.skin { 0.5 * self.skin / furthest } else { 1.0 };
        let mut meet = |memory: &Memory, before: f64, after: f64| {
            // Half of what is allowed, on a straight way there.
            if memory.is_contact() {
                if after < -allowed {
                    let before = memory.overlap;
                    share = share.min((before + 0.5 * allowed) / (before - after));
                }
            } else if after > allowed {
                let before = before.min(0.0);
                share = share.min((0.5 * allowed - before) / (after - before));
            }
        };
        for i in 0..self.particles.len() {
            let radius_i = self.particles.radius_m[i];
            for k in self.list.row(i) {
                if self.closed && !self.pairs.memory[k].is_contact() {
                    continue;
                }
                let j = index_of(self.list.other[k]);
                let radius_j = self.particles.radius_m[j];
                let unit = self.material.overlap_unit(radius_i, radius_j);
                let d = self.distance(i, k);
                let then = scale(sub(d, sub(moved[i], moved[j])), 1.0 / (1.0 + strain));
                let overlap = |d: Vec3| (radius_i + radius_j - norm(d)) / unit;
                meet(&self.pairs.memory[k], overlap(then), overlap(d));
            }
            for k in self.wall_list.row(i) {
                let wall = &self.walls[self.wall_list.wall[k] as usize];
                let distance = wall.distance(self.particles.position_m[i]);
                let then = distance - wall.inward * moved[i][wall.axis];
                let unit = self.material.wall_unit(radius_i);
                let overlap = |distance: f64| (radius_i - distance) / unit;
                meet(&self.wall_list.memory[k], overlap(then), overlap(distance));
            }
        }
        if share < 1.0 { share.clamp(0.02, 0.95) } else { 1.0 }
    }

    /// Rebuilds the list where particles have moved out of its skin.
    fn follow(&mut self) -> Result<(), BedError> {
        let mut furthest: f64 = 0.0;
        for (&now, &then) in self.particles.position_m.iter().zip(&self.listed_position) {
            let moved = sub(now, then);
            furthest = furthest.max(dot(moved, moved));
        }
        if furthest.sqrt() + self.travelled > 0.45 * self.skin {
            self.rebuild()?;
        }
        Ok(())
    }

    /// Moves the contacts to the end of the step, at the present positions.
    fn take(&mut self, step: &Step<'_>, may_close: bool) -> Changes {
        let may_meet = may_close && !self.closed;
        let alpha = self.law.law.adhesion;
        let mut changes = Changes::default();
        let (mut error, mut mean, mut count) = (0.0, 0.0, 0u32);
        for i in 0..self.particles.len() {
            let (position, radius) = (self.particles.position_m[i], self.particles.radius_m[i]);
            for k in self.list.row(i) {
                let j = index_of(self.list.other[k]);
                let reach = radius + self.particles.radius_m[j];
                let length = norm(self.distance(i, k));
                let memory = self.pairs.memory[k];
                if length > reach || !(may_meet || memory.is_contact()) {
                    changes.changed += u64::from(memory.is_contact());
                    self.pairs.memory[k] = Memory::APART;
                    continue;
                }
                let constants = self.contact_constants(step.equal, k);
                let x1 = (reach - length) / constants.unit;
                let (plastic, drift);
                if memory.is_contact() {
                    let outcome = self.outcome(&memory, x1, &constants, step);
                    plastic = outcome.plastic;
                    drift = if step.length_s > 0.0 {
                        let change = (outcome.force - (alpha - memory.pull)) / alpha;
                        let ratio =
                            0.5 * change * outcome.free_growth / (2.0 * x1.max(alpha).sqrt());
                        error += ratio * ratio;
                        mean += ratio;
                        count += 1;
                        (x1 - memory.overlap) / step.length_s * self.step_s
                    } else {
                        0.0
                    };
                } else {
                    changes.changed += 1;
                    drift = 0.0;
                    plastic = if step.length_s > 0.0 && step.rate.is_some() {
                        self.law.law.equilibrium_plastic_overlap(x1.max(alpha))
                    } else {
                        0.0
                    };
                }
                let (force, plastic) = self.law.force(x1, plastic, constants.end_plastic);
                self.pairs.memory[k] = Memory { overlap: x1, drift, plastic, pull: alpha - force };
                self.pairs.plastic_before[k] = plastic;
            }
            for k in self.wall_list.row(i) {
                let wall = self.walls[self.wall_list.wall[k] as usize];
                let overlap = (radius - wall.distance(position)) / self.material.wall_unit(radius);
                let memory = &mut self.wall_list.memory[k];
                let was = memory.is_contact();
                if overlap < 0.0 || !(may_close || was) {
                    changes.changed += u64::from(was);
                    *memory = Memory::APART;
                } else {
                    changes.changed += u64::from(!was);
                    let before = if was { memory.plastic } else { 0.0 };
                    let (force, plastic) = self.law.force(overlap, before, self.law.end_plastic);
                    *memory = Memory { overlap, drift: 0.0, plastic, pull: alpha - force };
                }
            }
        }
        let count = f64::from(count.max(1));
        changes.error = (error / count).sqrt();
        changes.mean_error = mean / count;
        changes
    }
}

/// A step of the wanted length or less that leaves no sliver at the end.
fn without_sliver(step_s: f64, left_s: f64) -> f64 {
    if step_s >= left_s {
        left_s
    } else if 2.0 * step_s > left_s {
        0.5 * left_s
    } else {
        step_s
    }
}

/// Outcome of a step.
enum Taken {
    /// The whole step, with an error of a/R (root mean square, and mean) and a strain of the box.
    Whole { error: f64, mean_error: f64, strain: f64 },
    /// Particles meet or part within the step: only a share of it may be made.
    Cut { share: f64 },
}

/// Changes made by a step.
#[derive(Default)]
struct Changes {
    /// Error of a/R, root mean square.
    error: f64,
    /// Error of a/R, mean.
    mean_error: f64,
    /// Contacts made and broken.
    changed: u64,
}
