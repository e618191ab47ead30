//! Laws of densification against each other: one free bed by kinetics and by the approach of its particles, and what
//! closed formulas say from its own starting density.

use std::ops::ControlFlow;
use std::path::Path;

use dem_core::bed::{BedError, Sample, SceneFile};
use dem_core::densification::{
    Approach, CLOSED, Densification, affine_density, affine_overlap, closure_density, closure_time,
    pore_time,
};
use dem_core::{Kinetics, PairSpec, Sintering, paper};
use figures::{CurvesFigure, MarkedCurve, Role};
use workbench::densify::crossing;
use workbench::error::{Failure, RunError};

use crate::report::{Report, Table};

const COUNT: usize = 1000;
const TAU_S: f64 = 3.81;
/// Length of a run, in tau_s.
const LENGTH: f64 = 1.8;
const LEVELS: [f64; 6] = [0.7, 0.8, 0.9, 0.94, 0.95, 0.99];

/// Densities over t/tau_s by one law.
struct Course {
    name: String,
    time: Vec<f64>,
    density: Vec<f64>,
    /// Where the pairs end: t/tau_s, density, a/R.
    end: Option<[f64; 3]>,
}

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let mut report = Report::begin(out, "bed-laws")?;
    let mut courses = Vec::new();
    for (kinetics, approach, stiffer) in [
        (Kinetics::Frenkel, Approach::Overlap, 1.0),
        (Kinetics::ThreeStage, Approach::Overlap, 1.0),
        (Kinetics::Pokluda, Approach::Overlap, 1.0),
        (Kinetics::Frenkel, Approach::EnergyBalance, 1.0),
        (Kinetics::Frenkel, Approach::KingeryBerg, 1.0),
        (Kinetics::Frenkel, Approach::Overlap, 100.0),
    ] {
        courses.push(bed(kinetics, approach, stiffer).map_err(RunError::new)?);
        eprintln!("{}", courses[courses.len() - 1].name);
    }
    let start = courses[0].density[0];
    courses.extend(formulas(start).map_err(RunError::new)?);
    let table = table(&courses);
    report.table(&table)?;
    report.figure("density", &figure(&courses))?;
    Ok(report.page("Laws of densification", &text(start, &table))?)
}

/// The free periodic bed of jammed particles.
fn bed(kinetics: Kinetics, approach: Approach, stiffer: f64) -> Result<Course, BedError> {
    let radius_m = paper::PA12.radius_m;
    let k1 = paper::K1_N_PER_M * stiffer;
    let text = format!(
        r#"
        name = "laws"
        [material]
        youngs_modulus_pa = 1.65e9
        surface_tension_n_per_m = 40.7e-3
        density_kg_per_m3 = 1000.0
        k1_n_per_m = {k1:e}
        [sintering]
        kinetics = "{kinetics}"
        approach = "{approach}"
        c1 = 1.177e-5
        tau_s = {TAU_S}
        delta_c = 9.55e-8
        calibrated_radius_m = {radius_m:e}
        [box]
        sides = ["periodic", "periodic", "periodic"]
        free = true
        [particles.packing]
        count = {COUNT}
        radii = {{ equal = {{ radius_m = {radius_m:e} }} }}
        seed = 1
        [[phases]]
        name = "heat"
        duration_s = {}
        heated = true
        mode = "quasi-static"
        outputs = 360
        tolerance = 3e-3
        "#,
        LENGTH * TAU_S
    );
    let scene = SceneFile::parse(&text, "laws")?.build()?;
    let series = scene.run(|_, _| ControlFlow::Continue(()))?;
    let column = |of: fn(&Sample) -> f64| series.samples.iter().map(of).collect::<Vec<f64>>();
    let by = match (approach, stiffer) {
        (Approach::Overlap, 1.0) => String::new(),
        (Approach::Overlap, _) => format!(", K1 times {stiffer}"),
        _ => format!(", {approach}"),
    };
    Ok(Course {
        name: format!("bed, {kinetics}{by}"),
        time: column(|sample| sample.time_s / TAU_S),
        density: column(|sample| sample.relative_density),
        end: series
            .hand_over
            .map(|end| [end.time_s / TAU_S, end.relative_density, end.mean_contact_ratio]),
    })
}

/// What the closed formulas give, with `x = x0 + t/tau_s`.
fn formulas(start: f64) -> Result<Vec<Course>, BedError> {
    let pair = PairSpec::new(paper::PA12, 2f64.cbrt()).build()?;
    let sintering = Sintering { c1: 1e-5, tau_s: 1.0, delta_c: 1e-7, lambda: 0.0 };
    let mut courses: Vec<Course> = Densification::ALL
        .into_iter()
        .map(|law| {
            let density: Vec<f64> =
                (0..=300).map(|k| start + (1.0 - start) * f64::from(k) / 300.0).collect();
            let time = density
                .iter()
                .map(|&density| law.time_s(&pair, (Kinetics::Frenkel, &sintering), start, density))
                .map(|time| time.unwrap_or(f64::NAN))
                .collect();
            Course { name: law.name().to_owned(), time, density, end: None }
        })
        .collect();
    for (name, approach) in [
        ("affine formula without an end", Approach::Overlap),
        ("Frenkel's initial shrinkage, 3t/8", Approach::EnergyBalance),
    ] {
        let last = affine_overlap(start, 1.0, approach);
        let time: Vec<f64> = (0..=300).map(|k| last * f64::from(k) / 300.0).collect();
        let density = time.iter().map(|&t| affine_density(start, t, approach)).collect();
        courses.push(Course { name: name.to_owned(), time, density, end: None });
    }
    Ok(courses)
}

