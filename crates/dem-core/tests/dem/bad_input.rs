//! Input over many decades, and input that is wrong.

use dem_core::{
    Damping, Kinetics, PairSpec, Powder, SceneError, Sintering, SolveError, SolverKind,
    SolverSettings, choose_solver, contact_ratios, knee, paper, simulate, time_to_contact_ratio,
    verlet_batch,
};
use proptest::array::{uniform4, uniform5};
use proptest::prelude::*;

/// Numbers of every size, NaN and infinity included.
fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => (-30.0..30.0f64).prop_map(|e| 10f64.powf(e)),
        1 => proptest::num::f64::ANY,
        1 => proptest::sample::select(vec![
            0.0, -0.0, -1.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::INFINITY, f64::NAN,
        ]),
    ]
}

fn any_kinetics() -> impl Strategy<Value = Kinetics> {
    proptest::sample::select(Kinetics::ALL.to_vec())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    #[test]
    fn a_curve_of_any_parameters_is_finite_and_monotone_or_refused(
        kinetics in any_kinetics(),
        kind in proptest::sample::select(SolverKind::ALL.to_vec()),
        [c1, tau_s, delta_c, end] in uniform4(any_number()),
        phi in 0.4..1.5f64,
        radius in -7.0..-3.0f64,
    ) {
        let powder = Powder { radius_m: 10f64.powf(radius), ..paper::PA12 };
        let scene = PairSpec::new(powder, phi).build().expect("valid");
        let s = Sintering { c1, tau_s, delta_c, lambda: 0.0 };
        let times: Vec<f64> = (0..20).map(|i| end * (f64::from(i) / 19.0).powi(4)).collect();
        let settings = SolverSettings { max_work: 3000, ..SolverSettings::of(kind) };
        let _ = knee(&scene, &s);
        let _ = time_to_contact_ratio(&scene, kinetics, &s, 0.5);
        match simulate(&scene, kinetics, &s, &settings, &times) {
            Ok(curve) => {
                let mut out = vec![0.0; 20];
                contact_ratios(&scene, kinetics, &s, &settings, &times, &mut out).expect("as before");
                prop_assert!(out.iter().all(|a| a.is_finite()));
                let overlaps = curve.overlap_m.iter().chain(&curve.plastic_overlap_m);
                prop_assert!(overlaps.clone().all(|x| x.is_finite() && *x >= 0.0));
                for (a, b) in curve.contact_ratio.iter().zip(&out) {
                    prop_assert!((a - b).abs() <= 1e-15 * a, "{a} {b}");
                }
                if kind != SolverKind::Verlet {
                    prop_assert!(out.is_sorted(), "{out:?}");
                    prop_assert!(out.iter().all(|&a| a <= phi * (1.0 + 1e-15)), "{out:?}");
                    prop_assert!((out[0] - scene.start_contact_ratio()).abs() < 1e-13);
                } else {
                    prop_assert!(out.iter().all(|&a| a < 2.0 * phi), "{out:?}");
                }
            }
            Err(error) => prop_assert!(error.to_string().len() > 20),
        }
    }

    #[test]
    fn a_scene_of_any_numbers_does_not_panic(
        [r, e, gamma, rho, phi] in uniform5(any_number()),
        [k1, k2, kc, fa, damping] in uniform5(any_number()),
        coefficient in any::<bool>(),
        kinetics in any_kinetics(),
    ) {
        let powder = Powder {
            radius_m: r,
            youngs_modulus_pa: e,
            surface_tension_n_per_m: gamma,
            density_kg_per_m3: rho,
        };
        let spec = PairSpec {
            k1,
            k2_max_over_k1: 1.0 + k2,
            kc_over_k1: kc,
            adhesion_over_k1_radius: fa,
            damping: if coefficient { Damping::Coefficient(damping) } else { Damping::Restitution(damping) },
            ..PairSpec::new(powder, phi)
        };
        if let Ok(scene) = spec.build() {
            prop_assert!(scene.collision_time_s() > 0.0 && scene.collision_time_s().is_finite());
            let s = Sintering { c1: 1e-5, tau_s: 1.0, delta_c: 1e-7, lambda: 0.0 };
            let times = [0.0, 0.1, 1.0];
            for kind in SolverKind::ALL {
                let settings = SolverSettings {
                    max_work: 2000,
                    step_over_collision_time: 0.5 * scene.step_limit_s() / scene.collision_time_s(),
                    ..SolverSettings::of(kind)
                };
                if let Ok(curve) = simulate(&scene, kinetics, &s, &settings, &times) {
                    prop_assert!(curve.contact_ratio.iter().all(|a| a.is_finite()), "{kind} {curve:?}");
                }
            }
        }
    }
}

