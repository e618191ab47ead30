//! Force balance at every instant: what a bed does when inertia plays no part.
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
//! of the drag of the contacts: it makes the balance unique and hardly changes it.
//!
//! The balance is found by Newton's method, its linear systems by conjugate gradients. Damping, drag and friction,
//! which act on velocities or need a history of sliding, play no part.
//!
//! Contacts are made between steps only: one that is tried out within an iteration would hold itself
//! together. A step in which particles meet is cut where they do.
//!
//! The step is chosen so that the change of D over it, the error of the implicit rule, moves no
//! contact ratio by more than the tolerance in root mean square.

use super::contact::{Grows, Growth, LawConstants, Memory};
use super::engine::Bed;
use super::error::{BedError, field, within};
use super::material::ContactConstants;
use super::neighbours::index_of;
use super::region::Side;
use super::vec3::{Vec3, ZERO, add, dot, norm, scale, sub};
use crate::Kinetics;
use crate::kinetics::{
    Frenkel, Pokluda, RateCoefficients, RegimeMap, ThreeStage, ThreeStagePokluda,
};

/// How the quasi-static mode goes about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuasiStaticSettings {
    /// Error of a/R (root mean square over the contacts) that one step may make.
    pub tolerance: f64,
    /// Largest net force on a particle that counts as balanced, over fa.
    pub balance: f64,
    /// Whether a box that is periodic on all sides shrinks so that it carries no pressure.
    pub free_box: bool,
    /// Largest number of steps.
    pub max_work: u64,
}

impl Default for QuasiStaticSettings {
    fn default() -> Self {
        Self { tolerance: 1e-4, balance: 1e-4, free_box: false, max_work: 100_000 }
    }
}

/// What a quasi-static run did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QuasiStaticReport {
    /// Steps taken.
    pub steps: u64,
    /// Steps made again, shorter.
    pub rejected: u64,
    /// Newton iterations.
    pub newton: u64,
    /// Iterations of conjugate gradients, each about as dear as a step of the engine.
    pub conjugate_gradients: u64,
    /// Sum of the errors of a/R of all steps.
    pub error_estimate: f64,
    /// The time up to which the bed is known to be in balance \[s\].
    pub balanced_at_s: Option<f64>,
}

/// A contact as one Newton iteration sees it.
struct Spring {
    i: usize,
    /// The second particle; none at a wall.
    j: Option<usize>,
    /// From the second body to the first.
    normal: Vec3,
    /// Distance of the centres, by which a strain of the box stretches it; 0 at a wall.
    length: f64,
    /// Stiffness \[N/m\] and pull \[N\].
    stiffness: f64,
    pull: f64,
    /// `K1 alpha/(g dt)` \[N/m\], or the stiffness where nothing grows.
    drag: f64,
}

/// What a step makes of a contact.
struct Outcome {
    plastic: f64,
    force: f64,
    stiffness: f64,
    /// `g dt`: by how much p grows where D = 1.
    free_growth: f64,
}

type RateOf = fn(&RateCoefficients<f64>, f64) -> f64;

fn rate_of<G: Growth>(coefficients: &RateCoefficients<f64>, overlap: f64) -> f64 {
    let (n, d) = G::rate_fraction(coefficients, overlap);
    n / d
}

/// Mean rate over the overlaps from `from` to `to`: the harmonic one, which is what takes the right time.
fn mean_rate(rate: RateOf, coefficients: &RateCoefficients<f64>, from: f64, to: f64) -> f64 {
    let slowness = |x: f64| 1.0 / rate(coefficients, x);
    let simpson = |a: f64, b: f64| {
        (b - a) / 6.0 * (slowness(a) + 4.0 * slowness(0.5 * (a + b)) + slowness(b))
    };
    let (low, high) = (from.min(to), from.max(to));
    if high - low <= 1e-9 * high {
        return rate(coefficients, 0.5 * (low + high));
    }
    let bend = coefficients.switch;
    let time = if low < bend && bend < high {
        simpson(low, bend * (1.0 - 1e-14)) + simpson(bend, high)
    } else {
        simpson(low, high)
    };
    (high - low) / time
}

/// Background drag over that of a contact.
const HOLD: f64 = 1e-4;

/// Overlap, in effective radii, that a contact may be made with, over the tolerance of a/R.
const NEW_OVERLAP: f64 = 50.0;

