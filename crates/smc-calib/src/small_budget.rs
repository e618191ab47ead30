//! Budgets of 30 to two thousand simulations: more and smaller stages, placed by a stand-in for the likelihood.

mod draws;
mod failing;
mod points;
mod unknown;

#[cfg(test)]
pub(crate) use self::draws::tests::{sampled, through_all};
pub(crate) use self::failing::Edge;
use self::failing::Failing;
use self::points::Points;
use self::unknown::Unknown;
use crate::cholesky::rows_of;
use crate::gaussian_process::{Covariance, Data, Found, GaussianProcess};
use crate::mixture::Component;
use crate::pool::{Pool, exponentiate};
use crate::sampler::Sampler;
use crate::target::{Target, follows_from_kept};
use crate::{Settings, SimError};
use rayon::prelude::*;
use std::cell::Cell;

/// Share of each proposal that is fitted to the samples themselves, without the stand-in, so that a stand-in that is sure
/// of the wrong place is found out: of few samples and of more than [`Points::FEW`].
const OWN: [f64; 2] = [0.05, 0.15];
/// Effective size that tempering aims at, per parameter and one more.
const WISHED: f64 = 3.0;
/// Largest error of the stand-in's log likelihood; with a larger one it is flattened until it has this one.
const ERROR: f64 = 4.0;
/// Evaluations of the stand-in for one proposal.
const EVALUATIONS: usize = 2048;
/// Stream of the evaluations for its evidence; those for proposals have the number of their stage, in higher bits.
const EVIDENCE: u64 = 1 << 47;
/// Depth of log density below the best sample down to which errors of the stand-in count.
const MATTERS: f64 = 6.0;
/// Covariances are searched at every stage that is not a hunt up to so many samples, and then whenever the number has grown by this
/// factor. With 64 and 1.4 one run in ten of 256 simulations of the banana keeps a covariance that is wrong (sd off by
/// 15 % and more).
const FEW: usize = 128;
const GROWN: f64 = 1.2;
/// Nugget of log likelihoods: at the best sample, and per unit of log density below it.
const NUGGET: [f64; 2] = [0.02, 0.1];
/// Nugget of curves, in units of their spread: at the best sample, and per unit of distance from its curve.
const NUGGET_OF_CURVES: [f64; 2] = [0.003, 0.03];
/// Most that the log likelihood is lowered by where simulations are expected to fail.
const DEAD: f64 = 5.0;
/// Half the variance of a log likelihood, times [`SAID_TOO_SMALL`], up to which the process is believed.
const UNSURE: f64 = 2.0;
/// Factor on the variance that a process says, before it is held against [`UNSURE`]: on smooth likelihoods its errors are two to ten of
/// the standard deviations that it says. With 1, PA12 is .009 off at 1024 simulations, not .007 (its sds 1.4 %, not .6 %), and the banana
/// .06 at 50, not .02.
const SAID_TOO_SMALL: f64 = 5.0;

/// Components of a proposal at most.
const COMPONENTS: usize = 8;
/// Every so many stages, of few samples and of more than [`Points::FEW`], samples are placed where what the process does not know
/// weighs most: by f sd instead of f, with the log likelihood raised by so many standard deviations sd, within a bound, and with a
/// floor below sd. The control variate leaves f times the process's error, which is what these samples make small. Of curves that is
/// done with few samples only: with a thousand PS's sd was a tenth off.
const HUNTS: [usize; 2] = [2, 3];
/// Of so many stages of few samples one is placed by the mean of f over the errors of the process, which goes where a far better
/// fit than that found can still hide. With both, the narrow posterior of PEEK is found by 100 runs in 50 of 50 seeds; with the first
/// alone it was not in one of 40, with none in two.
///
/// So few samples that nearly all of the prior is unknown do not know where that is: of those placed by the mean before
/// [`MEANS_FROM`] one of ten was a better fit than all before it, of the others one of four. Without them, and with lengths alone for
/// a covariance, 26 of 100 runs of 50 simulations of PEEK are more than one posterior standard deviation off, no longer 36, and 26 of
/// PS, no longer 30.
const MEANS: usize = 4;
const MEANS_FROM: usize = 40;
const OPTIMISM: f64 = 2.0;
const MOST_OPTIMISM: f64 = 6.0;
const KNOWN: f64 = 0.1;

