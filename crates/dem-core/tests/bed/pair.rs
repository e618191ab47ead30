//! The pair through the general engine is the pair of the pair solver.

use dem_core::bed::{Bed, Drive};
use dem_core::{Damping, Kinetics, SolverKind, SolverSettings, paper, simulate};

use crate::builders::{PA12_SINTERING, free, growing, material, spec, start};

fn overlap(bed: &Bed) -> f64 {
    let r = &bed.particles().position_m;
    let d2: f64 = (0..3).map(|axis| (r[1][axis] - r[0][axis]).powi(2)).sum();
    2.0 - d2.sqrt() / paper::PA12.radius_m
}

/// Largest difference of the overlap, in radii, over `observations` of `every` steps.
fn difference(
    kinetics: Kinetics,
    damping: Damping,
    from_contact: bool,
    every: u64,
    observations: u64,
) -> f64 {
    let mut spec = spec();
    spec.damping = damping;
    let scene = spec.build().expect("valid");
    let material = material(|material| *material = spec);
    let x0 = if from_contact { 0.0 } else { scene.x0() };
    // Not along an axis: the general engine has to find the direction.
    let n = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
    let mut bed =
        free(material, &start(paper::PA12.radius_m, &[[0.0; 3], n.map(|n| n * (2.0 - x0))]));
    bed.begin(&Drive { growing: Some(growing(kinetics)), ..Drive::default() }).expect("stable");
    let times: Vec<f64> = (1..=observations).map(|i| (i * every) as f64 * bed.step_s()).collect();
    let settings = SolverSettings { from_contact, ..SolverSettings::of(SolverKind::Verlet) };
    let curve = simulate(&scene, kinetics, &PA12_SINTERING, &settings, &times).expect("runs");
    let mut largest: f64 = 0.0;
    for expected in curve.overlap_m {
        bed.advance(every).expect("runs");
        largest = largest.max((overlap(&bed) - expected / paper::PA12.radius_m).abs());
    }
    largest
}

#[test]
fn pair_of_every_kinetics_is_the_pair_solvers_to_rounding() {
    for kinetics in Kinetics::ALL {
        let largest = difference(kinetics, Damping::Restitution(0.1), false, 20_000, 12);
        assert!(largest < 1e-9, "{kinetics}: {largest}");
    }
}

#[test]
fn undamped_pair_from_first_contact_is_the_pair_solvers_while_it_oscillates() {
    let largest = difference(Kinetics::ThreeStage, Damping::Restitution(1.0), true, 10, 100);
    assert!(largest < 1e-11, "{largest}");
}

#[test]
fn damped_pair_from_first_contact_is_the_pair_solvers() {
    let largest = difference(Kinetics::ThreeStage, Damping::Restitution(0.5), true, 7, 400);
    assert!(largest < 1e-11, "{largest}");
}

#[test]
fn step_of_a_pair_is_refused_where_the_pair_solver_refuses_it() {
    let scene = spec().build().expect("valid");
    let mut bed = free(
        material(|_| ()),
        &start(paper::PA12.radius_m, &[[0.0; 3], [2.0 - scene.x0(), 0.0, 0.0]]),
    );
    assert!((bed.step_limit_s().0 / scene.step_limit_s() - 1.0).abs() < 1e-12);
    assert!((bed.collision_time_s() / scene.collision_time_s() - 1.0).abs() < 1e-12);
    let limit = scene.step_limit_s() / scene.collision_time_s();
    let drive = |step| Drive { step_over_collision_time: step, ..Drive::default() };
    assert!(bed.begin(&drive(0.999 * limit)).is_ok());
    let message = bed.begin(&drive(1.001 * limit)).expect_err("unstable").to_string();
    assert!(message.contains("step_over_collision_time"), "{message}");
}
