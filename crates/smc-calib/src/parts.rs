//! The parts of a run: each ends at a budget, and is placed as it was when that budget was the last.
//!
//! A run that was extended has a part for each budget that it had. A run of two thousand simulations or more that a Gaussian
//! process begins has a first part of [`START`].

use crate::Settings;
use crate::mixture::Proposal;
use crate::sampler::{NextStage, Sampler};

/// Samples that a Gaussian process places first where the rest is placed without it: with 1000 errors are the same.
const START: usize = 400;

impl Settings {
    /// Budget of the first part: of the run that was extended, or of the whole run.
    pub(crate) fn first_budget(&self) -> usize {
        self.earlier.first().copied().unwrap_or(self.samples)
    }

    /// Budgets of the parts, in rising order.
    pub(crate) fn parts(&self) -> Vec<usize> {
        // Stages that wait for none of the last samples are placed from others of this part, in whole batches.
        let start = START.max(4 * self.overlap).next_multiple_of(self.batch.max(1));
        let begins = self.surrogate && self.first_budget() >= Self::PLAIN && start < Self::PLAIN;
        let start = begins.then_some(start);
        start.into_iter().chain(self.earlier.iter().copied()).chain([self.samples]).collect()
    }

    /// Number of samples that a Gaussian process places: all, the first ones, or none.
    pub fn placed_by_process(&self) -> usize {
        let by_process = self.parts().into_iter().filter(|part| self.of_part(*part).surrogate);
        by_process.last().unwrap_or(0)
    }

    /// Whether a Gaussian process has placed the last samples.
    pub(crate) fn ends_with_process(&self) -> bool {
        self.of_part(self.samples).surrogate
    }

    /// Settings that place the part up to a budget: those of the run. A part that ends beyond what a Gaussian process
    /// is for is placed without it, as a run of so many samples is; settings that were chosen stay.
    pub(crate) fn of_part(&self, budget: usize) -> Self {
        let mut own = self.clone();
        if !self.surrogate || budget < Self::PLAIN {
            return own;
        }
        let (small, plain) =
            (Self::for_budget(Self::PLAIN - 1), Self::for_budget(Self::WHOLLY_PLAIN));
        own.surrogate = false;
        unless_chosen(&mut own.iterations, small.iterations, plain.iterations);
        unless_chosen(&mut own.max_components, small.max_components, plain.max_components);
        unless_chosen(&mut own.patches, small.patches, plain.patches);
        unless_chosen(&mut own.batch, small.batch, plain.batch);
        unless_chosen(&mut own.final_share, small.final_share, plain.final_share);
        unless_chosen(&mut own.defensive_share, small.defensive_share, plain.defensive_share);
        unless_chosen(&mut own.tempering_share, small.tempering_share, plain.tempering_share);
        own
    }
}

/// Replaces a setting that is still the default of small budgets.
fn unless_chosen<T: PartialEq>(own: &mut T, small: T, plain: T) {
    if *own == small {
        *own = plain;
    }
}

impl Sampler<'_> {
    /// Size and proposal of the next stage, and whether it is the final one; none once the budget is spent.
    ///
    /// A part that extends a run has the stages that a run of its budget would still place. Until tempering has reached the
    /// full likelihood, further adaptive stages come before the last of a part, as long as half of what remains of it is left
    /// for that.
    pub(crate) fn next(&mut self) -> Option<NextStage> {
        let placed = self.samples();
        let parts = self.settings.parts();
        let budget = parts.iter().copied().find(|budget| *budget > placed)?;
        let (first, last) = (budget == parts[0], budget == self.settings.samples);
        if !first {
            self.place_as(budget);
        }
        let (sizes, stage, left) = (self.schedule(budget), self.stages(), budget - placed);
        if stage == 0 {
            return Some((sizes[0], self.opening.clone(), last && sizes.len() == 1));
        }
        if let Some(n) = self.explored(budget, sizes[0]) {
            self.beta = 0.0;
            return Some((n, Proposal::prior(self.pool.d), false));
        }
        let each = sizes[sizes.len().min(2) - 1];
        let n = if first {
            if stage + 1 < sizes.len() { sizes[stage] } else { left }
        } else {
            let finally = sizes[sizes.len() - 1];
            if sizes.len() > 1 && left >= finally + each { each } else { left }
        };
        let proposal = self.refit(n);
        if n < left {
            return Some((n, proposal, false));
        }
        if self.beta < 1.0 && sizes.len() > 2 && left >= 2 * each {
            let beta = self.beta;
            let further = self.refit(each);
            if self.beta < 1.0 {
                return Some((each, further, false));
            }
            self.beta = beta;
        }
        Some((left, proposal, last))
    }

    /// Size of a first stage of a later part that the process places, drawn from the prior: as much of the prior is explored
    /// as by a run of its budget, whose first stage has `wished` samples, or a share of it where that begins elsewhere.
    fn explored(&self, budget: usize, wished: usize) -> Option<usize> {
        let placed = self.samples();
        if !self.placing.surrogate || !self.settings.earlier.contains(&placed) {
            return None;
        }
        let further = wished.saturating_sub(self.schedule(placed)[0]);
        let n = (further as f64 * self.opening.prior_share) as usize;
        (n > 0 && placed + n < budget).then_some(n)
    }

    /// Goes over to the settings of a later part.
    fn place_as(&mut self, budget: usize) {
        let settings = self.settings.of_part(budget);
        if settings.surrogate != self.placing.surrogate {
            self.tails = !settings.surrogate;
        }
        self.placing = settings;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_begins_runs_of_two_to_eight_thousand_by_whole_batches_and_is_done_before() {
        for samples in [1, 30, 2047, 2048, 2049, 3001, 8191, 8192, 65_537] {
            for batch in [0, 1, 4, 7, 399, 401, 2047, 2048, 5000] {
                for overlap in [0, 1, 99, 101, 511].map(|most| most.min(samples / 4)) {
                    let run = Settings { batch, overlap, ..Settings::for_budget(samples) };
                    let (parts, first) = (run.parts(), run.placed_by_process());
                    let what = format!("{samples} {batch} {overlap}: {parts:?}");
                    assert!(parts.windows(2).all(|pair| pair[0] < pair[1]), "{what}");
                    assert_eq!(parts.last(), Some(&samples), "{what}");
                    match samples {
                        ..2048 => assert_eq!(first, samples, "{what}"),
                        8192.. => assert_eq!(first, 0, "{what}"),
                        _ if parts.len() == 1 => {
                            assert!(first == 0 && 4 * overlap + batch >= 2048, "{what}");
                        }
                        _ => {
                            assert_eq!(first, parts[0], "{what}");
                            assert!((START.max(4 * overlap)..2048).contains(&first), "{what}");
                            assert!(batch == 0 || first.is_multiple_of(batch), "{what}");
                        }
                    }
                }
            }
        }
    }
}
