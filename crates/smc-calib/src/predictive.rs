//! Posterior predictive bands.

use crate::draws::Draws;
use crate::estimate::Estimator;
use crate::sampler::Sampler;
use crate::simulator::outputs_at;
use crate::sobol::evenly;
use crate::stream::{Purpose, stream};
use crate::target::CurveTarget;
use crate::weighted::Weighted;
use crate::{BandPoint, Draw, GroupSummary, NoiseDraw, Posterior, SimError, Simulator, distinct};
use rand::RngExt;
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Intervals of 50, 90 and 95 %. Their probabilities are written out: computed ones are off by a rounding.
pub(crate) fn intervals(values: &Weighted) -> [[f64; 2]; 3] {
    [[0.25, 0.75], [0.05, 0.95], [0.025, 0.975]].map(|ends| ends.map(|p| values.quantile(p)))
}

/// Bands from equally weighted curve values and noisy ones.
fn band(index: usize, control: f64, mean: f64, values: Vec<f64>, noisy: Vec<f64>) -> BandPoint {
    let [curve50, curve90, curve95] = intervals(&Weighted::equal(values));
    let [noisy50, noisy90, noisy95] = intervals(&Weighted::equal(noisy));
    BandPoint { index, control, mean, curve50, curve90, curve95, noisy50, noisy90, noisy95 }
}

/// Most errors of correlated noise that are kept for the bands (128 MB).
const MAX_ERRORS: usize = 8_000_000;

/// Bands at the observations that were kept. Those of a new observation are of one in the same experiment: correlated
/// errors are known from the residuals there.
pub(crate) fn at_observations(
    target: &CurveTarget<'_>,
    sampler: &Sampler<'_>,
    estimator: &Estimator,
    (draws, of): (&[Draw], &Draws<'_>),
    groups: &[GroupSummary],
) -> Vec<BandPoint> {
    if draws.is_empty() {
        return Vec::new();
    }
    let pool = &sampler.pool;
    let width = pool.kept_width;
    let control = target.problem.control();
    let errors = Errors::new(target, (draws, of), groups);
    (0..target.indices.len())
        .into_par_iter()
        .map(|k| {
            let index = target.indices[k];
            let values: Vec<f64> = (0..draws.len()).map(|at| of.outputs(at)[k]).collect();
            let mut rng = stream(sampler.settings.seed, Purpose::Predictive, 0, k);
            let point_sigma = target.likelihood.fixed_sigma(index);
            let group = groups.iter().find(|g| g.places().contains(&index));
            let noise = |at: usize| group.map_or(draws[at].noise(), |g| g.noise_draw(at));
            let noisy: Vec<f64> = match &errors {
                Some(errors) => {
                    let used = errors.draws.iter().enumerate();
                    used.map(|(row, at)| {
                        let [mean, sd] = errors.table[row * control.len() + index];
                        let widening = noise(*at).map_or(1.0, |n| n.widening(rng.random()));
                        let score: f64 = rng.sample(StandardNormal);
                        values[*at] + mean + sd * widening * score
                    })
                    .collect()
                }
                None => (values.iter().enumerate())
                    .map(|(at, v)| {
                        let sigma = noise(at).map(|noise| noise.sigma);
                        let score: f64 = rng.sample(StandardNormal);
                        v + sigma.or(point_sigma).unwrap_or(0.0) * score
                    })
                    .collect(),
            };
            let mean = of.mean(estimator, |i| pool.kept[i * width + k], |at| values[at]);
            band(index, control[index], mean, values, noisy)
        })
        .collect()
}

/// Mean and standard deviation of new errors at all observations, for evenly chosen draws.
struct Errors {
    draws: Vec<usize>,
    /// One row for each of these draws.
    table: Vec<[f64; 2]>,
}

impl Errors {
    /// None where no group's noise has more than its standard deviation.
    fn new(
        target: &CurveTarget<'_>,
        (draws, of): (&[Draw], &Draws<'_>),
        groups: &[GroupSummary],
    ) -> Option<Self> {
        if !target.likelihood.has_shape() {
            return None;
        }
        let control = target.problem.control();
        let m = control.len();
        let count = draws.len().min((MAX_ERRORS / m).max(100));
        let used: Vec<usize> = evenly(draws.len(), count).collect();
        let mut table = vec![[0.0; 2]; count * m];
        table.par_chunks_mut(m).zip(&used).for_each(|(row, at)| {
            let curve = &of.outputs(*at)[..m];
            for (g, (part, range)) in target.likelihood.groups().enumerate() {
                let noise = groups.get(g).map_or(draws[*at].noise(), |g| g.noise_draw(*at));
                let found = match noise {
                    Some(noise) => {
                        part.errors_at(&noise, &curve[range.clone()], &control[range.clone()])
                    }
                    None => range
                        .clone()
                        .map(|i| [0.0, part.fixed_sigma(i - range.start).unwrap_or(0.0)])
                        .collect(),
                };
                row[range].copy_from_slice(&found);
            }
        });
        Some(Self { draws: used, table })
    }
}

/// Posterior predictive bands on any grid.
///
/// `simulator` gives the curve at `control` for the same parameters; it is run for at most `max_draws` of the
/// posterior's draws, evenly chosen. Draws that fail on this grid are left out. Noise is added where the
/// posterior knows one standard deviation for all points, as in a new experiment (what the residuals say of correlated
/// errors near the observations: [`Likelihood::errors_at`](crate::Likelihood::errors_at)); with several groups of
/// observations none is ([`predictive_band_of_group`] adds it).
///
/// # Errors
/// A fatal simulator error, or no draw that can be simulated.
pub fn predictive_band(
    posterior: &Posterior,
    simulator: &dyn Simulator,
    control: &[f64],
    max_draws: usize,
) -> Result<Vec<BandPoint>, SimError> {
    band_on_grid(posterior, simulator, control, max_draws, &|at| posterior.draws[at].noise())
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
    band_on_grid(posterior, simulator, control, max_draws, &|at| group.noise_draw(at))
}

/// Bands on a grid; `noise` is the noise of a draw.
fn band_on_grid(
    posterior: &Posterior,
    simulator: &dyn Simulator,
    control: &[f64],
    max_draws: usize,
    noise: &(dyn Fn(usize) -> Option<NoiseDraw> + Sync),
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
    let chosen: Vec<usize> = evenly(all.len(), count).collect();
    if let Some(draw) = all.iter().find(|draw| draw.sample >= posterior.samples.len()) {
        let sample = draw.sample;
        let text = format!("draw refers to sample {sample}, which does not exist");
        return Err(SimError::fatal(text));
    }
    let thetas: Vec<&[f64]> = chosen.iter().map(|at| posterior.theta(&all[*at])).collect();
    let (distinct, curve_of) = distinct(&thetas);
    let curves: Vec<Option<Vec<f64>>> = distinct
        .par_iter()
        .map(|theta| outputs_at(simulator, theta, control.len()))
        .collect::<Result<_, _>>()?;
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
                let noise = noise(*draw);
                let score: f64 = rng.sample(StandardNormal);
                let outliers = noise.is_some_and(|noise| noise.shape.is_some());
                let u = if outliers { rng.random() } else { 1.0 };
                noisy.push(curve[k] + noise.map_or(0.0, |n| n.sigma * n.widening(u)) * score);
            }
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            band(k, control[k], mean, values, noisy)
        })
        .collect())
}
