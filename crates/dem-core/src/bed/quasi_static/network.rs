//! The linear system of a network of springs, and its solution by conjugate gradients.
//!
//! The matrix is `sum b b^T` over the springs, `b = sqrt(k) n` at one end and `-sqrt(k) n` at the other,
//! plus a diagonal that ties particles to the ground; and, where the box may shrink, one more row for
//! its strain. Every spring is held by both of its ends, so that each row can be computed
//! alone. Sums over all particles are made of the sums of blocks of fixed size: the bits do not
//! depend on the number of threads.

use rayon::prelude::*;

use super::shear::{Shear, add_reactions};
use crate::bed::vec3::{Vec3, ZERO, add, dot, scale, sub};

/// Particles of a block.
const BLOCK: usize = 256;

/// Number of particles below which threads cost more than they save.
const PARALLEL: usize = 3000;

/// One end of a spring.
#[derive(Debug, Clone, Copy)]
struct Link {
    /// `sqrt(k) n`, n pointing to this end.
    along: Vec3,
    /// `sqrt(k)` times the length that a strain stretches.
    stretch: f32,
    other: u32,
}

/// A symmetric 3x3 matrix: xx, yy, zz, yz, xz, xy.
type Symmetric = [f64; 6];

/// The springs, by the particles at their ends.
#[derive(Debug, Clone, Default)]
pub(crate) struct Network {
    start: Vec<u32>,
    links: Vec<Link>,
    ground: Vec<Vec3>,
    /// Inverse of the diagonal block of each particle.
    inverse: Vec<Symmetric>,
    /// Stiffness of the strain; zero where the box is rigid.
    strain_stiffness: f64,
    /// Necks that resist shear: the first half of the rows then are the shifts of the particles, the second half their turns.
    necks: Vec<Shear>,
}

/// A spring between two particles.
pub(crate) struct Spring {
    pub(crate) ends: [u32; 2],
    /// From the second end to the first.
    pub(crate) normal: Vec3,
    /// Stiffness \[N/m\].
    pub(crate) stiffness: f64,
    /// Distance of the ends \[m\].
    pub(crate) length: f64,
}

/// A solution and its work.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Solution {
    /// Displacements \[m\].
    pub(crate) moves: Vec<Vec3>,
    /// Strain of the box.
    pub(crate) strain: f64,
    /// Iterations of conjugate gradients.
    pub(crate) iterations: u64,
}

