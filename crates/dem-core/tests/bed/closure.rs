//! The end of the pairs, and the closed laws that follow.

use std::ops::ControlFlow;

use dem_core::bed::{Law, SceneFile, Series};
use dem_core::densification::{Approach, CLOSED, affine_density, closure_rate, closure_time};
use dem_core::{Kinetics, SolverKind, SolverSettings, simulate};

use crate::builders::spec;

/// Sixty jammed particles in a box that shrinks with them, and is heated for twice tau_s.
const FREE: &str = r#"
name = "free"
[material]
youngs_modulus_pa = 1.65e9
surface_tension_n_per_m = 40.7e-3
density_kg_per_m3 = 1000.0
[sintering]
kinetics = "frenkel"
c1 = 1.177e-5
tau_s = 3.81
delta_c = 9.55e-8
calibrated_radius_m = 31.5e-6
[box]
sides = ["periodic", "periodic", "periodic"]
free = true
[particles.packing]
count = 60
radii = { equal = { radius_m = 31.5e-6 } }
seed = 3
[[phases]]
name = "heat"
duration_s = 8.0
heated = true
mode = "quasi-static"
outputs = 80
tolerance = 1e-2
"#;

fn run(text: &str) -> Series {
    let scene = SceneFile::parse(text, "scene.toml").expect("a scene").build().expect("valid");
    scene.run(|_, _| ControlFlow::Continue(())).expect("runs")
}

/// Density never falls nor exceeds 1, the laws come in their order, and after the hand-over the density is that of the
/// closed formula from there.
fn ends_where_matter_ends(series: &Series, tau_s: f64) {
    let from = series.hand_over.expect("the pairs end");
    assert!(from.relative_density < CLOSED + 0.006, "{from:?}");
    assert!(from.coordination < 13.0, "{from:?}");
    for pair in series.samples.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        // A bed that settles with inertia swings a little.
        let swing = if b.law == Law::Pairs { 1e-3 } else { 0.0 };
        assert!(b.relative_density >= a.relative_density - swing, "{a:?} {b:?}");
        assert!(b.relative_density <= 1.0, "{b:?}");
        assert!(b.coordination <= from.coordination + 1.0, "{b:?}");
        assert!((a.law as u8) <= b.law as u8, "{a:?} {b:?}");
        if b.law != Law::Pairs && b.relative_density < 0.995 {
            let took = (b.time_s - from.time_s) / tau_s;
            let formula = closure_time(from.relative_density, b.relative_density);
            assert!((took - formula).abs() < 1e-9, "{b:?}: {took} {formula}");
            assert_eq!((b.law == Law::Cell), b.relative_density < CLOSED, "{b:?}");
        }
    }
}

#[test]
fn a_free_bed_hands_over_where_its_necks_meet_and_never_exceeds_density_one() {
    for kinetics in ["frenkel", "three-stage", "pokluda"] {
        for approach in ["overlap", "energy-balance", "kingery-berg"] {
            let text =
                FREE.replace("\"frenkel\"", &format!("\"{kinetics}\"\napproach = \"{approach}\""));
            let series = run(&text);
            ends_where_matter_ends(&series, 3.81);
            assert_eq!(series.samples.len(), 81);
            let last = series.samples.last().expect("observed");
            assert!(last.relative_density > 0.999 && last.law == Law::Pores, "{last:?}");
        }
    }
}

#[test]
fn unequal_particles_have_a_cell_each_and_the_time_scale_of_their_mean_volume() {
    let radii = "{ log-normal = { median_m = 31.5e-6, sigma = 0.25 } }";
    let text = FREE.replace("{ equal = { radius_m = 31.5e-6 } }", radii);
    let scene = SceneFile::parse(&text, "unequal").expect("a scene").build().expect("valid");
    let radii = &scene.bed().particles().radius_m;
    let volume = radii.iter().map(|radius| radius.powi(3)).sum::<f64>() / radii.len() as f64;
    let tau_s = 3.81 * volume.cbrt() / 31.5e-6;
    assert!((tau_s - 3.81).abs() > 0.1, "{tau_s}");
    ends_where_matter_ends(&run(&text), tau_s);
}

#[test]
fn a_bed_that_is_looked_at_once_hands_over_at_the_same_moment() {
    let often = run(FREE).hand_over.expect("the pairs end");
    let once = run(&FREE.replace("outputs = 80", "outputs = 1"));
    ends_where_matter_ends(&once, 3.81);
    let once = once.hand_over.expect("the pairs end");
    assert!((once.time_s / often.time_s - 1.0).abs() < 0.05, "{once:?} {often:?}");
}

