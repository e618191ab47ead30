//! Simulations taken stage by stage: once each, in order, and again from what was stored.

use crate::support::{line, line_problem, prior};
use smc_calib::{
    CalibrateError, Noise, Observations, Parameter, Posterior, PriorSpec, Problem, Settings,
    SimError, Simulator, calibrate,
};
use std::collections::BTreeMap;
use std::sync::Mutex;

/// Parameters and outputs (or the cause of the failure) by number.
type Runs = BTreeMap<usize, (Vec<f64>, Result<Vec<f64>, SimError>)>;

/// The line, run in batches only; what was run is stored, and what is stored is not run.
struct Batches {
    observables: usize,
    runs: Mutex<Runs>,
    /// First number and size of every batch.
    batches: Mutex<Vec<(usize, usize)>>,
    simulated: Mutex<usize>,
    /// Number from which on nothing runs any more, and what is answered then.
    end: usize,
    ending: SimError,
}

impl Batches {
    fn new(observables: usize) -> Self {
        Self {
            observables,
            runs: Mutex::default(),
            batches: Mutex::default(),
            simulated: Mutex::default(),
            end: usize::MAX,
            ending: SimError::Interrupted,
        }
    }

    fn run(&self, theta: &[f64]) -> Result<Vec<f64>, SimError> {
        *self.simulated.lock().unwrap() += 1;
        // An eighth of the prior cannot be simulated.
        if theta[0] > 1.15 {
            return Err(SimError::recoverable("too steep"));
        }
        let step = 1.2 / self.observables as f64;
        Ok((0..self.observables).map(|i| theta[0] + theta[1] * step * i as f64).collect())
    }
}

impl Simulator for Batches {
    fn parameters(&self) -> usize {
        2
    }

    fn observables(&self) -> usize {
        self.observables
    }

    fn simulate(&self, _: &[f64], _: &mut [f64]) -> Result<(), SimError> {
        panic!("a simulation outside of the batches");
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        self.batches.lock().unwrap().push((first, thetas.len() / 2));
        let mut runs = self.runs.lock().unwrap();
        let rows = thetas.chunks_exact(2).zip(outputs.chunks_exact_mut(self.observables));
        rows.enumerate()
            .map(|(k, (theta, out))| {
                if first + k >= self.end {
                    return Err(self.ending.clone());
                }
                let (stored, result) =
                    runs.entry(first + k).or_insert_with(|| (theta.to_vec(), self.run(theta)));
                assert_eq!(stored, theta, "sample {} has other parameters", first + k);
                // Whatever a failed run leaves behind must not matter.
                out.fill(f64::NAN);
                result.clone().map(|values| out.copy_from_slice(&values))
            })
            .collect()
    }
}

fn settings(samples: usize) -> Settings {
    Settings { samples, seed: 5, map_simulations: 0, ..Settings::default() }
}

fn with_threads(threads: usize, simulator: &Batches, samples: usize) -> Posterior {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let problem = line_problem(simulator, Noise::default());
    pool.install(|| calibrate(&problem, &settings(samples), &mut ()).unwrap())
}

fn same(a: &Posterior, b: &Posterior) -> bool {
    // Debug prints every float to its last bit.
    format!("{a:?}") == format!("{b:?}")
}

#[test]
fn every_sample_is_simulated_once_in_one_batch_per_stage_and_nothing_else_is() {
    for samples in [1, 30, 100, 2048] {
        let simulator = Batches::new(12);
        let p = with_threads(2, &simulator, samples);
        assert_eq!(*simulator.simulated.lock().unwrap(), samples);
        assert_eq!(p.counters.map_simulations, 0);
        let batches = simulator.batches.lock().unwrap();
        let stages: Vec<(usize, usize)> =
            p.stages.iter().map(|s| (s.total - s.simulations, s.simulations)).collect();
        assert_eq!(*batches, stages);
        // The MAP is the best sample, with the curve that was simulated for it.
        let best = p
            .samples
            .iter()
            .filter(|s| s.log_likelihood == Some(p.map.log_likelihood))
            .map(|s| s.theta.clone())
            .next();
        assert_eq!(best.as_ref(), Some(&p.map.theta));
        assert_eq!(Ok(&p.map.outputs), simulator.run(&p.map.theta).as_ref());
        assert_eq!(p.residuals.values.len(), 12);
    }
}

