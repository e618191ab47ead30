//! The Verlet scheme of the pair.
//!
//! Lengths in R, forces in `K1 R`, with `omega^2 = K1/m_eff`, `alpha = fa/(K1 R)`,
//! `c = gamma_n/m_eff` and `f = f_ep/(K1 R)`:
//!
//! ```text
//! x'' = omega^2 (alpha - f) - c x'
//! p'  = rate(x) G(p) D,   D = (f + (c/omega^2) x')/alpha,   G = 1/(1 - q alpha/kappa^2)
//! ```
//!
//! D is the driving factor `(f_ep - gamma_n v_n)/fa` (`v_n = -x'`), 1 without inertia. One step of h,
//! kick and drift merged so that the state between steps is x, p and the drift `V = h x'` of the half
//! step to come:
//!
//! 1. drift: `x1 = x + V`.
//! 2. plastic overlap, implicit. With `D_p` the driving factor at the new overlap had p stayed
//!    (trapezoidal damping included), rate and G at the middle of the step and
//!    `z = h rate G khat/alpha`, `khat = kappa - q (x - p)`, the change of p is
//!    `h rate G [(1 + z) D_p + D]/2 / (1 + z/2 [(1 + z)(1 - beta) + 1])`.
//!    It is the solution of the linear relaxation of p towards its target, which moves through
//!    the step in a straight line, with `1/(1 + z + z^2/2)` for `exp(-z)`, and with the velocity that
//!    results at the end of the step in the target. For small z that is the trapezoidal rule, for
//!    large z the contact is relaxed (D = 0) at the end of the step; D does not change its
//!    sign for any z, so that the singular start neither overshoots nor chatters.
//! 3. force at (x1, p1) by the contact law, and kick with trapezoidal damping: with
//!    `N = h^2 omega^2 (alpha - f1)/2` and `beta = (h c/2)/(1 + h c/2)`, `V1 = (V + N)(1 - beta)`.

use crate::kinetics::RateCoefficients;
use crate::lanes::{F64x8, Lanes, WIDTH};
use crate::{Branch, ContactLaw, Kinetic, PairScene};

/// State of one pair, or of several.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<L> {
    /// Overlap.
    pub(super) overlap: L,
    /// Drift of the step to come, h times the velocity at its middle.
    pub(super) drift: L,
    /// h times the velocity.
    pub(super) velocity: L,
    pub(super) plastic: L,
    /// Plastic overlap one step ago.
    plastic_before: L,
    stiffness: L,
    driving: L,
    // One step ago, for observations inside a step.
    pub(super) overlap_before: L,
    pub(super) velocity_before: L,
}

impl Pair<f64> {
    /// At rest: in the adhesive contact, or at first touch.
    pub(super) fn start(scene: &PairScene, from_contact: bool) -> Self {
        let law = scene.law();
        let overlap = if from_contact { 0.0 } else { scene.x0() };
        let plastic = if from_contact { 0.0 } else { law.equilibrium_plastic_overlap(scene.x0()) };
        let stiffness = law.unloading_stiffness(plastic);
        let driving = if from_contact { 0.0 } else { 1.0 };
        Self {
            overlap,
            drift: 0.0,
            velocity: 0.0,
            plastic,
            plastic_before: plastic,
            stiffness,
            driving,
            overlap_before: overlap,
            velocity_before: 0.0,
        }
    }
}

/// Constants of the scheme.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scheme<L> {
    law: ContactLaw,
    start: L,
    end_plastic: L,
    adhesion: L,
    inverse_adhesion: L,
    stiffening: L,
    stiffness_max: L,
    cohesion: L,
    elastic_width: L,
    /// `(1 - beta)/alpha`.
    driving_of_force: L,
    /// `1 - beta`.
    undamped: L,
    beta: L,
    /// `c/(omega^2 h)`: damping force of a drift.
    damping: L,
    /// `h^2 omega^2/2`.
    kick: L,
    /// `(1 - h c/2)/(1 + h c/2)`.
    retained: L,
    pub(super) coefficients: RateCoefficients<L>,
}

impl<L: Lanes> Scheme<L> {
    pub(super) fn new(scene: &PairScene, step_s: f64, coefficients: &RateCoefficients<L>) -> Self {
        let law = *scene.law();
        let frequency_squared = scene.k1_n_per_m() / scene.effective_mass_kg();
        let dissipation = scene.dissipation_kg_per_s() / scene.effective_mass_kg();
        let half = 0.5 * step_s * dissipation;
        Self {
            law,
            start: L::splat(scene.x0()),
            end_plastic: L::splat(law.equilibrium_plastic_overlap(scene.final_overlap())),
            adhesion: L::splat(law.adhesion),
            inverse_adhesion: L::splat(1.0 / law.adhesion),
            stiffening: L::splat(law.stiffening()),
            stiffness_max: L::splat(law.k2_max),
            cohesion: L::splat(law.kc),
            elastic_width: L::splat(1.0 / law.stiffening()),
            driving_of_force: L::splat(1.0 / ((1.0 + half) * law.adhesion)),
            undamped: L::splat(1.0 / (1.0 + half)),
            beta: L::splat(half / (1.0 + half)),
            damping: L::splat(dissipation / (frequency_squared * step_s)),
            kick: L::splat(0.5 * step_s * step_s * frequency_squared),
            retained: L::splat((1.0 - half) / (1.0 + half)),
            coefficients: *coefficients,
        }
    }
}

