//! Integrals of the posterior over the frozen final stage, with a surrogate of the likelihood as control variate.
//!
//! The final stage is drawn from a proposal q that was fixed before. With f = likelihood x prior and any function g
//! that the samples of the sum had no part in,
//!
//! `integral of f phi = E_q[(f - g) phi / q] + integral of g phi`,
//!
//! whatever g is (P. Glasserman, Monte Carlo Methods in Financial Engineering, 2004, section 4.1). Here g is a
//! surrogate fitted to the samples of the stages before and, for one half of the final stage's sub-nets, to those of the
//! other half (cross-fitting). The closer g is to f, the less noise the first term has; the second takes no simulation,
//! only more points of q. Both are without bias. `phi` are 1, the coordinates, and their products: evidence, means and
//! covariances.
//!
//! Where a Gaussian process places the samples ([`crate::small_budget`]), g is that process, the mixture of all proposals
//! stands for q and all samples for the final stage: each sub-net's are held against a process through all others. As
//! samples are placed by what earlier ones gave, and the covariance of the process is that of all, this is without bias only
//! up to terms that fall with the square of its error.
//!
//! Every sub-net of the stage has its own net for the second term, so that it is a replicate of the whole, and the
//! spread of the sub-nets is an error bar of both terms together.

use crate::Evidence;
use crate::cholesky::{cholesky, gram, packed_inverse};
use crate::estimate::{Estimator, Integrals};
use crate::gaussian_process::Covariance;
use crate::mixture::Proposal;
use crate::neighbours::MOST_DIMENSIONS;
use crate::normal::LN_SQRT_2PI;
use crate::pool::{Pool, exponentiate};
use crate::sampler::Sampler;
use crate::small_budget::StandIn;
use crate::sobol::scrambled_net;
use crate::stage::Finishing;
use crate::stream::{Purpose, stream};
use crate::surrogate::{MOST_PARAMETERS, Surrogate, coefficients, monomials};
use crate::trust::agree;
use rayon::prelude::*;
use std::ops::Range;

/// Points that the surrogate is integrated with, per sample of the final stage, and at least; at least for a process.
const POINTS: [usize; 2] = [8, 32_768];
const POINTS_OF_PROCESS: usize = 8192;
/// Samples with a log posterior density this far below the best have no part in the surrogate.
const DEPTH: f64 = 16.0;
/// Largest g/q, in units of the mean of f/q: a g above it is wrong more often than right.
const CAP: f64 = 3.0;
/// Parts of the final stage, each with a surrogate that its own samples had no part in; of a process, every sub-net is one.
const FOLDS: usize = 2;
/// Fewest samples that a process is held against.
const FEWEST: usize = 32;
/// Least share of the variance of f/q that the surrogate must explain; that a process must, whose error is a pattern that a
/// few samples do not show.
const LEAST_EXPLAINED: f64 = 0.5;
const LEAST_EXPLAINED_BY_PROCESS: f64 = 0.9;

/// Standard error of the final stage's evidence, over that of all samples, from which on the latter is reported. By its number of
/// samples the final stage has 1.4 times the error, and its mean is exact; with more it has missed what earlier stages found.
const WORSE: f64 = 1.5;

/// Least share of the samples, one in so many, from which a stage of an extended run has an evidence of its own.
const OWN_EVIDENCE: usize = 16;

/// Share, one in so many, of the samples in the last stages of a run that a Gaussian process places.
const TOGETHER_FROZEN: usize = 4;

/// Stages whose proposals were fixed before they were drawn: the last one; see [`Sampler::frozen`].
pub(crate) struct Frozen {
    /// Its first sample in the pool.
    pub first: usize,
    /// Log of the proposal over the prior at its samples.
    pub ln_q: Vec<f64>,
    /// Log weights: likelihood times prior over the proposal.
    pub ln_w: Vec<f64>,
}

/// Samples that were drawn from one density q.
struct Drawn<'a> {
    /// The first of them in the pool; all after it are.
    first: usize,
    proposal: &'a Proposal,
    /// Log of q over the prior at each.
    ln_q: &'a [f64],
    /// Log of likelihood times prior over q at each.
    ln_w: &'a [f64],
    folds: usize,
    /// The process through all samples, where g is a process.
    process: Option<StandIn<'a>>,
}

