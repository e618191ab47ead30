//! The parts of a run: each ends at a budget, and is placed as it was when that budget was the last.
//!
//! A run that was extended has a part for each budget that it had. Before them comes one that a Gaussian process places,
//! where it begins a run that goes on without it.

use crate::Settings;
use crate::mixture::Proposal;
use crate::sampler::{NextStage, Sampler};
use crate::settings::{ALIKE, FEW_RUNS};

/// Samples that a Gaussian process places first where the rest is placed without it. The errors after 2048 are those that a
/// start of 1000 leaves.
const START: usize = 400;

/// Share of the budget that the first stage draws from the prior: enough for the stand-in to tell where the likelihood
/// is negligible.
const FIRST: f64 = 0.24;
/// Fewest samples of that stage, at most half of all and in whole batches, where the process is of log likelihoods alone: through fewer
/// it misses parts of the posterior. Of 50 runs of 32 simulations of two modes three lost one with 7, none with 10; with 12 errors are no
/// smaller. Curves say more: of 150 such runs of PA12 means are .39 posterior sds off with 7, .49 with 10.
const FIRST_AT_LEAST: usize = 10;

impl Settings {
    /// Budget of the first part: of the run that was extended, or of the whole run.
    pub(crate) fn first_budget(&self) -> usize {
        self.earlier.first().copied().unwrap_or(self.samples)
    }

    /// Samples that a Gaussian process places before the rest is placed without it: [`START`], or three batches, or four times
    /// what a stage does not wait for, as only the stages before that tell where to place it. None where this is more than half
    /// of the budget, or as much as is placed without a process.
    fn start(&self) -> Option<usize> {
        if !self.surrogate || self.first_budget() < Self::PLAIN {
            return None;
        }
        let least = START.max(self.batch.saturating_mul(3)).max(self.overlap.saturating_mul(4));
        let start = least.checked_next_multiple_of(self.batch.max(1))?;
        (start < Self::PLAIN && start <= self.first_budget() / 2).then_some(start)
    }

    /// Budgets of the parts, in rising order.
    pub(crate) fn parts(&self) -> Vec<usize> {
        let budgets = self.earlier.iter().copied().chain([self.samples]);
        self.start().into_iter().chain(budgets).collect()
    }

    /// Number of samples that a Gaussian process places: all, the first ones, or none.
    pub fn placed_by_process(&self) -> usize {
        let parts = self.parts().into_iter();
        parts.rev().find(|part| self.of_part(*part).surrogate).unwrap_or(0)
    }

    /// Most samples that a Gaussian process places at a time: no more simulations can go on at once before the last stage, unless
    /// stages [`overlap`](Self::overlap). None where no process places, or batches are not set.
    pub fn placed_at_a_time(&self) -> Option<usize> {
        let placed = self.placed_by_process();
        let own = self.of_part(placed);
        if placed == 0 || own.batch == 0 {
            return None;
        }
        own.batches(placed, own.adaptive(placed), true).get(1).copied()
    }

    /// Sizes of the stages where they are to be multiples of the batch. The first is larger where the process is not of `curves` but of log
    /// likelihoods alone. Up to [`FEW_RUNS`], and where a process places fewer than [`ALIKE`], the others are as equal as they can be, so that
    /// no further sample makes any of them much larger; elsewhere a last stage has what the adaptive ones leave.
    pub(crate) fn batches(&self, n: usize, adaptive: usize, curves: bool) -> Vec<usize> {
        let batch = self.batch;
        let stages = self.iterations.max(1);
        let least = if curves { 0 } else { FIRST_AT_LEAST.min(n / 2) };
        let explore = ((n as f64 * FIRST) as usize).max(least) / batch * batch;
        if n <= FEW_RUNS || self.surrogate && n < ALIKE {
            let first = explore.max(batch).min(n);
            let batches = (n - first).div_ceil(batch);
            let stages = stages.min(batches);
            let size = |k: usize| batch * (batches / stages + usize::from(k < batches % stages));
            let mut sizes: Vec<usize> = [first].into_iter().chain((0..stages).map(size)).collect();
            let excess = sizes.iter().sum::<usize>() - n;
            sizes.last_mut().into_iter().for_each(|last| *last -= excess);
            return sizes;
        }
        let each = (adaptive / stages).max(1).next_multiple_of(batch);
        let first = each.max(explore).min(n);
        let mut sizes = vec![first];
        let mut left = n - first;
        if left == 0 {
            return sizes;
        }
        while sizes.len() < stages && left > each {
            sizes.push(each);
            left -= each;
        }
        sizes.push(left);
        sizes
    }

