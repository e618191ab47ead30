//! The maximum a posteriori point, of the density in the priors' coordinates.

use crate::estimate::Estimator;
use crate::nelder_mead::{Start, best_of};
use crate::sampler::Sampler;
use crate::target::CurveTarget;
use crate::{CalibrateError, MapPoint, SimError};
use rayon::prelude::*;

/// Most places that the search starts from.
const MOST_STARTS: usize = 12;
/// Normal score beyond which a parameter is its bound to all digits.
const FARTHEST: f64 = 8.0;

/// The point of highest density: searched for in normal scores, or the best sample where no simulation is to be spent.
pub(crate) fn find_map(
    target: &CurveTarget<'_>,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
) -> Result<MapPoint, CalibrateError> {
    let pool = &sampler.pool;
    let density: Vec<f64> = (0..pool.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            if pool.ln_l[i].is_finite() {
                pool.ln_l[i] + target.ln_prior(pool.point(i))
            } else {
                f64::NEG_INFINITY
            }
        })
        .collect();
    let budget = sampler.settings.map_simulations;
    if budget == 0 {
        return Ok(best_sample(target, sampler, &density));
    }
    let starts = map_starts(sampler, estimator, &density);
    let start = starts.first().map_or_else(|| pool.point(0).to_vec(), |s| s.point.clone());
    let mut outputs = vec![0.0; target.problem.observations()];
    let mut ended: Option<SimError> = None;
    let (z, _, simulations) = best_of(&starts, budget, &mut |z| {
        if ended.is_some() || z.iter().any(|z| z.abs() > FARTHEST) {
            return f64::NEG_INFINITY;
        }
        match target.simulate(z, &mut outputs) {
            Ok(()) => target.likelihood.ln_joint(&outputs) + target.ln_prior(z),
            Err(error) => {
                ended = Some(error).filter(|error| !error.is_recoverable());
                f64::NEG_INFINITY
            }
        }
    });
    let total = pool.len() + simulations;
    if let Some(error) = ended {
        return Err(CalibrateError::ended_by(error, total));
    }
    let z = simulated_again(target, [z, start], &mut outputs)
        .map_err(|error| CalibrateError::ended_by(error, total))?;
    let log_likelihood = target.likelihood.ln_joint(&outputs);
    Ok(MapPoint {
        theta: target.theta(&z),
        log_likelihood,
        log_density: log_likelihood + target.ln_prior(&z),
        outputs,
        simulations: simulations + 1,
    })
}

/// The first of two points that can be simulated again, with its curve in `outputs`: the best one that was found, or else
/// the sample that the search started from.
fn simulated_again(
    target: &CurveTarget<'_>,
    [best, start]: [Vec<f64>; 2],
    outputs: &mut [f64],
) -> Result<Vec<f64>, SimError> {
    match target.simulate(&best, outputs) {
        Ok(()) => return Ok(best),
        Err(SimError::Interrupted) => return Err(SimError::Interrupted),
        Err(_) => {}
    }
    target.simulate(&start, outputs).map_err(|error| match error {
        SimError::Interrupted => error,
        other => SimError::fatal(format!(
            "the same parameters worked before and now fail: {}",
            other.cause()
        )),
    })?;
    Ok(start)
}

/// The sample of highest density, the earliest of equals; its curve is the one that was kept.
fn best_sample(target: &CurveTarget<'_>, sampler: &Sampler<'_>, density: &[f64]) -> MapPoint {
    let pool = &sampler.pool;
    let mut best = 0;
    for i in 0..pool.len() {
        if density[i] > density[best] {
            best = i;
        }
    }
    let kept = &pool.kept[best * pool.kept_width..(best + 1) * pool.kept_width];
    MapPoint {
        theta: target.theta(pool.point(best)),
        log_likelihood: pool.ln_l[best],
        log_density: density[best],
        outputs: target.best_outputs().unwrap_or_else(|| kept.to_vec()),
        simulations: 0,
    }
}

/// Places to search from: the best sample of every component of the last proposal, the best first, so that each
/// peak and each stretch of a ridge that the mixture tells apart has one.
fn map_starts(sampler: &Sampler<'_>, estimator: &Estimator, density: &[f64]) -> Vec<Start> {
    let pool = &sampler.pool;
    let d = pool.d;
    let components =
        sampler.proposals.last().map_or(&[] as &[_], |(_, proposal)| &proposal.components);
    let top = density.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Per component: its best sample among those that are nearest to it.
    let mut best: Vec<Option<usize>> = vec![None; components.len().max(1)];
    for i in (0..pool.len()).filter(|i| density[*i] > top - 50.0) {
        let z = pool.point(i);
        let mut nearest = (0, f64::INFINITY);
        for (c, component) in components.iter().enumerate() {
            let m = component.distance2(z);
            if m < nearest.1 {
                nearest = (c, m);
            }
        }
        let best = &mut best[nearest.0];
        if best.is_none_or(|b| density[i] > density[b]) {
            *best = Some(i);
        }
    }
    let mut starts: Vec<(usize, usize)> =
        best.into_iter().enumerate().filter_map(|(c, i)| i.map(|i| (c, i))).collect();
    starts.sort_by(|a, b| density[b.1].total_cmp(&density[a.1]).then(a.1.cmp(&b.1)));
    starts.truncate(MOST_STARTS);
    starts
        .into_iter()
        .map(|(c, i)| {
            let mut axes = vec![0.0; d * d];
            for a in 0..d {
                match components.get(c) {
                    // Columns of the factor: the directions in which the component is wide and narrow.
                    Some(c) => (a..d).for_each(|j| axes[a * d + j] = 0.3 * c.factor[j * d + a]),
                    None => {
                        let mean = estimator.mean(|i| pool.z[i * d + a]);
                        let variance = estimator.mean(|i| (pool.z[i * d + a] - mean).powi(2));
                        axes[a * d + a] = 0.5 * variance.max(0.0).sqrt().max(1e-6);
                    }
                }
            }
            Start { point: pool.point(i).to_vec(), axes }
        })
        .collect()
}
