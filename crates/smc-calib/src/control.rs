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
//! Where a Gaussian process has placed the first samples, processes through those before the final stage are stacked with the quadratics
//! (see below). Their covariances are those of all samples, and the shares those of the final stage: this is without bias but for that.
//!
//! Where it places all samples ([`crate::small_budget`]), the mixture of all proposals stands for q and all samples
//! for the final stage: each sub-net's are held against a g through all others. That g is, for each phi, the sum of several processes
//! and of local quadratics, with the shares that leave the least of f phi / q where they were left out (stacking: L. Breiman,
//! Mach. Learn. 24 (1996) 49). The better the sub-nets know an
//! integral with it than without, the larger the part of it that is taken with it ([`variate::SHARES`]). As samples are placed by what earlier
//! ones gave, and covariances and shares are those of all, this is without bias only up to terms that fall with the square of its error.
//!
//! Every sub-net of the stage has its own net for the second term, so that it is a replicate of the whole, and the
//! spread of the sub-nets is an error bar of both terms together. With a process the first term is one of pairs of samples,
//! and the spread alone would say no more than half of its variance ([`count_pairs_twice`]). What no sample has shown all sub-nets
//! miss alike: a process that runs through all samples says how much that can be ([`errors`]), and the larger error counts.
//! Its own integrals, without any weights, are taken with the share that its errors beside those of the sub-nets give them
//! ([`through_all`]): most of it where the likelihood is smooth.

mod by_process;
mod drawn;
mod errors;
mod frozen;
mod levels;
mod made_of;
mod through_all;
mod variate;

pub(crate) use self::by_process::ByProcess;

use self::drawn::Drawn;
use self::errors::Over;
use self::made_of::{MadeOf, Part, most_trusted};
use self::through_all::ThroughAll;
use self::variate::{
    Model, Standard, Variate, cap, count_pairs_twice, features, left, mean, scatter, share,
    stacked, surrogate,
};
use crate::estimate::{Axis, Estimator, Integrals};
use crate::gaussian_process::Found;
use crate::mixture::Proposal;
use crate::neighbours::MOST_DIMENSIONS;
use crate::pool::effective_sample_size;
use crate::sampler::Sampler;
use crate::small_budget::StandIn;
use crate::sobol::scrambled_net;
use crate::stage::Finishing;
use crate::stream::{Purpose, stream};
use crate::surrogate::{MOST_PARAMETERS, coefficients};
use crate::trust::limits::HELD_AGAINST_PROCESS;
use crate::trust::{Tail, agree};
use crate::{Evidence, Settings};
use rayon::prelude::*;
use std::sync::Arc;

/// Points that local quadratics are integrated with, per sample of the final stage, and at least.
const POINTS: [usize; 2] = [8, 32_768];
/// The least for a process: over all samples, where every sub-net has one of its own, and over a final stage. With 32 768 there PS and PA12
/// are a quarter further off at 2048 simulations.
const POINTS_OF_PROCESS: [usize; 2] = [16_384, 65_536];
/// Samples that tell shares of surrogates. Told by all of 1024 the errors of PS and PA12 are the same.
const JUDGES: usize = 150;
/// Fewest samples that a process is held against, and fewest sub-nets: two do not show what pairs of samples do.
const FEWEST: usize = 32;
const FEWEST_NETS: usize = 3;
/// Least share of the variance of f/q that local quadratics must explain.
const LEAST_EXPLAINED: f64 = 0.5;
/// Parts of the final stage, each with a surrogate that its own samples had no part in.
const FOLDS: usize = 2;

/// Normal score of the end of a prior that no sample is moved beyond: all but 1e-12 of it.
const MOST_SCORE: f64 = 7.0;

/// Standard error of the final stage's evidence, over that of all samples, from which on the latter is reported. By its number of
/// samples the final stage has 1.4 times the error, and its mean is exact; with more it has missed what earlier stages found.
const WORSE: f64 = 1.5;

