//! What the runs of a plan gave, sample by sample, and the sampler once more on it.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;

use campaign::{Contents, Outcome, Task};
use smc_calib::{Observer, Posterior, SimError, Simulator, StageRecord};

use crate::calibration::sample;
use crate::error::InputError;
use crate::given_up::{Counting, GivenUp};
use crate::pair::model::NeckGrowth;
use crate::plan::{Plan, run_number};
use crate::report::read_simulated;
use crate::simulator::{cause, models, stored};

/// The sampler once more, answered from what is stored.
pub(super) struct Replay<'a> {
    pub(super) plan: &'a Plan,
    pub(super) tasks: &'a [Task],
    models: Vec<Option<NeckGrowth>>,
    outcomes: Option<&'a HashMap<u64, Outcome>>,
    counting: Counting,
    /// What a function gave, row by row; none where it failed.
    kept: Vec<Option<Vec<f64>>>,
}

/// Fate of a sample.
pub(super) enum Simulated {
    /// Its values.
    Values(Vec<f64>),
    /// Why it failed.
    Failed(String),
    /// Some of its runs have not ended.
    Missing,
}

impl<'a> Replay<'a> {
    /// Of what is stored of the runs of programs; a plan of built-in experiments alone has nothing stored.
    pub(super) fn new(
        plan: &'a Plan,
        contents: Option<&'a Contents>,
        given_up: GivenUp,
    ) -> Result<Self, InputError> {
        Ok(Self {
            plan,
            tasks: contents.map_or(&[], |contents| &contents.tasks),
            models: models(plan)?,
            outcomes: contents.map(|contents| &contents.outcomes),
            counting: Counting::new(given_up),
            kept: Vec::new(),
        })
    }

    /// With the values that a function of another program gave, which are kept in the folder of the run.
    pub(super) fn with_kept(mut self, folder: &Path) -> Result<Self, InputError> {
        if self.plan.function().is_some() {
            self.kept = read_simulated(self.plan, folder)?;
        }
        Ok(self)
    }

    /// From now on every outcome counts: the run is done.
    pub(super) fn all_in(self) -> Self {
        self.counting.reach(self.plan, usize::MAX);
        self
    }

    /// What a sample gave; a run that counts as failed until others are in counts so.
    pub(super) fn sample(&self, sample: usize, theta: &[f64]) -> Simulated {
        let plan = self.plan;
        match self.kept.get(sample) {
            Some(Some(values)) => return Simulated::Values(values.clone()),
            Some(None) => return Simulated::Failed("failed".to_owned()),
            None => {}
        }
        let mut values = Vec::new();
        let mut missing = false;
        for (place, (model, experiment)) in self.models.iter().zip(&plan.experiments).enumerate() {
            let found = match model {
                Some(model) => {
                    let mut own = vec![0.0; experiment.width()];
                    let simulated = model.simulate(theta, &mut own);
                    Some(
                        simulated.map(|()| own).map_err(|error| {
                            SimError::recoverable(cause(plan, place, error.cause()))
                        }),
                    )
                }
                None => {
                    let number = run_number(plan, sample, place);
                    match self.counting.cause(number) {
                        Some(words) => Some(Err(SimError::recoverable(cause(plan, place, words)))),
                        None => {
                            let outcome = self.outcomes.and_then(|all| all.get(&number));
                            stored(plan, place, outcome.cloned())
                        }
                    }
                }
            };
            match found {
                Some(Ok(own)) => values.extend(own),
                Some(Err(error)) => return Simulated::Failed(error.cause().to_owned()),
                None => missing = true,
            }
        }
        if missing { Simulated::Missing } else { Simulated::Values(values) }
    }

    /// The posterior of the stages that are complete; none before the first.
    pub(super) fn posterior(&self) -> Option<Posterior> {
        let mut complete = StopAfter { stages: usize::MAX, seen: 0 };
        let groups = self.plan.groups().ok()?;
        let all = sample(self.plan, groups.clone(), self, &mut complete);
        if let Ok(posterior) = all {
            return Some(posterior);
        }
        // From the beginning.
        self.counting.reach(self.plan, 0);
        let mut again = StopAfter { stages: complete.seen, seen: 0 };
        if again.stages == 0 {
            return None;
        }
        sample(self.plan, groups, self, &mut again).ok()
    }
}

/// Ends a run after some stages.
struct StopAfter {
    stages: usize,
    seen: usize,
}

impl Observer for StopAfter {
    fn stage(&mut self, _: &StageRecord) -> ControlFlow<()> {
        self.seen += 1;
        if self.seen >= self.stages { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl Simulator for Replay<'_> {
    fn parameters(&self) -> usize {
        self.plan.parameters.len()
    }

    fn observables(&self) -> usize {
        self.plan.observations()
    }

    fn revised(&self, samples: usize) -> Vec<usize> {
        self.counting.reach(self.plan, samples)
    }

    fn will_revise(&self) -> bool {
        self.counting.will_change()
    }

    fn simulate(&self, _: &[f64], _: &mut [f64]) -> Result<(), SimError> {
        Err(SimError::fatal("only samples are stored"))
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let (d, m) = (self.parameters(), self.observables());
        thetas
            .chunks_exact(d)
            .zip(outputs.chunks_exact_mut(m))
            .enumerate()
            .map(|(row, (theta, out))| match self.sample(first + row, theta) {
                Simulated::Values(values) => {
                    out.copy_from_slice(&values);
                    Ok(())
                }
                Simulated::Failed(cause) => Err(SimError::recoverable(cause)),
                Simulated::Missing => Err(SimError::Interrupted),
            })
            .collect()
    }
}
