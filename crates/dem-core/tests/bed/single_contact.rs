//! One contact against closed forms.

use std::f64::consts::PI;

use dem_core::bed::{Bed, Drive, Friction, Region, Side, Start, Surroundings};
use dem_core::{Damping, paper};

use crate::builders::{elastic, free, material, start, velocities};

const R: f64 = 31.5e-6;

/// Time of contact over pi/omega, and the coefficient of restitution, of a head-on collision.
fn collision(restitution: f64, step: f64) -> (f64, f64) {
    let material = material(|spec| {
        spec.adhesion_over_k1_radius = 1e-9;
        spec.damping = Damping::Restitution(restitution);
        // Far from the plastic branch, and nothing that holds the pair together.
        spec.kc_over_k1 = 0.0;
    });
    let mut start = start(R, &[[0.0; 3], [2.0 + 1e-7, 0.0, 0.0]]);
    let speed = 0.1 * R / 1e-3;
    start.velocity_m_per_s = vec![[0.5 * speed, 0.0, 0.0], [-0.5 * speed, 0.0, 0.0]];
    let mut bed = free(material, &start);
    bed.begin(&Drive { step_over_collision_time: step, ..Drive::default() }).expect("stable");
    let mut contact_steps = 0;
    for _ in 0..(3.0 / step) as usize {
        bed.advance(1).expect("runs");
        let r = &bed.particles().position_m;
        if r[1][0] - r[0][0] < 2.0 * R {
            contact_steps += 1;
        }
    }
    let v = velocities(&bed);
    (f64::from(contact_steps) * step, (v[1][0] - v[0][0]) / speed)
}

#[test]
fn duration_and_restitution_of_a_collision_are_those_of_the_damped_oscillator() {
    // Repulsion only is allowed to end the contact, at delta = 0: t_c = pi/sqrt(omega^2 - (c/2)^2), e as set.
    for restitution in [1.0, 0.9, 0.5] {
        let (duration, e) = collision(restitution, 0.001);
        assert!((duration - 1.0).abs() < 0.003, "e = {restitution}: {duration} collision times");
        assert!((e - restitution).abs() < 0.004, "e = {restitution}: {e}");
    }
}

#[test]
fn energy_of_an_elastic_pair_is_conserved_to_second_order_in_the_step() {
    // A bound pair that oscillates without leaving the elastic branch, off any axis.
    let error = |step: f64| {
        let material = material(|spec| spec.damping = Damping::Restitution(1.0));
        let x0 = 1e-3;
        let n = [2.0 / 7.0, 3.0 / 7.0, 6.0 / 7.0];
        let mut start = start(R, &[[0.0; 3], n.map(|n| n * (2.0 - x0))]);
        let bed = free(material, &start);
        let omega = PI / bed.collision_time_s();
        let speed = 0.5 * x0 * R * omega;
        start.velocity_m_per_s = vec![[0.0; 3], n.map(|n| n * speed)];
        let mut bed = free(material, &start);
        bed.begin(&Drive { step_over_collision_time: step, ..Drive::default() }).expect("stable");
        let first = bed.energies().total_j();
        let mut largest: f64 = 0.0;
        for _ in 0..(4.0 / step) as usize {
            bed.advance(1).expect("runs");
            largest = largest.max((bed.energies().total_j() / first - 1.0).abs());
        }
        largest
    };
    let (coarse, fine) = (error(0.04), error(0.02));
    let order = (coarse / fine).log2();
    assert!((1.9..2.1).contains(&order), "{coarse} {fine}: order {order}");
}

fn on_floor(friction: Option<Friction>, gravity: f64, start: &Start) -> Bed {
    let region = Region { size_m: [1.0; 3], sides: [Side::Open, Side::Open, Side::LowerWall] };
    let surroundings = Surroundings {
        region,
        gravity_m_per_s2: [0.0, 0.0, -gravity],
        drag_viscosity_pa_s: 0.0,
        friction,
    };
    let material = material(|spec| {
        spec.adhesion_over_k1_radius = 1e-9;
        spec.k1 = 3.0;
    });
    Bed::new(material, surroundings, start).expect("valid")
}

#[test]
fn sliding_sphere_starts_to_roll_when_and_how_fast_the_rigid_body_does() {
    // On a plane with friction mu: it slides until t = 2 v0/(7 mu g), then rolls with 5/7 v0.
    let (mu, g, v0) = (0.3, 9.81, 0.01);
    let friction = Friction {
        coefficient: mu,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 1.0,
    };
    let mut start = start(R, &[[3.0, 3.0, 1.0]]);
    start.velocity_m_per_s = vec![[v0, 0.0, 0.0]];
    let mut bed = on_floor(Some(friction), g, &start);
    bed.begin(&Drive::default()).expect("stable");
    let rolls_at = 2.0 * v0 / (7.0 * mu * g);
    let steps = (0.5 * rolls_at / bed.step_s()) as u64;
    bed.advance(steps).expect("runs");
    let slowed = v0 - mu * g * bed.time_s();
    // The weight comes onto the wall within a collision time, a percent of the slide.
    assert!((bed.particles().velocity_m_per_s[0][0] / slowed - 1.0).abs() < 0.01);
    bed.advance(3 * steps).expect("runs");
    let v = bed.particles().velocity_m_per_s[0][0];
    let spin = bed.particles().angular_velocity_per_s[0][1];
    assert!((v / (5.0 / 7.0 * v0) - 1.0).abs() < 1e-3, "{v}");
    assert!((spin * R / v - 1.0).abs() < 1e-3, "{spin}");
}

