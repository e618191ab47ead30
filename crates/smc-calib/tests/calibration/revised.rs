//! Answers that change after they were given: the stages that they had placed stay, and the new answers count.

use crate::support::{line, line_problem};
use smc_calib::{Noise, Posterior, Settings, SimError, Simulator, calibrate};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The line, where every third run fails until so many samples are in.
struct Mended<'a> {
    line: &'a dyn Simulator,
    until: usize,
    samples: AtomicUsize,
}

impl Simulator for Mended<'_> {
    fn parameters(&self) -> usize {
        self.line.parameters()
    }

    fn observables(&self) -> usize {
        self.line.observables()
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        self.line.simulate(theta, out)
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let failing = self.samples.load(Ordering::Relaxed) < self.until;
        let mut results = self.line.simulate_batch(first, thetas, outputs);
        for (row, result) in results.iter_mut().enumerate() {
            if failing && (first + row).is_multiple_of(3) {
                *result = Err(SimError::recoverable("no licence"));
            }
        }
        results
    }

    fn revised(&self, samples: usize) -> Vec<usize> {
        let before = self.samples.swap(samples, Ordering::Relaxed);
        let now = (before + 1..=samples).contains(&self.until);
        if now { (0..samples).filter(|sample| sample.is_multiple_of(3)).collect() } else { Vec::new() }
    }
}

fn with(until: usize, samples: usize) -> Posterior {
    let line = line();
    let simulator = Mended { line: &line, until, samples: AtomicUsize::new(0) };
    let problem = line_problem(&simulator, Noise::default());
    let settings = Settings { samples, seed: 3, map_simulations: 0, ..Settings::default() };
    calibrate(&problem, &settings, &mut ()).expect("a posterior")
}

#[test]
fn failures_that_are_mended_later_leave_the_posterior_of_a_run_without_failures() {
    for samples in [2048, 8192] {
        let never = with(0, samples);
        assert!(never.failures.is_empty());
        let (tolerance, of_evidence) = if samples < 4096 { (0.15, 0.1) } else { (0.03, 0.02) };
        // Before the second stage is in, in the middle, and after the last one.
        for until in [2, samples / 2, samples] {
            let mended = with(until, samples);
            assert!(mended.failures.is_empty(), "{:?}", mended.failures);
            assert!(mended.failing.is_none());
            for (a, b) in never.parameters.iter().zip(&mended.parameters) {
                let (a, b) = (&a.in_coordinate, &b.in_coordinate);
                assert!((a.mean - b.mean).abs() < tolerance * a.sd, "{until}: {a:?} {b:?}");
                assert!((b.sd / a.sd - 1.0).abs() < tolerance, "{until}: {a:?} {b:?}");
            }
            let ln_z = |posterior: &Posterior| posterior.log_evidence.value;
            assert!((ln_z(&never) - ln_z(&mended)).abs() < of_evidence, "{until}");
            let stages = &mended.stages;
            assert!(
                stages.iter().filter(|stage| stage.total < until).all(|stage| stage.failed > 0)
            );
            assert!(
                stages.iter().filter(|stage| stage.total >= until).all(|s| s.failed_total == 0)
            );
        }
        // Never mended: a third is missing, and the evidence is smaller by ln(2/3).
        let failed = with(usize::MAX, samples);
        assert_eq!(failed.failures[0].count, samples.div_ceil(3));
        let less = failed.log_evidence.value - never.log_evidence.value;
        assert!((less - (2.0_f64 / 3.0).ln()).abs() < 0.1, "{less}");
    }
}
