//! Budgets of 50 to 300 simulations: as right as they can be, and honest where that is not enough.

use crate::conjugate::exact;
use crate::support::{line, line_problem, prior};
use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::reference::{self, Reference};
use smc_calib::trust::limits::{HELD_AGAINST_PROCESS, KHAT_LIMIT, TAIL_SHARE};
use smc_calib::{
    Concern, FixedSigma, FnSimulator, Noise, Observations, Parameter, ParameterSummary, Posterior,
    PriorSpec, Problem, Settings, SimError, Simulator, Target, Verdict, calibrate, sample_density,
};

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

/// Root mean square errors of the worst mean (posterior sds), the worst sd (relative) and the log evidence.
fn errors(reference: &Reference, settings: &Settings, seeds: u64) -> [f64; 3] {
    let runs: Vec<_> = (1..=seeds)
        .map(|seed| sample_density(reference, &Settings { seed, ..settings.clone() }).unwrap())
        .collect();
    let d = reference.mean.len();
    let mean =
        (0..d).map(|j| rms(runs.iter().map(|r| (r.mean[j] - reference.mean[j]) / reference.sd[j])));
    let sd = (0..d).map(|j| rms(runs.iter().map(|r| r.sd[j] / reference.sd[j] - 1.0)));
    [
        mean.fold(0.0, f64::max),
        sd.fold(0.0, f64::max),
        rms(runs.iter().map(|r| r.log_evidence.value - reference.log_evidence)),
    ]
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_hundred_simulations_find_narrow_posteriors_that_the_default_sampler_misses() {
    for d in [2, 3, 4] {
        let reference = reference::gaussian(d, 0.8, 0.1);
        let placed = errors(&reference, &Settings::for_budget(100), 5);
        // The process through the log likelihoods of a normal posterior is exact up to its nuggets.
        assert!(placed.iter().all(|error| *error < 0.01), "{d}: {placed:?}");
        let default = Settings { samples: 100, ..Settings::default() };
        let plain = errors(&reference, &default, 5);
        assert!(plain[0] > 10.0 * placed[0], "{d}: {plain:?} {placed:?}");
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_hundred_simulations_find_bent_cut_and_heavy_posteriors() {
    // One run in sixteen can decide.
    for (reference, most) in [
        (reference::banana(), [0.03, 0.07, 0.01]),
        (reference::heavy_tail(), [0.01, 0.01, 0.01]),
        (reference::bounded_ridge(), [0.06, 0.06, 0.03]),
    ] {
        let found = errors(&reference, &Settings::for_budget(100), 16);
        let close = found.iter().zip(&most).all(|(error, most)| error < most);
        assert!(close, "{}: {found:?} {most:?}", reference.name);
    }
}

/// Root mean square of errors over standard errors, each counted as ten at most, of all means.
#[test]
#[ignore = "longer: run by .ci/long"]
fn error_bars_of_a_posterior_that_failures_cut_are_honest_after_fifty_simulations() {
    let reference = reference::bounded_ridge();
    let runs = (1..=16).map(|seed| {
        let settings = Settings { seed, ..Settings::for_budget(50) };
        sample_density(&reference, &settings).unwrap()
    });
    // A calibration of fewer effective samples says that its budget is too small: one run in fifty has two.
    let worth: Vec<_> = runs.filter(|run| run.ess >= 7.0).collect();
    assert!(worth.len() >= 14, "{}", worth.len());
    let z = worth.iter().flat_map(|run| {
        (0..2).map(|j| (run.mean[j] - reference.mean[j]) / run.mean_se[j]).collect::<Vec<_>>()
    });
    let z = rms(z.map(|z| z.clamp(-10.0, 10.0)));
    assert!((0.6..1.5).contains(&z), "{z}");
}

/// The first example of PyVBMC: `ln L = -(x^2 - y)^2 - (x - 1)^2 / 100` under N(0, 3^2) in x and y. Log evidence -2.259 847 by
/// quadrature.
struct Valley;

impl Target for Valley {
    fn dimension(&self) -> usize {
        2
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let (x, y) = (3.0 * z[0], 3.0 * z[1]);
        Ok(-(x * x - y).powi(2) - (x - 1.0).powi(2) / 100.0)
    }
}

#[test]
fn the_evidence_of_a_smooth_valley_is_known_to_a_twentieth_after_a_hundred_calls() {
    let off = |seed| {
        let settings = Settings { seed, ..Settings::for_budget(100) };
        sample_density(&Valley, &settings).unwrap().log_evidence.value + 2.259_847
    };
    let ln_z = rms((1..=2).map(off));
    assert!(ln_z < 0.05, "{ln_z}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_bent_valley_is_known_far_better_after_a_thousand_simulations_than_by_their_weights() {
    // The process leaves a third of the noise there, local quadratics a five-hundredth; weights alone: .04, .09, .02.
    let placed = errors(&reference::banana(), &Settings::for_budget(1024), 2);
    assert!(placed[0] < 0.03 && placed[1] < 0.05 && placed[2] < 0.01, "{placed:?}");
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn two_thousand_simulations_that_a_process_begins_are_as_close_as_they_can_be() {
    // Without the process in the integrals the ridge is .012, .006 and .009 off.
    for (reference, most) in [
        (reference::banana(), [0.006, 0.014, 0.005]),
        (reference::bounded_ridge(), [0.009, 0.006, 0.006]),
        (reference::two_modes(), [0.015, 0.02, 0.01]),
    ] {
        let placed = errors(&reference, &Settings::for_budget(2048), 8);
        assert!(placed.iter().zip(&most).all(|(error, most)| error < most), "{placed:?}");
    }
    let begun = sample_density(&reference::banana(), &Settings::for_budget(2048)).unwrap();
    assert!(begun.components.len() > 20, "small stages first: {:?}", begun.components);
}

#[test]
fn settings_for_thousands_are_the_default_ones_but_for_the_process_that_begins() {
    for samples in [2048, 3000, 8191, 8192, 16_384] {
        let plain = Settings { samples, map_simulations: 0, ..Settings::default() };
        let settings = Settings::for_budget(samples);
        assert_eq!(settings.surrogate, samples < 8192, "{samples}");
        assert_eq!(Settings { surrogate: false, ..settings }, plain);
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn more_parameters_than_a_surrogate_takes_have_a_result_without_one() {
    for (d, samples) in [(13, 34), (13, 3000)] {
        let reference = reference::gaussian(d, 0.1, 0.8);
        let p = sample_density(&reference, &Settings::for_budget(samples)).unwrap();
        assert!(p.mean.iter().all(|mean| mean.is_finite()), "{d} parameters, {samples}");
    }
}

#[test]
fn stages_are_multiples_of_the_batch_and_spend_the_budget() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    for (samples, batch) in [(30, 4), (50, 10), (100, 16), (97, 8), (300, 12), (5, 4), (1, 4)] {
        let settings = Settings { batch, ..Settings::for_budget(samples) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert_eq!(p.samples.len(), samples);
        let sizes: Vec<usize> = p.stages.iter().map(|s| s.simulations).collect();
        let (_, before) = sizes.split_last().unwrap();
        assert!(before.iter().all(|s| s % batch == 0 && *s > 0), "{samples} {batch}: {sizes:?}");
        assert!(p.parameters.iter().all(|x| x.in_coordinate.mean.is_finite()));
    }
}

#[test]
fn one_simulation_more_makes_no_stage_of_a_small_budget_larger_by_more_than_one() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    let sizes_of = |samples: usize, surrogate: bool| -> Vec<usize> {
        let by_default = Settings::for_budget(samples);
        let settings = Settings { max_components: 1, path: false, surrogate, ..by_default };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert_eq!(p.samples.len(), samples);
        p.stages.iter().map(|s| s.simulations).collect()
    };
    // A process has no part in the sizes, and takes most of the time.
    assert_eq!(sizes_of(51, true), sizes_of(51, false));
    let sizes = |samples: usize| sizes_of(samples, false);
    for samples in [4, 30, 49, 50, 51, 73, 99, 100, 101, 150, 151, 199] {
        let (fewer, more) = (sizes(samples), sizes(samples + 1));
        assert!(fewer.len() <= more.len(), "{samples}: {fewer:?} {more:?}");
        let mut pairs = fewer.iter().zip(&more);
        assert!(pairs.all(|(a, b)| a.abs_diff(*b) <= 1), "{fewer:?} {more:?}");
    }
}

#[test]
fn few_runs_of_more_observations_than_are_kept_begin_by_ten_and_of_as_many_by_a_quarter() {
    for (observations, first) in [(512, 7), (513, 10)] {
        let simulator = FnSimulator::new(2, observations, |theta: &[f64], out: &mut [f64]| {
            out.iter_mut().enumerate().for_each(|(i, o)| *o = theta[0] + theta[1] * i as f64);
            Ok::<(), SimError>(())
        });
        let control = (0..observations).map(|i| i as f64).collect();
        let measured = Observations::new(control, vec![1.0; observations]).unwrap();
        let problem =
            Problem { observations: measured, ..line_problem(&simulator, Noise::default()) };
        let settings = Settings { path: false, ..Settings::for_budget(32) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert_eq!(p.stages[0].simulations, first, "{observations} observations");
    }
}

#[test]
fn a_small_run_that_is_extended_to_thousands_goes_on_in_stages_of_default_size_where_a_process_ends()
 {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    // 39 of the run that is extended, and after them those of a large run, or as many as before.
    for (surrogate, stages) in [(true, 47..=60), (false, 61..=100)] {
        let settings = Settings {
            surrogate,
            max_components: 1,
            path: false,
            ..Settings::for_budget(100).extended(3000).unwrap()
        };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert_eq!(p.samples.len(), 3000);
        assert!(stages.contains(&p.stages.len()), "{surrogate}: {}", p.stages.len());
    }
}

#[test]
fn small_budgets_give_the_same_bits_for_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let simulator = knee();
        pool.install(|| calibrate(&knee_problem(&simulator), &Settings::for_budget(80), &mut ()))
            .unwrap()
    };
    assert!(format!("{:?}", run(1)) == format!("{:?}", run(3)));
}

#[test]
fn settings_of_before_are_read_and_default_settings_are_written_as_before() {
    let text = serde_json::to_string(&Settings::default()).unwrap();
    assert!(!text.contains("batch") && !text.contains("surrogate"), "{text}");
    let small = Settings::for_budget(100);
    let text = serde_json::to_string(&small).unwrap();
    assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), small);
    // A budget that the default sampler was made for.
    assert!(!Settings::for_budget(16_384).surrogate);
}

/// Whether anything tells the user not to trust the weights.
fn distrusted(p: &Posterior) -> bool {
    p.trust().concerns.iter().any(|w| {
        matches!(
            w,
            Concern::FewEffectiveSamples { .. }
                | Concern::HighKhat { .. }
                | Concern::BudgetTooSmall { .. }
                | Concern::EvidenceDisagrees { .. }
        )
    })
}

/// Growth by a power law up to a knee, then a straight line up to a plateau: a narrow, bent posterior.
fn knee() -> impl Simulator {
    FnSimulator::new(3, 24, |p: &[f64], out: &mut [f64]| {
        for (i, o) in out.iter_mut().enumerate() {
            let t = 0.1 * (i + 1) as f64;
            let power = (p[0] * t).powf(2.0 / 7.0);
            let x = if power < p[2] { power } else { p[2] + (t - p[2].powf(3.5) / p[0]) / p[1] };
            *o = x.min(1.2);
        }
        Ok::<(), SimError>(())
    })
}

fn knee_problem(simulator: &dyn Simulator) -> Problem<'_> {
    let mut values = vec![0.0; 24];
    simulator.simulate(&[0.1, 4.0, 0.55], &mut values).unwrap();
    values.iter_mut().enumerate().for_each(|(i, v)| *v += 0.004 * (2.7 * i as f64).sin());
    let log = |lower, upper| prior(PriorSpec::LogUniform { lower, upper });
    Problem {
        simulator,
        parameters: vec![
            Parameter::new("rate", "1/s", log(1e-4, 1e2)),
            Parameter::new("time", "s", log(0.1, 100.0)),
            Parameter::new("knee", "1", log(0.01, 2.0)),
        ],
        observations: Observations::new((1..=24).map(|i| 0.1 * f64::from(i)).collect(), values)
            .unwrap(),
        noise: Noise::Inferred { nu0: 4.0, s0: 0.005 },
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn fifty_simulations_of_a_hard_problem_are_said_to_be_too_few() {
    let simulator = knee();
    let problem = knee_problem(&simulator);
    for seed in 1..=2 {
        let settings = Settings { seed, ..Settings::for_budget(50) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        let said = p.trust().concerns.iter().any(|w| matches!(w, Concern::BudgetTooSmall { .. }));
        assert!(
            said && distrusted(&p),
            "seed {seed}: {:?} {}",
            p.trust().concerns,
            p.ess.importance
        );
    }
}

#[test]
fn the_evidence_from_samples_alone_is_kept_beside_that_with_a_part_of_the_process() {
    // y_i = a + b t_i + noise of 0.1: a process knows it well.
    let times = [-1.0, -0.5, 0.0, 0.5, 1.0];
    let simulator = FnSimulator::new(2, 5, move |x: &[f64], out: &mut [f64]| {
        out.iter_mut().zip(times).for_each(|(o, t)| *o = x[0] + x[1] * t);
        Ok::<(), SimError>(())
    });
    let normal = || prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 });
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![Parameter::new("a", "1", normal()), Parameter::new("b", "1", normal())],
        observations: Observations::new(times.to_vec(), vec![0.1, 0.4, 0.7, 0.9, 1.3]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.1) },
    };
    for seed in 1..=4 {
        let settings = Settings { seed, ..Settings::for_budget(40) };
        let e = calibrate(&problem, &settings, &mut ()).unwrap().log_evidence;
        let cross_fitted = e.cross_fitted_value.expect("few effective samples");
        let apart = (e.value - cross_fitted).abs();
        assert!(e.process_value.is_some() && 1e-9 < apart && apart < 0.02, "seed {seed}: {e:?}");
    }
}

#[test]
fn three_hundred_simulations_of_an_easy_problem_are_enough_and_right() {
    // y = x + noise of 0.1, x ~ N(0, 1): mean y/1.01, sd 0.1/sqrt(1.01).
    let simulator = FnSimulator::new(1, 1, |x: &[f64], out: &mut [f64]| {
        out[0] = x[0];
        Ok::<(), SimError>(())
    });
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![Parameter::new("x", "1", prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 }))],
        observations: Observations::new(vec![0.0], vec![0.8]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.1) },
    };
    let sd = 0.1 / 1.01f64.sqrt();
    for seed in 1..=2 {
        let settings = Settings { seed, ..Settings::for_budget(300) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert!(!distrusted(&p), "seed {seed}: {:?}", p.trust().concerns);
        let x = p.parameters[0].in_coordinate;
        assert!((x.mean - 0.8 / 1.01).abs() < 0.2 * sd && (x.sd / sd - 1.0).abs() < 0.1, "{x:?}");
        // Nothing was simulated but the samples.
        assert_eq!((p.counters.simulations, p.counters.map_simulations), (300, 0));
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn failing_simulations_do_not_stop_a_small_budget() {
    // A third of the prior cannot be simulated; the posterior ends at its edge.
    let simulator = FnSimulator::new(2, 12, |p: &[f64], out: &mut [f64]| {
        if p[0] > 0.32 {
            return Err(SimError::recoverable("does not start"));
        }
        for (i, o) in out.iter_mut().enumerate() {
            *o = p[0] + 0.1 * p[1] * i as f64;
        }
        Ok(())
    });
    let problem = line_problem(&simulator, Noise::default());
    // The default sampler with many: a grid resolves the edge no better than its cells.
    let many = calibrate(&problem, &Settings::default(), &mut ()).unwrap();
    assert!(many.khat < 0.5 && many.ess.importance > 4000.0);
    let mut errors = Vec::new();
    for seed in 1..=5 {
        let settings = Settings { seed, ..Settings::for_budget(200) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        for j in 0..2 {
            let x = p.parameters[j].in_coordinate;
            let exact = many.parameters[j].in_coordinate;
            errors.push((x.mean - exact.mean) / exact.sd);
        }
        assert!(p.failures[0].count < 150, "{:?}", p.failures);
    }
    assert!(rms(errors.iter().copied()) < 0.25, "{errors:?}");
}

/// Errors of median and ends of the 95 % interval, and their standard errors, in posterior sds.
fn of_interval(p: &Posterior, j: usize, sd: f64, exact: [f64; 3]) -> [[f64; 2]; 3] {
    let of = p.parameters[j].in_coordinate;
    let [lower, median, upper] = exact;
    [
        [of.eti95.lower - lower, of.eti95.lower_se],
        [of.median - median, of.median_se],
        [of.eti95.upper - upper, of.eti95.upper_se],
    ]
    .map(|pair| pair.map(|x| x / sd))
}

/// By fifty weighted samples, of twenty effective ones, ends of intervals are known to half a standard deviation.
#[test]
#[ignore = "long: run by .ci/run"]
fn intervals_after_fifty_simulations_are_known_and_as_well_as_they_say() {
    let simulator = line();
    let line = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let conjugate = exact(0.05);
    // y = e^x + noise of 0.5, x ~ N(0, 1): skewed.
    let exponential = FnSimulator::new(1, 1, |x: &[f64], out: &mut [f64]| {
        out[0] = x[0].exp();
        Ok::<(), SimError>(())
    });
    let skewed = Problem {
        simulator: &exponential,
        parameters: vec![Parameter::new("x", "1", prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 }))],
        observations: Observations::new(vec![0.0], vec![1.0]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.5) },
    };
    let by_quadrature = quadrature(&skewed, &QuadratureSettings::default()).unwrap();
    let of_skewed = [0, 3, 6].map(|k| by_quadrature.quantiles[0][k]);
    let mut found = Vec::new();
    for seed in 1..=3 {
        let settings = Settings { seed, ..Settings::for_budget(50) };
        let p = calibrate(&line, &settings, &mut ()).unwrap();
        for j in 0..2 {
            let (mean, sd) = (conjugate.mean[j], conjugate.covariance[(j, j)].sqrt());
            found.extend(of_interval(
                &p,
                j,
                sd,
                [-1.959_964, 0.0, 1.959_964].map(|s| mean + s * sd),
            ));
        }
        let p = calibrate(&skewed, &settings, &mut ()).unwrap();
        found.extend(of_interval(&p, 0, by_quadrature.sd[0], of_skewed));
    }
    let error = rms(found.iter().map(|[off, _]| *off));
    let z = rms(found.iter().map(|[off, se]| off / se));
    assert!(error < 0.03 && (0.3..1.5).contains(&z), "{error} {z}: {found:?}");
}

