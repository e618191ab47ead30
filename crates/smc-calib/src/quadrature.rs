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

mod grid;

use self::grid::{Frame, Grid, digit};
use crate::cholesky::{cholesky, packed_inverse};
use crate::joint::{JointLikelihood, JointProblem};
use crate::target::{CurveTarget, Target};
use crate::weighted::Weighted;
use crate::{CalibrateError, Problem, SimError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

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
/// Same as [`quadrature`].
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

/// Integrates a target of up to three coordinates; moments are of `coordinate(j, z_j)`.
///
/// # Errors
/// More than three coordinates, a simulator that cannot run or is interrupted, or zero evidence.
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
    // Log density below the peak at which a cell is left out: a ten-thousandth of the tolerance, since what is left
    // out may be many times wider than the peak.
    let depth = (1e4 / settings.tolerance.clamp(1e-12, 1.0)).ln();
    let mut integration = Integration { target, depth, evaluations: 0 };
    let frame = integration.locate(d)?;
    integration.refine(&frame, coordinate, settings)
}

/// An integral in the making.
struct Integration<'a> {
    target: &'a dyn Target,
    /// Log density below the peak at which cells are left out.
    depth: f64,
    /// Likelihood evaluations so far.
    evaluations: usize,
}

impl Integration<'_> {
    /// The density on a grid of n cells per axis, where `wanted`.
    fn evaluate(
        &mut self,
        frame: &Frame,
        n: usize,
        wanted: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<Grid, CalibrateError> {
        let (grid, count) = frame.evaluate(self.target, n, wanted).map_err(ended)?;
        self.evaluations += count;
        Ok(grid)
    }

    /// The same, cells at the edge of what can be simulated counting as far as it reaches.
    fn evaluate_with_edges(
        &mut self,
        frame: &Frame,
        n: usize,
        wanted: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<Grid, CalibrateError> {
        let mut grid = self.evaluate(frame, n, wanted)?;
        self.evaluations +=
            frame.resolve_edges(self.target, &mut grid, self.depth).map_err(ended)?;
        Ok(grid)
    }

    fn zero_evidence(&self) -> CalibrateError {
        CalibrateError::ZeroEvidence { simulations: self.evaluations }
    }

    /// The box that holds the mass: from the whole prior to one whitened by the posterior's own covariance.
    fn locate(&mut self, d: usize) -> Result<Frame, CalibrateError> {
        let mut frame = Frame::of_prior(d);
        let coarse = COARSE[d - 1];
        for _ in 0..24 {
            let grid = self.evaluate(&frame, coarse, &|_| true)?;
            let Some((_, mean, mut cov)) = frame.moments(&grid) else {
                return Err(self.zero_evidence());
            };
            // A grid that sees one cell knows the covariance to no better than that cell.
            let step = frame.steps(coarse);
            for i in 0..d {
                cov[i * d + i] +=
                    0.1 * (0..=i).map(|j| (frame.factor[i * d + j] * step[j]).powi(2)).sum::<f64>();
            }
            let Some(factor) = cholesky(&cov, d) else { break };
            let ln_det: f64 = (0..d).map(|i| factor[i * d + i].ln()).sum();
            let inverse = packed_inverse(&factor, d);
            let (lower, upper, touches) = self.extent(&frame, &grid, &inverse, &mean);
            let moved = (ln_det - frame.ln_det).abs();
            frame = Frame { d, centre: mean, factor, ln_det, lower, upper };
            if moved < 0.02 * d as f64 && !touches {
                break;
            }
        }
        Ok(frame)
    }

    /// Ends of the cells that are not negligible, in the stretched coordinates of another centre and inverse factor; and
    /// whether they touch the box.
    fn extent(
        &self,
        frame: &Frame,
        grid: &Grid,
        inverse: &[f64],
        mean: &[f64],
    ) -> (Vec<f64>, Vec<f64>, bool) {
        let (d, n) = (frame.d, grid.n);
        let (top, step) = (grid.top(), frame.steps(n));
        let (mut lower, mut upper) = (vec![f64::INFINITY; d], vec![f64::NEG_INFINITY; d]);
        let mut z = vec![0.0; d];
        let mut touches = false;
        for (index, _) in grid.values.iter().enumerate().filter(|(_, v)| **v > top - self.depth) {
            touches |= (0..d).any(|a| [0, n - 1].contains(&digit(index, a, n, d)));
            // What is alive ends somewhere inside the next cell of this grid.
            let v = frame.point(index, n);
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
        (lower, upper, touches)
    }

    /// Halves the cells where there is mass until nothing moves.
    fn refine(
        &mut self,
        frame: &Frame,
        coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
        settings: &QuadratureSettings,
    ) -> Result<Quadrature, CalibrateError> {
        let d = frame.d;
        let mut n = COARSE[d - 1];
        let mut grid = self.evaluate_with_edges(frame, n, &|_| true)?;
        let mut result = summarise(frame, &grid, coordinate).ok_or_else(|| self.zero_evidence())?;
        result.error = f64::INFINITY;
        let most = settings.max_points.max([16_384, 1024, 0][d - 1]);
        while result.error > settings.tolerance && 2 * n <= most {
            let near = grid.neighbourhood(d, grid.top() - self.depth);
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
            let next = self.evaluate_with_edges(frame, fine, &|index| near[parent(index)])?;
            let Some(mut refined) = summarise(frame, &next, coordinate) else { break };
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
        result.evaluations = self.evaluations;
        Ok(result)
    }
}

/// Cells per axis of the first grid, in one, two and three dimensions.
const COARSE: [usize; 3] = [512, 128, 48];

fn ended(error: SimError) -> CalibrateError {
    CalibrateError::ended_by(error, 0)
}

/// Moments and quantiles of a grid; none where nothing is alive.
fn summarise(
    frame: &Frame,
    grid: &Grid,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
) -> Option<Quadrature> {
    let d = frame.d;
    let top = grid.top();
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
        let column = alive.iter().zip(x.chunks_exact(d)).map(|((_, w), x)| (x[j], w / total));
        out.quantiles.push(quantiles(column.collect(), out.sd[j]));
    }
    Some(out)
}

/// Quantiles at [`PROBABILITIES`] of the points of a grid and their weights; grid planes, points at the same coordinate,
/// count as one.
fn quantiles(mut points: Vec<(f64, f64)>, sd: f64) -> Vec<f64> {
    points.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut planes: Vec<(f64, f64)> = Vec::new();
    for (x, w) in points {
        match planes.last_mut() {
            Some(last) if (x - last.0).abs() <= 1e-9 * sd => last.1 += w,
            _ => planes.push((x, w)),
        }
    }
    let planes = Weighted::new(planes);
    PROBABILITIES.iter().map(|p| planes.quantile(*p)).collect()
}