#[test]
fn a_run_may_end_where_necks_meet_instead() {
    let series = run(&FREE.replace("\"frenkel\"", "\"frenkel\"\nwhen_necks_meet = \"stop\""));
    let (last, end) = (series.samples.last().expect("observed"), series.hand_over.expect("ends"));
    assert_eq!(*last, end);
    assert!(last.law == Law::Pairs && last.time_s < 2.0, "{last:?}");
    assert!(!series.stopped && series.samples.len() < 25);
}

#[test]
fn a_lattice_hands_over_where_its_pores_close_before_its_necks_meet() {
    // Simple cubic: six necks at right angles would meet at a/R = 0.71, where the density of the pairs is 1.24.
    let lattice = FREE
        .replace("[particles.packing]\ncount = 60", "[particles.lattice]\ncounts = [4, 4, 4]")
        .replace("radii = { equal = { radius_m = 31.5e-6 } }\nseed = 3", "radius_m = 31.5e-6")
        .replace("free = true", "free = true\nsize_m = [251.9e-6, 251.9e-6, 251.9e-6]");
    let series = run(&lattice);
    ends_where_matter_ends(&series, 3.81);
    let end = series.hand_over.expect("ends");
    // rho = rho0/(1 - x/2)^3 with x = t/tau_s, followed for another 0.02 tau_s.
    let (rates, rho) = (series.end_rates.expect("a closed law follows"), end.relative_density);
    let left = (std::f64::consts::PI / 6.0 / rho).cbrt();
    let further = rho * (left / (left - 0.01)).powi(3);
    assert!((rates.by_pairs / ((further - rho) / 0.02) - 1.0).abs() < 0.01, "{rates:?}");
    assert_eq!(rates.by_closed_law, closure_rate(rho));
    assert!(end.necks_meet == 0.0 && end.relative_density >= CLOSED, "{end:?}");
}

#[test]
fn closed_laws_rest_while_nothing_is_heated() {
    let phase = |name: &str, heated: bool| {
        format!(
            "[[phases]]\nname = \"{name}\"\nduration_s = 1.0\nheated = {heated}\nmode = \"quasi-static\"\noutputs = 4\ntolerance = 1e-2\n"
        )
    };
    let (start, _) = FREE.split_once("[[phases]]").expect("phases");
    let both =
        format!("{start}{}{}{}", phase("one", true), phase("rest", false), phase("two", true));
    let series = run(&both);
    let density: Vec<f64> = series.samples.iter().map(|sample| sample.relative_density).collect();
    let hand_over = series.hand_over.expect("ends in the first phase");
    assert!(hand_over.time_s < 1.0 && series.samples.len() == 15);
    assert!(density[4..=10].iter().all(|d| *d == density[4]), "{density:?}");
    let heated_s = 2.0 - hand_over.time_s;
    let took = closure_time(hand_over.relative_density, density[14]);
    assert!((took - heated_s / 3.81).abs() < 1e-9, "{took}");
    let times: Vec<f64> = series.samples.iter().map(|sample| sample.time_s).collect();
    assert!(times.is_sorted() && (times[14] - 3.0).abs() < 1e-9, "{times:?}");
}

#[test]
fn a_bed_with_a_surface_hands_over_in_a_dynamic_phase_too() {
    let (start, _) = FREE.split_once("[box]").expect("a box");
    let text = format!(
        "{}{}",
        start
            .replace("tau_s = 3.81", "tau_s = 0.02")
            .replace("[sintering]", "k1_n_per_m = 0.5\n[sintering]"),
        r#"
        [box]
        size_m = [252e-6, 252e-6, 1e-3]
        sides = ["periodic", "periodic", "lower-wall"]
        [particles.packing]
        count = 60
        relative_density = 0.55
        radii = { equal = { radius_m = 31.5e-6 } }
        seed = 1
        [adhesion]
        bond_number = 100.0
        [gravity]
        acceleration_m_per_s2 = [0.0, 0.0, -9.81]
        [[phases]]
        name = "settle"
        duration_s = 0.02
        heated = false
        outputs = 2
        [[phases]]
        name = "heat"
        duration_s = 0.1
        heated = true
        outputs = 20
        "#
    );
    ends_where_matter_ends(&run(&text), 0.02);
}

#[test]
fn a_cluster_without_a_volume_makes_no_contacts_once_its_necks_have_met() {
    let (start, _) = FREE.split_once("[box]").expect("a box");
    let mut positions = String::new();
    for i in 0..27 {
        let at = [i % 3, i / 3 % 3, i / 9].map(|k| f64::from(k) * 62.9685e-6);
        positions += &format!("{at:?},");
    }
    let text = format!(
        "{start}[particles.table]\npositions_m = [{positions}]\nradii_m = {:?}\n\
         [[phases]]\nname = \"heat\"\nduration_s = 8.0\nheated = true\nmode = \"quasi-static\"\noutputs = 40\ntolerance = 1e-2",
        [31.5e-6; 27]
    );
    let series = run(&text);
    let end = series.hand_over.expect("necks meet");
    let last = series.samples.last().expect("observed");
    assert!(last.law == Law::Pairs && last.relative_density.is_nan());
    assert!(last.mean_contact_ratio > 1.2, "the pairs go on: {last:?}");
    assert!(last.coordination <= end.coordination, "{end:?} {last:?}");
}

