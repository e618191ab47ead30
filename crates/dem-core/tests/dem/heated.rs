//! The solvers under a heat: the closed form in reduced time against runs with m in their rates.

use crate::kinetics::reference_time;
use crate::reference::{integrate, largest_difference, materials, motion, quasi_static, verlet};
use dem_core::heat::{CoolDown, Heat, History, Mobility, MobilityLaw, literature};
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverSettings, StopReason, contact_ratios,
    heated_contact_ratios, heated_time_to_contact_ratio, paper, simulate, simulate_heated,
    time_to_contact_ratio,
};

fn heated(
    scene: &PairScene,
    law: (Kinetics, &Sintering),
    heat: &Heat,
    settings: &SolverSettings,
    times: &[f64],
) -> Vec<f64> {
    let mut out = vec![0.0; times.len()];
    heated_contact_ratios(scene, law, heat, settings, times, &mut out).expect("valid");
    out
}

/// Heats that take a time like `scale_s`: of every kind, with jumps and bends, that freeze and that do not.
fn heats(scale_s: f64) -> Vec<(&'static str, Heat)> {
    let arrhenius =
        MobilityLaw::Arrhenius { activation_energy_j_per_mol: 100e3, reference_k: 450.0 };
    let arrhenius = Mobility::new(arrhenius).expect("valid");
    let glass = arrhenius.frozen_below(415.0).expect("a temperature");
    let MobilityLaw::Wlf { c1, c2_k, .. } = literature::PS_WLF else { panic!("WLF") };
    let wlf = Mobility::new(MobilityLaw::Wlf { c1, c2_k, reference_k: 459.0 }).expect("valid");
    let pulse = History::Pulse { ambient_k: 320.0, rise_k: 140.0, cooling_s: 0.9 * scale_s };
    let oven = History::RampAndHold {
        start_k: 400.0,
        rate_k_per_s: 150.0 / scale_s,
        hold_k: 458.0,
        then: Some(CoolDown { hold_s: 0.2 * scale_s, rate_k_per_s: 300.0 / scale_s }),
    };
    let rows = [(-0.1, 440.0), (0.2, 460.0), (0.4, 452.0), (0.45, 465.0), (3.0, 440.0)];
    let table = History::Table(rows.map(|(t, kelvin)| (t * scale_s, kelvin)).to_vec());
    let heat = |history: &History, mobility: &Mobility, start: f64| {
        Heat::new(history, mobility, start * scale_s).expect("valid")
    };
    vec![
        ("direct", Heat::direct(2.0, 0.5 * scale_s, 0.0).expect("valid")),
        ("late", Heat::direct(1.5, 0.8 * scale_s, 0.3 * scale_s).expect("valid")),
        ("pulse", heat(&pulse, &arrhenius, 0.0)),
        ("glass", heat(&pulse, &glass, 0.1)),
        ("wlf", heat(&pulse, &wlf, -0.01)),
        ("oven", heat(&oven, &wlf, 0.0)),
        ("oven with glass", heat(&oven, &glass, 0.0)),
        ("table", heat(&table, &arrhenius, 0.0)),
    ]
}

#[test]
fn quasi_static_runs_with_m_in_the_rates_are_the_closed_form_in_reduced_time() {
    for (scene, s) in materials() {
        for kinetics in Kinetics::ALL {
            let scale_s = reference_time(&scene, kinetics, &s, 0.9 * scene.final_overlap());
            let times: Vec<f64> =
                (0..100).map(|i| 2.0 * scale_s * (f64::from(i) / 99.0).powi(3)).collect();
            for (name, heat) in heats(scale_s) {
                let exact =
                    heated(&scene, (kinetics, &s), &heat, &SolverSettings::default(), &times);
                assert!(
                    exact.is_sorted() && exact[99] > 2.0 * exact[0],
                    "{kinetics} {name} {}",
                    exact[99]
                );
                for tolerance in [1e-4, 1e-6, 1e-8] {
                    let mut found = vec![0.0; times.len()];
                    let report = heated_contact_ratios(
                        &scene,
                        (kinetics, &s),
                        &heat,
                        &quasi_static(tolerance),
                        &times,
                        &mut found,
                    )
                    .expect("valid");
                    let error = largest_difference(&exact, &found);
                    let estimate = report.error_estimate.expect("the solver has one");
                    assert!(error <= tolerance, "{kinetics} {name} at {tolerance}: {error}");
                    assert!(error <= estimate + 1e-11, "{kinetics} {name}: {error} {estimate}");
                    assert_eq!(report.quasi_static_lag, None);
                }
            }
        }
    }
}

#[test]
fn verlet_with_m_in_the_rates_is_the_closed_form_in_reduced_time_as_inertia_vanishes() {
    let (scene, s) = materials()[0].clone();
    let times: Vec<f64> = (1..=20).map(|i| 0.1 * f64::from(i) / 20.0).collect();
    for kinetics in Kinetics::ALL {
        // The Verlet solver takes the rates of the map from the start: it is ahead by the rest.
        let rest = match kinetics {
            Kinetics::RegimeMap => reference_time(&scene, kinetics, &s, scene.x0()),
            _ => 0.0,
        };
        for (name, heat) in heats(0.08) {
            let mut reduced = vec![0.0; times.len()];
            heat.reduced_times(&times, &mut reduced);
            for s in &mut reduced {
                *s += rest;
            }
            let mut exact = vec![0.0; times.len()];
            contact_ratios(&scene, kinetics, &s, &SolverSettings::default(), &reduced, &mut exact)
                .expect("valid");
            let powder = dem_core::Powder { density_kg_per_m3: 1e-3, ..paper::PS };
            let light = PairSpec::new(powder, 1.08).build().expect("valid");
            let found = heated(&light, (kinetics, &s), &heat, &verlet(0.1), &times);
            let difference = largest_difference(&exact, &found);
            assert!(difference < 3e-4, "{kinetics} {name}: {difference}");
        }
    }
}

