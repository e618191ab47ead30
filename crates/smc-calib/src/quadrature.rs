//! Brute-force integration for up to three parameters: the reference that the sampler is held against.
//!
//! The trapezoidal rule in v, where `z = centre + factor sinh(v)`: normal scores whitened by the posterior's own
//! mean and covariance, and stretched so that a regular grid is dense in the core and still reaches far tails.
//! First the mass is located: a grid over the whole prior gives a mean and a covariance, which give the next
//! grid, until the covariance stands still and no mass touches the box. Then the grid is halved, only where there is
//! mass, until no moment moves; the last move is the error estimate.
//!
//! Where simulations fail the density ends at an edge, inside a cell. A plain sum would be off by up to half a cell there,
//! and halving need not show it. The edge is found by bisection between a live cell and a failing neighbour, and the live
//! cell counts as far as the edge reaches: along the axis that the edge is steepest to (the height functions of
//! C. W. Hirt, B. D. Nichols, J. Comput. Phys. 39 (1981) 201), so that it is counted once.

use crate::cholesky::{cholesky, packed_inverse};
use crate::joint::{JointLikelihood, JointProblem};
use crate::target::{CurveTarget, Target};
use crate::{CalibrateError, Problem, SimError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// Log density below the peak at which a cell is left out: a ten-thousandth of the tolerance, since what is left
/// out may be many times wider than the peak.
fn negligible(tolerance: f64) -> f64 {
    (1e4 / tolerance.clamp(1e-12, 1.0)).ln()
}

/// Posterior moments by quadrature, in the priors' coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quadrature {
    /// Means.
    pub mean: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
    /// Correlation matrix, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Log evidence.
    pub log_evidence: f64,
    /// Marginal quantiles per parameter at [`PROBABILITIES`].
    pub quantiles: Vec<Vec<f64>>,
    /// Estimated error: the last move of a mean or relative sd in standard deviations, or of the log evidence, whichever is largest.
    pub error: f64,
    /// Likelihood evaluations.
    pub evaluations: usize,
}

/// Probabilities of [`Quadrature::quantiles`].
pub const PROBABILITIES: [f64; 7] = [0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975];

/// How far to refine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadratureSettings {
    /// Refine until nothing moves by more than this (posterior sds, relative sd, log evidence).
    pub tolerance: f64,
    /// Most points per dimension.
    pub max_points: usize,
}

impl Default for QuadratureSettings {
    fn default() -> Self {
        // A fifth of what 16 384 samples leave; PA12, the costliest of the paper's curves, takes 3 million evaluations.
        Self { tolerance: 1e-3, max_points: 192 }
    }
}

/// Integrates a problem with up to three parameters.
///
/// # Errors
/// Noise that does not fit, more than three parameters, a fatal simulator error, or zero evidence.
pub fn quadrature(
    problem: &Problem<'_>,
    settings: &QuadratureSettings,
) -> Result<Quadrature, CalibrateError> {
    quadrature_joint(&problem.into(), settings)
}

/// Posterior moments and evidence of a problem with several groups of observations.
///
/// # Errors
/// As [`quadrature`].
pub fn quadrature_joint(
    problem: &JointProblem<'_>,
    settings: &QuadratureSettings,
) -> Result<Quadrature, CalibrateError> {
    let likelihood = JointLikelihood::new(problem)?;
    let target = CurveTarget::new(problem, &likelihood, 1);
    let coordinate = |j: usize, z: f64| {
        let prior = &problem.parameters[j].prior;
        prior.to_coordinate(prior.from_z(z))
    };
    integrate(&target, &coordinate, settings)
}

/// A box in stretched whitened coordinates: z = centre + factor sinh(v), v between `lower` and `upper`.
struct Frame {
    d: usize,
    centre: Vec<f64>,
    factor: Vec<f64>,
    ln_det: f64,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// Log densities on a grid; minus infinity where left out.
struct Grid {
    n: usize,
    values: Vec<f64>,
}

/// The place of a grid point along one axis; the last axis runs fastest.
fn digit(index: usize, axis: usize, n: usize, d: usize) -> usize {
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
    fn v(&self, axis: usize, i: usize, n: usize) -> f64 {
        self.lower[axis] + (self.upper[axis] - self.lower[axis]) * (i as f64 + 0.5) / n as f64
    }

    /// Stretched coordinates of a grid point.
    fn point(&self, index: usize, n: usize) -> [f64; 3] {
        let mut v = [0.0; 3];
        for (a, v) in v.iter_mut().enumerate().take(self.d) {
            *v = self.v(a, digit(index, a, n, self.d), n);
        }
        v
    }

    /// Normal scores at stretched coordinates; returns the log of the stretch's Jacobian.
    fn place(&self, v: &[f64], z: &mut [f64]) -> f64 {
        let d = self.d;
        for i in 0..d {
            z[i] =
                self.centre[i] + (0..=i).map(|j| self.factor[i * d + j] * v[j].sinh()).sum::<f64>();
        }
        v[..d].iter().map(|v| v.cosh().ln()).sum()
    }

    /// Normal scores of a grid point; returns the log of the stretch's Jacobian.
    fn z(&self, index: usize, n: usize, z: &mut [f64]) -> f64 {
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
            Ok(l) => {
                Ok(ln_jacobian + l + z.iter().map(|z| crate::normal::ln_density(*z)).sum::<f64>())
            }
            Err(e) if e.is_recoverable() => Ok(f64::NEG_INFINITY),
            Err(e) => Err(e),
        }
    }