#[test]
fn a_run_resumed_before_or_after_the_hand_over_is_the_run_without_a_stop() {
    let scene = SceneFile::parse(FREE, "free").expect("a scene").build().expect("valid");
    let mut whole = scene.start();
    let mut bytes = Vec::new();
    while whole.advance().expect("runs").is_some() {
        bytes.push(whole.checkpoint());
    }
    for at in [3, 8, 12, 30, 80] {
        let mut resumed = scene.resume(&bytes[at]).expect("whole");
        while resumed.advance().expect("runs").is_some() {}
        assert!(resumed.series() == whole.series(), "after observation {at}");
    }
}

#[test]
fn particles_approach_each_other_by_the_law_that_is_named_while_the_neck_grows_as_ever() {
    let pair = spec().build().expect("valid");
    let times = [0.05, 0.2, 0.5];
    let closed = SolverSettings::of(SolverKind::ClosedForm);
    for approach in Approach::ALL {
        for mode in ["quasi-static", "dynamic"] {
            let (start, _) = FREE.split_once("[box]").expect("a box");
            let start = start
                .replace("\"frenkel\"", &format!("\"three-stage\"\napproach = \"{approach}\""));
            let lattice = "[particles.lattice]\ncounts = [2, 1, 1]\nradius_m = 31.5e-6\n";
            let phase = format!(
                "[[phases]]\nname = \"heat\"\nduration_s = 0.5\nheated = true\nmode = \"{mode}\"\noutputs = 10"
            );
            let text = format!("{start}{lattice}{phase}");
            let scene = SceneFile::parse(&text, "pair").expect("a scene").build().expect("valid");
            let sintering = scene.growing().expect("heated").sintering;
            let curve = simulate(&pair, Kinetics::ThreeStage, &sintering, &closed, &times);
            let curve = curve.expect("runs").contact_ratio;
            let mut seen = Vec::new();
            scene
                .run(|progress, bed| {
                    let contact = bed.contacts().next().expect("bound");
                    seen.push((progress.sample.time_s, contact));
                    ControlFlow::Continue(())
                })
                .expect("runs");
            for (time, expected) in times.into_iter().zip(curve) {
                let (_, contact) =
                    seen.iter().find(|(at, _)| (at - time).abs() < 1e-6).expect("observed");
                let (ratio, approached) = (contact.contact_ratio(), contact.approach_m / 31.5e-6);
                // Inertia of the soft contact is what remains in the dynamic mode.
                assert!((ratio - expected).abs() < 6e-3, "{approach} {mode}: {ratio} {expected}");
                let law = approach.factor() * ratio * ratio;
                assert!((approached / law - 1.0).abs() < 1e-9, "{approach} {mode}: {approached}");
            }
        }
    }
}

#[test]
fn while_its_necks_are_apart_a_free_bed_follows_the_affine_formula_of_its_approach() {
    for approach in Approach::ALL {
        let name = format!("\"frenkel\"\napproach = \"{approach}\"");
        let series = run(&FREE.replace("\"frenkel\"", &name).replace("1e-2", "1e-3"));
        let start = series.samples[0].relative_density;
        let until = series.hand_over.expect("ends").time_s;
        for sample in series.samples.iter().take_while(|sample| sample.time_s < until) {
            let affine = affine_density(start, 1e-3 + sample.time_s / 3.81, approach);
            let off = sample.relative_density / affine - 1.0;
            assert!(off.abs() < 0.02, "{approach} at {} s: {off}", sample.time_s);
        }
    }
}

/// Three touching particles in an empty box: no bed that could become dense.
#[test]
fn a_cluster_in_an_empty_box_has_no_closed_law() {
    let (start, _) = FREE.split_once("[box]").expect("a box");
    let text = start.to_owned()
        + r#"
[box]
size_m = [1e-3, 1e-3, 1e-3]
sides = ["periodic", "periodic", "periodic"]
free = true
[particles.table]
positions_m = [[400e-6, 400e-6, 400e-6], [462.97e-6, 400e-6, 400e-6], [431.485e-6, 454.535e-6, 400e-6]]
radii_m = [31.5e-6, 31.5e-6, 31.5e-6]
[[phases]]
name = "heat"
duration_s = 16.0
heated = true
mode = "quasi-static"
outputs = 4
tolerance = 3e-3
"#;
    let series = run(&text);
    let last = series.samples.last().expect("samples");
    assert_eq!(last.law, Law::Pairs);
    assert!(last.relative_density < 0.9, "{}", last.relative_density);
}
