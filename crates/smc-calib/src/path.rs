//! Recursive Bayes over the observations: what was known after each of them.
//!
//! `ln w_k = ln w_(k-1) + ln p(y_k | y_1 .. y_(k-1), theta)`, from the samples of the whole run; early on, when
//! the posterior is still wide, few of them lie where the weight is, and the effective sample size says so. The last
//! point has the weights of the result. The kept numbers are used up: one curve per sample is most of the memory of
//! a long run.

use crate::estimate::Estimator;
use crate::joint::{JointLikelihood, JointProblem};
use crate::pool::{Pool, effective_sample_size, exponentiate_in_place};
use crate::target::CurveTarget;
use crate::{PathParameter, PathPoint};
use rayon::prelude::*;

/// `kept` holds what the pool kept of every sample.
pub(crate) fn path(
    problem: &JointProblem<'_>,
    target: &CurveTarget<'_>,
    pool: &Pool,
    mut kept: Vec<f64>,
    likelihood: &JointLikelihood,
    coordinate: &[Vec<f64>],
    estimator: &Estimator,
) -> Vec<PathPoint> {
    let n = pool.len();
    let points = target.indices.len();
    let ln_base = pool.ln_base();
    let control = problem.control();
    // Log likelihood up to each kept observation, sample by sample: kept, or in place of the curve.
    let (width, first) = if target.thinned { (2 * points, points) } else { (points, 0) };
    if !target.thinned {
        kept.par_chunks_mut(points * 64).for_each_init(
            || vec![0.0; points],
            |cumulative, kept| {
                for kept in kept.chunks_exact_mut(points) {
                    likelihood.ln_cumulative(kept, cumulative);
                    kept.copy_from_slice(cumulative);
                }
            },
        );
    }
    // The wide early posteriors need all samples in order, not only those that weigh at the end.
    let orders: Vec<Vec<u32>> = coordinate
        .par_iter()
        .map(|x| {
            let mut order: Vec<u32> =
                (0..n as u32).filter(|i| pool.ln_l[*i as usize].is_finite()).collect();
            order.sort_unstable_by(|a, b| x[*a as usize].total_cmp(&x[*b as usize]).then(a.cmp(b)));
            order
        })
        .collect();
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
            let parameters = coordinate
                .iter()
                .zip(&orders)
                .map(|(x, order)| {
                    let mean =
                        w.iter().zip(x).filter(|(w, _)| **w > 0.0).map(|(w, x)| w * x).sum::<f64>()
                            / total;
                    let variance = w
                        .iter()
                        .zip(x)
                        .filter(|(w, _)| **w > 0.0)
                        .map(|(w, x)| w * (x - mean) * (x - mean))
                        .sum::<f64>()
                        / total;
                    let mut quantiles = [f64::NAN; 5];
                    let probabilities = [0.05, 0.25, 0.5, 0.75, 0.95];
                    let (mut sum, mut next) = (0.0, 0);
                    for i in order {
                        sum += w[*i as usize];
                        while next < 5 && sum >= probabilities[next] * total {
                            quantiles[next] = x[*i as usize];
                            next += 1;
                        }
                    }
                    // Rounding may leave the last one open.
                    for q in &mut quantiles[next..] {
                        *q = order.last().map_or(mean, |i| x[*i as usize]);
                    }
                    PathParameter {
                        mean,
                        sd: variance.max(0.0).sqrt(),
                        median: quantiles[2],
                        eti50: [quantiles[1], quantiles[3]],
                        eti90: [quantiles[0], quantiles[4]],
                    }
                })
                .collect();
            PathPoint {
                index: target.indices[k],
                control: control[target.indices[k]],
                ess,
                log_evidence: top + (total / n as f64).ln(),
                parameters,
            }
        })
        .collect()
}
