//! Another numerical stiffness for a bed with contacts.
//!
//! K1 is a numerical stiffness, and so is the overlap `fa/K1` that adhesion alone gives to a contact. A bed settles with a soft one, for the
//! length of the steps; heat would then start from necks, and from a density, that the softness has made. A heated quasi-static phase, whose
//! steps do not go by K1, therefore begins with hard contacts: those whose adhesive overlap is the pair's, 1e-3 R, if it has no K1 of its own. The bed is
//! stretched by what the mean contact gives back, below one percent, and balanced again; which particles touch is what it was. Periodic sides, which are
//! parts of the bed, are stretched with it, and a bed with a surface grows up to where its surface comes to be; two walls stay where they are, and the bed between them as
//! wide as it is.

use super::engine::Bed;
use super::error::BedError;
use super::material::Material;
use super::neighbours::index_of;
use super::phase::{Mode, Phase};
use super::region::Side;
use super::vec3::norm;

/// What a phase began with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseEntry {
    /// Loading stiffness K1 \[N/m\].
    pub k1_n_per_m: f64,
    /// Lengths of the box as the phase before left them \[m\].
    pub box_before_m: [f64; 3],
    /// And once its contacts had the stiffness of this phase \[m\].
    pub box_m: [f64; 3],
    /// Whether no balance was found on the way to that stiffness, so that the contacts keep the overlaps of another.
    pub keeps_overlaps: bool,
}

impl Material {
    /// K1 of a phase \[N/m\]: its own, or that which gives contacts the neck of the pair where a heated balance has a stated adhesive force, or
    /// the material's.
    pub(crate) fn k1_of(&self, phase: &Phase) -> f64 {
        let is_hot_balance = phase.heated && phase.mode == Mode::QuasiStatic;
        let of_the_pair = self.pair_k1_n_per_m().filter(|_| is_hot_balance);
        phase.k1_n_per_m.or(of_the_pair).unwrap_or(self.k1_n_per_m())
    }
}

impl Bed {
    /// Takes on a material of another stiffness. Where the adhesive force is stated the contacts keep their overlaps and
    /// the forces they carry; where it goes by K1 all forces go with it.
    pub(crate) fn change_stiffness(&mut self, material: Material) {
        let share = self.material.k1_n_per_m() / material.k1_n_per_m();
        let before = self.law;
        self.set_material(material);
        if share == 1.0 || !material.has_stated_adhesion() {
            return;
        }
        let law = self.law.law;
        for memory in self.pairs.memory.iter_mut().chain(&mut self.wall_list.memory) {
            if memory.is_contact() {
                let (x, p) = (memory.overlap, memory.plastic);
                let force = before.stiffness(p) * (x - p) * share;
                memory.plastic = law.plastic_overlap_carrying(force.min(x), x);
                memory.pull *= share;
            }
        }
        for (before, memory) in self.pairs.plastic_before.iter_mut().zip(&self.pairs.memory) {
            *before = memory.plastic;
        }
    }

    /// Takes on a material of another stiffness for a balance of forces that follows. The contacts are elastic there: the bed is stretched, or
    /// shrunk, to where their mean overlap is that of adhesion.
    pub(crate) fn harden(&mut self, material: Material) -> Result<(), BedError> {
        self.set_material(material);
        let alpha = self.law.law.adhesion;
        let (mut excess, mut count) = (0.0, 0u32);
        for i in 0..self.particles.len() {
            for k in self.list.row(i).filter(|&k| self.pairs.memory[k].is_contact()) {
                let (overlap, unit) = self.geometric_overlap(i, k);
                excess += (overlap - alpha) * unit / norm(self.distance(i, k));
                count += 1;
            }
        }
        let factor = 1.0 + excess / f64::from(count.max(1));
        for axis in 0..3 {
            // Gravity that points down the axis leaves a surface below the upper wall.
            let is_surface = self.around.gravity_m_per_s2[axis] < 0.0;
            let side = self.around.region.sides[axis];
            if side == Side::Walls && !is_surface {
                continue;
            }
            for position in &mut self.particles.position_m {
                position[axis] *= factor;
            }
            if side == Side::Periodic {
                self.around.region.size_m[axis] *= factor;
            }
        }
        self.rebuild()?;
        for i in 0..self.particles.len() {
            for k in self.list.row(i) {
                if self.pairs.memory[k].is_contact() {
                    let overlap = self.geometric_overlap(i, k).0;
                    self.pairs.memory[k] = self.law.elastic(overlap);
                    self.pairs.plastic_before[k] = 0.0;
                }
            }
            for k in self.wall_list.row(i) {
                if self.wall_list.memory[k].is_contact() {
                    let wall = &self.walls[self.wall_list.wall[k] as usize];
                    let radius = self.particles.radius_m[i];
                    let overlap = radius - wall.distance(self.particles.position_m[i]);
                    let overlap = overlap / self.material.wall_unit(radius);
                    self.wall_list.memory[k] = self.law.elastic(overlap);
                }
            }
        }
        Ok(())
    }

    /// Overlap of a pair by its positions, and its unit \[m\].
    fn geometric_overlap(&self, i: usize, k: usize) -> (f64, f64) {
        let radius = &self.particles.radius_m;
        let j = index_of(self.list.other[k]);
        let unit = self.material.overlap_unit(radius[i], radius[j]);
        ((radius[i] + radius[j] - norm(self.distance(i, k))) / unit, unit)
    }

    /// Whether no contact has a plastic overlap: nothing has sintered.
    pub(crate) fn is_elastic(&self) -> bool {
        self.pairs.memory.iter().all(|memory| !memory.is_contact() || memory.plastic == 0.0)
    }
}
