//! Runs that cannot succeed end with a reason; results that cannot be trusted say so.

use crate::support::{line, line_problem, prior};
use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::{
    CalibrateError, Concern, FixedSigma, FnSimulator, Noise, Observations, Parameter, PriorSpec,
    Problem, Settings, SimError, StageRecord, StopReason, calibrate, leave_one_out,
    predictive_band,
};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

fn small() -> Settings {
    Settings { samples: 1024, ..Settings::default() }
}

fn one_parameter<'a>(simulator: &'a dyn smc_calib::Simulator, noise: Noise) -> Problem<'a> {
    Problem {
        simulator,
        parameters: vec![Parameter::new(
            "x",
            "1",
            prior(PriorSpec::Uniform { lower: 0.0, upper: 1.0 }),
        )],
        observations: Observations::new(vec![0.0, 1.0], vec![0.5, 0.5]).unwrap(),
        noise,
    }
}

#[test]
fn a_simulator_that_always_fails_is_an_error_that_names_the_cause() {
    let simulator = FnSimulator::new(1, 2, |_: &[f64], _: &mut [f64]| {
        Err(SimError::recoverable("no converged step"))
    });
    match calibrate(&one_parameter(&simulator, Noise::default()), &small(), &mut ()) {
        Err(CalibrateError::TooManyFailures { failed, simulations, commonest }) => {
            assert!(failed == simulations && commonest == "no converged step");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_fatal_error_stops_the_run() {
    let simulator =
        FnSimulator::new(1, 2, |_: &[f64], _: &mut [f64]| Err(SimError::fatal("disk full")));
    assert!(matches!(
        calibrate(&one_parameter(&simulator, Noise::default()), &small(), &mut ()),
        Err(CalibrateError::Fatal { cause, .. }) if cause == "disk full"
    ));
}

#[test]
fn nan_outputs_are_failures_and_half_of_them_leaves_the_right_posterior() {
    // Fails above one half: the posterior is the uniform prior cut there, mean one quarter.
    let simulator = FnSimulator::new(1, 2, |theta: &[f64], out: &mut [f64]| {
        out.fill(if theta[0] > 0.5 { f64::NAN } else { 0.5 });
        Ok(())
    });
    let p = calibrate(&one_parameter(&simulator, Noise::default()), &small(), &mut ()).unwrap();
    assert!(
        (p.parameters[0].in_coordinate.mean - 0.25).abs() < 0.01,
        "{:?}",
        p.parameters[0].in_coordinate
    );
    assert!(p.failures.len() == 1 && p.failures[0].count > 50, "{:?}", p.failures);
    assert!(
        p.samples.iter().all(|s| s.weight.is_finite() && (s.theta[0] <= 0.5 || s.weight == 0.0))
    );
}

#[test]
fn zero_evidence_is_an_error() {
    let simulator = FnSimulator::new(1, 2, |_: &[f64], out: &mut [f64]| {
        out.fill(1e200);
        Ok(())
    });
    let problem = one_parameter(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(1e-200) });
    assert!(matches!(
        calibrate(&problem, &small(), &mut ()),
        Err(CalibrateError::ZeroEvidence { .. })
    ));
}

#[test]
fn a_flat_likelihood_returns_the_prior_and_says_nothing_was_learned() {
    let simulator = FnSimulator::new(1, 2, |_: &[f64], out: &mut [f64]| {
        out.fill(0.5);
        Ok(())
    });
    let p = calibrate(&one_parameter(&simulator, Noise::default()), &small(), &mut ()).unwrap();
    let x = &p.parameters[0];
    assert!(
        (x.in_coordinate.mean - 0.5).abs() < 0.01 && (x.in_coordinate.sd - x.prior_sd).abs() < 0.01
    );
    assert!(
        p.trust().concerns.iter().any(|w| matches!(w, Concern::NotInformed { .. })),
        "{:?}",
        p.trust().concerns
    );
    // All weights are alike, and nothing is wrong with them.
    assert!(p.khat < 0.5 && p.ess.per_simulation > 0.5, "{} {:?}", p.khat, p.ess);
}

#[test]
fn log_likelihoods_of_minus_thousands_do_not_underflow() {
    // Noise so small that the log likelihood spans 10^4 and more.
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(1e-3) });
    let p =
        calibrate(&problem, &Settings { samples: 8192, ..Settings::default() }, &mut ()).unwrap();
    assert!(p.log_evidence.value < -1000.0 && p.log_evidence.value.is_finite());
    assert!(p.ess.importance > 1000.0 && p.khat < 0.7, "{:?} {}", p.ess, p.khat);
    assert!(p.trust().concerns.iter().any(|w| matches!(w, Concern::PoorFit { .. })));
}