    /// Number of a run's samples that are placed anew at every stage.
    pub(crate) fn adaptive(&self, n: usize) -> usize {
        ((n as f64 * (1.0 - self.final_share)) as usize).min(n)
    }

    /// Whether a Gaussian process has placed the last of `simulations` samples.
    pub(crate) fn process_placed(&self, simulations: usize) -> bool {
        let part = self.parts().into_iter().find(|part| *part >= simulations);
        self.of_part(part.unwrap_or(self.samples)).surrogate
    }

    /// Settings that place the part up to a budget: those of the run. A part that is placed otherwise than the run was meant to
    /// be, by a Gaussian process or without it, has the defaults of such runs; settings that were chosen stay.
    pub(crate) fn of_part(&self, budget: usize) -> Self {
        let mut own = self.clone();
        if !self.surrogate {
            return own;
        }
        let (first, process) = (self.first_budget(), budget < Self::PLAIN);
        if process && first >= Self::PLAIN {
            own.replace_defaults(Self::WHOLLY_PLAIN, START);
        } else if !process && first < Self::PLAIN {
            own.replace_defaults(first, Self::WHOLLY_PLAIN);
        }
        own.surrogate = process;
        own
    }

    /// Settings of a run of `samples` from the start that chooses what this one chose: defaults of its first budget are those of `samples`.
    pub fn begun_with(&self, samples: usize) -> Self {
        let mut own = self.as_begun();
        own.replace_defaults(own.samples, samples);
        own.samples = samples;
        own
    }

    /// Replaces what is still the default of one budget by that of another.
    fn replace_defaults(&mut self, one: usize, another: usize) {
        let (old, new) = (Self::for_budget(one), Self::for_budget(another));
        unless_chosen(&mut self.surrogate, old.surrogate, new.surrogate);
        unless_chosen(&mut self.iterations, old.iterations, new.iterations);
        unless_chosen(&mut self.max_components, old.max_components, new.max_components);
        unless_chosen(&mut self.patches, old.patches, new.patches);
        unless_chosen(&mut self.batch, old.batch, new.batch);
        unless_chosen(&mut self.final_share, old.final_share, new.final_share);
        unless_chosen(&mut self.defensive_share, old.defensive_share, new.defensive_share);
        unless_chosen(&mut self.tempering_share, old.tempering_share, new.tempering_share);
    }
}

