//! Random packings of a given density.
//!
//! Particles are thrown into the box and pushed apart: the energy `sum overlap^2 / 2` of soft spheres
//! is brought to zero by FIRE (E. Bitzek et al., Phys. Rev. Lett. 97 (2006) 170201). Below the
//! density of random close packing that succeeds; near it (0.64 for equal spheres, C.S. O'Hern et
//! al., Phys. Rev. E 68 (2003) 011306) the particles jam.

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, LogNormal};

use serde::{Deserialize, Serialize};

use super::error::{BedError, field, within};
use super::neighbours::{NeighbourList, image_of, index_of, sort_and_list};
use super::particles::Particles;
use super::region::{Region, Wall};
use super::vec3::{Vec3, ZERO, add, dot, norm, scale, sub};

/// Distribution of radii; in a scene file `radii = { equal = {..} }`, `{ log-normal = {..} }` or
/// `{ histogram = {..} }`.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Radii {
    /// Equal radii.
    Equal {
        /// The radius \[m\].
        radius_m: f64,
    },
    /// Log-normal by number: `ln R` is normal.
    LogNormal {
        /// The radius that half of the particles are below \[m\].
        median_m: f64,
        /// Standard deviation of `ln R`, 0 to 1.
        sigma: f64,
    },
    /// Uniform within the bins of a histogram by number.
    Histogram {
        /// Edges of the bins \[m\], rising.
        edges_m: Vec<f64>,
        /// Weights of the bins, one less than the edges.
        weights: Vec<f64>,
    },
}

impl Radii {
    /// Draws radii; the same seed gives the same bits.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`].
    pub fn draw(&self, count: usize, seed: u64) -> Result<Vec<f64>, BedError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1);
        let metres = "give the radius in metres, 1e-9 to 1e3";
        match self {
            Self::Equal { radius_m } => {
                within("radii.radius_m", *radius_m, 1e-9, 1e3, metres)?;
                Ok(vec![*radius_m; count])
            }
            Self::LogNormal { median_m, sigma } => {
                within("radii.median_m", *median_m, 1e-9, 1e3, metres)?;
                within("radii.sigma", *sigma, 0.0, 1.0, "use 0 to 1")?;
                let law = LogNormal::new(median_m.ln(), *sigma)
                    .map_err(|_| field("radii.sigma", sigma, "use 0 to 1"))?;
                Ok((0..count).map(|_| law.sample(&mut random)).collect())
            }
            Self::Histogram { edges_m, weights } => {
                let fits = weights.len() + 1 == edges_m.len() && !weights.is_empty();
                if !fits || !edges_m.is_sorted_by(|a, b| a < b) || edges_m[0] < 1e-9 {
                    let remedy = "give rising edges in metres, 1e-9 or more, one more than weights";
                    return Err(field("radii.edges_m", format!("{edges_m:?}"), remedy));
                }
                let total: f64 = weights.iter().sum();
                if weights.iter().any(|&weight| weight < 0.0 || weight.is_nan())
                    || !(total > 0.0 && total.is_finite())
                {
                    let remedy = "weights must not be negative, and not all zero";
                    return Err(field("radii.weights", format!("{weights:?}"), remedy));
                }
                let mut draw = || {
                    let mut left = random.random::<f64>() * total;
                    let bin = weights.iter().position(|&weight| {
                        left -= weight;
                        left < 0.0
                    });
                    // Rounding may leave a little beyond the last bin.
                    let bin = bin.unwrap_or(weights.len() - 1);
                    edges_m[bin] + random.random::<f64>() * (edges_m[bin + 1] - edges_m[bin])
                };
                Ok((0..count).map(|_| draw()).collect())
            }
        }
    }
}

/// A random packing of spheres without overlaps in a box, whose volume sets the relative density.
///
/// Returns the centres, in the order of the radii. Open sides count as walls.
///
/// # Errors
///
/// [`BedError::PackingDensity`] where the particles jam before they are free of overlaps.
pub fn random_packing(
    region: &Region,
    radius_m: &[f64],
    seed: u64,
) -> Result<Vec<[f64; 3]>, BedError> {
    let wished = density(region, radius_m);
    let particles = radius_m.len();
    // No packing is denser than the densest lattice.
    if wished < 0.745 {
        let mut soft = Soft::thrown(region, radius_m, seed)?;
        if soft.relax(PADDING, 0.5 * PADDING, 1e-3) {
            return Ok(soft.positions_m());
        }
        let reached = wished * (1.0 - 1.5 * soft.mean_overlap);
        return Err(BedError::PackingDensity { wished, reached, particles });
    }
    Err(BedError::PackingDensity { wished, reached: 0.64, particles })
}

