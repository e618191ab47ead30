//! Invariance of the result under place, direction, numbering, threads and calls.

use dem_core::bed::{Bed, Drive, Friction, Region, Side, Start, Surroundings};
use dem_core::{Damping, Kinetics};

use crate::builders::{cloud, growing, material, positions, velocities};

const R: f64 = 31.5e-6;

fn crowd() -> Start {
    let mut start = cloud(R, 5, 60.0);
    // Unequal radii, so that symmetry hides no mistake.
    for (i, radius) in start.radius_m.iter_mut().enumerate() {
        *radius *= 0.8 + 0.2 * ((i * 7 % 11) as f64 / 10.0);
    }
    start
}

fn run(surroundings: Surroundings, start: &Start, steps: u64) -> Bed {
    let mut bed = Bed::new(material(|_| ()), surroundings, start).expect("valid");
    bed.begin(&Drive { growing: Some(growing(Kinetics::ThreeStage)), ..Drive::default() })
        .expect("stable");
    bed.advance(steps).expect("runs");
    bed
}

fn periodic() -> Surroundings {
    Surroundings { region: Region::new([10.7 * R; 3], Side::Periodic), ..Surroundings::NOTHING }
}

fn furthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter()
        .zip(b)
        .flat_map(|(a, b)| (0..3).map(move |axis| (a[axis] - b[axis]).abs()))
        .fold(0.0, f64::max)
}

const STEPS: u64 = 400;

#[test]
fn the_scene_collides_and_rebuilds_its_list() {
    let bed = run(periodic(), &crowd(), STEPS);
    assert!(bed.work().rebuilds > 1, "{:?}", bed.work());
    assert!(bed.contacts().count() > 50, "{}", bed.contacts().count());
}

#[test]
fn momentum_is_conserved_to_rounding() {
    let start = crowd();
    let mut bed = run(periodic(), &start, 0);
    let momentum = |bed: &Bed| {
        let mut total = [0.0; 3];
        let p = bed.particles();
        for (v, radius) in p.velocity_m_per_s.iter().zip(&p.radius_m) {
            for axis in 0..3 {
                total[axis] += v[axis] * (radius / R).powi(3) / R;
            }
        }
        total
    };
    let before = momentum(&bed);
    bed.advance(STEPS).expect("runs");
    let after = momentum(&bed);
    for axis in 0..3 {
        assert!((after[axis] - before[axis]).abs() < 1e-10, "{before:?} {after:?}");
    }
}

#[test]
fn energy_never_grows_where_nothing_puts_it_in() {
    // Collisions, adhesion, plastic loading, cohesion and friction, but no heat: what a contact loses does not come back.
    let rough = |coefficient: f64, tangential_damping_over_normal: f64| Friction {
        coefficient,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal,
    };
    for (restitution, friction, neck_viscosity) in [
        (0.1, None, 0.0),
        (0.8, None, 0.0),
        (1.0, None, 0.0),
        (1.0, Some(rough(10.0, 0.0)), 0.0),
        (0.8, Some(rough(0.3, 0.5)), 0.0),
        (0.8, Some(rough(0.3, 0.5)), 1.0),
    ] {
        let material = material(|spec| spec.damping = Damping::Restitution(restitution))
            .with_neck_viscosity(neck_viscosity)
            .expect("in its range");
        let around = Surroundings { friction, ..periodic() };
        let mut bed = Bed::new(material, around, &crowd()).expect("valid");
        bed.begin(&Drive { step_over_collision_time: 0.005, ..Drive::default() }).expect("stable");
        let first = bed.energies().total_j();
        let (mut least, mut contacts, mut held) = (first, 0, 0.0f64);
        for _ in 0..300 {
            bed.advance(10).expect("runs");
            let now = bed.energies().total_j();
            held = held.max(bed.energies().springs_j);
            assert!(now < least + 1e-3 * first, "e = {restitution}: {now} after {least}");
            least = least.min(now);
            contacts = contacts.max(bed.contacts().count());
        }
        assert!(contacts > 20, "nothing collides: {contacts}");
        // Far more than the bound: without it the sum would grow.
        assert_eq!(held > 5e-3 * first, friction.is_some(), "e = {restitution}: {held} of {first}");
        let lost = restitution == 1.0 || least < 0.9 * first;
        assert!(lost, "e = {restitution}: nothing is lost, {least} of {first}");
    }
}

#[test]
fn moved_scene_moves_along() {
    let (start, far) = (crowd(), [300.0 * R, -20.0 * R, 1.0 * R]);
    let mut moved = start.clone();
    for position in &mut moved.position_m {
        for axis in 0..3 {
            position[axis] += far[axis];
        }
    }
    let here = positions(&run(Surroundings::NOTHING, &start, STEPS));
    let mut there = positions(&run(Surroundings::NOTHING, &moved, STEPS));
    for position in &mut there {
        for axis in 0..3 {
            position[axis] -= far[axis];
        }
    }
    assert!(furthest(&here, &there) < 1e-8 * R, "{}", furthest(&here, &there) / R);
}