/// The density by which a stand-in places samples.
enum Sought {
    /// Likelihood times prior, f.
    Plain,
    /// What the process does not know of it.
    Unknown(Unknown),
    /// Its mean over what the process does not know.
    Mean(Unknown),
}

/// A stand-in for the log likelihood.
pub(crate) struct StandIn<'a> {
    target: &'a dyn Target,
    pub process: GaussianProcess,
    /// Numbers of the samples that it runs through, the best first.
    chosen: Vec<usize>,
    /// Whether it predicts the outputs, from which the log likelihood follows, or the log likelihood itself.
    outputs: bool,
    /// Where samples failed; none where all finished.
    failing: Option<Failing>,
    /// How many of the chosen samples, from the first one on, matter or are enough.
    best: usize,
    /// Power of the likelihood: its root mean square error, when each of the best samples is left out, is then
    /// [`ERROR`] at most.
    power: f64,
    /// The density that is placed by.
    sought: Sought,
}

impl<'a> StandIn<'a> {
    /// Made from some samples of the pool.
    ///
    /// It predicts the outputs wherever the log likelihood follows from them: a process through the log likelihoods alone
    /// knows less, and believes in modes far from all samples.
    pub(crate) fn new(
        target: &'a dyn Target,
        pool: &'a Pool,
        weights: &[f64],
        known: impl Iterator<Item = usize>,
        covariance: Covariance<'_>,
    ) -> Option<Self> {
        let points = Points::FEW;
        Self::with(target, pool, weights, (known, points), [covariance, Covariance::Search])
    }

    /// Made from all samples of the pool, to estimate by: its covariances are those that integrals are taken with, and few effective
    /// samples, and weights with a heavy tail, are held against it.
    pub(crate) fn of_all(target: &'a dyn Target, pool: &'a Pool, weights: &[f64]) -> Option<Self> {
        let points = (0..pool.len(), Points::EVEN);
        Self::with(target, pool, weights, points, [Covariance::Search; 2])
    }

    /// Made from other samples, through many points, with a covariance that was found for this one, and its own for failures.
    pub(crate) fn like(
        &self,
        pool: &'a Pool,
        weights: &[f64],
        known: impl Iterator<Item = usize>,
        found: &Found,
    ) -> Option<Self> {
        let failing = self.failing.as_ref();
        let failing = failing.map_or(Covariance::Search, |f| Covariance::Like(f.covariance()));
        let covariances = [Covariance::Like(found), failing];
        Self::with(self.target, pool, weights, (known, Points::MANY), covariances)
    }

    /// Made from many of all samples of the pool, with the covariance that it has.
    pub(crate) fn through_many(&self, pool: &'a Pool, weights: &[f64]) -> Option<Self> {
        self.like(pool, weights, 0..pool.len(), &self.process.covariance)
    }

