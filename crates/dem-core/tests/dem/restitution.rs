//! Free motion on the loading branch, where the answer is a damped cosine.

use dem_core::{
    Damping, Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, paper, simulate,
};

/// Negligible sintering: plastic overlap 0, stiffness K1.
const FROZEN: Sintering = Sintering { c1: 1.0, tau_s: 1e30, delta_c: 1.0, lambda: 0.0 };

fn scene(damping: Damping) -> PairScene {
    let spec = PairSpec { damping, ..PairSpec::new(paper::PA12, 2f64.cbrt()) };
    spec.build().expect("valid")
}

fn overlaps(scene: &PairScene, step: f64, times: &[f64]) -> Vec<f64> {
    let settings = SolverSettings {
        step_over_collision_time: step,
        from_contact: true,
        ..SolverSettings::of(SolverKind::Verlet)
    };
    let curve = simulate(scene, Kinetics::Frenkel, &FROZEN, &settings, times).expect("valid");
    curve.overlap_m.iter().map(|delta| delta / scene.radius_m()).collect()
}

#[test]
fn half_a_swing_keeps_the_share_of_the_restitution() {
    // From rest at contact the pair swings about fa/K1; the half swing of one collision time leaves
    // the share e of the amplitude.
    for e in [0.1, 0.5, 0.9, 1.0] {
        let scene = scene(Damping::Restitution(e));
        let at = overlaps(&scene, 1e-3, &[scene.collision_time_s()])[0];
        assert!((at / 1e-3 - (1.0 + e)).abs() < 2e-5, "{e}: {at}");
    }
}

#[test]
fn dissipation_is_the_published_function_of_restitution() {
    let with = scene(Damping::Restitution(0.1));
    let m = 0.5 * 1000.0 * 4.0 / 3.0 * std::f64::consts::PI * 31.5e-6f64.powi(3);
    let log = 0.1f64.ln();
    let expected = -2.0 * log * (3e-4 * m / (std::f64::consts::PI.powi(2) + log * log)).sqrt();
    assert!((with.dissipation_kg_per_s() / expected - 1.0).abs() < 1e-14);
    // ... so that a collision takes pi/sqrt(K1/m - (gamma_n/2m)^2) and its velocity falls to e.
    let t = with.collision_time_s();
    assert!(((-expected / (2.0 * m) * t).exp() - 0.1).abs() < 1e-14);
    let given = scene(Damping::Coefficient(expected));
    assert!((given.collision_time_s() / t - 1.0).abs() < 1e-13);
    assert_eq!(scene(Damping::Restitution(1.0)).dissipation_kg_per_s(), 0.0);
}

#[test]
fn undamped_swing_is_of_second_order_and_gains_no_energy() {
    let scene = scene(Damping::Restitution(1.0));
    let t_c = scene.collision_time_s();
    // Ten and a half swings, and none of the instants where the pair only just touches.
    let times: Vec<f64> = (0..40).map(|i| t_c * (0.13 + 0.26 * f64::from(i))).collect();
    let exact: Vec<f64> =
        times.iter().map(|t| 1e-3 * (1.0 - (std::f64::consts::PI * t / t_c).cos())).collect();
    let errors: Vec<f64> = [0.02, 0.01, 0.005]
        .iter()
        .map(|&step| {
            let found = overlaps(&scene, step, &times);
            exact.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        })
        .collect();
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((1.9..2.1).contains(&order), "order {order}, {errors:?}");
    }
    // The amplitude is still there, and no more, after two thousand swings.
    let late: Vec<f64> = (0..200).map(|i| t_c * (2000.0 + 0.05 * f64::from(i))).collect();
    let found = overlaps(&scene, 0.02, &late);
    let largest = found.iter().copied().fold(0.0, f64::max);
    assert!((largest / 2e-3 - 1.0).abs() < 2e-3, "{largest}");
}
