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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use smc_calib::FnSimulator;

    use super::super::{RunOptions, run, run_function};
    use super::*;
    use crate::export::Groups;
    use crate::plan::FunctionOptions;
    use crate::watch::Unwatched;

    fn planned() -> Planned {
        let options: FunctionOptions = serde_json::from_value(serde_json::json!({
            "name": "line", "function": "line", "seed": 3, "samples": 128,
            "parameters": [
                {"name": "a", "unit": "1", "prior": {"kind": "normal", "mean": 0.0, "sd": 1.0}},
                {"name": "b", "unit": "1", "prior": {"kind": "uniform", "lower": -4.0, "upper": 4.0}},
            ],
            "observables": [{
                "name": "y", "control_name": "t", "control": [0.0, 1.0, 2.0], "values": [0.31, 0.79, 1.32],
                "sigma": null, "unit": "", "control_unit": "",
                "noise": {"kind": "inferred", "nu0": 4.0, "s0": 0.05},
            }],
        }))
        .expect("options");
        options.plan().expect("a plan")
    }

    fn options(folder: &std::path::Path) -> RunOptions {
        RunOptions { out: Some(folder.join("run")), ..RunOptions::default() }
    }

    #[test]
    fn every_sample_is_asked_of_the_function_once_and_its_values_are_kept_and_exported() {
        let folder = tempfile::tempdir().expect("a folder");
        let calls = AtomicUsize::new(0);
        let line = FnSimulator::new(2, 3, |theta: &[f64], out: &mut [f64]| {
            calls.fetch_add(1, Ordering::Relaxed);
            if theta[1] > 3.0 {
                return Err(SimError::recoverable("too steep"));
            }
            (0..3).for_each(|t| out[t] = theta[0] + theta[1] * t as f64);
            Ok(())
        });
        let planned = planned();
        let found = run_function(&planned, &line, &options(folder.path()), &Unwatched::default())
            .expect("a run");
        assert_eq!(calls.into_inner(), 128);
        let kept = crate::report::read_simulated(&planned.plan, &found.out).expect("values");
        let samples = crate::report::read_samples(&found.record, &found.out).expect("samples");
        for (k, row) in kept.iter().enumerate() {
            let (a, b) = (samples.parameters[0][k], samples.parameters[1][k]);
            let wanted = (b <= 3.0).then(|| vec![a, a + b, a + b * 2.0]);
            assert_eq!(*row, wanted, "sample {k}");
        }
        assert!(kept.contains(&None), "the test needs failures too");
        let groups = Groups::read(&found.out).expect("groups");
        for name in ["log_likelihood", "posterior_predictive"] {
            let group = groups.group(name).unwrap_or_else(|| panic!("{name}"));
            assert!(!group.variables.is_empty(), "{name}: {:?}", groups.notes);
        }
        // Draws are of the process, as are their outputs: this line is one.
        assert!(found.record.drawn_by_process);
        let column = |group: &str, name: &str| {
            let variable = groups.group(group).and_then(|group| group.variable(name));
            let values = &variable.unwrap_or_else(|| panic!("{name}")).values;
            (0..values.len()).map(|k| values.at(k)).collect::<Vec<f64>>()
        };
        let [a, b, sigma] = ["a", "b", "sigma"].map(|name| column("posterior", name));
        let said = column("log_likelihood", "y");
        for (k, said) in said.chunks_exact(3).enumerate() {
            for (t, (y, said)) in [0.31, 0.79, 1.32].iter().zip(said).enumerate() {
                let score = (y - a[k] - b[k] * t as f64) / sigma[k];
                let exact = -0.5 * (score * score + std::f64::consts::TAU.ln()) - sigma[k].ln();
                assert!((said - exact).abs() < 0.01 * (1.0 + score.abs()), "{said} {exact}");
            }
        }
    }

    #[test]
    fn a_function_of_another_shape_or_no_function_is_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let short = FnSimulator::new(2, 2, |_: &[f64], _: &mut [f64]| Ok(()));
        let (planned, options) = (planned(), options(folder.path()));
        let error = run_function(&planned, &short, &options, &Unwatched::default());
        let error = error.expect_err("a shape").to_string();
        assert!(error.contains("2 parameters that gives 2 values"), "{error}");
        let error = run(&planned, &options, &Unwatched::default()).expect_err("none").to_string();
        assert!(error.contains("line, a function of the program that calibrated it"), "{error}");
        assert!(!options.out.as_ref().is_some_and(|out| out.exists()));
    }
}
