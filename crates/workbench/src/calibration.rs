//! From a plan to a posterior and everything that is reported of it.

use dem_core::{Kinetics, knee, printed};
use rayon::prelude::*;
use smc_calib::{
    CalibrateError, FixedSigma, Noise, Observer, Posterior, Problem, SimError, Simulator, calibrate,
};

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::frenkel_fit;
use crate::material::Material;
use crate::model::{INTERRUPTED, NeckGrowth, Watched};
use crate::plan::{Plan, Planned};
use crate::posterior_file::{
    Curves, Derived, Fit, FitError, KneeSummary, PaperComparison, PosteriorFile, PrintedParameter,
    SCHEMA_VERSION,
};
use crate::prior_file::ParameterName;
use crate::product;
use crate::summary::INFORMED_BITS;
use crate::weighted::Weighted;

/// Most posterior draws that are run on the fine grid of times.
const GRID_DRAWS: usize = 1024;
/// Evenly spaced times of that grid, and logarithmically spaced ones for a logarithmic axis.
const GRID_LINEAR: usize = 201;
const GRID_LOG: usize = 60;

/// A finished calibration: the report, and the samples behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// What `posterior.json` holds.
    pub file: PosteriorFile,
    /// The sampler's own account, with all samples.
    pub posterior: Posterior,
}

impl Calibration {
    /// Calibrates. `on_simulation` is called at every simulation, for progress; `false` ends the run.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for settings the sampler refuses, [`Failure::Run`] for a run that cannot succeed,
    /// [`Failure::Interrupted`] where the observer ended it too early.
    pub fn run(
        planned: &Planned,
        observer: &mut dyn Observer,
        on_simulation: &(dyn Fn() -> bool + Sync),
    ) -> Result<Self, Failure> {
        let plan = &planned.plan;
        let model = NeckGrowth::of(plan)?;
        let watched = Watched { model: &model, go_on: on_simulation };
        let problem = Problem {
            simulator: &watched,
            parameters: plan.parameters.clone(),
            observations: plan.observations()?,
            noise: plan.noise.clone(),
        };
        let posterior = calibrate(&problem, &plan.sampler, observer).map_err(failure)?;
        let file = report(planned, &model, &posterior)?;
        Ok(Self { file, posterior })
    }
}

fn failure(error: CalibrateError) -> Failure {
    match error {
        CalibrateError::Interrupted { .. } => Failure::Interrupted,
        CalibrateError::Fatal { cause, .. } if cause == INTERRUPTED => Failure::Interrupted,
        CalibrateError::Setting { setting, value, range } => {
            InputError::new(format!("--{}", setting.replace('_', "-")), Mistake::OutOfRange)
                .found(value)
                .expected(range)
                .into()
        }
        CalibrateError::Noise(error) => {
            InputError::new("--noise", Mistake::OutOfRange).found(error).into()
        }
        other => RunError::new(other).into(),
    }
}

fn simulation_failure(error: &SimError) -> Failure {
    RunError::new(format_args!("a curve of the report could not be computed: {error}")).into()
}

fn report(
    planned: &Planned,
    model: &NeckGrowth,
    posterior: &Posterior,
) -> Result<PosteriorFile, Failure> {
    let plan = &planned.plan;
    let kinetics = plan.kinetics()?;
    let observed = &plan.experiment.contact_ratio;
    let frenkel_tau_s =
        frenkel_fit::best_tau_s(model, observed).map_err(|error| simulation_failure(&error))?;
    let paper = plan
        .material()
        .map(|material| paper_comparison(material, plan.experiment.radius_m, model, posterior));
    let (curves, at_data) = curves(plan, model, posterior, frenkel_tau_s, paper.is_some())?;
    let mean_at_data: Vec<f64> = posterior.predictive.iter().map(|band| band.mean).collect();
    let fit = Fit {
        map: FitError::of(observed, &posterior.map.outputs),
        posterior_mean: FitError::of(observed, &mean_at_data),
        paper: at_data.paper.map(|curve| FitError::of(observed, &curve)),
        frenkel: at_data.frenkel.map(|curve| FitError::of(observed, &curve)),
        frenkel_tau_s,
    };
    let mut advice = general_advice(&planned.warnings, posterior);
    advice.extend(posterior.parameters.iter().filter_map(magnitude_advice));
    advice.extend(kinetics_advice(kinetics));
    Ok(PosteriorFile {
        schema_version: SCHEMA_VERSION,
        plan: plan.clone(),
        is_posterior: posterior.is_posterior,
        parameters: posterior.parameters.clone(),
        printed: printed_parameters(plan, model, posterior, paper.as_ref()),
        paper,
        product: product::summary(plan, kinetics, posterior),
        correlation: posterior.correlation.clone(),
        correlation_si: posterior.correlation_si.clone(),
        sigma: posterior.sigma,
        log_evidence: posterior.log_evidence,
        ess: posterior.ess,
        khat: posterior.khat,
        map: posterior.map.clone(),
        residuals: posterior.residuals.clone(),
        fit,
        knee: if kinetics.separates_c1_from_delta_c() {
            knee_summary(plan, model, posterior)?
        } else {
            None
        },
        predictive: posterior.predictive.clone(),
        curves,
        path: posterior.path.clone(),
        stages: posterior.stages.clone(),
        failures: posterior.failures.clone(),
        stop: posterior.stop,
        warnings: posterior.warnings.clone(),
        advice,
        counters: posterior.counters,
    })
}

