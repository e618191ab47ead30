//! The exact solutions against quadrature of the printed equations.

use crate::reference::{materials, switch, time_between};
use dem_core::kinetics::Regimes;
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverSettings, contact_ratios, knee, paper,
    time_to_contact_ratio,
};

/// Time \[s\] in which the reference reaches an overlap from the adhesive contact.
pub(crate) fn reference_time(scene: &PairScene, kinetics: Kinetics, s: &Sintering, x: f64) -> f64 {
    let rest = if kinetics == Kinetics::RegimeMap {
        // The map in explicit time leaves x0 when the first of its branches gets there.
        let crossing = switch(scene, kinetics, s);
        let x0 = scene.x0();
        if x0 < crossing { crossing * s.tau_s * (x0 / crossing).powf(3.5) } else { x0 * s.tau_s }
    } else {
        0.0
    };
    rest + time_between(scene, kinetics, s, scene.x0(), x)
}

#[test]
fn closed_form_is_the_quadrature_of_the_rate_to_rounding() {
    for (scene, sintering) in materials() {
        for kinetics in Kinetics::ALL {
            let mut times = Vec::new();
            let mut expected = Vec::new();
            for i in 0..40 {
                let share = (f64::from(i) / 40.0).powi(3);
                // At x0 itself the map is still at rest: any time up to the rest is right.
                if kinetics == Kinetics::RegimeMap && i == 0 {
                    continue;
                }
                let x = scene.x0() + share * (0.999 * scene.final_overlap() - scene.x0());
                times.push(reference_time(&scene, kinetics, &sintering, x));
                expected.push(x.sqrt());
            }
            let mut found = vec![0.0; times.len()];
            contact_ratios(
                &scene,
                kinetics,
                &sintering,
                &SolverSettings::default(),
                &times,
                &mut found,
            )
            .expect("valid");
            for ((t, a), b) in times.iter().zip(&expected).zip(&found) {
                assert!((a - b).abs() < 1e-13, "{kinetics} at {t}: {a} against {b}");
                let back =
                    time_to_contact_ratio(&scene, kinetics, &sintering, *a).expect("below phi");
                let rounding = 1e-11 * t + 1e-15 * sintering.tau_s;
                assert!((back - t).abs() <= rounding, "{kinetics}: time {back} against {t}");
            }
        }
    }
}

#[test]
fn small_pokluda_necks_follow_the_line_of_frenkel() {
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build().expect("valid");
    let s = Sintering { c1: 1.0, tau_s: 1.0, delta_c: 1.0, lambda: 0.0 };
    let time = |kinetics| time_to_contact_ratio(&scene, kinetics, &s, 0.04).expect("reached");
    let (frenkel, pokluda) = (time(Kinetics::Frenkel), time(Kinetics::Pokluda));
    assert!((pokluda / frenkel - 1.0).abs() < 2e-3, "{frenkel} {pokluda}");
    assert_eq!(time_to_contact_ratio(&scene, Kinetics::Pokluda, &s, 2f64.cbrt()), None);
    assert!(time_to_contact_ratio(&scene, Kinetics::Frenkel, &s, 2f64.cbrt()).is_some());
}

#[test]
fn bellehumeur_without_elasticity_is_pokluda_and_with_more_of_it_is_slower() {
    for phi in [1.08, 2f64.cbrt()] {
        let scene = PairSpec::new(paper::PS, phi).build().expect("valid");
        let times: Vec<f64> = (0..80).map(|i| 0.05 * f64::from(i)).collect();
        let curve = |kinetics, lambda| {
            let s = Sintering { c1: f64::NAN, tau_s: 0.6, delta_c: f64::NAN, lambda };
            let mut out = vec![0.0; times.len()];
            contact_ratios(&scene, kinetics, &s, &SolverSettings::default(), &times, &mut out)
                .expect("valid");
            assert!(out.is_sorted(), "{lambda}");
            out
        };
        let newtonian = curve(Kinetics::Pokluda, f64::NAN);
        let mut before = curve(Kinetics::Bellehumeur, 0.0);
        for (a, b) in newtonian.iter().zip(&before) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
        // The difference goes with lambda, for small ones.
        let small = |lambda| newtonian[4] - curve(Kinetics::Bellehumeur, lambda)[4];
        assert!((small(1e-5) / small(1e-6) - 10.0).abs() < 1e-2, "{}", small(1e-5));
        for lambda in [1e-3, 0.03, 0.2, 1.0, 30.0, 1e6] {
            let slower = curve(Kinetics::Bellehumeur, lambda);
            assert!(slower[1..].iter().zip(&before[1..]).all(|(s, b)| s < b || *s == phi));
            before = slower;
        }
        assert!(before[79] < 1.01 * before[0], "{before:?}");
    }
}