/// Replaces a setting that is still the default.
fn unless_chosen<T: PartialEq>(own: &mut T, old: T, new: T) {
    if *own == old {
        *own = new;
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

    /// Size of a first stage of a later part, drawn from the prior: as much of the prior is explored as by a run of its
    /// budget, whose first stage has `wished` samples, or a share of it where that begins elsewhere.
    fn explored(&self, budget: usize, wished: usize) -> Option<usize> {
        let placed = self.samples();
        let goes_on = self.placing.surrogate && self.settings.earlier.contains(&placed);
        if !goes_on && self.settings.start() != Some(placed) {
            return None;
        }
        let explored = self.schedule_by(&self.settings.of_part(placed), placed)[0];
        let further = wished.saturating_sub(explored);
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
    use crate::SimError;
    use crate::target::Target;

    /// A log likelihood that follows from an output, or is all that is known.
    struct Line {
        curves: bool,
    }

    impl Target for Line {
        fn dimension(&self) -> usize {
            1
        }

        fn kept(&self) -> usize {
            1
        }

        fn ln_likelihood(&self, z: &[f64], kept: &mut [f64]) -> Result<f64, SimError> {
            kept[0] = z[0];
            Ok(z[0])
        }

        fn ln_likelihood_of(&self, kept: &[f64]) -> Option<f64> {
            self.curves.then(|| kept[0])
        }
    }

    #[test]
    fn a_process_begins_by_whole_batches_and_leaves_half_of_the_budget() {
        for samples in [1, 30, 2047, 2048, 2049, 3001, 8191, 8192, 65_537] {
            for batch in [0, 1, 4, 7, 133, 134, 340, 341, 400, 2047, 2048, 1 << 27] {
                for overlap in [0, 1, 100, 101, 256, 257, 511].map(|most| most.min(samples / 4)) {
                    let run = Settings { batch, overlap, ..Settings::for_budget(samples) };
                    let (parts, first) = (run.parts(), run.placed_by_process());
                    let what = format!("{samples} {batch} {overlap}: {parts:?} {first}");
                    assert!(parts.windows(2).all(|pair| pair[0] < pair[1]), "{what}");
                    assert_eq!(parts.last(), Some(&samples), "{what}");
                    let expected = match samples {
                        ..2048 => samples,
                        8192.. => 0,
                        _ => {
                            let least = 400.max(3 * batch).max(4 * overlap);
                            let whole = least.next_multiple_of(batch.max(1));
                            if whole < 2048 && 2 * whole <= samples { whole } else { 0 }
                        }
                    };
                    assert_eq!(first, expected, "{what}");
                }
            }
        }
    }

    #[test]
    fn parts_have_the_defaults_of_their_kind_and_what_was_chosen() {
        let of = |settings: &Settings| {
            let Settings { surrogate, iterations, max_components, batch, .. } = *settings;
            (surrogate, iterations, max_components, batch, settings.final_share.to_bits())
        };
        let small = of(&Settings::for_budget(400));
        let plain = of(&Settings::for_budget(10_000));
        assert!(small.0 && !plain.0);
        for run in [Settings::for_budget(3000), Settings { surrogate: true, ..Settings::default() }]
        {
            // However many samples it begins with.
            for start in [400, 406, 800] {
                assert_eq!(of(&run.of_part(start)), small);
            }
            assert_eq!(of(&run.of_part(run.samples)), plain);
            let chosen = Settings { iterations: 5, batch: 7, ..run };
            for part in [406, chosen.samples] {
                assert_eq!((chosen.of_part(part).iterations, chosen.of_part(part).batch), (5, 7));
            }
        }
        let off = Settings { surrogate: false, ..Settings::for_budget(3000) };
        assert_eq!(off.parts(), [3000]);
        assert_eq!(of(&off.of_part(3000)), plain);
        for first in [30, 100, 201, 300, 399, 400, 500, 1000, 2047] {
            let begun = Settings::for_budget(first);
            let extended = begun.extended(3000).unwrap_or_default();
            assert_eq!(extended.parts(), [first, 3000]);
            assert_eq!(of(&extended.of_part(first)), of(&begun));
            assert_eq!(of(&extended.of_part(3000)), plain);
        }
        for [first, samples] in
            [[30, 300], [100, 100], [300, 3000], [500, 1500], [2047, 8192], [9000, 100]]
        {
            let begun = Settings { seed: 7, ..Settings::for_budget(first) };
            let extended = begun.extended(10_000).unwrap_or_default();
            let expected = Settings { seed: 7, ..Settings::for_budget(samples) };
            assert_eq!(extended.begun_with(samples), expected);
            let chosen = Settings { batch: 7, ..begun };
            assert_eq!(chosen.begun_with(samples), Settings { batch: 7, ..expected });
        }
        // What was chosen for a small run is no default of it, also where it is that of larger ones.
        let eight = Settings { iterations: plain.1, ..Settings::for_budget(300) };
        assert_eq!(eight.of_part(300).iterations, plain.1);
    }

    #[test]
    fn few_runs_begin_by_a_share_of_all_and_those_of_log_likelihoods_by_ten_or_half_of_all() {
        for batch in [1, 3, 4] {
            let of = |n: usize, curves: bool| {
                let run = Settings { batch, ..Settings::for_budget(n) };
                run.batches(n, run.adaptive(n), curves)
            };
            for n in 1..=200 {
                for curves in [true, false] {
                    let sizes = of(n, curves);
                    assert_eq!(sizes.iter().sum::<usize>(), n, "{n} {batch} {sizes:?}");
                    let least = if curves { 0 } else { 10.min(n / 2) };
                    let first = (n * 24 / 100).max(least) / batch * batch;
                    assert_eq!(sizes[0], first.max(batch).min(n), "{n} {batch} {sizes:?}");
                    assert!(of(n + 1, curves)[0] >= sizes[0], "{n} {batch} {sizes:?}");
                }
            }
            for n in 42..=300 {
                assert_eq!(of(n, true), of(n, false));
            }
        }
        let first = |n: usize, batch: usize, curves: bool| {
            let settings = Settings { batch, ..Settings::for_budget(n) };
            Sampler::new(&Line { curves }, &settings).schedule(n)[0]
        };
        for (n, batch, of_curves, of_likelihoods) in
            [(16, 1, 3, 8), (20, 1, 4, 10), (32, 1, 7, 10), (32, 4, 4, 8), (41, 1, 9, 10)]
        {
            assert_eq!(
                [first(n, batch, true), first(n, batch, false)],
                [of_curves, of_likelihoods]
            );
        }
    }

    /// Sizes of the stages of a run of so many simulations with outputs.
    fn sizes_by_default(n: usize) -> Vec<usize> {
        let run = Settings::for_budget(n);
        run.batches(n, run.adaptive(n), true)
    }

    #[test]
    fn one_simulation_more_adds_or_takes_one_stage_at_most_and_makes_none_larger_by_more_than_a_batch()
     {
        let of = sizes_by_default;
        for n in 2..400 {
            let (sizes, next) = (of(n), of(n + 1));
            let without = Settings { surrogate: false, ..Settings::for_budget(n) };
            let without = without.batches(n, without.adaptive(n), true);
            assert_eq!(without.iter().sum::<usize>(), n);
            assert!(n > 200 || without == sizes, "{n}: {without:?} {sizes:?}");
            assert_eq!(sizes.iter().sum::<usize>(), n);
            assert!(sizes.len().abs_diff(next.len()) <= 1, "{n}: {sizes:?} {next:?}");
            let batch = if n < 200 { 1 } else { 4 };
            let mut pairs = sizes.iter().zip(&next);
            assert!(pairs.all(|(a, b)| *b <= a + batch), "{n}: {sizes:?} {next:?}");
            assert!(sizes[1..].is_sorted_by(|a, b| a >= b), "{n}: {sizes:?}");
        }
        let stages = [50, 100, 200, 201, 256, 300, 399].map(|n| of(n).len() - 1);
        assert_eq!(stages, [38, 38, 38, 37, 29, 25, 19]);
        // As many as are chosen.
        let chosen = Settings { iterations: 60, ..Settings::for_budget(300) };
        assert_eq!(chosen.batches(300, chosen.adaptive(300), true).len(), 58);
    }

    #[test]
    fn from_four_hundred_samples_on_stages_become_fewer_one_by_one_and_larger() {
        let of = sizes_by_default;
        for n in 400..2047 {
            let (sizes, next) = (of(n), of(n + 1));
            assert_eq!(sizes.iter().sum::<usize>(), n);
            assert!(next.len() <= sizes.len() && sizes.len() <= next.len() + 1, "{n}: {sizes:?}");
            let (each, of_next) = (sizes[1], next[1]);
            assert!(each <= of_next && of_next <= each + each / 4 + 4, "{n}: {sizes:?} {next:?}");
        }
        let shares = [400, 512, 768, 1024, 2047].map(|n| {
            let sizes = of(n);
            let last = sizes[sizes.len() - 1] as f64 / n as f64;
            (sizes.len() - 1, (100.0 * last).round())
        });
        assert_eq!(shares, [(19, 4.0), (15, 11.0), (12, 19.0), (12, 20.0), (12, 20.0)]);
    }

    #[test]
    fn no_more_samples_are_placed_at_a_time_than_is_told() {
        for n in 5..=41 {
            for iterations in [2, 5, 40] {
                let run = Settings { iterations, ..Settings::for_budget(n) };
                let told = run.placed_at_a_time();
                let of = |curves| Sampler::new(&Line { curves }, &run).schedule(n).get(1).copied();
                assert_eq!(of(true), told, "{n} {iterations}");
                assert!(of(false) <= told, "{n} {iterations}");
            }
        }
        let run = Settings { iterations: 5, ..Settings::for_budget(40) };
        assert_eq!(run.placed_at_a_time(), Some(7));
        assert_eq!(Sampler::new(&Line { curves: false }, &run).schedule(40)[1], 6);
    }

    #[test]
    fn an_end_among_the_first_samples_is_one_of_a_process() {
        let run = Settings::for_budget(4096);
        for (simulations, process) in [(1, true), (400, true), (401, false), (4096, false)] {
            assert_eq!(run.process_placed(simulations), process, "{simulations}");
        }
        assert!(Settings::for_budget(300).process_placed(120));
        assert!(!Settings::for_budget(8192).process_placed(120));
    }
}
