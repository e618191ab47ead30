//! Posterior predictive bands, and the posterior of the noise.

use crate::estimate::Estimator;
use crate::noise::Likelihood;
use crate::sampler::Sampler;
use crate::stream::{Purpose, stream};
use crate::target::CurveTarget;
use crate::weighted::Weighted;
use crate::{BandPoint, Draw, GroupSummary, Posterior, SigmaSummary, SimError, Simulator};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use statrs::function::gamma::ln_gamma;

/// Intervals of 50, 90 and 95 %. Their probabilities are written out: computed ones are off by a rounding.
fn intervals(values: &Weighted) -> [[f64; 2]; 3] {
    [[0.25, 0.75], [0.05, 0.95], [0.025, 0.975]].map(|ends| ends.map(|p| values.quantile(p)))
}

/// Bands from equally weighted curve values and noisy ones.
fn band(index: usize, control: f64, mean: f64, values: Vec<f64>, noisy: Vec<f64>) -> BandPoint {
    let [curve50, curve90, curve95] = intervals(&Weighted::equal(values));
    let [noisy50, noisy90, noisy95] = intervals(&Weighted::equal(noisy));
    BandPoint { index, control, mean, curve50, curve90, curve95, noisy50, noisy90, noisy95 }
}

/// Bands at the observations that were kept.
pub(crate) fn at_observations(
    target: &CurveTarget<'_>,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
    draws: &[Draw],
    groups: &[GroupSummary],
) -> Vec<BandPoint> {
    if draws.is_empty() {
        return Vec::new();
    }
    let pool = &sampler.pool;
    let width = pool.kept_width;
    let control = target.problem.control();
    (0..target.indices.len())
        .into_par_iter()
        .map(|k| {
            let index = target.indices[k];
            let values: Vec<f64> = draws.iter().map(|d| pool.kept[d.sample * width + k]).collect();
            let mut rng = stream(sampler.settings.seed, Purpose::Predictive, 0, k);
            let point_sigma = target.likelihood.fixed_sigma(index);
            let group = groups.iter().find(|g| g.places().contains(&index));
            let noisy: Vec<f64> = draws
                .iter()
                .zip(&values)
                .enumerate()
                .map(|(at, (d, v))| {
                    let sigma = group.map_or(d.sigma, |g| g.sigma_draws.get(at).copied());
                    v + sigma.or(point_sigma).unwrap_or(0.0) * rng.sample::<f64, _>(StandardNormal)
                })
                .collect();
            let mean = estimator.mean(|i| pool.kept[i * width + k]);
            band(index, control[index], mean, values, noisy)
        })
        .collect()
}

/// Posterior predictive bands on any grid.
///
/// `simulator` gives the curve at `control` for the same parameters; it is run for at most `max_draws` of the
/// posterior's draws, evenly chosen. Draws that fail on this grid are left out. Noise is added where the
/// posterior knows one standard deviation for all points; with several groups of observations none is
/// ([`predictive_band_of_group`] adds it).
///
/// # Errors
/// A fatal simulator error, or no draw that can be simulated.
pub fn predictive_band(
    posterior: &Posterior,
    simulator: &dyn Simulator,
    control: &[f64],
    max_draws: usize,
) -> Result<Vec<BandPoint>, SimError> {
    band_on_grid(posterior, simulator, control, max_draws, &|at| posterior.draws[at].sigma)
}

/// Posterior predictive bands on any grid, of one group of observations, with that group's noise.
///
/// `simulator` gives this group's curve at `control`; otherwise as [`predictive_band`].
///
/// # Errors
/// A group that the posterior does not have, a fatal simulator error, or no draw that can be simulated.
pub fn predictive_band_of_group(
    posterior: &Posterior,
    group: &str,
    simulator: &dyn Simulator,
    control: &[f64],
    max_draws: usize,
) -> Result<Vec<BandPoint>, SimError> {
    let Some(group) = posterior.groups.iter().find(|g| g.name == group) else {
        let names: Vec<&str> = posterior.groups.iter().map(|g| g.name.as_str()).collect();
        return Err(SimError::fatal(format!(
            "the posterior has no group of observations named {group}; its groups: {}",
            if names.is_empty() { "none".to_owned() } else { names.join(", ") }
        )));
    };
    band_on_grid(posterior, simulator, control, max_draws, &|at| group.sigma_draws.get(at).copied())
}

