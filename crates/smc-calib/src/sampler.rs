//! Adaptive importance sampling with recycled samples: see [`Sampler::run`].

use crate::cholesky::cholesky;
use crate::cloud::Cloud;
use crate::gaussian_process::Found;
use crate::mixture::{Component, Proposal, ln_sum};
use crate::pool::{Pool, exponentiate, temper, tune};
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};
use crate::target::{Target, follows_from_kept};
use crate::{CalibrateError, Counters, Settings};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;

/// Least power of the likelihood that proposals are fitted to; the rest of their width is a factor on covariances. A bent
/// posterior grows along its bend when it is flattened, and wider components do not follow it there.
const FLATTEST: f64 = 0.7;
/// Share of a proposal whose components are wider still, for tails that no sample has reached.
const WIDE_SHARE: f64 = 0.1;
/// Factor on the covariances of [`WIDE_SHARE`].
const WIDER: f64 = 9.0;

/// Fewest samples of a stage per sub-net that has a net of its own, where a Gaussian process places them.
const TOGETHER: usize = 8;

/// Size and proposal of a stage, and whether it is the last one.
pub(crate) type NextStage = (usize, Proposal, bool);

/// A stage that was drawn, and whose simulations are not in the pool yet.
struct Placed {
    proposal: Proposal,
    z: Vec<f64>,
    replicates: Vec<u32>,
    /// Power of the likelihood that its proposal was fitted to.
    beta: f64,
    last: bool,
}

/// The state of a run: all samples, all proposals.
pub(crate) struct Sampler<'a> {
    pub(crate) target: &'a dyn Target,
    pub(crate) settings: &'a Settings,
    /// The proposal of the first stage.
    pub(crate) opening: Proposal,
    /// The settings that the newest stage was placed by: those of its part of the run.
    pub(crate) placing: Settings,
    pub pool: Pool,
    /// Number of draws and proposal of each stage in the pool.
    pub proposals: Vec<(usize, Proposal)>,
    placed: VecDeque<Placed>,
    pub counters: Counters,
    /// Power of the likelihood that the newest proposal was fitted to.
    pub beta: f64,
    pub replicates: usize,
    /// Whether proposals are flattened and have a wide share. A Gaussian process that places few samples knows the tails
    /// itself.
    pub tails: bool,
    /// Number of samples when the process last searched the lengths of its covariances, and what it found.
    pub(crate) searched: Option<(usize, Vec<Option<Found>>)>,
}

impl<'a> Sampler<'a> {
    pub(crate) fn new(target: &'a dyn Target, settings: &'a Settings) -> Self {
        // Each sub-net needs a few points, or there is nothing to average.
        // An extended run has the sub-nets that it began with.
        let first = settings.parts()[0];
        let placing = settings.of_part(first);
        let fewest = if placing.surrogate { 4 } else { 8 };
        let replicates = settings.replicates.min(first / fewest).max(1);
        Self {
            target,
            settings,
            // Settings were checked: there is none only where the sampler made them itself.
            opening: settings
                .opening(target.dimension())
                .unwrap_or_else(|_| Proposal::prior(target.dimension())),
            pool: Pool::new(target.dimension(), target.kept()),
            proposals: Vec::new(),
            placed: VecDeque::new(),
            counters: Counters::default(),
            beta: 0.0,
            replicates,
            tails: !placing.surrogate,
            placing,
            searched: None,
        }
    }

    /// Sizes of the stages of a run of `n` samples: the adaptive ones, then the final one; all multiples of the number of
    /// sub-nets where the budget allows.
    pub(crate) fn schedule(&self, n: usize) -> Vec<usize> {
        self.schedule_by(&self.placing, n)
    }

    /// The same by other settings than those of the newest stage.
    pub(crate) fn schedule_by(&self, placing: &Settings, n: usize) -> Vec<usize> {
        let r = self.replicates;
        let adaptive = placing.adaptive(n);
        let stages = placing.iterations.max(1);
        if placing.batch > 0 {
            return placing.batches(n, adaptive, follows_from_kept(self.target));
        }
        let each = adaptive / stages / r * r;
        if n < 256 || each < 4 * r {
            // Too few to adapt often: prior, then one or two refinements.
            let first = n / 2;
            return if n < 16 { vec![n] } else { vec![first, n - first] };
        }
        // With overlap the final stage begins later, so that it is placed from as many samples, and keeps a quarter of them.
        let later = self.settings.overlap.div_ceil(each);
        let stages = (stages + later).min((n - n.div_ceil(4)) / each).max(stages);
        let mut sizes = vec![each; stages];
        sizes.push(n - each * stages);
        sizes
    }

    /// Number of stages that were placed.
    pub(crate) fn stages(&self) -> usize {
        self.proposals.len() + self.placed.len()
    }