    /// Log of likelihood times prior times Jacobian on a grid of n cells per axis, where `wanted`.
    fn evaluate(
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
    fn resolve_edges(
        &self,
        target: &dyn Target,
        grid: &mut Grid,
        negligible: f64,
    ) -> Result<usize, SimError> {
        const BISECTIONS: i32 = 7;
        let (d, n) = (self.d, grid.n);
        let least = grid.values.iter().copied().fold(f64::NEG_INFINITY, f64::max) - negligible;
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

    /// Moments of a grid: log integral, mean and covariance of z, extent in u of what is not negligible.
    fn moments(&self, grid: &Grid) -> Option<(f64, Vec<f64>, Vec<f64>)> {
        let d = self.d;
        let top = grid.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
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

    fn ln_cell(&self, n: usize) -> f64 {
        self.ln_det
            + (0..self.d).map(|a| ((self.upper[a] - self.lower[a]) / n as f64).ln()).sum::<f64>()
    }
}

/// Integrates a target of up to three coordinates; moments are those of `coordinate(j, z_j)`.
///
/// # Errors
/// More than three coordinates, a fatal simulator error, or zero evidence.
pub fn integrate(
    target: &dyn Target,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    settings: &QuadratureSettings,
) -> Result<Quadrature, CalibrateError> {
    let d = target.dimension();
    if !(1..=3).contains(&d) {
        return Err(CalibrateError::Setting {
            setting: "number of parameters of a quadrature",
            value: d as f64,
            range: "1 to 3",
        });
    }
    let mut evaluations = 0;
    let failed = |error: SimError| CalibrateError::ended_by(error, 0);
    let mut identity = vec![0.0; d * d];
    (0..d).for_each(|i| identity[i * d + i] = 1.0);
    let reach = 8.5f64.asinh();
    let mut frame = Frame {
        d,
        centre: vec![0.0; d],
        factor: identity,
        ln_det: 0.0,
        lower: vec![-reach; d],
        upper: vec![reach; d],
    };
    let coarse = [512, 128, 48][d - 1];
    for _ in 0..24 {
        let (grid, count) = frame.evaluate(target, coarse, &|_| true).map_err(failed)?;
        evaluations += count;
        let Some((_, mean, mut cov)) = frame.moments(&grid) else {
            return Err(CalibrateError::ZeroEvidence { simulations: evaluations });
        };
        let top = grid.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // A grid that sees one cell knows the covariance to no better than that cell.
        let step: Vec<f64> =
            (0..d).map(|a| (frame.upper[a] - frame.lower[a]) / coarse as f64).collect();
        for i in 0..d {
            cov[i * d + i] +=
                0.1 * (0..=i).map(|j| (frame.factor[i * d + j] * step[j]).powi(2)).sum::<f64>();
        }
        let Some(factor) = cholesky(&cov, d) else { break };
        let ln_det: f64 = (0..d).map(|i| factor[i * d + i].ln()).sum();
        let inverse = packed_inverse(&factor, d);
        let (mut lower, mut upper) = (vec![f64::INFINITY; d], vec![f64::NEG_INFINITY; d]);
        let mut z = vec![0.0; d];
        let mut touches = false;
        for (index, _) in grid
            .values
            .iter()
            .enumerate()
            .filter(|(_, v)| **v > top - negligible(settings.tolerance))
        {
            touches |= (0..d).any(|a| [0, coarse - 1].contains(&digit(index, a, coarse, d)));
            // What is alive ends somewhere inside the next cell of this grid.
            let v = frame.point(index, coarse);
            for corner in 0..1 << d {
                let mut v = v;
                for a in 0..d {
                    v[a] += if corner >> a & 1 == 1 { step[a] } else { -step[a] };
                }
                frame.place(&v, &mut z);
                let mut row = 0;
                for i in 0..d {
                    let u: f64 = (0..=i).map(|j| inverse[row + j] * (z[j] - mean[j])).sum();
                    row += i + 1;
                    lower[i] = lower[i].min(u);
                    upper[i] = upper[i].max(u);
                }
            }
        }
        for i in 0..d {
            (lower[i], upper[i]) = (lower[i].asinh() - 0.1, upper[i].asinh() + 0.1);
        }
        let moved = (ln_det - frame.ln_det).abs();
        frame = Frame { d, centre: mean, factor, ln_det, lower, upper };
        if moved < 0.02 * d as f64 && !touches {
            break;
        }
    }
    // Refine: halve the cells where there is mass.
    let mut n = coarse;
    let depth = negligible(settings.tolerance);
    let (mut grid, count) = frame.evaluate(target, n, &|_| true).map_err(failed)?;
    evaluations += count + frame.resolve_edges(target, &mut grid, depth).map_err(failed)?;
    let mut result = summarise(&frame, &grid, coordinate)
        .ok_or(CalibrateError::ZeroEvidence { simulations: evaluations })?;
    result.error = f64::INFINITY;
    let most = match d {
        1 => settings.max_points.max(16_384),
        2 => settings.max_points.max(1024),
        _ => settings.max_points,
    };
    while result.error > settings.tolerance && 2 * n <= most {
        let top = grid.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let near = alive_neighbourhood(&grid, d, top - depth);
        let fine = 2 * n;
        let parent = |index: usize| {
            let (mut rest, mut out, mut stride) = (index, 0, 1);
            for _ in 0..d {
                out += (rest % fine) / 2 * stride;
                rest /= fine;
                stride *= n;
            }
            out
        };
        let (mut next, count) =
            frame.evaluate(target, fine, &|index| near[parent(index)]).map_err(failed)?;
        evaluations += count + frame.resolve_edges(target, &mut next, depth).map_err(failed)?;
        let Some(mut refined) = summarise(&frame, &next, coordinate) else { break };
        refined.error = (0..d)
            .map(|j| {
                let m = (refined.mean[j] - result.mean[j]).abs() / refined.sd[j];
                m.max((refined.sd[j] / result.sd[j] - 1.0).abs())
            })
            .fold((refined.log_evidence - result.log_evidence).abs(), f64::max);
        result = refined;
        grid = next;
        n = fine;
    }
    result.evaluations = evaluations;
    Ok(result)
}

/// Cells above a threshold and their neighbours.
fn alive_neighbourhood(grid: &Grid, d: usize, threshold: f64) -> Vec<bool> {
    let n = grid.n;
    let mut alive: Vec<bool> = grid.values.iter().map(|v| *v > threshold).collect();
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

fn summarise(
    frame: &Frame,
    grid: &Grid,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
) -> Option<Quadrature> {
    let d = frame.d;
    let top = grid.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return None;
    }
    let alive: Vec<(usize, f64)> = grid
        .values
        .iter()
        .enumerate()
        .map(|(i, v)| (i, (v - top).exp()))
        .filter(|(_, w)| *w > 1e-17)
        .collect();
    let x: Vec<f64> = alive
        .par_iter()
        .flat_map_iter(|(index, _)| {
            let mut z = [0.0; 3];
            frame.z(*index, grid.n, &mut z[..d]);
            (0..d).map(move |j| coordinate(j, z[j]))
        })
        .collect();
    let total: f64 = alive.iter().map(|a| a.1).sum();
    let mut out = Quadrature {
        log_evidence: top + total.ln() + frame.ln_cell(grid.n),
        mean: vec![0.0; d],
        sd: vec![0.0; d],
        correlation: vec![vec![0.0; d]; d],
        ..Quadrature::default()
    };
    for ((_, w), x) in alive.iter().zip(x.chunks_exact(d)) {
        for j in 0..d {
            out.mean[j] += w / total * x[j];
        }
    }
    for ((_, w), x) in alive.iter().zip(x.chunks_exact(d)) {
        for i in 0..d {
            for j in 0..d {
                out.correlation[i][j] += w / total * (x[i] - out.mean[i]) * (x[j] - out.mean[j]);
            }
        }
    }
    for i in 0..d {
        out.sd[i] = out.correlation[i][i].sqrt();
    }
    for i in 0..d {
        for j in 0..d {
            out.correlation[i][j] /= out.sd[i] * out.sd[j];
        }
    }
    for j in 0..d {
        let mut order: Vec<(f64, f64)> =
            alive.iter().zip(x.chunks_exact(d)).map(|((_, w), x)| (x[j], w / total)).collect();
        order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Grid planes: points at the same coordinate count as one, half of it on either side.
        let mut planes: Vec<(f64, f64)> = Vec::new();
        for (x, w) in order {
            match planes.last_mut() {
                Some(last) if (x - last.0).abs() <= 1e-9 * out.sd[j] => last.1 += w,
                _ => planes.push((x, w)),
            }
        }
        let mut sum = 0.0;
        for plane in &mut planes {
            let w = plane.1;
            plane.1 = sum + 0.5 * w;
            sum += w;
        }
        let mut quantiles = Vec::new();
        for p in PROBABILITIES {
            let at = planes.partition_point(|plane| plane.1 < p).clamp(1, planes.len().max(2) - 1);
            let ((xa, pa), (xb, pb)) = (planes[at - 1], planes[at.min(planes.len() - 1)]);
            let t = if pb > pa { ((p - pa) / (pb - pa)).clamp(0.0, 1.0) } else { 0.0 };
            quantiles.push(xa + t * (xb - xa));
        }
        out.quantiles.push(quantiles);
    }
    Some(out)
}
