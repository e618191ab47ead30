//! From weighted samples to a [`Posterior`].

use crate::control::{ByProcess, estimate};
use crate::draws::{Drawn, Draws};
use crate::estimate::{Below, Estimator};
use crate::failing::failing;
use crate::joint::JointProblem;
use crate::map_search::find_map;
use crate::marginal::{
    Marginal, correlation, draws_by_error, draws_by_errors, in_si, mean_and_sd, mean_and_variance,
};
use crate::noise_summary::{GroupNoise, Part};
use crate::path::path;
use crate::pool::{Pool, effective_sample_size};
use crate::predictive::at_observations;
use crate::replicated;
use crate::residuals::residuals_of;
use crate::sampler::Sampler;
use crate::stage::{Finishing, Observer};
use crate::target::CurveTarget;
use crate::trust::Tail;
use crate::{
    CalibrateError, Counters, Draw, EffectiveSampleSize, Evidence, GroupSummary, MapPoint, MovedBy,
    Parameter, ParameterSummary, Posterior, Residuals, Sample, StageRecord, StopReason,
};
use rayon::prelude::*;

/// A finished run.
pub(crate) struct Run<'a> {
    pub target: &'a CurveTarget<'a>,
    pub sampler: Sampler<'a>,
    /// Weights, largest 1.
    pub raw: Vec<f64>,
    /// Log of the factor taken out of the weights.
    pub ln_scale: f64,
    pub tuned: bool,
    pub stages: Vec<StageRecord>,
    pub stop: StopReason,
}

/// Everything that is reported of a run.
pub(crate) fn summarise(
    run: Run<'_>,
    observer: &mut dyn Observer,
) -> Result<Posterior, CalibrateError> {
    let mut finishing = Finishing(observer);
    let Run { target, mut sampler, raw, ln_scale, tuned, stages, stop } = run;
    let (problem, likelihood, settings) = (target.problem, target.likelihood, sampler.settings);
    let pool = &sampler.pool;
    let (n, d) = (pool.len(), pool.d);
    let (estimator, log_evidence, by_process) =
        estimator(problem, &sampler, (&raw, ln_scale), tuned, &mut finishing);

    // Columns of the samples: SI, coordinate.
    let theta: Vec<Vec<f64>> =
        columns(problem, |j, i| problem.parameters[j].prior.from_z(pool.z[i * d + j]), n);
    let coordinate: Vec<Vec<f64>> =
        columns(problem, |j, i| problem.parameters[j].prior.to_coordinate(theta[j][i]), n);
    let own = [theta, coordinate];

    finishing.after_integrals(0, "best fit");
    let map = find_map(target, &sampler, &estimator).map_err(|error| error.after(&stages))?;
    finishing.after_integrals(1, "intervals");
    // What is said of the parameters is of the samples where the estimates have them.
    let moved = moved(problem, &estimator);
    let of = Of { own: &own, moved: moved.as_ref() };
    let mut parameters = of.parameters(problem, pool, &raw, &estimator, &map);
    let correlated = correlation(&of.columns()[1], &estimator);
    // Where it knows more than the weights do.
    let (ess, by_errors) =
        (effective_sample_size(&raw), by_errors(&parameters, &estimator, &log_evidence));
    let drawn = by_process
        .filter(|_| by_errors.is_some_and(|draws| draws > ess))
        .and_then(|by| Drawn::new(&by, problem, &estimator, settings));
    let of_drawn = drawn.as_ref().map(|drawn| drawn.tell(&mut parameters, &correlated));
    let correlation_si = of_drawn.unwrap_or_else(|| correlation(&of.columns()[0], &estimator));
    let khat = parameters.iter().map(|p| p.khat).fold(f64::NEG_INFINITY, f64::max);

    finishing.after_integrals(2, "noise and predictions");
    let drawn = Draws::new(pool, &estimator, settings, drawn);
    let noise = likelihood.single().map(|one| {
        let range = 0..problem.observations();
        let part = Part { likelihood: one, group: 0, range, ln_l: &pool.ln_l };
        part.noise(&sampler, &estimator, &drawn)
    });
    let draws = draws(&drawn, noise.as_ref());
    let groups = groups(target, &sampler, &estimator, &drawn, &map);
    let predictive = at_observations(target, &sampler, &estimator, (&draws, &drawn), &groups);
    finishing.after_integrals(3, "what each observation taught");
    // The kept curves are most of the memory: used up here, before the samples take theirs.
    let kept = std::mem::take(&mut sampler.pool.kept);
    let path =
        (settings.path && !tuned).then(|| path(target, &sampler.pool, kept, &own[1], &estimator));
    let pool = &sampler.pool;
    Ok(Posterior {
        is_posterior: !tuned,
        noise: problem.groups[0].noise.clone(),
        settings: settings.clone(),
        samples: samples(pool, &of, &estimator, (&raw, ln_scale)),
        moved: of.moved.map(|_| moved_by((&parameters, &correlated), &own[1], &estimator)),
        correlation: correlated,
        correlation_si,
        log_evidence,
        ess: EffectiveSampleSize { by_errors, ..of_size(ess, n) },
        khat,
        sigma: noise.as_ref().and_then(|noise| noise.sigma),
        noise_shape: noise.and_then(|noise| noise.shape),
        residuals: residuals(target, &groups, &map),
        predictive,
        path: path.unwrap_or_default(),
        draws,
        parameters,
        stages,
        failures: pool.failures(),
        failing: failing(&sampler, problem, (&raw, ln_scale), (!tuned).then_some(&log_evidence)),
        stop,
        counters: Counters { map_simulations: map.simulations, ..sampler.counters },
        map,
        groups,
    })
}

