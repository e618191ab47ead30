//! A function of the calling program as the simulator of a plan: each parameter set is simulated once, and its values are kept.

use std::sync::{Mutex, PoisonError};

use smc_calib::{Posterior, SimError, Simulator};

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::output::WriteFile;
use crate::plan::Planned;
use crate::report::simulated;
use crate::watch::Watch;

/// A function with the values that it has given.
pub(super) struct Called<'a> {
    planned: &'a Planned,
    function: &'a dyn Simulator,
    watch: &'a dyn Watch,
    kept: Mutex<Kept>,
}

/// Values of the samples in their order, row by row, and what became of each.
#[derive(Default)]
struct Kept {
    values: Vec<f64>,
    results: Vec<Result<(), SimError>>,
}

impl<'a> Called<'a> {
    /// A function that simulates the one experiment of a plan.
    pub(super) fn new(
        planned: &'a Planned,
        function: &'a dyn Simulator,
        watch: &'a dyn Watch,
    ) -> Result<Self, Failure> {
        let plan = &planned.plan;
        let refused = |found: String, expected: String| {
            Err(InputError::new(&plan.name, Mistake::Conflict)
                .found(found)
                .expected(expected)
                .into())
        };
        if plan.function().is_none() || plan.experiments.len() != 1 {
            return refused(
                "a function, and a plan that does not call one".to_owned(),
                "a plan with one experiment, which a function simulates".to_owned(),
            );
        }
        let (takes, gives) = (function.parameters(), function.observables());
        let (parameters, observations) = (plan.parameters.len(), plan.observations());
        if (takes, gives) != (parameters, observations) {
            return refused(
                format!("a function of {takes} parameters that gives {gives} values"),
                format!("one of {parameters} parameters that gives {observations} values"),
            );
        }
        Ok(Self { planned, function, watch, kept: Mutex::default() })
    }

    /// Writes the values of every sample, empty where the simulation failed.
    pub(super) fn write(
        &self,
        posterior: &Posterior,
        write: &WriteFile<'_>,
    ) -> Result<(), RunError> {
        let plan = &self.planned.plan;
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let rows = kept.values.chunks_exact(plan.observations()).zip(&posterior.samples);
        let rows = rows.map(|(row, sample)| sample.log_likelihood.map(|_| row));
        write(simulated::FILE, simulated::csv(plan, rows).as_bytes())
    }
}

impl Simulator for Called<'_> {
    fn parameters(&self) -> usize {
        self.function.parameters()
    }

    fn observables(&self) -> usize {
        self.function.observables()
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        self.function.simulate(theta, out)
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let rows = thetas.len() / self.parameters();
        if self.watch.stop().asked() {
            return vec![Err(SimError::Interrupted); rows];
        }
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let places = first * self.observables()..(first + rows) * self.observables();
        if let (Some(values), Some(results)) =
            (kept.values.get(places), kept.results.get(first..first + rows))
        {
            outputs.copy_from_slice(values);
            return results.to_vec();
        }
        // Given sets are simulated as they are given, not as their normal scores round them.
        let given: Option<Vec<f64>> =
            self.planned.plan.design.as_ref().map(|design| {
                design.sets.iter().skip(first).take(rows).flatten().copied().collect()
            });
        let thetas = given.as_deref().filter(|given| given.len() == thetas.len()).unwrap_or(thetas);
        let results = self.function.simulate_batch(first, thetas, outputs);
        (0..rows).for_each(|_| self.watch.advance());
        if kept.results.len() == first && results.len() == rows {
            kept.values.extend_from_slice(outputs);
            kept.results.extend_from_slice(&results);
        }
        results
    }
}
