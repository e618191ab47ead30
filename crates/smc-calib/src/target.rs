//! What the sampler sees: a log likelihood over normal scores.

use crate::noise::Likelihood;
use crate::{Problem, SimError};

/// A log likelihood over normal scores; the prior is the standard normal in every coordinate.
///
/// Curves ([`Problem`]) and plain densities ([`crate::reference`]) run through the same sampler.
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
}

/// Most numbers kept of all curves together (480 MB).
const MAX_KEPT: usize = 60_000_000;
/// Most points of a thinned path.
const MAX_PATH: usize = 256;

/// A problem as a target. Whole curves are kept where there is room; else the outputs at some observations
/// and the log likelihood up to each of them.
pub(crate) struct CurveTarget<'a> {
    pub problem: &'a Problem<'a>,
    pub likelihood: &'a Likelihood,
    /// Observations of which something is kept.
    pub indices: Vec<usize>,
    pub thinned: bool,
}

impl<'a> CurveTarget<'a> {
    pub(crate) fn new(
        problem: &'a Problem<'a>,
        likelihood: &'a Likelihood,
        samples: usize,
    ) -> Self {
        let m = problem.observations.len();
        if m <= 2 * MAX_PATH && m.saturating_mul(samples) <= MAX_KEPT {
            return Self { problem, likelihood, indices: (0..m).collect(), thinned: false };
        }
        let kept = m.min(MAX_PATH).min(MAX_KEPT / 2 / samples.max(1)).max(2);
        // Evenly spaced, the last one included.
        let indices = (1..=kept).map(|k| k * m / kept - 1).collect();
        Self { problem, likelihood, indices, thinned: true }
    }

    /// Parameters in SI.
    pub(crate) fn theta(&self, z: &[f64]) -> Vec<f64> {
        self.problem.parameters.iter().zip(z).map(|(p, z)| p.prior.from_z(*z)).collect()
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
        if outputs.iter().all(|v| v.is_finite()) {
            Ok(())
        } else {
            Err(SimError::recoverable("an output is not a finite number"))
        }
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
        let m = self.problem.observations.len();
        let mut outputs = vec![0.0; m];
        let mut path = vec![0.0; m];
        self.simulate(z, &mut outputs)?;
        self.likelihood.ln_cumulative(&outputs, &mut path);
        let (values, ln) = kept.split_at_mut(self.indices.len());
        for ((v, l), i) in values.iter_mut().zip(ln).zip(&self.indices) {
            *v = outputs[*i];
            *l = path[*i];
        }
        Ok(self.likelihood.ln_joint(&outputs))
    }
}