#[test]
fn what_few_samples_do_not_know_and_a_process_does_is_rough_unless_the_budget_was_too_small() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let mut p = calibrate(&problem, &Settings::for_budget(50), &mut ()).unwrap();
    assert!(p.ess.importance < 40.0 && p.ess.by_errors.is_some_and(|draws| draws > 400.0));
    let few = |p: &Posterior| {
        p.trust().concerns.into_iter().find_map(|concern| match concern {
            Concern::FewEffectiveSamples { by_errors, .. } => Some(by_errors),
            _ => None,
        })
    };
    let trust = p.trust();
    assert_eq!((trust.verdict, trust.evidence_error_known), (Verdict::Rough, true));
    // Means, medians and evidence are known at least as well as intervals too.
    assert!(few(&p).is_some_and(|centre| centre >= p.ess.by_errors), "{:?}", few(&p));
    let line = trust.line(&p.log_evidence);
    assert!(line.contains("known as by") && line.contains("+-"), "{line}");
    // Weights with a heavy tail have no part in it.
    (p.khat, p.parameters[0].khat, p.parameters[0].tail_share) = (0.9, 0.9, 0.5);
    assert_eq!(p.trust().verdict, Verdict::Rough);
    // Known as by fewer than two draws; known well by a budget that was too small; not known by a process.
    let known = p.log_evidence;
    p.log_evidence.se = 0.71;
    assert_eq!((p.trust().verdict, few(&p)), (Verdict::Untrusted, Some(None)));
    (p.log_evidence, p.ess.importance) = (known, 6.9);
    assert_eq!(p.trust().verdict, Verdict::Rough);
    p.log_evidence.process_value = known.cross_fitted_value.map(|value| value + 1.01);
    assert_eq!((p.trust().verdict, few(&p)), (Verdict::Untrusted, Some(None)));
    (p.log_evidence, p.ess.by_errors, p.ess.importance) = (known, None, 39.9);
    assert_eq!((p.trust().verdict, few(&p)), (Verdict::Untrusted, Some(None)));
}