/// A jammed packing: particles that hold each other, with overlaps of at most `overlap` mean radii. Returns
/// the box and the centres.
///
/// Particles thrown into a box somewhat too small are brought to balance, and the box is enlarged
/// until hardly any overlap is left, as by C.S. O'Hern et al., Phys. Rev. E 68 (2003) 011306.
///
/// # Errors
///
/// [`BedError::PeriodicSideTooShort`], [`BedError::Field`].
pub fn jammed_packing(
    region: &Region,
    radius_m: &[f64],
    overlap: f64,
    seed: u64,
) -> Result<(Region, Vec<[f64; 3]>), BedError> {
    within("overlap", overlap, 1e-6, 0.1, "use 1e-6 to 0.1 radii")?;
    let sized = |target: f64| {
        let factor = (density(region, radius_m) / target).cbrt();
        Region { size_m: region.size_m.map(|size| size * factor), ..*region }
    };
    let mut target = 0.65;
    let mut jammed = Soft::thrown(&sized(target), radius_m, seed)?;
    while jammed.relax(0.0, 1e-5, ROUGH) && target < 0.95 {
        target += 0.02;
        jammed.resize(&sized(target));
    }
    // Share of the overlaps that the next enlargement leaves.
    const LEAST: f64 = 0.15;
    let mut left: f64 = LEAST;
    while left < 0.9999 {
        if jammed.largest_overlap <= overlap {
            let held = !jammed.relax(0.0, 0.02 * overlap, BALANCE);
            if held && jammed.largest_overlap <= overlap {
                break;
            }
        }
        let wished = left.max((0.6 * overlap / jammed.largest_overlap).min(0.9));
        let next = target * (1.0 - 1.5 * jammed.mean_overlap * (1.0 - wished));
        let mut soft = jammed.clone();
        soft.resize(&sized(next));
        if soft.relax(0.0, 0.02 * overlap, ROUGH) {
            // Enlarged too far: the particles no longer hold each other.
            left = 0.5 * (1.0 + left);
        } else {
            (jammed, target) = (soft, next);
            left = (0.7 * left).max(LEAST);
        }
    }
    Ok((jammed.region_m(), jammed.positions_m()))
}

fn density(region: &Region, radius_m: &[f64]) -> f64 {
    let solid: f64 = radius_m.iter().map(|radius| radius.powi(3)).sum();
    4.0 / 3.0 * std::f64::consts::PI * solid / region.volume_m3()
}

/// Gap, over the mean radius, that the particles of a packing are pushed apart to.
const PADDING: f64 = 1e-3;

/// Net force on a particle, over a mean contact force, that counts as balanced: on the way, and at the end.
const ROUGH: f64 = 0.03;
const BALANCE: f64 = 0.01;

/// Soft spheres; lengths in mean radii.
#[derive(Clone)]
struct Soft {
    unit_m: f64,
    region: Region,
    walls: Vec<Wall>,
    particles: Particles,
    list: NeighbourList,
    listed: Vec<Vec3>,
    force: Vec<Vec3>,
    padding: f64,
    largest_overlap: f64,
    mean_overlap: f64,
}

/// Skin of the list, in mean radii.
const SKIN: f64 = 0.4;

impl Soft {
    fn thrown(region: &Region, radius_m: &[f64], seed: u64) -> Result<Self, BedError> {
        region.check()?;
        let count = radius_m.len();
        if count == 0 {
            return Err(field("particles.count", 0, "pack at least one particle"));
        }
        let unit_m = radius_m.iter().sum::<f64>() / count as f64;
        let radii: Vec<f64> = radius_m.iter().map(|radius| radius / unit_m).collect();
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let needed = 2.0 * (2.0 * largest + SKIN);
        for axis in 0..3 {
            let size_m = region.size_m[axis];
            if region.sides[axis] == super::Side::Periodic && size_m <= needed * unit_m {
                return Err(BedError::PeriodicSideTooShort {
                    axis,
                    size_m,
                    needed_m: needed * unit_m,
                });
            }
        }
        let sides = region.sides.map(|side| match side {
            super::Side::Periodic => side,
            _ => super::Side::Walls,
        });
        let region = Region { size_m: region.size_m.map(|size| size / unit_m), sides };
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let position = radii
            .iter()
            .map(|&radius| {
                [0, 1, 2].map(|axis| {
                    let size = region.size_m[axis];
                    let margin = if sides[axis] == super::Side::Walls {
                        radius.min(0.5 * size)
                    } else {
                        0.0
                    };
                    margin + random.random::<f64>() * (size - 2.0 * margin)
                })
            })
            .collect();
        Ok(Self {
            unit_m,
            walls: region.walls(),
            region,
            particles: Particles::new(position, vec![ZERO; count], radii, 1.0, false),
            list: NeighbourList::default(),
            listed: Vec::new(),
            force: vec![ZERO; count],
            padding: 0.0,
            largest_overlap: 0.0,
            mean_overlap: 0.0,
        })
    }

    fn region_m(&self) -> Region {
        Region { size_m: self.region.size_m.map(|size| size * self.unit_m), ..self.region }
    }

