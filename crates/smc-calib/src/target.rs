//! The sampler's target: a log likelihood over normal scores.

use crate::SimError;
use crate::joint::{JointLikelihood, JointProblem};
use crate::simulator::parallel_block;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// A log likelihood over normal scores; the prior is the standard normal in every coordinate.
///
/// Curves ([`crate::Problem`]) and plain densities ([`crate::reference`]) run through the same sampler.
pub trait Target: Sync {
    /// Number of coordinates.
    fn dimension(&self) -> usize;

    /// Numbers kept per sample beside the log likelihood (the simulated curve).
    fn kept(&self) -> usize {
        0
    }

    /// Log likelihood at normal scores `z`; fills `kept`.
    ///
    /// # Errors
    /// As [`crate::Simulator::simulate`].
    fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError>;

    /// Log likelihood of kept numbers, where it follows from them alone.
    fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
        let _ = kept;
        None
    }

    /// The measured values of the kept numbers, where the log likelihood follows from these alone.
    fn measured(&self) -> Option<Vec<f64>> {
        None
    }

    /// Tells that the log likelihoods of these samples will be asked for: see [`crate::Simulator::announce`].
    fn announce(&self, first: usize, z: &[f64]) {
        let _ = (first, z);
    }

    /// The samples whose answers have changed; see [`crate::Simulator::revised`].
    fn revised(&self, samples: usize) -> Vec<usize> {
        let _ = samples;
        Vec::new()
    }

    /// Whether answers will change later; see [`crate::Simulator::will_revise`].
    fn will_revise(&self) -> bool {
        false
    }

    /// Log likelihoods of samples `first`, `first + 1`, .. at normal scores `z`, row by row; fills `ln_l` and
    /// `kept`. Returns the failures and their places from `first`, in order; `ln_l` is minus infinity there.
    ///
    /// The sampler calls this once per stage, in order, from one thread.
    fn ln_likelihood_batch(
        &self,
        first: usize,
        z: &[f64],
        ln_l: &mut [f64],
        kept: &mut [f64],
    ) -> Vec<(usize, SimError)> {
        let _ = first;
        let (d, width) = (self.dimension(), self.kept());
        in_parallel(ln_l, kept, width, |at, kept| {
            self.ln_likelihood(&z[at * d..(at + 1) * d], kept)
        })
    }
}

/// Whether the log likelihood follows from the kept numbers.
pub(crate) fn follows_from_kept(target: &dyn Target) -> bool {
    target.ln_likelihood_of(&vec![0.0; target.kept()]).is_some()
}

/// Computes `ln_l` row by row from rows of `width` kept numbers; failures in order.
fn in_parallel(
    ln_l: &mut [f64],
    kept: &mut [f64],
    width: usize,
    value: impl Fn(usize, &mut [f64]) -> Result<f64, SimError> + Sync,
) -> Vec<(usize, SimError)> {
    let one = |at: usize, ln_l: &mut f64, kept: &mut [f64]| {
        let error = match value(at, kept) {
            Ok(v) if v.is_nan() || v == f64::INFINITY => {
                SimError::recoverable("the log likelihood is not a number")
            }
            Ok(v) => {
                *ln_l = v;
                return None;
            }
            Err(error) => error,
        };
        *ln_l = f64::NEG_INFINITY;
        Some((at, error))
    };
    let block = parallel_block(ln_l.len());
    if width == 0 {
        let blocks = ln_l.par_chunks_mut(block).enumerate();
        return blocks
            .flat_map_iter(|(b, ln_l)| {
                let one = &one;
                ln_l.iter_mut().enumerate().filter_map(move |(i, l)| one(b * block + i, l, &mut []))
            })
            .collect();
    }
    ln_l.par_chunks_mut(block)
        .zip(kept.par_chunks_mut(block * width))
        .enumerate()
        .flat_map_iter(|(b, (ln_l, kept))| {
            let one = &one;
            ln_l.iter_mut()
                .zip(kept.chunks_exact_mut(width))
                .enumerate()
                .filter_map(move |(i, (l, kept))| one(b * block + i, l, kept))
        })
        .collect()
}

/// Most numbers kept of all curves together (480 MB).
const MAX_KEPT: usize = 60_000_000;
/// Most points of a thinned path.
const MAX_PATH: usize = 256;
/// Most numbers of one batch of whole curves that are not kept (64 MB).
const MAX_BATCH: usize = 8_000_000;

/// The sample of highest density so far, where its curve is not kept.
#[derive(Clone, Debug)]
pub(crate) struct Best {
    /// Likelihood times prior in the priors' coordinates, logarithm.
    density: f64,
    /// The whole curve.
    outputs: Vec<f64>,
}

/// A problem as a target. Whole curves are kept where there is room; else the outputs at some observations
/// and the log likelihood up to each of them.
pub(crate) struct CurveTarget<'a> {
    pub problem: &'a JointProblem<'a>,
    pub likelihood: &'a JointLikelihood,
    /// Number of observations.
    observations: usize,
    /// Observations of which something is kept.
    pub indices: Vec<usize>,
    pub thinned: bool,
    /// Kept up to date by batches where curves are thinned.
    best: Mutex<Option<Best>>,
}