/// An effective sample size of n simulations.
pub(crate) fn of_size(importance: f64, n: usize) -> EffectiveSampleSize {
    EffectiveSampleSize { importance, per_simulation: importance / n as f64, by_errors: None }
}

/// [`EffectiveSampleSize::by_errors`]; none where moments or an end of an interval are not known beyond the samples.
fn by_errors(
    parameters: &[ParameterSummary],
    estimator: &Estimator,
    evidence: &Evidence,
) -> Option<f64> {
    let each = parameters.iter().enumerate().map(|(j, parameter)| {
        let below = estimator.below(j).filter(|_| estimator.has_all_moments())?;
        let reached = below.reaches(0.025) && below.reaches(0.975);
        reached.then(|| draws_by_errors(&parameter.in_coordinate))
    });
    // The evidence is a mean: by n draws that are as unequal as their mean is large it has a relative error of 1 / sqrt(n).
    let of_evidence = draws_by_error(1.0, evidence.se);
    let least = each.into_iter().try_fold(of_evidence, |least, draws| Some(least.min(draws?)))?;
    least.is_finite().then_some(least)
}

/// The samples with the weights of the result, the evidence, and a process to draw from, if there is one; tuned weights have none of both.
fn estimator<'a>(
    problem: &JointProblem<'_>,
    sampler: &'a Sampler<'_>,
    (raw, ln_scale): (&[f64], f64),
    tuned: bool,
    finishing: &mut Finishing<'_>,
) -> (Estimator, Evidence, Option<ByProcess<'a>>) {
    if tuned {
        let estimator = Estimator::new(&sampler.pool, raw.to_vec(), ln_scale, sampler.replicates);
        return (estimator, Evidence { agree: true, ..Evidence::default() }, None);
    }
    estimate(sampler, raw, ln_scale, &problem.coordinate(), finishing)
}

/// Draws as plain data, with the noise that was drawn for each.
fn draws(of: &Draws<'_>, noise: Option<&GroupNoise>) -> Vec<Draw> {
    let draw = |(k, sample): (usize, &usize)| {
        let noise = noise.and_then(|noise| noise.draws.get(k));
        let (sigma, shape) = (noise.map(|draw| draw.sigma), noise.and_then(|draw| draw.shape));
        Draw { sample: *sample, theta: of.theta(k), sigma, shape }
    };
    of.samples.iter().enumerate().map(draw).collect()
}

