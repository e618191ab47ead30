//! One step of one contact: overlap, plastic overlap, damping.
//!
//! Lengths in the unit R of overlaps (the effective radius times the factor of the
//! [approach](crate::densification::Approach)), forces in `K1 R`, with `omega^2 = K1/m_eff`, `alpha = fa/(K1 R)`,
//! `c = gamma_n/m_eff`. The normal force without adhesion, damping included, is
//! `S = f + (c/omega^2) x'`, f by the contact law, and the contact pulls with `alpha - S`.
//!
//! Everything is computed from the overlap at the end of the step, the overlap before it and their
//! difference, the drift: no velocities are needed, and what comes out is the same seen from either
//! particle.
//!
//! # Damping
//!
//! The damping force belongs to the velocity at the end of the step, which itself depends on
//! the force there (trapezoidal rule). With `beta = (h c/2)/(1 + h c/2)`,
//!
//! ```text
//! S1 = (1 - beta) (f1 + c/(omega^2 h) drift) + beta (alpha + o)
//! ```
//!
//! where `omega^2 o` is the acceleration of the overlap by all the other forces on the two particles. For a pair
//! alone o = 0 and this is the pair solver's step. In a packing o is taken from the step before:
//! the two last drifts give the acceleration of the overlap, and the contact's own share is known. It must
//! not be left out: a resting contact that carries a load would carry it with `S/(1 - beta)`.
//!
//! # Plastic overlap
//!
//! The implicit step of the [Verlet](crate::solvers::Verlet) pair solver: the linear
//! relaxation of the plastic overlap towards its target with `1/(1 + z + z^2/2)` for `exp(-z)`, which neither
//! overshoots nor changes the sign of the driving factor `D = S/alpha` whatever the rate.

use std::marker::PhantomData;

use super::heat_clock::StepPace;
use super::material::ContactConstants;
use crate::kinetics::RateCoefficients;
use crate::{Branch, ContactLaw, Kinetic};

/// State of a contact between steps.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(crate) struct Memory {
    /// Overlap; negative where there is no contact.
    pub(crate) overlap: f64,
    /// Change of the overlap in the last step.
    pub(crate) drift: f64,
    /// Plastic overlap.
    pub(crate) plastic: f64,
    /// Pull of the contact, `alpha - S`.
    pub(crate) pull: f64,
}

impl Memory {
    /// No contact.
    pub(crate) const APART: Self = Self { overlap: -1.0, drift: 0.0, plastic: 0.0, pull: 0.0 };

    #[inline(always)]
    pub(crate) fn is_contact(&self) -> bool {
        self.overlap >= 0.0
    }
}

/// Growth of the plastic overlap: a type, so that a bed at rest does not compute it.
pub(crate) trait Growth: Copy + Send + Sync {
    /// Whether it grows at all.
    const GROWS: bool;
    /// Whether the necks resist shear and rolling.
    const NECKS: bool = false;
    /// `dx/dt` as numerator and denominator.
    fn rate_fraction(coefficients: &RateCoefficients<f64>, overlap: f64) -> (f64, f64);
}

/// The plastic overlap changes by the contact law alone.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NoGrowth;

impl Growth for NoGrowth {
    const GROWS: bool = false;
    #[inline(always)]
    fn rate_fraction(_: &RateCoefficients<f64>, _: f64) -> (f64, f64) {
        (0.0, 1.0)
    }
}

/// A contact that grows by a kinetics.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grows<K>(PhantomData<K>);

impl<K: Kinetic> Growth for Grows<K> {
    const GROWS: bool = true;
    #[inline(always)]
    fn rate_fraction(coefficients: &RateCoefficients<f64>, overlap: f64) -> (f64, f64) {
        K::rate_fraction(coefficients, overlap)
    }
}

/// A contact that grows and whose neck resists shear and rolling.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sintered<G>(PhantomData<G>);

impl<G: Growth> Growth for Sintered<G> {
    const GROWS: bool = true;
    const NECKS: bool = true;
    #[inline(always)]
    fn rate_fraction(coefficients: &RateCoefficients<f64>, overlap: f64) -> (f64, f64) {
        G::rate_fraction(coefficients, overlap)
    }
}