#[test]
fn verlet_with_m_in_the_rates_is_the_motion_with_m_in_the_rates() {
    let (scene, s) = &materials()[0];
    let slow = Sintering { c1: 1e-4 * s.c1, ..*s };
    for (kinetics, s) in [(Kinetics::ThreeStage, &slow), (Kinetics::Frenkel, s)] {
        let heat = Heat::direct(2.0, 0.03, 0.0).expect("valid");
        let times: Vec<f64> = (1..=12).map(|i| 0.05 * f64::from(i) / 12.0).collect();
        let start = [scene.x0(), 0.0, scene.law().equilibrium_plastic_overlap(scene.x0()), 0.0];
        // With the rate of the plastic overlap times m; the elastic part keeps its own time.
        let with_heat = |[x, v, p, t]: [f64; 4]| {
            let [dx, dv, dp] = motion(scene, kinetics, s, [x, v, p]);
            [dx, dv, 2.0 * (-t / 0.03f64).exp() * dp, 1.0]
        };
        let expected: Vec<f64> =
            integrate(with_heat, start, &times, 1e-12, 1e-12).iter().map(|y| y[0].sqrt()).collect();
        let errors: Vec<f64> = [0.04, 0.02, 0.01, 0.005]
            .iter()
            .map(|&step| {
                let found = heated(scene, (kinetics, s), &heat, &verlet(step), &times);
                largest_difference(&expected, &found)
            })
            .collect();
        let order = (errors[0] / errors[3]).log2() / 3.0;
        assert!((1.8..2.5).contains(&order), "{kinetics}: order {order}, {errors:?}");
        assert!(errors[1] < 2e-4, "{kinetics}: {errors:?}");
    }
}

#[test]
fn heats_of_unit_mobility_give_the_bits_of_runs_without_heat() {
    let (scene, s) = materials()[0].clone();
    let times: Vec<f64> = (0..60).map(|i| 0.003 * f64::from(i)).collect();
    let wlf = Mobility::new(literature::PS_WLF).expect("valid");
    let constant = History::Constant { temperature_k: 373.0 };
    for heat in [
        Heat::direct(1.0, f64::INFINITY, 0.0).expect("valid"),
        Heat::new(&constant, &wlf, 0.0).expect("valid"),
    ] {
        for kinetics in Kinetics::ALL {
            for settings in [SolverSettings::default(), quasi_static(1e-7), verlet(0.05)] {
                let (plain, with_heat) = (
                    simulate(&scene, kinetics, &s, &settings, &times).expect("valid"),
                    simulate_heated(&scene, (kinetics, &s), &heat, &settings, &times)
                        .expect("valid"),
                );
                assert_eq!(plain.contact_ratio, with_heat.contact_ratio, "{kinetics}");
                assert_eq!(plain.plastic_overlap_m, with_heat.plastic_overlap_m, "{kinetics}");
                assert_eq!(plain.report.steps, with_heat.report.steps, "{kinetics}");
                let mut ratios = vec![0.0; times.len()];
                contact_ratios(&scene, kinetics, &s, &settings, &times, &mut ratios)
                    .expect("valid");
                assert_eq!(ratios, heated(&scene, (kinetics, &s), &heat, &settings, &times));
            }
        }
    }
}

#[test]
fn pairs_that_cool_stop_at_the_contact_ratio_of_their_last_reduced_time() {
    let (scene, s) = materials()[1].clone();
    let law = (Kinetics::ThreeStage, &s);
    let heat = Heat::direct(0.8, 2.0, 0.0).expect("valid");
    let times = [1.0, 5.0, 60.0, 1e4];
    let mut at_end = [0.0];
    let end = [heat.reduced_time_at_end()];
    contact_ratios(&scene, law.0, &s, &SolverSettings::default(), &end, &mut at_end)
        .expect("valid");
    assert!(at_end[0] > 0.4 && at_end[0] < 0.9, "{at_end:?}");
    for settings in [SolverSettings::default(), quasi_static(1e-9)] {
        let mut found = [0.0; 4];
        let report = heated_contact_ratios(&scene, law, &heat, &settings, &times, &mut found)
            .expect("valid");
        assert_eq!(report.stop, StopReason::LastObservation);
        assert!((found[3] - at_end[0]).abs() < 1e-9, "{found:?} {at_end:?}");
    }
    let found = heated(&scene, law, &heat, &verlet(0.05), &times[..3]);
    assert!((found[2] - at_end[0]).abs() < 1e-3, "{found:?} {at_end:?}");
    // The time to a contact ratio: later than without heat, and never beyond the plateau.
    let to = |ratio| heated_time_to_contact_ratio(&scene, law, &heat, ratio);
    let reached = to(0.4).expect("reached");
    let exact = time_to_contact_ratio(&scene, law.0, &s, 0.4).expect("reached");
    assert!((heat.reduced_time(reached) / exact - 1.0).abs() < 1e-12 && reached > exact);
    assert!(to(0.99 * at_end[0]).is_some());
    assert_eq!(to(1.01 * at_end[0]), None);
    // One that is cold from the start keeps its adhesive contact in every solver.
    let cold = Heat::direct(0.0, 1.0, 0.0).expect("valid");
    for settings in [SolverSettings::default(), quasi_static(1e-6), verlet(0.05)] {
        for kinetics in Kinetics::ALL {
            let found = heated(&scene, (kinetics, &s), &cold, &settings, &[0.0, 0.5]);
            assert!((found[1] - scene.start_contact_ratio()).abs() < 1e-12, "{kinetics}");
        }
    }
}