/// Newton iterations after which contacts that open stay open, and moves are halved.
const PATIENCE: u64 = 15;

/// Length of the first step over the time in which the start overlap would double.
const FIRST: f64 = 0.1;

impl Bed {
    /// Goes to a time through states of force balance.
    ///
    /// Velocities are zero afterwards. Particles keep what they remember, so that modes may alternate.
    ///
    /// # Errors
    ///
    /// [`BedError::NoBalance`], [`BedError::WorkLimit`], [`BedError::Field`].
    pub fn advance_quasi_static(
        &mut self,
        until_s: f64,
        settings: &QuasiStaticSettings,
        report: &mut QuasiStaticReport,
    ) -> Result<(), BedError> {
        within("tolerance", settings.tolerance, 1e-9, 0.1, "use 1e-9 to 0.1")?;
        within("balance", settings.balance, 1e-9, 0.1, "use 1e-9 to 0.1 of fa")?;
        if settings.free_box && self.around.region.sides != [Side::Periodic; 3] {
            let remedy = "a box that shrinks freely is periodic on all sides";
            return Err(field("box.free", "true", remedy));
        }
        self.particles.velocity_m_per_s.fill(ZERO);
        self.particles.half_velocity.fill(ZERO);
        self.fastest = 0.0;
        let rate = self.rate();
        // Where growth has to start from, force balance with p as it is.
        if report.balanced_at_s != Some(self.time_s) {
            self.balance(0.0, rate, settings, report)?;
        }
        let mut step_s = self.first_step_s(rate);
        let mut balanced = self.clone();
        while self.time_s < until_s {
            let left_s = until_s - self.time_s;
            // No sliver at the end.
            let this_s = if step_s >= left_s {
                left_s
            } else if 2.0 * step_s > left_s {
                0.5 * left_s
            } else {
                step_s
            };
            if report.steps + report.rejected >= settings.max_work {
                let (max_work, time_s) = (settings.max_work, self.time_s);
                return Err(BedError::WorkLimit { max_work, time_s });
            }
            let taken = self.balance(this_s, rate, settings, report);
            let error = match taken {
                Ok(error) if error <= settings.tolerance => error,
                Ok(error) if error.is_infinite() => {
                    let share = self.meeting(settings);
                    self.clone_from(&balanced);
                    report.rejected += 1;
                    step_s = this_s * share;
                    continue;
                }
                failed => {
                    let time_s = self.time_s;
                    self.clone_from(&balanced);
                    report.rejected += 1;
                    step_s = match failed {
                        Ok(error) => this_s * (0.8 * settings.tolerance / error).clamp(0.1, 0.7),
                        Err(error) if this_s < 1e-12 * until_s => return Err(error),
                        Err(BedError::NoBalance { .. }) => 0.25 * this_s,
                        Err(error) => return Err(error),
                    };
                    self.time_s = time_s;
                    continue;
                }
            };
            self.time_s = if this_s == left_s { until_s } else { self.time_s + this_s };
            report.steps += 1;
            report.error_estimate += error;
            let growth = (0.8 * settings.tolerance / error.max(1e-300)).clamp(0.5, 2.5);
            step_s = if this_s < step_s { step_s.max(this_s * growth) } else { this_s * growth };
            balanced.clone_from(self);
        }
        report.balanced_at_s = Some(self.time_s);
        // The next phase starts its clock here.
        self.phase_start_s = self.time_s;
        self.phase_steps = 0;
        Ok(())
    }

    fn rate(&self) -> Option<RateOf> {
        Some(match self.drive.growing?.kinetics {
            Kinetics::ThreeStage => rate_of::<Grows<ThreeStage>>,
            Kinetics::Frenkel => rate_of::<Grows<Frenkel>>,
            Kinetics::Pokluda => rate_of::<Grows<Pokluda>>,
            Kinetics::ThreeStagePokluda => rate_of::<Grows<ThreeStagePokluda>>,
            Kinetics::RegimeMap => rate_of::<Grows<RegimeMap>>,
        })
    }