impl<L: Lanes> Scheme<L> {
    /// One step; see the head of this file. `growing_s` is the step in the reduced time of the rates: `step_s` without heat.
    #[inline(always)]
    pub(super) fn step<K: Kinetic>(&self, growing_s: L, pair: &mut Pair<L>)
    where
        Self: OffElastic<L>,
    {
        let one = L::splat(1.0);
        let half = L::splat(0.5);
        let Pair { overlap: x, drift, plastic: p, .. } = *pair;
        let x1 = x + drift;

        let middle = (x + half * drift).max(self.start);
        let (n, d) = K::rate_fraction(&self.coefficients, middle);
        // G at the middle, as kappa^2/(kappa^2 - q alpha).
        let middle_plastic = p + half * (p - pair.plastic_before);
        let kappa = one + self.stiffening * middle_plastic;
        let squared = kappa * kappa;
        let d = d * (squared - self.stiffening * self.adhesion);
        let growing = growing_s * n * squared;
        // Growth, forth or back, stops at full coalescence.
        let (hn, _) = L::choose_pair(p, self.end_plastic, || (growing, d), || (L::splat(0.0), d));
        let softened = pair.stiffness - self.stiffening * (x - p);
        let z = hn * softened * self.inverse_adhesion; // times d
        let damped = self.damping * drift;
        let predicted = pair.stiffness * self.driving_of_force * (x1 - p)
            + (self.driving_of_force * damped + self.beta);
        let stiff = d + z;
        // Terms that need x1 come last, so that the division runs beside the drift.
        let share = half * hn / (d * d + half * z * (stiff * self.undamped + d));
        let change = share * stiff * predicted + share * (d * pair.driving);

        let p1 = (p + change).max(L::splat(0.0)).min(self.end_plastic);
        let stiffness = (one + self.stiffening * p1).min(self.stiffness_max);
        let force = stiffness * (x1 - p1);
        let kick = self.kick * (self.adhesion - force);

        pair.overlap_before = x;
        pair.velocity_before = pair.velocity;
        pair.plastic_before = p;
        pair.overlap = x1;
        pair.plastic = p1;
        pair.stiffness = stiffness;
        pair.driving = self.driving_of_force * (force + damped) + self.beta;
        pair.velocity = (drift + kick) * self.undamped;
        pair.drift = self.retained * drift + (one + self.retained) * kick;

        // Positive off the elastic branch, which the plain run of a pair never leaves.
        let cohesive = L::splat(0.0) - self.cohesion * x1 - force;
        let loading = x1 - p1 - self.elastic_width;
        let apart = L::splat(0.0) - x1;
        self.off_elastic(cohesive.max(loading).max(apart), drift, pair);
    }
}

impl Scheme<f64> {
    /// Gives the first drift to a pair at rest.
    ///
    /// At the singular start the driving factor falls from 1 to nearly 0 within a time `h/z` that
    /// may be far below the step. The first half kick takes its mean over the half step,
    /// `D (1 - exp(-z/2))/(z/2)`: with D itself the pair would set off half a step late, an error of
    /// first order.
    pub(super) fn set_off<K: Kinetic>(&self, growing_s: f64, pair: &mut Pair<f64>) {
        let (n, d) = K::rate_fraction(&self.coefficients, self.start);
        let softened = pair.stiffness - self.stiffening * (pair.overlap - pair.plastic);
        let factor = self.law.equilibrium_factor(pair.plastic);
        let half_z = 0.5 * growing_s * n / d * factor * softened * self.inverse_adhesion;
        let mean = if half_z > 0.0 { -(-half_z).exp_m1() / half_z } else { 1.0 };
        pair.drift = self.kick * self.adhesion * (1.0 - pair.driving * mean);
    }

    /// Redoes the end of a step with the force of the branch that holds.
    #[cold]
    fn other_branch(&self, drift: f64, pair: &mut Pair<f64>) {
        let response = self.law.respond(pair.overlap, pair.plastic);
        if response.branch == Branch::Apart {
            pair.plastic = pair.plastic_before;
            pair.stiffness = self.law.unloading_stiffness(pair.plastic);
            pair.driving = 0.0;
            pair.velocity = drift;
            pair.drift = drift;
            return;
        }
        pair.plastic = response.plastic_overlap.min(self.end_plastic);
        pair.stiffness = self.law.unloading_stiffness(pair.plastic);
        let damped = self.damping * drift;
        let kick = self.kick * (self.adhesion - response.force);
        pair.driving = self.driving_of_force * (response.force + damped) + self.beta;
        pair.velocity = (drift + kick) * self.undamped;
        pair.drift = self.retained * drift + (1.0 + self.retained) * kick;
    }
}