impl Course {
    /// t/tau_s at a density, between the points and the end of the pairs.
    fn time_to(&self, density: f64) -> Option<f64> {
        let after = self.density.iter().position(|&at| at >= density)?;
        let point = |k: usize| (self.time[k], self.density[k]);
        let Some(before) = after.checked_sub(1) else { return Some(0.0) };
        let end = self.end.map(|[time, at, _]| (time, at));
        Some(crossing([point(before), point(after)], end, density))
    }
}

fn table(courses: &[Course]) -> Table {
    let mut table = Table::new(&[
        "law",
        "pairs end at t/tau_s",
        "density there",
        "a/R there",
        "t/tau_s to 0.7",
        "0.8",
        "0.9",
        "0.94",
        "0.95",
        "0.99",
        "to 0.9, over closed pores",
    ]);
    let pores = courses.iter().find(|course| course.name.starts_with("closed"));
    let reference = pores.and_then(|course| course.time_to(0.9)).unwrap_or(f64::NAN);
    for course in courses {
        let number = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.3}"));
        let mut row = vec![course.name.clone()];
        row.extend([0, 1, 2].map(|k| number(course.end.map(|end| end[k]))));
        row.extend(LEVELS.map(|level| number(course.time_to(level))));
        row.push(number(course.time_to(0.9).map(|time| time / reference)));
        table.push(row);
    }
    table
}

fn figure(courses: &[Course]) -> CurvesFigure {
    let drawn = courses.iter().filter(|course| !course.name.contains("K1 times"));
    // Beds first; formulas that a bed repeats are left out.
    let curves = drawn
        .filter(|course| !course.name.starts_with("pairs"))
        .enumerate()
        .map(|(k, course)| {
            let (x, y): (Vec<f64>, Vec<f64>) = course
                .time
                .iter()
                .zip(&course.density)
                .filter(|(time, density)| **time <= 1.5 && **density <= 1.0)
                .map(|(time, density)| (*time, *density))
                .unzip();
            let mark = course.end.map(|[time, density, _]| (time, density));
            // Looks of a series repeat after eight.
            let role = if k < 8 { Role::Series(k) } else { Role::Frenkel };
            MarkedCurve { name: course.name.clone(), role, x, y, mark }
        })
        .collect();
    CurvesFigure {
        title: String::new(),
        x_name: "t/tau_{s}".to_owned(),
        y_name: "relative density".to_owned(),
        curves,
        mark_name: "the pairs end".to_owned(),
    }
}

/// Rate of a course of closed laws at the start, in 1/tau_s.
fn rate(start: f64, time: impl Fn(f64) -> f64) -> f64 {
    let small = 1e-6;
    small / (time(start + small) - time(start))
}

fn text(start: f64, table: &Table) -> String {
    let cell = rate(start, |density| closure_time(start, density));
    let pores = rate(start, |density| pore_time(start) - pore_time(density));
    let closing = [CLOSED - 1e-6, CLOSED].map(|from| (closure_density(from, 1e-6) - from) / 1e-6);
    format!(
        "{COUNT} jammed PA12 particles in a periodic box that shrinks with them, from force balance to force balance (tolerance \
         3e-3), and closed formulas from the same relative density, {start:.4}. Times are in tau_s = eta R/gamma. Where the pairs of \
         a bed end (necks meet on more than 5 % of the particles, or the density reaches {CLOSED:.3}) its density goes on by \
         open and closed pores.\n\n{}\n\
         Where the factor comes from. A bed of pairs shrinks like one of them, `rho = rho0/(1 - s x/2)^3` with `x = t/tau_s`: its \
         rate at the start is `(3/2) s rho0/tau_s` = {:.3} for the overlap (s = 1), {:.3} for Frenkel's shrinkage (s = \
         3/4), {:.3} for Kingery and Berg (s = 1/2), and rises from there; the rate of Scherer's cell at the same density is {cell:.3}, \
         that of one closed pore per particle {pores:.3}, and both fall from there. Three things are in it. The overlap takes a/R \
         for the circle in which two spheres meet, and leaves out the matter between them, which Kingery and Berg put into the neck \
         (a factor of 2 in the approach). A pair is driven by its neck alone, whose curvature does not know of others; pores lose \
         their surface as they shrink. And `x = t/tau_s` is the law of small necks: Pokluda's, at kept volume, is slower by the \
         row of the bed with it. The rates of the two closed laws where the pores close are {:.3} and {:.3} per tau_s: they \
         belong to pores of different shapes, and the step is left as it is.\n\n\
         K1 is a numerical stiffness: a hundred times as stiff the bed takes the same times, with an adhesive force that is not stated and grows with it. \
         Where the force is stated a heated balance chooses the stiffness (study bed-settling).\n",
        table.markdown(),
        1.5 * start,
        1.125 * start,
        0.75 * start,
        closing[0],
        closing[1],
    )
}
