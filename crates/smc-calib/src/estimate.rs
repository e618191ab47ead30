//! Estimates from pooled weights, and their error bars from independently scrambled sub-nets.
//!
//! Sub-net r of every stage together is one replicate of the whole estimate. The spread of the replicates'
//! shares of an estimate's influence function is its standard error, at no extra simulation.

use crate::planted::{self, Bug};
use crate::pool::Pool;

/// Weights of all samples for estimation, and what is needed for error bars.
pub(crate) struct Estimator {
    n: usize,
    replicates: usize,
    label: Vec<u32>,
    /// Importance weights, largest 1.
    pub weights: Vec<f64>,
    /// Sum of `weights`.
    pub total: f64,
    /// Log of the factor taken out of the weights.
    pub ln_scale: f64,
}

impl Estimator {
    /// Takes raw weights (largest 1, log scale apart) of the pool's samples.
    pub(crate) fn new(pool: &Pool, weights: Vec<f64>, ln_scale: f64, replicates: usize) -> Self {
        Self::of(pool.replicate.clone(), weights, ln_scale, replicates)
    }

    /// From the sub-net of each sample and its weight.
    pub(crate) fn of(label: Vec<u32>, weights: Vec<f64>, ln_scale: f64, replicates: usize) -> Self {
        Self { n: weights.len(), replicates, label, total: weights.iter().sum(), weights, ln_scale }
    }

    /// Weighted mean of a function of the samples.
    pub(crate) fn mean(&self, value: impl Fn(usize) -> f64) -> f64 {
        (0..self.n)
            .filter(|i| self.weights[*i] > 0.0)
            .map(|i| self.weights[i] * value(i))
            .sum::<f64>()
            / self.total
    }

    /// Standard error of the estimate whose influence function, up to the normalised weight, is `influence`:
    /// `g - mean` for the mean of g.
    pub(crate) fn standard_error(&self, influence: impl Fn(usize) -> f64) -> f64 {
        let r = self.replicates;
        if r < 2 {
            return f64::INFINITY;
        }
        let mut parts = vec![0.0; r];
        for i in 0..self.n {
            if self.weights[i] <= 0.0 {
                continue;
            }
            let f = self.weights[i] * influence(i);
            parts[self.label[i] as usize] += f;
        }
        let scale = r as f64 / self.total;
        let mean = parts.iter().sum::<f64>() * scale / r as f64;
        let squares: f64 = parts.iter().map(|p| (p * scale - mean).powi(2)).sum();
        let se = (squares / (r * (r - 1)) as f64).sqrt();
        if planted::is(Bug::ErrorsTooSmall) { se / (r as f64).sqrt() } else { se }
    }

    /// Log evidence and its standard error.
    pub(crate) fn log_evidence(&self) -> (f64, f64) {
        let value = self.ln_scale + (self.total / self.n as f64).ln();
        // The evidence is a plain mean: its parts are not centred by weight but by their number.
        (value, self.standard_error(|_| 1.0))
    }
}
