//! What cannot succeed ends with a reason; what should not be trusted says so.

use crate::support::{line, line_problem, prior};
use smc_calib::{
    CalibrateError, FixedSigma, FnSimulator, Noise, Observations, Parameter, PriorSpec, Problem,
    Settings, SimError, StageRecord, StopReason, Warning, calibrate,
};
use std::ops::ControlFlow;

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
        p.warnings.iter().any(|w| matches!(w, Warning::NotInformed { .. })),
        "{:?}",
        p.warnings
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
    assert!(p.warnings.iter().any(|w| matches!(w, Warning::PoorFit { .. })));
}

#[test]
fn a_budget_too_small_for_a_needle_is_warned_about() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(1e-6) });
    let p = calibrate(&problem, &Settings { samples: 64, ..Settings::default() }, &mut ()).unwrap();
    assert!(
        p.warnings.iter().any(|w| matches!(w, Warning::FewEffectiveSamples { .. })),
        "{:?}",
        p.warnings
    );
    assert!(p.warnings.iter().any(|w| matches!(w, Warning::HighKhat { .. })), "{:?}", p.warnings);
}

#[test]
fn any_small_number_of_samples_ends_well() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    for samples in [1, 2, 3, 7, 15, 16, 17, 100, 255, 300] {
        let p = calibrate(&problem, &Settings { samples, ..Settings::default() }, &mut ()).unwrap();
        assert_eq!(p.samples.len(), samples);
        assert!((p.samples.iter().map(|s| s.weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(samples > 100 || !p.warnings.is_empty());
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
    assert!(!tuned.is_posterior && tuned.warnings.contains(&Warning::NotAPosterior));
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
