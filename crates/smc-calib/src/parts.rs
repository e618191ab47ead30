//! The parts of a run that was extended: each ends at a budget, and is placed as it was when that budget was the last.

use crate::Settings;
use crate::mixture::Proposal;
use crate::sampler::{NextStage, Sampler};

impl Settings {
    /// Budget of the first part: of the run that was extended, or of the whole run.
    pub(crate) fn first_budget(&self) -> usize {
        self.earlier.first().copied().unwrap_or(self.samples)
    }

    /// Budget of the part that places the next sample after `samples`; none once all are placed.
    fn budget_after(&self, samples: usize) -> Option<usize> {
        self.earlier.iter().chain([&self.samples]).copied().find(|budget| *budget > samples)
    }

    /// Whether a Gaussian process has placed the last samples.
    pub(crate) fn ends_with_process(&self) -> bool {
        self.of_part(self.samples).surrogate
    }

    /// Settings that place the part up to a budget: those of the run. A later part that ends beyond what a Gaussian process
    /// is for is placed without it, as a run of so many samples is; settings that were chosen stay.
    fn of_part(&self, budget: usize) -> Self {
        let mut own = self.clone();
        if !self.surrogate || self.first_budget() >= Self::PLAIN || budget < Self::PLAIN {
            return own;
        }
        let (small, plain) = (Self::for_budget(Self::PLAIN - 1), Self::for_budget(Self::PLAIN));
        own.surrogate = false;
        unless_chosen(&mut own.iterations, small.iterations, plain.iterations);
        unless_chosen(&mut own.max_components, small.max_components, plain.max_components);
        unless_chosen(&mut own.patches, small.patches, plain.patches);
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
        let budget = self.settings.budget_after(placed)?;
        let (first, last) =
            (budget == self.settings.first_budget(), budget == self.settings.samples);
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
