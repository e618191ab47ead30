//! Beds under a heat, against the pair solvers under it and against themselves without it.

use std::ops::ControlFlow;

use dem_core::bed::{Mode, Scene, SceneFile, Series};
use dem_core::heat::{Heat, History, Mobility, MobilityLaw};
use dem_core::{Kinetics, PairSpec, SolverKind, SolverSettings, simulate, simulate_heated};

use crate::builders::spec;

fn pair(mode: Mode, kinetics: Kinetics) -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/scenes/pair.toml");
    let text = std::fs::read_to_string(path).expect("a scene");
    let mut file = SceneFile::parse(&text, "pair").expect("valid");
    file.phases[0].duration_s = 0.6;
    file.phases[0].outputs = 6;
    file.phases[0].step_over_collision_time = 0.02;
    file.phases[0].mode = mode;
    if let Some(sintering) = &mut file.sintering {
        sintering.kinetics = kinetics.to_string();
        sintering.lambda = 0.5;
    }
    file.build().expect("valid")
}

fn run(scene: &Scene) -> Series {
    scene.run(|_, _| ControlFlow::Continue(())).expect("runs")
}

/// Every bit of the observations, of which some are NaN.
fn shown(series: &Series) -> String {
    format!("{:?}", series.samples)
}

fn pulse() -> Heat {
    let law = MobilityLaw::Arrhenius { activation_energy_j_per_mol: 100e3, reference_k: 450.0 };
    let mobility = Mobility::new(law).and_then(|law| law.frozen_below(400.0)).expect("valid");
    let pulse = History::Pulse { ambient_k: 320.0, rise_k: 150.0, cooling_s: 0.5 };
    Heat::new(&pulse, &mobility, 0.05).expect("valid")
}

#[test]
fn a_pair_in_a_bed_is_the_pair_of_the_solvers_under_the_same_heat() {
    for (mode, kind, limit) in [
        (Mode::Dynamic, SolverKind::Verlet, 1e-5),
        (Mode::QuasiStatic, SolverKind::ClosedForm, 1e-3),
    ] {
        for kinetics in [Kinetics::ThreeStage, Kinetics::Bellehumeur] {
            let scene = pair(mode, kinetics).with_heat(pulse());
            let sintering = scene.growing().expect("heated").sintering;
            let series = run(&scene);
            let times: Vec<f64> = series.samples.iter().map(|sample| sample.time_s).collect();
            let alone = PairSpec { k1: 0.03, ..spec() }.build().expect("valid");
            // Observations of a bed fall on steps.
            let step_s = 0.1 / (0.1 / scene.bed().step_s()).ceil();
            let settings = SolverSettings {
                step_over_collision_time: step_s / alone.collision_time_s(),
                ..SolverSettings::of(kind)
            };
            let law = (kinetics, &sintering);
            let curve = simulate_heated(&alone, law, &pulse(), &settings, &times).expect("runs");
            let cold = simulate(&alone, kinetics, &sintering, &settings, &times).expect("runs");
            assert!((curve.contact_ratio[6] - cold.contact_ratio[6]).abs() > 0.01, "{kinetics}");
            for (sample, expected) in series.samples.iter().zip(&curve.contact_ratio) {
                let found = sample.mean_contact_ratio;
                assert!((found - expected).abs() < limit, "{kinetics}: {sample:?} {expected}");
            }
        }
    }
}

#[test]
fn beds_of_unit_mobility_have_the_bits_of_beds_without_heat() {
    for mode in [Mode::Dynamic, Mode::QuasiStatic] {
        let scene = pair(mode, Kinetics::ThreeStage);
        let heat = Heat::direct(1.0, f64::INFINITY, 0.0).expect("valid");
        assert_eq!(shown(&run(&scene)), shown(&run(&scene.clone().with_heat(heat))));
    }
}

#[test]
fn a_bed_under_a_heat_goes_on_from_a_checkpoint_with_the_same_bits() {
    for mode in [Mode::Dynamic, Mode::QuasiStatic] {
        let scene = pair(mode, Kinetics::ThreeStage).with_heat(pulse());
        let whole = run(&scene);
        let mut half = scene.start();
        for _ in 0..3 {
            half.advance().expect("runs");
        }
        let mut rest = scene.resume(&half.checkpoint()).expect("its own");
        while rest.advance().expect("runs").is_some() {}
        assert_eq!(shown(rest.series()), shown(&whole));
        assert!(half.set_heat(pulse()).is_err(), "a heat cannot be changed while it acts");
    }
}

#[test]
fn a_bed_that_freezes_stays_as_it_is_to_the_end_of_the_run() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/scenes/four-particles.toml");
    let text = std::fs::read_to_string(path).expect("a scene");
    let mut file = SceneFile::parse(&text, "four").expect("valid");
    file.phases[0].duration_s = 4.0;
    file.phases[0].outputs = 8;
    file.phases[0].mode = Mode::QuasiStatic;
    let frozen = run(&file.build().expect("valid").with_heat(pulse()));
    let ratios: Vec<f64> = frozen.samples.iter().map(|one| one.mean_contact_ratio).collect();
    // 470 K falls to 400 K after 0.5 ln(150/80) = 0.314 s.
    assert!(ratios[0] < 0.05 && ratios[1] > 0.15, "{ratios:?}");
    assert!(ratios[1..].iter().all(|ratio| (ratio - ratios[1]).abs() < 1e-6), "{ratios:?}");
    assert!((frozen.samples[8].time_s - 4.0).abs() < 1e-9);
}