#[test]
fn a_budget_too_small_for_a_needle_is_warned_about() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(1e-6) });
    let p = calibrate(&problem, &Settings { samples: 64, ..Settings::default() }, &mut ()).unwrap();
    assert!(
        p.trust().concerns.iter().any(|w| matches!(w, Concern::FewEffectiveSamples { .. })),
        "{:?}",
        p.trust().concerns
    );
    assert!(
        p.trust().concerns.iter().any(|w| matches!(w, Concern::HighKhat { .. })),
        "{:?}",
        p.trust().concerns
    );
}

#[test]
fn any_small_number_of_samples_ends_well() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    for samples in [1, 2, 3, 7, 15, 16, 17, 100, 255, 300] {
        let p = calibrate(&problem, &Settings { samples, ..Settings::default() }, &mut ()).unwrap();
        assert_eq!(p.samples.len(), samples);
        assert!((p.samples.iter().map(|s| s.weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(samples > 100 || !p.trust().concerns.is_empty());
    }
}

#[test]
fn the_observer_sees_every_stage_and_can_end_the_run() {
    struct Stop(usize);
    impl smc_calib::Observer for Stop {
        fn stage(&mut self, record: &StageRecord) -> ControlFlow<()> {
            self.0 += 1;
            if record.stage == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    let mut stop = Stop(0);
    let p =
        calibrate(&problem, &Settings { samples: 4096, ..Settings::default() }, &mut stop).unwrap();
    assert!(stop.0 == 5 && p.stages.len() == 5 && p.stop == StopReason::Interrupted);
    let p = calibrate(
        &problem,
        &Settings { samples: 16_384, ess_target: Some(200.0), ..Settings::default() },
        &mut (),
    )
    .unwrap();
    assert!(
        p.stop == StopReason::EssReached
            && p.counters.simulations < 16_384
            && p.ess.importance >= 200.0
    );
}

#[test]
fn tuned_weights_are_labelled_and_too_narrow() {
    let simulator = line();
    let settings = Settings { samples: 4096, ..Settings::default() };
    let tuned =
        calibrate(&line_problem(&simulator, Noise::EssTarget { share: 0.3 }), &settings, &mut ())
            .unwrap();
    let right = calibrate(&line_problem(&simulator, Noise::default()), &settings, &mut ()).unwrap();
    assert!(!tuned.is_posterior && tuned.trust().concerns.contains(&Concern::NotAPosterior));
    let ratio = right.parameters[0].in_coordinate.sd / tuned.parameters[0].in_coordinate.sd;
    assert!(ratio > 2.0, "the artefact of uncorrected proposals is gone: {ratio}");
}

#[test]
fn mismatched_sizes_and_settings_out_of_range_are_refused() {
    let simulator = line();
    let mut problem = line_problem(&simulator, Noise::default());
    let wrong = Settings { defensive_share: 0.0, ..small() };
    assert!(matches!(calibrate(&problem, &wrong, &mut ()), Err(CalibrateError::Setting { .. })));
    let none = Settings { samples: 0, ..small() };
    assert!(matches!(calibrate(&problem, &none, &mut ()), Err(CalibrateError::Setting { .. })));
    problem.noise = Noise::Inferred { nu0: -1.0, s0: 0.05 };
    assert!(matches!(calibrate(&problem, &small(), &mut ()), Err(CalibrateError::Noise(_))));
    problem.noise = Noise::default();
    problem.parameters.pop();
    assert!(matches!(
        calibrate(&problem, &small(), &mut ()),
        Err(CalibrateError::Parameters { .. })
    ));
}

/// Two parameters whose simulations are interrupted from the `end`-th on.
fn interrupted_from(end: usize) -> impl smc_calib::Simulator {
    let count = AtomicUsize::new(0);
    FnSimulator::new(2, 12, move |theta: &[f64], out: &mut [f64]| {
        if count.fetch_add(1, Ordering::SeqCst) >= end {
            return Err(SimError::Interrupted);
        }
        for (i, o) in out.iter_mut().enumerate() {
            *o = theta[0] + theta[1] * 0.1 * i as f64;
        }
        Ok(())
    })
}

#[test]
fn an_interruption_ends_a_run_at_any_simulation_with_the_stages_that_were_finished() {
    let whole = calibrate(
        &line_problem(&interrupted_from(usize::MAX), Noise::default()),
        &small(),
        &mut (),
    )
    .unwrap();
    let all = 1024 + whole.counters.map_simulations;
    assert!(all > 1100, "the search for the MAP takes simulations too: {all}");
    let first = whole.stages[0].total;
    // The first simulation, both sides of the first stage's end, the final stage, the search, the MAP's own curve.
    for end in [0, first - 1, first, 1023, 1024, 1100, all - 1] {
        let simulator = interrupted_from(end);
        let run = calibrate(&line_problem(&simulator, Noise::default()), &small(), &mut ());
        let Err(CalibrateError::Interrupted { stages }) = run else { panic!("{end}: {run:?}") };
        let finished: Vec<_> = whole.stages.iter().filter(|s| s.total <= end).cloned().collect();
        assert_eq!(stages, finished, "{end}");
    }
    let simulator = interrupted_from(all);
    assert!(calibrate(&line_problem(&simulator, Noise::default()), &small(), &mut ()).is_ok());
}

#[test]
fn an_interruption_is_no_failure_of_the_model() {
    // Half of the simulations fail before; were it counted among them the run would go on, or end as failed.
    let simulator = FnSimulator::new(1, 2, |theta: &[f64], out: &mut [f64]| {
        out.fill(0.5);
        match theta[0] {
            x if x > 0.9 => Err(SimError::Interrupted),
            x if x > 0.5 => Err(SimError::recoverable("too far")),
            _ => Ok(()),
        }
    });
    let error = calibrate(&one_parameter(&simulator, Noise::default()), &small(), &mut ());
    assert!(matches!(error, Err(CalibrateError::Interrupted { stages }) if stages.is_empty()));
    assert!(!SimError::Interrupted.is_recoverable());
    assert_eq!(SimError::Interrupted.cause(), SimError::Interrupted.to_string());
}

#[test]
fn an_interrupted_curve_ends_bands_quadrature_and_leaving_out() {
    let fine = interrupted_from(usize::MAX);
    let problem = line_problem(&fine, Noise::default());
    let p = calibrate(&problem, &small(), &mut ()).unwrap();
    let stopped = interrupted_from(0);
    let control: Vec<f64> = (0..12).map(f64::from).collect();
    assert_eq!(predictive_band(&p, &stopped, &control, 10), Err(SimError::Interrupted));
    let problem = line_problem(&stopped, Noise::default());
    let interrupted = CalibrateError::Interrupted { stages: Vec::new() };
    assert_eq!(leave_one_out(&problem, &p), Err(interrupted.clone()));
    assert_eq!(quadrature(&problem, &QuadratureSettings::default()), Err(interrupted));
}
