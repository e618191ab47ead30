//! All samples so far, weighted against the mixture of all proposals so far.
//!
//! Balance heuristic: `w_i = prior(z_i) L(z_i) / sum_t (n_t/N) q_t(z_i)`, recomputed for every sample whenever a
//! proposal joins, so that no simulation is thrown away and no weight stays frozen at its stage.

use crate::mixture::{Proposal, ln_sum};
use crate::normal::ln_prior;
use crate::target::Target;
use crate::{Failure, SimError};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Samples that one parallel task works on; fixed, so that sums do not depend on the number of threads.
pub(crate) const CHUNK: usize = 256;

/// All samples so far.
pub(crate) struct Pool {
    pub d: usize,
    pub kept_width: usize,
    /// Normal scores, row by row.
    pub z: Vec<f64>,
    /// Log likelihood, minus infinity where the simulation failed.
    pub ln_l: Vec<f64>,
    /// Numbers kept of every sample (its curve), row by row.
    pub kept: Vec<f64>,
    pub stage: Vec<u32>,
    pub replicate: Vec<u32>,
    /// Log prior density.
    ln_prior: Vec<f64>,
    /// sum_t n_t times the Student-t part of q_t.
    student: Vec<f64>,
    /// sum_t n_t times the prior's share of q_t.
    prior_count: f64,
    /// Log of the mixture of all proposals over the prior.
    pub ln_mixture_over_prior: Vec<f64>,
    /// Causes of failure by sample.
    causes: BTreeMap<usize, String>,
    pub component_densities: usize,
}

impl Pool {
    pub(crate) fn new(d: usize, kept_width: usize) -> Self {
        Self {
            d,
            kept_width,
            z: Vec::new(),
            ln_l: Vec::new(),
            kept: Vec::new(),
            stage: Vec::new(),
            replicate: Vec::new(),
            ln_prior: Vec::new(),
            student: Vec::new(),
            prior_count: 0.0,
            ln_mixture_over_prior: Vec::new(),
            causes: BTreeMap::new(),
            component_densities: 0,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.ln_l.len()
    }

    pub(crate) fn point(&self, i: usize) -> &[f64] {
        &self.z[i * self.d..(i + 1) * self.d]
    }

    /// Simulates new samples, drawn from `proposals.last()`, and adds them.
    ///
    /// # Errors
    /// The first error, in the order of the samples, that is no failure of its sample alone.
    pub(crate) fn extend(
        &mut self,
        target: &dyn Target,
        z: &[f64],
        replicates: &[u32],
        stage: usize,
        proposals: &[(usize, Proposal)],
    ) -> Result<(), SimError> {
        let (d, kept_width) = (self.d, self.kept_width);
        let old = self.len();
        let n = replicates.len();
        self.z.extend_from_slice(z);
        self.replicate.extend_from_slice(replicates);
        self.stage.resize(old + n, stage as u32);
        self.ln_l.resize(old + n, f64::NEG_INFINITY);
        self.kept.resize((old + n) * kept_width, 0.0);
        self.ln_prior.extend(z.chunks_exact(d).map(ln_prior));
        self.student.resize(old + n, 0.0);

        let kept = &mut self.kept[old * kept_width..];
        let ln_l = &mut self.ln_l[old..];
        let errors = target.ln_likelihood_batch(old, z, ln_l, kept);
        for (at, e) in errors {
            if !e.is_recoverable() {
                return Err(e);
            }
            self.ln_l[old + at] = f64::NEG_INFINITY;
            self.causes.insert(old + at, e.cause().to_owned());
        }

        // The new proposal at the old samples; all proposals at the new ones.
        let (newest, before) = match proposals.split_last() {
            Some(split) => split,
            None => return Ok(()),
        };
        self.prior_count += newest.0 as f64 * newest.1.prior_share;
        let all_components: usize = proposals.iter().map(|p| p.1.components.len()).sum();
        self.component_densities += old * newest.1.components.len() + n * all_components;
        let z = &self.z;
        self.student.par_chunks_mut(CHUNK).enumerate().for_each(|(b, sums)| {
            for (i, sum) in sums.iter_mut().enumerate() {
                let at = b * CHUNK + i;
                let z = &z[at * d..(at + 1) * d];
                *sum += newest.0 as f64 * newest.1.student_density(z);
                if at >= old {
                    *sum +=
                        before.iter().map(|(n, q)| *n as f64 * q.student_density(z)).sum::<f64>();
                }
            }
        });
        let total = self.len() as f64;
        let ln_prior_share = (self.prior_count / total).ln();
        self.ln_mixture_over_prior = self
            .student
            .par_iter()
            .zip(&self.ln_prior)
            .with_min_len(CHUNK)
            .map(|(student, ln_prior)| ln_sum(ln_prior_share, (student / total).ln() - ln_prior))
            .collect();
        Ok(())
    }

    /// Takes a sample's new answer in place of the one that it had.
    ///
    /// # Errors
    /// As [`extend`](Self::extend).
    pub(crate) fn simulate_again(&mut self, target: &dyn Target, i: usize) -> Result<(), SimError> {
        let (d, width) = (self.d, self.kept_width);
        let (z, kept) = (&self.z[i * d..(i + 1) * d], &mut self.kept[i * width..(i + 1) * width]);
        let errors = target.ln_likelihood_batch(i, z, &mut self.ln_l[i..=i], kept);
        self.causes.remove(&i);
        for (_, e) in errors {
            if !e.is_recoverable() {
                return Err(e);
            }
            self.ln_l[i] = f64::NEG_INFINITY;
            self.causes.insert(i, e.cause().to_owned());
        }
        Ok(())
    }

    /// Number of failures from sample `first` on.
    pub(crate) fn failed_from(&self, first: usize) -> usize {
        self.causes.range(first..).count()
    }

    /// Log density of the prior at sample i.
    pub(crate) fn ln_prior(&self, i: usize) -> f64 {
        self.ln_prior[i]
    }

    /// Log of prior over mixture of all samples: the weight apart from the likelihood.
    pub(crate) fn ln_base(&self) -> Vec<f64> {
        self.ln_mixture_over_prior.iter().map(|m| -m).collect()
    }

    /// Failures by cause, commonest first, ties by name.
    pub(crate) fn failures(&self) -> Vec<Failure> {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for cause in self.causes.values() {
            *counts.entry(cause).or_insert(0) += 1;
        }
        let mut list: Vec<Failure> = counts
            .into_iter()
            .map(|(cause, count)| Failure { cause: cause.to_owned(), count })
            .collect();
        list.sort_by(|a, b| b.count.cmp(&a.count).then_with(|| a.cause.cmp(&b.cause)));
        list
    }
}

/// Weights from log weights, the largest one being 1; and the log of the factor taken out.
pub(crate) fn exponentiate(ln_w: &[f64]) -> (Vec<f64>, f64) {
    let mut weights = ln_w.to_vec();
    let top = exponentiate_in_place(&mut weights);
    (weights, top)
}

/// Log weights to weights, the largest one being 1; returns the log of the factor taken out.
pub(crate) fn exponentiate_in_place(weights: &mut [f64]) -> f64 {
    let top = weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        weights.fill(0.0);
    } else {
        weights.iter_mut().for_each(|w| *w = (*w - top).exp());
    }
    top
}

