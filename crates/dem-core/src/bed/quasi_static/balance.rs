//! The balance of forces at the end of a quasi-static step.

use rayon::prelude::*;

use super::network::{Network, Spring};
use super::settings::{QuasiStaticReport, QuasiStaticSettings};
use super::shear::{Shear, add_reactions};
use crate::bed::contact::{Growth, LawConstants, Memory};
use crate::bed::engine::Bed;
use crate::bed::error::BedError;
use crate::bed::material::{ContactConstants, effective_radius};
use crate::bed::necks::Neck;
use crate::bed::neighbours::index_of;
use crate::bed::vec3::{Vec3, ZERO, add, dot, norm, scale, sub};
use crate::kinetics::RateCoefficients;

/// Rate of the overlap.
pub(crate) type RateOf = fn(&RateCoefficients<f64>, f64) -> f64;

pub(crate) fn rate_of<G: Growth>(coefficients: &RateCoefficients<f64>, overlap: f64) -> f64 {
    let (n, d) = G::rate_fraction(coefficients, overlap);
    n / d
}

/// A step that is to end in balance.
#[derive(Clone, Copy)]
pub(crate) struct Step<'a> {
    /// Its length; 0 to balance forces without growth.
    pub(crate) length_s: f64,
    pub(crate) rate: Option<RateOf>,
    pub(crate) settings: &'a QuasiStaticSettings,
    /// The constants of all contacts of equal particles.
    pub(crate) equal: &'a ContactConstants,
}

/// A contact at the end of a step.
pub(crate) struct Outcome {
    pub(crate) plastic: f64,
    pub(crate) force: f64,
    /// `d force/d x1` over the step.
    slope: f64,
    /// `g dt`: the growth of p where D = 1.
    pub(crate) free_growth: f64,
}

/// A contact in one Newton iteration.
struct Bond {
    i: u32,
    /// The second particle; [`GROUND`] at a wall.
    j: u32,
    /// From the second body to the first.
    normal: Vec3,
    /// Distance of the centres, by which a strain of the box stretches it.
    length: f64,
    /// Stiffness \[N/m\] and pull \[N\].
    stiffness: f64,
    pull: f64,
    /// `K1 alpha/(g dt)` \[N/m\]; 0 without growth.
    drag: f64,
    /// Mean overlap of the step by which its neck resists turning.
    overlap: f64,
    /// Mean distance of the centres over the step, over the sum of the radii.
    arm: f64,
}

const GROUND: u32 = u32::MAX;

/// Particles handled by one task; does not change any result.
const CHUNK: usize = 256;

/// Background drag over that of a contact.
const HOLD: f64 = 1e-4;

/// The same where necks resist shear and rolling: they hold all but whole clusters, and bend far more easily than they are drawn out.
const HOLD_WITH_NECKS: f64 = 1e-7;

/// Largest displacement of a particle in one iteration, in mean radii.
const FURTHEST: f64 = 0.2;

/// Time in which an overlap grows freely from `from` to `to`.
fn time_between(rate: RateOf, coefficients: &RateCoefficients<f64>, from: f64, to: f64) -> f64 {
    let slowness = |x: f64| 1.0 / rate(coefficients, x);
    let simpson = |a: f64, b: f64| {
        (b - a) / 6.0 * (slowness(a) + 4.0 * slowness(0.5 * (a + b)) + slowness(b))
    };
    let bend = coefficients.switch;
    if from < bend && bend < to {
        simpson(from, bend * (1.0 - 1e-14)) + simpson(bend, to)
    } else {
        simpson(from, to)
    }
}

/// Mean rate over the overlaps from `from` to `to`: the harmonic mean, which takes the right time.
fn mean_rate(rate: RateOf, coefficients: &RateCoefficients<f64>, from: f64, to: f64) -> f64 {
    let (low, high) = (from.min(to), from.max(to));
    if high - low <= 1e-9 * high {
        return rate(coefficients, 0.5 * (low + high));
    }
    (high - low) / time_between(rate, coefficients, low, high)
}

