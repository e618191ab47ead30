//! Simulation-based calibration: do posteriors hold the truth as often as they say?
//!
//! S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, "Validating Bayesian inference algorithms with
//! simulation-based calibration" (2018): draw parameters and noise from the priors, data from both, calibrate; the
//! posterior's distribution function at the truth is then uniform over data sets. For parameters and functions of
//! them it is the share of the importance weights below the truth; where sigma takes part, that of the draws. Where a Gaussian process
//! made the draws, parameters are ranked among these, and likelihoods among some of them that are simulated.
//! Uniformity is judged by the simultaneous band of the empirical distribution function: T. Säilynoja,
//! P.-C. Bürkner, A. Vehtari, "Graphical test for discrete uniformity and its applications in goodness-of-fit
//! evaluation and multiple sample comparison", Stat. Comput. 32 (2022) 32.

use crate::simulator::outputs_at;
use crate::sobol::evenly;
use crate::stream::{Purpose, normals, stream};
use crate::{
    CalibrateError, Draw, Likelihood, Noise, NoiseDraw, NoiseQuantity, NoiseShape, Observations,
    Parameter, Point, Posterior, Problem, Settings, ShapeSummary, Simulator, calibrate,
};
use rand::rngs::ChaCha8Rng;
use rand::{Rng, RngExt};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::function::gamma::ln_gamma;

/// Most draws that are simulated to rank likelihoods and noise.
const SIMULATED_DRAWS: usize = 128;
/// Points at which empirical distribution functions are compared with the uniform one.
const POINTS: usize = 100;

/// A study in simulation-based calibration.
pub struct Study<'a> {
    /// The simulator.
    pub simulator: &'a dyn Simulator,
    /// Parameters and their priors, from which the truth is drawn.
    pub parameters: Vec<Parameter>,
    /// Control variable of the observations.
    pub control: Vec<f64>,
    /// The noise model that data are calibrated with; its prior is what noise is drawn from.
    pub noise: Noise,
    /// Where the data come from, if not from the same simulator and noise.
    pub origin: Option<Origin<'a>>,
    /// The sampler's settings; data set k is calibrated with seed `settings.seed + k`.
    pub settings: Settings,
    /// Number of data sets.
    pub data_sets: usize,
}

/// Data from another simulator, with other errors, than those of the calibration: what a wrong model costs.
pub struct Origin<'a> {
    /// What makes the curve of the drawn parameters.
    pub simulator: &'a dyn Simulator,
    /// Draws the noise, and an error for each observation.
    pub errors: &'a (dyn Fn(&mut ChaCha8Rng) -> Option<MadeErrors> + Sync),
}

/// Noise that was drawn, and an error for each observation.
pub type MadeErrors = (NoiseDraw, Vec<f64>);

/// One calibrated data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The posterior's distribution function at the truth, for each of [`quantities`]; with data of another
    /// [`Origin`] those of correlation length and white share are not numbers.
    pub ranks: Vec<f64>,
    /// Whether the 50 % interval of each of [`intervals`] holds the truth.
    pub inside50: Vec<bool>,
    /// Likewise for the 95 % interval.
    pub inside95: Vec<bool>,
    /// Posterior standard deviations of the parameters, in the priors' coordinates.
    pub sd: Vec<f64>,
    /// Log evidence.
    pub log_evidence: f64,
    /// Pareto shape.
    pub khat: f64,
    /// Effective sample size.
    pub ess: f64,
}

/// Names of what has intervals: parameters, sigma, and of correlated noise its length and white share.
pub fn intervals(parameters: &[Parameter], noise: &Noise) -> Vec<String> {
    let mut all: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
    all.push("sigma".to_owned());
    if noise.is_correlated() {
        all.extend(SHAPE.map(str::to_owned));
    }
    all
}

/// What correlated noise has beside sigma.
const SHAPE: [&str; 2] = ["correlation length", "white share"];

