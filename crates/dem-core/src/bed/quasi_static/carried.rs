//! Whether the weight of every particle is carried: where it is not there is no balance of forces, and no end to a fall.
//!
//! Contacts without friction carry across a wall only. A group of particles in contact is carried where, for each axis along
//! which gravity acts, one of them touches a wall across that axis.

use crate::bed::engine::Bed;
use crate::bed::error::BedError;
use crate::bed::neighbours::index_of;
use crate::bed::vec3::norm;

/// Components of gravity below such a part of it are those of a rounded direction.
const ROUNDED: f64 = 1e-9;

/// Particles that nothing carries.
pub(super) struct Loose {
    /// Whether each is.
    pub(super) is_loose: Vec<bool>,
    /// The first of them, by its place in the scene.
    particle: usize,
    /// An axis of gravity along which nothing carries it.
    axis: usize,
}

impl Bed {
    /// The particles that nothing carries, where there are such.
    pub(super) fn loose(&self) -> Option<Loose> {
        let gravity = self.around.gravity_m_per_s2;
        let acts = gravity.map(|along| along.abs() > ROUNDED * norm(gravity));
        if acts == [false; 3] {
            return None;
        }
        let n = self.particles.len();
        let mut group: Vec<usize> = (0..n).collect();
        for i in 0..n {
            for k in self.list.row(i).filter(|&k| self.pairs.memory[k].is_contact()) {
                let (a, b) =
                    (first(&mut group, i), first(&mut group, index_of(self.list.other[k])));
                group[a.max(b)] = a.min(b);
            }
        }
        // A group is known by its first particle.
        let mut held = vec![acts.map(|acts| !acts); n];
        for i in 0..n {
            for k in self.wall_list.row(i).filter(|&k| self.wall_list.memory[k].is_contact()) {
                held[first(&mut group, i)][self.walls[self.wall_list.wall[k] as usize].axis] = true;
            }
        }
        let held: Vec<[bool; 3]> = (0..n).map(|i| held[first(&mut group, i)]).collect();
        let named = |i: &usize| self.particles.id[*i];
        let i = (0..n).filter(|&i| held[i] != [true; 3]).min_by_key(named)?;
        Some(Loose {
            is_loose: held.iter().map(|held| *held != [true; 3]).collect(),
            particle: self.particles.id[i] as usize,
            axis: held[i].iter().position(|held| !held).unwrap_or_default(),
        })
    }

    /// An error of the balance, or what it comes from: a particle that nothing carries.
    pub(super) fn cause(&self, error: BedError) -> BedError {
        match (&error, self.loose()) {
            (BedError::NoBalance { .. } | BedError::NoRest { .. }, Some(loose)) => {
                loose.error(self.time_s)
            }
            _ => error,
        }
    }
}

impl Loose {
    pub(super) fn error(&self, time_s: f64) -> BedError {
        BedError::NothingCarries { particle: self.particle, axis: self.axis, time_s }
    }
}

/// The first particle of a group; shortens the way there.
fn first(group: &mut [usize], mut i: usize) -> usize {
    while group[i] != i {
        group[i] = group[group[i]];
        i = group[i];
    }
    i
}
