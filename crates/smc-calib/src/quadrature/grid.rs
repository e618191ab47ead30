//! A regular grid in stretched coordinates, the density on it, and the edges where simulations begin to fail.

use crate::SimError;
use crate::target::Target;
use rayon::prelude::*;
use std::collections::HashMap;

/// A box in stretched whitened coordinates: z = centre + factor sinh(v), v between `lower` and `upper`.
pub(super) struct Frame {
    pub d: usize,
    pub centre: Vec<f64>,
    pub factor: Vec<f64>,
    pub ln_det: f64,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
}

/// Log densities on a grid; minus infinity where left out.
pub(super) struct Grid {
    pub n: usize,
    pub values: Vec<f64>,
}

/// The place of a grid point along one axis; the last axis runs fastest.
pub(super) fn digit(index: usize, axis: usize, n: usize, d: usize) -> usize {
    index / n.pow((d - 1 - axis) as u32) % n
}

/// The edge between a live cell and a failing neighbour.
struct Crossing {
    cell: usize,
    axis: usize,
    /// Whether the neighbour is the next one up the axis.
    up: bool,
    /// Distance of the edge from the live cell's centre, in cells.
    reach: f64,
}

impl Frame {
    /// The whole prior: 8.5 standard deviations to either side.
    pub(super) fn of_prior(d: usize) -> Self {
        let mut identity = vec![0.0; d * d];
        (0..d).for_each(|i| identity[i * d + i] = 1.0);
        let reach = 8.5f64.asinh();
        Self {
            d,
            centre: vec![0.0; d],
            factor: identity,
            ln_det: 0.0,
            lower: vec![-reach; d],
            upper: vec![reach; d],
        }
    }

    /// Size of a cell along each axis of a grid of n cells.
    pub(super) fn steps(&self, n: usize) -> Vec<f64> {
        (0..self.d).map(|a| (self.upper[a] - self.lower[a]) / n as f64).collect()
    }

    fn v(&self, axis: usize, i: usize, n: usize) -> f64 {
        self.lower[axis] + (self.upper[axis] - self.lower[axis]) * (i as f64 + 0.5) / n as f64
    }

    /// Stretched coordinates of a grid point.
    pub(super) fn point(&self, index: usize, n: usize) -> [f64; 3] {
        let mut v = [0.0; 3];
        for (a, v) in v.iter_mut().enumerate().take(self.d) {
            *v = self.v(a, digit(index, a, n, self.d), n);
        }
        v
    }

    /// Normal scores at stretched coordinates; returns the log of the stretch's Jacobian.
    pub(super) fn place(&self, v: &[f64], z: &mut [f64]) -> f64 {
        let d = self.d;
        for i in 0..d {
            z[i] =
                self.centre[i] + (0..=i).map(|j| self.factor[i * d + j] * v[j].sinh()).sum::<f64>();
        }
        v[..d].iter().map(|v| v.cosh().ln()).sum()
    }

    /// Normal scores of a grid point; returns the log of the stretch's Jacobian.
    pub(super) fn z(&self, index: usize, n: usize, z: &mut [f64]) -> f64 {
        self.place(&self.point(index, n), z)
    }

    /// Log of likelihood times prior times Jacobian at stretched coordinates; minus infinity where there is none.
    fn ln_density(
        &self,
        target: &dyn Target,
        v: &[f64],
        kept: &mut [f64],
    ) -> Result<f64, SimError> {
        let mut z = [0.0; 3];
        let z = &mut z[..self.d];
        let ln_jacobian = self.place(v, z);
        match target.ln_likelihood(z, kept) {
            Ok(l) if l.is_nan() => Ok(f64::NEG_INFINITY),
            Ok(l) => Ok(ln_jacobian + l + crate::normal::ln_prior(z)),
            Err(e) if e.is_recoverable() => Ok(f64::NEG_INFINITY),
            Err(e) => Err(e),
        }
    }