/// (sum w)^2 / sum w^2.
pub(crate) fn effective_sample_size(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    if squares > 0.0 { sum * sum / squares } else { 0.0 }
}

/// The power of the likelihood, at most 1, at which the effective size of the weights is `wished`.
pub(crate) fn temper(ln_base: &[f64], ln_l: &[f64], wished: f64) -> f64 {
    // Failed samples have no part in it.
    let alive: Vec<(f64, f64)> = ln_base
        .iter()
        .zip(ln_l)
        .filter(|(b, l)| b.is_finite() && l.is_finite())
        .map(|(b, l)| (*b, *l))
        .collect();
    bisect(&alive, wished, 0.0)
}

/// The power of the likelihood, of any size, at which the effective size of samples weighted by it is `wished`.
pub(crate) fn tune(ln_l: &[f64], wished: f64) -> f64 {
    let alive: Vec<(f64, f64)> = ln_l.iter().filter(|l| l.is_finite()).map(|l| (0.0, *l)).collect();
    bisect(&alive, wished, 60.0)
}

/// Bisection of ln beta between -700 and `high`; the upper end where the size is reached there.
fn bisect(alive: &[(f64, f64)], wished: f64, high: f64) -> f64 {
    let ess = |beta: f64| {
        let ln: Vec<f64> = alive.iter().map(|(b, l)| b + beta * l).collect();
        effective_sample_size(&exponentiate(&ln).0)
    };
    if ess(high.exp()) >= wished {
        return high.exp();
    }
    let (mut low, mut high) = (-50.0f64, high);
    if ess(low.exp()) < wished {
        // Too few samples alive, or log likelihoods that span more than e^50: search among flatter ones.
        low = -700.0;
    }
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if ess(middle.exp()) >= wished { low = middle } else { high = middle }
    }
    low.exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Settings;
    use crate::reference::banana;
    use crate::sampler::Sampler;

    #[test]
    fn pooled_weights_are_those_of_brute_force() {
        let reference = banana();
        let settings = Settings { samples: 1024, ..Settings::default() };
        let mut sampler = Sampler::new(&reference, &settings);
        sampler.run().expect("runs");
        let pool = &sampler.pool;
        for i in (0..pool.len()).step_by(37) {
            let z = pool.point(i);
            let prior = (-0.5 * (z[0] * z[0] + z[1] * z[1])).exp() / (2.0 * std::f64::consts::PI);
            let mixture: f64 = sampler
                .proposals
                .iter()
                .map(|(n, q)| {
                    *n as f64 / pool.len() as f64 * (q.prior_share * prior + q.student_density(z))
                })
                .sum();
            let expected = (mixture / prior).ln();
            assert!((pool.ln_mixture_over_prior[i] - expected).abs() < 1e-10, "{i}");
        }
    }

    #[test]
    fn tempering_reaches_the_wished_for_size_and_no_more() {
        let ln_l: Vec<f64> = (0..1000).map(|i| -f64::from(i) * f64::from(i)).collect();
        let base = vec![0.0; 1000];
        let beta = temper(&base, &ln_l, 100.0);
        let ln: Vec<f64> = ln_l.iter().map(|l| beta * l).collect();
        assert!((effective_sample_size(&exponentiate(&ln).0) - 100.0).abs() < 0.1);
        assert_eq!(temper(&base, &[0.0; 1000], 100.0), 1.0);
    }
}