/// The process through all samples, where one has placed them, or the first of a run of fewer than [`Settings::WHOLLY_PLAIN`].
fn process<'a>(sampler: &'a Sampler<'_>, weights: &[f64]) -> Option<StandIn<'a>> {
    let (n, d, settings) = (sampler.pool.len(), sampler.pool.d, sampler.settings);
    let first = settings.placed_by_process() > 0 && settings.samples < Settings::WHOLLY_PLAIN;
    let most = if sampler.placing.surrogate { MOST_PARAMETERS } else { MOST_DIMENSIONS };
    if !first || d > most || n < FEWEST || sampler.replicates < FEWEST_NETS {
        return None;
    }
    StandIn::of_all(sampler.target, &sampler.pool, weights)
}

/// The samples and their target f/q, for which a g is wanted.
struct Control<'a> {
    sampler: &'a Sampler<'a>,
    /// Weights of all samples over `exp(ln_scale)`.
    weights: &'a [f64],
    ln_scale: f64,
    first: usize,
    proposal: &'a Proposal,
    /// f/q over the scale at the samples that were drawn from q.
    target: Vec<f64>,
    /// Log of q over the prior at all samples.
    ln_q: Vec<f64>,
    /// Moments are of `coordinate(j, z_j)`.
    coordinate: &'a (dyn Fn(usize, f64) -> f64 + Sync),
    /// What coordinates are measured in, and 1, x_j and x_i x_j, the phi, at all samples.
    standard: Standard,
    features: Vec<f64>,
}

/// One fold: the numbers of its samples, and g and its values there, from the samples of the others.
struct Fold<'a> {
    own: Vec<usize>,
    variate: Variate<'a>,
    control: Vec<f64>,
}

