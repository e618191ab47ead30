//! Recursive Bayes over the observations: what was known after each of them.
//!
//! `ln w_k = ln w_(k-1) + ln p(y_k | y_1 .. y_(k-1), theta)`, from the samples of the whole run; early on, when
//! the posterior is still wide, few of them lie where the weight is, and the effective sample size says so. The last
//! point has the weights of the result. The kept curves are overwritten: they are most of the memory of a long run.

use crate::estimate::Estimator;
use crate::pool::{Pool, effective_sample_size, exponentiate_in_place};
use crate::target::CurveTarget;
use crate::weighted::steps;
use crate::{PathParameter, PathPoint};
use rayon::prelude::*;

/// Posterior after each kept observation. `kept` holds the kept values of every sample, `coordinate` the samples
/// of each parameter.
pub(crate) fn path(
    target: &CurveTarget<'_>,
    pool: &Pool,
    mut kept: Vec<f64>,
    coordinate: &[Vec<f64>],
    estimator: &Estimator,
) -> Vec<PathPoint> {
    let n = pool.len();
    let points = target.indices.len();
    let ln_base = pool.ln_base();
    let control = target.problem.control();
    // Log likelihood up to each kept observation, sample by sample: kept as such, or written over the curve.
    let (width, first) = if target.thinned { (2 * points, points) } else { (points, 0) };
    if !target.thinned {
        accumulate(target, &mut kept);
    }
    let orders: Vec<Vec<u32>> = coordinate.par_iter().map(|x| order(pool, x)).collect();
    (0..points)
        .into_par_iter()
        .map(|k| {
            let mut w: Vec<f64> = (0..n)
                .map(|i| {
                    if pool.ln_l[i].is_finite() {
                        ln_base[i] + kept[i * width + first + k]
                    } else {
                        f64::NEG_INFINITY
                    }
                })
                .collect();
            let mut top = exponentiate_in_place(&mut w);
            let ess = effective_sample_size(&w);
            if k + 1 == points {
                w.clone_from(&estimator.weights);
                top = estimator.ln_scale;
            }
            let total: f64 = w.iter().sum();
            let each = coordinate.iter().zip(&orders);
            PathPoint {
                index: target.indices[k],
                control: control[target.indices[k]],
                ess,
                log_evidence: top + (total / n as f64).ln(),
                parameters: each.map(|(x, order)| known(x, &w, order, total)).collect(),
            }
        })
        .collect()
}

/// Overwrites every curve by its log likelihood up to each observation.
fn accumulate(target: &CurveTarget<'_>, kept: &mut [f64]) {
    let points = target.indices.len();
    kept.par_chunks_mut(points * 64).for_each_init(
        || vec![0.0; points],
        |cumulative, kept| {
            for kept in kept.chunks_exact_mut(points) {
                target.likelihood.ln_cumulative(kept, cumulative);
                kept.copy_from_slice(cumulative);
            }
        },
    );
}

/// Samples in ascending order of x: the wide early posteriors need all of them, not only those that weigh at the end.
fn order(pool: &Pool, x: &[f64]) -> Vec<u32> {
    let mut order: Vec<u32> =
        (0..pool.len() as u32).filter(|i| pool.ln_l[*i as usize].is_finite()).collect();
    order.sort_unstable_by(|a, b| x[*a as usize].total_cmp(&x[*b as usize]).then(a.cmp(b)));
    order
}

/// Summary of one parameter under weights that sum to `total`.
fn known(x: &[f64], w: &[f64], order: &[u32], total: f64) -> PathParameter {
    let alive = || w.iter().zip(x).filter(|(w, _)| **w > 0.0);
    let mean = alive().map(|(w, x)| w * x).sum::<f64>() / total;
    let variance = alive().map(|(w, x)| w * (x - mean) * (x - mean)).sum::<f64>() / total;
    let [q5, q25, median, q75, q95] = steps(x, w, order, total, [0.05, 0.25, 0.5, 0.75, 0.95]);
    let sd = variance.max(0.0).sqrt();
    PathParameter { mean, sd, median, eti50: [q25, q75], eti90: [q5, q95] }
}