/// Names of what is ranked: parameters, sigma, log likelihood with the noise integrated out and (inferred noise) with
/// sigma, products of parameters (of their normal scores), and of correlated noise its length and white share.
pub fn quantities(parameters: &[Parameter], noise: &Noise) -> Vec<String> {
    let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
    let mut all: Vec<String> = names.iter().map(|n| (*n).to_owned()).collect();
    all.push("sigma".to_owned());
    all.push("log likelihood".to_owned());
    if matches!(noise, Noise::Inferred { .. }) {
        all.push("log likelihood at sigma".to_owned());
    }
    for i in 0..names.len() {
        for j in 0..i {
            all.push(format!("{} x {}", names[j], names[i]));
        }
    }
    if noise.is_correlated() {
        all.extend(SHAPE.map(str::to_owned));
    }
    all
}

/// Calibrates all data sets; in the order of their numbers, whatever the threads.
///
/// # Errors
/// Same as [`calibrate`].
pub fn run(study: &Study<'_>) -> Result<Vec<Outcome>, CalibrateError> {
    (0..study.data_sets).into_par_iter().map(|k| one(study, k)).collect()
}

/// Makes and calibrates data set `k`.
fn one(study: &Study<'_>, k: usize) -> Result<Outcome, CalibrateError> {
    let mut rng = stream(study.settings.seed, Purpose::Truth, 0, k);
    let d = study.parameters.len();
    let rows = study.control.len();
    let simulator = study.origin.as_ref().map_or(study.simulator, |origin| origin.simulator);
    // Parameters that cannot be simulated have posterior zero, so they are no truth either.
    let (z, theta, outputs) = loop {
        let z = normals(d, &mut rng);
        let theta: Vec<f64> =
            study.parameters.iter().zip(&z).map(|(p, z)| p.prior.from_z(*z)).collect();
        let outputs = outputs_at(simulator, &theta, rows);
        if let Some(outputs) = outputs.map_err(|error| CalibrateError::ended_by(error, 0))? {
            break (z, theta, outputs);
        }
    };
    let drawn = match &study.origin {
        Some(origin) => (origin.errors)(&mut rng),
        None => study.noise.draw_errors(&study.control, &mut rng),
    };
    let fatal = |cause: String| CalibrateError::Fatal { cause, simulations: 0 };
    let (noise, errors) =
        drawn.ok_or_else(|| fatal("made data: noise without a prior of its size".to_owned()))?;
    let values: Vec<f64> = outputs.iter().zip(&errors).map(|(o, e)| o + e).collect();
    let observations = Observations::new(study.control.clone(), values)
        .map_err(|e| fatal(format!("made data: {e}")))?;
    let likelihood = Likelihood::new(&study.noise, &observations)?;
    let fine = likelihood.ranking(&observations).filter(|_| study.origin.is_none());
    let problem = Problem {
        simulator: study.simulator,
        parameters: study.parameters.clone(),
        observations,
        noise: study.noise.clone(),
    };
    let settings = Settings {
        seed: study.settings.seed.wrapping_add(k as u64),
        map_simulations: 0,
        path: false,
        ..study.settings.clone()
    };
    let posterior = calibrate(&problem, &settings, &mut ())?;
    let truth = Truth { z, theta, noise, ln_likelihood: likelihood.ln_joint(&outputs) };
    let mut ties = stream(study.settings.seed, Purpose::Ties, 0, k);
    // Draws of a process, and samples that were moved, have no simulation yet.
    let again = posterior.is_drawn() || posterior.moved.is_some();
    let correlated = study.noise.is_correlated();
    let simulated = if again || correlated {
        simulated(&posterior, study.simulator, rows)?
    } else {
        Vec::new()
    };
    let mut ranks =
        ranks((&posterior, again.then_some(&simulated[..])), &truth, &likelihood, &mut ties);
    if correlated {
        let found = fine.and_then(|fine| shape_ranks(&simulated, &truth, &fine));
        ranks.extend(found.unwrap_or([f64::NAN; 2]));
    }
    Ok(Outcome {
        ranks,
        inside50: inside(&posterior, &truth, 0.5),
        inside95: inside(&posterior, &truth, 0.95),
        sd: posterior.parameters.iter().map(|p| p.in_coordinate.sd).collect(),
        log_evidence: posterior.log_evidence.value,
        khat: posterior.khat,
        ess: posterior.ess.importance,
    })
}

struct Truth {
    z: Vec<f64>,
    theta: Vec<f64>,
    noise: NoiseDraw,
    ln_likelihood: f64,
}