/// An overlap after a time of free growth, to a few percent.
fn free_overlap(rate: RateOf, coefficients: &RateCoefficients<f64>, from: f64, time_s: f64) -> f64 {
    let (mut x, mut left) = (from, time_s);
    for _ in 0..60 {
        let takes = time_between(rate, coefficients, x, 1.5 * x);
        if takes >= left {
            return x * (1.0 + 0.5 * left / takes);
        }
        left -= takes;
        x *= 1.5;
    }
    x
}

impl Bed {
    /// A contact at the end of a step that takes it to the overlap `x1`.
    ///
    /// The force rises with `x1`: pulled beyond the cohesive branch it stays at what that holds at the start of
    /// the step, and it is drawn on where the contact opens.
    pub(crate) fn outcome(
        &self,
        memory: &Memory,
        x1: f64,
        constants: &ContactConstants,
        step: &Step<'_>,
    ) -> Outcome {
        let law: &LawConstants = &self.law;
        let alpha = law.law.adhesion;
        let (x0, p0) = (memory.overlap.max(0.0), memory.plastic);
        let end = constants.end_plastic;
        let grows = step.length_s > 0.0 && constants.rate.stretching > 0.0;
        let (mut p1, mut kappa, mut free_growth) = (p0, law.stiffness(p0), 0.0);
        let mut slope = kappa;
        if let Some(rate) = step.rate.filter(|_| grows) {
            let start = constants.start;
            let bare = mean_rate(rate, &constants.rate, x0.max(start), x1.max(start));
            // p1 = p0 + g dt kappa(p1) (x1 - p1)/alpha, by iteration: kappa changes little.
            for _ in 0..3 {
                free_growth = step.length_s
                    * bare
                    * law.law.equilibrium_factor(0.5 * (p0 + p1.clamp(0.0, end)));
                let s = kappa * free_growth / alpha;
                p1 = (p0 + s * x1) / (1.0 + s);
                kappa = law.stiffness(p1.clamp(0.0, end));
                slope = kappa / (1.0 + s);
            }
            let s = kappa * free_growth / alpha;
            let grown = x1.max(start) - x0.max(start);
            // d ln(bare)/d x1: D is the time that the overlap took over the step, so that its slope goes by the
            // rate at the end.
            let b = if x1 > start && grown.abs() > 1e-6 * x1 {
                (1.0 - bare / rate(&constants.rate, x1)) / grown
            } else {
                0.0
            };
            let q = if kappa < law.law.k2_max { law.stiffening } else { 0.0 };
            let e = s * (x1 - p1) / (1.0 + s);
            let along = (s / (1.0 + s) + e * b) / (1.0 - e * q / kappa);
            slope = (kappa * (1.0 - along) + q * along * (x1 - p1)).max(0.1 * slope);
            if p1 >= end || p0 >= end {
                p1 = end;
                kappa = law.stiffness(p1);
                slope = kappa;
            }
        }
        let force = kappa * (x1 - p1);
        let least = -law.law.kc * x0;
        let plastic = p1.max(0.0);
        if force < least {
            return Outcome { plastic, force: least, slope: 0.0, free_growth };
        }
        if x1 > 0.0 && force > x1 {
            let (force, plastic) = law.force(x1, plastic, end);
            let slope = if force < x1 { kappa } else { 1.0 };
            return Outcome { plastic, force, slope, free_growth };
        }
        Outcome { plastic, force, slope, free_growth }
    }

    pub(crate) fn contact_constants(&self, equal: &ContactConstants, k: usize) -> ContactConstants {
        if self.equal { *equal } else { self.pairs.constants[k] }
    }

    /// All contacts at the present positions; `is_first` where they are those of the start of the step.
    fn bonds(&self, step: &Step<'_>, is_first: bool) -> Vec<Bond> {
        let n = self.particles.len();
        let chunk = |chunk: usize| {
            let mut bonds = Vec::with_capacity(4 * CHUNK);
            for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(n) {
                self.bonds_of(i, step, is_first, &mut bonds);
            }
            bonds
        };
        let chunks: Vec<Vec<Bond>> = if n <= CHUNK {
            vec![chunk(0)]
        } else {
            (0..n.div_ceil(CHUNK)).into_par_iter().map(chunk).collect()
        };
        chunks.into_iter().flatten().collect()
    }