    /// Number of samples that were placed.
    pub(crate) fn samples(&self) -> usize {
        self.pool.len() + self.placed.iter().map(|placed| placed.replicates.len()).sum::<usize>()
    }

    /// Places stages as `next` gives them (size, proposal, whether it is the last one), as far as the pool allows: a stage is
    /// placed from all stages that end [`Settings::overlap`] samples or more before its first, never from more, so that it
    /// does not matter which simulations end first.
    pub(crate) fn place(&mut self, next: &mut dyn FnMut(&mut Self) -> Option<NextStage>) {
        let waits = |sampler: &Self| {
            sampler.placed.front().is_some_and(|placed| {
                let end = sampler.pool.len() + placed.replicates.len();
                end + sampler.settings.overlap <= sampler.samples()
            })
        };
        while !waits(self) {
            let Some((n, proposal, last)) = next(self) else { return };
            let (first, (z, replicates)) = (self.samples(), self.draw(n, &proposal));
            if self.settings.overlap > 0 {
                self.target.announce(first, &z);
            }
            self.placed.push_back(Placed { proposal, z, replicates, beta: self.beta, last });
        }
    }

    /// Simulates the next of the stages that were placed, and adds it to the pool; whether it is the last one, none where no
    /// stage was placed.
    pub(crate) fn take(&mut self) -> Result<Option<bool>, CalibrateError> {
        let Some(Placed { proposal, z, replicates, beta, last }) = self.placed.pop_front() else {
            return Ok(None);
        };
        self.beta = beta;
        self.simulate(proposal, &z, &replicates)?;
        Ok(Some(last))
    }

    /// Takes over the answers that have changed since they were given.
    pub(crate) fn revise(&mut self) -> Result<(), CalibrateError> {
        let samples = self.pool.len();
        for i in self.target.revised(samples).into_iter().filter(|i| *i < samples) {
            let again = self.pool.simulate_again(self.target, i);
            again.map_err(|error| CalibrateError::ended_by(error, samples))?;
        }
        Ok(())
    }

    /// Draws of the next stage, in normal scores, and the sub-net of each.
    fn draw(&self, n: usize, proposal: &Proposal) -> (Vec<f64>, Vec<u32>) {
        let stage = self.stages();
        // The few samples of a stage that a Gaussian process places fill their space together: one net for all of them, dealt
        // to the sub-nets one by one. Errors are then those of independent draws.
        let together = self.placing.surrogate && n < TOGETHER * self.replicates;
        let (d, r) = (self.pool.d, if together { 1 } else { self.replicates });
        let seed = self.settings.seed;
        let width = proposal.uniforms();
        let blocks: Vec<Vec<f64>> = (0..r)
            .into_par_iter()
            .map(|k| {
                let points = n / r + usize::from(k < n % r);
                let net =
                    scrambled_net(width, points, &mut stream(seed, Purpose::Scramble, stage, k));
                let mut z = vec![0.0; points * d];
                for (u, z) in net.chunks_exact(width).zip(z.chunks_exact_mut(d)) {
                    proposal.draw(u, z);
                }
                z
            })
            .collect();
        let (mut z, mut replicates) = (Vec::with_capacity(n * d), Vec::with_capacity(n));
        for (k, block) in blocks.into_iter().enumerate() {
            replicates.resize(replicates.len() + block.len() / d, k as u32);
            z.extend(block);
        }
        if together {
            let dealt = (self.samples()..).map(|i| (i % self.replicates) as u32);
            replicates.iter_mut().zip(dealt).for_each(|(own, dealt)| *own = dealt);
        }
        (z, replicates)
    }

    /// Simulates given normal scores as a stage of draws from `proposal`.
    pub(crate) fn simulate(
        &mut self,
        proposal: Proposal,
        z: &[f64],
        replicates: &[u32],
    ) -> Result<(), CalibrateError> {
        let stage = self.proposals.len();
        self.proposals.push((replicates.len(), proposal));
        let simulated = self.pool.extend(self.target, z, replicates, stage, &self.proposals);
        self.counters.simulations = self.pool.len();
        self.counters.component_densities = self.pool.component_densities;
        simulated.map_err(|error| CalibrateError::ended_by(error, self.pool.len()))
    }

    /// Log weights of all samples at full likelihood.
    pub(crate) fn ln_weights(&self) -> Vec<f64> {
        self.pool.ln_base().iter().zip(&self.pool.ln_l).map(|(b, l)| b + l).collect()
    }

    /// Number of samples and proposal of the last stage, where it has at least a quarter of all samples.
    pub(crate) fn final_stage(&self) -> Option<(usize, &Proposal)> {
        let (n, proposal) = self.proposals.last()?;
        (4 * n >= self.pool.len()).then_some((*n, proposal))
    }

