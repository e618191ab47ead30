//! From weighted samples to a [`Posterior`].

use crate::control::estimate;
use crate::estimate::Estimator;
use crate::joint::{JointLikelihood, JointProblem};
use crate::map_search::{self, MOST_STARTS, Start};
use crate::marginal::{Marginal, in_si, mean_and_sd};
use crate::noise::Likelihood;
use crate::path::path;
use crate::pool::effective_sample_size;
use crate::predictive::{at_observations, sigma_summary};
use crate::residuals::residuals_of;
use crate::sampler::Sampler;
use crate::stream::{Purpose, stream};
use crate::target::CurveTarget;
use crate::{
    CalibrateError, Draw, EffectiveSampleSize, Evidence, GroupSummary, MapPoint, ParameterSummary,
    Posterior, Residuals, Sample, Settings, SimError, StageRecord, StopReason, psis,
};
use rand::RngExt;
use rand_distr::{Distribution, Gamma};
use rayon::prelude::*;

/// A finished run.
pub(crate) struct Run<'a> {
    pub problem: &'a JointProblem<'a>,
    pub settings: &'a Settings,
    pub target: &'a CurveTarget<'a>,
    pub likelihood: &'a JointLikelihood,
    pub sampler: Sampler<'a>,
    /// Weights, largest 1.
    pub raw: Vec<f64>,
    /// Log of the factor taken out of the weights.
    pub ln_scale: f64,
    pub tuned: bool,
    pub stages: Vec<StageRecord>,
    pub stop: StopReason,
}

pub(crate) fn summarise(run: Run<'_>) -> Result<Posterior, CalibrateError> {
    let Run { problem, settings, target, likelihood, raw, ln_scale, tuned, stages, stop, .. } = run;
    let mut sampler = run.sampler;
    let pool = &sampler.pool;
    let (n, d) = (pool.len(), pool.d);
    let importance = effective_sample_size(&raw);
    let weight_khat = psis::khat(&raw);
    let (estimator, log_evidence) = if tuned {
        // Tuned weights have no evidence.
        let estimator = Estimator::new(pool, raw.clone(), ln_scale, sampler.replicates);
        (estimator, Evidence { agree: true, ..Evidence::default() })
    } else {
        estimate(&sampler, &raw, ln_scale, &|j, z| {
            let prior = &problem.parameters[j].prior;
            prior.to_coordinate(prior.from_z(z))
        })
    };

    // Columns of the samples: normal scores, SI, coordinate.
    let theta: Vec<Vec<f64>> =
        columns(problem, |j, i| problem.parameters[j].prior.from_z(pool.z[i * d + j]), n);
    let coordinate: Vec<Vec<f64>> =
        columns(problem, |j, i| problem.parameters[j].prior.to_coordinate(theta[j][i]), n);

    let map = find_map(target, likelihood, &sampler, &estimator, settings)
        .map_err(|error| error.after(&stages))?;
    let marginals: Vec<Marginal<'_>> =
        coordinate.par_iter().map(|x| Marginal::new(x, &estimator)).collect();
    let parameters: Vec<ParameterSummary> = (0..d)
        .into_par_iter()
        .map(|j| {
            let p = &problem.parameters[j];
            let in_coordinate = marginals[j].moments();
            let mean = in_coordinate.mean;
            let khat_of = |power: i32| {
                let values: Vec<f64> = estimator
                    .weights
                    .iter()
                    .zip(&coordinate[j])
                    .map(|(w, x)| w * (x - mean).abs().powi(power))
                    .collect();
                psis::khat(&values)
            };
            let z: Vec<f64> = pool.z.iter().skip(j).step_by(d).copied().collect();
            ParameterSummary {
                parameter: p.clone(),
                coordinate: p.prior.coordinate(),
                in_si: in_si(
                    p.prior.coordinate(),
                    &in_coordinate,
                    mean_and_sd(&theta[j], &estimator),
                ),
                in_coordinate,
                map: map.theta[j],
                khat: weight_khat.max(khat_of(1)).max(khat_of(2)),
                information_gain_bits: Marginal::new(&z, &estimator).information_gain_bits(),
                prior_mean: p.prior.mean(),
                prior_sd: p.prior.sd(),
            }
        })
        .collect();
    let khat = parameters.iter().map(|p| p.khat).fold(weight_khat, f64::max);

    let chosen = chosen(&estimator, settings);
    let sigma_draws =
        likelihood.single().map(|one| draw_sigmas(&chosen, &pool.ln_l, one, 0, settings));
    let draws: Vec<Draw> = chosen
        .iter()
        .enumerate()
        .map(|(k, sample)| Draw {
            sample: *sample,
            sigma: sigma_draws.as_ref().and_then(|s| s.get(k).copied()),
        })
        .collect();
    let groups = groups(problem, target, &sampler, &estimator, &chosen, &map, settings);
    let residuals = match groups.as_slice() {
        [] => {
            let part = likelihood.groups().next().map(|(part, _)| part);
            part.map_or_else(Residuals::default, |part| {
                residuals_of(&problem.groups[0], part, &map.outputs)
            })
        }
        several => residuals_of_all(several),
    };
    let predictive = at_observations(target, &sampler, &estimator, &draws, &groups, settings);
    let path = {
        // The kept curves are most of the memory: used up here, before the samples take theirs.
        let kept = std::mem::take(&mut sampler.pool.kept);
        if tuned {
            Vec::new()
        } else {
            path(problem, target, &sampler.pool, kept, likelihood, &coordinate, &estimator)
        }
    };
    let pool = &sampler.pool;
    let total = estimator.total;
    let samples = (0..n)
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let weight = estimator.weights[i] / total;
            Sample {
                z: pool.point(i).to_vec(),
                theta: theta.iter().map(|t| t[i]).collect(),
                log_likelihood: Some(pool.ln_l[i]).filter(|l| l.is_finite()),
                log_weight: Some(ln_scale + raw[i].ln()).filter(|l| l.is_finite()),
                weight,
                stage: pool.stage[i] as usize,
                replicate: pool.replicate[i] as usize,
            }
        })
        .collect();
    let mut posterior = Posterior {
        is_posterior: !tuned,
        noise: problem.groups[0].noise.clone(),
        settings: settings.clone(),
        samples,
        correlation: correlation(&coordinate, &estimator),
        correlation_si: correlation(&theta, &estimator),
        log_evidence,
        ess: EffectiveSampleSize { importance, per_simulation: importance / n as f64 },
        khat,
        sigma: likelihood.single().and_then(|one| {
            sigma_summary(sigma_draws.unwrap_or_default(), &pool.ln_l, &estimator, one)
        }),
        residuals,
        predictive,
        path,
        draws,
        parameters,
        stages,
        failures: pool.failures(),
        stop,
        counters: sampler.counters,
        map,
        groups,
    };
    posterior.counters.map_simulations = posterior.map.simulations;
    Ok(posterior)
}