    fn bonds_of(&self, i: usize, step: &Step<'_>, is_first: bool, bonds: &mut Vec<Bond>) {
        let alpha = self.law.law.adhesion;
        let k1 = self.material.k1_n_per_m();
        let (position, radius) = (self.particles.position_m[i], self.particles.radius_m[i]);
        for k in self.list.row(i) {
            let memory = &self.pairs.memory[k];
            if !memory.is_contact() {
                continue;
            }
            let j = index_of(self.list.other[k]);
            let d = self.distance(i, k);
            let length = norm(d);
            let constants = self.contact_constants(step.equal, k);
            let x1 = (radius + self.particles.radius_m[j] - length) / constants.unit;
            let outcome = self.outcome(memory, x1, &constants, step);
            let mut slope = outcome.slope;
            if is_first && outcome.free_growth > x1.max(constants.start) {
                slope = slope.max(self.chord(x1, &outcome, &constants, step));
            }
            let reach = radius + self.particles.radius_m[j];
            bonds.push(Bond {
                i: i as u32,
                j: j as u32,
                normal: scale(d, 1.0 / length),
                length,
                stiffness: k1 * slope,
                pull: k1 * constants.unit * (alpha - outcome.force),
                drag: if outcome.free_growth > 0.0 {
                    k1 * alpha / outcome.free_growth
                } else {
                    0.0
                },
                overlap: logarithmic_mean(
                    memory.overlap.max(constants.start),
                    x1.max(constants.start),
                ),
                arm: 1.0 - 0.5 * constants.unit * (memory.overlap + x1) / reach,
            });
        }
        for k in self.wall_list.row(i) {
            let memory = &self.wall_list.memory[k];
            if !memory.is_contact() {
                continue;
            }
            let wall = self.walls[self.wall_list.wall[k] as usize];
            let unit = self.material.wall_unit(radius);
            let x1 = (radius - wall.distance(position)) / unit;
            let still = Step { rate: None, ..*step };
            let outcome = self.outcome(memory, x1, step.equal, &still);
            let mut normal = ZERO;
            normal[wall.axis] = wall.inward;
            bonds.push(Bond {
                i: i as u32,
                j: GROUND,
                normal,
                length: 0.0,
                stiffness: k1 * outcome.slope,
                pull: k1 * unit * (alpha - outcome.force),
                drag: 0.0,
                overlap: 0.0,
                arm: 1.0,
            });
        }
    }

    /// Slope to the overlap of free growth. A small contact is so soft at the start of a
    /// step that its tangent would lead far beyond.
    fn chord(
        &self,
        x1: f64,
        outcome: &Outcome,
        constants: &ContactConstants,
        step: &Step<'_>,
    ) -> f64 {
        let Some(rate) = step.rate else { return 0.0 };
        let x1 = x1.max(constants.start);
        let alone = free_overlap(rate, &constants.rate, x1, step.length_s);
        (self.law.law.adhesion - outcome.force) / (alone - x1)
    }

    /// The necks that resist shear over a step: those that grow. Without growth nothing flows, and contacts slide and roll freely, whatever
    /// resistance their necks are going to have.
    fn necks(&self, bonds: &[Bond], step: &Step<'_>) -> Vec<Shear> {
        if !self.has_flowing_necks(step) {
            return Vec::new();
        }
        let radius = &self.particles.radius_m;
        let neck = |bond: &Bond| {
            let [i, j] = [bond.i as usize, bond.j as usize];
            let effective = effective_radius(radius[i], radius[j]);
            let resistance = self.material.neck_viscosity() * bond.drag;
            Shear {
                ends: [i, j],
                normal: bond.normal,
                arm: bond.arm,
                radius: [radius[i], radius[j]],
                neck: Neck::new(resistance, bond.overlap * effective * effective),
            }
        };
        bonds.iter().filter(|bond| bond.j != GROUND).map(neck).collect()
    }