/// The contact law and the constants that follow from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LawConstants {
    pub(crate) law: ContactLaw,
    pub(crate) stiffening: f64,
    elastic_width: f64,
    inverse_adhesion: f64,
    /// Plastic overlap of the fully coalesced contact of equal particles.
    pub(crate) end_plastic: f64,
}

impl LawConstants {
    pub(crate) fn new(law: ContactLaw) -> Self {
        Self {
            law,
            stiffening: law.stiffening(),
            elastic_width: 1.0 / law.stiffening(),
            inverse_adhesion: 1.0 / law.adhesion,
            end_plastic: law.equilibrium_plastic_overlap(law.plastic_overlap_max),
        }
    }

    /// A contact that has not sintered, at rest; one that has opened is held until a balance of forces has been found.
    pub(crate) fn elastic(&self, overlap: f64) -> Memory {
        let overlap = overlap.max(0.0);
        Memory { overlap, drift: 0.0, plastic: 0.0, pull: self.law.adhesion - overlap }
    }

    /// Stiffness `kappa(p)`.
    #[inline(always)]
    pub(crate) fn stiffness(&self, plastic: f64) -> f64 {
        (1.0 + self.stiffening * plastic).min(self.law.k2_max)
    }

    /// Elasto-plastic force and plastic overlap, at most `end`, by the branch that holds.
    #[inline(always)]
    pub(crate) fn force(&self, overlap: f64, plastic: f64, end: f64) -> (f64, f64) {
        let force = self.stiffness(plastic) * (overlap - plastic);
        let cohesive = -self.law.kc * overlap - force;
        let loading = overlap - plastic - self.elastic_width;
        if cohesive > 0.0 || loading > 0.0 {
            return self.other_branch(overlap, plastic, end);
        }
        (force, plastic)
    }

    #[cold]
    #[inline(never)]
    fn other_branch(&self, overlap: f64, plastic: f64, end: f64) -> (f64, f64) {
        let response = self.law.respond(overlap, plastic);
        debug_assert_ne!(response.branch, Branch::Apart);
        (response.force, response.plastic_overlap.min(end))
    }
}

/// The constants of a contact for one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scheme {
    /// One over the unit of overlaps \[1/m\].
    pub(crate) inverse_unit: f64,
    /// `K1 R` \[N\].
    pub(crate) force_scale: f64,
    step_s: f64,
    pace: StepPace,
    /// `1 - beta` and `beta`.
    undamped: f64,
    beta: f64,
    /// `c/(omega^2 h)`.
    pub(crate) damping: f64,
    /// `1/(h omega)^2`.
    inverse_phase_squared: f64,
    start: f64,
    end_plastic: f64,
    rate: RateCoefficients<f64>,
}

impl Scheme {
    #[inline(always)]
    pub(crate) fn new(constants: &ContactConstants, k1: f64, step_s: f64) -> Self {
        let half = 0.5 * step_s * constants.dissipation;
        let undamped = 1.0 / (1.0 + half);
        let inverse = 1.0 / (constants.frequency_squared * step_s);
        Self {
            inverse_unit: 1.0 / constants.unit,
            force_scale: k1 * constants.unit,
            step_s,
            pace: StepPace { growing_s: step_s, slowness: 1.0 },
            undamped,
            beta: half * undamped,
            damping: constants.dissipation * inverse,
            inverse_phase_squared: inverse / step_s,
            start: constants.start,
            end_plastic: constants.end_plastic,
            rate: constants.rate,
        }
    }

    /// The same under a heat.
    #[inline(always)]
    pub(crate) fn paced(self, pace: StepPace) -> Self {
        Self { pace, ..self }
    }

