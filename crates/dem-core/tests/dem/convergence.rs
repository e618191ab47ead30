//! The solvers with steps against independent references and against each other.

use crate::kinetics::reference_time;
use crate::reference::{integrate, largest_difference, materials, motion, quasi_static, verlet};
use dem_core::{
    Damping, Kinetics, PairScene, PairSpec, Sintering, SolverSettings, StopReason, contact_ratios,
    paper, simulate, verlet_batch,
};

fn ratios(
    scene: &PairScene,
    kinetics: Kinetics,
    s: &Sintering,
    settings: &SolverSettings,
    times: &[f64],
) -> Vec<f64> {
    let mut out = vec![0.0; times.len()];
    contact_ratios(scene, kinetics, s, settings, times, &mut out).expect("valid");
    out
}

#[test]
fn quasi_static_error_is_within_the_tolerance_and_its_own_estimate() {
    for (scene, s) in materials() {
        for kinetics in Kinetics::ALL {
            let (mut times, mut expected) = (vec![], vec![]);
            for i in 0..150 {
                let share = (f64::from(i) / 150.0).powi(3);
                let x = scene.x0() + share * (0.999 * scene.final_overlap() - scene.x0());
                times.push(reference_time(&scene, kinetics, &s, x));
                expected.push(x.sqrt());
            }
            let mut errors = vec![];
            for tolerance in [1e-3, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10] {
                let mut found = vec![0.0; times.len()];
                let settings = quasi_static(tolerance);
                let report = contact_ratios(&scene, kinetics, &s, &settings, &times, &mut found)
                    .expect("valid");
                let error = largest_difference(&expected, &found);
                let estimate = report.error_estimate.expect("the solver has one");
                assert!(error <= tolerance, "{kinetics} at {tolerance}: {error}");
                assert!(error <= estimate + 1e-13, "{kinetics} at {tolerance}: {error} {estimate}");
                errors.push(error);
            }
            // Proportional: four decades of tolerance are about four of error.
            let decades = (errors[2] / errors[6]).log10();
            assert!((2.5..6.0).contains(&decades), "{kinetics}: {decades} decades, {errors:?}");
        }
    }
}

#[test]
fn quasi_static_meets_the_knee_of_very_slow_and_very_fast_zipping() {
    let (scene, s) = materials()[1].clone();
    for (c1, delta_c) in [(1e-3, 1.0), (1e-1, 3.0), (1e4, 0.3), (1e3, 1.0), (1e-2, 10.0)] {
        let s = Sintering { c1: c1 * s.c1, delta_c: delta_c * s.delta_c, ..s };
        for kinetics in [Kinetics::ThreeStage, Kinetics::ThreeStagePokluda] {
            let end = reference_time(&scene, kinetics, &s, 1.5);
            let knee = dem_core::knee(&scene, &s).time_s;
            let times: Vec<f64> = (0..200)
                .map(|i| f64::from(i) / 199.0)
                .map(|at| {
                    if at < 0.5 { knee * 2.0 * at } else { knee + (end - knee) * (2.0 * at - 1.0) }
                })
                .collect();
            // The closed form is held against quadrature elsewhere.
            let exact = ratios(&scene, kinetics, &s, &SolverSettings::default(), &times);
            for tolerance in [1e-4, 1e-6, 1e-8] {
                let found = ratios(&scene, kinetics, &s, &quasi_static(tolerance), &times);
                let error = largest_difference(&exact, &found);
                assert!(error <= tolerance, "{kinetics} {c1} {delta_c} at {tolerance}: {error}");
            }
        }
    }
}

