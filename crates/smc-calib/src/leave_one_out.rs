//! Prediction of each observation by the others.
//!
//! A. Vehtari, A. Gelman, J. Gabry, "Practical Bayesian model evaluation using leave-one-out cross-validation and
//! WAIC", Stat. Comput. 27 (2017) 1413. A sample of the posterior becomes one of the posterior without observation i when
//! its weight is divided by `p(y_i | all others, theta, noise)`, which is `p(y_i | theta, sigma^2)` where the errors are
//! independent; the tail of these ratios is Pareto smoothed ([`psis`]), and its shape
//! says whether the answer can be trusted.

use crate::joint::{JointLikelihood, JointProblem};
use crate::stream::{Purpose, stream};
use crate::{CalibrateError, NoiseDraw, Posterior, Problem, SimError, psis};
use rand_distr::{ChiSquared, Distribution};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Most numbers kept of all curves together (480 MB); with more, only as many samples as fit are used.
const MAX_KEPT: usize = 60_000_000;

/// Leave-one-out predictive density of a posterior.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaveOneOut {
    /// One entry per observation.
    pub points: Vec<LeaveOneOutPoint>,
    /// Sum of the log densities (elpd).
    pub ln_density: f64,
    /// Its spread over data sets: sqrt(m) times the standard deviation over the m observations.
    pub spread: f64,
    /// Its Monte Carlo standard error.
    pub se: f64,
    /// Effective number of parameters: log density with each observation included minus with it left out.
    pub effective_parameters: f64,
    /// Largest Pareto shape.
    pub khat: f64,
}

/// One observation predicted by the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaveOneOutPoint {
    /// Observation, from 0.
    pub index: usize,
    /// Control value (time).
    pub control: f64,
    /// `ln p(y_i | all others)`.
    pub ln_density: f64,
    /// Pareto shape of the ratios; trustworthy below [`KHAT_LIMIT`](crate::trust::limits::KHAT_LIMIT).
    pub khat: f64,
}

/// Leaves out each observation in turn, without new inference.
///
/// Each sample of positive weight is simulated once more, and sigma^2 drawn for it from
/// Inverse-Gamma((nu0 + m)/2, (nu0 s0^2 + S(theta))/2) where it is inferred. `None` for tuned noise, which has no
/// posterior.
///
/// # Errors
/// Noise that does not fit, or a simulator that cannot run or is interrupted.
pub fn leave_one_out(
    problem: &Problem<'_>,
    posterior: &Posterior,
) -> Result<Option<LeaveOneOut>, CalibrateError> {
    leave_one_out_of(&problem.into(), posterior, |sample, outputs| {
        problem.simulator.simulate(&posterior.samples[sample].theta, outputs)
    })
}

/// Same as [`leave_one_out`], for any number of groups of observations, with the curve of sample s from
/// `curve(s, outputs)`: from what was stored of the run, where a simulation is expensive.
///
/// # Errors
/// Noise that does not fit, or an error of `curve` that is not recoverable.
pub fn leave_one_out_of(
    problem: &JointProblem<'_>,
    posterior: &Posterior,
    curve: impl Fn(usize, &mut [f64]) -> Result<(), SimError> + Sync,
) -> Result<Option<LeaveOneOut>, CalibrateError> {
    if !posterior.is_posterior {
        return Ok(None);
    }
    let likelihood = JointLikelihood::new(problem)?;
    let m = problem.observations();
    let chosen = chosen(posterior, (MAX_KEPT / m.max(1)).max(1000));
    let rows: Vec<Option<Vec<f64>>> = chosen
        .par_iter()
        .map(|&s| densities(&likelihood, posterior.settings.seed, s, m, &curve))
        .collect::<Result<_, _>>()?;
    let mut kept = Kept::default();
    for (s, row) in chosen.iter().zip(rows) {
        if let Some(row) = row {
            let sample = &posterior.samples[*s];
            kept.ln_weights.push(sample.weight.ln());
            kept.replicates.push(sample.replicate);
            kept.rows.push(row);
        }
    }
    let control = problem.control();
    let total: f64 = kept.ln_weights.iter().map(|w| w.exp()).sum();
    let results: Vec<LeftOut> =
        (0..m).into_par_iter().map(|i| kept.without(i, control[i], total)).collect();
    Ok(Some(summary(&results)))
}

/// Samples of positive weight; of too many the `most` of largest weight, in order.
fn chosen(posterior: &Posterior, most: usize) -> Vec<usize> {
    let weight = |s: &usize| posterior.samples[*s].weight;
    let mut chosen: Vec<usize> = (0..posterior.samples.len()).filter(|s| weight(s) > 0.0).collect();
    if chosen.len() > most {
        chosen.sort_unstable_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.cmp(b)));
        chosen.truncate(most);
        chosen.sort_unstable();
    }
    chosen
}

/// The samples that could be simulated again.
#[derive(Default)]
struct Kept {
    ln_weights: Vec<f64>,
    replicates: Vec<usize>,
    /// `ln p(y_i | theta_s, sigma_s^2)`, one row per sample.
    rows: Vec<Vec<f64>>,
}