    fn has_flowing_necks(&self, step: &Step<'_>) -> bool {
        self.has_necks() && step.length_s > 0.0 && step.rate.is_some()
    }

    /// Net forces on the particles, the hold taken off, and the force on a strain of the box; with necks that resist shear the
    /// torques over the radius after the forces.
    fn net(&self, bonds: &[Bond], held: &Held<'_>, free_box: bool) -> (Vec<Vec3>, f64) {
        let &Held { hold, necks, turned } = held;
        let gravity = self.gravity();
        let particles = &self.particles;
        let mut force: Vec<Vec3> = particles
            .inertia
            .iter()
            .zip(&particles.half_velocity)
            .map(|(&mass, &moved)| sub(scale(gravity, mass), scale(moved, hold)))
            .collect();
        let mut strain_force = 0.0;
        for bond in bonds {
            let push = scale(bond.normal, -bond.pull);
            force[bond.i as usize] = add(force[bond.i as usize], push);
            if bond.j != GROUND {
                force[bond.j as usize] = sub(force[bond.j as usize], push);
            }
            strain_force -= bond.pull * bond.length;
        }
        if !necks.is_empty() {
            force.extend(turned.iter().map(|&turned| scale(turned, -hold)));
            let moves: Vec<Vec3> = particles.half_velocity.iter().chain(turned).copied().collect();
            add_reactions(necks, &moves, -1.0, &mut force);
        }
        (force, if free_box { strain_force } else { 0.0 })
    }

    /// Moves the particles, and strains the box and all that is in it.
    pub(crate) fn displace(&mut self, moves: &[Vec3], share: f64, strain: f64) {
        let factor = 1.0 + strain * share;
        let particles = &mut self.particles;
        for (i, &by) in moves.iter().enumerate() {
            let by = scale(by, share);
            particles.position_m[i] = scale(add(particles.position_m[i], by), factor);
            particles.half_velocity[i] = add(particles.half_velocity[i], by);
        }
        if strain != 0.0 {
            self.around.region.size_m = self.around.region.size_m.map(|size| size * factor);
            for position in &mut self.listed_position {
                *position = scale(*position, factor);
            }
            // A shrinking box brings images nearer than their particles have moved.
            let reach = 4.0 * self.mean_radius() + 2.0 * self.skin;
            self.travelled += (strain * share).abs() * reach;
        }
    }

    pub(crate) fn mean_radius(&self) -> f64 {
        self.particles.radius_m.iter().sum::<f64>() / self.particles.len() as f64
    }