    /// A step in which the fastest contact grows by a part of itself.
    fn first_step_s(&self, rate: Option<RateOf>) -> f64 {
        let Some(rate) = rate else { return f64::INFINITY };
        let mut shortest = f64::INFINITY;
        let Ok(equal) = self.equal_constants() else { return shortest };
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    let constants = if self.equal { &equal } else { &self.pairs.constants[k] };
                    let x = self.pairs.memory[k].overlap.max(constants.start);
                    shortest = shortest.min(FIRST * x / rate(&constants.rate, x));
                }
            }
        }
        shortest
    }

    /// Finds the balance at the end of a step, and takes the contacts there. Returns the error of a/R.
    fn balance(
        &mut self,
        step_s: f64,
        rate: Option<RateOf>,
        settings: &QuasiStaticSettings,
        report: &mut QuasiStaticReport,
    ) -> Result<f64, BedError> {
        const MOST: u64 = 60;
        let n = self.particles.len();
        let mean_radius = self.particles.radius_m.iter().sum::<f64>() / n as f64;
        let adhesion = self.law.law.adhesion * self.material.k1_n_per_m() * mean_radius;
        let mut residual = f64::INFINITY;
        let mut hold = None;
        // Here, as nothing moves by velocities: the displacements in this step.
        self.particles.half_velocity.fill(ZERO);
        for iteration in 0..MOST {
            self.follow()?;
            if iteration >= PATIENCE {
                self.let_go(step_s, rate)?;
            }
            let springs = self.springs(step_s, rate)?;
            let (mut force, strain_force) = self.net(&springs, settings.free_box);
            let hold = *hold.get_or_insert_with(|| {
                // The drag of a contact, alpha/(g dt); where nothing grows, its stiffness.
                let sum = springs.iter().map(|spring| spring.drag).sum::<f64>();
                HOLD * sum / springs.len().max(1) as f64
            });
            for (force, &moved) in force.iter_mut().zip(&self.particles.half_velocity) {
                *force = sub(*force, scale(moved, hold));
            }
            residual = force.iter().map(|&f| norm(f)).fold(0.0, f64::max);
            let strained = strain_force.abs() / (springs.len().max(1) as f64 * 2.0 * mean_radius);
            residual = residual.max(strained) / adhesion;
            if residual <= settings.balance {
                if step_s > 0.0 && self.meeting(settings) < 1.0 {
                    return Ok(f64::INFINITY);
                }
                self.particles.half_velocity.fill(ZERO);
                return self.take(step_s, rate);
            }
            report.newton += 1;
            let (moves, strain, iterations) =
                solve(&springs, &force, settings.free_box.then_some(strain_force), hold);
            report.conjugate_gradients += iterations;
            let furthest = moves.iter().map(|&m| norm(m)).fold(0.0, f64::max);
            let furthest = furthest.max(strain.abs() * 2.0 * mean_radius);
            let patience = if iteration < PATIENCE { 1.0 } else { 0.5 };
            let share = patience * (0.1 * mean_radius / furthest).min(1.0);
            let particles = &mut self.particles;
            for (i, &by) in moves.iter().enumerate() {
                let by = scale(by, share);
                particles.position_m[i] = add(particles.position_m[i], by);
                particles.half_velocity[i] = add(particles.half_velocity[i], by);
            }
            if settings.free_box {
                let factor = 1.0 + strain * share;
                self.around.region.size_m = self.around.region.size_m.map(|size| size * factor);
                for values in [&mut self.particles.position_m, &mut self.listed_position] {
                    for position in values {
                        *position = scale(*position, factor);
                    }
                }
                // A shrinking box brings images nearer than their particles have moved.
                self.travelled += (strain * share).abs() * 2.0 * (2.0 * mean_radius + self.skin);
            }
        }
        let (time_s, wanted) = (self.time_s, settings.balance);
        Err(BedError::NoBalance { time_s, iterations: MOST, residual, wanted })
    }

    /// The share of a step after which the first particles meet: 1 where none of those that meet in it
    /// overlap by more than new contacts may.
    fn meeting(&self, settings: &QuasiStaticSettings) -> f64 {
        let allowed = self.law.law.adhesion.max(NEW_OVERLAP * settings.tolerance);
        let mut share: f64 = 1.0;
        let mut meet = |before: f64, after: f64| {
            if after > allowed {
                // Half the allowed overlap, on a straight way there.
                let way = (0.5 * allowed - before) / (after - before);
                share = share.min(way.clamp(0.02, 0.95));
            }
        };
        let moved = &self.particles.half_velocity;
        for i in 0..self.particles.len() {
            let radius_i = self.particles.radius_m[i];
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    continue;
                }
                let j = index_of(self.list.other[k]);
                let radius_j = self.particles.radius_m[j];
                let effective = 2.0 * radius_i * radius_j / (radius_i + radius_j);
                let d = self.distance(i, k);
                let then = sub(d, sub(moved[i], moved[j]));
                let overlap = |d: Vec3| (radius_i + radius_j - norm(d)) / effective;
                meet(overlap(then).min(0.0), overlap(d));
            }
            for k in self.wall_list.row(i) {
                if self.wall_list.memory[k].is_contact() {
                    continue;
                }
                let wall = &self.walls[self.wall_list.wall[k] as usize];
                let distance = wall.distance(self.particles.position_m[i]);
                let then = distance - wall.inward * moved[i][wall.axis];
                let overlap = |distance: f64| (radius_i - distance) / (2.0 * radius_i);
                meet(overlap(then).min(0.0), overlap(distance));
            }
        }
        share
    }

    /// Ends the contacts that have opened or are on the cohesive branch. There a contact holds the less
    /// the further it is pulled: it has no balance, and the next thing it does is to open.
    fn let_go(&mut self, step_s: f64, rate: Option<RateOf>) -> Result<(), BedError> {
        let equal = self.equal_constants()?;
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                let memory = self.pairs.memory[k];
                if !memory.is_contact() {
                    continue;
                }
                let j = index_of(self.list.other[k]);
                let reach = self.particles.radius_m[i] + self.particles.radius_m[j];
                let constants = self.contact_constants(&equal, k);
                let x1 = (reach - norm(self.distance(i, k))) / constants.radius;
                if x1 < 0.0
                    || self.outcome(&memory, x1, &constants, step_s, rate).force
                        <= -self.law.law.kc * x1
                {
                    self.pairs.memory[k] = Memory::APART;
                }
            }
            for k in self.wall_list.row(i) {
                let wall = &self.walls[self.wall_list.wall[k] as usize];
                if wall.distance(self.particles.position_m[i]) > self.particles.radius_m[i] {
                    self.wall_list.memory[k] = Memory::APART;
                }
            }
        }
        Ok(())
    }

    /// Keeps the list complete.
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

    /// What a step of a given length makes of a contact that ends at the overlap `x1`.
    fn outcome(
        &self,
        memory: &Memory,
        x1: f64,
        constants: &ContactConstants,
        step_s: f64,
        rate: Option<RateOf>,
    ) -> Outcome {
        let law: &LawConstants = &self.law;
        let alpha = law.law.adhesion;
        let (x0, p0) = (memory.overlap.max(0.0), memory.plastic);
        let Some(rate) = rate.filter(|_| step_s > 0.0 && constants.rate.stretching > 0.0) else {
            let (force, plastic) = law.force(x1, p0);
            return Outcome { plastic, force, stiffness: law.stiffness(plastic), free_growth: 0.0 };
        };
        let start = constants.start;
        let bare = mean_rate(rate, &constants.rate, x0.max(start), x1.max(start));
        // p1 = p0 + g dt kappa(p1) (x1 - p1)/alpha, by iteration: kappa changes little.
        let (mut p1, mut kappa, mut softened, mut free_growth) = (p0, law.stiffness(p0), 0.0, 0.0);
        for _ in 0..3 {
            free_growth = step_s * bare * law.law.equilibrium_factor(0.5 * (p0 + p1));
            let s = kappa * free_growth / alpha;
            p1 = ((p0 + s * x1) / (1.0 + s)).clamp(0.0, law.end_plastic);
            kappa = law.stiffness(p1);
            // D is the time that the overlap took over the step, so that its slope goes by the
            // rate at the end: with the mean one Newton's method would overshoot.
            let slope = s * (rate(&constants.rate, x1.max(start)) / bare).min(1.0);
            softened = kappa / (1.0 + slope);
        }
        if p0 >= law.end_plastic {
            (p1, softened) = (p0, kappa);
        }
        let (force, plastic) = law.force(x1, p1);
        if plastic != p1 || p1 >= law.end_plastic {
            softened = kappa;
        }
        Outcome { plastic: plastic.max(0.0), force, stiffness: softened, free_growth }
    }

    fn contact_constants(&self, equal: &ContactConstants, k: usize) -> ContactConstants {
        if self.equal { *equal } else { self.pairs.constants[k] }
    }

    /// All contacts at the present positions.
    fn springs(&self, step_s: f64, rate: Option<RateOf>) -> Result<Vec<Spring>, BedError> {
        let alpha = self.law.law.adhesion;
        let k1 = self.material.k1_n_per_m();
        let equal = self.equal_constants()?;
        let mut springs = Vec::with_capacity(4 * self.particles.len());
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                let j = index_of(self.list.other[k]);
                let d = self.distance(i, k);
                let length = norm(d);
                let reach = self.particles.radius_m[i] + self.particles.radius_m[j];
                if length > reach || (step_s > 0.0 && !self.pairs.memory[k].is_contact()) {
                    continue;
                }
                let constants = self.contact_constants(&equal, k);
                let x1 = (reach - length) / constants.radius;
                let memory = &self.pairs.memory[k];
                let outcome = self.outcome(memory, x1, &constants, step_s, rate);
                springs.push(Spring {
                    i,
                    j: Some(j),
                    normal: scale(d, 1.0 / length),
                    length,
                    stiffness: k1 * outcome.stiffness,
                    pull: k1 * constants.radius * (alpha - outcome.force),
                    drag: if outcome.free_growth > 0.0 {
                        k1 * alpha / outcome.free_growth
                    } else {
                        k1 * outcome.stiffness
                    },
                });
            }
            let (position, radius) = (self.particles.position_m[i], self.particles.radius_m[i]);
            for k in self.wall_list.row(i) {
                let wall = self.walls[self.wall_list.wall[k] as usize];
                let x1 = (radius - wall.distance(position)) / (2.0 * radius);
                if x1 < 0.0 || (step_s > 0.0 && !self.wall_list.memory[k].is_contact()) {
                    continue;
                }
                let (force, plastic) = self.law.force(x1, self.wall_list.memory[k].plastic);
                let mut normal = ZERO;
                normal[wall.axis] = wall.inward;
                springs.push(Spring {
                    i,
                    j: None,
                    normal,
                    length: 0.0,
                    stiffness: k1 * self.law.stiffness(plastic),
                    pull: k1 * 2.0 * radius * (alpha - force),
                    drag: 0.0,
                });
            }
        }
        Ok(springs)
    }

    /// Net forces, and the force on a strain of the box.
    fn net(&self, springs: &[Spring], free_box: bool) -> (Vec<Vec3>, f64) {
        let gravity = self.gravity();
        let mut force: Vec<Vec3> =
            self.particles.inertia.iter().map(|&mass| scale(gravity, mass)).collect();
        let mut strain_force = 0.0;
        for spring in springs {
            let push = scale(spring.normal, -spring.pull);
            force[spring.i] = add(force[spring.i], push);
            if let Some(j) = spring.j {
                force[j] = sub(force[j], push);
            }
            strain_force -= spring.pull * spring.length;
        }
        (force, if free_box { strain_force } else { 0.0 })
    }

    /// Takes the contacts to the end of the step, at the present positions.
    fn take(&mut self, step_s: f64, rate: Option<RateOf>) -> Result<f64, BedError> {
        let alpha = self.law.law.adhesion;
        let equal = self.equal_constants()?;
        let (mut error, mut count) = (0.0, 0u32);
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                let j = index_of(self.list.other[k]);
                let length = norm(self.distance(i, k));
                let reach = self.particles.radius_m[i] + self.particles.radius_m[j];
                if length > reach {
                    self.pairs.memory[k] = Memory::APART;
                    continue;
                }
                let constants = self.contact_constants(&equal, k);
                let x1 = (reach - length) / constants.radius;
                let memory = self.pairs.memory[k];
                let rate = rate.filter(|_| memory.is_contact());
                let outcome = self.outcome(&memory, x1, &constants, step_s, rate);
                if memory.is_contact() && step_s > 0.0 {
                    // D relaxes within alpha/kappa of p, or over the whole step.
                    let change = (outcome.force - (alpha - memory.pull)) / alpha;
                    let span = (0.5 * outcome.free_growth).min(alpha / outcome.stiffness.max(1.0));
                    let ratio = change * span / (2.0 * x1.max(alpha).sqrt());
                    error += ratio * ratio;
                    count += 1;
                }
                let drift = if step_s > 0.0 && memory.is_contact() {
                    (x1 - memory.overlap) / step_s * self.step_s
                } else {
                    0.0
                };
                self.pairs.memory[k] = Memory {
                    overlap: x1,
                    drift,
                    plastic: outcome.plastic,
                    pull: alpha - outcome.force,
                };
                self.pairs.plastic_before[k] = outcome.plastic;
            }
            let (position, radius) = (self.particles.position_m[i], self.particles.radius_m[i]);
            for k in self.wall_list.row(i) {
                let wall = self.walls[self.wall_list.wall[k] as usize];
                let overlap = (radius - wall.distance(position)) / (2.0 * radius);
                self.wall_list.memory[k] = if overlap < 0.0 {
                    Memory::APART
                } else {
                    let (force, plastic) =
                        self.law.force(overlap, self.wall_list.memory[k].plastic);
                    Memory { overlap, drift: 0.0, plastic, pull: alpha - force }
                };
            }
        }
        Ok((error / f64::from(count.max(1))).sqrt())
    }
}

