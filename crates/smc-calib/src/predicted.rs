//! Outputs at parameters that were not simulated.

use crate::SimError;
use crate::pool::Pool;
use crate::small_budget::StandIn;
use crate::target::Target;

/// What the simulations of a run gave, a row of each for every simulation.
#[derive(Clone, Copy)]
pub struct Simulations<'a> {
    /// Number of parameters.
    pub parameters: usize,
    /// Normal scores of the parameters ([`Prior::to_z`](crate::Prior::to_z)), row by row.
    pub z: &'a [f64],
    /// Outputs, row by row; anything where a simulation failed.
    pub outputs: &'a [f64],
    /// Log likelihoods; minus infinity where a simulation failed.
    pub ln_likelihood: &'a [f64],
    /// Weights.
    pub weights: &'a [f64],
    /// Log likelihood of outputs.
    pub ln_joint: &'a (dyn Fn(&[f64]) -> f64 + Sync),
}

/// Outputs that the Gaussian process through simulations predicts, row by row, at normal scores `at`, row by row: what belongs to the draws
/// of a small budget, none of which was simulated ([`Posterior::is_drawn`](crate::Posterior::is_drawn)). Up to 400 simulations have a part.
///
/// None where rows are not complete, fewer simulations than two more than there are parameters have a likelihood, or their outputs do not
/// tell it.
pub fn predicted_outputs(of: &Simulations<'_>, at: &[f64]) -> Option<Vec<f64>> {
    let (n, d) = (of.weights.len(), of.parameters);
    let width = of.outputs.len().checked_div(n)?;
    let complete = of.z.len() == n * d && of.outputs.len() == n * width;
    if d == 0 || !complete || of.ln_likelihood.len() != n || !at.len().is_multiple_of(d) {
        return None;
    }
    let mut pool = Pool::new(d, width);
    pool.extend(of, of.z, &vec![0; n], 0, &[]).ok()?;
    let process = StandIn::of_all(of, &pool, of.weights)?.through_many(&pool, of.weights)?;
    let outputs = process.predicted_rows(at);
    outputs.iter().all(|value| value.is_finite()).then_some(outputs)
}

impl Target for Simulations<'_> {
    fn dimension(&self) -> usize {
        self.parameters
    }

    fn kept(&self) -> usize {
        self.outputs.len() / self.weights.len()
    }

    fn ln_likelihood(&self, _: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        Err(SimError::fatal("there is no simulation there"))
    }

    fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
        Some((self.ln_joint)(kept))
    }

    fn ln_likelihood_batch(
        &self,
        _: usize,
        _: &[f64],
        ln_l: &mut [f64],
        kept: &mut [f64],
    ) -> Vec<(usize, SimError)> {
        ln_l.copy_from_slice(self.ln_likelihood);
        kept.copy_from_slice(self.outputs);
        Vec::new()
    }
}
