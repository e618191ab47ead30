//! The neighbour list, built with linked cells.

use std::ops::Range;

use rayon::prelude::*;

use super::particles::Particles;
use super::region::{Region, Side};
use super::vec3::{Vec3, dot, sub};

/// Bits of a neighbour entry that hold the particle; the others hold the image.
const INDEX_BITS: u32 = 27;
const INDEX_MASK: u32 = (1 << INDEX_BITS) - 1;
/// Limit on the number of particles of a list, exclusive.
pub(crate) const MOST_PARTICLES: usize = 1 << INDEX_BITS;

/// The pairs of particles closer than the sum of their radii and a skin, each once, under the
/// particle that comes first.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct NeighbourList {
    /// Place of the first pair of particle i, for i up to and including the number of particles.
    pub(crate) start: Vec<u32>,
    /// The second particle of a pair and the image of the box it is seen in.
    pub(crate) other: Vec<u32>,
    /// Place in `reverse` of the first pair whose second particle is i.
    pub(crate) reverse_start: Vec<u32>,
    /// Pairs by their second particle.
    pub(crate) reverse: Vec<u32>,
}

/// Second particle of a pair.
#[inline(always)]
pub(crate) fn index_of(entry: u32) -> usize {
    (entry & INDEX_MASK) as usize
}

/// Image of the second particle of a pair.
#[inline(always)]
pub(crate) fn image_of(entry: u32) -> usize {
    (entry >> INDEX_BITS) as usize
}

impl NeighbourList {
    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> Range<usize> {
        self.start[i] as usize..self.start[i + 1] as usize
    }

    #[inline(always)]
    pub(crate) fn reverse_row(&self, i: usize) -> &[u32] {
        &self.reverse[self.reverse_start[i] as usize..self.reverse_start[i + 1] as usize]
    }

    /// The pair of two particles, the first one first.
    pub(crate) fn find(&self, first: usize, second: usize) -> Option<usize> {
        self.row(first).find(|&k| index_of(self.other[k]) == second)
    }

    /// The list of particles that lie sorted in the cells.
    fn build(particles: &Particles, region: &Region, cells: &Cells, skin: f64) -> Self {
        let n = particles.len();
        let chunks: Vec<(Vec<u32>, Vec<u32>)> = (0..n.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let mut counts = Vec::with_capacity(CHUNK);
                let mut others = Vec::with_capacity(6 * CHUNK);
                for i in chunk * CHUNK..((chunk + 1) * CHUNK).min(n) {
                    let from = others.len();
                    cells.neighbours_after(i, particles, region, skin, &mut others);
                    others[from..].sort_unstable_by_key(|&entry| index_of(entry));
                    counts.push((others.len() - from) as u32);
                }
                (counts, others)
            })
            .collect();
        let mut start = Vec::with_capacity(n + 1);
        let mut other = Vec::with_capacity(chunks.iter().map(|(_, others)| others.len()).sum());
        start.push(0);
        let mut total = 0;
        for (counts, others) in &chunks {
            for count in counts {
                total += count;
                start.push(total);
            }
            other.extend_from_slice(others);
        }
        let mut reverse_start = vec![0; n + 1];
        for &entry in &other {
            reverse_start[index_of(entry) + 1] += 1;
        }
        for i in 0..n {
            reverse_start[i + 1] += reverse_start[i];
        }
        let mut next = reverse_start.clone();
        let mut reverse = vec![0; other.len()];
        for (k, &entry) in other.iter().enumerate() {
            let place = &mut next[index_of(entry)];
            reverse[*place as usize] = k as u32;
            *place += 1;
        }
        Self { start, other, reverse_start, reverse }
    }
}

/// Particles handled by one task; does not change any result.
const CHUNK: usize = 256;

/// Sorts the particles into cells and lists their neighbours. Also returns where each particle was
/// before.
pub(crate) fn sort_and_list(
    particles: &mut Particles,
    region: &Region,
    skin: f64,
) -> (NeighbourList, Vec<u32>) {
    for position in &mut particles.position_m {
        region.wrap(position);
    }
    let largest = particles.radius_m.iter().copied().fold(0.0, f64::max);
    let mut cells = Cells::around(&particles.position_m, region, 2.0 * largest + skin);
    let order = cells.sort(&particles.position_m);
    particles.reorder(&order);
    (NeighbourList::build(particles, region, &cells, skin), order)
}

