//! The control variate: a surrogate of the likelihood over the proposal, its integrals, and what is measured of it.

use crate::cholesky::{cholesky, gram, packed_inverse};
use crate::mixture::Proposal;
use crate::normal::LN_SQRT_2PI;
use crate::pool::Pool;
use crate::sampler::Sampler;
use crate::small_budget::StandIn;
use crate::surrogate::{MOST_PARAMETERS, Surrogate, coefficients, monomials};
use rayon::prelude::*;

/// Samples with a log posterior density this far below the best have no part in the surrogate.
const DEPTH: f64 = 16.0;
/// Largest g/q, in units of the mean of f/q: a g above it is wrong more often than right.
const CAP: f64 = 3.0;

/// Centre and scale of every coordinate.
pub(super) struct Standard {
    mean: Vec<f64>,
    sd: Vec<f64>,
}

impl Standard {
    fn of(d: usize, x: &[f64], weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let mut standard = Self { mean: vec![0.0; d], sd: vec![0.0; d] };
        for (w, x) in weights.iter().zip(x.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
            for (m, x) in standard.mean.iter_mut().zip(x) {
                *m += w / total * x;
            }
        }
        for (w, x) in weights.iter().zip(x.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
            for ((s, m), x) in standard.sd.iter_mut().zip(&standard.mean).zip(x) {
                *s += w / total * (x - m).powi(2);
            }
        }
        standard.sd.iter_mut().for_each(|s| *s = s.sqrt().max(f64::MIN_POSITIVE));
        standard
    }

    fn features(&self, x: impl Iterator<Item = f64>, out: &mut [f64]) {
        let mut standard = [0.0; MOST_PARAMETERS];
        let d = self.mean.len();
        for (j, x) in x.enumerate().take(d) {
            standard[j] = (x - self.mean[j]) / self.sd[j];
        }
        monomials(&standard[..d], out);
    }
}

/// 1, x_j, and x_i x_j of all samples, row by row, and what x is measured in.
pub(super) fn features(
    pool: &Pool,
    weights: &[f64],
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
) -> (Standard, Vec<f64>) {
    let d = pool.d;
    // Failed samples too: f is zero there, but g need not be.
    let x: Vec<f64> = (0..pool.len() * d)
        .into_par_iter()
        .with_min_len(256)
        .map(|i| coordinate(i % d, pool.z[i]))
        .collect();
    let standard = Standard::of(d, &x, weights);
    let p = coefficients(d);
    let mut features = vec![0.0; pool.len() * p];
    features.par_chunks_mut(p).zip(x.par_chunks(d)).with_min_len(256).for_each(|(out, x)| {
        standard.features(x.iter().copied(), out);
    });
    (standard, features)
}

/// Largest g/q from the values of f/q: [`CAP`] times their mean, which of all samples, many of them far from the posterior,
/// is taken by weight.
pub(super) fn cap(values: impl ExactSizeIterator<Item = f64> + Clone, by_weight: bool) -> f64 {
    let n = values.len() as f64;
    let sum: f64 = values.clone().sum();
    if by_weight { CAP * values.map(|v| v * v).sum::<f64>() / sum } else { CAP * sum / n }
}

/// A surrogate of the likelihood.
pub(super) enum Model<'a> {
    Local(Box<Surrogate>),
    Process(Box<StandIn<'a>>),
}

impl Model<'_> {
    /// Log of g over `exp(ln_q)` and the prior at z.
    fn ln_ratio(&self, z: &[f64], ln_q: f64, found: &mut Vec<(f64, u32)>) -> Option<f64> {
        match self {
            Self::Local(surrogate) => surrogate.ln_ratio(z, ln_q, found),
            Self::Process(process) => Some(process.ln_likelihood_at(z) - ln_q),
        }
    }
}

/// The control variate g/q over the scale of the weights.
pub(super) struct Variate<'a> {
    pub model: Model<'a>,
    pub ln_scale: f64,
    /// Its largest value.
    pub cap: f64,
}

impl Variate<'_> {
    /// At z, where `ln_q` is the log of proposal over prior.
    pub(super) fn at(&self, z: &[f64], ln_q: f64, found: &mut Vec<(f64, u32)>) -> f64 {
        self.model
            .ln_ratio(z, ln_q, found)
            .map(|ratio| (ratio - self.ln_scale).exp())
            .filter(|ratio| !ratio.is_nan())
            .map_or(0.0, |ratio| ratio.min(self.cap))
    }

    /// Adds the integral of g phi by the points of a net, taken to the proposal.
    pub(super) fn integrate(
        &self,
        net: &[f64],
        proposal: &Proposal,
        standard: &Standard,
        coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
        sums: &mut [f64],
    ) {
        let width = proposal.uniforms();
        let points = (net.len() / width) as f64;
        let (mut z, mut row) = (vec![0.0; proposal.dimension], vec![0.0; sums.len()]);
        let mut found = Vec::new();
        for u in net.chunks_exact(width) {
            proposal.draw(u, &mut z);
            let ln_prior = -z.iter().map(|z| 0.5 * z * z + LN_SQRT_2PI).sum::<f64>();
            let g = self.at(&z, proposal.ln_over_prior(&z, ln_prior), &mut found);
            if g > 0.0 {
                standard.features(z.iter().enumerate().map(|(j, z)| coordinate(j, *z)), &mut row);
                sums.iter_mut().zip(&row).for_each(|(s, f)| *s += g * f / points);
            }
        }
    }
}

/// Factor of the covariance that distances are measured in: of the mean precision of the proposal's components, which
/// says how fast the posterior varies, not how wide it is (a bent or a split posterior is much wider).
pub(super) fn metric(proposal: &Proposal) -> Option<Vec<f64>> {
    let d = proposal.dimension;
    let mut precision = vec![0.0; d * d];
    for c in &proposal.components {
        let own = gram(&packed_inverse(&c.factor, d), d);
        precision.iter_mut().zip(own).for_each(|(p, own)| *p += c.weight * own);
    }
    cholesky(&gram(&packed_inverse(&cholesky(&precision, d)?, d), d), d)
}

/// The surrogate fitted to some samples of the pool.
pub(super) fn surrogate(
    sampler: &Sampler<'_>,
    known: &[usize],
    ln_q: &[f64],
    metric: &[f64],
) -> Option<Surrogate> {
    let pool = &sampler.pool;
    let density = |i: usize| pool.ln_l[i] + pool.ln_prior(i);
    let top = known.iter().map(|i| density(*i)).fold(f64::NEG_INFINITY, f64::max);
    let kept: Vec<usize> =
        known.iter().copied().filter(|i| density(*i) > top - 2.0 * DEPTH).collect();
    let z: Vec<f64> = kept.iter().flat_map(|i| pool.point(*i)).copied().collect();
    let of_kept = |all: &[f64]| -> Vec<f64> { kept.iter().map(|i| all[*i]).collect() };
    let fitted: Vec<bool> = kept.iter().map(|i| density(*i) > top - DEPTH).collect();
    Surrogate::new(&z, &of_kept(&pool.ln_l), &of_kept(ln_q), &fitted, metric)
}

/// Share of the variance of the target that a control variate leaves.
pub(super) fn left(target: &[f64], control: &[f64]) -> f64 {
    let variance = |values: &mut dyn Iterator<Item = f64>| {
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        for v in values {
            (sum, squares, n) = (sum + v, squares + v * v, n + 1.0);
        }
        squares - sum * sum / n
    };
    let left = variance(&mut target.iter().zip(control).map(|(t, c)| t - c));
    left / variance(&mut target.iter().copied())
}