    /// Log of the last proposal over the prior at some samples.
    pub(crate) fn ln_last_proposal(&self, samples: Range<usize>) -> Vec<f64> {
        let Some((_, proposal)) = self.proposals.last() else { return Vec::new() };
        self.ln_proposal(proposal, samples)
    }

    /// Log of a proposal over the prior at some samples.
    pub(crate) fn ln_proposal(&self, proposal: &Proposal, samples: Range<usize>) -> Vec<f64> {
        samples
            .into_par_iter()
            .with_min_len(256)
            .map(|i| proposal.ln_over_prior(self.pool.point(i), self.pool.ln_prior(i)))
            .collect()
    }

    /// A proposal fitted to the tempered weights of all samples.
    pub(crate) fn refit(&mut self, next_size: usize) -> Proposal {
        let (s, d) = (self.placing.clone(), self.pool.d);
        if self.pool.len() == 0 {
            self.beta = 0.0;
            return Proposal::prior(d);
        }
        let base = self.pool.ln_base();
        let wished = self.wished(next_size);
        self.beta = temper(&base, &self.pool.ln_l, wished);
        // Tempered samples are wider than the posterior as they are.
        let tails = self.tails && self.beta >= 1.0;
        let power = if tails { (1.0 / s.widening).clamp(FLATTEST, 1.0) } else { self.beta };
        let ln: Vec<f64> = base
            .iter()
            .zip(&self.pool.ln_l)
            .map(|(b, l)| if l.is_finite() { b + power * l } else { f64::NEG_INFINITY })
            .collect();
        let (weights, _) = exponentiate(&ln);
        let stage = self.stages();
        let nu = s.degrees_of_freedom;
        let fit = Cloud::new(d, &self.pool.z, &weights, s.seed, stage)
            .map(|cloud| cloud.fit(s.max_components, s.seed, stage));
        let Some(fit) = fit else { return Proposal::prior(d) };
        self.counters.em_iterations += fit.em_iterations;
        self.counters.mixtures_fitted += fit.mixtures;
        let mut components = self.placed(&weights).unwrap_or_default();
        let rest = 1.0 - components.iter().map(|c| c.weight).sum::<f64>();
        let widen = if tails { s.widening * power } else { s.widening }.sqrt();
        components.extend(fit.components.into_iter().map(|g| {
            let factor = g.factor.iter().map(|f| f * widen).collect();
            Component::new(rest * g.weight, g.mean, factor, nu)
        }));
        let mut proposal =
            Proposal { dimension: d, prior_share: 0.0, degrees_of_freedom: nu, components };
        // Density of the mixture at every sample of positive weight, updated as components join.
        let mut density: Vec<f64> =
            (0..self.pool.len())
                .into_par_iter()
                .with_min_len(256)
                .map(|i| {
                    if weights[i] > 0.0 {
                        proposal.student_density(self.pool.point(i))
                    } else {
                        0.0
                    }
                })
                .collect();
        for _ in 0..s.patches {
            if !self.patch(&mut proposal, &ln, &weights, &density) {
                break;
            }
            let newest = &proposal.components[proposal.components.len() - 1];
            density.par_iter_mut().enumerate().with_min_len(256).for_each(|(i, density)| {
                if weights[i] > 0.0 {
                    *density +=
                        newest.weight * newest.density(newest.distance2(self.pool.point(i)), nu);
                }
            });
        }
        if tails {
            let further = WIDER.sqrt();
            let wide: Vec<Component> = proposal
                .components
                .iter()
                .map(|c| {
                    let factor = c.factor.iter().map(|f| f * further).collect();
                    Component::new(c.weight * WIDE_SHARE, c.mean.clone(), factor, nu)
                })
                .collect();
            proposal.components.iter_mut().for_each(|c| c.weight *= 1.0 - WIDE_SHARE);
            proposal.components.extend(wide);
        }
        // The prior's share, and the rest to the components.
        let total: f64 = proposal.components.iter().map(|c| c.weight).sum();
        for c in &mut proposal.components {
            c.weight *= (1.0 - s.defensive_share) / total;
        }
        proposal.prior_share = s.defensive_share;
        proposal
    }

