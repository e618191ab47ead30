//! Sintered necks that resist shear, rolling and twist, against closed forms.

use std::ops::ControlFlow;

use dem_core::Kinetics;
use dem_core::bed::{
    Bed, BedError, Drive, Friction, Material, QuasiStaticReport, QuasiStaticSettings, Region,
    Scene, SceneFile, Side, Start, Surroundings,
};

use crate::builders::{PA12_SINTERING, growing, material, positions, spec};

const R: f64 = 31.5e-6;
const PI: f64 = std::f64::consts::PI;
const MASS: f64 = 1000.0 * 4.0 / 3.0 * PI * R * R * R;
const TAU_S: f64 = PA12_SINTERING.tau_s;
const ADHESIVE: f64 = 1e-3;

fn heated() -> Drive {
    Drive { growing: Some(growing(Kinetics::Frenkel)), ..Drive::default() }
}

/// A material whose overlap under adhesion alone is that of the pair, with an adhesive force.
fn sticky(adhesion_n: f64, neck_viscosity: f64) -> Material {
    let adhesive = material(|spec| spec.k1 = adhesion_n / (ADHESIVE * R));
    adhesive.with_neck_viscosity(neck_viscosity).expect("in its range")
}

/// `c_n = fa tau_s/R` of Frenkel's law, the same for every neck \[N s/m\].
fn normal_resistance(adhesion_n: f64) -> f64 {
    adhesion_n * TAU_S / R
}

const BOND_NUMBER: f64 = 1000.0;

/// A particle between two that lie on the floor, a little above it.
fn beam(neck_viscosity: f64) -> Bed {
    let reach = 2.0 - ADHESIVE;
    let height: f64 = 0.04;
    let across = (reach * reach - height * height).sqrt();
    let start = Start {
        position_m: [
            [2.0, 5.0, 1.0],
            [2.0 + across, 5.0, 1.0 + height],
            [2.0 + 2.0 * across, 5.0, 1.0],
        ]
        .map(|r| r.map(|x| x * R))
        .to_vec(),
        radius_m: vec![R; 3],
        ..Start::default()
    };
    let around = Surroundings {
        region: Region { size_m: [10.0 * R; 3], sides: [Side::Open, Side::Open, Side::LowerWall] },
        gravity_m_per_s2: [0.0, 0.0, -9.81],
        ..Surroundings::NOTHING
    };
    let material = sticky(BOND_NUMBER * MASS * 9.81, neck_viscosity);
    Bed::new(material, around, &start).expect("valid")
}

/// How far the contacts of the middle have turned \[rad\]; their approach alone does not turn them.
fn turned(bed: &Bed, since: &Bed) -> f64 {
    let slope = |bed: &Bed| {
        let r = positions(bed);
        let (dx, dz) = (r[1][0] - r[0][0], r[1][2] - r[0][2]);
        dz / dx.hypot(dz)
    };
    slope(since) - slope(bed)
}

/// The middle carries half its weight to each neck, at a distance `d = 2 - x` of the centres: the turn is of the rate
/// `m g/(2 d) (1/c_shear + (d R/2)^2/c_bending)`, with `c_shear = nu c_n/3`, `c_bending = nu c_n x R^2/4` and Frenkel's `x = x0 + t/tau_s`.
fn expected_turn(neck_viscosity: f64, from_s: f64, to_s: f64) -> f64 {
    let [a, b] = [from_s, to_s].map(|t| ADHESIVE + t / TAU_S);
    let integral = 3.0 * ((2.0 - a) / (2.0 - b)).ln() + 2.0 * (b / a).ln() - (b - a);
    0.5 / (BOND_NUMBER * neck_viscosity) * integral
}

/// The turn that the springs of Newton's law hold, `k_shear = 2/7 K1` and `k_bending = k_shear x R^2/4`, where their dashpots are strong.
fn held_turn(at_s: f64) -> f64 {
    let x = ADHESIVE + at_s / TAU_S;
    let d = 2.0 - x;
    0.5 * ADHESIVE / BOND_NUMBER * 3.5 * (1.0 / d + d / x)
}

fn balance(bed: &mut Bed, report: &mut QuasiStaticReport, until_s: f64) {
    let exact = QuasiStaticSettings { tolerance: 1e-4, balance: 1e-8, ..Default::default() };
    bed.advance_quasi_static(until_s, &exact, report).expect("balances");
}