/// Columns of the samples where they were simulated, SI and coordinate, and of where they were moved to, if they were.
struct Of<'a> {
    own: &'a [Vec<Vec<f64>>; 2],
    moved: Option<&'a [Vec<Vec<f64>>; 2]>,
}

impl Of<'_> {
    /// The columns that the parameters are summarised by.
    fn columns(&self) -> &[Vec<Vec<f64>>; 2] {
        self.moved.unwrap_or(self.own)
    }

    /// Summaries of all parameters, each with the k-hat of the weights where that is larger.
    fn parameters(
        &self,
        problem: &JointProblem<'_>,
        pool: &Pool,
        raw: &[f64],
        estimator: &Estimator,
        map: &MapPoint,
    ) -> Vec<ParameterSummary> {
        let of_weights = Tail::of(raw);
        let judged = estimator.judged(raw);
        let [theta, coordinate] = self.columns();
        let of_parameter = |j: usize| {
            let parameter = &problem.parameters[j];
            let z: Vec<f64> = if self.moved.is_some() {
                theta[j].iter().map(|x| parameter.prior.to_z(*x)).collect()
            } else {
                pool.z.iter().skip(j).step_by(pool.d).copied().collect()
            };
            let below = estimator.below(j);
            let columns = Columns { z: &z, theta: &theta[j], coordinate: &coordinate[j], below };
            let judged = (judged, of_weights);
            let mut summary = parameter_summary(parameter, &columns, judged, estimator);
            summary.map = map.theta[j];
            summary
        };
        (0..pool.d).into_par_iter().map(of_parameter).collect()
    }
}

/// One parameter of all samples.
pub(crate) struct Columns<'a> {
    pub z: &'a [f64],
    pub theta: &'a [f64],
    pub coordinate: &'a [f64],
    /// What is known of the coordinate beyond the samples.
    pub below: Option<&'a Below>,
}

/// Summary of the samples of one parameter, with the heaviest tail of its moments by the weights `judged` and of the importance weights;
/// the MAP is filled in later.
pub(crate) fn parameter_summary(
    p: &Parameter,
    of: &Columns<'_>,
    (judged, of_weights): (&[f64], Tail),
    estimator: &Estimator,
) -> ParameterSummary {
    let coordinate = p.prior.coordinate();
    let (lower, upper) = p.prior.support();
    let range = [lower, upper].map(|end| coordinate.of(end));
    let marginal = Marginal::new(of.coordinate, estimator).known_by(of.below, range);
    let in_coordinate = marginal.moments();
    let mean = in_coordinate.mean;
    let tail = Tail::of_moments(judged, of.coordinate, mean).heavier(of_weights);
    ParameterSummary {
        parameter: p.clone(),
        coordinate,
        in_si: in_si(coordinate, &in_coordinate, mean_and_sd(of.theta, estimator)),
        in_coordinate,
        map: f64::NAN,
        khat: tail.khat,
        tail_share: tail.share,
        information_gain_bits: Marginal::new(of.z, estimator).information_gain_bits(),
        prior_mean: p.prior.mean(),
        prior_sd: p.prior.sd(),
    }
}

/// All samples as plain data. `raw` are their importance weights over `exp(ln_scale)`.
fn samples(
    pool: &Pool,
    of: &Of<'_>,
    estimator: &Estimator,
    (raw, ln_scale): (&[f64], f64),
) -> Vec<Sample> {
    (0..pool.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|i| Sample {
            z: pool.point(i).to_vec(),
            theta: of.own[0].iter().map(|t| t[i]).collect(),
            log_likelihood: Some(pool.ln_l[i]).filter(|l| l.is_finite()),
            log_weight: Some(ln_scale + raw[i].ln()).filter(|l| l.is_finite()),
            weight: estimator.weights[i] / estimator.total,
            moved: of.moved.iter().flat_map(|[theta, _]| theta).map(|t| t[i]).collect(),
            stage: pool.stage[i] as usize,
            replicate: pool.replicate[i] as usize,
        })
        .collect()
}