/// One observation left out.
struct LeftOut {
    point: LeaveOneOutPoint,
    /// Log density with the observation included minus with it left out.
    gain: f64,
    /// Share of every sub-net in the error of the log density.
    parts: Vec<f64>,
}

impl Kept {
    /// Predicts observation i by the others; `total` is the sum of the weights.
    fn without(&self, i: usize, control: f64, total: f64) -> LeftOut {
        let Self { ln_weights, replicates, rows } = self;
        let ln_ratios: Vec<f64> = ln_weights.iter().zip(rows).map(|(w, row)| w - row[i]).collect();
        let smoothed = psis::smooth(&ln_ratios);
        let density: f64 = smoothed.weights.iter().zip(rows).map(|(w, row)| w * row[i].exp()).sum();
        let included: f64 =
            ln_weights.iter().zip(rows).map(|(w, row)| w.exp() * row[i].exp()).sum::<f64>() / total;
        let mut parts = vec![0.0; replicates.iter().max().map_or(0, |r| r + 1)];
        for ((w, row), replicate) in smoothed.weights.iter().zip(rows).zip(replicates) {
            parts[*replicate] += w * (row[i].exp() / density - 1.0);
        }
        let (ln_density, khat) = (density.ln(), smoothed.khat);
        let point = LeaveOneOutPoint { index: i, control, ln_density, khat };
        LeftOut { point, gain: included.ln() - ln_density, parts }
    }
}

/// Sums over all observations.
fn summary(results: &[LeftOut]) -> LeaveOneOut {
    let points: Vec<LeaveOneOutPoint> = results.iter().map(|r| r.point).collect();
    let m = points.len();
    let ln_density: f64 = points.iter().map(|p| p.ln_density).sum();
    let mean = ln_density / m as f64;
    let variance = points.iter().map(|p| (p.ln_density - mean).powi(2)).sum::<f64>()
        / (m.saturating_sub(1)).max(1) as f64;
    let replicates = results.first().map_or(0, |r| r.parts.len());
    let parts: Vec<f64> =
        (0..replicates).map(|k| results.iter().map(|r| r.parts[k]).sum()).collect();
    LeaveOneOut {
        ln_density,
        spread: (m as f64 * variance).sqrt(),
        se: spread_of_parts(&parts),
        effective_parameters: results.iter().map(|r| r.gain).sum(),
        khat: points.iter().map(|p| p.khat).fold(f64::NEG_INFINITY, f64::max),
        points,
    }
}

/// Standard error of a sum of independent, equally distributed parts.
fn spread_of_parts(parts: &[f64]) -> f64 {
    let r = parts.len() as f64;
    if parts.len() < 2 {
        return f64::INFINITY;
    }
    let mean = parts.iter().sum::<f64>() / r;
    (r / (r - 1.0) * parts.iter().map(|p| (p - mean).powi(2)).sum::<f64>()).sqrt()
}

