//! Sampling a plain log density: the sampler without a curve.

use crate::control::estimate;
use crate::pool::exponentiate;
use crate::sampler::Sampler;
use crate::stage::Finishing;
use crate::target::Target;
use crate::{CalibrateError, Counters, Evidence, Settings, psis};

/// Moments and evidence of a log density over normal scores.
#[derive(Clone, Debug, PartialEq)]
pub struct DensitySummary {
    /// Means of the coordinates.
    pub mean: Vec<f64>,
    /// Their standard errors.
    pub mean_se: Vec<f64>,
    /// Standard deviations.
    pub sd: Vec<f64>,
    /// Their standard errors.
    pub sd_se: Vec<f64>,
    /// Correlation matrix, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Log evidence.
    pub log_evidence: Evidence,
    /// Effective sample size of the importance weights.
    pub ess: f64,
    /// Largest Pareto shape over the weights and all coordinates.
    pub khat: f64,
    /// Number of components of each stage's proposal.
    pub components: Vec<usize>,
    /// Power of the likelihood of the last fit.
    pub beta: f64,
    /// Work done.
    pub counters: Counters,
}

/// Samples a log density times a standard normal prior.
///
/// # Errors
/// Same as [`crate::calibrate`].
pub fn sample_density(
    target: &dyn Target,
    settings: &Settings,
) -> Result<DensitySummary, CalibrateError> {
    sample_density_in(target, &|_, z| z, settings)
}

/// Same as [`sample_density`], with moments of `coordinate(j, z_j)`.
///
/// # Errors
/// Same as [`crate::calibrate`].
pub fn sample_density_in(
    target: &dyn Target,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    settings: &Settings,
) -> Result<DensitySummary, CalibrateError> {
    let mut sampler = Sampler::new(target, settings);
    sampler.run()?;
    let ln_w = sampler.ln_weights();
    let (raw, ln_scale) = exponentiate(&ln_w);
    if ln_scale == f64::NEG_INFINITY {
        return Err(CalibrateError::ZeroEvidence { simulations: sampler.pool.len() });
    }
    let ess = crate::pool::effective_sample_size(&raw);
    let (estimator, log_evidence, _) =
        estimate(&sampler, &raw, ln_scale, coordinate, &mut Finishing(&mut ()));
    let d = sampler.pool.d;
    let mut khat = psis::khat(&raw);
    let (mut mean, mut mean_se, mut sd, mut sd_se) = (vec![], vec![], vec![], vec![]);
    let of_sample = |j: usize| -> Vec<f64> {
        estimator.moved(j).unwrap_or_else(|| {
            sampler.pool.z.chunks_exact(d).map(|z| coordinate(j, z[j])).collect()
        })
    };
    let columns: Vec<Vec<f64>> = (0..d).map(of_sample).collect();
    for x in &columns {
        let m = estimator.mean(|i| x[i]);
        let v = estimator.mean(|i| (x[i] - m).powi(2));
        let s = v.max(0.0).sqrt();
        mean.push(m);
        mean_se.push(estimator.standard_error(|i| x[i] - m));
        sd.push(s);
        sd_se.push(estimator.standard_error(|i| ((x[i] - m).powi(2) - v) / (2.0 * s)));
        let tail: Vec<f64> = raw.iter().zip(x).map(|(w, x)| w * (x - m).powi(2)).collect();
        khat = khat.max(psis::khat(&tail));
    }
    let centred = |i: usize, j: usize| columns[j][i] - mean[j];
    let covariance = |j: usize, k: usize| estimator.mean(|i| centred(i, j) * centred(i, k));
    let row = |j: usize| -> Vec<f64> {
        let of = |k| if j == k { 1.0 } else { covariance(j, k) / (sd[j] * sd[k]) };
        (0..d).map(of).collect()
    };
    let correlation = (0..d).map(row).collect();
    Ok(DensitySummary {
        correlation,
        mean,
        mean_se,
        sd,
        sd_se,
        log_evidence,
        ess,
        khat,
        components: sampler.proposals.iter().map(|p| p.1.components.len()).collect(),
        beta: sampler.beta,
        counters: sampler.counters,
    })
}
