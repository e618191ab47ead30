//! Materials, priors and neck growth curves.

use std::str::FromStr as _;

use dem_core::{Kinetics, PairSpec, Powder, Sintering, SolverKind, SolverSettings, choose_solver};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use smc_calib::Prior;
use workbench::error::{InputError, Mistake};
use workbench::input::experiment::Experiment;
use workbench::input::material::Material;

use crate::failures::{argument, mistaken};
use crate::job::{bytes, doubles};

/// Checks a prior, given as the JSON of its specification; gives its support.
#[pyfunction]
pub(crate) fn check_prior(name: &str, spec: &str) -> PyResult<(f64, f64)> {
    let refused = |error: &dyn std::fmt::Display| {
        mistaken(&InputError::new(name, Mistake::OutOfRange).found(error))
    };
    let spec = serde_json::from_str(spec).map_err(|error| refused(&error))?;
    Ok(Prior::new(spec).map_err(|error| refused(&error))?.support())
}

/// A name that an argument does not know.
fn unknown<const N: usize>(argument: &str, name: &str, names: [&'static str; N]) -> PyErr {
    let error = InputError::new(argument, Mistake::UnknownName)
        .found(format_args!("\"{name}\""))
        .expected(format_args!("one of {}", names.join(", ")));
    mistaken(&error.did_you_mean(name, names))
}

/// The built-in material of a name.
pub(crate) fn named(name: &str) -> PyResult<Material> {
    Material::from_name(name).ok_or_else(|| unknown("material", name, Material::NAMES))
}

/// The kinetics of a name.
pub(crate) fn kinetics(name: &str) -> PyResult<Kinetics> {
    Kinetics::from_str(name)
        .map_err(|_| unknown("kinetics", name, Kinetics::ALL.map(Kinetics::name)))
}

/// The solver of a name; none for "auto".
pub(crate) fn solver(name: &str) -> PyResult<Option<SolverKind>> {
    if name == "auto" {
        return Ok(None);
    }
    SolverKind::from_str(name).map(Some).map_err(|_| {
        let names = SolverKind::ALL.map(SolverKind::name);
        argument("solver", format_args!("\"{name}\""), format_args!("auto, {}", names.join(", ")))
    })
}

/// What is built in of a material: title, powder, final contact ratio, measured times \[s\] and contact ratios, and the parameters of
/// Table 3 of the paper in SI.
#[pyfunction]
pub(crate) fn material<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
    let material = named(name)?;
    let experiment = Experiment::of_material(material).map_err(|error| mistaken(&error))?;
    let (powder, table3) = (material.powder(), material.table3_sintering());
    let found = PyDict::new(py);
    found.set_item("title", material.title())?;
    found.set_item(
        "powder",
        (
            powder.radius_m,
            powder.youngs_modulus_pa,
            powder.surface_tension_n_per_m,
            powder.density_kg_per_m3,
        ),
    )?;
    found.set_item("final_contact_ratio", experiment.final_contact_ratio)?;
    found.set_item("time_s", bytes(py, &experiment.table.time_s))?;
    found.set_item("contact_ratio", bytes(py, &experiment.table.contact_ratio))?;
    found.set_item("table3", (table3.c1, table3.tau_s, table3.delta_c))?;
    Ok(found)
}

/// Contact ratios at times \[s\], sorted, of a pair of particles of a powder (R, E, gamma, rho), for `sintering`
/// (C1, tau_s, delta_c, lambda) and `model` (kinetics, solver, tolerance).
#[pyfunction]
pub(crate) fn contact_ratios<'py>(
    py: Python<'py>,
    times_s: &[u8],
    sintering: (f64, f64, f64, f64),
    powder: (f64, f64, f64, f64),
    final_contact_ratio: f64,
    model: (String, String, f64),
) -> PyResult<Bound<'py, PyBytes>> {
    let powder = Powder {
        radius_m: powder.0,
        youngs_modulus_pa: powder.1,
        surface_tension_n_per_m: powder.2,
        density_kg_per_m3: powder.3,
    };
    let scene = PairSpec::new(powder, final_contact_ratio)
        .build()
        .map_err(|error| mistaken(&InputError::new("powder", Mistake::OutOfRange).found(error)))?;
    let (kinetics, forced, tolerance) = (kinetics(&model.0)?, solver(&model.1)?, model.2);
    let times_s = doubles(times_s);
    let (c1, tau_s, delta_c, lambda) = sintering;
    let sintering = Sintering { c1, tau_s, delta_c, lambda };
    let computed = py.detach(|| {
        let kind = forced.unwrap_or_else(|| choose_solver(&scene, kinetics, tolerance).kind);
        let settings = SolverSettings { tolerance, ..SolverSettings::of(kind) };
        let mut ratios = vec![0.0; times_s.len()];
        dem_core::contact_ratios(&scene, kinetics, &sintering, &settings, &times_s, &mut ratios)
            .map(|_| ratios)
    });
    let ratios = computed.map_err(|error| {
        mistaken(&InputError::new("neck_growth", Mistake::OutOfRange).found(error))
    })?;
    Ok(bytes(py, &ratios))
}
