//! Curves of a pair on a fine grid of times, with their posterior bands: what the fit plot draws.

use dem_core::{Kinetics, Sintering};
use rayon::prelude::*;
use smc_calib::{
    FixedSigma, Likelihood, Noise, NoiseDraw, SimError, Simulator as _, Weighted, distinct,
};

use super::of_pair::{OfPair, simulation_failure};
use crate::error::{Failure, RunError};
use crate::pair::model::NeckGrowth;
use crate::record::Curves;

/// Most posterior draws that are run on the fine grid of times.
const GRID_DRAWS: usize = 1024;
/// Number of evenly spaced times of that grid, and of logarithmically spaced ones for a logarithmic axis.
const GRID_LINEAR: usize = 201;
const GRID_LOG: usize = 60;

/// Curves at the observation times.
pub(super) struct AtData {
    pub(super) paper: Option<Vec<f64>>,
    pub(super) frenkel: Option<Vec<f64>>,
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

/// The bands and curves on the grid, and the curves of the paper and of the best Frenkel fit at the data.
pub(super) fn curves(
    of: &OfPair<'_>,
    frenkel_tau_s: Option<f64>,
) -> Result<(Curves, AtData), Failure> {
    let failed = |error: SimError| simulation_failure(&error);
    let on_grid = of.model.at_times(grid(&of.measured.control));
    let Bands { columns: [mean, lower50, upper50, lower90, upper90, lower, upper], noise_is_known } =
        bands(of, &on_grid)?;
    let mut map = vec![0.0; on_grid.times_s().len()];
    on_grid.simulate(&of.posterior.map.theta, &mut map).map_err(failed)?;
    let run = |model: &NeckGrowth, kinetics, sintering: Option<Sintering>| {
        let Some(sintering) = sintering else { return Ok(None) };
        let model = model.with_kinetics(kinetics);
        let mut curve = vec![0.0; model.times_s().len()];
        model.curve(&sintering, &mut curve).map(|()| Some(curve)).map_err(failed)
    };
    let (paper, frenkel) = (
        of.paper(),
        frenkel_tau_s.map(|tau_s| Sintering { c1: 1.0, tau_s, delta_c: 1.0, lambda: 0.0 }),
    );
    let between = on_grid.started_at(of.start_s()).heated_as(&of.posterior.map.theta);
    let at_data = of.reference();
    let at_data = AtData {
        paper: run(&at_data, Kinetics::ThreeStage, paper)?,
        frenkel: run(&at_data, Kinetics::Frenkel, frenkel)?,
    };
    let curves = Curves {
        time_s: on_grid.times_s().to_vec(),
        mean,
        curve50: [lower50, upper50],
        curve90: [lower90, upper90],
        noisy90: noise_is_known.then_some([lower, upper]),
        map,
        paper: run(&between, Kinetics::ThreeStage, paper)?,
        frenkel: run(&between, Kinetics::Frenkel, frenkel)?,
    };
    Ok((curves, at_data))
}

/// Mean, 50 % band, 90 % band, and 90 % band of a new measurement, each over all times.
struct Bands {
    columns: [Vec<f64>; 7],
    /// Whether the noise is known between the observations.
    noise_is_known: bool,
}

fn bands(of: &OfPair<'_>, on_grid: &NeckGrowth) -> Result<Bands, Failure> {
    let points = on_grid.times_s().len();
    let draws = representative_draws(of);
    let (distinct, runs) = distinct(&draws.iter().map(|(theta, _)| *theta).collect::<Vec<_>>());
    let thetas = distinct.concat();
    let mut outputs = vec![0.0; distinct.len() * points];
    let results = on_grid.simulate_batch(0, &thetas, &mut outputs);
    let errors = Errors::new(of)?;
    let kept: Vec<Drawn<'_>> = draws
        .par_iter()
        .enumerate()
        .filter_map(|(k, &(theta, noise))| {
            let run = runs[k];
            let curve = results[run].is_ok().then(|| &outputs[run * points..][..points])?;
            // Noise by golden-ratio sequences: stratified, and the same for every time, so that the band is smooth.
            let u = |step: f64| ((k as f64 + 0.5) * step).fract();
            let widening = noise.map_or(1.0, |noise| noise.widening(u(0.754_877_666_246_692_8)));
            let score = smc_calib::normal::quantile(u(0.618_033_988_749_894_9)) * widening;
            let errors = errors.at(of, theta, noise, on_grid.times_s());
            Some(Drawn { curve, noise, score, errors })
        })
        .collect();
    if kept.is_empty() {
        return Err(
            RunError::new("no posterior draw could be simulated between the observations").into()
        );
    }
    // Noise that is stated row by row is not known between the rows.
    let relative = match of.measured.noise {
        Noise::Fixed { sigma: FixedSigma::Relative(share) } => share,
        _ => 0.0,
    };
    let noise_is_known = relative > 0.0 || kept.iter().all(|drawn| drawn.noise.is_some());
    let rows: Vec<[f64; 7]> = (0..points)
        .into_par_iter()
        .map(|point| {
            let values: Vec<f64> = kept.iter().map(|drawn| drawn.curve[point]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let noisy = kept.iter().map(|drawn| drawn.noisy(point, relative));
            let [noisy_lower, noisy_upper] = Weighted::equal(noisy.collect()).interval(0.9);
            let values = Weighted::equal(values);
            let ([lower50, upper50], [lower90, upper90]) =
                (values.interval(0.5), values.interval(0.9));
            [mean, lower50, upper50, lower90, upper90, noisy_lower, noisy_upper]
        })
        .collect();
    let columns =
        std::array::from_fn(|place| rows.iter().map(|row| row[place]).collect::<Vec<_>>());
    Ok(Bands { columns, noise_is_known })
}

/// A draw on the grid.
struct Drawn<'a> {
    curve: &'a [f64],
    noise: Option<NoiseDraw>,
    /// Error over its standard deviation.
    score: f64,
    /// Mean and standard deviation of the errors; empty where they are those of the noise everywhere.
    errors: Vec<[f64; 2]>,
}

impl Drawn<'_> {
    /// Value of a new measurement at a time of the grid.
    fn noisy(&self, point: usize, relative: f64) -> f64 {
        let value = self.curve[point];
        match self.errors.get(point) {
            Some([mean, sd]) => value + mean + sd * self.score,
            None => value + self.noise.map_or(relative * value, |noise| noise.sigma) * self.score,
        }
    }
}