#[test]
fn an_interrupted_run_that_is_repeated_with_its_stored_outputs_ends_in_the_same_bits() {
    let whole = with_threads(1, &Batches::new(12), 1000);
    assert!(whole.failures[0].count > 50, "the test needs failures too");
    for threads in [1, 2] {
        let mut simulator = Batches::new(12);
        for end in [0, 7, 62, 63, 500, 999] {
            simulator.end = end;
            for ending in [SimError::fatal("the machine was switched off"), SimError::Interrupted] {
                simulator.ending = ending.clone();
                let problem = line_problem(&simulator, Noise::default());
                let stopped = calibrate(&problem, &settings(1000), &mut ());
                match (ending, stopped) {
                    (SimError::Fatal { .. }, Err(CalibrateError::Fatal { cause, .. })) => {
                        assert!(cause.contains("switched off"), "{cause}");
                    }
                    (SimError::Interrupted, Err(CalibrateError::Interrupted { stages })) => {
                        assert!(stages.iter().all(|stage| stage.total <= end), "ends at {end}");
                    }
                    (_, other) => panic!("ends at {end}: {other:?}"),
                }
            }
        }
        simulator.end = usize::MAX;
        assert!(same(&with_threads(threads, &simulator, 1000), &whole), "{threads} threads");
        assert_eq!(*simulator.simulated.lock().unwrap(), 1000, "nothing ran twice");
        // All of it stored.
        assert!(same(&with_threads(threads, &simulator, 1000), &whole), "{threads} threads");
        assert_eq!(*simulator.simulated.lock().unwrap(), 1000);
    }
}

#[test]
fn batches_give_the_bits_of_single_simulations() {
    let batches = Batches::new(12);
    let single = smc_calib::FnSimulator::new(2, 12, |theta: &[f64], out: &mut [f64]| {
        batches.run(theta).map(|values| out.copy_from_slice(&values))
    });
    let problem = line_problem(&single, Noise::default());
    let one = calibrate(&problem, &settings(1000), &mut ()).unwrap();
    assert!(same(&one, &with_threads(2, &Batches::new(12), 1000)));
}

#[test]
fn a_batch_with_answers_missing_is_refused() {
    struct Short;
    impl Simulator for Short {
        fn parameters(&self) -> usize {
            2
        }
        fn observables(&self) -> usize {
            12
        }
        fn simulate(&self, _: &[f64], _: &mut [f64]) -> Result<(), SimError> {
            Ok(())
        }
        fn simulate_batch(
            &self,
            _: usize,
            thetas: &[f64],
            _: &mut [f64],
        ) -> Vec<Result<(), SimError>> {
            vec![Ok(()); thetas.len() / 2 - 1]
        }
    }
    let error = calibrate(&line_problem(&Short, Noise::default()), &settings(100), &mut ());
    let Err(CalibrateError::Fatal { cause, .. }) = error else { panic!("{error:?}") };
    assert!(cause.contains("49 of the 50 runs"), "{cause}");
}

#[test]
fn long_curves_come_in_few_batches_and_the_best_one_is_kept_whole() {
    // 30 000 observations: 266 curves of them fit into one batch.
    let m = 30_000;
    let simulator = Batches::new(m);
    let values = simulator.run(&[0.3, 1.2]).unwrap();
    let problem = Problem {
        simulator: &simulator,
        parameters: ["a", "b"]
            .map(|n| Parameter::new(n, "1", prior(PriorSpec::Normal { mean: 0.5, sd: 1.0 })))
            .to_vec(),
        observations: Observations::new((0..m).map(|i| i as f64).collect(), values).unwrap(),
        noise: Noise::default(),
    };
    let p = calibrate(&problem, &settings(600), &mut ()).unwrap();
    let sizes: Vec<usize> = simulator.batches.lock().unwrap().iter().map(|b| b.1).collect();
    assert_eq!(sizes.iter().sum::<usize>(), 600);
    assert!(sizes.iter().all(|s| *s <= 266) && sizes.len() <= p.stages.len() + 2, "{sizes:?}");
    assert_eq!(p.map.outputs, simulator.run(&p.map.theta).unwrap());
    let best = p.samples.iter().filter_map(|s| s.log_likelihood).fold(f64::MIN, f64::max);
    // Flat enough a prior that the best fit is the best density.
    assert!(p.map.log_likelihood >= best - 0.1, "{} {best}", p.map.log_likelihood);
}

#[test]
fn a_plain_simulator_needs_no_batches_of_its_own() {
    let simulator = line();
    let mut out = vec![0.0; 36];
    let thetas = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let results = simulator.simulate_batch(17, &thetas, &mut out);
    assert_eq!(results, vec![Ok(()); 3]);
    for (theta, out) in thetas.chunks(2).zip(out.chunks(12)) {
        let mut alone = vec![0.0; 12];
        simulator.simulate(theta, &mut alone).unwrap();
        assert_eq!(alone, out);
    }
}