/// `ln p(y_i | theta, sigma^2)` of every observation for sample `s`; none where it cannot be simulated again.
fn densities(
    likelihood: &JointLikelihood,
    seed: u64,
    s: usize,
    m: usize,
    curve: impl Fn(usize, &mut [f64]) -> Result<(), SimError>,
) -> Result<Option<Vec<f64>>, CalibrateError> {
    let mut values = vec![0.0; m];
    match curve(s, &mut values) {
        Ok(()) => {}
        Err(error) if error.is_recoverable() => return Ok(None),
        Err(error) => return Err(CalibrateError::ended_by(error, s)),
    }
    for (g, (part, range)) in likelihood.groups().enumerate() {
        let values = &mut values[range];
        let rng = || stream(seed, Purpose::LeaveOneOut, g, s);
        let drawn = if part.has_shape() {
            let drawn = part.draw_shapes((1, false), |_| Some(&*values), |_| rng());
            drawn.and_then(|drawn| drawn.draws.first().copied())
        } else {
            part.inferred().and_then(|(nu0, sum0)| {
                let chi_squared = ChiSquared::new(nu0 + values.len() as f64).ok()?;
                let sum = sum0 + part.sum_of_squares(values);
                let sigma = (sum / chi_squared.sample(&mut rng())).sqrt();
                Some(NoiseDraw { sigma, shape: None })
            })
        };
        let Some(densities) = part.ln_pointwise(drawn.as_ref(), values) else { return Ok(None) };
        values.copy_from_slice(&densities);
    }
    Ok(Some(values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::normal::LN_SQRT_2PI;
    use crate::quadrature::{QuadratureSettings, quadrature};
    use crate::{
        FixedSigma, FnSimulator, Noise, Observations, Parameter, Prior, PriorSpec, Settings,
        calibrate,
    };

    const Y: [f64; 8] = [0.31, 0.12, 0.55, 0.71, 0.38, 0.83, 0.47, 0.66];

    fn t() -> Vec<f64> {
        (1..=Y.len()).map(|k| 0.25 * k as f64).collect()
    }

    fn posterior(problem: &Problem<'_>, samples: usize) -> LeaveOneOut {
        let settings = Settings { seed: 3, samples, ..Settings::default() };
        let posterior = calibrate(problem, &settings, &mut ()).expect("a posterior");
        leave_one_out(problem, &posterior).expect("no error").expect("a posterior")
    }

    #[test]
    fn leaving_out_one_observation_of_a_normal_mean_gives_the_conjugate_predictive_density() {
        // y_i = mu + noise, sigma 0.2, mu ~ N(0, 1): the others give mu ~ N(v sum/sigma^2, v), v = 1/(1 + 7/sigma^2).
        let sigma = 0.2;
        let mean = FnSimulator::new(1, Y.len(), |theta: &[f64], out: &mut [f64]| {
            out.fill(theta[0]);
            Ok(())
        });
        let prior = Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 }).expect("a prior");
        let problem = Problem {
            simulator: &mean,
            parameters: vec![Parameter::new("mu", "1", prior)],
            observations: Observations::new(t(), Y.to_vec()).expect("observations"),
            noise: Noise::Fixed { sigma: FixedSigma::Absolute(sigma) },
        };
        let found = posterior(&problem, 16_384);
        let mut exact_sum = 0.0;
        for (i, point) in found.points.iter().enumerate() {
            let v = 1.0 / (1.0 + (Y.len() - 1) as f64 / sigma.powi(2));
            let centre = v * (Y.iter().sum::<f64>() - Y[i]) / sigma.powi(2);
            let sd = (v + sigma * sigma).sqrt();
            let exact = -0.5 * ((Y[i] - centre) / sd).powi(2) - sd.ln() - LN_SQRT_2PI;
            assert!((point.ln_density - exact).abs() < 3e-3, "{i}: {} {exact}", point.ln_density);
            assert!(point.khat < 0.5, "{i}: {}", point.khat);
            exact_sum += exact;
        }
        assert!((found.ln_density - exact_sum).abs() < 5.0 * found.se + 1e-3, "{found:?}");
        assert!(found.se < 0.01, "{}", found.se);
        assert!((0.5..1.5).contains(&found.effective_parameters), "one parameter: {found:?}");
    }

    /// A curve that bends, at times t.
    fn bent(t: Vec<f64>) -> impl crate::Simulator {
        FnSimulator::new(2, t.len(), move |theta: &[f64], out: &mut [f64]| {
            for (o, t) in out.iter_mut().zip(&t) {
                *o = theta[0] * (1.0 - (-t / theta[1]).exp());
            }
            Ok(())
        })
    }

    fn bend() -> Vec<Parameter> {
        let log_uniform =
            |lower, upper| Prior::new(PriorSpec::LogUniform { lower, upper }).expect("a prior");
        vec![
            Parameter::new("height", "1", log_uniform(0.1, 3.0)),
            Parameter::new("time", "s", log_uniform(0.05, 5.0)),
        ]
    }

    /// Largest difference of the left-out densities of some observations from p(y_i | others) = Z(all)/Z(others), both by
    /// brute force.
    fn off(noise: &Noise, observations: std::ops::Range<usize>, samples: usize) -> f64 {
        let evidence = |keep: &dyn Fn(usize) -> bool| {
            let pick = |v: &[f64]| -> Vec<f64> {
                v.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, v)| *v).collect()
            };
            let problem = Problem {
                simulator: &bent(pick(&t())),
                parameters: bend(),
                observations: Observations::new(pick(&t()), pick(&Y)).expect("observations"),
                noise: noise.clone(),
            };
            quadrature(&problem, &QuadratureSettings::default()).expect("a number").log_evidence
        };
        let problem = Problem {
            simulator: &bent(t()),
            parameters: bend(),
            observations: Observations::new(t(), Y.to_vec()).expect("observations"),
            noise: noise.clone(),
        };
        let found = posterior(&problem, samples);
        let all = evidence(&|_| true);
        let off = |i: usize| (found.points[i].ln_density - all + evidence(&|j| j != i)).abs();
        observations.map(off).fold(0.0, f64::max)
    }

    #[test]
    fn leaving_out_agrees_with_quadrature_of_the_evidence_without_each_observation() {
        let off = off(&Noise::Inferred { nu0: 4.0, s0: 0.1 }, 0..Y.len(), 16_384);
        assert!(off < 0.03, "{off}");
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn leaving_out_under_robust_noise_agrees_with_evidence_without_each_observation() {
        let off = off(&Noise::Robust { nu0: 4.0, s0: 0.1 }, 0..Y.len(), 16_384);
        assert!(off < 0.03, "{off}");
    }

    #[test]
    fn leaving_out_under_correlated_noise_agrees_with_evidence_without_each_observation() {
        // Not the first and the last: without them the range is another one, and so is the prior of the length.
        let scale = Some(crate::DistanceScale::Linear);
        let noise = Noise::Correlated { nu0: 4.0, s0: 0.1, scale, nodes: Some([8, 8]) };
        // Length and share are drawn once for each sample, too: 16 384 samples leave 0.031.
        let off = off(&noise, 1..Y.len() - 1, 65_536);
        assert!(off < 0.03, "{off}");
    }
}
