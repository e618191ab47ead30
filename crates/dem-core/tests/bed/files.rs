//! Checkpoints and files for other programs.

use std::ops::ControlFlow;

use dem_core::Kinetics;
use dem_core::bed::{
    Bed, BedError, CSV_HEADER, Drive, Friction, Region, SceneFile, Side, Surroundings, write_csv,
    write_vtk,
};

use crate::builders::{cloud, growing, material};

const R: f64 = 31.5e-6;

fn bed() -> Bed {
    let surroundings = Surroundings {
        region: Region { size_m: [10.7 * R; 3], sides: [Side::Periodic, Side::Walls, Side::Walls] },
        gravity_m_per_s2: [0.0, 0.0, -9.81],
        drag_viscosity_pa_s: 1e-3,
        friction: Some(Friction {
            coefficient: 0.3,
            tangential_stiffness_over_k1: 2.0 / 7.0,
            tangential_damping_over_normal: 0.5,
        }),
    };
    let mut start = cloud(R, 5, 60.0);
    start.radius_m[3] *= 0.9;
    let material = material(|spec| spec.k1 = 0.03);
    let mut bed = Bed::new(material, surroundings, &start).expect("valid");
    let drive = Drive { growing: Some(growing(Kinetics::ThreeStage)), ..Drive::default() };
    bed.begin(&drive).expect("stable");
    bed
}

#[test]
fn run_from_a_checkpoint_is_the_run_without_one_bit_for_bit() {
    let mut whole = bed();
    whole.advance(700).expect("runs");
    let checkpoint = whole.checkpoint();
    whole.advance(700).expect("runs");
    let mut resumed = bed();
    resumed.restore(&checkpoint, Some(growing(Kinetics::ThreeStage))).expect("same scene");
    resumed.advance(700).expect("runs");
    assert!(whole == resumed);
    assert!(whole.work().rebuilds > 2, "{:?}", whole.work());
    assert_eq!(whole.checkpoint(), resumed.checkpoint());
}

#[test]
fn damaged_or_foreign_checkpoints_are_refused_and_change_nothing() {
    let mut bed = bed();
    let good = bed.checkpoint();
    let before = bed.clone();
    for at in [0, 9, 100, good.len() / 2, good.len() - 1] {
        let mut bad = good.clone();
        bad[at] ^= 1;
        let error = bed.restore(&bad, None).expect_err("damaged");
        assert!(matches!(error, BedError::Checkpoint(_)), "{error}");
    }
    for length in [0, 7, 8, good.len() - 1] {
        assert!(bed.restore(&good[..length], None).is_err());
    }
    let other =
        Bed::new(material(|_| ()), Surroundings::NOTHING, &crate::builders::start(R, &[[0.0; 3]]))
            .expect("valid");
    assert!(bed.restore(&other.checkpoint(), None).is_err());
    assert!(bed == before);
}

#[test]
fn vtk_file_is_read_back_by_an_independent_reader() {
    use vtkio::model::{Attribute, DataSet, Piece};
    let mut bed = bed();
    bed.advance(300).expect("runs");
    let mut file = Vec::new();
    write_vtk(&bed, &mut file).expect("memory");
    let vtk = vtkio::Vtk::parse_legacy_be(&file[..]).expect("a VTK file");
    let DataSet::PolyData { pieces, .. } = vtk.data else { panic!("no PolyData") };
    let Piece::Inline(piece) = &pieces[0] else { panic!("no data") };
    let points = piece.points.clone().into_vec::<f64>().expect("doubles");
    let expected: Vec<f64> = bed.particles().position_m.iter().flatten().copied().collect();
    assert_eq!(points, expected);
    let names: Vec<&str> = piece.data.point.iter().map(Attribute::name).collect();
    assert_eq!(names, ["diameter", "id", "contacts", "contact_ratio", "velocity"]);
    let Attribute::DataArray(diameters) = &piece.data.point[0] else { panic!("no array") };
    let diameters = diameters.data.clone().into_vec::<f64>().expect("doubles");
    assert!(diameters.iter().zip(&bed.particles().radius_m).all(|(d, r)| *d == 2.0 * r));
}

#[test]
fn csv_has_a_number_in_every_column_and_a_row_for_every_observation() {
    let scene = r#"
        name = "two"
        particles.table = { positions_m = [[0, 0, 0], [62.9685e-6, 0, 0]], radii_m = [31.5e-6, 31.5e-6] }
        phases = [{ name = "rest", duration_s = 0.01, heated = false, outputs = 4 }]
        [material]
        youngs_modulus_pa = 1.65e9
        surface_tension_n_per_m = 40.7e-3
        density_kg_per_m3 = 1000.0
    "#;
    let scene = SceneFile::parse(scene, "two").expect("valid").build().expect("valid");
    let series = scene.run(|_, _| ControlFlow::Continue(())).expect("runs");
    let mut csv = Vec::new();
    write_csv(&series, &mut csv).expect("memory");
    let csv = String::from_utf8(csv).expect("text");
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some(CSV_HEADER));
    let columns = CSV_HEADER.split(',').count();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| {
            let (numbers, law) = line.rsplit_once(',').expect("cells");
            assert_eq!(law, "pairs");
            numbers.split(',').map(|cell| cell.parse().expect("number")).collect()
        })
        .collect();
    assert_eq!(rows.len(), 5);
    assert!(rows.iter().all(|row| row.len() == columns - 1));
    // At rest in the adhesive contact.
    assert!(rows.iter().all(|row| (row[4] - 1e-3f64.sqrt()).abs() < 1e-9), "{rows:?}");
}