/// Summary of each group; empty for a single group.
fn groups(
    target: &CurveTarget<'_>,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
    draws: &Draws<'_>,
    map: &MapPoint,
) -> Vec<GroupSummary> {
    if target.likelihood.single().is_some() {
        return Vec::new();
    }
    let (pool, width) = (&sampler.pool, sampler.pool.kept_width);
    let parts = target.problem.groups.iter().zip(target.likelihood.groups());
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
            let outputs = &map.outputs[range.clone()];
            let noise = Part { likelihood: part, group: g, range: range.clone(), ln_l: &ln_l }
                .noise(sampler, estimator, draws);
            // Thinned curves are those at some of the observations.
            let check = (!target.thinned).then(|| {
                let curve = |k: usize| &draws.outputs(k)[range.clone()];
                replicated::check((g, group, part), sampler.settings.seed, draws.len(), curve)
            });
            GroupSummary {
                name: group.name.clone(),
                noise: group.noise.clone(),
                first: range.start,
                observations: range.len(),
                log_likelihood: part.ln_joint(outputs),
                sigma: noise.sigma,
                sigma_draws: noise.draws.iter().map(|draw| draw.sigma).collect(),
                noise_shape: noise.shape,
                shape_draws: noise.draws.iter().filter_map(|draw| draw.shape).collect(),
                residuals: residuals_of(group, part, outputs),
                check: check.flatten(),
            }
        })
        .collect()
}

/// Residuals of the MAP curve; of several groups with the tests of the group that fails them most clearly.
fn residuals(target: &CurveTarget<'_>, groups: &[GroupSummary], map: &MapPoint) -> Residuals {
    if let Some(one) = target.likelihood.single() {
        return residuals_of(&target.problem.groups[0], one, &map.outputs);
    }
    let mut all = Residuals { independent: true, ..Residuals::default() };
    for r in groups.iter().map(|g| &g.residuals) {
        if (!r.independent, r.lag1.abs()) > (!all.independent, all.lag1.abs()) {
            (all.lag1, all.runs_z, all.independent) = (r.lag1, r.runs_z, r.independent);
        }
        all.values.extend(&r.values);
    }
    all
}

/// A number of every sample, parameter by parameter.
fn columns(
    problem: &JointProblem<'_>,
    value: impl Fn(usize, usize) -> f64 + Sync,
    n: usize,
) -> Vec<Vec<f64>> {
    (0..problem.parameters.len())
        .map(|j| (0..n).into_par_iter().with_min_len(256).map(|i| value(j, i)).collect())
        .collect()
}

/// Columns of the moved samples, SI and coordinate; none where they stay where they are.
fn moved(problem: &JointProblem<'_>, estimator: &Estimator) -> Option<[Vec<Vec<f64>>; 2]> {
    let parameters = problem.parameters.iter().enumerate();
    let each = parameters.map(|(j, parameter)| {
        let coordinate = estimator.moved(j)?;
        let of = parameter.prior.coordinate();
        Some((coordinate.iter().map(|x| of.theta(*x)).collect(), coordinate))
    });
    let (theta, coordinate) = each.collect::<Option<Vec<_>>>()?.into_iter().unzip();
    Some([theta, coordinate])
}

/// How far columns of the samples, in the coordinates, are from the moments and correlations that are reported.
fn moved_by(
    (parameters, correlated): (&[ParameterSummary], &[Vec<f64>]),
    own: &[Vec<f64>],
    e: &Estimator,
) -> MovedBy {
    let mut by = MovedBy::default();
    for (parameter, own) in parameters.iter().zip(own) {
        let ((mean, variance), known) = (mean_and_variance(own, e), parameter.in_coordinate);
        by.mean = by.mean.max((mean - known.mean).abs() / known.sd);
        by.sd = by.sd.max((variance.sqrt() / known.sd - 1.0).abs());
    }
    let own = correlation(own, e).concat();
    let off = correlated.iter().flatten().zip(own).map(|(known, own)| (known - own).abs());
    by.correlation = off.fold(0.0, f64::max);
    by
}
