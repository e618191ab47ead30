//! Runs that extend others: what was simulated counts, and the answer is that of so many simulations.

use crate::support::{line, line_problem};
use smc_calib::reference::{Reference, banana, gaussian, two_modes};
use smc_calib::{
    CalibrateError, Concern, Noise, Posterior, Settings, StopReason, calibrate, sample_density,
};

fn run(settings: &Settings) -> Posterior {
    let simulator = line();
    calibrate(&line_problem(&simulator, Noise::default()), settings, &mut ()).unwrap()
}

fn extended(settings: &Settings, budgets: &[usize]) -> Settings {
    budgets.iter().fold(settings.clone(), |settings, budget| settings.extended(*budget).unwrap())
}

/// Stage, parameters and log likelihood of the first samples, to the last bit.
fn first(posterior: &Posterior, samples: usize) -> Vec<String> {
    let rows = posterior.samples.iter().take(samples);
    rows.map(|s| format!("{} {:?} {:?}", s.stage, s.theta, s.log_likelihood)).collect()
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn the_first_samples_of_an_extended_run_are_those_of_the_run_it_extends() {
    let small = Settings::for_budget;
    let plain = Settings { samples: 4096, ..Settings::default() };
    let overlapping = Settings { overlap: 300, ..plain.clone() };
    let parallel = Settings { batch: 10, overlap: 12, ..small(60) };
    let cases: [(Settings, &[usize]); 11] = [
        (plain.clone(), &[8192]),
        (plain, &[4097, 5000, 40_000]),
        (overlapping, &[8192]),
        (Settings { samples: 20, ..Settings::default() }, &[40]),
        (small(60), &[120]),
        (small(60), &[120, 240]),
        (small(97), &[203]),
        (small(16), &[17, 34]),
        (parallel, &[120]),
        (small(1000), &[3000]),
        (small(2048), &[4096, 16_384]),
    ];
    for (settings, budgets) in cases {
        let mut before = run(&settings);
        for k in 1..=budgets.len() {
            let after = run(&extended(&settings, &budgets[..k]));
            let (n, to) = (before.samples.len(), budgets[k - 1]);
            assert_eq!(after.samples.len(), to);
            assert!(first(&after, n) == first(&before, n), "{n} -> {to}");
            let last: Vec<bool> = after.stages.iter().map(|stage| stage.last).collect();
            let (finally, others) = last.split_last().unwrap();
            assert!(*finally && !others.contains(&true), "{n} -> {to}: {last:?}");
            before = after;
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_extended_run_gives_the_same_bits_for_any_number_of_threads() {
    let with = |threads: usize, settings: &Settings| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| format!("{:?}", run(settings)))
    };
    for settings in [
        extended(&Settings::for_budget(60), &[120]),
        extended(&Settings { samples: 1024, ..Settings::default() }, &[2048]),
        Settings::for_budget(2048),
    ] {
        assert!(with(1, &settings) == with(3, &settings));
    }
}

/// Root mean squares over seeds of all means (posterior sds), all sds (relative) and the log evidence.
fn errors(reference: &Reference, settings: &Settings, seeds: u64) -> [f64; 3] {
    let (mut sums, mut counts) = ([0.0; 3], [0.0; 3]);
    for seed in 1..=seeds {
        let settings = Settings { seed, ..settings.clone() };
        let found = sample_density(reference, &settings).unwrap();
        let mut add = |of: usize, error: f64| {
            sums[of] += error * error;
            counts[of] += 1.0;
        };
        for j in 0..reference.mean.len() {
            add(0, (found.mean[j] - reference.mean[j]) / reference.sd[j]);
            add(1, found.sd[j] / reference.sd[j] - 1.0);
        }
        add(2, found.log_evidence.value - reference.log_evidence);
    }
    std::array::from_fn(|of| (sums[of] / counts[of]).sqrt())
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn an_extended_run_is_as_good_as_one_of_as_many_simulations_from_the_start() {
    let seeds = 12;
    // Each root mean square is known to 1 / sqrt(2 * 12) = 20 % at best, their ratio to 29 %; twice that is allowed, and
    // errors below a thousandth of a standard deviation do not count.
    let allowed = 1.2 * (1.0 + 2.0 / (seeds as f64).sqrt());
    let mut worse = Vec::new();
    for reference in [banana(), two_modes(), gaussian(3, 0.8, 0.1)] {
        for begun in [
            Settings::for_budget(100),
            Settings { samples: 1024, ..Settings::default() },
            Settings { samples: 4096, ..Settings::default() },
        ] {
            let twice = 2 * begun.samples;
            let whole = errors(&reference, &Settings { samples: twice, ..begun.clone() }, seeds);
            let parts = errors(&reference, &extended(&begun, &[twice]), seeds);
            // Not as good yet: a hundred calls of the banana and a hundred more, 0.06 standard deviations off where two hundred from the
            // start are 0.02, are held to no more than that.
            let behind = reference.name == "banana" && begun.samples == 100;
            let allowed = if behind { 4.0 } else { allowed };
            if parts.iter().zip(whole).any(|(part, whole)| *part > allowed * whole + 1e-3) {
                worse.push(format!("{} {twice}: {parts:.3?} against {whole:.3?}", reference.name));
            }
        }
    }
    assert!(worse.is_empty(), "{worse:?}");
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_run_placed_by_the_process_goes_on_without_it_where_so_many_simulations_do() {
    let begun = Settings::for_budget(300);
    let parts = extended(&begun, &[16_384]);
    for reference in [banana(), two_modes()] {
        let found = errors(&reference, &parts, 4);
        let whole = errors(&reference, &Settings::for_budget(16_384), 4);
        for (found, whole) in found.iter().zip(whole) {
            assert!(*found <= 2.0 * whole + 2e-3, "{}: {found:?} {whole:?}", reference.name);
        }
    }
}

#[test]
fn a_target_that_a_run_has_reached_does_not_end_its_extension() {
    let begun = Settings { samples: 4096, ess_target: Some(100.0), ..Settings::default() };
    let before = run(&begun);
    assert!(before.stop == StopReason::EssReached && before.samples.len() < 4096);
    let after = run(&extended(&begun, &[8192]));
    assert_eq!((after.stop, after.samples.len()), (StopReason::BudgetSpent, 8192));
    let n = before.samples.len();
    assert!(first(&after, n) == first(&before, n));
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_handful_of_further_simulations_raises_no_doubt() {
    for (begun, to) in [(4096, 4097), (4096, 4100), (4096, 4300), (300, 301), (300, 310)] {
        for seed in 1..=5 {
            let begun = Settings { seed, ..Settings::for_budget(begun) };
            let concerns = |settings: &Settings| {
                let posterior = run(settings);
                let doubts = posterior.trust().concerns.into_iter();
                let doubts = doubts.filter(|concern| {
                    matches!(
                        concern,
                        Concern::EvidenceDisagrees { .. } | Concern::BudgetTooSmall { .. }
                    )
                });
                doubts.collect::<Vec<_>>()
            };
            let (before, after) = (concerns(&begun), concerns(&extended(&begun, &[to])));
            assert!(after.len() <= before.len(), "{to}, seed {seed}: {before:?} {after:?}");
        }
    }
}

#[test]
fn budgets_that_do_not_rise_are_refused() {
    let begun = Settings { samples: 100, ..Settings::default() };
    for samples in [0, 99, 100] {
        let error = begun.extended(samples).unwrap_err();
        assert!(error.to_string().contains("above the number that the run has"), "{error}");
    }
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    for earlier in [vec![100], vec![200], vec![0, 50], vec![60, 50], vec![50, 50]] {
        let settings = Settings { earlier: earlier.clone(), ..begun.clone() };
        let error = calibrate(&problem, &settings, &mut ()).unwrap_err();
        let is = matches!(error, CalibrateError::Setting { setting: "earlier", .. });
        assert!(is, "{earlier:?}: {error}");
        // Without the check nothing panics.
        let _ = sample_density(&gaussian(2, 0.8, 0.1), &settings);
    }
    let tuned = line_problem(&simulator, Noise::EssTarget { share: 0.2 });
    let error = calibrate(&tuned, &begun.extended(200).unwrap(), &mut ()).unwrap_err();
    assert!(error.to_string().contains("none with tuned noise"), "{error}");
}

#[test]
fn settings_of_a_run_that_was_not_extended_are_written_as_before() {
    let begun = Settings::for_budget(100);
    assert!(!serde_json::to_string(&begun).unwrap().contains("earlier"));
    let twice = begun.extended(200).unwrap();
    let text = serde_json::to_string(&twice).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), twice);
    assert_eq!(twice.as_begun(), begun);
}
