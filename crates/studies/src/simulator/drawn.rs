//! Draws from the prior: every method over all of them, Verlet in batches.

use crate::stiff_reference::{Equations, Reference};
use dem_core::{Kinetics, Sintering, SolveError, SolverKind, SolverSettings, verlet_batch};
use figures::Band;
use rayon::prelude::*;
use workbench::error::{Failure, RunError};

use super::method::{self, Method, difference, reference};
use super::row::{self, Error, Found, Line, Row};
use crate::pair::Pair;
use crate::quantile::quantile;
use crate::timing::{Clock, Timing};

/// Time steps over the collision time.
const STEPS: [f64; 5] = [0.15, 0.1, 0.05, 0.02, 0.01];

/// A method over all draws.
struct Point {
    method: Method,
    /// Mean time of a curve \[s\].
    each_s: f64,
    /// Mean number of steps.
    steps: u64,
    /// Draws that the method refuses.
    failed: usize,
    /// Sorted errors against the quasi-static limit.
    balance: Vec<f64>,
    /// Sorted errors against the equations of motion.
    motion: Vec<f64>,
}

/// References of the draws, where there is one.
struct References {
    balance: Vec<Option<Reference>>,
    motion: Vec<Option<Reference>>,
}

pub(super) fn study(pair: &Pair, draws: &[Sintering]) -> Result<Found, Failure> {
    let of = |equations| -> Vec<Option<Reference>> {
        draws.par_iter().map(|s| reference(pair, equations, s).ok()).collect()
    };
    let references =
        References { balance: of(Equations::ForceBalance), motion: of(Equations::Motion) };
    let points = method::all(&STEPS)
        .into_iter()
        .map(|method| point(pair, draws, &references, method))
        .collect::<Result<Vec<_>, _>>()?;
    let known = |references: &[Option<Reference>]| references.iter().flatten().count();
    let finding = format!(
        "- {}, {} draws: the quasi-static limit has a reference for {} of them (settled to 1e-7 or better; none \
         where a knee from very slow to very fast growth enlarges every error of time), the equations of motion \
         for {} (none where the motion leaves the elastic branch either).\n",
        pair.material.title(),
        draws.len(),
        known(&references.balance),
        known(&references.motion),
    );
    let parameters = format!("{} prior draws", draws.len());
    let rows = points.iter().map(|point| row(pair, &parameters, point)).collect();
    let title = format!(
        "{}, {} draws from the prior: median, and up to the worst",
        pair.material.title(),
        draws.len()
    );
    let figure =
        row::figure(title, "verlet in batches, step 0.15 … 0.01 t_{c}", |kind, of_motion| {
            let chosen = || points.iter().filter(|point| point.method.settings.kind == kind);
            let errors =
                |point: &Point| error(if of_motion { &point.motion } else { &point.balance });
            let floor = |value: f64| value.max(1e-16);
            let middle: Vec<f64> = chosen().map(|point| floor(errors(point).median)).collect();
            let upper = chosen().map(|point| floor(errors(point).worst.unwrap_or(0.0))).collect();
            Line {
                cost: chosen().map(|point| point.each_s).collect(),
                error: middle.clone(),
                band: Band { lower: middle, upper },
            }
        });
    Ok(Found { rows, finding, figure })
}

fn point(
    pair: &Pair,
    draws: &[Sintering],
    references: &References,
    method: Method,
) -> Result<Point, RunError> {
    let width = pair.times_s.len();
    let mut out = vec![0.0; width * draws.len()];
    let (took_s, runs) = Clock::Wall.measure(|| curves(pair, draws, &method.settings, &mut out));
    let runs = runs.map_err(RunError::new)?;
    let (mut balance, mut motion) = (Vec::new(), Vec::new());
    for (i, curve) in out.chunks(width).enumerate().filter(|(i, _)| runs[*i].is_ok()) {
        let error = |truth: &Reference| difference(curve, &truth.contact_ratio);
        balance.extend(references.balance[i].as_ref().map(error));
        motion.extend(references.motion[i].as_ref().map(error));
    }
    balance.sort_by(f64::total_cmp);
    motion.sort_by(f64::total_cmp);
    Ok(Point {
        method,
        each_s: took_s / draws.len() as f64,
        steps: runs.iter().flatten().sum::<u64>() / draws.len() as u64,
        failed: runs.iter().filter(|run| run.is_err()).count(),
        balance,
        motion,
    })
}

/// The curves of all draws, row by row; the number of steps of each.
fn curves(
    pair: &Pair,
    draws: &[Sintering],
    settings: &SolverSettings,
    out: &mut [f64],
) -> Result<Vec<Result<u64, SolveError>>, SolveError> {
    if settings.kind == SolverKind::Verlet {
        let runs =
            verlet_batch(&pair.scene, Kinetics::ThreeStage, draws, settings, &pair.times_s, out)?;
        return Ok(runs.into_iter().map(|run| run.map(|report| report.steps)).collect());
    }
    let rows = out.chunks_mut(pair.times_s.len());
    Ok(draws.iter().zip(rows).map(|(s, out)| pair.curve(s, settings, out)).collect())
}

fn row(pair: &Pair, parameters: &str, point: &Point) -> Vec<String> {
    let refused = point.failed;
    Row {
        material: pair.material,
        parameters,
        method: &point.method,
        timing: Timing { median_s: point.each_s, lower_s: point.each_s, upper_s: point.each_s },
        steps: point.steps,
        balance: error(&point.balance),
        motion: (point.method.settings.kind == SolverKind::Verlet).then(|| error(&point.motion)),
        note: if refused > 0 { format!("{refused} draws refused") } else { String::new() },
    }
    .cells()
}

fn error(sorted: &[f64]) -> Error {
    Error { median: quantile(sorted, 0.5), worst: Some(sorted.last().copied().unwrap_or(0.0)) }
}