/// What any posterior is published with: warnings of the input and of the sampler, and parameters that the data say
/// little about. Input and sampler may say the same (fewer observations than parameters): it is said once.
pub(crate) fn general_advice(of_input: &[String], posterior: &Posterior) -> Vec<String> {
    let mut advice = of_input.to_vec();
    advice.extend(posterior.warnings.iter().map(ToString::to_string));
    advice.extend(posterior.parameters.iter().filter_map(|p| hardly_informed(posterior, p)));
    let mut seen = std::collections::BTreeSet::new();
    advice.retain(|line| seen.insert(line.clone()));
    advice
}

/// For a parameter that is flagged as not informed, and that the sampler itself has not warned of.
fn hardly_informed(posterior: &Posterior, summary: &smc_calib::ParameterSummary) -> Option<String> {
    let (name, bits) = (&summary.parameter.name, summary.information_gain_bits);
    let warned = posterior.warnings.iter().any(|warning| {
        matches!(warning, smc_calib::Warning::NotInformed { parameter, .. } if parameter == name)
    });
    (bits < INFORMED_BITS && !warned).then(|| {
        format!(
            "the data say little about {name} ({bits:.2} bits): its posterior is near its prior"
        )
    })
}

/// A 95 % interval over more than this factor is knowledge of the order of magnitude only.
const MAGNITUDE: f64 = 100.0;

fn magnitude_advice(summary: &smc_calib::ParameterSummary) -> Option<String> {
    let interval = &summary.in_si.eti95;
    let factor = interval.upper / interval.lower;
    (interval.lower > 0.0 && factor > MAGNITUDE).then(|| {
        format!(
            "{} is known to its order of magnitude at best: its 95 % interval spans a factor of {factor:.0}",
            summary.parameter.name
        )
    })
}

fn kinetics_advice(kinetics: Kinetics) -> Option<String> {
    (kinetics.uses_c1_delta_c() && !kinetics.separates_c1_from_delta_c()).then(|| {
        format!(
            "under the {kinetics} kinetics c1 and delta_c enter only as c1 * delta_c^2: the data inform the product, and \
             the prior alone divides it between the two"
        )
    })
}

fn weighted_of<'a>(
    posterior: &'a Posterior,
    value: impl Fn(&[f64]) -> f64 + 'a,
) -> impl Iterator<Item = (f64, f64)> + 'a {
    posterior
        .samples
        .iter()
        .filter(|sample| sample.weight > 0.0)
        .map(move |sample| (value(&sample.theta), sample.weight))
}

fn paper_comparison(
    material: Material,
    radius_m: f64,
    model: &NeckGrowth,
    posterior: &Posterior,
) -> PaperComparison {
    // The form of Table 3 belongs to a radius; at that of Table 1 it is what the paper prints, to the digit.
    let si = material.table3_sintering_at(radius_m);
    let printed = if radius_m == material.powder().radius_m {
        material.table3()
    } else {
        printed::to_printed(&si, radius_m)
    };
    let percentile_si = model
        .names()
        .iter()
        .enumerate()
        .map(|(place, name)| {
            let value = match name {
                ParameterName::C1 => si.c1,
                ParameterName::TauS => si.tau_s,
                ParameterName::DeltaC => si.delta_c,
                ParameterName::Phi => return None,
            };
            let marginal = Weighted::new(weighted_of(posterior, move |theta| theta[place]));
            Some(100.0 * marginal.share_below(value))
        })
        .collect();
    PaperComparison {
        printed: [printed.c1, printed.tau_s, printed.delta_c],
        si: [si.c1, si.tau_s, si.delta_c],
        percentile_si,
    }
}