    /// Takes a contact to the overlap `x1` at the end of a step. `plastic_before` is the plastic overlap
    /// one step before `memory.plastic`; it is not read without growth.
    #[inline(always)]
    pub(crate) fn advance<G: Growth>(
        &self,
        law: &LawConstants,
        x1: f64,
        memory: &mut Memory,
        plastic_before: &mut f64,
    ) {
        let Memory { overlap: x, drift: drift_before, plastic: p, pull } = *memory;
        let alpha = law.law.adhesion;
        let drift = x1 - x;
        let damped = self.damping * drift;
        let others = (drift - drift_before) * self.inverse_phase_squared - pull;
        let waiting = self.beta * (alpha + others);

        let p1 = if G::GROWS {
            let middle = (x + 0.5 * drift).max(self.start);
            let (n, d) = G::rate_fraction(&self.rate, middle);
            // G at the middle, as kappa^2/(kappa^2 - q alpha).
            let kappa = 1.0 + law.stiffening * (p + 0.5 * (p - *plastic_before));
            let squared = kappa * kappa;
            let n = n * squared;
            let d = d * (squared - law.stiffening * alpha);
            // Growth, forth or back, stops at full coalescence.
            let hn = if p < self.end_plastic { self.pace.growing_s * n } else { 0.0 };
            let stiffness = law.stiffness(p);
            let softened = stiffness - law.stiffening * (x - p);
            let z = hn * softened * law.inverse_adhesion; // times d
            let predicted =
                (self.undamped * (stiffness * (x1 - p) + damped) + waiting) * law.inverse_adhesion;
            let driving = (alpha - pull) * law.inverse_adhesion;
            let stiff = d + z;
            let share = 0.5 * hn / (d * d + 0.5 * z * (stiff * self.undamped + d));
            *plastic_before = p;
            (p + share * (stiff * predicted + d * driving)).max(0.0).min(self.end_plastic)
        } else {
            p
        };

        let (force, plastic) = law.force(x1, p1, self.end_plastic);
        let normal = self.undamped * (force + damped) + waiting;
        *memory = Memory { overlap: x1, drift, plastic, pull: alpha - normal };
    }

    /// The mean pull over the first half step from a start, where the driving factor D may relax
    /// within a time far below the step: D times `(1 - exp(-z/2))/(z/2)`.
    pub(crate) fn first_pull<G: Growth>(&self, law: &LawConstants, memory: &Memory) -> f64 {
        if !G::GROWS || memory.plastic >= self.end_plastic {
            return memory.pull;
        }
        let alpha = law.law.adhesion;
        let (n, d) = G::rate_fraction(&self.rate, memory.overlap.max(self.start));
        let stiffness = law.stiffness(memory.plastic);
        let softened = stiffness - law.stiffening * (memory.overlap - memory.plastic);
        let factor = law.law.equilibrium_factor(memory.plastic);
        let half_z = 0.5 * self.pace.growing_s * n / d * factor * softened * law.inverse_adhesion;
        let mean = if half_z > 0.0 { -(-half_z).exp_m1() / half_z } else { 1.0 };
        alpha - (alpha - memory.pull) * mean
    }

    /// The memory, before the step, of a contact that is made in a step from the overlap `before`,
    /// negative, to `after`: no force so far, and no acceleration by others.
    pub(crate) fn touching(&self, law: &LawConstants, before: f64, after: f64) -> Memory {
        let alpha = law.law.adhesion;
        let drift = after - before - alpha / self.inverse_phase_squared;
        Memory { overlap: before, drift, plastic: 0.0, pull: alpha }
    }

    /// Resistance of a contact that grows to motion along its axis, `fa/(R rate)` \[N s/m\].
    #[inline(always)]
    pub(crate) fn resistance<G: Growth>(&self, law: &LawConstants, overlap: f64) -> f64 {
        let (n, d) = G::rate_fraction(&self.rate, overlap.max(self.start));
        // A kinetics that has come to its end resists without a limit.
        law.law.adhesion
            * self.force_scale
            * self.inverse_unit
            * (d / n * self.pace.slowness).min(1e30)
    }

    /// The pull of a contact at rest or in motion, out of its overlap, plastic overlap and the rate of the overlap \[1/s\].
    pub(crate) fn settle(&self, law: &LawConstants, memory: &mut Memory, rate: f64) {
        let (force, plastic) = law.force(memory.overlap, memory.plastic, self.end_plastic);
        let normal = force + self.damping * self.step_s * rate;
        *memory = Memory { plastic, pull: law.law.adhesion - normal, ..*memory };
    }
}
