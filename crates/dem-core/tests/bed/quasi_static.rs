//! The quasi-static mode against the closed form and against the full engine.

use dem_core::bed::{
    Bed, Drive, QuasiStaticReport, QuasiStaticSettings, Region, Side, Start, Surroundings,
    jammed_packing,
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

/// A hundred particles that touch, free to contract.
fn lump() -> Start {
    let region = Region::new([10.0 * R; 3], Side::Walls);
    let radius_m = vec![R; 100];
    let (_, position_m) = jammed_packing(&region, &radius_m, 3e-4, 5).expect("jams");
    Start { position_m, radius_m, ..Start::default() }
}

#[test]
fn hundred_particles_contract_as_the_full_engine_lets_them() {
    let drive = Drive { growing: Some(growing(Kinetics::ThreeStage)), ..Drive::default() };
    let mut slow = free(material(|_| ()), &lump());
    slow.begin(&drive).expect("stable");
    let mut full = slow.clone();
    let mut report = QuasiStaticReport::default();
    for time in [0.2, 0.6] {
        let steps = ((time - full.time_s()) / full.step_s()).round() as u64;
        full.advance(steps).expect("runs");
        slow.advance_quasi_static(full.time_s(), &settings(), &mut report).expect("balances");
        let (a, b) = (full.sample(), slow.sample());
        assert!(
            (a.mean_contact_ratio - b.mean_contact_ratio).abs() < 0.004,
            "{time} s: engine {a:?}\nquasi-static {b:?}\n{report:?}"
        );
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