/// The posterior pushed, sample by sample, through the map to the form of Table 3.
fn printed_parameters(
    plan: &Plan,
    model: &NeckGrowth,
    posterior: &Posterior,
    paper: Option<&PaperComparison>,
) -> Vec<PrintedParameter> {
    let complete = [ParameterName::C1, ParameterName::TauS, ParameterName::DeltaC]
        .iter()
        .all(|name| model.names().contains(name));
    if !complete {
        return Vec::new();
    }
    let radius_m = plan.experiment.radius_m;
    let push = |theta: &[f64]| {
        let printed = printed::to_printed(&model.sintering(theta), radius_m);
        [printed.c1, printed.tau_s, printed.delta_c]
    };
    let at_map = push(&posterior.map.theta);
    // In the units that its numbers have: Table 3 itself prints 1/(Pa s) and s.
    [("c1", "1/(Pa s m)"), ("tau_s", "s m"), ("delta_c", "m")]
        .into_iter()
        .enumerate()
        .map(|(place, (name, unit))| {
            let log10 =
                Weighted::new(weighted_of(posterior, move |theta| push(theta)[place].log10()));
            let back = |[lower, upper]: [f64; 2]| [10f64.powf(lower), 10f64.powf(upper)];
            let (mean_log10, sd_log10) = log10.moments();
            let paper = paper.map(|paper| paper.printed[place]);
            PrintedParameter {
                name: name.to_owned(),
                unit: unit.to_owned(),
                map: at_map[place],
                median: 10f64.powf(log10.quantile(0.5)),
                mean_log10,
                sd_log10,
                eti50: back(log10.interval(0.5)),
                eti90: back(log10.interval(0.9)),
                eti95: back(log10.interval(0.95)),
                paper,
                paper_percentile: paper.map(|value| 100.0 * log10.share_below(value.log10())),
            }
        })
        .collect()
}

fn knee_summary(
    plan: &Plan,
    model: &NeckGrowth,
    posterior: &Posterior,
) -> Result<Option<KneeSummary>, Failure> {
    let scene = plan.scene()?;
    let at = |theta: &[f64]| {
        let knee = match model.scene(theta) {
            Ok(scene) => knee(&scene, &model.sintering(theta)),
            Err(_) => return None,
        };
        (knee.has_zipping && knee.has_stretching).then_some(knee)
    };
    let total: f64 = posterior.samples.iter().map(|sample| sample.weight).sum();
    let knees: Vec<_> = posterior
        .samples
        .iter()
        .filter(|sample| sample.weight > 0.0)
        .filter_map(|sample| at(&sample.theta).map(|knee| (knee, sample.weight)))
        .collect();
    let Some(at_map) = at(&posterior.map.theta) else {
        return Ok(None);
    };
    let with_knee: f64 = knees.iter().map(|(_, weight)| weight).sum();
    let paper = plan
        .material()
        .map(|material| knee(&scene, &material.table3_sintering_at(plan.experiment.radius_m)));
    let derived = |of: fn(&dem_core::Knee) -> f64| {
        let marginal = Weighted::new(knees.iter().map(|(knee, weight)| (of(knee), *weight)));
        Derived {
            map: of(&at_map),
            median: marginal.quantile(0.5),
            eti95: marginal.interval(0.95),
            paper: paper.as_ref().map(of),
        }
    };
    Ok(Some(KneeSummary {
        probability: (with_knee / total).min(1.0),
        contact_ratio: derived(|knee| knee.contact_ratio),
        time_s: derived(|knee| knee.time_s),
    }))
}

/// The curves at the observation times that the fit errors need.
struct AtData {
    paper: Option<Vec<f64>>,
    frenkel: Option<Vec<f64>>,
}