#[test]
fn weights_are_held_against_the_process_where_few_are_effective_or_their_tail_is_heavy() {
    let simulator = FnSimulator::new(2, 3, |x: &[f64], out: &mut [f64]| {
        out.copy_from_slice(&[x[0], x[0] + 0.3 * x[1], x[0] - 0.3 * x[1]]);
        Ok::<(), SimError>(())
    });
    // Errors about their prior scale beyond a fit that is next to perfect: a posterior with the tails of Student's t.
    let problem = Problem {
        observations: Observations::new(vec![0.0; 3], vec![0.1, 0.12, 0.11]).unwrap(),
        ..line_problem(&simulator, Noise::Inferred { nu0: 1.0, s0: 0.005 })
    };
    let of = |samples, seed| {
        let settings = Settings { seed, ..Settings::for_budget(samples) };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        let heavy = |of: &ParameterSummary| of.khat >= KHAT_LIMIT && of.tail_share >= TAIL_SHARE;
        let heavy = p.parameters.iter().any(heavy);
        let few = p.ess.importance < HELD_AGAINST_PROCESS;
        let (trust, e) = (p.trust(), p.log_evidence);
        assert_eq!(e.process_value.is_some(), few || heavy, "{samples} {seed}: {few} {heavy}");
        // What the process says as well is no budget that was too small.
        assert!(trust.verdict != Verdict::Untrusted, "{samples} {seed}: {trust:?}");
        assert_eq!(trust.concerns.iter().any(|c| matches!(c, Concern::HighKhat { .. })), heavy);
        (few, heavy)
    };
    assert_eq!([of(40, 1).0, of(40, 2).0], [true; 2]);
    assert_eq!([of(64, 1), of(64, 2)], [(false, true), (false, false)]);
}