impl<'a> Drawn<'a> {
    /// The final stage, where it is large enough for local quadratics.
    fn finally(sampler: &'a Sampler<'_>, frozen: &'a Frozen) -> Option<Self> {
        let (n, proposal) = sampler.final_stage()?;
        let few = 8 * coefficients(sampler.pool.d);
        let Frozen { first, ln_q, ln_w } = frozen;
        (n >= few && *first >= few).then_some(Self {
            first: *first,
            proposal,
            ln_q,
            ln_w,
            folds: FOLDS,
            process: None,
        })
    }

    /// All samples, for local quadratics: in many dimensions the final stage alone misses what earlier ones found.
    fn pooled(sampler: &'a Sampler<'_>, ln_w: &'a [f64], proposal: &'a Proposal) -> Option<Self> {
        let pool = &sampler.pool;
        let few = 16 * coefficients(pool.d);
        let ln_q = &pool.ln_mixture_over_prior;
        let drawn = Self { first: 0, proposal, ln_q, ln_w, folds: FOLDS, process: None };
        (pool.len() >= few).then_some(drawn)
    }

    /// All samples, for a process.
    fn all(
        sampler: &'a Sampler<'_>,
        weights: &[f64],
        ln_w: &'a [f64],
        proposal: &'a Proposal,
    ) -> Option<Self> {
        let pool = &sampler.pool;
        let n = pool.len();
        if n < FEWEST {
            return None;
        }
        Some(Self {
            first: 0,
            proposal,
            ln_q: &pool.ln_mixture_over_prior,
            ln_w,
            folds: sampler.replicates,
            process: Some(StandIn::new(sampler.target, pool, weights, 0..n, Covariance::Search)?),
        })
    }
}

/// Centre and scale of every coordinate.
struct Standard {
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

/// The integrals, where the surrogate is good enough to be of use.
///
/// `weights` are the weights of all samples over `exp(ln_scale)`; moments are of `coordinate(j, z_j)`.
fn integrals(
    sampler: &Sampler<'_>,
    weights: &[f64],
    ln_scale: f64,
    drawn: &Drawn<'_>,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    finishing: &mut Finishing<'_>,
) -> Option<Integrals> {
    let pool = &sampler.pool;
    let (d, r) = (pool.d, sampler.replicates);
    let Drawn { first, proposal, folds, .. } = *drawn;
    let (n, p) = (pool.len() - first, coefficients(d));
    if d > MOST_PARAMETERS || r < 2 {
        return None;
    }
    let (standard, features) = features(pool, weights, coordinate);

    // f/q over the scale at the samples of the final stage, and the log of q over the prior at all samples.
    let target: Vec<f64> = drawn.ln_w.iter().map(|l| (l - ln_scale).exp()).collect();
    let ln_q = [&sampler.ln_last_proposal(0..first)[..], drawn.ln_q].concat();
    let least = if drawn.process.is_some() { POINTS_OF_PROCESS } else { POINTS[1] };
    let points = (POINTS[0] * n).max(least) / r;
    // Local quadratics measure distances by it.
    let metric = if drawn.process.is_none() { metric(proposal)? } else { Vec::new() };
    let mut counts = vec![0.0; r];
    pool.replicate[first..].iter().for_each(|k| counts[*k as usize] += 1.0);
    let mut of_sub_nets = vec![0.0; r * p];
    let mut controls = vec![0.0; n];
    for fold in 0..folds {
        finishing.of_integrals(2 * fold, folds, "evidence and means: stand-in");
        let (own, others): (Vec<usize>, Vec<usize>) =
            (first..pool.len()).partition(|i| pool.replicate[*i] as usize % folds == fold);
        let known: Vec<usize> = (0..first).chain(others.iter().copied()).collect();
        let model = match &drawn.process {
            None => Model::Local(Box::new(surrogate(sampler, &known, &ln_q, &metric)?)),
            Some(process) => {
                let known = known.iter().copied();
                let stand_in = process.like(pool, weights, known)?;
                Model::Process(Box::new(stand_in))
            }
        };
        let cap = cap(others.iter().map(|i| target[i - first]), first == 0);
        let variate = Variate { model, ln_scale, cap };
        let control: Vec<f64> = own
            .par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |found, i| variate.at(pool.point(*i), ln_q[*i], found))
            .collect();
        let target: Vec<f64> = own.iter().map(|i| target[i - first]).collect();
        if drawn.process.is_none() && !explains(&target, &control, LEAST_EXPLAINED) {
            return None;
        }
        own.iter().zip(&control).for_each(|(i, control)| controls[i - first] = *control);

        finishing.of_integrals(2 * fold + 1, folds, "evidence and means: integrals");
        // Per sub-net: the integral of g phi by a net of its own, and the mean of (f - g) phi / q.
        let seed = sampler.settings.seed;
        of_sub_nets.par_chunks_mut(p).enumerate().skip(fold).step_by(folds).for_each(
            |(k, sums)| {
                let mut rng = stream(seed, Purpose::Surrogate, 0, k);
                let net = scrambled_net(proposal.uniforms(), points, &mut rng);
                variate.integrate(&net, proposal, &standard, coordinate, sums);
            },
        );
        for ((i, target), control) in own.iter().zip(&target).zip(&control) {
            let k = pool.replicate[*i] as usize;
            let off = (target - control) / counts[k];
            let phi = &features[i * p..(i + 1) * p];
            of_sub_nets[k * p..(k + 1) * p]
                .iter_mut()
                .zip(phi)
                .for_each(|(s, phi)| *s += off * phi);
        }
    }
    // One sub-net of a few samples says nothing.
    let explained =
        drawn.process.is_none() || explains(&target, &controls, LEAST_EXPLAINED_BY_PROCESS);
    explained.then_some(Integrals { of_sub_nets, features })
}