/// Bands on a grid; `sigma` is the noise standard deviation of a draw.
fn band_on_grid(
    posterior: &Posterior,
    simulator: &dyn Simulator,
    control: &[f64],
    max_draws: usize,
    sigma: &(dyn Fn(usize) -> Option<f64> + Sync),
) -> Result<Vec<BandPoint>, SimError> {
    let all = &posterior.draws;
    if simulator.observables() != control.len()
        || simulator.parameters() != posterior.parameters.len()
    {
        return Err(SimError::fatal(format!(
            "the simulator of the band takes {} parameters and gives {} values; expected {} and {}",
            simulator.parameters(),
            simulator.observables(),
            posterior.parameters.len(),
            control.len()
        )));
    }
    let count = all.len().min(max_draws);
    let chosen: Vec<usize> = (0..count).map(|k| k * all.len() / count).collect();
    // Neighbouring draws are often the same sample: simulate it once.
    let mut distinct: Vec<usize> = chosen.iter().map(|at| all[*at].sample).collect();
    distinct.dedup();
    let curves: Vec<Option<Vec<f64>>> = distinct
        .par_iter()
        .map(|sample| {
            let mut out = vec![0.0; control.len()];
            let theta = posterior.samples.get(*sample).map(|s| s.theta.as_slice());
            let Some(theta) = theta else {
                return Err(SimError::fatal(format!(
                    "draw refers to sample {sample}, which does not exist"
                )));
            };
            match simulator.simulate(theta, &mut out) {
                Ok(()) if out.iter().all(|v| v.is_finite()) => Ok(Some(out)),
                Ok(()) => Ok(None),
                Err(e) if e.is_recoverable() => Ok(None),
                Err(e) => Err(e),
            }
        })
        .collect::<Result<_, _>>()?;
    let mut curve_of = Vec::with_capacity(chosen.len());
    let mut at = 0;
    for draw in &chosen {
        while distinct[at] != all[*draw].sample {
            at += 1;
        }
        curve_of.push(at);
    }
    let alive: Vec<(usize, usize)> =
        curve_of.into_iter().zip(chosen).filter(|(c, _)| curves[*c].is_some()).collect();
    if alive.is_empty() {
        return Err(SimError::fatal("no posterior draw can be simulated on this grid"));
    }
    Ok((0..control.len())
        .into_par_iter()
        .map(|k| {
            let mut rng = stream(posterior.settings.seed, Purpose::Predictive, 1, k);
            let mut values = Vec::with_capacity(alive.len());
            let mut noisy = Vec::with_capacity(alive.len());
            for (c, draw) in &alive {
                let Some(curve) = &curves[*c] else { continue };
                values.push(curve[k]);
                noisy.push(
                    curve[k] + sigma(*draw).unwrap_or(0.0) * rng.sample::<f64, _>(StandardNormal),
                );
            }
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            band(k, control[k], mean, values, noisy)
        })
        .collect())
}

/// Posterior of the noise standard deviation: moments exactly, as the weighted mixture of conditional inverse
/// gammas, sigma^2 ~ IG(a, b), a = (nu0 + m)/2, b = (nu0 s0^2 + S)/2, with
/// `E sigma = sqrt(b) Gamma(a - 1/2)/Gamma(a)` and `E sigma^2 = b/(a - 1)`; quantiles from the
/// drawn `values`. `ln_l` holds the log likelihoods of the samples under this likelihood.
pub(crate) fn sigma_summary(
    values: Vec<f64>,
    ln_l: &[f64],
    estimator: &Estimator,
    likelihood: &Likelihood,
) -> Option<SigmaSummary> {
    if let Some(s) = likelihood.common_sigma() {
        let both = [s, s];
        return Some(SigmaSummary {
            mean: s,
            sd: 0.0,
            median: s,
            eti50: both,
            eti90: both,
            eti95: both,
            fixed: true,
        });
    }
    let (nu0, sum0) = likelihood.inferred()?;
    let a = 0.5 * (nu0 + likelihood.values().len() as f64);
    let first = (ln_gamma(a - 0.5) - ln_gamma(a)).exp();
    let b = |i: usize| 0.5 * (sum0 + likelihood.sum_of_squares_at(ln_l[i]).unwrap_or(0.0));
    let mean = estimator.mean(|i| b(i).sqrt() * first);
    // With a at most 1 the second moment does not exist.
    let sd = if a > 1.0 {
        (estimator.mean(|i| b(i) / (a - 1.0)) - mean * mean).max(0.0).sqrt()
    } else {
        f64::MAX
    };
    if values.is_empty() {
        let both = [mean, mean];
        return Some(SigmaSummary {
            mean,
            sd,
            median: mean,
            eti50: both,
            eti90: both,
            eti95: both,
            fixed: false,
        });
    }
    let values = Weighted::equal(values);
    let [eti50, eti90, eti95] = intervals(&values);
    Some(SigmaSummary { mean, sd, median: values.quantile(0.5), eti50, eti90, eti95, fixed: false })
}
