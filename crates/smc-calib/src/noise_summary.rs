//! The posterior of the noise, from the samples of the parameters.

use crate::draws::Draws;
use crate::estimate::Estimator;
use crate::noise::{Likelihood, NoiseDraws};
use crate::predictive::intervals;
use crate::sampler::Sampler;
use crate::stream::{Purpose, stream};
use crate::weighted::Weighted;
use crate::{NoiseDraw, Settings, ShapeSummary, SigmaSummary};
use rand_distr::{Distribution, Gamma};
use rayon::prelude::*;
use statrs::function::gamma::ln_gamma;
use std::ops::Range;

/// A group of observations among the samples of a run.
pub(crate) struct Part<'a> {
    pub likelihood: &'a Likelihood,
    pub group: usize,
    /// Places of its observations in the kept curves.
    pub range: Range<usize>,
    /// Log likelihoods of the samples in this group.
    pub ln_l: &'a [f64],
}

/// The noise of one group.
pub(crate) struct GroupNoise {
    /// One for each draw; empty where it is fixed point by point or tuned.
    pub draws: Vec<NoiseDraw>,
    pub sigma: Option<SigmaSummary>,
    pub shape: Option<ShapeSummary>,
}

impl Part<'_> {
    /// Draws the noise of each draw of the parameters, and sums it up.
    pub(crate) fn noise(
        &self,
        sampler: &Sampler<'_>,
        estimator: &Estimator,
        of: &Draws<'_>,
    ) -> GroupNoise {
        if self.likelihood.has_shape() {
            return self.with_shape(sampler, of);
        }
        let sigmas = self.draw_sigmas(of, sampler.settings);
        let draws = sigmas.iter().map(|sigma| NoiseDraw { sigma: *sigma, shape: None }).collect();
        GroupNoise { draws, sigma: self.sigma_summary(sigmas, of, estimator), shape: None }
    }

    /// The noise of a model with a shape, from the curves of the draws.
    fn with_shape(&self, sampler: &Sampler<'_>, of: &Draws<'_>) -> GroupNoise {
        let seed = sampler.settings.seed;
        let curve = |k: usize| (!of.again(k)).then(|| &of.outputs(k)[self.range.clone()]);
        let drawn = self
            .likelihood
            .draw_shapes((of.len(), true), curve, |k| stream(seed, Purpose::Sigma, self.group, k));
        let Some(NoiseDraws { draws, moments: [mean, square], shape }) = drawn else {
            return GroupNoise { draws: Vec::new(), sigma: None, shape: None };
        };
        let values = Weighted::equal(draws.iter().map(|draw| draw.sigma).collect());
        let sigma = (!draws.is_empty()).then(|| {
            let [eti50, eti90, eti95] = intervals(&values);
            let sd = (square - mean * mean).max(0.0).sqrt();
            let median = values.quantile(0.5);
            SigmaSummary { mean, sd, median, eti50, eti90, eti95, fixed: false }
        });
        GroupNoise { draws, sigma, shape: shape.filter(|_| sigma.is_some()) }
    }

    /// One noise standard deviation per draw, from its conditional inverse gamma. Empty where the noise is fixed point by
    /// point or tuned.
    fn draw_sigmas(&self, of: &Draws<'_>, settings: &Settings) -> Vec<f64> {
        let part = self.likelihood;
        let Some((nu0, sum0)) = part.inferred() else {
            return part.common_sigma().map_or_else(Vec::new, |sigma| vec![sigma; of.len()]);
        };
        let Ok(gamma) = Gamma::new(0.5 * (nu0 + part.values().len() as f64), 1.0) else {
            return Vec::new();
        };
        (0..of.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|k| {
                let s = self.sum_of_squares(of, k);
                let mut rng = stream(settings.seed, Purpose::Sigma, self.group, k);
                let g: f64 = gamma.sample(&mut rng);
                (0.5 * (sum0 + s) / g).sqrt()
            })
            .collect()
    }

    /// Sum of the squared residuals of draw k.
    fn sum_of_squares(&self, of: &Draws<'_>, k: usize) -> f64 {
        let ln_l = match &of.drawn {
            Some(_) => self.likelihood.ln_joint(&of.outputs(k)[self.range.clone()]),
            None => self.ln_l[of.samples[k]],
        };
        self.likelihood.sum_of_squares_at(ln_l).unwrap_or(0.0)
    }

    /// Posterior of the noise standard deviation: moments exactly, as the weighted mixture of conditional inverse
    /// gammas, sigma^2 ~ IG(a, b), a = (nu0 + m)/2, b = (nu0 s0^2 + S)/2, with
    /// `E sigma = sqrt(b) Gamma(a - 1/2)/Gamma(a)` and `E sigma^2 = b/(a - 1)`; quantiles from the drawn `values`.
    fn sigma_summary(
        &self,
        values: Vec<f64>,
        of: &Draws<'_>,
        estimator: &Estimator,
    ) -> Option<SigmaSummary> {
        let likelihood = self.likelihood;
        if let Some(s) = likelihood.common_sigma() {
            return Some(SigmaSummary { fixed: true, ..certain(s, 0.0) });
        }
        let (nu0, sum0) = likelihood.inferred()?;
        let a = 0.5 * (nu0 + likelihood.values().len() as f64);
        let first = (ln_gamma(a - 0.5) - ln_gamma(a)).exp();
        let mean_of = |value: &dyn Fn(f64) -> f64| {
            let b = |sum: f64| value(0.5 * (sum0 + sum));
            let of_sample = |i: usize| likelihood.sum_of_squares_at(self.ln_l[i]).unwrap_or(0.0);
            of.mean(estimator, |i| b(of_sample(i)), |k| b(self.sum_of_squares(of, k)))
        };
        let mean = mean_of(&|b| b.sqrt() * first);
        // With a at most 1 the second moment does not exist.
        let sd = if a > 1.0 {
            (mean_of(&|b| b / (a - 1.0)) - mean * mean).max(0.0).sqrt()
        } else {
            f64::MAX
        };
        if values.is_empty() {
            return Some(certain(mean, sd));
        }
        let values = Weighted::equal(values);
        let [eti50, eti90, eti95] = intervals(&values);
        let median = values.quantile(0.5);
        Some(SigmaSummary { mean, sd, median, eti50, eti90, eti95, fixed: false })
    }
}

/// A summary whose quantiles are all the mean: without draws.
fn certain(mean: f64, sd: f64) -> SigmaSummary {
    let both = [mean, mean];
    SigmaSummary { mean, sd, median: mean, eti50: both, eti90: both, eti95: both, fixed: false }
}