    /// Made with the covariances of its process and of that through finished and failed samples.
    fn with(
        target: &'a dyn Target,
        pool: &'a Pool,
        weights: &[f64],
        (known, points): (impl Iterator<Item = usize>, Points),
        [covariance, of_failing]: [Covariance<'_>; 2],
    ) -> Option<Self> {
        let density: Vec<f64> = (0..pool.len()).map(|i| pool.ln_l[i] + pool.ln_prior(i)).collect();
        let known: Vec<usize> = known.collect();
        let mut ordered: Vec<usize> =
            known.iter().copied().filter(|i| density[*i].is_finite()).collect();
        if ordered.len() < pool.d + 2 {
            return None;
        }
        ordered.sort_by(|a, b| density[*b].total_cmp(&density[*a]).then(a.cmp(b)));
        let highest = density[ordered[0]];
        let depth = |i: &usize| highest - density[*i];
        let chosen = points.of(ordered, depth);
        let depths: Vec<f64> = chosen.iter().map(depth).collect();
        let outputs = follows_from_kept(target);
        let process = if outputs {
            curve_process(pool, weights, &chosen, covariance)?
        } else {
            likelihood_process(pool, weights, &chosen, &depths, covariance)?
        };
        let best = depths.iter().filter(|depth| **depth < MATTERS).count();
        let best = best.max(2 * (pool.d + 1)).min(chosen.len());
        let alive: Vec<bool> = known.iter().map(|i| density[*i].is_finite()).collect();
        let failing = if alive.contains(&false) {
            Some(Failing::new((pool, weights), (&known, &alive), Points::FEW.most(), of_failing)?)
        } else {
            None
        };
        let (power, sought) = (1.0, Sought::Plain);
        let mut made = Self { target, process, chosen, outputs, failing, best, power, sought };
        let squares = (0..best).map(|k| made.left_out(pool, k).1.powi(2));
        let error = (squares.sum::<f64>() / best as f64).sqrt();
        made.power = (ERROR / error.max(1e-9)).min(1.0);
        error.is_finite().then_some(made)
    }

    /// What is predicted of the k-th chosen sample without it, and the error of its log likelihood by that.
    fn left_out(&self, pool: &Pool, k: usize) -> (Vec<f64>, f64) {
        let (i, m) = (self.chosen[k], self.process.units.len());
        let left_out = &self.process.left_out[k * m..(k + 1) * m];
        if !self.outputs {
            return (vec![pool.ln_l[i] - left_out[0]], -left_out[0]);
        }
        let values = &pool.kept[i * m..(i + 1) * m];
        let predicted: Vec<f64> = values.iter().zip(left_out).map(|(v, e)| v - e).collect();
        let error = self.ln_likelihood_of_predicted(&predicted) - pool.ln_l[i];
        (predicted, error)
    }

    /// Log likelihood, not flattened, lowered where the process does not know it: by what half its variance, times [`SAID_TOO_SMALL`],
    /// exceeds [`UNSURE`] by. For outputs it is what the log likelihood loses, in the mean, one standard deviation, by that variance,
    /// above and below them.
    pub(crate) fn ln_likelihood_at(&self, z: &[f64], edge: Edge) -> f64 {
        let (at, mut outputs) = (self.process.at(z), vec![0.0; self.process.units.len()]);
        self.process.predict_at(&at, &mut outputs);
        let ln_l = self.ln_likelihood_of_predicted(&outputs);
        let lowered = |variance| {
            let unsure = self.unsure(&outputs, ln_l, SAID_TOO_SMALL * variance);
            if unsure.is_nan() { f64::INFINITY } else { (unsure - UNSURE).max(0.0) }
        };
        // What is lost grows with the variance: where the larger one of fewer samples is believed, so is that of all.
        let believed = Cell::new(false);
        let variance = self.process.variance_at(at, |variance| {
            believed.set(lowered(variance) == 0.0);
            believed.get()
        });
        let lowered = if believed.get() { 0.0 } else { lowered(variance) };
        ln_l - lowered + self.ln_finished(z, edge)
    }

    /// What the log likelihood of these predicted values loses by this variance.
    fn unsure(&self, outputs: &[f64], ln_l: f64, variance: f64) -> f64 {
        if !self.outputs {
            return 0.5 * variance * self.process.units[0].powi(2);
        }
        let off = |by: f64| -> f64 {
            let units = outputs.iter().zip(&self.process.units);
            let moved: Vec<f64> = units.map(|(o, unit)| o + by * unit).collect();
            self.target.ln_likelihood_of(&moved).unwrap_or(f64::NAN)
        };
        let sd = variance.sqrt();
        ln_l - 0.5 * (off(sd) + off(-sd))
    }

    /// What the process through samples of this pool does not know.
    fn unknown(&self, pool: &Pool) -> Unknown {
        if !self.outputs {
            return Unknown::OfLikelihoods;
        }
        let m = pool.kept_width;
        let rows = self.chosen.iter().map(|i| &pool.kept[i * m..(i + 1) * m]);
        Unknown::of_curves(self.target, &self.process, rows)
    }

    /// Whether it predicts outputs, and not the log likelihood alone.
    pub(crate) fn predicts_outputs(&self) -> bool {
        self.outputs
    }

    /// What the process predicts at z.
    fn predicted(&self, z: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.process.units.len()];
        self.process.predict(z, &mut values);
        values
    }

    /// What it predicts at many z, row by row.
    pub(crate) fn predicted_rows(&self, z: &[f64]) -> Vec<f64> {
        let rows = z.par_chunks(self.target.dimension()).with_min_len(16);
        rows.flat_map_iter(|z| self.predicted(z)).collect()
    }

    /// Log likelihood by what it predicts.
    fn ln_likelihood_of_predicted(&self, values: &[f64]) -> f64 {
        if self.outputs {
            self.target.ln_likelihood_of(values).unwrap_or(f64::NAN)
        } else {
            values[0]
        }
    }