/// A draw and its outputs; none where its simulation fails.
type Simulated<'p> = (&'p Draw, Option<Vec<f64>>);

/// Simulations at evenly chosen draws.
fn simulated<'p>(
    p: &'p Posterior,
    simulator: &dyn Simulator,
    rows: usize,
) -> Result<Vec<Simulated<'p>>, CalibrateError> {
    let chosen = evenly(p.draws.len(), p.draws.len().min(SIMULATED_DRAWS)).map(|k| &p.draws[k]);
    let each = chosen.enumerate().map(|(before, draw)| {
        let outputs = outputs_at(simulator, p.theta(draw), rows);
        let ended = |error| CalibrateError::ended_by(error, p.samples.len() + before);
        Ok((draw, outputs.map_err(ended)?))
    });
    each.collect()
}

/// Posterior distribution functions of correlation length and white share at the truth: exactly for given parameters,
/// averaged over draws of these.
fn shape_ranks(simulated: &[Simulated<'_>], truth: &Truth, fine: &Likelihood) -> Option<[f64; 2]> {
    let shape = truth.noise.shape?;
    let (mut sums, mut used) = ([0.0; 2], 0.0);
    for outputs in simulated.iter().filter_map(|(_, outputs)| outputs.as_ref()) {
        let below = fine.below(&shape, outputs)?;
        sums = [sums[0] + below[0], sums[1] + below[1]];
        used += 1.0;
    }
    Some(sums.map(|sum| sum / used))
}

/// Posterior distribution functions at the truth; a random place within ties.
fn ranks(
    (p, simulated): (&Posterior, Option<&[Simulated<'_>]>),
    truth: &Truth,
    likelihood: &Likelihood,
    rng: &mut impl Rng,
) -> Vec<f64> {
    let d = truth.z.len();
    let known = |ln_l: Option<f64>| ln_l.unwrap_or(f64::NEG_INFINITY);
    // Draws and their log likelihoods.
    let ranked: Vec<(&Draw, f64)> = match simulated {
        Some(simulated) => {
            let ln_l =
                |outputs: &Option<Vec<f64>>| outputs.as_ref().map(|o| likelihood.ln_joint(o));
            simulated.iter().map(|(draw, outputs)| (*draw, known(ln_l(outputs)))).collect()
        }
        None => p.draws.iter().map(|d| (d, known(p.samples[d.sample].log_likelihood))).collect(),
    };
    let mut rank = |values: &mut dyn Iterator<Item = (f64, f64)>, at: f64| -> f64 {
        let (mut below, mut equal) = (0.0, 0.0);
        for (value, weight) in values {
            if value < at {
                below += weight;
            } else if value == at {
                equal += weight;
            }
        }
        (below + rng.random::<f64>() * equal).clamp(0.0, 1.0)
    };
    let mut out: Vec<f64> = (0..d)
        .map(|j| rank(&mut p.points().map(|at| (at.theta[j], at.weight)), truth.theta[j]))
        .collect();
    let samples = p.samples.iter().filter(|s| s.weight > 0.0);
    let mut of_samples = samples.map(|s| (known(s.log_likelihood), s.weight));
    let marginal = simulated.is_none().then(|| rank(&mut of_samples, truth.ln_likelihood));
    let z = |at: &Point<'_>, j: usize| p.parameters[j].parameter.prior.to_z(at.theta[j]);
    let mut products = Vec::new();
    for i in 0..d {
        for j in 0..i {
            let mut of = p.points().map(|at| (z(&at, i) * z(&at, j), at.weight));
            products.push(rank(&mut of, truth.z[i] * truth.z[j]));
        }
    }
    let m = likelihood.values().len() as f64;
    let joint = |ln_joint: f64, sigma: f64| {
        let s = likelihood.sum_of_squares_at(ln_joint).unwrap_or(f64::NAN);
        -m * sigma.ln() - 0.5 * s / (sigma * sigma)
    };
    let mut drawn = |value: &dyn Fn(f64, f64) -> f64, at: f64| -> f64 {
        let values = ranked.iter().map(|(d, ln)| value(*ln, d.sigma.unwrap_or(f64::NAN)));
        let below = values.filter(|value| *value < at).count();
        (below as f64 + rng.random::<f64>()) / (ranked.len() + 1) as f64
    };
    out.push(drawn(&|_, sigma| sigma, truth.noise.sigma));
    out.push(marginal.unwrap_or_else(|| drawn(&|ln, _| ln, truth.ln_likelihood)));
    if likelihood.inferred().is_some() && matches!(p.noise, Noise::Inferred { .. }) {
        out.push(drawn(&joint, joint(truth.ln_likelihood, truth.noise.sigma)));
    }
    out.extend(products);
    out
}

fn inside(p: &Posterior, truth: &Truth, share: f64) -> Vec<bool> {
    let mut all: Vec<bool> = p
        .parameters
        .iter()
        .zip(&truth.theta)
        .map(|(s, theta)| {
            let i = if share == 0.5 { s.in_si.eti50 } else { s.in_si.eti95 };
            (i.lower..=i.upper).contains(theta)
        })
        .collect();
    all.push(p.sigma.is_some_and(|s| {
        let [lower, upper] = if share == 0.5 { s.eti50 } else { s.eti95 };
        (lower..=upper).contains(&truth.noise.sigma)
    }));
    if p.noise.is_correlated() {
        all.extend(inside_shape(p, truth, share));
    }
    all
}

/// Whether the intervals of correlation length and white share hold the truth.
fn inside_shape(p: &Posterior, truth: &Truth, share: f64) -> [bool; 2] {
    let Some(ShapeSummary::Correlated { length, white_share, .. }) = &p.noise_shape else {
        return [false; 2];
    };
    let Some(NoiseShape::Correlated { length: l, white_share: w }) = truth.noise.shape else {
        return [false; 2];
    };
    let holds = |quantity: &NoiseQuantity, at: f64| {
        let [lower, upper] = if share == 0.5 { quantity.eti50 } else { quantity.eti95 };
        (lower..=upper).contains(&at)
    };
    [holds(length, l), holds(white_share, w)]
}

/// The simultaneous band of the empirical distribution function of `n` independent uniform numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    n: usize,
    /// ln k!
    ln_factorial: Vec<f64>,
    /// Pointwise probability outside at each point.
    pub pointwise: f64,
    /// Smallest and largest count at k/100, k = 1..99.
    pub counts: Vec<(usize, usize)>,
}

impl Band {
    /// The band that all of the function stays inside with at least this probability.
    ///
    /// The counts at successive points are a Markov chain of binomial steps, so the probability of a band is exact
    /// (section 2.2 of the paper of 2022); the pointwise level is found by bisection.
    pub fn new(n: usize, probability: f64) -> Self {
        let ln_factorial = (0..=n).map(|k| ln_gamma(k as f64 + 1.0)).collect();
        let mut band = Self { n, ln_factorial, pointwise: 0.0, counts: Vec::new() };
        let (mut low, mut high) = (f64::ln(1e-12), f64::ln(1.0 - probability));
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            if band.coverage(&band.limits(middle.exp())) >= probability {
                low = middle;
            } else {
                high = middle;
            }
        }
        band.pointwise = low.exp();
        band.counts = band.limits(band.pointwise);
        band
    }

    /// Whether these numbers stay inside.
    pub fn holds(&self, ranks: &[f64]) -> bool {
        counts(ranks).iter().zip(&self.counts).all(|(c, (low, high))| (low..=high).contains(&c))
    }

    /// Probability that uniform numbers stray as far as these at their worst point.
    pub fn p_value(&self, ranks: &[f64]) -> f64 {
        let worst = counts(ranks)
            .iter()
            .enumerate()
            .map(|(k, c)| {
                let p = (k + 1) as f64 / POINTS as f64;
                let below: f64 = (0..=*c).map(|j| self.pmf(j, self.n, p)).sum();
                let above: f64 = (*c..=self.n).map(|j| self.pmf(j, self.n, p)).sum();
                2.0 * below.min(above)
            })
            .fold(1.0, f64::min);
        // A little narrower, so that the worst point itself is outside.
        (1.0 - self.coverage(&self.limits((worst * (1.0 + 1e-9)).min(1.0)))).clamp(0.0, 1.0)
    }

    fn pmf(&self, k: usize, n: usize, p: f64) -> f64 {
        let ln = self.ln_factorial[n] - self.ln_factorial[k] - self.ln_factorial[n - k];
        (ln + k as f64 * p.ln() + (n - k) as f64 * (-p).ln_1p()).exp()
    }

    /// Counts that are outside with at most half the pointwise probability on either side.
    fn limits(&self, pointwise: f64) -> Vec<(usize, usize)> {
        (1..POINTS)
            .map(|k| {
                let p = k as f64 / POINTS as f64;
                let (mut low, mut sum) = (0, self.pmf(0, self.n, p));
                while sum < 0.5 * pointwise && low < self.n {
                    low += 1;
                    sum += self.pmf(low, self.n, p);
                }
                let (mut high, mut sum) = (self.n, self.pmf(self.n, self.n, p));
                while sum < 0.5 * pointwise && high > low {
                    high -= 1;
                    sum += self.pmf(high, self.n, p);
                }
                (low, high)
            })
            .collect()
    }

    /// Probability that uniform numbers keep inside the limits.
    fn coverage(&self, limits: &[(usize, usize)]) -> f64 {
        let mut before = vec![1.0];
        let mut first = 0;
        for (k, (low, high)) in limits.iter().enumerate() {
            // The share of what is left that falls into the next step.
            let p = 1.0 / (POINTS - k) as f64;
            let mut now = vec![0.0; high - low + 1];
            for (i, mass) in before.iter().enumerate().filter(|(_, m)| **m > 1e-14) {
                let from = first + i;
                for (j, now) in now.iter_mut().enumerate() {
                    let to = low + j;
                    if to >= from {
                        *now += mass * self.pmf(to - from, self.n - from, p);
                    }
                }
            }
            (before, first) = (now, *low);
        }
        before.iter().sum()
    }
}

/// Number of `ranks` not above k/100, for k = 1..99.
pub fn counts(ranks: &[f64]) -> Vec<usize> {
    let mut sorted = ranks.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    (1..POINTS).map(|k| sorted.partition_point(|r| *r <= k as f64 / POINTS as f64)).collect()
}

/// z-score of a share of hits among independent trials of a known probability.
pub fn coverage_score(hits: usize, trials: usize, probability: f64) -> f64 {
    let n = trials as f64;
    (hits as f64 / n - probability) / (probability * (1.0 - probability) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal;

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn the_band_holds_uniform_numbers_as_often_as_it_says() {
        let (n, repeats) = (200, 4000);
        let band = Band::new(n, 0.95);
        let (mut held, mut low) = (0u32, 0u32);
        for r in 0..repeats {
            let mut rng = stream(21, Purpose::Truth, 1, r);
            let ranks: Vec<f64> = (0..n).map(|_| rng.random()).collect();
            held += u32::from(band.holds(&ranks));
            low += u32::from(band.p_value(&ranks) < 0.05);
        }
        let share = f64::from(held) / repeats as f64;
        assert!((0.94..0.965).contains(&share), "{share}");
        // Counts are whole, so p-values are a little conservative.
        let low = f64::from(low) / repeats as f64;
        assert!((0.03..0.06).contains(&low), "{low}");
    }

    // The shifted function is 0.119 off at the middle; Kolmogorov's limit gives p = 2 exp(-2 500 0.119^2) = 1.4e-6.
    #[test]
    fn ranks_that_pile_up_at_the_ends_or_drift_leave_the_band() {
        let n = 500;
        let band = Band::new(n, 0.95);
        let even: Vec<f64> = (0..n).map(|i| (i as f64 + 0.5) / n as f64).collect();
        assert!(band.holds(&even) && band.p_value(&even) > 0.9);
        let narrow: Vec<f64> =
            even.iter().map(|u| normal::cdf(1.3 * normal::quantile(*u))).collect();
        let shifted: Vec<f64> =
            even.iter().map(|u| normal::cdf(0.3 + normal::quantile(*u))).collect();
        assert!(!band.holds(&narrow) && band.p_value(&narrow) < 1e-3);
        assert!(!band.holds(&shifted) && band.p_value(&shifted) < 1e-4);
    }
}
