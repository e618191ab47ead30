//! Stages that are placed while earlier ones are still on their way.

use crate::support::{line, line_problem};
use smc_calib::reference::{Reference, all};
use smc_calib::{
    CalibrateError, DensitySummary, FixedSigma, Noise, Posterior, Settings, SimError, Simulator,
    StageRecord, StopReason, calibrate, sample_density,
};
use std::ops::ControlFlow;
use std::sync::Mutex;

fn settings(samples: usize, overlap: usize, seed: u64) -> Settings {
    Settings { samples, overlap, seed, map_simulations: 0, ..Settings::default() }
}

fn runs(reference: &Reference, overlap: usize, samples: usize, seeds: u64) -> Vec<DensitySummary> {
    let run = |seed| sample_density(reference, &settings(samples, overlap, seed)).unwrap();
    (0..seeds).map(run).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
#[ignore = "long: run by .ci/run"]
fn moments_and_evidence_of_every_reference_are_found_at_any_overlap() {
    for overlap in [1, 512, 1024] {
        for reference in all() {
            let runs = runs(&reference, overlap, 4096, 6);
            let name = format!("{}, overlap {overlap}", reference.name);
            let evidence = rms(runs.iter().map(|r| r.log_evidence.value - reference.log_evidence));
            assert!(evidence < 0.02, "{name}: log evidence {evidence}");
            for j in 0..reference.mean.len() {
                let mean =
                    rms(runs.iter().map(|r| (r.mean[j] - reference.mean[j]) / reference.sd[j]));
                let sd = rms(runs.iter().map(|r| r.sd[j] / reference.sd[j] - 1.0));
                assert!(mean < 0.03, "{name}: mean {j} off by {mean} sd");
                assert!(sd < 0.03, "{name}: sd {j} off by {sd}");
            }
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_evidence_is_unbiased_and_its_error_bars_are_honest_with_overlap() {
    let reference = &all()[1];
    let runs = runs(reference, 500, 2048, 60);
    let n = runs.len() as f64;
    let ratio = |r: &DensitySummary| (r.log_evidence.frozen_value - reference.log_evidence).exp();
    let mean = runs.iter().map(ratio).sum::<f64>() / n;
    let se = rms(runs.iter().map(|r| ratio(r) - mean)) / (n - 1.0).sqrt();
    assert!((mean - 1.0).abs() < 3.5 * se, "mean of Z-hat/Z is {mean} +- {se}");
    let scores =
        runs.iter().map(|r| (r.log_evidence.value - reference.log_evidence) / r.log_evidence.se);
    let spread = rms(scores) / (15f64 / 13.0).sqrt();
    assert!((0.7..1.35).contains(&spread), "z-scores have sd {spread}");
}

/// What the sampler did: it announced a stage, or asked for one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Announced(usize, usize),
    Asked(usize, usize),
}

/// The line, which remembers what it was told, and may end.
struct Told<'a> {
    line: &'a dyn Simulator,
    steps: Mutex<Vec<Step>>,
    announced: Mutex<Vec<f64>>,
    end: usize,
}

impl<'a> Told<'a> {
    fn new(line: &'a dyn Simulator) -> Self {
        Self { line, steps: Mutex::default(), announced: Mutex::default(), end: usize::MAX }
    }
}

impl Simulator for Told<'_> {
    fn parameters(&self) -> usize {
        2
    }

    fn observables(&self) -> usize {
        12
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        self.line.simulate(theta, out)
    }

    fn announce(&self, first: usize, thetas: &[f64]) {
        let mut announced = self.announced.lock().unwrap();
        assert_eq!(announced.len(), 2 * first, "stages are announced in order");
        announced.extend_from_slice(thetas);
        self.steps.lock().unwrap().push(Step::Announced(first, first + thetas.len() / 2));
    }

    fn simulate_batch(
        &self,
        first: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        let end = first + thetas.len() / 2;
        self.steps.lock().unwrap().push(Step::Asked(first, end));
        let announced = self.announced.lock().unwrap();
        if !announced.is_empty() {
            assert_eq!(announced[2 * first..2 * end], *thetas, "other parameters than announced");
        }
        if end > self.end {
            return vec![Err(SimError::Interrupted); thetas.len() / 2];
        }
        let rows = thetas.chunks_exact(2).zip(outputs.chunks_exact_mut(12));
        rows.map(|(theta, out)| self.line.simulate(theta, out)).collect()
    }
}

fn of_line(simulator: &dyn Simulator, settings: &Settings) -> Result<Posterior, CalibrateError> {
    let noise = Noise::Fixed { sigma: FixedSigma::Absolute(0.05) };
    calibrate(&line_problem(simulator, noise), settings, &mut ())
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_stage_is_placed_from_all_stages_that_end_so_far_before_it_and_from_no_other() {
    let line = line();
    for (samples, overlap) in
        [(300, 0), (300, 1), (300, 40), (2048, 128), (2048, 300), (2048, 512), (17, 4)]
    {
        let told = Told::new(&line);
        let settings = Settings { overlap, seed: 3, ..Settings::for_budget(samples) };
        let posterior = of_line(&told, &settings).unwrap();
        let steps = told.steps.into_inner().unwrap();
        let mut asked = 0;
        let mut ends = vec![0];
        for step in &steps {
            match step {
                Step::Announced(first, end) => {
                    let known = ends.iter().copied().filter(|end| end + overlap <= *first).max();
                    assert_eq!(
                        asked,
                        known.unwrap_or(0),
                        "{samples}, {overlap}: stage from {first}"
                    );
                    ends.push(*end);
                }
                Step::Asked(first, end) => {
                    assert_eq!(*first, asked);
                    asked = *end;
                }
            }
        }
        assert_eq!(asked, samples);
        let announced = steps.iter().any(|step| matches!(step, Step::Announced(..)));
        assert_eq!(announced, overlap > 0);
        let stages: Vec<usize> = posterior.stages.iter().map(|stage| stage.stage).collect();
        assert_eq!(stages, (0..stages.len()).collect::<Vec<_>>());
    }
}

#[test]
fn threads_and_interruptions_do_not_change_a_bit_with_overlap() {
    let line = line();
    let settings = settings(2000, 450, 11);
    let whole = format!("{:?}", of_line(&line, &settings).unwrap());
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let again = pool.install(|| of_line(&line, &settings).unwrap());
        assert!(format!("{again:?}") == whole, "{threads} threads");
    }
    let mut told = Told::new(&line);
    told.end = 600;
    let stopped = of_line(&told, &settings);
    assert!(matches!(stopped, Err(CalibrateError::Interrupted { .. })), "{stopped:?}");
    let before = told.announced.into_inner().unwrap();
    let told = Told::new(&line);
    assert!(format!("{:?}", of_line(&told, &settings).unwrap()) == whole);
    assert!(told.announced.into_inner().unwrap().starts_with(&before), "placed otherwise");
}

#[test]
fn a_run_that_reaches_its_target_ends_with_the_stages_that_were_placed_meanwhile() {
    let line = line();
    let told = Told::new(&line);
    let settings = Settings { ess_target: Some(200.0), ..settings(16_384, 600, 1) };
    let posterior = of_line(&told, &settings).unwrap();
    assert_eq!(posterior.stop, StopReason::EssReached);
    let announced = told.announced.into_inner().unwrap().len() / 2;
    assert!(announced < 16_384 && posterior.samples.len() == announced, "{announced}");
    let at =
        posterior.stages.iter().position(|stage| stage.beta >= 1.0 && stage.ess >= 200.0).unwrap();
    assert!(at + 1 < posterior.stages.len(), "some were on their way");
}

#[test]
fn an_observer_ends_a_run_without_the_stages_on_their_way() {
    struct AfterFive;
    impl smc_calib::Observer for AfterFive {
        fn stage(&mut self, record: &StageRecord) -> ControlFlow<()> {
            if record.stage == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
    let line = line();
    let noise = Noise::Fixed { sigma: FixedSigma::Absolute(0.05) };
    let problem = line_problem(&line, noise);
    let posterior = calibrate(&problem, &settings(4096, 500, 1), &mut AfterFive).unwrap();
    assert_eq!((posterior.stages.len(), posterior.samples.len()), (6, 6 * 256));
    assert_eq!(posterior.stop, StopReason::Interrupted);
}

#[test]
fn an_overlap_of_more_than_a_quarter_of_the_samples_is_refused() {
    let line = line();
    match of_line(&line, &settings(1000, 251, 1)) {
        Err(CalibrateError::Setting { setting: "overlap", value: 251.0, range }) => {
            assert_eq!(range, "at most a quarter of samples");
        }
        other => panic!("{other:?}"),
    }
    assert!(of_line(&line, &settings(1000, 250, 1)).is_ok());
}