/// Displacements, and strain of the box, that balance the springs to first order; and the iterations it took.
///
/// Conjugate gradients on `sum k n n^T` and the hold, preconditioned by the diagonal.
fn solve(
    springs: &[Spring],
    force: &[Vec3],
    strain_force: Option<f64>,
    hold: f64,
) -> (Vec<Vec3>, f64, u64) {
    let n = force.len();
    let mut diagonal = vec![hold; n];
    let mut strain_diagonal = 0.0;
    for spring in springs {
        diagonal[spring.i] += spring.stiffness;
        if let Some(j) = spring.j {
            diagonal[j] += spring.stiffness;
        }
        strain_diagonal += spring.stiffness * spring.length * spring.length;
    }
    let strain_diagonal = if strain_force.is_some() { strain_diagonal.max(1e-300) } else { 1.0 };
    let strains = if strain_force.is_some() { 1.0 } else { 0.0 };
    let apply = |u: &[Vec3], strain: f64, out: &mut [Vec3]| {
        for (out, &u) in out.iter_mut().zip(u) {
            *out = scale(u, hold);
        }
        let mut strain_out = 0.0;
        for spring in springs {
            let mut along = dot(spring.normal, u[spring.i]) + strains * strain * spring.length;
            if let Some(j) = spring.j {
                along -= dot(spring.normal, u[j]);
            }
            let push = scale(spring.normal, spring.stiffness * along);
            out[spring.i] = add(out[spring.i], push);
            if let Some(j) = spring.j {
                out[j] = sub(out[j], push);
            }
            strain_out += strains * spring.stiffness * along * spring.length;
        }
        strain_out
    };
    let mut u = vec![ZERO; n];
    let mut strain = 0.0;
    let mut r = force.to_vec();
    let mut r_strain = strain_force.unwrap_or(0.0);
    let inverse = |r: &[Vec3], r_strain: f64| -> (Vec<Vec3>, f64) {
        (
            r.iter().zip(&diagonal).map(|(&r, &k)| scale(r, 1.0 / k)).collect(),
            strains * r_strain / strain_diagonal,
        )
    };
    let product = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(&a, &b)| dot(a, b)).sum::<f64>();
    let (mut z, mut z_strain) = inverse(&r, r_strain);
    let (mut p, mut p_strain) = (z.clone(), z_strain);
    let mut rz = product(&r, &z) + r_strain * z_strain;
    let wanted = 1e-4 * rz;
    let mut out = vec![ZERO; n];
    let mut iterations = 0;
    while rz > wanted && iterations < 2000 {
        iterations += 1;
        let strain_out = apply(&p, p_strain, &mut out);
        let step = rz / (product(&p, &out) + p_strain * strain_out);
        for i in 0..n {
            u[i] = add(u[i], scale(p[i], step));
            r[i] = sub(r[i], scale(out[i], step));
        }
        strain += step * p_strain;
        r_strain -= step * strain_out;
        (z, z_strain) = inverse(&r, r_strain);
        let next = product(&r, &z) + r_strain * z_strain;
        let share = next / rz;
        rz = next;
        for i in 0..n {
            p[i] = add(z[i], scale(p[i], share));
        }
        p_strain = z_strain + share * p_strain;
    }
    (u, strain, iterations)
}
