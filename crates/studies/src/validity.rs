//! The map of where each solver is valid: error over the time step and over the sintering time, both in
//! collision times.
//!
//! PA12 at the paper's parameters, with its kinetics made faster or slower as a whole: C1 and tau_s are scaled
//! together, so that the curve keeps its shape over `t/tau_s`. Errors are against the equations of motion: for verlet
//! that of the step, for the quasi-static limit (closed form) that of leaving the inertia out.
//!
//! Above some 3000 collision times no stiff integrator settles to 1e-8: the contact oscillates too often. The reference there
//! is verlet with a step of 0.001 t_c, whose own error the table gives wherever the stiff integrator still settles. Errors below
//! that are left out of the figure.

use std::path::Path;

use crate::stiff_reference::{Equations, Problem};
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios,
};
use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionSeries};
use rayon::prelude::*;
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use crate::pair::verlet;
use crate::report::{Report, Table};

const STEPS: [f64; 5] = [0.15, 0.1, 0.05, 0.02, 0.005];

/// Step of the reference where no stiff integrator settles.
const FINE: f64 = 0.001;

const TEXT: &str = "\
PA12 at the paper's parameters with C1 and tau_s scaled together, from 0.01 to 100 000 collision times. Error: the largest
difference of a/R from the equations of motion; for verlet that of the step, for the quasi-static limit (closed form) that of
leaving the inertia out. PS is at 40 collision times, PA12 at 2100, PEEK at 18 000. Above 3000 the reference is verlet with
a step of 0.001 t_c, good to 2e-7; errors below its own are left out of the figure.
";

/// `tau_s/t_c`, four to a decade, as far as the slowest of the materials (PEEK).
fn ratios() -> Vec<f64> {
    (-8..=20).map(|quarter| 10f64.powf(f64::from(quarter) / 4.0)).collect()
}

/// Errors at one ratio.
struct Found {
    ratio: f64,
    /// Error of each solver.
    errors: Vec<f64>,
    /// Error of verlet with the fine step; none where that is the reference.
    fine: Option<f64>,
}

/// The quasi-static limit, and verlet at each step, with their names in the figure.
fn solvers() -> Vec<(String, SolverSettings)> {
    std::iter::once(("quasi-static limit".to_owned(), SolverSettings::default()))
        .chain(STEPS.map(|step| (format!("verlet, step {step} t_{{c}}"), verlet(step))))
        .collect()
}

/// Two equal particles of a material that merge at constant volume.
fn scene(material: Material) -> Result<PairScene, RunError> {
    PairSpec::new(material.powder(), 2f64.cbrt()).build().map_err(RunError::new)
}

pub(crate) fn run(out: &Path) -> Result<(), Failure> {
    let mut report = Report::begin(out, "validity")?;
    let material = Material::Pa12;
    let (scene, paper) = (scene(material)?, material.table3_sintering());
    let found: Vec<(f64, Option<Found>)> = ratios()
        .par_iter()
        .with_max_len(1)
        .map(|&ratio| (ratio, found(&scene, &paper, ratio)))
        .collect();
    report.table(&table(&found))?;
    report.figure("figure", &figure(&found)?)?;
    Ok(report.page("Where each solver is valid", TEXT)?)
}

