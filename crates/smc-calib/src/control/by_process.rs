//! The posterior that a process through all samples predicts: weighted points of it.

use super::errors::{Over, weighed};
use crate::mixture::Proposal;
use crate::sampler::Sampler;
use crate::small_budget::StandIn;
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};

/// Points of the proposal for each draw, and the least and the most.
const EACH: usize = 4;
const POINTS: [usize; 2] = [4096, 65_536];

/// A process that estimates are taken with, and the mixture that points are drawn from.
pub(crate) struct ByProcess<'a> {
    process: StandIn<'a>,
    proposal: Proposal,
    ln_scale: f64,
    cap: f64,
}

impl<'a> ByProcess<'a> {
    /// With the covariance of a process through some of the samples. None where no draws are wanted, or it does not predict outputs: what
    /// belongs to a draw could not be told.
    pub(super) fn new(
        of: &StandIn<'a>,
        sampler: &'a Sampler<'_>,
        weights: &[f64],
        over: Over<'_>,
    ) -> Option<Self> {
        if !of.predicts_outputs() || sampler.settings.draws == 0 {
            return None;
        }
        let process = of.through_many(&sampler.pool, weights)?;
        let Over { proposal, ln_scale, cap } = over;
        Some(Self { process, proposal: proposal.clone(), ln_scale, cap })
    }

    /// Points for so many draws, row by row, and the weight of each.
    pub(crate) fn weighed(&self, draws: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let Self { process, proposal, ln_scale, cap } = self;
        let over = Over { proposal, ln_scale: *ln_scale, cap: *cap };
        let points = (EACH * draws).clamp(POINTS[0], POINTS[1]);
        let mut rng = stream(seed, Purpose::Draws, 1, 0);
        weighed(process, over, &scrambled_net(proposal.uniforms(), points, &mut rng))
    }

    /// Predicted outputs at points, row by row.
    pub(crate) fn outputs(&self, z: &[f64]) -> Vec<f64> {
        self.process.predicted_rows(z)
    }
}
