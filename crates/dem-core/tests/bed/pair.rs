//! The pair through the general engine is the pair of the pair solver.

use dem_core::bed::{Bed, Drive, QuasiStaticReport, QuasiStaticSettings, final_contact_ratio};
use dem_core::densification::Approach;
use dem_core::{Damping, Kinetics, SolverKind, SolverSettings, paper, simulate};
use std::f64::consts::PI;

use crate::builders::{PA12_SINTERING, free, growing, material, spec, start};

const R: f64 = paper::PA12.radius_m;

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

/// Volume of a sphere of radius `r` cut by a plane at a circle of radius `neck` so that the larger part is left, by
/// discs, and of the sphere that has that volume whatever the cut: the radius r for a particle of radius `radius`.
fn cut_sphere(radius: f64, neck: f64) -> Option<(f64, f64)> {
    let volume = |r: f64| {
        let plane = (r * r - neck * neck).max(0.0).sqrt();
        let (discs, mut sum) = (4000, 0.0);
        let thick = (r + plane) / f64::from(discs);
        for disc in 0..discs {
            let z = -r + (f64::from(disc) + 0.5) * thick;
            sum += PI * (r * r - z * z) * thick;
        }
        sum
    };
    let wanted = 4.0 / 3.0 * PI * radius.powi(3);
    let (mut low, mut high) = (neck.max(radius), 2.0 * radius.max(neck));
    if volume(low) > wanted * (1.0 + 1e-6) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if volume(middle) < wanted { low = middle } else { high = middle }
    }
    Some((low, volume(low)))
}

#[test]
fn final_neck_of_any_two_particles_is_the_widest_that_keeps_the_volume_of_both() {
    let phi = 2f64.cbrt();
    assert_eq!(final_contact_ratio(phi, 2.0, 2.0), phi);
    assert_eq!(final_contact_ratio(1.08, 3e-5, 3e-5), 1.08);
    for ratio in [1.0, 0.9, 0.6, 0.3, 0.1, 0.02] {
        let (small, large) = (ratio * R, R);
        let effective = 2.0 * small * large / (small + large);
        let neck = final_contact_ratio(phi, small, large) * effective;
        assert_eq!(final_contact_ratio(phi, large, small), final_contact_ratio(phi, small, large));
        let total = 4.0 / 3.0 * PI * (small.powi(3) + large.powi(3));
        let (dome, of_small) = cut_sphere(small, neck * (1.0 - 1e-6)).expect("room for the neck");
        let (_, of_large) = cut_sphere(large, neck * (1.0 - 1e-6)).expect("room for the neck");
        assert!(((of_small + of_large) / total - 1.0).abs() < 1e-5, "{ratio}: volume");
        assert!((dome / neck - 1.0).abs() < 1e-2, "{ratio}: the smaller one is a hemisphere");
        assert!(cut_sphere(small, 1.001 * neck).is_none(), "{ratio}: a wider neck has no room");
    }
}

#[test]
fn two_particles_of_any_ratio_end_at_their_own_neck_in_both_modes_of_motion() {
    for ratio in [1.0, 0.6, 0.3, 0.1] {
        let (small, large) = (ratio * R, R);
        let effective = 2.0 * small * large / (small + large);
        let reach = small + large - 1e-3 * effective;
        let mut start = start(R, &[[0.0; 3], [0.0, 0.0, reach / R]]);
        start.radius_m = vec![large, small];
        let material = material(|_| ());
        let drive = Drive { growing: Some(growing(Kinetics::Frenkel)), ..Drive::default() };
        let neck = |bed: &Bed| bed.contacts().next().expect("bound").contact_ratio() * effective;
        let wanted = 2f64.cbrt() * small;

        let mut bed = free(material, &start);
        bed.begin(&drive).expect("stable");
        let settings = QuasiStaticSettings::default();
        let mut report = QuasiStaticReport::default();
        bed.advance_quasi_static(0.2, &settings, &mut report).expect("balances");
        let within = neck(&bed);
        bed.advance_quasi_static(20.0, &settings, &mut report).expect("balances");
        assert!((neck(&bed) / wanted - 1.0).abs() < 1e-6, "{ratio}: {}", neck(&bed) / wanted);
        assert!(within < 0.9 * wanted, "{ratio}: still grows at 0.2 s");

        // The same in time, with kinetics a thousand times as fast.
        let mut fast = growing(Kinetics::Frenkel);
        fast.sintering.tau_s *= 1e-3;
        let mut bed = free(material, &start);
        bed.begin(&Drive { growing: Some(fast), ..Drive::default() }).expect("stable");
        bed.advance((0.05 / bed.step_s()) as u64).expect("runs");
        assert!((neck(&bed) / wanted - 1.0).abs() < 1e-3, "{ratio}: {}", neck(&bed) / wanted);
    }
}

/// Volume between two spheres at a distance, from the line of centres to a radius, that where they overlap counted as negative, and
/// that overlap.
fn between(radii: [f64; 2], distance: f64, neck: f64) -> (f64, f64) {
    let (rings, mut total, mut overlap) = (20_000, 0.0, 0.0);
    let wide = neck / f64::from(rings);
    for ring in 0..rings {
        let r = (f64::from(ring) + 0.5) * wide;
        let gap =
            distance - radii.iter().map(|radius| (radius * radius - r * r).sqrt()).sum::<f64>();
        let volume = 2.0 * PI * r * wide * gap;
        total += volume;
        overlap -= volume.min(0.0);
    }
    (total, overlap)
}

#[test]
fn matter_that_overlaps_fills_the_neck_at_all_times_by_kingery_and_berg_and_is_left_out_by_the_overlap()
 {
    for ratio in [1.0, 0.6, 0.3] {
        for approach in [Approach::KingeryBerg, Approach::Overlap] {
            let radii = [R, ratio * R];
            let effective = 2.0 * radii[0] * radii[1] / (radii[0] + radii[1]);
            let mut start = start(R, &[[0.0; 3], [0.0; 3]]);
            start.radius_m = radii.to_vec();
            start.position_m[1][2] = radii[0] + radii[1] - 5e-4 * effective;
            let mut bed = free(material(|_| ()).with_approach(approach), &start);
            let growing = Some(growing(Kinetics::Frenkel));
            bed.begin(&Drive { growing, ..Drive::default() }).expect("stable");
            let mut report = QuasiStaticReport::default();
            let settings = QuasiStaticSettings::default();
            for time in [0.02, 0.1, 0.4] {
                bed.advance_quasi_static(time, &settings, &mut report).expect("balances");
                let r = &bed.particles().position_m;
                let distance = (r[1][2] - r[0][2]).abs();
                let ratio_now = bed.contacts().next().expect("bound").contact_ratio();
                let (left, overlap) = between(radii, distance, ratio_now * effective);
                let x = ratio_now * ratio_now;
                if approach == Approach::KingeryBerg {
                    // Kept to the next order of the neck, which is x.
                    assert!(left.abs() < 4.0 * x * overlap, "{ratio} {time}: {left} of {overlap}");
                } else {
                    // All of the lens `pi a^4/(2R)` is left out: of two equal particles 3/16 of x^2.
                    let lens = 0.5 * PI * (ratio_now * effective).powi(4) / effective;
                    assert!((-left / lens - 1.0).abs() < 2.0 * x, "{ratio} {time}: {left} {lens}");
                }
            }
        }
    }
}