    fn resize(&mut self, region_m: &Region) {
        let factor = region_m.size_m[0] / self.unit_m / self.region.size_m[0];
        for position in &mut self.particles.position_m {
            *position = scale(*position, factor);
        }
        self.region.size_m = region_m.size_m.map(|size| size / self.unit_m);
        self.walls = self.region.walls();
        self.listed.clear();
    }

    fn positions_m(&self) -> Vec<Vec3> {
        let mut positions = vec![ZERO; self.particles.len()];
        for (position, &id) in self.particles.position_m.iter().zip(&self.particles.id) {
            let mut position = *position;
            self.region.wrap(&mut position);
            positions[id as usize] = scale(position, self.unit_m);
        }
        positions
    }

    fn update_list(&mut self) {
        let limit = 0.25 * SKIN * SKIN;
        let moved = |(now, then): (&Vec3, &Vec3)| {
            let d = sub(*now, *then);
            dot(d, d) > limit
        };
        let positions = &self.particles.position_m;
        if self.listed.is_empty() || positions.iter().zip(&self.listed).any(moved) {
            let reach = SKIN + self.padding;
            self.list = sort_and_list(&mut self.particles, &self.region, reach).0;
            self.listed.clone_from(&self.particles.position_m);
        }
    }

    /// Forces, and returns the energy.
    fn evaluate(&mut self) -> f64 {
        self.update_list();
        let shifts = self.region.image_shifts();
        let (position, radius) = (&self.particles.position_m, &self.particles.radius_m);
        self.force.fill(ZERO);
        let (mut energy, mut sum, mut count) = (0.0, 0.0, 0u32);
        let mut largest: f64 = 0.0;
        for i in 0..position.len() {
            for k in self.list.row(i) {
                let entry = self.list.other[k];
                let j = index_of(entry);
                let d = add(sub(position[i], position[j]), shifts[image_of(entry)]);
                let reach = radius[i] + radius[j] + self.padding;
                let squared = dot(d, d);
                if squared >= reach * reach {
                    continue;
                }
                let distance = squared.sqrt().max(1e-12);
                let overlap = reach - distance;
                let push = scale(d, overlap / distance);
                self.force[i] = add(self.force[i], push);
                self.force[j] = sub(self.force[j], push);
                energy += 0.5 * overlap * overlap;
                sum += overlap;
                count += 1;
                largest = largest.max(overlap);
            }
            for wall in &self.walls {
                let overlap = radius[i] + 0.5 * self.padding - wall.distance(position[i]);
                if overlap > 0.0 {
                    self.force[i][wall.axis] += wall.inward * overlap;
                    energy += 0.5 * overlap * overlap;
                    largest = largest.max(overlap);
                }
            }
        }
        self.largest_overlap = largest;
        self.mean_overlap = sum / f64::from(count.max(1));
        energy
    }

    /// Pushes the particles apart, to a gap of `padding`, until no overlap with it exceeds
    /// `tolerance`. False where they jam: no net force exceeds `balance` mean contact forces.
    fn relax(&mut self, padding: f64, tolerance: f64, balance: f64) -> bool {
        if padding != self.padding {
            self.padding = padding;
            self.listed.clear();
        }
        let (mut step, mut mixing, mut downhill) = (0.2, 0.1, 0);
        // The velocity goes through the re-sorting of the list with its particle.
        self.particles.half_velocity.fill(ZERO);
        for iteration in 0..20_000u32 {
            let _energy = self.evaluate();
            if self.largest_overlap <= tolerance {
                return true;
            }
            let velocity = &mut self.particles.half_velocity;
            let (mut power, mut vv, mut ff, mut fastest) = (0.0, 0.0, 0.0, 0.0f64);
            for (v, f) in velocity.iter().zip(&self.force) {
                power += dot(*v, *f);
                vv += dot(*v, *v);
                ff += dot(*f, *f);
                fastest = fastest.max(dot(*f, *f));
            }
            // Balanced though pressed: the largest net force is small against a contact force.
            if iteration > 50 && fastest.sqrt() < balance * self.mean_overlap {
                return false;
            }
            if power > 0.0 {
                let share = mixing * (vv / ff).sqrt();
                for (v, f) in velocity.iter_mut().zip(&self.force) {
                    *v = add(scale(*v, 1.0 - mixing), scale(*f, share));
                }
                downhill += 1;
                if downhill > 5 {
                    step = f64::min(step * 1.1, 0.6);
                    mixing *= 0.99;
                }
            } else {
                velocity.fill(ZERO);
                step *= 0.5;
                mixing = 0.1;
                downhill = 0;
            }
            let positions = &mut self.particles.position_m;
            for ((r, v), f) in positions.iter_mut().zip(velocity.iter_mut()).zip(&self.force) {
                *v = add(*v, scale(*f, step));
                let speed = norm(*v);
                let moved = scale(*v, step * (0.3 / (step * speed)).min(1.0));
                *r = add(*r, moved);
            }
        }
        false
    }
}