#[test]
fn verlet_is_of_second_order_where_the_motion_is_smooth() {
    for (scene, s) in &materials()[..2] {
        // Slow zipping, whose first relaxation the steps resolve, and stretching alone; and zipping
        // from its singular start, where the relaxation of the contact is far shorter than any step.
        let slow = Sintering { c1: 1e-4 * s.c1, ..*s };
        for (kinetics, s, until, lowest) in [
            (Kinetics::ThreeStage, &slow, 0.1, 1.8),
            (Kinetics::Frenkel, s, 0.9, 1.8),
            (Kinetics::ThreeStage, s, 0.2, 1.4),
        ] {
            let end = reference_time(scene, kinetics, s, f64::powi(until, 2)).min(0.1);
            let times: Vec<f64> = (1..=12).map(|i| end * f64::from(i) / 12.0).collect();
            let start = [scene.x0(), 0.0, scene.law().equilibrium_plastic_overlap(scene.x0())];
            let truth = |tolerance| -> Vec<f64> {
                integrate(|y| motion(scene, kinetics, s, y), start, &times, tolerance, 1e-12)
                    .iter()
                    .map(|y| y[0].sqrt())
                    .collect()
            };
            let expected = truth(1e-12);
            assert!(largest_difference(&expected, &truth(1e-11)) < 1e-8, "reference still moves");
            let errors: Vec<f64> = [0.04, 0.02, 0.01, 0.005, 0.0025]
                .iter()
                .map(|&step| {
                    largest_difference(
                        &expected,
                        &ratios(scene, kinetics, s, &verlet(step), &times),
                    )
                })
                .collect();
            let order = (errors[0] / errors[4]).log2() / 4.0;
            assert!((lowest..2.5).contains(&order), "{kinetics}: order {order}, {errors:?}");
            assert!(errors[1] < 2e-4, "{kinetics}: {errors:?}");
        }
    }
}

#[test]
fn verlet_over_the_knee_converges_to_the_equations_of_motion() {
    let (scene, s) = &materials()[0];
    let times: Vec<f64> = (1..=30).map(|i| 0.12 * f64::from(i) / 30.0).collect();
    let start = [scene.x0(), 0.0, scene.law().equilibrium_plastic_overlap(scene.x0())];
    let expected: Vec<f64> =
        integrate(|y| motion(scene, Kinetics::ThreeStage, s, y), start, &times, 1e-12, 1e-12)
            .iter()
            .map(|y| y[0].sqrt())
            .collect();
    let error = |step| {
        largest_difference(
            &expected,
            &ratios(scene, Kinetics::ThreeStage, s, &verlet(step), &times),
        )
    };
    let (coarse, fine) = (error(0.02), error(0.001));
    assert!(coarse < 5e-3 && fine < coarse / 8.0, "{coarse} {fine}");
}

#[test]
fn the_three_solvers_agree_as_inertia_vanishes() {
    for kinetics in Kinetics::ALL {
        let (scene, s) = materials()[0].clone();
        let rest = if kinetics == Kinetics::RegimeMap {
            reference_time(&scene, kinetics, &s, scene.x0())
        } else {
            0.0
        };
        let times: Vec<f64> = (1..=20).map(|i| 0.08 * f64::from(i) / 20.0).collect();
        // The Verlet solver takes the rates of the map from the start: it is ahead by the rest.
        let later: Vec<f64> = times.iter().map(|t| t + rest).collect();
        let exact = ratios(&scene, kinetics, &s, &SolverSettings::default(), &later);
        let balanced = ratios(&scene, kinetics, &s, &quasi_static(1e-9), &later);
        assert!(largest_difference(&exact, &balanced) < 1e-9);
        let lags: Vec<f64> = [1e3, 1e1, 1e-1, 1e-3]
            .iter()
            .map(|&density_kg_per_m3| {
                let powder = dem_core::Powder { density_kg_per_m3, ..paper::PS };
                let scene = PairSpec::new(powder, 1.08).build().expect("valid");
                let found = ratios(&scene, kinetics, &s, &verlet(0.1), &times);
                largest_difference(&exact, &found)
            })
            .collect();
        assert!(lags.is_sorted_by(|a, b| *a > 2.0 * *b), "{kinetics}: {lags:?}");
        assert!(lags[3] < 3e-4, "{kinetics}: {lags:?}");
    }
}