#[test]
fn sphere_on_an_incline_slides_where_the_ratio_to_the_pressing_force_is_the_coefficient() {
    // It rolls with 2/7 of the downhill force at the contact, and slides where that exceeds mu (N + fa).
    let (mu, g) = (0.3, 9.81);
    let weight = 4.0 / 3.0 * PI * R.powi(3) * paper::DENSITY_KG_PER_M3 * g;
    let friction = Friction {
        coefficient: mu,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 1.0,
    };
    // fa of a wall contact, 2R K1 alpha, is nothing or half of the weight; cohesion has no part in it.
    for fa in [1e-3, 0.5] {
        let material = material(|spec| {
            spec.k1 = 3.0;
            spec.adhesion_over_k1_radius = fa * weight / (2.0 * R * spec.k1);
        });
        let rolls = |angle: f64| {
            let region =
                Region { size_m: [1.0; 3], sides: [Side::Open, Side::Open, Side::LowerWall] };
            let surroundings = Surroundings {
                region,
                gravity_m_per_s2: [g * angle.sin(), 0.0, -g * angle.cos()],
                drag_viscosity_pa_s: 0.0,
                friction: Some(friction),
            };
            let mut bed =
                Bed::new(material, surroundings, &start(R, &[[3.0, 3.0, 1.0]])).expect("valid");
            bed.begin(&Drive::default()).expect("stable");
            bed.advance((0.01 / bed.step_s()) as u64).expect("runs");
            let (v, w) = (
                bed.particles().velocity_m_per_s[0][0],
                bed.particles().angular_velocity_per_s[0][1],
            );
            (v / (g * bed.time_s()), w * R / v)
        };
        // Where 2/7 sin = mu (cos + fa/mg), by bisection.
        let (mut low, mut high): (f64, f64) = (0.0, 1.5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if 2.0 / 7.0 * middle.sin() < mu * (middle.cos() + fa) {
                low = middle;
            } else {
                high = middle;
            }
        }
        if fa < 0.1 {
            assert!((low.tan() / (3.5 * mu) - 1.0).abs() < 5e-3, "{low}");
        }
        let (gained, turning) = rolls(low - 0.03);
        assert!((turning - 1.0).abs() < 2e-3, "fa {fa} weights: rolls below, {turning}");
        assert!((gained / (5.0 / 7.0 * (low - 0.03).sin()) - 1.0).abs() < 0.02, "{gained}");
        let above = low + 0.1;
        let (gained, turning) = rolls(above);
        let slides = above.sin() - mu * (above.cos() + fa);
        assert!((gained / slides - 1.0).abs() < 0.02, "fa {fa} weights: {gained}, {slides}");
        assert!(turning < 0.98, "slides above: {turning}");
    }
}

#[test]
fn bound_pair_with_friction_turns_like_a_rigid_body() {
    // Spins and orbit are one rotation: the spring never stretches, and the angle is omega t.
    let friction = Friction {
        coefficient: 0.5,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 0.0,
    };
    let surroundings = Surroundings { friction: Some(friction), ..Surroundings::NOTHING };
    let material = material(|_| ());
    let reach = 1.0 - 0.5e-3;
    let mut start = start(R, &[[-reach, 0.0, 0.0], [reach, 0.0, 0.0]]);
    let omega = 1.0;
    start.velocity_m_per_s = vec![[0.0, -omega * reach * R, 0.0], [0.0, omega * reach * R, 0.0]];
    start.angular_velocity_per_s = vec![[0.0, 0.0, omega]; 2];
    let mut bed = Bed::new(material, surroundings, &start).expect("valid");
    bed.begin(&Drive::default()).expect("stable");
    bed.advance((0.5 / bed.step_s()) as u64).expect("runs");
    let r = bed.particles().position_m[1];
    let angle = r[1].atan2(r[0]);
    assert!((angle / (omega * bed.time_s()) - 1.0).abs() < 1e-4, "{angle}");
    let spin = bed.particles().angular_velocity_per_s[1][2];
    assert!((spin / omega - 1.0).abs() < 1e-4, "{spin}");
}

