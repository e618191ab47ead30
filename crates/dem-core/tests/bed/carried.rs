//! A balance of forces where gravity acts: it is found, or refused with the particle that nothing carries.

use dem_core::Kinetics;
use dem_core::bed::{
    Bed, BedError, Drive, QuasiStaticReport, QuasiStaticSettings, Region, Side, Start, Surroundings,
};

use crate::builders::{growing, material, spec};

const R: f64 = 31.5e-6;
const FLOOR: [Side; 3] = [Side::Open, Side::Open, Side::LowerWall];

/// Steps and Newton iterations of a run that is refused, or that has few particles: far above what they take.
const MOST_WORK: u64 = 20_000;

struct Loose {
    sides: [Side; 3],
    /// \[m/s2\]
    gravity: [f64; 3],
    bond_number: f64,
    heated: bool,
    /// In radii.
    positions: Vec<[f64; 3]>,
}

impl Loose {
    fn new(sides: [Side; 3], positions: &[[f64; 3]]) -> Self {
        let positions = positions.to_vec();
        Self { sides, gravity: [0.0, 0.0, -9.81], bond_number: 120.0, heated: true, positions }
    }

    /// Two seconds from force balance to force balance.
    fn run(&self) -> (Result<(), BedError>, QuasiStaticReport, Bed) {
        let weight =
            spec().powder.density_kg_per_m3 * 4.0 / 3.0 * std::f64::consts::PI * R.powi(3) * 9.81;
        let adhesion_n_per_m = self.bond_number * weight / R;
        let material = material(|spec| spec.k1 = adhesion_n_per_m / 2e-3);
        let material = material.with_adhesion(adhesion_n_per_m).expect("hard enough");
        let around = Surroundings {
            region: Region { size_m: [40.0 * R; 3], sides: self.sides },
            gravity_m_per_s2: self.gravity,
            ..Surroundings::NOTHING
        };
        let start = Start {
            position_m: self.positions.iter().map(|r| r.map(|x| x * R)).collect(),
            radius_m: vec![R; self.positions.len()],
            ..Start::default()
        };
        let mut bed = Bed::new(material, around, &start).expect("valid");
        let growing = self.heated.then(|| growing(Kinetics::ThreeStage));
        bed.begin(&Drive { growing, ..Drive::default() }).expect("stable");
        let mut report = QuasiStaticReport::default();
        let settings = QuasiStaticSettings {
            tolerance: 1e-2,
            max_work: MOST_WORK,
            ..QuasiStaticSettings::default()
        };
        let ran = bed.advance_quasi_static(2.0, &settings, &mut report);
        assert!(report.newton < MOST_WORK, "{report:?}");
        (ran, report, bed)
    }

    /// The particle and the axis along which nothing carries it.
    fn refused(&self) -> (usize, usize) {
        match self.run().0.expect_err("nothing carries it") {
            BedError::NothingCarries { particle, axis, .. } => (particle, axis),
            other => panic!("{other}"),
        }
    }
}

#[test]
fn particle_that_nothing_carries_is_named_with_the_axis() {
    let high = Loose::new(FLOOR, &[[5.0, 5.0, 30.0]]);
    assert_eq!(high.refused(), (0, 2));
    let second = Loose::new(FLOOR, &[[5.0, 5.0, 1.0], [5.0, 5.0, 30.0]]);
    assert_eq!(second.refused(), (1, 2));
    let out_of_sight = Loose::new(FLOOR, &[[5.0, 5.0, 1.0], [5.0, 5.0, 1e9]]);
    assert_eq!(out_of_sight.refused(), (1, 2));
    let cluster = [[5.0, 5.0, 5.0], [6.999, 5.0, 5.0], [5.0, 6.999, 5.0]];
    for sides in [Side::Open, Side::Periodic] {
        assert_eq!(Loose::new([sides; 3], &cluster).refused(), (0, 2));
    }
    // Side walls without friction hold nothing up, a floor holds nothing on a slope.
    let beside = Loose::new([Side::Walls, Side::Open, Side::Open], &[[1.0, 5.0, 5.0]]);
    assert_eq!(beside.refused(), (0, 2));
    let slope = Loose { gravity: [1.0, 0.0, -9.0], ..Loose::new(FLOOR, &[[5.0, 5.0, 1.0]]) };
    assert_eq!(slope.refused(), (0, 0));
    for bond_number in [1e-3, 1.0, 1e3, 1e6] {
        for heated in [false, true] {
            let high = Loose { bond_number, heated, ..Loose::new(FLOOR, &[[5.0, 5.0, 30.0]]) };
            assert_eq!(high.refused(), (0, 2));
        }
    }
}

#[test]
fn particle_just_above_the_floor_comes_to_lie_on_it_and_the_floor_carries_its_weight() {
    // Rounding of a direction is no slope.
    for gravity in [[0.0, 0.0, -9.81], [6e-16, 0.0, -9.81]] {
        let near = Loose { gravity, ..Loose::new(FLOOR, &[[5.0, 5.0, 1.02], [5.0, 5.0, 3.03]]) };
        let (ran, report, bed) = near.run();
        ran.expect("lies on the floor");
        assert!(report.steps > 0, "{report:?}");
        let height = bed.particles().position_m[0][2] / R;
        assert!((0.99..1.0).contains(&height), "{height}");
        assert!(bed.sample().mean_contact_ratio > 0.2, "{:?}", bed.sample());
    }
}

#[test]
fn loose_beds_of_any_shape_end_in_bounded_work() {
    let mut state = 7u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let (mut carried, mut named, mut neither) = (0, 0, 0);
    for _ in 0..1000 {
        let mut side = || {
            [Side::Open, Side::Periodic, Side::LowerWall, Side::Walls][(4.0 * random()) as usize]
        };
        let sides =
            [side(), side(), if side() == Side::Open { Side::Open } else { Side::LowerWall }];
        let tilt = if random() < 0.3 { random() } else { 0.0 };
        let spread = 0.2 + 3.0 * random();
        let is_layer = random() < 0.5;
        let mut positions: Vec<[f64; 3]> = Vec::new();
        for _ in 0..1 + (20.0 * random()) as usize {
            // A layer on the floor, or scattered.
            let height = if is_layer { 0.02 } else { 8.0 * spread };
            let place = [
                10.0 + 4.0 * spread * random(),
                10.0 + 4.0 * spread * random(),
                1.0 + height * random(),
            ];
            let apart = |other: &[f64; 3]| {
                (0..3).map(|axis| (place[axis] - other[axis]).powi(2)).sum::<f64>() >= 4.0
            };
            if positions.iter().all(apart) {
                positions.push(place);
            }
        }
        let scene = Loose {
            sides,
            gravity: [9.81 * tilt, 0.0, -9.81],
            bond_number: 10f64.powf(-3.0 + 8.0 * random()),
            heated: random() < 0.7,
            positions,
        };
        let (ran, _, bed) = scene.run();
        let lowest = bed.particles().position_m.iter().map(|r| r[2]).fold(f64::INFINITY, f64::min);
        assert!(ran.is_err() || sides[2] == Side::Open || lowest > 0.9 * R, "{lowest}, {ran:?}");
        match ran {
            Ok(()) => carried += 1,
            Err(BedError::NothingCarries { particle, .. }) if particle < scene.positions.len() => {
                named += 1
            }
            Err(BedError::NoBalance { .. } | BedError::NoRest { .. }) => neither += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(carried > 100 && named > 400 && neither < 100, "{carried} {named} {neither}");
}
