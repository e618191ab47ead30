//! The quasi-static mode against the closed form and against the full engine.

use dem_core::bed::{
    Bed, Drive, QuasiStaticReport, QuasiStaticSettings, Region, Side, Start, Surroundings,
    inertia_error, random_packing,
};
use dem_core::{Kinetics, SolverKind, SolverSettings, simulate};

use crate::builders::{PA12_SINTERING, free, growing, material, spec, start};

const R: f64 = 31.5e-6;

fn settings() -> QuasiStaticSettings {
    QuasiStaticSettings::default()
}

#[test]
fn quasi_static_pair_follows_the_closed_form_whatever_k1() {
    for kinetics in [Kinetics::ThreeStage, Kinetics::Frenkel, Kinetics::ThreeStagePokluda] {
        for k1 in [3e-4, 30.0] {
            let mut spec = spec();
            spec.k1 = k1;
            let scene = spec.build().expect("valid");
            let times = [0.01, 0.1, 0.3, 1.0, 3.0, 5.0];
            let closed = SolverSettings::of(SolverKind::QuasiStatic);
            let curve = simulate(&scene, kinetics, &PA12_SINTERING, &closed, &times).expect("runs");
            let material = material(|material| *material = spec);
            let mut bed = free(material, &start(R, &[[0.0; 3], [2.0 - scene.x0(), 0.0, 0.0]]));
            let drive = Drive { growing: Some(growing(kinetics)), ..Drive::default() };
            bed.begin(&drive).expect("stable");
            let mut report = QuasiStaticReport::default();
            for (time, expected) in times.into_iter().zip(curve.contact_ratio) {
                bed.advance_quasi_static(time, &settings(), &mut report).expect("balances");
                let ratio = bed.sample().mean_contact_ratio;
                assert!(
                    (ratio - expected).abs() < 1e-3,
                    "{kinetics}, K1 = {k1}, {time} s: {ratio}, closed form {expected}"
                );
            }
            assert!(report.steps < 120, "{report:?}");
        }
    }
}

/// Sixty particles settled under gravity, the load at the bottom a thirtieth of fa.
fn settled() -> Bed {
    let side = 8.0 * R;
    let sides = [Side::Periodic, Side::Periodic, Side::LowerWall];
    let region = Region { size_m: [side, side, 8.0 * R], sides };
    let radius_m = vec![R; 60];
    let position_m = random_packing(&region, &radius_m, 3).expect("below jamming");
    let start = Start { position_m, radius_m, ..Start::default() };
    let around = Surroundings {
        region,
        gravity_m_per_s2: [0.0, 0.0, -9.81],
        drag_viscosity_pa_s: 2e-4,
        ..Surroundings::NOTHING
    };
    let mut bed = Bed::new(material(|spec| spec.k1 = 6.0), around, &start).expect("valid");
    bed.begin(&Drive::default()).expect("stable");
    bed.advance((0.03 / bed.step_s()) as u64).expect("settles");
    let now_s = bed.time_s();
    bed.advance_quasi_static(now_s, &settings(), &mut QuasiStaticReport::default())
        .expect("balances");
    bed
}

#[test]
fn claimed_errors_of_mass_scaling_and_of_the_quasi_static_mode_bound_those_found() {
    let settled = settled();
    let drive = |mass_scaling| Drive {
        growing: Some(growing(Kinetics::ThreeStage)),
        mass_scaling,
        ..Drive::default()
    };
    let start_s = settled.time_s();
    let times = [0.005, 0.02, 0.05, 0.08];
    let scaled = |mass_scaling: f64| {
        let mut bed = settled.clone();
        bed.begin(&drive(mass_scaling)).expect("stable");
        let mut chance: f64 = 0.0;
        let samples = times.map(|time| {
            let left_s = start_s + time - bed.time_s();
            bed.advance((left_s / bed.step_s()).round() as u64).expect("runs");
            chance = chance.max(bed.chance_of_mean_contact_ratio());
            bed.sample()
        });
        (samples, inertia_error(&samples), chance)
    };
    let quasi_static = |tolerance: f64| {
        let mut bed = settled.clone();
        bed.begin(&drive(1.0)).expect("stable");
        let mut report = QuasiStaticReport::default();
        let settings = QuasiStaticSettings { tolerance, ..settings() };
        let mut chance: f64 = 0.0;
        let samples = times.map(|time| {
            bed.advance_quasi_static(start_s + time, &settings, &mut report).expect("balances");
            chance = chance.max(bed.chance_of_mean_contact_ratio());
            bed.sample()
        });
        (samples, report.error_estimate, chance)
    };
    let (reference, ..) = scaled(1.0);
    let mut runs = vec![];
    for factor in [10.0, 1e3, 1e5] {
        runs.push((format!("masses times {factor}"), scaled(factor)));
    }
    for tolerance in [1e-2, 1e-3, 1e-4] {
        runs.push((format!("quasi-static to {tolerance}"), quasi_static(tolerance)));
    }
    assert!(reference[3].mean_contact_ratio > 0.1, "{reference:?}");
    for (name, (samples, error, chance)) in runs {
        let found = samples
            .iter()
            .zip(&reference)
            .map(|(a, b)| (a.mean_contact_ratio - b.mean_contact_ratio).abs())
            .fold(0.0, f64::max);
        assert!(found <= error + 2.0 * chance, "{name}: {found}, claimed {error} and {chance}");
        // A claim that is always true says nothing.
        assert!(chance < 0.01 && (error < 0.03 || name.ends_with("100000")), "{name}: {error}");
    }
}

#[test]
fn free_box_shrinks_as_far_as_its_contacts_do() {
    // A simple cubic lattice: every contact is a pair, and the box follows (2 - x)^3.
    let x0 = 1e-3;
    let spacing = (2.0 - x0) * R;
    let mut start = Start::default();
    for i in 0..64 {
        let at = [i / 16, i / 4 % 4, i % 4];
        start.position_m.push(at.map(|at| at as f64 * spacing));
        start.radius_m.push(R);
    }
    let region = Region::new([4.0 * spacing; 3], Side::Periodic);
    let surroundings = Surroundings { region, ..Surroundings::NOTHING };
    let mut bed = Bed::new(material(|_| ()), surroundings, &start).expect("valid");
    let drive = Drive { growing: Some(growing(Kinetics::ThreeStage)), ..Drive::default() };
    bed.begin(&drive).expect("stable");
    let settings = QuasiStaticSettings { free_box: true, ..settings() };
    let scene = spec().build().expect("valid");
    let closed = SolverSettings::of(SolverKind::ClosedForm);
    for time in [0.1, 0.3, 0.8] {
        bed.advance_quasi_static(time, &settings, &mut QuasiStaticReport::default())
            .expect("balances");
        let curve = simulate(&scene, Kinetics::ThreeStage, &PA12_SINTERING, &closed, &[time])
            .expect("runs");
        let x = curve.contact_ratio[0].powi(2);
        let density = std::f64::consts::PI / 6.0 * (2.0 / (2.0 - x)).powi(3);
        let sample = bed.sample();
        assert!((sample.relative_density / density - 1.0).abs() < 1e-3, "{sample:?} {density}");
        assert_eq!(sample.coordination, 6.0);
    }
}