impl<'a> CurveTarget<'a> {
    pub(crate) fn new(
        problem: &'a JointProblem<'a>,
        likelihood: &'a JointLikelihood,
        samples: usize,
    ) -> Self {
        let m = problem.observations();
        // Noise with a shape is drawn from whole curves.
        let few = m <= 2 * MAX_PATH || likelihood.has_shape();
        if few && Self::has_room(m, samples) {
            let (indices, best) = ((0..m).collect(), Mutex::new(None));
            return Self { problem, likelihood, observations: m, indices, thinned: false, best };
        }
        let kept = m.min(MAX_PATH).min(MAX_KEPT / 2 / samples.max(1)).max(2);
        // Evenly spaced, the last one included, and the last one of every group.
        let mut indices: Vec<usize> = (1..=kept).map(|k| k * m / kept - 1).collect();
        indices.extend(problem.ranges().iter().map(|range| range.end - 1));
        indices.sort_unstable();
        indices.dedup();
        let best = Mutex::new(None);
        Self { problem, likelihood, observations: m, indices, thinned: true, best }
    }

    /// Whether there is room for so many whole curves.
    pub(crate) fn has_room(observations: usize, samples: usize) -> bool {
        observations.saturating_mul(samples) <= MAX_KEPT
    }

    /// Parameters in SI.
    pub(crate) fn theta(&self, z: &[f64]) -> Vec<f64> {
        self.problem.parameters.iter().zip(z).map(|(p, z)| p.prior.from_z(*z)).collect()
    }

    /// Parameters in SI of many points, row by row.
    fn thetas(&self, z: &[f64]) -> Vec<f64> {
        let d = self.problem.parameters.len();
        let mut thetas = vec![0.0; z.len()];
        thetas.par_chunks_mut(256 * d).zip(z.par_chunks(256 * d)).for_each(|(thetas, z)| {
            for (thetas, z) in thetas.chunks_exact_mut(d).zip(z.chunks_exact(d)) {
                for ((t, p), z) in thetas.iter_mut().zip(&self.problem.parameters).zip(z) {
                    *t = p.prior.from_z(*z);
                }
            }
        });
        thetas
    }

    /// Runs the simulator at normal scores; refuses outputs that are not finite.
    pub(crate) fn simulate(&self, z: &[f64], outputs: &mut [f64]) -> Result<(), SimError> {
        let mut small = [0.0; 16];
        let large;
        let theta: &[f64] = if z.len() <= small.len() {
            for ((t, p), z) in small.iter_mut().zip(&self.problem.parameters).zip(z) {
                *t = p.prior.from_z(*z);
            }
            &small[..z.len()]
        } else {
            large = self.theta(z);
            &large
        };
        self.problem.simulator.simulate(theta, outputs)?;
        finite(outputs)
    }

    /// Log likelihood of group `g` from what was kept of a sample and its joint log likelihood.
    pub(crate) fn ln_of_group(&self, g: usize, kept: &[f64], ln_joint: f64) -> f64 {
        if self.likelihood.single().is_some() {
            return ln_joint;
        }
        let Some((part, range)) = self.likelihood.groups().nth(g) else { return f64::NAN };
        if !self.thinned {
            return part.ln_joint(&kept[range]);
        }
        // Every group's last observation is kept.
        let cumulative = &kept[self.indices.len()..];
        let up_to = |end: usize| match self.indices.binary_search(&(end.wrapping_sub(1))) {
            Ok(k) => cumulative[k],
            Err(_) => 0.0,
        };
        up_to(range.end) - up_to(range.start)
    }

    /// Log density of the prior in its coordinates, at normal scores.
    pub(crate) fn ln_prior(&self, z: &[f64]) -> f64 {
        self.problem
            .parameters
            .iter()
            .zip(z)
            .map(|(p, z)| p.prior.ln_density_in_coordinate(p.prior.from_z(*z)))
            .sum()
    }

    /// Whole curve of the sample of highest density in the batches so far, where curves are thinned.
    pub(crate) fn best_outputs(&self) -> Option<Vec<f64>> {
        let best = self.best.lock().unwrap_or_else(PoisonError::into_inner);
        best.as_ref().map(|b| b.outputs.clone())
    }

    /// Runs the simulator at the rows of `z`; refuses outputs that are not finite.
    fn simulate_batch(
        &self,
        first: usize,
        z: &[f64],
        outputs: &mut [f64],
    ) -> Result<Vec<Result<(), SimError>>, SimError> {
        let thetas = self.thetas(z);
        let rows = z.len() / self.dimension();
        let results = self.problem.simulator.simulate_batch(first, &thetas, outputs);
        if results.len() == rows {
            return Ok(results);
        }
        Err(SimError::fatal(format!(
            "the simulator answered {} of the {rows} runs of a batch; it must give one result per run",
            results.len()
        )))
    }