#[test]
fn a_stiff_start_neither_overshoots_nor_chatters() {
    // Far into the prior, with the largest stable step: dx/dt starts at 1e12/s and more.
    for c1 in [1e-4, 1e0, 1e4, 1e8] {
        for delta_c in [1e-7, 1e-6, 3e-6] {
            let spec = PairSpec::new(paper::PA12, 2f64.cbrt());
            for damping in [Damping::Restitution(0.1), Damping::Restitution(1.0)] {
                let scene = PairSpec { damping, ..spec }.build().expect("valid");
                let s = Sintering { c1, tau_s: 1.0, delta_c, lambda: 0.0 };
                let step = 0.95 * scene.step_limit_s() / scene.collision_time_s();
                let times: Vec<f64> =
                    (0..400).map(|i| f64::from(i) * step * scene.collision_time_s()).collect();
                let curve = simulate(&scene, Kinetics::ThreeStage, &s, &verlet(step), &times)
                    .expect("stable");
                let p = &curve.plastic_overlap_m;
                let limit = scene.final_overlap() * scene.radius_m();
                // Undamped, an elastic rebound turns the driving force and may undo some growth.
                let may_fall = damping == Damping::Restitution(1.0);
                assert!(
                    may_fall || p.is_sorted(),
                    "{c1} {delta_c} {damping:?}: plastic overlap falls"
                );
                assert!(p.iter().all(|&p| p <= limit));
                for (x, p) in curve.overlap_m.iter().zip(p) {
                    assert!(x - p > -1e-2 * limit && *x < 1.3 * limit, "{c1} {delta_c}: {x} {p}");
                }
            }
        }
    }
}

#[test]
fn batch_has_the_bits_of_single_curves() {
    let (scene, s) = materials()[0].clone();
    let times: Vec<f64> = (0..17).map(|i| 0.012 * f64::from(i)).collect();
    // Different speeds, so that lanes end and are taken again at different times; one is refused.
    let sinterings: Vec<Sintering> = (0..21)
        .map(|i| Sintering {
            tau_s: if i == 5 { -1.0 } else { s.tau_s * (0.3 + 0.1 * f64::from(i)) },
            delta_c: s.delta_c * (0.5 + 0.05 * f64::from(i)),
            ..s
        })
        .collect();
    for kinetics in Kinetics::ALL {
        for from_contact in [false, true] {
            let settings = SolverSettings { from_contact, ..verlet(0.05) };
            let mut out = vec![0.0; sinterings.len() * times.len()];
            let results = verlet_batch(&scene, kinetics, &sinterings, &settings, &times, &mut out)
                .expect("valid");
            for (i, (s, result)) in sinterings.iter().zip(results).enumerate() {
                let mut one = vec![0.0; times.len()];
                let alone = contact_ratios(&scene, kinetics, s, &settings, &times, &mut one);
                assert_eq!(result, alone, "{kinetics} {i}");
                if alone.is_ok() {
                    assert_eq!(out[i * times.len()..][..times.len()], one, "{kinetics} {i}");
                }
            }
        }
    }
}

#[test]
fn a_coalesced_pair_ends_its_run() {
    let (scene, s) = materials()[0].clone();
    let times = [0.05, 0.2, 1.0, 1e4];
    for settings in [verlet(0.02), quasi_static(1e-6), SolverSettings::default()] {
        let curve = simulate(&scene, Kinetics::ThreeStage, &s, &settings, &times).expect("valid");
        assert_eq!(curve.report.stop, StopReason::Coalesced, "{}", settings.kind);
        assert!(curve.report.steps < 20_000, "{}", curve.report.steps);
        assert!((curve.contact_ratio[3] - 1.08).abs() < 1e-12);
    }
}

#[test]
fn the_run_from_first_contact_reaches_the_adhesive_equilibrium() {
    // Almost without sintering the pair settles where fa = K1 delta, a/R = sqrt(1e-3).
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build().expect("valid");
    let s = Sintering { c1: 1e-20, tau_s: 1e20, delta_c: 1e-20, lambda: 0.0 };
    let settings = SolverSettings { from_contact: true, ..verlet(0.02) };
    let times = [0.0, 0.1];
    let curve = simulate(&scene, Kinetics::ThreeStage, &s, &settings, &times).expect("valid");
    assert_eq!(curve.contact_ratio[0], 0.0);
    assert!((curve.contact_ratio[1] - 1e-3f64.sqrt()).abs() < 1e-9);
}
