//! The map of where each solver is valid: error over the time step and over the sintering time, both in
//! collision times.
//!
//! PA12 at the paper's parameters, with its kinetics made faster or slower as a whole: C1 and tau_s are scaled
//! together, so that the curve keeps its shape over `t/tau_s`. Errors against the equations of motion: for verlet
//! that of the step, for the quasi-static limit (closed form) that of leaving the inertia out.

use std::path::Path;

use dem_core::stiff_reference::{Equations, settled};
use dem_core::{Kinetics, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios};
use rayon::prelude::*;

use super::report::{self, Header, Table};
use crate::error::{Failure, RunError};
use crate::experiment::full_coalescence;
use crate::material::Material;
use crate::output;
use crate::plot::{Band, Role, WorkPrecisionFigure, WorkPrecisionSeries};

const STEPS: [f64; 5] = [0.15, 0.1, 0.05, 0.02, 0.005];

/// `tau_s/t_c`, four to a decade.
fn ratios() -> Vec<f64> {
    (-8..=20).map(|quarter| 10f64.powf(f64::from(quarter) / 4.0)).collect()
}

pub(super) fn run(out: &Path) -> Result<(), Failure> {
    let header = Header::now("cargo run --release --features stiff-reference -- bench simulator");
    let material = Material::Pa12;
    let scene = PairSpec::new(material.powder(), full_coalescence())
        .build()
        .map_err(|error| RunError::new(error.to_string()))?;
    let paper = material.table3_sintering();
    let t_c = scene.collision_time_s();
    let solvers: Vec<(String, SolverSettings)> =
        std::iter::once(("quasi-static limit".to_owned(), SolverSettings::default()))
            .chain(STEPS.map(|step| {
                let settings = SolverSettings {
                    step_over_collision_time: step,
                    ..SolverSettings::of(SolverKind::Verlet)
                };
                (format!("verlet, step {step} t_{{c}}"), settings)
            }))
            .collect();

    // One row per ratio: the errors, or none where the motion has no reference.
    let errors: Vec<Option<Vec<f64>>> = ratios()
        .par_iter()
        .map(|ratio| {
            let factor = ratio * t_c / paper.tau_s;
            let s = Sintering { c1: paper.c1 / factor, tau_s: paper.tau_s * factor, ..paper };
            let times_s: Vec<f64> = (1..=40).map(|i| 2.0 * s.tau_s * f64::from(i) / 40.0).collect();
            let truth = settled(
                Equations::Motion,
                &scene,
                Kinetics::ThreeStage,
                &s,
                &times_s,
                1e-8,
                5_000_000,
            )
            .ok()?;
            let mut found = vec![0.0; times_s.len()];
            solvers
                .iter()
                .map(|(_, settings)| {
                    contact_ratios(
                        &scene,
                        Kinetics::ThreeStage,
                        &s,
                        settings,
                        &times_s,
                        &mut found,
                    )
                    .ok()?;
                    let misses = found.iter().zip(&truth.contact_ratio).map(|(a, b)| (a - b).abs());
                    Some(misses.fold(1e-16, f64::max))
                })
                .collect()
        })
        .collect();

    let mut table = Table::new(&[
        "tau_s/t_c",
        "solver",
        "step/t_c",
        "error of a/R against the equations of motion",
    ]);
    for (ratio, errors) in ratios().iter().zip(&errors) {
        for (place, (_, settings)) in solvers.iter().enumerate() {
            let is_verlet = settings.kind == SolverKind::Verlet;
            table.push(vec![
                format!("{ratio:.4e}"),
                if is_verlet { "verlet" } else { "quasi-static limit" }.to_owned(),
                if is_verlet {
                    settings.step_over_collision_time.to_string()
                } else {
                    String::new()
                },
                errors.as_ref().map_or("no reference settles to 1e-8".to_owned(), |e| {
                    format!("{:.3e}", e[place])
                }),
            ]);
        }
    }
    output::write_file(&out.join("validity.csv"), table.csv(&header).as_bytes())?;
    let series = solvers
        .iter()
        .enumerate()
        .map(|(place, (name, _))| {
            let (cost, error) = ratios()
                .iter()
                .zip(&errors)
                .filter_map(|(ratio, errors)| Some((*ratio, errors.as_ref()?[place])))
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