/// None where neither the stiff integrator nor verlet with the fine step gives a reference, or a solver fails.
fn found(scene: &PairScene, paper: &Sintering, ratio: f64) -> Option<Found> {
    let factor = ratio * scene.collision_time_s() / paper.tau_s;
    let s = Sintering { c1: paper.c1 / factor, tau_s: paper.tau_s * factor, ..*paper };
    let times_s: Vec<f64> = (1..=40).map(|i| 2.0 * s.tau_s * f64::from(i) / 40.0).collect();
    let kinetics = Kinetics::ThreeStage;
    let run = |settings: &SolverSettings| {
        let mut curve = vec![0.0; times_s.len()];
        contact_ratios(scene, kinetics, &s, settings, &times_s, &mut curve).ok()?;
        Some(curve)
    };
    let fine = run(&verlet(FINE));
    let equations = Equations::Motion;
    let settled = Problem { equations, scene, kinetics, sintering: &s, times_s: &times_s }
        .settled(1e-8, 5_000_000);
    let truth = match &settled {
        Ok(reference) => &reference.contact_ratio,
        Err(_) => fine.as_ref()?,
    };
    let error = |curve: &[f64]| {
        let misses = curve.iter().zip(truth).map(|(a, b)| (a - b).abs());
        misses.fold(1e-16, f64::max)
    };
    let errors = solvers().into_iter().map(|(_, settings)| Some(error(&run(&settings)?)));
    Some(Found {
        ratio,
        errors: errors.collect::<Option<_>>()?,
        fine: settled.is_ok().then(|| fine.as_deref().map(error)).flatten(),
    })
}

fn table(rows: &[(f64, Option<Found>)]) -> Table {
    let mut table = Table::new(&[
        "tau_s/t_c",
        "solver",
        "step/t_c",
        "error of a/R against the equations of motion",
        "reference",
    ]);
    for (ratio, found) in rows {
        let ratio = format!("{ratio:.4e}");
        let reference = match found {
            None => "none",
            Some(Found { fine: Some(_), .. }) => "Radau, settled to 1e-8",
            Some(Found { fine: None, .. }) => "verlet, step 0.001",
        };
        let mut push = |solver: &str, step: String, error: Option<f64>| {
            let error = error.map_or(String::new(), |e| format!("{e:.3e}"));
            table.push(vec![ratio.clone(), solver.to_owned(), step, error, reference.to_owned()]);
        };
        for (place, (_, settings)) in solvers().iter().enumerate() {
            let error = found.as_ref().map(|found| found.errors[place]);
            if settings.kind == SolverKind::Verlet {
                push("verlet", settings.step_over_collision_time.to_string(), error);
            } else {
                push("quasi-static limit", String::new(), error);
            }
        }
        if let Some(fine) = found.as_ref().and_then(|found| found.fine) {
            push("verlet", FINE.to_string(), Some(fine));
        }
    }
    table
}

fn figure(rows: &[(f64, Option<Found>)]) -> Result<WorkPrecisionFigure, RunError> {
    let found = || rows.iter().filter_map(|(_, found)| found.as_ref());
    // Error of the fine verlet in the last decade with another reference: smaller errors are not resolved.
    let resolved = found()
        .filter(|found| found.ratio >= 1e3)
        .filter_map(|found| found.fine)
        .fold(0.0, f64::max);
    let mut series: Vec<WorkPrecisionSeries> = Vec::new();
    for (place, (name, _)) in solvers().into_iter().enumerate() {
        let (cost, error) = found()
            .map(|found| (found, found.errors[place]))
            .filter(|(found, error)| found.fine.is_some() || *error > resolved)
            .map(|(found, error)| (found.ratio, error))
            .unzip();
        let (role, band) = (Role::Series(place), Band::default());
        series.push(WorkPrecisionSeries { name, role, cost, error, band });
    }
    // Upright lines at the materials.
    let least = series.iter().flat_map(|s| &s.error).copied().fold(1.0, f64::min);
    for (material, role) in Material::ALL.into_iter().zip([Role::Posterior, Role::Map, Role::Prior])
    {
        let ratio = material.table3_sintering().tau_s / scene(material)?.collision_time_s();
        series.push(WorkPrecisionSeries {
            name: format!("{} of the paper", material.name().to_uppercase()),
            role,
            cost: vec![ratio, ratio],
            error: vec![least, 1.0],
            band: Band::default(),
        });
    }
    Ok(WorkPrecisionFigure {
        title: "Where each solver is valid: error against the equations of motion".to_owned(),
        cost_name: "sintering time over collision time, τ_{s}/t_{c}".to_owned(),
        cost_unit: String::new(),
        error_name: "largest error of a/R".to_owned(),
        error_unit: String::new(),
        series,
        guide_slope: None,
    })
}
