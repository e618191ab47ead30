//! Samples of the pool that an integral is taken over.

use super::errors::Over;
use super::frozen::Frozen;
use super::variate::cap;
use crate::mixture::Proposal;
use crate::sampler::Sampler;
use crate::surrogate::coefficients;

/// Samples that were drawn from one density q.
pub(super) struct Drawn<'a> {
    /// The first of them in the pool; all after it are.
    pub first: usize,
    pub proposal: &'a Proposal,
    /// Log of q over the prior at each.
    pub ln_q: &'a [f64],
    /// Log of likelihood times prior over q at each.
    pub ln_w: &'a [f64],
}

impl<'a> Drawn<'a> {
    /// All, and the mixture that they are drawn from.
    pub(super) fn of_all(
        sampler: &'a Sampler<'_>,
        proposal: &'a Proposal,
        ln_w: &'a [f64],
    ) -> Self {
        Self { first: 0, proposal, ln_q: &sampler.pool.ln_mixture_over_prior, ln_w }
    }

    /// The final stage, where it is large enough for local quadratics.
    pub(super) fn finally(sampler: &'a Sampler<'_>, frozen: &'a Frozen) -> Option<Self> {
        let (n, proposal) = sampler.final_stage()?;
        let few = 8 * coefficients(sampler.pool.d);
        let Frozen { first, ln_q, ln_w } = frozen;
        (n >= few && *first >= few).then_some(Self { first: *first, proposal, ln_q, ln_w })
    }

    /// f/q over this scale at each.
    pub(super) fn over(&self, ln_scale: f64) -> Vec<f64> {
        self.ln_w.iter().map(|l| (l - ln_scale).exp()).collect()
    }

    /// q, and the scale and the largest value of g/q.
    pub(super) fn capped(&self, ln_scale: f64) -> Over<'a> {
        let cap = cap(self.over(ln_scale).into_iter(), self.first == 0);
        Over { proposal: self.proposal, ln_scale, cap }
    }
}