#[test]
fn very_elastic_pairs_shorten_at_a_rate_of_lambda_alone() {
    // 8 (lambda e)^2 + 2 lambda e = 1 where the viscosity does not count: lambda e = 1/4, the pole of steady extension at
    // the rate 2 e. The pair is 2 R/w long, over 4^(1/3): from x0 to x in 4 lambda ln(w/w0).
    let scene = PairSpec::new(paper::PS, 1.2).build().expect("valid");
    let s = Sintering { c1: 1.0, tau_s: 1e-9, delta_c: 1.0, lambda: 2.0 };
    let w = |x: f64| {
        // The root of 4 w - 1/w^2 = 3 x/2^(2/3).
        let (mut low, mut high) = (0.6, 1.0);
        for _ in 0..60 {
            let middle: f64 = 0.5 * (low + high);
            let rest = 4.0 * middle - middle.powi(-2) - 3.0 * x / 4f64.cbrt();
            if rest < 0.0 { low = middle } else { high = middle }
        }
        high
    };
    for ratio in [0.1, 0.5, 1.0, 1.2] {
        let found =
            time_to_contact_ratio(&scene, Kinetics::Bellehumeur, &s, ratio).expect("reached");
        let exact = 4.0 * s.lambda * (w(ratio * ratio) / w(scene.x0())).ln();
        assert!((found / exact - 1.0).abs() < 1e-6, "{ratio}: {found} {exact}");
    }
}

#[test]
fn stages_are_absent_where_the_knee_is_out_of_range() {
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build().expect("valid");
    let at = |delta_c| knee(&scene, &Sintering { c1: 1e-5, tau_s: 1.0, delta_c, lambda: 0.0 });
    let low = at(1e-10);
    assert!(!low.has_zipping && low.has_stretching && low.time_s == 0.0);
    let high = at(1e-4);
    assert!(high.has_zipping && !high.has_stretching && high.time_s.is_infinite());
    let both = at(1e-7);
    assert!(both.has_zipping && both.has_stretching && both.time_s > 0.0);

    // Without stage 2 three-stage is Frenkel's law, to the bit.
    let s = Sintering { c1: 1e-5, tau_s: 1.0, delta_c: 1e-10, lambda: 0.0 };
    let times = [0.0, 0.1, 0.5, 1.0, 3.0];
    let (mut a, mut b) = ([0.0; 5], [0.0; 5]);
    let settings = SolverSettings::default();
    contact_ratios(&scene, Kinetics::ThreeStage, &s, &settings, &times, &mut a).expect("valid");
    contact_ratios(&scene, Kinetics::Frenkel, &s, &settings, &times, &mut b).expect("valid");
    assert_eq!(a, b);
}

#[test]
fn regime_map_depends_on_the_product_of_c1_and_the_square_of_delta_c_alone() {
    let (scene, s) = materials()[1].clone();
    let other = Sintering { c1: 4.0 * s.c1, delta_c: s.delta_c / 2.0, ..s };
    let times: Vec<f64> = (0..50).map(|i| 0.01 * f64::from(i * i)).collect();
    let curve = |s: &Sintering, kinetics| {
        let mut out = vec![0.0; times.len()];
        contact_ratios(&scene, kinetics, s, &SolverSettings::default(), &times, &mut out)
            .expect("valid");
        out
    };
    for (a, b) in curve(&s, Kinetics::RegimeMap).iter().zip(curve(&other, Kinetics::RegimeMap)) {
        assert!((a - b).abs() < 1e-14);
    }
    assert_ne!(curve(&s, Kinetics::ThreeStage), curve(&other, Kinetics::ThreeStage));
}

#[test]
fn regime_map_is_the_maximum_of_equations_3_4_and_5() {
    use std::f64::consts::PI;
    let (scene, s) = materials()[2].clone();
    let (r, gamma) = (scene.radius_m(), scene.powder().surface_tension_n_per_m);
    let times: Vec<f64> = (0..60).map(|i| 1e-8 * 10f64.powf(f64::from(i) / 6.0)).collect();
    let mut out = vec![0.0; times.len()];
    contact_ratios(&scene, Kinetics::RegimeMap, &s, &SolverSettings::default(), &times, &mut out)
        .expect("valid");
    for (t, found) in times.iter().zip(out) {
        let a1 = (63.0 * PI.powi(3) / 16.0).powf(1.0 / 7.0)
            * (s.delta_c / r).powf(2.0 / 7.0)
            * (2.0 * s.c1 * gamma * t / r).powf(1.0 / 7.0);
        let a2 = (t / s.tau_s).sqrt();
        let expected = a1.max(a2).max(1e-3f64.sqrt()).min(2f64.cbrt());
        assert!((found - expected).abs() < 1e-14, "{t}: {found} against {expected}");
    }
}

#[test]
fn the_lines_of_figure_2_cross_at_p1_and_p2_and_make_the_regime_map() {
    for (scene, s) in materials() {
        let regimes = Regimes::new(scene.powder(), &s);
        let (p1, p2) = (regimes.p1_s(), regimes.p2_s());
        assert!((regimes.zipping(p1) / regimes.adhesive - 1.0).abs() < 1e-13);
        assert!((regimes.zipping(p2) / regimes.stretching(p2) - 1.0).abs() < 1e-13);
        let times = [0.3 * p2, p2, 1.5 * p2];
        let mut map = [0.0; 3];
        let settings = SolverSettings::default();
        contact_ratios(&scene, Kinetics::RegimeMap, &s, &settings, &times, &mut map)
            .expect("valid");
        for (t, found) in times.into_iter().zip(map) {
            let expected = regimes.zipping(t).max(regimes.stretching(t));
            let held = expected.clamp(scene.start_contact_ratio(), scene.final_contact_ratio());
            assert!((found - held).abs() < 1e-14, "{t}: {found} against {held}");
        }
    }
}