#[test]
fn beam_of_three_sags_in_balance_as_shear_and_bending_of_its_necks_say() {
    for neck_viscosity in [0.5, 1.0, 4.0] {
        let mut bed = beam(neck_viscosity);
        bed.begin(&heated()).expect("stable");
        let mut report = QuasiStaticReport::default();
        balance(&mut bed, &mut report, 0.01);
        for (from_s, to_s) in [(0.01, 0.05), (0.05, 0.2), (0.2, 0.6)] {
            let before = bed.clone();
            balance(&mut bed, &mut report, to_s);
            let (found, expected) =
                (turned(&bed, &before), expected_turn(neck_viscosity, from_s, to_s));
            assert!(
                (found / expected - 1.0).abs() < 0.01,
                "nu {neck_viscosity}: {found} {expected}"
            );
        }
    }
}

#[test]
fn beam_of_three_sags_in_motion_as_shear_and_bending_of_its_necks_say() {
    let mut bed = beam(1.0);
    bed.begin(&heated()).expect("stable");
    let go = |bed: &mut Bed, until_s: f64| {
        let steps = ((until_s - bed.time_s()) / bed.step_s()).round() as u64;
        bed.advance(steps).expect("runs");
    };
    go(&mut bed, 0.05);
    let before = bed.clone();
    go(&mut bed, 0.2);
    let (found, viscous) = (turned(&bed, &before), expected_turn(1.0, 0.05, 0.2));
    let expected = viscous + held_turn(0.2) - held_turn(0.05);
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
}

#[test]
fn beam_of_necks_without_resistance_falls_to_the_floor() {
    let mut bed = beam(0.0);
    bed.begin(&heated()).expect("stable");
    let mut report = QuasiStaticReport::default();
    balance(&mut bed, &mut report, 0.1);
    assert!(positions(&bed)[1][2] < R, "{:?}", positions(&bed));
}

/// A pair along x with velocities along y and spins \[1/s\] about axes.
fn pair(neck_viscosity: f64, velocity: f64, spins: [[f64; 3]; 2]) -> Bed {
    let distance = (2.0 - ADHESIVE) * R;
    let start = Start {
        position_m: vec![[0.0; 3], [distance, 0.0, 0.0]],
        radius_m: vec![R; 2],
        velocity_m_per_s: vec![[0.0, 0.5 * velocity, 0.0], [0.0, -0.5 * velocity, 0.0]],
        angular_velocity_per_s: spins.to_vec(),
    };
    let material = sticky(spec().k1 * ADHESIVE * R, neck_viscosity);
    let mut bed = Bed::new(material, Surroundings::NOTHING, &start).expect("valid");
    bed.begin(&heated()).expect("stable");
    bed
}

fn advanced(mut bed: Bed, time_s: f64) -> Bed {
    bed.advance((time_s / bed.step_s()).round() as u64).expect("runs");
    bed
}

#[test]
fn sliding_of_a_pair_decays_by_the_shear_resistance_of_its_neck() {
    // The point of contact has the mass of 2/m + 5/m: translation and rotation.
    let (nu, v) = (0.01, 1e-7);
    let c = nu * normal_resistance(spec().k1 * ADHESIVE * R) / 3.0;
    let rate = 7.0 * c / MASS;
    let time_s = 1.5 / rate;
    let bed = advanced(pair(nu, v, [[0.0; 3]; 2]), time_s);
    let (p, arm) = (bed.particles(), 1.0 - 0.5 * ADHESIVE);
    let [a, b] = [0, 1].map(|i| p.velocity_m_per_s[i][1]);
    let [s, t] = [0, 1].map(|i| p.angular_velocity_per_s[i][2]);
    // The contact lies at x above the first and below the second.
    let sliding = (a + s * R * arm) - (b - t * R * arm);
    let expected = (-rate * bed.time_s()).exp();
    assert!((sliding / v / expected - 1.0).abs() < 0.02, "{} {expected}", sliding / v);
}

#[test]
fn bending_and_twist_of_a_pair_decay_by_the_second_moments_of_its_neck() {
    let inertia = 0.4 * MASS * R * R;
    let c = normal_resistance(spec().k1 * ADHESIVE * R);
    for (axis, share) in [(0, 1.0 / 6.0), (1, 0.25), (2, 0.25)] {
        let (nu, time_s) = (0.05, 0.12);
        let spin = |sign: f64| {
            let mut spin = [0.0; 3];
            spin[axis] = sign * 1e-3;
            spin
        };
        let bed = advanced(pair(nu, 0.0, [spin(1.0), spin(-1.0)]), time_s);
        let found = bed.particles().angular_velocity_per_s[0][axis] / 1e-3;
        let t = bed.time_s();
        // The integral of 2 c_turning/I over the squared radius of the neck, x R^2.
        let x = ADHESIVE * t + t * t / (2.0 * TAU_S);
        let expected = (-2.0 * nu * c * share * R * R * x / inertia).exp();
        assert!(
            expected < 0.6 && (found / expected - 1.0).abs() < 0.02,
            "{axis}: {found} {expected}"
        );
    }
}