/// A grid of cells, each at least as long as the reach of the list.
struct Cells {
    low: Vec3,
    inverse_length: Vec3,
    count: [usize; 3],
    periodic: [bool; 3],
    /// Place of the first particle of a cell, once they are sorted.
    start: Vec<u32>,
}

impl Cells {
    fn around(positions: &[Vec3], region: &Region, reach: f64) -> Self {
        let mut low = [0.0; 3];
        let mut inverse_length = [0.0; 3];
        let mut count = [1; 3];
        let mut periodic = [false; 3];
        // Never many more cells than particles, however far apart these are.
        let most = (positions.len() as f64).cbrt().ceil() * 2.0 + 1.0;
        for axis in 0..3 {
            let along = positions.iter().map(|position| position[axis]);
            let length = if region.sides[axis] == Side::Periodic {
                periodic[axis] = true;
                region.size_m[axis]
            } else {
                low[axis] = along.clone().fold(f64::INFINITY, f64::min);
                along.fold(low[axis], f64::max) - low[axis]
            };
            let cells = (length / reach).floor().clamp(1.0, most);
            count[axis] = cells as usize;
            inverse_length[axis] = if length > 0.0 { cells / length } else { 0.0 };
        }
        Self { low, inverse_length, count, periodic, start: Vec::new() }
    }

    fn place(&self, position: Vec3) -> [usize; 3] {
        let mut place = [0; 3];
        for axis in 0..3 {
            let along = (position[axis] - self.low[axis]) * self.inverse_length[axis];
            // Saturates at zero, and at the last cell.
            place[axis] = (along as usize).min(self.count[axis] - 1);
        }
        place
    }

    fn index(&self, place: [usize; 3]) -> usize {
        (place[2] * self.count[1] + place[1]) * self.count[0] + place[0]
    }

    /// The order that puts the particles cell by cell, otherwise as they were.
    fn sort(&mut self, positions: &[Vec3]) -> Vec<u32> {
        let cell_of: Vec<usize> = positions.iter().map(|&r| self.index(self.place(r))).collect();
        let mut start = vec![0u32; self.count.iter().product::<usize>() + 1];
        for &cell in &cell_of {
            start[cell + 1] += 1;
        }
        for cell in 1..start.len() {
            start[cell] += start[cell - 1];
        }
        let mut next = start.clone();
        let mut order = vec![0; positions.len()];
        for (particle, &cell) in cell_of.iter().enumerate() {
            order[next[cell] as usize] = particle as u32;
            next[cell] += 1;
        }
        self.start = start;
        order
    }

    /// Appends the neighbours of particle i that come after it.
    fn neighbours_after(
        &self,
        i: usize,
        particles: &Particles,
        region: &Region,
        skin: f64,
        others: &mut Vec<u32>,
    ) {
        let (position, radius) = (particles.position_m[i], particles.radius_m[i]);
        let place = self.place(position);
        let along = [0, 1, 2].map(|axis| self.around_cell(axis, place[axis]));
        for &z in along[2].as_slice() {
            for &y in along[1].as_slice() {
                for &x in along[0].as_slice() {
                    let cell = self.index([x, y, z]);
                    let from = (self.start[cell] as usize).max(i + 1);
                    for j in from..(self.start[cell + 1] as usize).max(from) {
                        let d = sub(position, particles.position_m[j]);
                        let (d, image) = region.nearest_image(d);
                        let reach = radius + particles.radius_m[j] + skin;
                        if dot(d, d) < reach * reach {
                            others.push(j as u32 | image << INDEX_BITS);
                        }
                    }
                }
            }
        }
    }

    /// The cell and its neighbours on one axis, each once.
    fn around_cell(&self, axis: usize, at: usize) -> Few {
        let count = self.count[axis];
        let mut few = Few { cells: [at; 3], count: 1 };
        let wraps = self.periodic[axis];
        let before = if at > 0 { Some(at - 1) } else { wraps.then(|| count - 1) };
        let after = if at + 1 < count { Some(at + 1) } else { wraps.then_some(0) };
        for cell in [before, after].into_iter().flatten() {
            if !few.as_slice().contains(&cell) {
                few.cells[few.count] = cell;
                few.count += 1;
            }
        }
        few
    }
}

/// Up to three cells.
struct Few {
    cells: [usize; 3],
    count: usize,
}

impl Few {
    fn as_slice(&self) -> &[usize] {
        &self.cells[..self.count]
    }
}