    /// One batch of whole curves and their log likelihoods; failures and their places in the batch, in order.
    fn batch(
        &self,
        first: usize,
        z: &[f64],
        ln_l: &mut [f64],
        outputs: &mut [f64],
    ) -> Vec<(usize, SimError)> {
        let results = match self.simulate_batch(first, z, outputs) {
            Ok(results) => results,
            Err(error) => return vec![(0, error)],
        };
        in_parallel(ln_l, outputs, self.observations, |at, outputs| {
            match results[at].clone().and_then(|()| finite(outputs)) {
                Ok(()) => Ok(self.likelihood.ln_joint(outputs)),
                Err(error) => {
                    // Nothing depends on what a failed simulation left behind.
                    outputs.fill(0.0);
                    Err(error)
                }
            }
        })
    }

    /// Remembers the curve of the highest density.
    fn remember_best(&self, z: &[f64], ln_l: &[f64], outputs: &[f64]) {
        let mut best = self.best.lock().unwrap_or_else(PoisonError::into_inner);
        let rows = z.chunks_exact(self.dimension()).zip(ln_l);
        for ((z, l), outputs) in rows.zip(outputs.chunks_exact(self.observations)) {
            if !l.is_finite() {
                continue;
            }
            let density = l + self.ln_prior(z);
            if best.as_ref().is_none_or(|b| density > b.density) {
                *best = Some(Best { density, outputs: outputs.to_vec() });
            }
        }
    }

    /// Reduces a whole curve to the outputs and log likelihoods at the kept observations.
    fn thin(&self, outputs: &[f64], path: &mut [f64], kept: &mut [f64]) {
        self.likelihood.ln_cumulative(outputs, path);
        let (values, ln) = kept.split_at_mut(self.indices.len());
        for ((v, l), i) in values.iter_mut().zip(ln).zip(&self.indices) {
            *v = outputs[*i];
            *l = path[*i];
        }
    }
}

/// Refuses outputs that are not finite.
fn finite(outputs: &[f64]) -> Result<(), SimError> {
    if outputs.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(SimError::recoverable("an output is not a finite number"))
    }
}

impl Target for CurveTarget<'_> {
    fn dimension(&self) -> usize {
        self.problem.parameters.len()
    }

    fn kept(&self) -> usize {
        self.indices.len() * if self.thinned { 2 } else { 1 }
    }

    fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
        if !self.thinned {
            self.simulate(z, kept)?;
            return Ok(self.likelihood.ln_joint(kept));
        }
        let m = self.observations;
        let mut outputs = vec![0.0; m];
        self.simulate(z, &mut outputs)?;
        self.thin(&outputs, &mut vec![0.0; m], kept);
        Ok(self.likelihood.ln_joint(&outputs))
    }

    fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
        (!self.thinned).then(|| self.likelihood.ln_joint(kept))
    }

    fn measured(&self) -> Option<Vec<f64>> {
        let values = self.problem.groups.iter().flat_map(|group| group.observations.values());
        (!self.thinned).then(|| values.copied().collect())
    }

    fn revised(&self, samples: usize) -> Vec<usize> {
        self.problem.simulator.revised(samples)
    }

    fn will_revise(&self) -> bool {
        self.problem.simulator.will_revise()
    }

    fn announce(&self, first: usize, z: &[f64]) {
        self.problem.simulator.announce(first, &self.thetas(z));
    }

    fn ln_likelihood_batch(
        &self,
        first: usize,
        z: &[f64],
        ln_l: &mut [f64],
        kept: &mut [f64],
    ) -> Vec<(usize, SimError)> {
        if !self.thinned {
            return self.batch(first, z, ln_l, kept);
        }
        // Whole curves for as many samples at a time as there is room for.
        let (d, m, width) = (self.dimension(), self.observations, self.kept());
        let rows = (MAX_BATCH / m).clamp(1, ln_l.len().max(1));
        let mut outputs = vec![0.0; rows * m];
        let mut errors = Vec::new();
        let blocks = z.chunks(rows * d).zip(ln_l.chunks_mut(rows));
        for (b, ((z, ln_l), kept)) in blocks.zip(kept.chunks_mut(rows * width)).enumerate() {
            let outputs = &mut outputs[..ln_l.len() * m];
            let failed = self.batch(first + b * rows, z, ln_l, outputs);
            let fatal = failed.iter().any(|(_, error)| !error.is_recoverable());
            errors.extend(failed.into_iter().map(|(at, error)| (b * rows + at, error)));
            if fatal {
                break;
            }
            self.remember_best(z, ln_l, outputs);
            kept.par_chunks_mut(width).zip(outputs.par_chunks(m)).for_each_init(
                || vec![0.0; m],
                |path, (kept, outputs)| self.thin(outputs, path, kept),
            );
        }
        errors
    }
}