impl Network {
    /// `ground`: stiffness along each axis that ties a particle to the ground. `strains`: whether
    /// the box may shrink.
    pub(crate) fn new(springs: &[Spring], ground: Vec<Vec3>, strains: bool) -> Self {
        let n = ground.len();
        let mut start = vec![0u32; n + 1];
        for spring in springs {
            for end in spring.ends {
                start[end as usize + 1] += 1;
            }
        }
        for i in 0..n {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut links = vec![Link { along: ZERO, stretch: 0.0, other: 0 }; 2 * springs.len()];
        let mut strain_stiffness = 0.0;
        for spring in springs {
            let [i, j] = spring.ends;
            let root = spring.stiffness.sqrt();
            let along = scale(spring.normal, root);
            let stretch = if strains { (root * spring.length) as f32 } else { 0.0 };
            strain_stiffness += f64::from(stretch) * f64::from(stretch);
            for (end, other, along) in [(i, j, along), (j, i, scale(along, -1.0))] {
                let place = &mut next[end as usize];
                links[*place as usize] = Link { along, stretch, other };
                *place += 1;
            }
        }
        let mut network = Self { start, links, ground, strain_stiffness, ..Self::default() };
        network.inverse = (0..n).map(|i| network.inverse_block(i, [0.0; 6])).collect();
        network
    }

    /// With necks between the particles of the first half of the rows, whose turns are the second half.
    pub(crate) fn with_necks(mut self, necks: Vec<Shear>) -> Self {
        let rows = self.ground.len();
        let mut blocks = vec![[0.0; 6]; rows];
        for neck in &necks {
            let [x, y, z] = neck.normal;
            for (end, &particle) in neck.ends.iter().enumerate() {
                let rows = [particle, rows / 2 + particle];
                for (row, [along, across]) in rows.into_iter().zip(neck.diagonal(end)) {
                    let own = [x * x, y * y, z * z, y * z, x * z, x * y];
                    for (at, product) in own.into_iter().enumerate() {
                        let one = if at < 3 { across } else { 0.0 };
                        blocks[row][at] += one + (along - across) * product;
                    }
                }
            }
        }
        self.inverse = (0..rows).map(|i| self.inverse_block(i, blocks[i])).collect();
        Self { necks, ..self }
    }

    fn row(&self, i: usize) -> &[Link] {
        &self.links[self.start[i] as usize..self.start[i + 1] as usize]
    }

    /// The inverse of a diagonal block; `own`: what necks add to it.
    fn inverse_block(&self, i: usize, own: Symmetric) -> Symmetric {
        let [mut a, mut b, mut c] = self.ground[i];
        let [mut f, mut g, mut h] = [own[3], own[4], own[5]];
        (a, b, c) = (a + own[0], b + own[1], c + own[2]);
        for link in self.row(i) {
            let [x, y, z] = link.along;
            a += x * x;
            b += y * y;
            c += z * z;
            f += y * z;
            g += x * z;
            h += x * y;
        }
        // One or two springs leave directions with almost no stiffness: a share of the whole keeps
        // the block regular. Any positive definite block will do.
        let some = 1e-6 * (a + b + c) + 1e-300;
        let [a, b, c] = [a + some, b + some, c + some];
        let (aa, bb, cc) = (b * c - f * f, a * c - g * g, a * b - h * h);
        let (ff, gg, hh) = (g * h - a * f, f * h - b * g, f * g - c * h);
        let inverse = 1.0 / (a * aa + h * hh + g * gg);
        [aa, bb, cc, ff, gg, hh].map(|value| value * inverse)
    }

    fn precondition(&self, i: usize, [x, y, z]: Vec3) -> Vec3 {
        let [a, b, c, f, g, h] = self.inverse[i];
        [a * x + h * y + g * z, h * x + b * y + f * z, g * x + f * y + c * z]
    }

    /// Displacements and strain under forces, to `accuracy` of the energy norm of the error's preconditioned residual.
    ///
    /// Conjugate gradients in the form of A.T. Chronopoulos and C.W. Gear, J. Comput. Appl. Math. 25 (1989) 153, with
    /// one pass for the matrix and one for the vectors.
    pub(crate) fn solve(&self, force: &[Vec3], strain_force: f64, accuracy: f64) -> Solution {
        const MOST: u64 = 400;
        let n = force.len();
        let strains = self.strain_stiffness > 0.0;
        let strain_inverse = if strains { 1.0 / self.strain_stiffness } else { 0.0 };
        let mut u = vec![ZERO; n];
        let mut r = force.to_vec();
        let mut p = vec![ZERO; n];
        let mut w = vec![ZERO; n];
        let mut z: Vec<Vec3> = (0..n).map(|i| self.precondition(i, r[i])).collect();
        let mut s = vec![ZERO; n];
        let (mut u_strain, mut r_strain) = (0.0, if strains { strain_force } else { 0.0 });
        let (mut p_strain, mut w_strain) = (0.0, 0.0);
        let mut z_strain = r_strain * strain_inverse;
        let mut rz = block_sums(r.iter().zip(&z).map(|(&r, &z)| dot(r, z))) + r_strain * z_strain;
        let wanted = accuracy * accuracy * rz;
        let (mut share, mut step_before) = (0.0, 1.0);
        let mut iterations = 0;
        while rz > wanted && iterations < MOST {
            iterations += 1;
            let [zs, s_strain] = self.apply(&z, z_strain, &mut s);
            let curvature = zs + z_strain * s_strain;
            let against = share * rz / step_before;
            let step = rz / (curvature - against);
            if !(step > 0.0 && step.is_finite()) {
                break;
            }
            let state = Vectors { u: &mut u, r: &mut r, p: &mut p, w: &mut w, z: &mut z, s: &s };
            let mut next = self.update(state, share, step);
            p_strain = z_strain + share * p_strain;
            w_strain = s_strain + share * w_strain;
            u_strain += step * p_strain;
            r_strain -= step * w_strain;
            z_strain = r_strain * strain_inverse;
            next += r_strain * z_strain;
            share = next / rz;
            rz = next;
            step_before = step;
        }
        Solution { moves: u, strain: u_strain, iterations }
    }

    /// `s` = matrix times `z`; returns `z . s` and the strain's row.
    fn apply(&self, z: &[Vec3], z_strain: f64, s: &mut [Vec3]) -> [f64; 2] {
        let rows = |(block, s): (usize, &mut [Vec3])| {
            let (mut product, mut strain) = (0.0, 0.0);
            for (at, s) in s.iter_mut().enumerate() {
                let i = block * BLOCK + at;
                let here = z[i];
                let ground = self.ground[i];
                let mut sum = [ground[0] * here[0], ground[1] * here[1], ground[2] * here[2]];
                for link in self.row(i) {
                    let stretch = f64::from(link.stretch);
                    let pull =
                        dot(link.along, sub(here, z[link.other as usize])) + z_strain * stretch;
                    sum = add(sum, scale(link.along, pull));
                    strain += stretch * pull;
                }
                *s = sum;
                product += dot(here, sum);
            }
            // Every spring has been seen from both ends.
            [product, 0.5 * strain]
        };
        let sums: Vec<[f64; 2]> = if z.len() < PARALLEL {
            s.chunks_mut(BLOCK).enumerate().map(rows).collect()
        } else {
            s.par_chunks_mut(BLOCK).enumerate().map(rows).collect()
        };
        let [product, strain] =
            sums.iter().fold([0.0; 2], |sum, block| [sum[0] + block[0], sum[1] + block[1]]);
        if self.necks.is_empty() {
            return [product, strain];
        }
        add_reactions(&self.necks, z, 1.0, s);
        [block_sums(z.iter().zip(&*s).map(|(&z, &s)| dot(z, s))), strain]
    }

    /// The vectors of the next iteration; returns `r . z`.
    fn update(&self, all: Vectors<'_>, share: f64, step: f64) -> f64 {
        let n = all.u.len();
        let blocks = all.split();
        let one = |(block, all): (usize, Vectors<'_>)| {
            let mut product = 0.0;
            for at in 0..all.u.len() {
                let p = add(all.z[at], scale(all.p[at], share));
                let w = add(all.s[at], scale(all.w[at], share));
                let r = sub(all.r[at], scale(w, step));
                let z = self.precondition(block * BLOCK + at, r);
                all.u[at] = add(all.u[at], scale(p, step));
                (all.p[at], all.w[at], all.r[at], all.z[at]) = (p, w, r, z);
                product += dot(r, z);
            }
            product
        };
        let sums: Vec<f64> = if n < PARALLEL {
            blocks.into_iter().enumerate().map(one).collect()
        } else {
            blocks.into_par_iter().enumerate().map(one).collect()
        };
        sums.iter().sum()
    }
}

/// Solution, residual, direction, matrix times direction, preconditioned residual, matrix times that.
struct Vectors<'a> {
    u: &'a mut [Vec3],
    r: &'a mut [Vec3],
    p: &'a mut [Vec3],
    w: &'a mut [Vec3],
    z: &'a mut [Vec3],
    s: &'a [Vec3],
}