#[test]
fn a_pair_that_turns_as_one_body_is_not_resisted() {
    let spin = 1e-3;
    // The second particle moves along -y where the pair turns by -z.
    let distance = (2.0 - ADHESIVE) * R;
    let bed = advanced(pair(1.0, spin * distance, [[0.0, 0.0, -spin]; 2]), 0.05);
    for w in &bed.particles().angular_velocity_per_s {
        // The pair shrinks by x/2 and keeps its angular momentum: 10/7 of this in the angular velocity.
        let grown = 0.05 / TAU_S;
        assert!((w[2] / -spin - 1.0 - 5.0 / 7.0 * grown).abs() < 2e-3, "{w:?} {grown}");
    }
}

#[test]
fn resistance_of_necks_out_of_its_range_is_refused() {
    for value in [-1.0, 1e-9, 1e9, f64::NAN] {
        let error = material(|_| ()).with_neck_viscosity(value).expect_err("refused");
        assert!(matches!(error, BedError::Field { .. }), "{error}");
    }
}
/// Sixty particles, settled or jammed, in heated phases of both modes.
fn packed(neck_viscosity: &str) -> Scene {
    let text = format!(
        r#"
        name = "necks"
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
        {neck_viscosity}
        [box]
        sides = ["periodic", "periodic", "periodic"]
        [particles.packing]
        count = 60
        radii = {{ histogram = {{ edges_m = [28e-6, 35e-6], weights = [1.0] }} }}
        seed = 2
        [[phases]]
        name = "motion"
        duration_s = 0.02
        heated = true
        outputs = 2
        [[phases]]
        name = "balance"
        duration_s = 0.2
        heated = true
        mode = "quasi-static"
        outputs = 2
        tolerance = 1e-2
        "#
    );
    SceneFile::parse(&text, "necks").expect("parses").build().expect("valid")
}

#[test]
fn necks_give_the_same_bits_on_any_number_of_threads_and_after_a_checkpoint() {
    let scene = packed("neck_viscosity = 1.0");
    let run = |threads: usize, stop_after: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| {
            let mut run = scene.start();
            for _ in 0..stop_after {
                run.advance().expect("runs");
            }
            run = scene.resume(&run.checkpoint()).expect("the same scene");
            while run.advance().expect("runs").is_some() {}
            run.series().clone()
        })
    };
    let one = run(1, 0);
    assert_eq!(one.samples.len(), 6);
    for (threads, stop_after) in [(3, 2), (1, 4), (2, 5)] {
        assert!(run(threads, stop_after) == one, "{threads} threads, stopped after {stop_after}");
    }
    let none = packed("");
    assert!(none.bed().particles().angular_velocity_per_s.is_empty());
    let zero = packed("neck_viscosity = 0.0").run(|_, _| ControlFlow::Continue(()));
    assert!(zero == none.run(|_, _| ControlFlow::Continue(())));
    assert!(zero.expect("runs") != one);
}

/// A bed that settles and is heated from balance to balance.
fn settled(neck_viscosity: &str) -> Scene {
    let text = format!(
        r#"
        name = "settled"
        [material]
        youngs_modulus_pa = 1.65e9
        surface_tension_n_per_m = 40.7e-3
        density_kg_per_m3 = 1000.0
        k1_n_per_m = 0.5
        [sintering]
        kinetics = "frenkel"
        c1 = 1.0
        tau_s = 3.81
        delta_c = 1e-7
        calibrated_radius_m = 31.5e-6
        {neck_viscosity}
        [box]
        size_m = [252e-6, 252e-6, 1e-3]
        sides = ["periodic", "periodic", "lower-wall"]
        [particles.packing]
        count = 60
        relative_density = 0.45
        radii = {{ equal = {{ radius_m = 31.5e-6 }} }}
        seed = 1
        [adhesion]
        bond_number = 100.0
        [gravity]
        acceleration_m_per_s2 = [0.0, 0.0, -9.81]
        [drag]
        viscosity_pa_s = 2e-4
        [[phases]]
        name = "settle"
        duration_s = 0.05
        heated = false
        outputs = 1
        [[phases]]
        name = "heat"
        duration_s = 1.5
        heated = true
        mode = "quasi-static"
        outputs = 15
        tolerance = 3e-3
        "#
    );
    SceneFile::parse(&text, "settled").expect("parses").build().expect("valid")
}