/// A packing that settles in one phase and is heated in two others.
const PHASES: &str = r#"
name = "phases"
[material]
youngs_modulus_pa = 1.65e9
surface_tension_n_per_m = 40.7e-3
density_kg_per_m3 = 1000.0
[sintering]
kinetics = "three-stage"
c1 = 1.177e-5
tau_s = 3.81
delta_c = 9.55e-8
calibrated_radius_m = 31.5e-6
[box]
sides = ["periodic", "periodic", "periodic"]
[particles.packing]
count = 60
radii = { log-normal = { median_m = 31.5e-6, sigma = 0.1 } }
seed = 1
[[phases]]
name = "rest"
duration_s = 1e-3
heated = false
outputs = 2
[[phases]]
name = "heat"
duration_s = 2e-3
heated = true
outputs = 3
[[phases]]
name = "hold"
duration_s = 0.4
heated = true
mode = "quasi-static"
outputs = 3
tolerance = 1e-3
"#;

#[test]
fn a_scene_resumed_after_any_observation_is_the_scene_without_a_stop() {
    let scene = SceneFile::parse(PHASES, "phases").expect("valid").build().expect("valid");
    let whole = scene.run(|_, _| ControlFlow::Continue(())).expect("runs");
    assert_eq!(whole.samples.len(), 11);
    let mut run = scene.start();
    loop {
        run = scene.resume(&run.checkpoint()).expect("its own checkpoint");
        if run.advance().expect("runs").is_none() {
            break;
        }
    }
    assert_eq!(run.series().samples.len(), 11);
    // Bits, NaN included.
    assert_eq!(format!("{:?}", run.series()), format!("{whole:?}"));
    assert!(whole.samples[10].coordination > 1.0, "nothing touches: {:?}", whole.samples[10]);
    let mut bad = run.checkpoint();
    bad[60] ^= 1;
    assert!(matches!(scene.resume(&bad), Err(BedError::Checkpoint(_))));
    let fewer = PHASES.replace("count = 60", "count = 59");
    let fewer = SceneFile::parse(&fewer, "fewer").expect("valid").build().expect("valid");
    assert!(matches!(fewer.resume(&run.checkpoint()), Err(BedError::Checkpoint(_))));
}

#[test]
fn another_draw_is_the_scene_with_its_parameters_and_comes_before_the_heat() {
    let parse =
        |text: &str| SceneFile::parse(text, "scene").expect("valid").build().expect("valid");
    let text = |tau_s: &str, phi: &str| {
        PHASES.replace("tau_s = 3.81", tau_s).replace("[sintering]", &format!("{phi}[sintering]"))
    };
    let go_on = |_: &_, _: &Bed| ControlFlow::Continue(());
    let other = parse(&text("tau_s = 1.9", "final_contact_ratio = 1.1\n"));
    let mut run = parse(PHASES).with_final_contact_ratio(1.1).expect("valid").start();
    while !run.next_phase().expect("not at the end").heated {
        run.advance().expect("runs");
    }
    run.set_growing(*other.growing().expect("sinters")).expect("before the heat");
    while run.advance().expect("runs").is_some() {}
    let expected = other.run(go_on).expect("runs");
    assert_eq!(format!("{:?}", run.series()), format!("{expected:?}"));
    assert!(run.set_growing(*other.growing().expect("sinters")).is_err(), "after the heat");
}

#[test]
fn an_outline_refuses_what_needs_no_packing_to_be_seen() {
    let outline = |from: &str, to: &str| {
        SceneFile::parse(&PHASES.replace(from, to), "scene").expect("valid").outline()
    };
    let found = outline("", "").expect("valid");
    assert_eq!(found.particles, 60);
    assert!((found.mean_radius_m / 31.5e-6 - 1.0).abs() < 0.05, "{found:?}");
    for (from, to, word) in [
        ("tolerance = 1e-3", "tolerance = 1.0", "[[phases]] 3 (hold): tolerance = 1"),
        ("outputs = 3", "outputs = 0", "[[phases]] 2 (heat): outputs = 0"),
        ("sigma = 0.1", "sigma = -0.1", "sigma = -0.1"),
        ("youngs_modulus_pa = 1.65e9", "youngs_modulus_pa = -1.0", "youngs_modulus_pa"),
    ] {
        let error = outline(from, to).expect_err(to).to_string();
        assert!(error.contains(word), "{error}");
    }
}