/// What belongs to each of several groups; nothing where there is one.
fn groups(
    problem: &JointProblem<'_>,
    target: &CurveTarget<'_>,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
    chosen: &[usize],
    map: &MapPoint,
    settings: &Settings,
) -> Vec<GroupSummary> {
    if target.likelihood.single().is_some() {
        return Vec::new();
    }
    let (pool, width) = (&sampler.pool, sampler.pool.kept_width);
    let parts = problem.groups.iter().zip(target.likelihood.groups());
    parts
        .enumerate()
        .map(|(g, (group, (part, range)))| {
            let ln_l: Vec<f64> = pool
                .ln_l
                .par_iter()
                .zip(pool.kept.par_chunks(width))
                .map(|(l, kept)| {
                    if l.is_finite() { target.ln_of_group(g, kept, *l) } else { f64::NEG_INFINITY }
                })
                .collect();
            let sigma_draws = draw_sigmas(chosen, &ln_l, part, g, settings);
            let outputs = &map.outputs[range.clone()];
            GroupSummary {
                name: group.name.clone(),
                noise: group.noise.clone(),
                first: range.start,
                observations: range.len(),
                log_likelihood: part.ln_joint(outputs),
                sigma: sigma_summary(sigma_draws.clone(), &ln_l, estimator, part),
                sigma_draws,
                residuals: residuals_of(group, part, outputs),
            }
        })
        .collect()
}

/// Residuals of all groups, with the tests of the group that fails them most clearly.
fn residuals_of_all(groups: &[GroupSummary]) -> Residuals {
    let mut all = Residuals { independent: true, ..Residuals::default() };
    for r in groups.iter().map(|g| &g.residuals) {
        if (!r.independent, r.lag1.abs()) > (!all.independent, all.lag1.abs()) {
            (all.lag1, all.runs_z, all.independent) = (r.lag1, r.runs_z, r.independent);
        }
        all.values.extend(&r.values);
    }
    all
}

fn columns(
    problem: &JointProblem<'_>,
    value: impl Fn(usize, usize) -> f64 + Sync,
    n: usize,
) -> Vec<Vec<f64>> {
    (0..problem.parameters.len())
        .map(|j| (0..n).into_par_iter().with_min_len(256).map(|i| value(j, i)).collect())
        .collect()
}