#[test]
fn resistance_that_goes_to_nothing_tends_to_none() {
    let run = |nu: &str| settled(nu).run(|_, _| ControlFlow::Continue(())).expect("runs").samples;
    let (none, little) = (run(""), run("neck_viscosity = 1e-6"));
    // The first observation of the heat is of a balance without growth.
    for (a, b) in none.iter().zip(&little).take(3) {
        assert!((a.relative_density / b.relative_density - 1.0).abs() < 1e-6, "{a:?} {b:?}");
        assert!((a.mean_contact_ratio - b.mean_contact_ratio).abs() < 1e-6, "{a:?} {b:?}");
        assert_eq!(a.coordination, b.coordination);
    }
    let (a, b) = (none[8], little[8]);
    assert!((a.relative_density / b.relative_density - 1.0).abs() < 0.02, "{a:?} {b:?}");
}

#[test]
fn rates_before_and_after_the_hand_over_differ_where_fixed_sides_and_necks_resist() {
    let rates = |nu: &str| {
        let series = settled(nu).run(|_, _| ControlFlow::Continue(())).expect("runs");
        let end = series.hand_over.expect("necks meet");
        let rates = series.end_rates.expect("a closed law follows");
        // The last two observations by the contacts say the same, roughly.
        let before = series.samples.iter().rposition(|s| s.time_s < end.time_s).expect("before");
        let [a, b] = [series.samples[before - 1], end];
        let seen = 3.81 * (b.relative_density - a.relative_density) / (b.time_s - a.time_s);
        assert!((rates.by_pairs / seen - 1.0).abs() < 0.4, "{rates:?} {seen}");
        rates
    };
    let stiff = rates("neck_viscosity = 10.0");
    assert!(stiff.by_closed_law > 1.5 * stiff.by_pairs, "{stiff:?}");
}

#[test]
fn springs_of_necks_hold_the_energy_of_the_motion_that_they_stop() {
    // Dashpots so strong that the springs alone give way, and so hard that the neck hardly grows while they do.
    let distance = (2.0 - ADHESIVE) * R;
    let friction = Friction {
        coefficient: 0.0,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 0.0,
    };
    let k1 = 1e6 * spec().k1;
    // Sliding, twist, bending; of two spins the springs take all, of sliding a part: the point of contact has the mass of 2/m + 5/m.
    for (velocity, axis, share) in
        [(1e-2, None, 2.0 / 7.0), (0.0, Some(0), 1.0), (0.0, Some(1), 1.0)]
    {
        let spin = |sign: f64| {
            let mut spin = [0.0; 3];
            if let Some(axis) = axis {
                spin[axis] = 100.0 * sign;
            }
            spin
        };
        let start = Start {
            position_m: vec![[0.0; 3], [distance, 0.0, 0.0]],
            radius_m: vec![R; 2],
            velocity_m_per_s: vec![[0.0, 0.5 * velocity, 0.0], [0.0, -0.5 * velocity, 0.0]],
            angular_velocity_per_s: vec![spin(1.0), spin(-1.0)],
        };
        let around = Surroundings { friction: Some(friction), ..Surroundings::NOTHING };
        let mut bed = Bed::new(sticky(k1 * ADHESIVE * R, 1e6), around, &start).expect("valid");
        bed.begin(&heated()).expect("stable");
        let moving = |bed: &Bed| bed.energies().translation_j + bed.energies().rotation_j;
        let (first, mut most) = (moving(&bed), 0.0f64);
        // A quarter of a period of the turns, with omega^2 = 2 (2/7 K1 x R^2/4)/(2/5 m R^2).
        let period_s = 2.0 * PI / (k1 / MASS * ADHESIVE / 2.8).sqrt();
        let steps = (0.3 * period_s / bed.step_s()) as u64;
        for _ in 0..steps {
            bed.advance(1).expect("runs");
            let held = bed.energies().springs_j;
            most = most.max(held / first);
            let sum = (moving(&bed) + held) / first;
            assert!((sum - 1.0).abs() < 0.03, "{axis:?}: {sum} at {} s", bed.time_s());
        }
        assert!((most / share - 1.0).abs() < 0.03, "{axis:?}: {most}");
    }
}