/// Times for plots: evenly spaced ones from zero, and logarithmic ones from below the first observation.
fn grid(observed_s: &[f64]) -> Vec<f64> {
    let last = observed_s.last().copied().unwrap_or(1.0);
    let last = if last > 0.0 { 1.02 * last } else { 1.0 };
    let mut times: Vec<f64> =
        (0..GRID_LINEAR).map(|k| last * k as f64 / (GRID_LINEAR - 1) as f64).collect();
    let first = observed_s.iter().copied().find(|t| *t > 0.0).unwrap_or(last);
    let first = (0.1 * first).min(1e-2 * last);
    times.extend((0..GRID_LOG).map(|k| first * (last / first).powf(k as f64 / GRID_LOG as f64)));
    times.retain(|time| time.is_finite());
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

fn curves(
    plan: &Plan,
    model: &NeckGrowth,
    posterior: &Posterior,
    frenkel_tau_s: Option<f64>,
    with_paper: bool,
) -> Result<(Curves, AtData), Failure> {
    let on_grid = model.at_times(grid(&plan.experiment.time_s));
    let points = on_grid.times_s().len();
    let draws = representative_draws(posterior);
    // One run per distinct sample, however many draws it stands for.
    let mut distinct: Vec<usize> = draws.iter().map(|draw| draw.sample).collect();
    distinct.sort_unstable();
    distinct.dedup();
    let thetas: Vec<f64> =
        distinct.iter().flat_map(|&sample| &posterior.samples[sample].theta).copied().collect();
    let mut outputs = vec![0.0; distinct.len() * points];
    let results = on_grid.simulate_batch(0, &thetas, &mut outputs);
    let kept: Vec<(&[f64], Option<f64>, f64)> = draws
        .iter()
        .enumerate()
        .filter_map(|(k, draw)| {
            let run = distinct.binary_search(&draw.sample).ok()?;
            let curve = results[run].is_ok().then(|| &outputs[run * points..][..points])?;
            // Noise by the golden-ratio sequence: stratified, and the same for every time, so that
            // the band is smooth.
            let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
            Some((curve, draw.sigma, smc_calib::normal::quantile(u)))
        })
        .collect();
    if kept.is_empty() {
        return Err(
            RunError::new("no posterior draw could be simulated between the observations").into()
        );
    }
    // Noise that is stated row by row is not known between the rows.
    let relative = match plan.noise {
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => share,
        _ => 0.0,
    };
    let noise_is_known = relative > 0.0 || kept.iter().all(|(_, sigma, _)| sigma.is_some());
    let rows: Vec<[f64; 7]> = (0..points)
        .into_par_iter()
        .map(|point| {
            let mut values: Vec<f64> = kept.iter().map(|(curve, ..)| curve[point]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.sort_unstable_by(f64::total_cmp);
            let mut noisy: Vec<f64> = kept
                .iter()
                .map(|(curve, sigma, score)| {
                    curve[point] + sigma.map_or(relative * curve[point], |sigma| sigma) * score
                })
                .collect();
            noisy.sort_unstable_by(f64::total_cmp);
            let [lower50, upper50] = [0.25, 0.75].map(|p| quantile(&values, p));
            let [lower90, upper90] = [0.05, 0.95].map(|p| quantile(&values, p));
            let [noisy_lower, noisy_upper] = [0.05, 0.95].map(|p| quantile(&noisy, p));
            [mean, lower50, upper50, lower90, upper90, noisy_lower, noisy_upper]
        })
        .collect();
    let column = |place: usize| rows.iter().map(|row| row[place]).collect::<Vec<_>>();

    let failed = |error: SimError| simulation_failure(&error);
    let mut map = vec![0.0; points];
    on_grid.simulate(&posterior.map.theta, &mut map).map_err(failed)?;
    let run = |model: &NeckGrowth, sintering: &dem_core::Sintering| {
        let mut curve = vec![0.0; model.times_s().len()];
        model.curve(sintering, &mut curve).map(|()| curve).map_err(failed)
    };
    let frenkel_of = |model: &NeckGrowth| {
        frenkel_tau_s
            .map(|tau_s| {
                let sintering = dem_core::Sintering { c1: 1.0, tau_s, delta_c: 1.0 };
                run(&model.with_kinetics(Kinetics::Frenkel), &sintering)
            })
            .transpose()
    };
    let (frenkel, frenkel_at_data) = (frenkel_of(&on_grid)?, frenkel_of(model)?);
    let three_stage = |model: &NeckGrowth| model.with_kinetics(Kinetics::ThreeStage);
    let table3 = plan
        .material()
        .filter(|_| with_paper)
        .map(|m| m.table3_sintering_at(plan.experiment.radius_m));
    let (paper, paper_at_data) = match table3 {
        Some(table3) => {
            (Some(run(&three_stage(&on_grid), &table3)?), Some(run(&three_stage(model), &table3)?))
        }
        None => (None, None),
    };
    Ok((
        Curves {
            time_s: on_grid.times_s().to_vec(),
            mean: column(0),
            curve50: [column(1), column(2)],
            curve90: [column(3), column(4)],
            noisy90: noise_is_known.then(|| [column(5), column(6)]),
            map,
            paper,
            frenkel,
        },
        AtData { paper: paper_at_data, frenkel: frenkel_at_data },
    ))
}

/// Evenly chosen draws, at most [`GRID_DRAWS`].
fn representative_draws(posterior: &Posterior) -> Vec<smc_calib::Draw> {
    let all = &posterior.draws;
    if all.len() <= GRID_DRAWS {
        return all.clone();
    }
    (0..GRID_DRAWS).map(|k| all[k * all.len() / GRID_DRAWS]).collect()
}

/// Quantile of sorted values, linear in between.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let position = p * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}