/// The end of a step off the elastic branch, where `excess` is positive.
pub(super) trait OffElastic<L> {
    fn off_elastic(&self, excess: L, drift: L, pair: &mut Pair<L>);
}

impl OffElastic<f64> for Scheme<f64> {
    #[inline(always)]
    fn off_elastic(&self, excess: f64, drift: f64, pair: &mut Pair<f64>) {
        if excess > 0.0 {
            self.other_branch(drift, pair);
        }
    }
}

impl OffElastic<F64x8> for Scheme<F64x8> {
    #[inline(always)]
    fn off_elastic(&self, excess: F64x8, drift: F64x8, pair: &mut Pair<F64x8>) {
        let mut any = false;
        for i in 0..WIDTH {
            any |= excess.0[i] > 0.0;
        }
        if any {
            self.other_branches(excess, drift, pair);
        }
    }
}

impl Scheme<F64x8> {
    #[cold]
    #[inline(never)]
    fn other_branches(&self, excess: F64x8, drift: F64x8, pair: &mut Pair<F64x8>) {
        for i in 0..WIDTH {
            if excess.0[i] > 0.0 {
                let mut one = pair.lane(i);
                self.lane(i).other_branch(drift.0[i], &mut one);
                pair.set_lane(i, &one);
            }
        }
    }

    /// The scheme of one lane.
    fn lane(&self, i: usize) -> Scheme<f64> {
        Scheme {
            law: self.law,
            start: self.start.0[i],
            end_plastic: self.end_plastic.0[i],
            adhesion: self.adhesion.0[i],
            inverse_adhesion: self.inverse_adhesion.0[i],
            stiffening: self.stiffening.0[i],
            stiffness_max: self.stiffness_max.0[i],
            cohesion: self.cohesion.0[i],
            elastic_width: self.elastic_width.0[i],
            driving_of_force: self.driving_of_force.0[i],
            undamped: self.undamped.0[i],
            beta: self.beta.0[i],
            damping: self.damping.0[i],
            kick: self.kick.0[i],
            retained: self.retained.0[i],
            coefficients: self.coefficients.lane(i),
        }
    }
}

impl RateCoefficients<F64x8> {
    /// All lanes alike.
    pub(super) fn splat(one: &RateCoefficients<f64>) -> Self {
        Self {
            switch: F64x8::splat(one.switch),
            zipping: F64x8::splat(one.zipping),
            stretching: F64x8::splat(one.stretching),
            relaxation: F64x8::splat(one.relaxation),
        }
    }

    /// The coefficients of one lane.
    pub(super) fn lane(&self, i: usize) -> RateCoefficients<f64> {
        RateCoefficients {
            switch: self.switch.0[i],
            zipping: self.zipping.0[i],
            stretching: self.stretching.0[i],
            relaxation: self.relaxation.0[i],
        }
    }

    /// Changes the coefficients of one lane.
    pub(super) fn set_lane(&mut self, i: usize, one: &RateCoefficients<f64>) {
        self.switch.0[i] = one.switch;
        self.zipping.0[i] = one.zipping;
        self.stretching.0[i] = one.stretching;
        self.relaxation.0[i] = one.relaxation;
    }
}

macro_rules! lanes_of_pair {
    ($($field:ident),*) => {
        impl Pair<F64x8> {
            /// All lanes alike.
            pub(super) fn splat(one: &Pair<f64>) -> Self {
                Self { $($field: F64x8::splat(one.$field)),* }
            }

            /// One lane.
            pub(super) fn lane(&self, i: usize) -> Pair<f64> {
                Pair { $($field: self.$field.0[i]),* }
            }

            /// Changes one lane.
            pub(super) fn set_lane(&mut self, i: usize, one: &Pair<f64>) {
                $(self.$field.0[i] = one.$field;)*
            }
        }
    };
}
lanes_of_pair!(
    overlap,
    drift,
    velocity,
    plastic,
    plastic_before,
    stiffness,
    driving,
    overlap_before,
    velocity_before
);

impl Pair<f64> {
    /// Overlap and plastic overlap at a fraction of the step that has just been made: the overlap
    /// by the cubic through values and velocities, the plastic overlap by a straight line.
    pub(super) fn at(&self, fraction: f64) -> (f64, f64) {
        let s = fraction;
        let (x, v, x1, v1) =
            (self.overlap_before, self.velocity_before, self.overlap, self.velocity);
        let rest = 1.0 - s;
        let cubic = x + s * (x1 - x) + s * rest * (rest * (v - (x1 - x)) - s * (v1 - (x1 - x)));
        (cubic, self.plastic_before + s * (self.plastic - self.plastic_before))
    }
}
