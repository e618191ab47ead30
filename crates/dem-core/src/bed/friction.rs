//! The tangential force of a contact.

use super::material::Friction;
use super::vec3::{Vec3, add, dot, scale, sub};

/// [`Friction`] with the constants of the material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slider {
    pub(crate) coefficient: f64,
    /// `k_t` \[N/m\].
    pub(crate) stiffness: f64,
    /// `gamma_t / gamma_n`.
    pub(crate) damping_over_normal: f64,
}

impl Slider {
    pub(crate) fn new(friction: &Friction, k1: f64) -> Self {
        Self {
            coefficient: friction.coefficient,
            stiffness: friction.tangential_stiffness_over_k1 * k1,
            damping_over_normal: friction.tangential_damping_over_normal,
        }
    }

    /// Energy of a spring \[J\].
    pub(crate) fn energy_j(&self, spring: Vec3) -> f64 {
        0.5 * self.stiffness * dot(spring, spring)
    }

    /// Turns the spring into the tangential plane, stretches it by a step, lets it slide, and
    /// returns the force.
    ///
    /// `relative` is the velocity at the contact of the first body relative to the second, `normal` points to the
    /// first, and `pressing` is the normal force without adhesion, `f_n + fa` \[N\].
    #[inline(always)]
    pub(crate) fn force(
        &self,
        spring: &mut Vec3,
        normal: Vec3,
        relative: Vec3,
        pressing: f64,
        normal_damping: f64,
        step_s: f64,
    ) -> Vec3 {
        let tangential = sub(relative, scale(normal, dot(normal, relative)));
        let turned = sub(*spring, scale(normal, dot(normal, *spring)));
        let stretched = add(turned, scale(tangential, step_s));
        let dashpot = scale(tangential, self.damping_over_normal * normal_damping);
        let trial = scale(add(scale(stretched, self.stiffness), dashpot), -1.0);
        let limit = (self.coefficient * pressing).max(0.0);
        let squared = dot(trial, trial);
        if squared <= limit * limit {
            *spring = stretched;
            return trial;
        }
        let force = scale(trial, limit / squared.sqrt());
        *spring = scale(add(force, dashpot), -1.0 / self.stiffness);
        force
    }
}