#[test]
fn a_wrong_field_is_named_with_its_value() {
    let good = PairSpec::new(paper::PS, 1.08);
    let message = |spec: PairSpec| spec.build().expect_err("wrong").to_string();
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 5e-324] {
        let powder = |powder| PairSpec { powder, ..good };
        let shown = value.to_string();
        for (field, spec) in [
            ("radius_m", powder(Powder { radius_m: value, ..paper::PS })),
            ("youngs_modulus_pa", powder(Powder { youngs_modulus_pa: value, ..paper::PS })),
            (
                "surface_tension_n_per_m",
                powder(Powder { surface_tension_n_per_m: value, ..paper::PS }),
            ),
            ("density_kg_per_m3", powder(Powder { density_kg_per_m3: value, ..paper::PS })),
            ("final_contact_ratio", PairSpec { final_contact_ratio: value, ..good }),
            ("k1", PairSpec { k1: value, ..good }),
            ("k2_max_over_k1", PairSpec { k2_max_over_k1: value, ..good }),
            ("adhesion_over_k1_radius", PairSpec { adhesion_over_k1_radius: value, ..good }),
            ("damping (restitution)", PairSpec { damping: Damping::Restitution(value), ..good }),
        ] {
            let said = message(spec);
            assert!(said.starts_with(field) && said.contains(&shown), "{said}");
        }
    }
    let tiny = PairSpec { final_contact_ratio: 0.03, ..good };
    assert!(matches!(
        PairSpec { k2_max_over_k1: 1.1, ..tiny }.build(),
        Err(SceneError::StartsCoalesced { .. })
    ));
    assert!(matches!(tiny.build(), Err(SceneError::FoldedEquilibrium { .. })));
}

#[test]
fn a_wrong_run_is_refused_with_its_place() {
    let scene = PairSpec::new(paper::PS, 1.08).build().expect("valid");
    let s = Sintering { c1: 1e-4, tau_s: 0.1, delta_c: 1e-7, lambda: 0.0 };
    let run = |s: &Sintering, settings: &SolverSettings, times: &[f64]| {
        simulate(&scene, Kinetics::ThreeStage, s, settings, times).expect_err("wrong")
    };
    let closed = SolverSettings::default();
    assert_eq!(run(&s, &closed, &[]), SolveError::NoTimes);
    assert!(matches!(run(&s, &closed, &[0.0, f64::NAN]), SolveError::Time { index: 1, .. }));
    assert!(matches!(run(&s, &closed, &[-1.0]), SolveError::Time { index: 0, .. }));
    assert!(matches!(run(&s, &closed, &[0.0, f64::INFINITY]), SolveError::Time { index: 1, .. }));
    assert!(matches!(
        run(&s, &closed, &[1.0, 2.0, 1.5]),
        SolveError::UnsortedTimes { index: 2, .. }
    ));
    for (field, wrong) in [
        ("c1", Sintering { c1: f64::NAN, ..s }),
        ("tau_s", Sintering { tau_s: 0.0, ..s }),
        ("delta_c", Sintering { delta_c: -1.0, ..s }),
    ] {
        let error = run(&wrong, &closed, &[1.0]);
        assert!(matches!(error, SolveError::Field { field: f, .. } if f == field), "{error}");
        assert!(error.is_recoverable());
    }
    let quasi = SolverSettings { tolerance: 0.0, ..SolverSettings::of(SolverKind::QuasiStatic) };
    assert!(matches!(run(&s, &quasi, &[1.0]), SolveError::Field { field: "tolerance", .. }));
    let limit = scene.step_limit_s() / scene.collision_time_s();
    let verlet = |step_over_collision_time, max_work| SolverSettings {
        step_over_collision_time,
        max_work,
        ..SolverSettings::of(SolverKind::Verlet)
    };
    let coarse = run(&s, &verlet(1.0001 * limit, 1000), &[1.0]);
    assert!(matches!(coarse, SolveError::UnstableStep { .. }) && !coarse.is_recoverable());
    assert!(
        simulate(&scene, Kinetics::ThreeStage, &s, &verlet(0.999 * limit, 10_000_000), &[1.0])
            .is_ok()
    );
    // Undamped the limit is 0.2013 collision times.
    let undamped =
        PairSpec { damping: Damping::Restitution(1.0), ..PairSpec::new(paper::PS, 1.08) };
    let undamped = undamped.build().expect("valid");
    assert!((undamped.step_limit_s() / undamped.collision_time_s() - 0.2013).abs() < 1e-4);
    for step in [0.0, f64::NAN, -0.02] {
        assert!(matches!(run(&s, &verlet(step, 1000), &[1.0]), SolveError::Field { .. }));
    }
    let tired = run(&s, &verlet(0.02, 100), &[1.0]);
    assert!(matches!(tired, SolveError::WorkLimit { max_work: 100, .. }) && tired.is_recoverable());
    let mut short = [0.0];
    assert_eq!(
        contact_ratios(&scene, Kinetics::Frenkel, &s, &closed, &[0.0, 1.0], &mut short),
        Err(SolveError::OutputLength { out: 1, times: 2 })
    );
    assert_eq!(
        verlet_batch(&scene, Kinetics::Frenkel, &[s, s], &closed, &[0.0, 1.0], &mut short),
        Err(SolveError::OutputLength { out: 1, times: 4 })
    );
}

#[test]
fn the_choice_of_a_solver_is_explained() {
    let scene = PairSpec::new(paper::PS, 1.08).build().expect("valid");
    for tolerance in [1e-4, 1e-16, f64::NAN] {
        let choice = choose_solver(&scene, Kinetics::Pokluda, tolerance);
        assert_eq!(choice.kind, SolverKind::ClosedForm);
        assert!(choice.reason.contains("pokluda") && choice.reason.len() > 60);
    }
}