/// 1, x_j, and x_i x_j of all samples, row by row, and what x is measured in.
fn features(
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
fn cap(values: impl ExactSizeIterator<Item = f64> + Clone, by_weight: bool) -> f64 {
    let n = values.len() as f64;
    let sum: f64 = values.clone().sum();
    if by_weight { CAP * values.map(|v| v * v).sum::<f64>() / sum } else { CAP * sum / n }
}

/// What g is made of.
enum Model<'a> {
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
struct Variate<'a> {
    model: Model<'a>,
    ln_scale: f64,
    /// Its largest value.
    cap: f64,
}

impl Variate<'_> {
    /// At z, where `ln_q` is the log of proposal over prior.
    fn at(&self, z: &[f64], ln_q: f64, found: &mut Vec<(f64, u32)>) -> f64 {
        self.model
            .ln_ratio(z, ln_q, found)
            .map(|ratio| (ratio - self.ln_scale).exp())
            .filter(|ratio| !ratio.is_nan())
            .map_or(0.0, |ratio| ratio.min(self.cap))
    }

    /// Adds the integral of g phi by the points of a net, taken to the proposal.
    fn integrate(
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
fn metric(proposal: &Proposal) -> Option<Vec<f64>> {
    let d = proposal.dimension;
    let mut precision = vec![0.0; d * d];
    for c in &proposal.components {
        let own = gram(&packed_inverse(&c.factor, d), d);
        precision.iter_mut().zip(own).for_each(|(p, own)| *p += c.weight * own);
    }
    cholesky(&gram(&packed_inverse(&cholesky(&precision, d)?, d), d), d)
}

/// The surrogate fitted to some samples of the pool.
fn surrogate(
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

/// Whether the control variate takes away enough of the variance of the target.
fn explains(target: &[f64], control: &[f64], share: f64) -> bool {
    let variance = |values: &mut dyn Iterator<Item = f64>| {
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        for v in values {
            (sum, squares, n) = (sum + v, squares + v * v, n + 1.0);
        }
        squares - sum * sum / n
    };
    let left = variance(&mut target.iter().zip(control).map(|(t, c)| t - c));
    left < (1.0 - share) * variance(&mut target.iter().copied())
}

impl Sampler<'_> {
    /// The samples of the last stage, or the last that is large enough, weighted by the one density that they were drawn from;
    /// of small stages that a process places, the last ones that together have [`TOGETHER_FROZEN`] of the samples, each by its own.
    pub(crate) fn frozen(&self) -> Frozen {
        let (len, extended) = (self.pool.len(), !self.settings.earlier.is_empty());
        let mut end = len;
        let stages = self.proposals.iter().rev().map(|(n, proposal)| {
            let range = end - n..end;
            end -= n;
            (range, proposal)
        });
        let mut stages: Vec<(Range<usize>, &Proposal)> = stages.collect();
        if self.placing.surrogate {
            let enough = len - len.div_ceil(TOGETHER_FROZEN);
            let last = stages.iter().position(|(range, _)| range.start <= enough);
            stages.truncate(last.map_or(stages.len(), |last| last + 1));
        } else {
            // As large as the last one of the first part is enough.
            let enough = self.schedule(self.settings.first_budget()).last().copied().unwrap_or(len);
            let enough = enough.min(len / OWN_EVIDENCE);
            let large = |range: &Range<usize>| !extended || range.len() >= enough;
            let chosen = stages.iter().position(|(range, _)| large(range)).unwrap_or(0);
            stages = stages.into_iter().skip(chosen).take(1).collect();
        }
        let mut frozen = Frozen { first: len, ln_q: Vec::new(), ln_w: Vec::new() };
        for (range, proposal) in stages.into_iter().rev() {
            let ln_q = self.ln_proposal(proposal, range.clone());
            frozen.ln_w.extend(self.pool.ln_l[range.clone()].iter().zip(&ln_q).map(|(l, q)| l - q));
            frozen.ln_q.extend(ln_q);
            frozen.first = frozen.first.min(range.start);
        }
        frozen
    }

    /// Log evidence from that stage alone, with its standard error. Samples are weighted by the one density that they
    /// were drawn from, which was fixed before: the mean of the evidence (not of its logarithm) is exact.
    pub(crate) fn frozen_evidence(&self, frozen: &Frozen) -> (f64, f64) {
        let (weights, ln_scale) = exponentiate(&frozen.ln_w);
        if ln_scale == f64::NEG_INFINITY {
            return (f64::MIN, f64::MAX);
        }
        let stage = frozen.first..frozen.first + frozen.ln_w.len();
        let label = self.pool.replicate[stage].to_vec();
        Estimator::of(label, weights, ln_scale, self.replicates).log_evidence()
    }
}

/// All samples with the weights of the result, and the evidence. `raw` are the importance weights over
/// `exp(ln_scale)`, `coordinate(j, z_j)` is what moments are taken of.
pub(crate) fn estimate(
    sampler: &Sampler<'_>,
    raw: &[f64],
    ln_scale: f64,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    finishing: &mut Finishing<'_>,
) -> (Estimator, Evidence) {
    let mut estimator = Estimator::new(&sampler.pool, raw.to_vec(), ln_scale, sampler.replicates);
    let (pooled_value, pooled_se) = estimator.log_evidence();
    let frozen = sampler.frozen();
    let (frozen_value, frozen_se) = sampler.frozen_evidence(&frozen);
    let mut integrals =
        |drawn: &Drawn<'_>| integrals(sampler, raw, ln_scale, drawn, coordinate, finishing);
    let far = sampler.placing.surrogate || sampler.pool.d > MOST_DIMENSIONS;
    let known = if far {
        Proposal::of_stages(&sampler.proposals).and_then(|mixture| {
            let ln_w = sampler.ln_weights();
            let drawn = if sampler.placing.surrogate {
                Drawn::all(sampler, raw, &ln_w, &mixture)
            } else {
                Drawn::pooled(sampler, &ln_w, &mixture)
            };
            integrals(&drawn?)
        })
    } else {
        Drawn::finally(sampler, &frozen).and_then(|drawn| integrals(&drawn))
    };
    let held = known.is_some_and(|known| estimator.hold_to(known, sampler.pool.d, far));
    let (value, se) = if held {
        estimator.log_evidence()
    } else if sampler.final_stage().is_some()
        && frozen_value > f64::MIN
        && frozen_se <= WORSE * pooled_se
    {
        (frozen_value, frozen_se)
    } else {
        (pooled_value, pooled_se)
    };
    let agree = agree(pooled_value, frozen_value, pooled_se.hypot(frozen_se));
    let evidence = Evidence { value, se, frozen_value, frozen_se, pooled_value, pooled_se, agree };
    (estimator, evidence)
}