    /// Log of the likelihood's mean over what the process does not know; as predicted where that has no mean.
    fn ln_mean(&self, unknown: &Unknown, z: &[f64], values: &[f64]) -> f64 {
        let mean = unknown.ln_mean(self.target, &self.process, z, values);
        mean.unwrap_or_else(|| self.ln_likelihood_of_predicted(values))
    }

    /// Log of the probability that a simulation finishes and has a likelihood above zero.
    pub(crate) fn ln_finished(&self, z: &[f64], edge: Edge) -> f64 {
        ln_alive(self.failing.as_ref().map_or(1.0, |failing| failing.finished(z, edge)))
    }
}

/// Log of a probability that a simulation finishes, [`DEAD`] below zero at most.
fn ln_alive(finished: f64) -> f64 {
    finished.max((-DEAD).exp()).ln()
}

/// A process through the log likelihoods of the chosen samples.
fn likelihood_process(
    pool: &Pool,
    weights: &[f64],
    chosen: &[usize],
    depths: &[f64],
    covariance: Covariance<'_>,
) -> Option<GaussianProcess> {
    let values: Vec<f64> = chosen.iter().map(|i| pool.ln_l[*i]).collect();
    let nuggets: Vec<f64> = depths.iter().map(|depth| NUGGET[0] + NUGGET[1] * depth).collect();
    GaussianProcess::new(Data {
        d: pool.d,
        z: &pool.z,
        weights,
        chosen,
        values: &values,
        nuggets: &nuggets,
        offsets: vec![values.iter().copied().fold(f64::NEG_INFINITY, f64::max)],
        units: vec![1.0],
        covariance,
    })
}

/// A process through the curves of the chosen samples, the best one first.
fn curve_process(
    pool: &Pool,
    weights: &[f64],
    chosen: &[usize],
    covariance: Covariance<'_>,
) -> Option<GaussianProcess> {
    let m = pool.kept_width;
    let values = rows_of(&pool.kept, m, chosen);
    let first = &values[..m];
    let mut units = vec![0.0; m];
    for row in values.chunks_exact(m) {
        for ((u, v), f) in units.iter_mut().zip(row).zip(first) {
            *u += (v - f) * (v - f) / chosen.len() as f64;
        }
    }
    for (u, f) in units.iter_mut().zip(first) {
        // What does not vary is known; its unit only has to be one.
        *u = if *u > 0.0 { u.sqrt() } else { f.abs().max(1e-300) };
    }
    // Curves far from the best one need not be met closely.
    let nuggets: Vec<f64> = values
        .chunks_exact(m)
        .map(|row| {
            let square = |((v, f), u): ((&f64, &f64), &f64)| ((v - f) / u).powi(2);
            let sum: f64 = row.iter().zip(first).zip(&units).map(square).sum();
            NUGGET_OF_CURVES[0] + NUGGET_OF_CURVES[1] * (sum / m as f64).sqrt()
        })
        .collect();
    GaussianProcess::new(Data {
        d: pool.d,
        z: &pool.z,
        weights,
        chosen,
        values: &values,
        nuggets: &nuggets,
        offsets: first.to_vec(),
        units,
        covariance,
    })
}

impl Target for StandIn<'_> {
    fn dimension(&self) -> usize {
        self.target.dimension()
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let values = self.predicted(z);
        let ln_l = || self.ln_likelihood_of_predicted(&values);
        let sought = match &self.sought {
            Sought::Plain => self.power * ln_l(),
            Sought::Unknown(unknown) => {
                let sd = unknown.sd(self.target, &self.process, z, &values);
                let raised = self.power * (ln_l() + (OPTIMISM * sd).min(MOST_OPTIMISM));
                raised + (sd.min(1.0) + KNOWN).ln()
            }
            Sought::Mean(unknown) => self.power * self.ln_mean(unknown, z, &values),
        };
        Ok(sought + self.ln_finished(z, Edge::KNOWN))
    }
}

/// A stand-in that is not flattened: the likelihood that it predicts, or its mean over what it does not know.
struct Whole<'a, 'b> {
    stand_in: &'a StandIn<'b>,
    unknown: Option<&'a Unknown>,
}

