//! The map of where each solver is valid: error over the time step and over the sintering time, both in
//! collision times.
//!
//! PA12 at the paper's parameters, with its kinetics made faster or slower as a whole: C1 and tau_s are scaled
//! together, so that the curve keeps its shape over `t/tau_s`. Errors against the equations of motion: for verlet
//! that of the step, for the quasi-static limit (closed form) that of leaving the inertia out.
//!
//! Above some 3000 collision times no stiff integrator settles to 1e-8: the contact oscillates too often. The reference there
//! is verlet with a step of 0.001 t_c, whose own error the table gives wherever the stiff integrator still settles. Errors below
//! that are left out of the figure.

use std::path::Path;

use dem_core::{Kinetics, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios};
use rayon::prelude::*;

use super::report::{self, Header, Table};
use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionSeries};
use studies::stiff_reference::{Equations, Problem};
use workbench::error::{Failure, RunError};
use workbench::experiment::full_coalescence;
use workbench::material::Material;
use workbench::output;

const STEPS: [f64; 5] = [0.15, 0.1, 0.05, 0.02, 0.005];

/// Step of the reference where no stiff integrator settles.
const FINE: f64 = 0.001;

/// `tau_s/t_c`, four to a decade, as far as the slowest of the materials (PEEK).
fn ratios() -> Vec<f64> {
    (-8..=20).map(|quarter| 10f64.powf(f64::from(quarter) / 4.0)).collect()
}

/// What was found at one ratio.
struct Found {
    /// Error of each solver.
    errors: Vec<f64>,
    /// Error of verlet with the fine step; none where that is the reference.
    fine: Option<f64>,
}

pub(super) fn run(out: &Path) -> Result<(), Failure> {
    let header = Header::now("cargo run --release -p studies -- simulator");
    let material = Material::Pa12;
    let scene = PairSpec::new(material.powder(), full_coalescence())
        .build()
        .map_err(|error| RunError::new(error.to_string()))?;
    let paper = material.table3_sintering();
    let t_c = scene.collision_time_s();
    let verlet = |step| SolverSettings {
        step_over_collision_time: step,
        ..SolverSettings::of(SolverKind::Verlet)
    };
    let solvers: Vec<(String, SolverSettings)> =
        std::iter::once(("quasi-static limit".to_owned(), SolverSettings::default()))
            .chain(STEPS.map(|step| (format!("verlet, step {step} t_{{c}}"), verlet(step))))
            .collect();

    // One row per ratio.
    let rows: Vec<Option<Found>> = ratios()
        .par_iter()
        .with_max_len(1)
        .map(|ratio| {
            let factor = ratio * t_c / paper.tau_s;
            let s = Sintering { c1: paper.c1 / factor, tau_s: paper.tau_s * factor, ..paper };
            let times_s: Vec<f64> = (1..=40).map(|i| 2.0 * s.tau_s * f64::from(i) / 40.0).collect();
            let run = |settings: &SolverSettings| {
                let mut found = vec![0.0; times_s.len()];
                contact_ratios(&scene, Kinetics::ThreeStage, &s, settings, &times_s, &mut found)
                    .ok()?;
                Some(found)
            };
            let fine = run(&verlet(FINE));
            let problem = Problem {
                equations: Equations::Motion,
                scene: &scene,
                kinetics: Kinetics::ThreeStage,
                sintering: &s,
                times_s: &times_s,
            };
            let settled = problem.settled(1e-8, 5_000_000);
            let truth = match &settled {
                Ok(reference) => &reference.contact_ratio,
                Err(_) => fine.as_ref()?,
            };
            let error = |found: &[f64]| {
                let misses = found.iter().zip(truth).map(|(a, b)| (a - b).abs());
                misses.fold(1e-16, f64::max)
            };
            Some(Found {
                errors: solvers
                    .iter()
                    .map(|(_, settings)| Some(error(&run(settings)?)))
                    .collect::<Option<_>>()?,
                fine: settled.is_ok().then(|| fine.as_deref().map(error)).flatten(),
            })
        })
        .collect();

    let mut table = Table::new(&[
        "tau_s/t_c",
        "solver",
        "step/t_c",
        "error of a/R against the equations of motion",
        "reference",
    ]);
    for (ratio, found) in ratios().iter().zip(&rows) {
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
        for (place, (_, settings)) in solvers.iter().enumerate() {
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
    output::write_file(&out.join("validity.csv"), table.csv(&header).as_bytes())?;
    // What the fine verlet itself is off by, in the last decade with another reference: smaller errors are not resolved.
    let resolved = ratios()
        .iter()
        .zip(&rows)
        .filter(|(ratio, _)| **ratio >= 1e3)
        .filter_map(|(_, found)| found.as_ref()?.fine)
        .fold(0.0, f64::max);
    let mut series: Vec<WorkPrecisionSeries> = solvers
        .iter()
        .enumerate()
        .map(|(place, (name, _))| {
            let (cost, error) = ratios()
                .iter()
                .zip(&rows)
                .filter_map(|(ratio, found)| {
                    let found = found.as_ref()?;
                    let error = found.errors[place];
                    (found.fine.is_some() || error > resolved).then_some((*ratio, error))
                })
                .unzip();
            WorkPrecisionSeries {
                name: name.clone(),
                role: Role::Series(place),
                cost,
                error,
                band: Band::default(),
            }
        })
        .collect();
    // Where the materials are, as upright lines.
    let least = series.iter().flat_map(|s| &s.error).copied().fold(1.0, f64::min);
    for (material, role) in Material::ALL.into_iter().zip([Role::Posterior, Role::Map, Role::Prior])
    {
        let scene = PairSpec::new(material.powder(), full_coalescence())
            .build()
            .map_err(|error| RunError::new(error.to_string()))?;
        let ratio = material.table3_sintering().tau_s / scene.collision_time_s();
        series.push(WorkPrecisionSeries {
            name: format!("{} of the paper", material.name().to_uppercase()),
            role,
            cost: vec![ratio, ratio],
            error: vec![least, 1.0],
            band: Band::default(),
        });
    }
    let figure = WorkPrecisionFigure {
        title: "Where each solver is valid: error against the equations of motion".to_owned(),
        cost_name: "sintering time over collision time, τ_{s}/t_{c}".to_owned(),
        cost_unit: String::new(),
        error_name: "largest error of a/R".to_owned(),
        error_unit: String::new(),
        series,
        guide_slope: None,
    };
    report::figure(out, "validity", &figure)?;
    Ok(())
}