#[test]
fn off_centre_collision_with_friction_keeps_linear_and_angular_momentum() {
    let friction = Friction {
        coefficient: 0.5,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 0.5,
    };
    let surroundings = Surroundings { friction: Some(friction), ..Surroundings::NOTHING };
    let mut start = start(R, &[[0.0; 3], [2.3, 1.2, 0.3]]);
    start.radius_m[1] = 1.4 * R;
    start.velocity_m_per_s = vec![[20.0 * R, 3.0 * R, 0.0], [-20.0 * R, 0.0, 5.0 * R]];
    start.angular_velocity_per_s = vec![[3.0, 40.0, 0.0], [0.0, 10.0, -30.0]];
    let mut bed = Bed::new(elastic(), surroundings, &start).expect("valid");
    bed.begin(&Drive::default()).expect("stable");
    let momenta = |bed: &Bed| {
        let p = bed.particles();
        let (mut linear, mut angular) = ([0.0; 3], [0.0; 3]);
        for i in 0..2 {
            let mass = p.radius_m[i].powi(3);
            let (r, v, w) = (p.position_m[i], p.velocity_m_per_s[i], p.angular_velocity_per_s[i]);
            for axis in 0..3 {
                let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
                linear[axis] += mass * v[axis];
                angular[axis] += mass * (r[y] * v[z] - r[z] * v[y])
                    + 0.4 * mass * p.radius_m[i].powi(2) * w[axis];
            }
        }
        (linear, angular)
    };
    let (linear, angular) = momenta(&bed);
    let spin = bed.particles().angular_velocity_per_s[0];
    bed.advance((10.0 * bed.collision_time_s() / bed.step_s()) as u64).expect("runs");
    assert_ne!(bed.particles().angular_velocity_per_s[0], spin, "there was no collision");
    let (linear_after, angular_after) = momenta(&bed);
    for axis in 0..3 {
        let scale = R.powi(3) * 20.0 * R;
        assert!((linear_after[axis] - linear[axis]).abs() < 1e-12 * scale, "{axis}");
        // Velocities are half a step from the positions inside a step.
        assert!((angular_after[axis] - angular[axis]).abs() < 1e-10 * scale * R, "{axis}");
    }
}

#[test]
fn sphere_sinks_through_oil_with_stokes_velocity() {
    let (eta, g) = (0.5, 9.81);
    let surroundings = Surroundings {
        gravity_m_per_s2: [0.0, 0.0, -g],
        drag_viscosity_pa_s: eta,
        ..Surroundings::NOTHING
    };
    let mut bed = Bed::new(material(|_| ()), surroundings, &start(R, &[[0.0; 3]])).expect("valid");
    bed.begin(&Drive::default()).expect("stable");
    bed.advance(2000).expect("runs");
    let stokes = 2.0 / 9.0 * paper::DENSITY_KG_PER_M3 * g * R * R / eta;
    let v = bed.particles().velocity_m_per_s[0][2];
    assert!((v / -stokes - 1.0).abs() < 1e-9, "{v} {stokes}");
}

#[test]
fn resting_sphere_presses_the_floor_with_its_weight_through_twice_its_radius() {
    let mut bed = on_floor(None, 9.81, &start(R, &[[3.0, 3.0, 1.0]]));
    bed.begin(&Drive::default()).expect("stable");
    bed.advance(20_000).expect("runs");
    let weight = 4.0 / 3.0 * PI * R.powi(3) * 1000.0 * 9.81;
    let force = bed.wall_forces_n()[0];
    assert!((force[2] / -weight - 1.0).abs() < 1e-6, "{force:?} {weight}");
    // f_ep = K1 delta with fa = 1e-9 K1 (2R): delta = weight/K1, whatever the effective radius.
    let sunk = R - bed.particles().position_m[0][2];
    assert!((sunk / (weight / 3.0 + 1e-9 * 2.0 * R) - 1.0).abs() < 1e-6, "{sunk}");
}

#[test]
fn in_a_stack_of_three_every_contact_carries_the_weight_above_it() {
    let mut bed =
        on_floor(None, 9.81, &start(R, &[[3.0, 3.0, 1.0], [3.0, 3.0, 3.0], [3.0, 3.0, 5.0]]));
    bed.begin(&Drive::default()).expect("stable");
    bed.advance(60_000).expect("runs");
    let weight = 4.0 / 3.0 * PI * R.powi(3) * 1000.0 * 9.81;
    let floor = bed.wall_forces_n()[0][2];
    assert!((floor / (-3.0 * weight) - 1.0).abs() < 1e-5, "{floor}");
    // Soft springs K1 in series: each is shortened by its load, and fa, nearly nothing, by 1e-9 R.
    let mut approach: Vec<f64> = bed.contacts().map(|contact| contact.approach_m).collect();
    approach.sort_by(f64::total_cmp);
    for (carried, approach) in [1.0, 2.0].into_iter().zip(&approach) {
        let expected = carried * weight / 3.0 + 1e-9 * R;
        assert!((approach / expected - 1.0).abs() < 1e-4, "{carried} weights: {approach}");
    }
    assert_eq!(approach.len(), 2);
}