    /// Adds a component where the proposal is thinnest beside the target: at the sample with the largest ratio
    /// of the two, with the covariance of its nearest weighty neighbours and their share of the weight
    /// (incremental mixture importance sampling: A. E. Raftery, L. Bao, Biometrics 66 (2010) 1162).
    /// False where none was added.
    fn patch(
        &self,
        proposal: &mut Proposal,
        ln_weights: &[f64],
        weights: &[f64],
        density: &[f64],
    ) -> bool {
        const NEIGHBOURS: usize = 64;
        let (d, pool) = (self.pool.d, &self.pool);
        let total: f64 = weights.iter().sum();
        let defensive = self.placing.defensive_share;
        // Target over proposal: the weight times the mixture so far over the new proposal.
        let ratio = |i: usize| -> f64 {
            if weights[i] <= 0.0 {
                return f64::NEG_INFINITY;
            }
            let ln_prior = pool.ln_prior(i);
            let ln_mixture = pool.ln_mixture_over_prior[i];
            ln_weights[i] + ln_mixture - ln_sum(defensive.ln(), density[i].ln() - ln_prior)
        };
        let ratios: Vec<f64> =
            (0..pool.len()).into_par_iter().with_min_len(256).map(ratio).collect();
        let Some(worst) =
            (0..ratios.len()).max_by(|a, b| ratios[*a].total_cmp(&ratios[*b]).then(b.cmp(a)))
        else {
            return false;
        };
        if ratios[worst] == f64::NEG_INFINITY || proposal.components.is_empty() {
            return false;
        }
        // Distances in the nearest component's own scale.
        let centre = pool.point(worst).to_vec();
        let mut scale = proposal.components[0].clone();
        for c in &proposal.components[1..] {
            if c.distance2(&centre) < scale.distance2(&centre) {
                scale = c.clone();
            }
        }
        scale.mean.clone_from(&centre);
        let mut near: Vec<(f64, usize)> = (0..pool.len())
            .filter(|i| weights[*i] > 1e-6 * weights[worst])
            .map(|i| (scale.distance2(pool.point(i)), i))
            .collect();
        if near.len() > NEIGHBOURS {
            near.select_nth_unstable_by(NEIGHBOURS, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.truncate(NEIGHBOURS);
        }
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mass: f64 = near.iter().map(|(_, i)| weights[*i]).sum::<f64>();
        let mut covariance = vec![0.0; d * d];
        let even = 1.0 / near.len() as f64;
        for (_, i) in &near {
            let share = 0.5 * (weights[*i] / mass + even);
            let z = pool.point(*i);
            for a in 0..d {
                for b in 0..d {
                    covariance[a * d + b] += share * (z[a] - centre[a]) * (z[b] - centre[b]);
                }
            }
        }
        for a in 0..d {
            // A little of the nearest component's scale, so that few or collinear neighbours make a component too.
            let own: f64 = (0..=a).map(|k| scale.factor[a * d + k].powi(2)).sum();
            covariance[a * d + a] += 1e-3 * own;
        }
        if let Some(factor) = cholesky(&covariance, d) {
            let all: f64 = proposal.components.iter().map(|c| c.weight).sum();
            let weight = (mass / total).clamp(0.01, 0.2) * all;
            let nu = proposal.degrees_of_freedom;
            proposal.components.push(Component::new(weight, centre, factor, nu));
            return true;
        }
        false
    }

    /// GrainLearning's weights: likelihood of the newest iteration alone, with the sigma at which its effective
    /// sample size is the wished-for share, and no correction for the proposal.
    pub(crate) fn tuned_ln_weights(&self, share: f64) -> Vec<f64> {
        let n = self.proposals.last().map_or(0, |p| p.0);
        let first = self.pool.len() - n;
        let newest = &self.pool.ln_l[first..];
        let beta = tune(newest, share * n as f64);
        let mut ln = vec![f64::NEG_INFINITY; first];
        ln.extend(newest.iter().map(|l| if l.is_finite() { beta * l } else { f64::NEG_INFINITY }));
        ln
    }

    /// GrainLearning's next proposal: the mixture fitted to those weights, neither widened nor defended.
    pub(crate) fn refit_tuned(&mut self, share: f64) -> Proposal {
        let (weights, _) = exponentiate(&self.tuned_ln_weights(share));
        self.beta = 1.0;
        let (d, s, stage) = (self.pool.d, self.settings, self.stages());
        let Some(cloud) = Cloud::new(d, &self.pool.z, &weights, s.seed, stage) else {
            return Proposal::prior(d);
        };
        let fit = cloud.fit(s.max_components, s.seed, stage);
        self.counters.em_iterations += fit.em_iterations;
        self.counters.mixtures_fitted += fit.mixtures;
        // So many degrees of freedom that components are normal.
        let nu = 1e6;
        let components = fit
            .components
            .into_iter()
            .map(|g| Component::new(g.weight, g.mean, g.factor, nu))
            .collect();
        Proposal { dimension: d, prior_share: 0.0, degrees_of_freedom: nu, components }
    }

    /// Runs all stages without an observer.
    pub(crate) fn run(&mut self) -> Result<(), CalibrateError> {
        loop {
            self.place(&mut Self::next);
            if self.take()?.is_none() {
                return Ok(());
            }
        }
    }
}