    /// Log of likelihood times prior times Jacobian on a grid of n cells per axis, where `wanted`.
    pub(super) fn evaluate(
        &self,
        target: &dyn Target,
        n: usize,
        wanted: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<(Grid, usize), SimError> {
        let d = self.d;
        let cells = n.pow(d as u32);
        let results: Vec<(Vec<f64>, usize)> = (0..cells.div_ceil(1024))
            .into_par_iter()
            .map(|b| {
                let mut kept = vec![0.0; target.kept()];
                let mut count = 0;
                let values = (b * 1024..((b + 1) * 1024).min(cells))
                    .map(|index| {
                        if !wanted(index) {
                            return Ok(f64::NEG_INFINITY);
                        }
                        count += 1;
                        self.ln_density(target, &self.point(index, n), &mut kept)
                    })
                    .collect::<Result<Vec<f64>, SimError>>()?;
                Ok((values, count))
            })
            .collect::<Result<Vec<_>, SimError>>()?;
        let evaluations = results.iter().map(|r| r.1).sum();
        Ok((Grid { n, values: results.into_iter().flat_map(|r| r.0).collect() }, evaluations))
    }

    /// Lets every live cell beside a failing one count as far as the edge between them reaches; returns the number
    /// of evaluations.
    pub(super) fn resolve_edges(
        &self,
        target: &dyn Target,
        grid: &mut Grid,
        negligible: f64,
    ) -> Result<usize, SimError> {
        const BISECTIONS: i32 = 7;
        let (d, n) = (self.d, grid.n);
        let least = grid.top() - negligible;
        let mut crossings: Vec<Crossing> = Vec::new();
        for cell in (0..grid.values.len()).filter(|i| grid.values[*i] > least) {
            for axis in 0..d {
                let (at, stride) = (digit(cell, axis, n, d), n.pow((d - 1 - axis) as u32));
                for (up, exists) in [(false, at > 0), (true, at + 1 < n)] {
                    let next = if up { cell + stride } else { cell.wrapping_sub(stride) };
                    if exists && grid.values[next] == f64::NEG_INFINITY {
                        crossings.push(Crossing { cell, axis, up, reach: 0.0 });
                    }
                }
            }
        }
        crossings.par_iter_mut().with_min_len(64).try_for_each_init(
            || vec![0.0; target.kept()],
            |kept, c| {
                let from = self.point(c.cell, n);
                let step = (self.upper[c.axis] - self.lower[c.axis]) / n as f64;
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..BISECTIONS {
                    c.reach = 0.5 * (low + high);
                    let mut v = from;
                    v[c.axis] += if c.up { c.reach * step } else { -c.reach * step };
                    let alive = self.ln_density(target, &v, kept)? > f64::NEG_INFINITY;
                    if alive { low = c.reach } else { high = c.reach }
                }
                c.reach = 0.5 * (low + high);
                Ok(())
            },
        )?;
        // Where the edge lies in every column of cells along an axis.
        let column = |c: &Crossing, cell: usize| {
            (c.axis, c.up, cell - digit(cell, c.axis, n, d) * n.pow((d - 1 - c.axis) as u32))
        };
        let height = |c: &Crossing| {
            digit(c.cell, c.axis, n, d) as f64 + if c.up { c.reach } else { -c.reach }
        };
        let mut heights: HashMap<_, Vec<f64>> = HashMap::new();
        for c in &crossings {
            heights.entry(column(c, c.cell)).or_default().push(height(c));
        }
        let mut share: HashMap<usize, f64> = HashMap::new();
        for c in &crossings {
            let own = height(c);
            let nearest = |cell: usize| {
                let rises = heights.get(&column(c, cell))?.iter().map(|h| h - own);
                rises.min_by(|a, b| a.abs().total_cmp(&b.abs()))
            };
            let steepest = (0..d).filter(|b| *b != c.axis).all(|b| {
                let (at, stride) = (digit(c.cell, b, n, d), n.pow((d - 1 - b) as u32));
                let before = if at > 0 { nearest(c.cell - stride) } else { None };
                let after = if at + 1 < n { nearest(c.cell + stride) } else { None };
                let slope = match (before, after) {
                    (Some(before), Some(after)) => 0.5 * (after - before),
                    (before, after) => before.or(after).unwrap_or(0.0),
                };
                slope.abs() <= 1.0
            });
            if steepest {
                *share.entry(c.cell).or_insert(1.0) += c.reach - 0.5;
            }
        }
        for (cell, share) in share {
            grid.values[cell] += share.max(f64::MIN_POSITIVE).ln();
        }
        Ok(crossings.len() * BISECTIONS as usize)
    }

    /// Moments of a grid: log integral, mean and covariance of z; none where nothing is alive.
    pub(super) fn moments(&self, grid: &Grid) -> Option<(f64, Vec<f64>, Vec<f64>)> {
        let d = self.d;
        let top = grid.top();
        if top == f64::NEG_INFINITY {
            return None;
        }
        let (mut total, mut mean, mut second) = (0.0, vec![0.0; d], vec![0.0; d * d]);
        let mut z = vec![0.0; d];
        for (index, v) in grid.values.iter().enumerate() {
            let w = (v - top).exp();
            if w == 0.0 {
                continue;
            }
            self.z(index, grid.n, &mut z);
            total += w;
            for i in 0..d {
                let x = z[i] - self.centre[i];
                mean[i] += w * x;
                for j in 0..d {
                    second[i * d + j] += w * x * (z[j] - self.centre[j]);
                }
            }
        }
        for i in 0..d {
            mean[i] /= total;
        }
        for i in 0..d {
            for j in 0..d {
                second[i * d + j] = second[i * d + j] / total - mean[i] * mean[j];
            }
        }
        for i in 0..d {
            mean[i] += self.centre[i];
        }
        Some((top + total.ln() + self.ln_cell(grid.n), mean, second))
    }

    pub(super) fn ln_cell(&self, n: usize) -> f64 {
        self.ln_det
            + (0..self.d).map(|a| ((self.upper[a] - self.lower[a]) / n as f64).ln()).sum::<f64>()
    }
}

impl Grid {
    /// Largest log density; minus infinity where nothing is alive.
    pub(super) fn top(&self) -> f64 {
        self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Cells of log density above a threshold and their neighbours, in `d` dimensions.
    pub(super) fn neighbourhood(&self, d: usize, threshold: f64) -> Vec<bool> {
        let n = self.n;
        let mut alive: Vec<bool> = self.values.iter().map(|v| *v > threshold).collect();
        let mut stride = 1;
        for _ in 0..d {
            let before = alive.clone();
            for (i, a) in alive.iter_mut().enumerate() {
                let at = i / stride % n;
                *a |= (at > 0 && before[i - stride]) || (at + 1 < n && before[i + stride]);
            }
            stride *= n;
        }
        alive
    }
}
