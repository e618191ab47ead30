//! The stiff references against the closed form and against the extrapolation of `dem-core`'s own tests.

#[path = "../../../dem-core/tests/dem/reference.rs"]
#[allow(dead_code, reason = "written for the tests of dem-core, which use the rest")]
mod reference;

use crate::stiff_reference::{Equations, Problem, ReferenceError};
use dem_core::{Kinetics, PairScene, Sintering, SolverSettings, contact_ratios};
use reference::{integrate as extrapolate, materials, motion};

/// The paper's kinetics at one time, by motion.
fn moving<'a>(scene: &'a PairScene, sintering: &'a Sintering) -> Problem<'a> {
    let (equations, kinetics) = (Equations::Motion, Kinetics::ThreeStage);
    Problem { equations, scene, kinetics, sintering, times_s: &[0.1] }
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn force_balance_by_radau_is_the_exact_solution() {
    for (scene, s) in materials() {
        for kinetics in Kinetics::ALL {
            let times: Vec<f64> =
                (0..30).map(|i| 2.0 * s.tau_s * (f64::from(i) / 29.0).powi(2)).collect();
            let problem = Problem {
                equations: Equations::ForceBalance,
                scene: &scene,
                kinetics,
                sintering: &s,
                times_s: &times,
            };
            let found = problem.settled(1e-9, 100_000).expect("settles");
            let mut exact = vec![0.0; times.len()];
            contact_ratios(&scene, kinetics, &s, &SolverSettings::default(), &times, &mut exact)
                .expect("valid");
            let error = largest_difference(&found.contact_ratio, &exact);
            assert!(error < 2e-9, "{kinetics}: {error:e}");
        }
    }
}

#[test]
fn motion_by_radau_is_that_by_extrapolation() {
    for (scene, s) in &materials()[..2] {
        for kinetics in [Kinetics::ThreeStage, Kinetics::Pokluda] {
            let times: Vec<f64> = (1..=20).map(|i| 0.05 * f64::from(i) / 20.0).collect();
            let start = [scene.x0(), 0.0, scene.law().equilibrium_plastic_overlap(scene.x0())];
            let expected: Vec<f64> =
                extrapolate(|y| motion(scene, kinetics, s, y), start, &times, 1e-12, 1e-12)
                    .iter()
                    .map(|y| y[0].sqrt())
                    .collect();
            let problem = Problem { kinetics, times_s: &times, ..moving(scene, s) };
            let found = problem.settled(1e-8, 1_000_000).expect("settles");
            let error = largest_difference(&found.contact_ratio, &expected);
            assert!(error < 3e-8, "{kinetics}: {error:e}");
        }
    }
}

#[test]
fn a_reference_ends_and_says_where_it_stopped() {
    let (scene, s) = &materials()[0];
    let tired = moving(scene, s).integrate(1e-9, 50);
    assert!(matches!(tired, Err(ReferenceError::WorkLimit { max_steps: 50, .. })), "{tired:?}");
    let fast = Sintering { c1: 1e6, ..*s };
    let other = moving(scene, &fast).integrate(1e-8, 100_000);
    if let Ok((ratios, _)) = &other {
        assert!(ratios.iter().all(|a| a.is_finite()));
    }
}