impl<'a> Control<'a> {
    fn new(
        sampler: &'a Sampler<'a>,
        (weights, ln_scale): (&'a [f64], f64),
        drawn: &Drawn<'a>,
        coordinate: &'a (dyn Fn(usize, f64) -> f64 + Sync),
        levels: Vec<Vec<f64>>,
    ) -> Self {
        let Drawn { first, proposal, ln_q, .. } = *drawn;
        let target = drawn.over(ln_scale);
        let ln_q = [&sampler.ln_last_proposal(0..first)[..], ln_q].concat();
        let (standard, features) = features(&sampler.pool, weights, coordinate, levels);
        Self {
            sampler,
            weights,
            ln_scale,
            first,
            proposal,
            target,
            ln_q,
            coordinate,
            standard,
            features,
        }
    }

    /// Whether g is for all samples, and not for the final stage.
    fn of_all(&self) -> bool {
        self.first == 0
    }

    fn fold(&self, made_of: &MadeOf<'a>, fold: usize) -> Option<Fold<'a>> {
        let Self { sampler, first, ln_scale, .. } = *self;
        let (pool, folds) = (&sampler.pool, self.folds(made_of));
        let (own, others): (Vec<usize>, Vec<usize>) =
            (first..pool.len()).partition(|i| pool.replicate[*i] as usize % folds == fold);
        let known = (0..first).chain(others.iter().copied());
        let model = match made_of {
            MadeOf::Quadratics { metric } => {
                let known: Vec<usize> = known.collect();
                Model::Local(Box::new(surrogate(sampler, &known, &self.ln_q, metric)?))
            }
            MadeOf::Process { all, found } => {
                Model::Process(Arc::new(all.like(pool, self.weights, known, found)?))
            }
            MadeOf::ProcessBefore(process) => Model::Process(Arc::clone(process)),
        };
        let cap = cap(others.iter().map(|i| self.target[i - first]), self.of_all());
        let variate = Variate { model, ln_scale, cap };
        let control: Vec<f64> = own
            .par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |found, i| variate.at(pool.point(*i), self.ln_q[*i], found))
            .collect();
        Some(Fold { own, variate, control })
    }

    /// Number of the parts of the samples, each with a g that its own samples had no part in; of all samples and a process every sub-net
    /// is one.
    fn folds(&self, made_of: &MadeOf<'_>) -> usize {
        match made_of {
            MadeOf::Process { .. } => self.sampler.replicates,
            _ => FOLDS,
        }
    }

    /// Values of g where it is left out, at all samples of the sub-nets that judge, and zero at others: of all samples as if no simulation
    /// failed. All processes have the same edge of failures, and by chance the one that is wrongest inside is closest to samples at it.
    fn left_out(&self, made_of: &MadeOf<'a>) -> Option<Vec<f64>> {
        let pool = &self.sampler.pool;
        let folds = 0..self.folds(made_of).min(self.judges());
        let folds: Option<Vec<Fold<'_>>> =
            folds.into_par_iter().map(|fold| self.fold(made_of, fold)).collect();
        let mut values = vec![0.0; self.target.len()];
        for Fold { own, control, variate } in folds? {
            for (i, control) in own.iter().zip(&control) {
                let failed = !pool.ln_l[*i].is_finite();
                values[i - self.first] = if self.of_all() {
                    variate.without_edge(*control, pool.point(*i), failed)
                } else {
                    *control
                };
            }
        }
        values.iter().all(|value| value.is_finite()).then_some(values)
    }

    /// Number of sub-nets, the first ones, whose samples judge: they have [`JUDGES`] together, or are all; of a final stage, where two
    /// processes are enough, all.
    fn judges(&self) -> usize {
        let r = self.sampler.replicates;
        if self.of_all() { (JUDGES * r).div_ceil(self.target.len()).min(r) } else { r }
    }

    /// Some ways, with the shares that leave the least of f phi / q where they are left out.
    fn stacked(&self, ways: Vec<MadeOf<'a>>) -> Vec<Part<'a>> {
        let p = coefficients(self.sampler.pool.d);
        if ways.len() == 1 {
            let all = |made_of| Part { made_of, shares: vec![1.0; p] };
            return ways.into_iter().map(all).collect();
        }
        let judged = ways.into_iter().filter_map(|way| self.left_out(&way).map(|v| (way, v)));
        let (ways, values): (Vec<_>, Vec<_>) = judged.unzip();
        let judges = self.judges() as u32;
        let labels = &self.sampler.pool.replicate[self.first..];
        let width = self.standard.count();
        let squares: Vec<Vec<f64>> = (0..p)
            .map(|a| {
                let phi = self.features[self.first * width + a..].iter().step_by(width);
                let judged = labels.iter().zip(phi);
                judged.map(|(k, phi)| if *k < judges { phi * phi } else { 0.0 }).collect()
            })
            .collect();
        let shares = stacked(&values, &self.target, &squares);
        let parts = ways.into_iter().enumerate().map(|(k, made_of)| Part {
            made_of,
            shares: shares.iter().map(|of_integral| of_integral[k]).collect(),
        });
        parts.filter(|part| part.shares.iter().any(|share| *share > 0.0)).collect()
    }

    /// The integrals, where the surrogate is good enough to be of use, with their errors by what a process does not know; the log
    /// evidence of the sub-nets alone.
    fn integrals(
        self,
        stack: &[Part<'a>],
        process: Option<&StandIn<'_>>,
        finishing: &mut Finishing<'_>,
    ) -> Option<(Integrals, f64)> {
        let Self { sampler, target, ln_scale, .. } = &self;
        if stack.is_empty() {
            return None;
        }
        let (r, p) = (sampler.replicates, self.standard.count());
        let local = stack.iter().all(|part| matches!(part.made_of, MadeOf::Quadratics { .. }));
        // Where samples are left out of a process one by one there are two nets for each sub-net: their difference tells the nets' error.
        let pairs = !local && self.of_all();
        let parts = if pairs { 2 } else { 1 };
        let mut of_nets = vec![0.0; r * parts * p];
        let folds = |parts: &[Part<'_>]| parts.iter().map(|p| self.folds(&p.made_of)).sum();
        let mut controls = Vec::with_capacity(stack.len());
        for (k, part) in stack.iter().enumerate() {
            let done = (folds(&stack[..k]), folds(stack));
            controls.push(self.add(part, local, &mut of_nets, (done, finishing))?);
        }
        let control = |i: usize, a: usize| -> f64 {
            stack.iter().zip(&controls).map(|(part, of_part)| part.share(a) * of_part[i]).sum()
        };
        if !local {
            // Over all sub-nets: one of a few samples says nothing.
            let controls: Vec<f64> = (0..target.len()).map(|i| control(i, 0)).collect();
            // Of all samples a process that explains little helps too: where half was asked for, the banana was .18 off in ln Z by 32
            // samples, not .11. A final stage that is not explained knows less than all samples do.
            let least = if self.of_all() { 0.0 } else { LEAST_EXPLAINED };
            if left(target, &controls) >= 1.0 - least {
                return None;
            }
        }
        let mut of_sub_nets = vec![0.0; r * p];
        for (sums, net) in of_sub_nets.chunks_mut(p).zip(of_nets.chunks(parts * p)) {
            for part in net.chunks(p) {
                sums.iter_mut().zip(part).for_each(|(s, part)| *s += part / parts as f64);
            }
        }
        self.add_means(|i, a| target[i] - control(i, a), &mut of_sub_nets);
        let mut by_samples = vec![0.0; r * p];
        self.add_means(|i, _| target[i], &mut by_samples);
        let spread: Vec<f64> = (0..p).map(|a| scatter(&of_sub_nets, p, a)).collect();
        if pairs {
            count_pairs_twice(&mut of_sub_nets, &of_nets, p);
        }
        let cross_fitted = ln_scale + mean(&of_sub_nets, p, 0).ln();
        // Of a final stage, and of more samples than the process that places them runs through, the sub-nets show more than its draws.
        let process = process.filter(|_| self.of_all());
        let few = process.filter(|process| process.runs_through_all(&sampler.pool));
        let trusted = most_trusted(process, stack);
        let found = trusted.or_else(|| Some(&few?.process.covariance));
        let all = process.zip(found).and_then(|(process, found)| self.through_all(process, found));
        let left = match (&all, trusted) {
            (Some(all), Some(_)) => all.mixed_into(&mut of_sub_nets, &of_nets, p),
            _ => vec![1.0; p],
        };
        // What the two differ by is no sign against the sub-nets.
        let known = |a: usize| left[a].min(1.0) * spread[a];
        // What lies below a level has the share of the evidence: where no sample is below it their spread says nothing.
        let moments = coefficients(sampler.pool.d);
        let of = |a: usize| share(known(a), scatter(&by_samples, p, a));
        let shares = (0..p).map(|a| of(if a < moments { a } else { 0 })).collect();
        let errors = all.filter(|_| few.is_some());
        let errors = errors.map_or_else(Vec::new, |all| all.errors(&of_sub_nets, p));
        let (axes, features, levels) = (self.axes(), self.features, self.standard.into_levels());
        Some((Integrals { of_sub_nets, features, shares, errors, axes, levels }, cross_fitted))
    }

    /// What coordinates are standardised by, where few samples may have to be moved.
    fn axes(&self) -> Vec<Axis> {
        if !self.sampler.placing.surrogate {
            return Vec::new();
        }
        let range = |j| [-MOST_SCORE, MOST_SCORE].map(|z| (self.coordinate)(j, z));
        self.standard.axes(range)
    }

    /// The integrals by one process through all samples, or as many as a process of the sub-nets runs through.
    fn through_all(&self, process: &StandIn<'_>, found: &Found) -> Option<ThroughAll> {
        let Self { sampler, proposal, standard, coordinate, ln_scale, .. } = self;
        let (pool, seed) = (&sampler.pool, sampler.settings.seed);
        let process = process.like(pool, self.weights, 0..pool.len(), found)?;
        let cap = cap(self.target.iter().copied(), self.of_all());
        let over = Over { proposal, ln_scale: *ln_scale, cap };
        let p = standard.count();
        let features = |z: &[f64], row: &mut [f64]| standard.features_at(z, coordinate, row);
        let draws = errors::integrals(&process, pool, over, p, &features, seed);
        let g = Variate { model: Model::Process(Arc::new(process)), ln_scale: *ln_scale, cap };
        let by_net = |net: &[f64], sums: &mut [f64]| {
            g.integrate(net, proposal, standard, coordinate, sums);
        };
        let of_nets = through_all::of_nets(proposal.uniforms(), p, seed, &by_net);
        let off = errors::off_by_draws(&draws, &through_all::means(&of_nets, p));
        Some(ThroughAll { of_nets, off })
    }

    /// Adds a part's share of the integrals of g phi, by nets of its own for every sub-net; its g at the samples, each where it is
    /// left out. None where local quadratics, which are all there is, do not explain enough.
    fn add(
        &self,
        part: &Part<'a>,
        local: bool,
        of_nets: &mut [f64],
        ((done, all), finishing): ((usize, usize), &mut Finishing<'_>),
    ) -> Option<Vec<f64>> {
        let Self { sampler, proposal, target, first, .. } = self;
        let (n, r, p) = (target.len(), sampler.replicates, self.standard.count());
        let nets = of_nets.len() / (r * p);
        let of_process = POINTS_OF_PROCESS[usize::from(!self.of_all())];
        let least = if local { POINTS[1] } else { of_process };
        let points = (POINTS[0] * n).max(least) / (r * nets);
        let folds = self.folds(&part.made_of);
        let mut controls = vec![0.0; n];
        for fold in 0..folds {
            let done = 2 * (done + fold);
            finishing.of_integrals(done, all, "evidence and means: stand-in");
            let Fold { own, variate, control } = self.fold(&part.made_of, fold)?;
            let target: Vec<f64> = own.iter().map(|i| target[i - first]).collect();
            if local && left(&target, &control) >= 1.0 - LEAST_EXPLAINED {
                return None;
            }
            own.iter().zip(&control).for_each(|(i, control)| controls[i - first] = *control);

            finishing.of_integrals(done + 1, all, "evidence and means: integrals");
            let seed = sampler.settings.seed;
            of_nets.par_chunks_mut(nets * p).enumerate().skip(fold).step_by(folds).for_each(
                |(k, sums)| {
                    let mut rng = stream(seed, Purpose::Surrogate, 0, k);
                    for sums in sums.chunks_mut(p) {
                        let net = scrambled_net(proposal.uniforms(), points, &mut rng);
                        let mut own = vec![0.0; p];
                        let (standard, coordinate) = (&self.standard, self.coordinate);
                        variate.integrate(&net, proposal, standard, coordinate, &mut own);
                        let shared = sums.iter_mut().zip(&own).enumerate();
                        shared.for_each(|(a, (s, own))| *s += part.share(a) * own);
                    }
                },
            );
        }
        Some(controls)
    }

    /// Adds to every sub-net's sums of integral a the mean of `value(i, a)` times phi over its samples.
    fn add_means(&self, value: impl Fn(usize, usize) -> f64, sums: &mut [f64]) {
        let (first, r) = (self.first, self.sampler.replicates);
        let (labels, p) = (&self.sampler.pool.replicate[first..], sums.len() / r);
        let mut counts = vec![0.0; r];
        labels.iter().for_each(|k| counts[*k as usize] += 1.0);
        let rows = self.features[first * p..].chunks_exact(p);
        for (i, (label, phi)) in labels.iter().zip(rows).enumerate() {
            let k = *label as usize;
            for (a, (s, phi)) in sums[k * p..(k + 1) * p].iter_mut().zip(phi).enumerate() {
                *s += value(i, a) / counts[k] * phi;
            }
        }
    }
}

/// Whether no heavy tail of the weights or of a parameter's moments can change an estimate.
fn tails_hold(
    sampler: &Sampler<'_>,
    raw: &[f64],
    estimator: &Estimator,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
) -> bool {
    let (d, of_weights) = (sampler.pool.d, Tail::of(raw));
    (0..d).all(|j| {
        let z = sampler.pool.z.iter().skip(j).step_by(d);
        let own = || z.map(|z| coordinate(j, *z)).collect();
        let column: Vec<f64> = estimator.moved(j).unwrap_or_else(own);
        let mean = estimator.mean(|i| column[i]);
        Tail::of_moments(estimator.judged(raw), &column, mean).heavier(of_weights).holds()
    })
}

/// All samples with the weights of the result, the evidence, and a process to draw from where one knows more than they do. `raw` are the
/// importance weights over `exp(ln_scale)`, `coordinate(j, z_j)` is what moments are taken of.
pub(crate) fn estimate<'a>(
    sampler: &'a Sampler<'_>,
    raw: &[f64],
    ln_scale: f64,
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    finishing: &mut Finishing<'_>,
) -> (Estimator, Evidence, Option<ByProcess<'a>>) {
    let mut estimator = Estimator::new(&sampler.pool, raw.to_vec(), ln_scale, sampler.replicates);
    let (pooled_value, pooled_se) = estimator.log_evidence();
    let frozen = sampler.frozen();
    let (frozen_value, frozen_se) = sampler.frozen_evidence(&frozen);
    let far = sampler.placing.surrogate || sampler.pool.d > MOST_DIMENSIONS;
    let mixture = if far { Proposal::of_stages(&sampler.proposals) } else { None };
    let ln_w = if far { sampler.ln_weights() } else { Vec::new() };
    let drawn = if far {
        mixture.as_ref().map(|mixture| Drawn::of_all(sampler, mixture, &ln_w))
    } else {
        Drawn::finally(sampler, &frozen)
    };
    let process = if far || drawn.is_some() { process(sampler, raw) } else { None };
    let can_be = sampler.pool.d <= MOST_PARAMETERS && sampler.replicates > 1;
    let all = process.as_ref().filter(|_| sampler.placing.surrogate);
    let known = drawn.as_ref().filter(|_| can_be).and_then(|drawn| {
        let before = (drawn.first > 0).then_some((drawn.first, raw));
        let ways = MadeOf::ways(&sampler.pool, drawn.proposal, process.as_ref(), before);
        let levels = all.map_or_else(Vec::new, |all| {
            levels::levels(all, drawn.capped(ln_scale), coordinate, sampler.settings.seed)
        });
        let control = Control::new(sampler, (raw, ln_scale), drawn, coordinate, levels);
        let stack = control.stacked(ways);
        control.integrals(&stack, process.as_ref(), finishing)
    });
    let cross_fitted = known.and_then(|(known, cross_fitted)| {
        estimator.hold_to(known, sampler.pool.d, far).then_some(cross_fitted)
    });
    let (value, se) = if cross_fitted.is_some() {
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
    let few = effective_sample_size(raw) < HELD_AGAINST_PROCESS;
    let held = all.filter(|_| few || !tails_hold(sampler, raw, &estimator, coordinate));
    let by_process = held.and_then(|process| sampler.evidences_of(process));
    let [process_value, process_mean] = by_process.map_or([None; 2], |both| both.map(Some));
    let evidence = Evidence {
        value,
        se,
        frozen_value,
        frozen_se,
        pooled_value,
        pooled_se,
        agree,
        process_value,
        process_mean,
        cross_fitted_value: cross_fitted.filter(|by| by.is_finite() && process_value.is_some()),
    };
    let drawn_by = all.zip(drawn).filter(|_| estimator.below(0).is_some());
    let drawn_by =
        drawn_by.and_then(|(all, of)| ByProcess::new(all, sampler, raw, of.capped(ln_scale)));
    (estimator, evidence, drawn_by)
}
