//! The largest stable time step of a bed.

use super::engine::Bed;
use super::error::BedError;
use super::neighbours::index_of;

/// Of the springs of necks over k_t: 7/2 of shear, and 1 or less of bending and twist.
const NECKS: f64 = 4.5;

impl Bed {
    /// Collision time of two of the smallest particles, `pi / sqrt(omega^2 - (c/2)^2)` \[s\], with the mass
    /// scaling; undamped where the damping is overcritical.
    #[must_use]
    pub fn collision_time_s(&self) -> f64 {
        let smallest = self.particles.inertia.iter().copied().fold(f64::INFINITY, f64::min);
        let undamped = 2.0 * self.material.k1_n_per_m() / smallest;
        let half = 0.5 * self.material.dissipation(0.5 * smallest);
        let squared = undamped - half * half;
        std::f64::consts::PI / if squared > 0.0 { squared } else { undamped }.sqrt()
    }

    /// Largest stable step \[s\] and the contacts of the particle that decides.
    ///
    /// By Gershgorin's theorem no frequency of the contact network exceeds
    /// `omega^2 = max_i (2 z_i + w_i) k/m_i` with z contacts and w wall contacts, all on their stiffest branch,
    /// `k = K2max` (and `7/2 k_t` with friction, `9/2 k_t` with necks that resist shear); the step must stay below `2/omega`. For a pair that is
    /// `2 sqrt(m_eff/K2max)`. The damping of the other contacts, known from the step before only, adds
    /// `h c (z - 2) < 2`.
    #[must_use]
    pub fn step_limit_s(&self) -> (f64, usize) {
        let mut contacts = vec![(0usize, 0usize); self.particles.len()];
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    contacts[i].0 += 1;
                    contacts[index_of(self.list.other[k])].0 += 1;
                }
            }
            contacts[i].1 =
                self.wall_list.row(i).filter(|&k| self.wall_list.memory[k].is_contact()).count();
        }
        let k1 = self.material.k1_n_per_m();
        let tangential = self
            .around
            .friction
            .map_or(0.0, |friction| 3.5 * friction.tangential_stiffness_over_k1);
        let necks = if self.has_necks() { NECKS * self.slider().stiffness / k1 } else { 0.0 };
        let stiffness = k1 * (self.law.law.k2_max + tangential.max(necks));
        let mut limit = (f64::INFINITY, 0);
        for (&(pairs, walls), &mass) in contacts.iter().zip(&self.particles.inertia) {
            // A particle without contacts may make one any time.
            let weight = (2 * pairs + walls).max(2) as f64;
            let elastic = 2.0 / (weight * stiffness / mass).sqrt();
            let damping = self.material.dissipation(0.5 * mass) * (pairs + walls) as f64
                - 2.0 * self.material.dissipation(0.5 * mass);
            let damped = if damping > 0.0 { 2.0 / damping } else { f64::INFINITY };
            let step = elastic.min(damped);
            if step < limit.0 {
                limit = (step, pairs + walls);
            }
        }
        limit
    }

    pub(super) fn check_stability(&self) -> Result<(), BedError> {
        let (limit_s, contacts) = self.step_limit_s();
        if self.step_s < limit_s {
            return Ok(());
        }
        Err(BedError::UnstableStep {
            step_s: self.step_s,
            step_over_collision_time: self.step_s / self.collision_time_s(),
            limit_s,
            contacts,
            time_s: self.time_s,
        })
    }
}