    /// Moves the particles into balance, with the contacts that there are. The displacements are in
    /// `half_velocity`; returns the strain of the box. Starts from where the particles are, `strained` already.
    pub(crate) fn balance(
        &mut self,
        step: &Step<'_>,
        strained: f64,
        report: &mut QuasiStaticReport,
    ) -> Result<f64, BedError> {
        const MOST: u64 = 40;
        const ACCURACY: f64 = 1e-2;
        let settings = step.settings;
        let n = self.particles.len();
        let mean_radius = self.mean_radius();
        let adhesion = self.material.adhesion_n(mean_radius);
        let mut strain = strained;
        let mut bonds = self.bonds(step, true);
        let share = if self.has_flowing_necks(step) { HOLD_WITH_NECKS } else { HOLD };
        let hold = hold(&bonds, share, self.material.k1_n_per_m());
        let mut necks = self.necks(&bonds, step);
        let mut turned = if necks.is_empty() { Vec::new() } else { vec![ZERO; n] };
        let net = |bed: &Self, bonds: &[Bond], necks: &[Shear], turned: &[Vec3]| {
            bed.net(bonds, &Held { hold, necks, turned }, settings.free_box)
        };
        let (mut force, mut strain_force) = net(self, &bonds, &necks, &turned);
        let mut residual = f64::INFINITY;
        'newton: for _ in 0..MOST {
            let largest = force.iter().map(|&f| norm(f)).fold(0.0, f64::max);
            let strained = strain_force.abs() / (bonds.len().max(1) as f64 * 2.0 * mean_radius);
            residual = largest.max(strained) / adhesion;
            if residual <= settings.balance {
                return Ok(strain);
            }
            report.newton += 1;
            let mut network = network(&bonds, (n, force.len()), hold, settings.free_box);
            if !necks.is_empty() {
                network = network.with_necks(necks.clone());
            }
            let mut solution = network.solve(&force, strain_force, ACCURACY);
            report.conjugate_gradients += solution.iterations;
            for by in &mut solution.moves {
                let far = norm(*by) / (FURTHEST * mean_radius);
                if far > 1.0 {
                    *by = scale(*by, 1.0 / far);
                }
            }
            let by_strain = solution.strain.clamp(-0.02, 0.02);
            let downhill = |force: &[Vec3], strain_force: f64| {
                force.iter().zip(&solution.moves).map(|(&f, &u)| dot(f, u)).sum::<f64>()
                    + strain_force * by_strain
            };
            let at_start = downhill(&force, strain_force);
            let mut share = 1.0;
            let (shifts, turns) = solution.moves.split_at(n);
            self.displace(shifts, share, by_strain);
            turn(&mut turned, turns, share);
            loop {
                bonds = self.bonds(step, false);
                necks = self.necks(&bonds, step);
                (force, strain_force) = net(self, &bonds, &necks, &turned);
                let slope = downhill(&force, strain_force);
                // Beyond the lowest point by more than there was to go: back to where the slope vanishes.
                if slope > -0.5 * at_start || share < 0.02 {
                    break;
                }
                if slope.is_nan() {
                    break 'newton;
                }
                let less = share * (at_start / (at_start - slope)).clamp(0.1, 0.9);
                self.displace(shifts, less - share, by_strain);
                turn(&mut turned, turns, less - share);
                share = less;
            }
            strain += share * by_strain;
        }
        let (time_s, wanted) = (self.time_s, settings.balance);
        Err(BedError::NoBalance { time_s, iterations: MOST, residual, wanted })
    }
}

/// The mean of x whose inverse is the mean of 1/x, between two x that it passes through evenly.
fn logarithmic_mean(a: f64, b: f64) -> f64 {
    let apart = b / a - 1.0;
    if apart.abs() < 1e-6 { 0.5 * (a + b) } else { a * apart / apart.ln_1p() }
}

/// What holds particles besides their contacts: the background, and necks that resist shear, with the turns of the particles since the
/// start of the step; both empty where necks do not.
struct Held<'a> {
    hold: f64,
    necks: &'a [Shear],
    turned: &'a [Vec3],
}

fn turn(turned: &mut [Vec3], turns: &[Vec3], share: f64) {
    for (turned, &by) in turned.iter_mut().zip(turns) {
        *turned = add(*turned, scale(by, share));
    }
}

/// The hold of a particle: a share of the drag of a contact, of its stiffness without growth, or of K1 without contacts.
fn hold(bonds: &[Bond], share: f64, k1: f64) -> f64 {
    let mean = |of: fn(&Bond) -> f64| {
        let (sum, count) = bonds
            .iter()
            .map(of)
            .filter(|&value| value > 0.0)
            .fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
        (count > 0).then(|| share * sum / f64::from(count))
    };
    mean(|bond| bond.drag).or_else(|| mean(|bond| bond.stiffness)).unwrap_or(share * k1)
}

/// `rows`: the shifts of the `n` particles, and their turns where necks resist these.
fn network(bonds: &[Bond], (n, rows): (usize, usize), hold: f64, free_box: bool) -> Network {
    let mut ground = vec![[hold; 3]; n];
    ground.resize(rows, [hold; 3]);
    let mut springs = Vec::with_capacity(bonds.len());
    for bond in bonds {
        if bond.j == GROUND {
            for (ground, along) in ground[bond.i as usize].iter_mut().zip(bond.normal) {
                *ground += bond.stiffness * along * along;
            }
        } else {
            springs.push(Spring {
                ends: [bond.i, bond.j],
                normal: bond.normal,
                stiffness: bond.stiffness,
                length: bond.length,
            });
        }
    }
    Network::new(&springs, ground, free_box)
}