impl<'a> Vectors<'a> {
    fn split(self) -> Vec<Vectors<'a>> {
        let u = self.u.chunks_mut(BLOCK);
        let r = self.r.chunks_mut(BLOCK);
        let p = self.p.chunks_mut(BLOCK);
        let w = self.w.chunks_mut(BLOCK);
        let z = self.z.chunks_mut(BLOCK);
        let s = self.s.chunks(BLOCK);
        u.zip(r)
            .zip(p.zip(w))
            .zip(z.zip(s))
            .map(|(((u, r), (p, w)), (z, s))| Vectors { u, r, p, w, z, s })
            .collect()
    }
}

/// A sum over particles, block by block.
fn block_sums(values: impl Iterator<Item = f64>) -> f64 {
    let (mut total, mut block, mut count) = (0.0, 0.0, 0);
    for value in values {
        block += value;
        count += 1;
        if count == BLOCK {
            total += block;
            (block, count) = (0.0, 0);
        }
    }
    total + block
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain between two walls, the first particle pulled: the closed form of springs in a row.
    #[test]
    fn chain_of_springs_gives_way_as_hookes_law_says() {
        let n = 40;
        let (k, tie) = (3.0, 7.0);
        let springs: Vec<Spring> = (1..n as u32)
            .map(|i| Spring {
                ends: [i - 1, i],
                normal: [0.6, 0.0, 0.8],
                stiffness: k,
                length: 1.0,
            })
            .collect();
        let mut ground = vec![[1e-9; 3]; n];
        ground[n - 1] = [tie; 3];
        let network = Network::new(&springs, ground, false);
        let mut force = vec![ZERO; n];
        force[0] = [6.0, 0.0, 8.0];
        let solution = network.solve(&force, 0.0, 1e-10);
        for (i, moved) in solution.moves.iter().enumerate() {
            let expected = 10.0 * ((n - 1 - i) as f64 / k + 1.0 / tie);
            let along = dot(*moved, [0.6, 0.0, 0.8]);
            assert!((along / expected - 1.0).abs() < 1e-6, "{i}: {along} {expected}");
        }
    }

    #[test]
    fn strain_of_a_lattice_is_the_force_over_the_stiffness() {
        // One particle with its own images: no displacement, all strain.
        let spring = |normal: Vec3| Spring { ends: [0, 1], normal, stiffness: 5.0, length: 2.0 };
        let springs = [spring([1.0, 0.0, 0.0]), spring([-1.0, 0.0, 0.0])];
        let network = Network::new(&springs, vec![[1e-3; 3]; 2], true);
        let solution = network.solve(&[ZERO; 2], 8.0, 1e-12);
        assert!((solution.strain / (8.0 / (2.0 * 5.0 * 4.0)) - 1.0).abs() < 1e-6);
        assert!(solution.moves.iter().flatten().all(|u| u.abs() < 1e-9), "{solution:?}");
    }

    #[test]
    fn any_number_of_threads_solves_to_the_same_bits() {
        let n = 2 * PARALLEL;
        let springs: Vec<Spring> = (1..n as u32)
            .map(|i| Spring {
                ends: [i / 2, i],
                normal: [[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.6, 0.0, -0.8]][i as usize % 3],
                stiffness: 1.0 + f64::from(i % 17),
                length: 1.0,
            })
            .collect();
        let network = Network::new(&springs, vec![[0.1; 3]; n], true);
        let force: Vec<Vec3> = (0..n).map(|i| [(i % 7) as f64 - 3.0, 1.0, -0.5]).collect();
        let solve = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("pool").install(|| network.solve(&force, 1.0, 1e-8))
        };
        let one = solve(1);
        assert!(one.iterations > 10, "{}", one.iterations);
        assert!(solve(2) == one);
        assert!(solve(5) == one);
    }
}
