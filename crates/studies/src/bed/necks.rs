//! What the resistance of sintered necks to shear and rolling does to densification.

use std::ops::ControlFlow;
use std::path::Path;

use dem_core::bed::{BedError, EndRates, Law, Sample, SceneFile};
use figures::{CurvesFigure, MarkedCurve, Role};
use workbench::densify::crossing;
use workbench::error::{Failure, RunError};

use crate::report::{Report, Table};

const TAU_S: f64 = 3.81;
const NECK_VISCOSITIES: [f64; 5] = [0.0, 0.01, 0.1, 1.0, 10.0];
/// Densities over that at the start.
const LEVELS: [f64; 4] = [1.05, 1.1, 1.2, 1.3];

/// Two beds: what stands in their scenes besides the material and the heat.
const BEDS: [(&str, &str); 2] = [
    (
        "jammed, free box",
        r#"
        [box]
        sides = ["periodic", "periodic", "periodic"]
        free = true
        [particles.packing]
        count = 400
        radii = { equal = { radius_m = 31.5e-6 } }
        seed = 1
        "#,
    ),
    (
        "settled, fixed sides",
        r#"
        [box]
        size_m = [315e-6, 315e-6, 2e-3]
        sides = ["periodic", "periodic", "lower-wall"]
        [particles.packing]
        count = 400
        relative_density = 0.35
        radii = { equal = { radius_m = 31.5e-6 } }
        seed = 1
        [adhesion]
        bond_number = 100.0
        [gravity]
        acceleration_m_per_s2 = [0.0, 0.0, -9.81]
        allowed_load_over_adhesion = 0.2
        [drag]
        viscosity_pa_s = 1.8e-5
        [[phases]]
        name = "settle"
        duration_s = 0.05
        heated = false
        outputs = 1
        "#,
    ),
];

/// Densities over t/tau_s while the pairs hold, contacts per particle and a/R at the end of the pairs.
struct Course {
    points: Vec<(f64, f64)>,
    pairs_end: Option<Sample>,
    rates: Option<EndRates>,
}

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let mut report = Report::begin(out, "bed-necks")?;
    let mut table = Table::new(&[
        "bed",
        "neck viscosity nu",
        "density at first",
        "t/tau_s to 1.05 times that",
        "1.1 times",
        "1.2 times",
        "1.3 times",
        "pairs end at t/tau_s",
        "density there",
        "contacts per particle there",
        "d rho/dt there by the pairs [1/tau_s]",
        "by the closed law",
    ]);
    let mut curves = Vec::new();
    for (bed, scene) in BEDS {
        for neck_viscosity in NECK_VISCOSITIES {
            let course = course(scene, neck_viscosity).map_err(RunError::new)?;
            let row = row(bed, neck_viscosity, &course);
            eprintln!("{row:?}");
            table.push(row);
            if bed == BEDS[1].0 {
                curves.push(curve(neck_viscosity, &course, Role::Series(curves.len())));
            }
        }
    }
    report.table(&table)?;
    let figure = CurvesFigure {
        title: String::new(),
        x_name: "t/tau_{s}".to_owned(),
        y_name: "relative density".to_owned(),
        curves,
        mark_name: "the pairs end".to_owned(),
    };
    report.figure("density", &figure)?;
    Ok(report.page("Necks that resist shear and rolling", &text(&table))?)
}

fn course(bed: &str, neck_viscosity: f64) -> Result<Course, BedError> {
    let text = format!(
        r#"
        name = "necks"
        [material]
        youngs_modulus_pa = 1.65e9
        surface_tension_n_per_m = 40.7e-3
        density_kg_per_m3 = 1000.0
        k1_n_per_m = 0.5
        [sintering]
        kinetics = "frenkel"
        neck_viscosity = {neck_viscosity:?}
        c1 = 1.0
        tau_s = {TAU_S}
        delta_c = 1e-7
        calibrated_radius_m = 31.5e-6
        {bed}
        [[phases]]
        name = "heat"
        duration_s = {}
        heated = true
        mode = "quasi-static"
        outputs = 120
        tolerance = 3e-3
        "#,
        0.6 * TAU_S
    );
    let scene = SceneFile::parse(&text, "necks")?.build()?;
    let heat = scene.phases().len() - 1;
    let series = scene.run(|_, _| ControlFlow::Continue(()))?;
    let from_s = series.phase_start_s[heat];
    let heated = series.samples.iter().zip(&series.phase).filter(|(_, phase)| **phase == heat);
    let by_pairs = heated.filter(|(s, _)| s.law == Law::Pairs).map(|(s, _)| s);
    let points = by_pairs.chain(&series.hand_over);
    let points = points.map(|s| ((s.time_s - from_s) / TAU_S, s.relative_density)).collect();
    let pairs_end =
        series.hand_over.map(|end| Sample { time_s: (end.time_s - from_s) / TAU_S, ..end });
    Ok(Course { points, pairs_end, rates: series.end_rates })
}

fn row(bed: &str, neck_viscosity: f64, course: &Course) -> Vec<String> {
    let first = course.points[0].1;
    let mut row = vec![bed.to_owned(), neck_viscosity.to_string(), format!("{first:.4}")];
    row.extend(LEVELS.map(|level| {
        let after = course.points.iter().position(|point| point.1 >= level * first);
        after.filter(|&after| after > 0).map_or_else(String::new, |after| {
            let ends = [course.points[after - 1], course.points[after]];
            format!("{:.4}", crossing(ends, None, level * first))
        })
    }));
    row.extend(course.pairs_end.map_or([const { String::new() }; 3], |end| {
        [
            format!("{:.3}", end.time_s),
            format!("{:.3}", end.relative_density),
            format!("{:.2}", end.coordination),
        ]
    }));
    row.extend(course.rates.map_or([const { String::new() }; 2], |rates| {
        [rates.by_pairs, rates.by_closed_law].map(|rate| format!("{rate:.2}"))
    }));
    row
}

fn curve(neck_viscosity: f64, course: &Course, role: Role) -> MarkedCurve {
    let (x, y) = course.points.iter().copied().unzip();
    let mark = course.pairs_end.map(|end| (end.time_s, end.relative_density));
    let name = if neck_viscosity > 0.0 {
        format!("nu = {neck_viscosity}")
    } else {
        "necks slide and roll freely".to_owned()
    };
    MarkedCurve { name, role, x, y, mark }
}

fn text(table: &Table) -> String {
    format!(
        "400 PA12 particles with Frenkel's kinetics, from force balance to force balance (tolerance 3e-3), with necks that resist shear, rolling and \
         twist by `nu c_n/3`, `nu c_n a^2/4` and `nu c_n a^2/6`, where c_n is what a neck resists its own growth with (nu = 1: a Newtonian neck, \
         F.T. Trouton, Proc. R. Soc. Lond. A 77 (1906) 426). One bed is jammed and shrinks in all directions, the other has settled with a Bond number of 100 and \
         sinks between sides that stay where they are.\n\n{}\n\
         A jammed bed that shrinks evenly needs no shear: all contacts get shorter alike, and the resistance of the necks changes next to nothing. Between fixed sides \
         the contacts across cannot get shorter unless particles move past each other, and there the resistance decides.\n\n\
         Densities are those of the contacts: cells are empty, and curves end, where the pairs do. The closed laws that a run goes on by are isotropic and free: they know neither \
         fixed sides nor the resistance of necks, and the last two columns say how far the rate jumps where they take over. What follows there in a run is theirs, not this bed's.\n",
        table.markdown(),
    )
}