/// Errors that are alike near the observations.
struct Errors(Option<Likelihood>);

impl Errors {
    fn new(of: &OfPair<'_>) -> Result<Self, Failure> {
        let noise = &of.measured.noise;
        if !noise.is_correlated() {
            return Ok(Self(None));
        }
        let likelihood = Likelihood::new(noise, &of.measured.observations()?)
            .map_err(|error| Failure::from(RunError::new(error)))?;
        Ok(Self(Some(likelihood)))
    }

    /// Errors of a draw at some times, in the experiment that was observed.
    fn at(
        &self,
        of: &OfPair<'_>,
        theta: &[f64],
        noise: Option<NoiseDraw>,
        times: &[f64],
    ) -> Vec<[f64; 2]> {
        let (Some(likelihood), Some(noise)) = (&self.0, noise) else { return Vec::new() };
        let mut curve = vec![0.0; of.measured.values.len()];
        match of.model.simulate(theta, &mut curve) {
            Ok(()) => likelihood.errors_at(&noise, &curve, times),
            Err(_) => Vec::new(),
        }
    }
}

/// Evenly chosen draws, at most [`GRID_DRAWS`]: their parameters, and the noise of this pair's observable.
fn representative_draws<'a>(of: &OfPair<'a>) -> Vec<(&'a [f64], Option<NoiseDraw>)> {
    let posterior = of.posterior;
    let all = &posterior.draws;
    let noise = |draw: usize| match of.posterior.groups.get(of.group) {
        Some(group) => group.noise_draw(draw),
        None => all[draw].noise(),
    };
    let kept = all.len().min(GRID_DRAWS);
    let chosen = (0..kept).map(|k| k * all.len() / kept);
    chosen.map(|draw| (posterior.theta(&all[draw]), noise(draw))).collect()
}