fn correlation(columns: &[Vec<f64>], e: &Estimator) -> Vec<Vec<f64>> {
    let d = columns.len();
    let means: Vec<f64> = columns.iter().map(|x| e.mean(|i| x[i])).collect();
    let mut c = vec![vec![0.0; d]; d];
    for i in 0..d {
        for j in 0..=i {
            let v = e.mean(|k| (columns[i][k] - means[i]) * (columns[j][k] - means[j]));
            c[i][j] = v;
            c[j][i] = v;
        }
    }
    let sd: Vec<f64> = (0..d).map(|i| c[i][i].max(0.0).sqrt()).collect();
    for i in 0..d {
        for j in 0..d {
            let s = sd[i] * sd[j];
            c[i][j] = if i == j {
                1.0
            } else if s > 0.0 {
                (c[i][j] / s).clamp(-1.0, 1.0)
            } else {
                0.0
            };
        }
    }
    c
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

/// The highest density of the prior's coordinate, searched for in normal scores.
fn find_map(
    target: &CurveTarget<'_>,
    likelihood: &JointLikelihood,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
    settings: &Settings,
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
    if settings.map_simulations == 0 {
        return Ok(best_sample(target, sampler, &density));
    }
    let starts = map_starts(sampler, estimator, &density);
    let start = starts.first().map_or_else(|| pool.point(0).to_vec(), |s| s.point.clone());
    let mut outputs = vec![0.0; target.problem.observations()];
    let mut ended: Option<SimError> = None;
    let (z, _, simulations) = map_search::best_of(&starts, settings.map_simulations, &mut |z| {
        // Beyond 8 the parameter is its bound to all digits.
        if ended.is_some() || z.iter().any(|z| z.abs() > 8.0) {
            return f64::NEG_INFINITY;
        }
        match target.simulate(z, &mut outputs) {
            Ok(()) => likelihood.ln_joint(&outputs) + target.ln_prior(z),
            Err(e) => {
                ended = Some(e).filter(|e| !e.is_recoverable());
                f64::NEG_INFINITY
            }
        }
    });
    let total = pool.len() + simulations;
    if let Some(error) = ended {
        return Err(CalibrateError::ended_by(error, total));
    }
    // The search starts from a sample that was simulated, so its best can be simulated again.
    let z = match target.simulate(&z, &mut outputs) {
        Ok(()) => z,
        Err(SimError::Interrupted) => {
            return Err(CalibrateError::ended_by(SimError::Interrupted, total));
        }
        Err(_) => {
            target.simulate(&start, &mut outputs).map_err(|error| match error {
                SimError::Interrupted => CalibrateError::ended_by(error, total),
                other => CalibrateError::Fatal {
                    cause: format!(
                        "the same parameters worked before and now fail: {}",
                        other.cause()
                    ),
                    simulations: total,
                },
            })?;
            start
        }
    };
    let log_likelihood = likelihood.ln_joint(&outputs);
    Ok(MapPoint {
        theta: target.theta(&z),
        log_likelihood,
        log_density: log_likelihood + target.ln_prior(&z),
        outputs,
        simulations: simulations + 1,
    })
}

/// Systematic resampling: the sample of each draw.
fn chosen(estimator: &Estimator, settings: &Settings) -> Vec<usize> {
    let count = settings.draws;
    if count == 0 {
        return Vec::new();
    }
    let step = estimator.total / count as f64;
    let mut next = step * stream(settings.seed, Purpose::Draws, 0, 0).random::<f64>();
    let mut chosen = Vec::with_capacity(count);
    let mut sum = 0.0;
    for (i, w) in estimator.weights.iter().enumerate() {
        sum += w;
        while next < sum && chosen.len() < count {
            chosen.push(i);
            next += step;
        }
    }
    while let (true, Some(last)) = (chosen.len() < count, chosen.last().copied()) {
        chosen.push(last);
    }
    chosen
}

/// One noise standard deviation per draw, from its conditional inverse gamma in one group; `ln_l` holds the samples'
/// log likelihoods there. Empty where the noise is fixed point by point or tuned.
fn draw_sigmas(
    chosen: &[usize],
    ln_l: &[f64],
    part: &Likelihood,
    group: usize,
    settings: &Settings,
) -> Vec<f64> {
    let Some((nu0, sum0)) = part.inferred() else {
        return part.common_sigma().map_or_else(Vec::new, |sigma| vec![sigma; chosen.len()]);
    };
    let Ok(gamma) = Gamma::new(0.5 * (nu0 + part.values().len() as f64), 1.0) else {
        return Vec::new();
    };
    chosen
        .par_iter()
        .enumerate()
        .with_min_len(256)
        .map(|(k, sample)| {
            let s = part.sum_of_squares_at(ln_l[*sample]).unwrap_or(0.0);
            let g: f64 = gamma.sample(&mut stream(settings.seed, Purpose::Sigma, group, k));
            (0.5 * (sum0 + s) / g).sqrt()
        })
        .collect()
}