impl Target for Whole<'_, '_> {
    fn dimension(&self) -> usize {
        self.stand_in.dimension()
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let values = self.stand_in.predicted(z);
        let ln_l = match self.unknown {
            Some(unknown) => self.stand_in.ln_mean(unknown, z, &values),
            None => self.stand_in.ln_likelihood_of_predicted(&values),
        };
        Ok(ln_l + self.stand_in.ln_finished(z, Edge::KNOWN))
    }
}

impl Sampler<'_> {
    /// Effective size that tempering aims at.
    pub(crate) fn wished(&self, next_size: usize) -> f64 {
        let wished = self.placing.tempering_share * next_size as f64;
        if self.placing.surrogate { wished.max(WISHED * (self.pool.d + 1) as f64) } else { wished }
    }

    /// Settings of a run of so many evaluations of a stand-in.
    fn inner_settings(&self, samples: usize, stream: u64) -> Settings {
        Settings {
            samples,
            max_components: COMPONENTS,
            iterations: 5,
            replicates: 1,
            seed: self.settings.seed ^ stream,
            final_share: 0.4,
            tempering_share: 0.1,
            patches: 1,
            batch: 0,
            surrogate: false,
            overlap: 0,
            earlier: Vec::new(),
            first_proposal: None,
            ..self.placing.clone()
        }
    }

    /// Log evidence by a stand-in as it is, not flattened, and by its mean over what it does not know. Half of the first evaluations
    /// are where the last samples were placed, so that a narrow posterior that was found is not looked for again.
    pub(crate) fn evidences_of(&self, stand_in: &StandIn<'_>) -> Option<[f64; 2]> {
        let mut opening = self.proposals.last()?.1.clone();
        let total: f64 = opening.components.iter().map(|c| c.weight).sum();
        opening.prior_share = if total > 0.0 { 0.5 } else { 1.0 };
        opening.components.iter_mut().for_each(|c| c.weight *= 0.5 / total);
        let settings = self.inner_settings(2 * EVALUATIONS, EVIDENCE);
        let evidence = |unknown| -> Option<f64> {
            let whole = Whole { stand_in, unknown };
            let mut inner = Sampler::new(&whole, &settings);
            (inner.tails, inner.opening) = (false, opening.clone());
            inner.run().ok()?;
            let (weights, ln_scale) = exponentiate(&inner.ln_weights());
            Some(ln_scale + (weights.iter().sum::<f64>() / weights.len() as f64).ln())
        };
        let plain = evidence(None)?;
        // Of log likelihoods there is no other mean.
        let mean = match stand_in.unknown(&self.pool) {
            Unknown::OfLikelihoods => plain,
            unknown => evidence(Some(&unknown))?,
        };
        Some([plain, mean])
    }

    /// Components of the next proposal from the stand-in; none where it is not asked for or cannot be made.
    pub(crate) fn placed(&mut self, weights: &[f64]) -> Option<Vec<Component>> {
        if !self.placing.surrogate {
            return None;
        }
        let (n, stage) = (self.pool.len(), self.stages());
        let few = n < Points::FEW.most();
        let hunting =
            stage % HUNTS[usize::from(!few)] == 1 && (few || self.target.measured().is_none());
        let covariance = match &self.searched {
            Some((searched, known))
                if hunting || n > FEW && (n as f64) < GROWN * *searched as f64 =>
            {
                Covariance::Known(known)
            }
            _ => Covariance::Search,
        };
        let mut stand_in = StandIn::new(self.target, &self.pool, weights, 0..n, covariance)?;
        if matches!(covariance, Covariance::Search) {
            self.searched = Some((n, stand_in.process.found.clone()));
        }
        if hunting {
            stand_in.sought = Sought::Unknown(stand_in.unknown(&self.pool));
        } else if few && n >= MEANS_FROM && stage % MEANS == 2 {
            stand_in.sought = Sought::Mean(stand_in.unknown(&self.pool));
        }
        let settings = self.inner_settings(EVALUATIONS, (stage as u64) << 48);
        let mut inner = Sampler::new(&stand_in, &settings);
        inner.tails = false;
        inner.run().ok()?;
        let mut proposal = inner.refit(settings.samples);
        let total: f64 = proposal.components.iter().map(|c| c.weight).sum();
        let share = 1.0 - OWN[usize::from(!few)];
        proposal.components.iter_mut().for_each(|c| c.weight *= share / total);
        if proposal.components.is_empty() {
            return None;
        }
        self.beta = stand_in.power;
        Some(proposal.components)
    }
}
