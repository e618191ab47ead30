//! The stages whose proposals were fixed before they were drawn, and the evidence by them alone.

use crate::estimate::Estimator;
use crate::mixture::Proposal;
use crate::pool::exponentiate;
use crate::sampler::Sampler;
use std::ops::Range;

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

impl Sampler<'_> {
    /// The samples of the last stage, or the last that is large enough, weighted by the one density that they were drawn from;
    /// of small stages that a process places, the last ones that together have [`TOGETHER_FROZEN`] of the samples, each by its own.
    pub(crate) fn frozen(&self) -> Frozen {
        let (len, parts) = (self.pool.len(), self.settings.parts());
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
            let enough = self.schedule(parts[0]).last().copied().unwrap_or(len);
            let enough = enough.min(len / OWN_EVIDENCE);
            let large = |range: &Range<usize>| parts.len() == 1 || range.len() >= enough;
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
