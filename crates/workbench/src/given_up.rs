//! Failures that were given up while the runs that they had helped to place were kept (`--keep-placed`): they count as
//! failures until all that was placed with them is in, and what the runs gave when they were made again counts from then on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};

use crate::plan::{Plan, sample_of};

/// The file with them, beside the runs.
pub(crate) const FILE: &str = "given-up.json";

/// Failures that were given up, in the order in which they were.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(crate) struct GivenUp(Vec<Round>);

/// Failures that were given up together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Round {
    /// Number of samples that had been placed.
    placed: usize,
    /// Causes of failure by run.
    failures: BTreeMap<u64, String>,
}

impl GivenUp {
    /// Adds failures that are given up now.
    pub(crate) fn add(&mut self, placed: usize, failures: BTreeMap<u64, String>) {
        self.0.push(Round { placed, failures });
    }

    /// Whether there are none.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// Reads those of the runs in a folder, without its lock.
pub(crate) fn read(runs: &Path) -> GivenUp {
    let text = std::fs::read(runs.join(FILE)).unwrap_or_default();
    serde_json::from_slice(&text).unwrap_or_default()
}

/// What counts while the sampler goes through its stages.
#[derive(Debug, Default)]
pub(crate) struct Counting {
    given_up: GivenUp,
    /// Number of samples that are in.
    samples: AtomicUsize,
}

impl Counting {
    pub(crate) fn new(given_up: GivenUp) -> Self {
        Self { given_up, samples: AtomicUsize::new(0) }
    }

    /// The cause by which a run counts as failed now; none where its outcome counts.
    pub(crate) fn cause(&self, run: u64) -> Option<&str> {
        let samples = self.samples.load(Ordering::Relaxed);
        let rounds = self.given_up.0.iter().filter(|round| round.placed > samples);
        rounds.filter_map(|round| round.failures.get(&run)).map(String::as_str).next()
    }

    /// Whether something will count otherwise later.
    pub(crate) fn will_change(&self) -> bool {
        let samples = self.samples.load(Ordering::Relaxed);
        self.given_up.0.iter().any(|round| round.placed > samples)
    }

    /// So many samples are in now: the samples that count otherwise than before.
    pub(crate) fn reach(&self, plan: &Plan, samples: usize) -> Vec<usize> {
        let before = self.samples.swap(samples, Ordering::Relaxed);
        let rounds = self.given_up.0.iter();
        let rounds = rounds.filter(|round| (before + 1..=samples).contains(&round.placed));
        let changed = rounds.flat_map(|round| round.failures.keys());
        let changed: BTreeSet<usize> = changed.map(|run| sample_of(plan, *run).0).collect();
        changed.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::material::Material;
    use crate::plan::PairOptions;

    #[test]
    fn a_failure_counts_until_everything_that_was_placed_with_it_is_in() {
        let options = PairOptions { material: Some(Material::Ps), ..PairOptions::default() };
        let mut plan = options.plan().expect("a plan").plan;
        plan.experiments.push(plan.experiments[0].clone());
        // Runs 5 and 6 are of sample 2, run 13 is of sample 6.
        let mut given_up = GivenUp::default();
        let said = |run: u64, cause: &str| BTreeMap::from([(run, cause.to_owned())]);
        given_up.add(20, said(5, "exit code 1").into_iter().chain(said(13, "timeout")).collect());
        given_up.add(40, said(5, "exit code 2"));
        let counting = Counting::new(given_up);
        let causes = || [5, 6, 13].map(|run| counting.cause(run).map(str::to_owned));
        let reach = |samples| counting.reach(&plan, samples);
        let none: [usize; 0] = [];
        let both = [Some("exit code 1".to_owned()), None, Some("timeout".to_owned())];
        assert_eq!(causes(), both);
        assert_eq!(reach(19), none);
        assert_eq!(causes(), both);
        assert_eq!(reach(20), [2, 6]);
        assert_eq!(causes(), [Some("exit code 2".to_owned()), None, None]);
        assert_eq!(reach(39), none);
        assert_eq!(reach(60), [2]);
        assert_eq!(causes(), [None, None, None]);
        // From the beginning.
        assert_eq!(reach(0), none);
        assert_eq!(causes(), both);
    }
}