#[test]
fn turned_scene_turns_along() {
    let turn = |r: [f64; 3]| {
        let (c, s) = (0.6, 0.8);
        let [x, y, z] = [c * r[0] - s * r[1], s * r[0] + c * r[1], r[2]];
        [x, c * y - s * z, s * y + c * z]
    };
    let start = crowd();
    let mut turned = start.clone();
    turned.position_m.iter_mut().for_each(|r| *r = turn(*r));
    turned.velocity_m_per_s.iter_mut().for_each(|v| *v = turn(*v));
    let expected: Vec<_> =
        positions(&run(Surroundings::NOTHING, &start, STEPS)).into_iter().map(turn).collect();
    let there = positions(&run(Surroundings::NOTHING, &turned, STEPS));
    assert!(furthest(&expected, &there) < 1e-8 * R, "{}", furthest(&expected, &there) / R);
}

#[test]
fn numbering_does_not_matter() {
    let start = crowd();
    let n = start.position_m.len();
    // 37 has no common divisor with 125.
    let order: Vec<usize> = (0..n).map(|i| i * 37 % n).collect();
    let pick = |values: &[[f64; 3]]| order.iter().map(|&i| values[i]).collect::<Vec<_>>();
    let renumbered = Start {
        position_m: pick(&start.position_m),
        velocity_m_per_s: pick(&start.velocity_m_per_s),
        radius_m: order.iter().map(|&i| start.radius_m[i]).collect(),
        ..Start::default()
    };
    let expected = pick(&positions(&run(periodic(), &start, STEPS)));
    let there = positions(&run(periodic(), &renumbered, STEPS));
    let size = 10.7 * R;
    let wrapped = |a: f64| a - size * (a / size).round();
    let largest = expected
        .iter()
        .zip(&there)
        .flat_map(|(a, b)| (0..3).map(move |axis| wrapped(a[axis] - b[axis]).abs()))
        .fold(0.0, f64::max);
    assert!(largest < 1e-8 * R, "{}", largest / R);
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    // Enough particles that the work is divided.
    let start = cloud(R, 15, 60.0);
    let region = Region::new([31.7 * R; 3], Side::Periodic);
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| {
            let bed = run(Surroundings { region, ..Surroundings::NOTHING }, &start, 200);
            assert!(bed.work().rebuilds > 1, "{:?}", bed.work());
            (positions(&bed), velocities(&bed))
        })
    };
    let one = bits(1);
    for threads in [2, 3, 7] {
        assert!(bits(threads) == one, "{threads} threads");
    }
}

#[test]
fn how_steps_are_divided_into_calls_does_not_change_a_bit() {
    let mut at_once = run(periodic(), &crowd(), 0);
    let mut in_pieces = at_once.clone();
    at_once.advance(300).expect("runs");
    for steps in [1, 7, 92, 200] {
        in_pieces.advance(steps).expect("runs");
    }
    assert!(at_once == in_pieces);
}

#[test]
fn elastic_lattice_keeps_its_energy_to_second_order_in_the_step() {
    // Shaken so little that no contact opens: the force has no kink.
    let material = material(|spec| spec.damping = Damping::Restitution(1.0));
    let spacing = (2.0 - 1e-3) * R;
    let mut start = cloud(R, 4, 0.0);
    let mut state = 0.0;
    start.velocity_m_per_s.clear();
    for (i, position) in start.position_m.iter_mut().enumerate() {
        *position = [i / 16, i / 4 % 4, i % 4].map(|at| at as f64 * spacing);
        let mut v = || {
            state = (state + 0.618_033_988_749_895) % 1.0;
            (state - 0.5) * R
        };
        start.velocity_m_per_s.push([v(), v(), v()]);
    }
    let region = Region::new([4.0 * spacing; 3], Side::Periodic);
    let error = |step: f64| {
        let surroundings = Surroundings { region, ..Surroundings::NOTHING };
        let mut bed = Bed::new(material, surroundings, &start).expect("valid");
        bed.begin(&Drive { step_over_collision_time: step, ..Drive::default() }).expect("stable");
        let (first, moving) = (bed.energies().total_j(), bed.energies().translation_j);
        let mut largest: f64 = 0.0;
        for _ in 0..(5.0 / step) as usize {
            bed.advance(1).expect("runs");
            largest = largest.max((bed.energies().total_j() - first).abs() / moving);
        }
        assert_eq!(bed.contacts().count(), 3 * 64, "a contact has opened");
        largest
    };
    let (coarse, fine) = (error(0.02), error(0.01));
    let order = (coarse / fine).log2();
    assert!((1.9..2.1).contains(&order), "{coarse} {fine}: order {order}");
}
