//! Calibrations, and runs that are there.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use smc_calib::Noise;
use workbench::calibration::{self, Finished, RunOptions};
use workbench::error::{Failure, InputError, Mistake};
use workbench::export::{Attributes, Format, Groups, Values, Variable, export_posterior};
use workbench::init::InitOptions;
use workbench::input::columns::Columns;
use workbench::input::heat::HeatFields;
use workbench::pair::draws::PairDraws;
use workbench::plan::{FunctionOptions, PairOptions};
use workbench::predict::Wanted;
use workbench::{record, report};

use crate::curves::{kinetics, named, solver};
use crate::failures::{argument, failed, mistaken, raised};
use crate::job::{bytes, drive, work};

/// The folder of a run, and what became of an earlier one there.
type Place = (PathBuf, Option<PathBuf>);

fn place(finished: Finished) -> Place {
    let kept = match finished.published {
        workbench::output::Published::MovedAside { kept, .. } => Some(kept),
        _ => None,
    };
    (finished.out, kept)
}

/// Calibrates a Python function. `plan` is the JSON of the parameters, measurements and settings, `function` as in
/// [`drive`](crate::job::drive()).
#[pyfunction]
pub(crate) fn calibrate_function(
    py: Python<'_>,
    plan: &str,
    run: (PathBuf, Option<usize>),
    function: &Bound<'_, PyAny>,
    progress: &Bound<'_, PyAny>,
) -> PyResult<Place> {
    let options: FunctionOptions = serde_json::from_str(plan).map_err(|error| {
        mistaken(&InputError::new("calibrate", Mistake::WrongType).found(error))
    })?;
    let planned = options.plan().map_err(|error| mistaken(&error))?;
    let shape = (planned.plan.parameters.len(), planned.plan.observations());
    let options = RunOptions { out: Some(run.0), threads: run.1, ..RunOptions::default() };
    let found = drive(py, (shape.0, shape.1, Some(function)), progress, |watching, asking| {
        calibration::run_function(&planned, asking, &options, watching)
    })?;
    found.map(place).map_err(raised)
}

/// Options of a pair, by their names in Python.
fn pair_options(given: &Bound<'_, PyDict>) -> PyResult<PairOptions> {
    let mut options = PairOptions::default();
    for (key, value) in given.iter() {
        let key: String = key.extract()?;
        match key.as_str() {
            "material" => options.material = Some(named(&value.extract::<String>()?)?),
            "experiment" => options.experiment = Some(value.extract()?),
            "others" => options.others = value.extract()?,
            "prior" => options.prior = Some(value.extract()?),
            "window_s" => options.window_s = Some(value.extract()?),
            "kinetics" => options.kinetics = kinetics(&value.extract::<String>()?)?,
            "solver" => options.solver = solver(&value.extract::<String>()?)?,
            "tolerance" => options.tolerance = value.extract()?,
            "noise" => options.noise = noise(&value.extract::<String>()?)?,
            "samples" => options.samples = value.extract()?,
            "iterations" => options.iterations = Some(value.extract()?),
            "ess" => options.ess = Some(value.extract()?),
            "seed" => options.seed = value.extract()?,
            other => return Err(argument(other, "unknown", "an option of the calibration")),
        }
    }
    if !workbench::plan::SAMPLES.contains(&options.samples) {
        let range = workbench::plan::SAMPLES;
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        return Err(argument("samples", options.samples, expected));
    }
    Ok(options)
}

fn noise(json: &str) -> PyResult<Noise> {
    serde_json::from_str(json)
        .map_err(|error| mistaken(&InputError::new("noise", Mistake::OutOfRange).found(error)))
}

/// Calibrates a pair of particles by the built-in simulator.
#[pyfunction]
pub(crate) fn calibrate_pair(
    py: Python<'_>,
    options: &Bound<'_, PyDict>,
    run: (PathBuf, Option<usize>, bool),
    progress: &Bound<'_, PyAny>,
) -> PyResult<Place> {
    let planned = pair_options(options)?.plan().map_err(|error| mistaken(&error))?;
    let (out, threads, other_kinetics) = run;
    let options = RunOptions {
        out: Some(out),
        threads,
        without_other_kinetics: !other_kinetics,
        ..RunOptions::default()
    };
    let found = work(py, progress, |watching| {
        for warning in &planned.warnings {
            workbench::watch::Watch::warn(watching, warning);
        }
        calibration::run(&planned, &options, watching)
    })?;
    found.map(place).map_err(raised)
}

/// What a run left: its record as JSON, the summary as text, samples and draws as columns of doubles.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = || {
        let record = record::read(&path)?;
        let file = record::locate(&path);
        let folder = file.parent().map(PathBuf::from).unwrap_or_default();
        let samples = report::read_samples(&record, &folder)?;
        let draws = report::read_draws(&record, &folder)?;
        // One number for all values is what sigma is drawn of.
        let found: Vec<_> = record.observables().map(|(_, found)| found.sigma.is_some()).collect();
        let sigma = match found[..] {
            [true] => report::read_sigma(&record, &folder)?,
            _ => None,
        };
        Ok::<_, InputError>((record, folder, samples, draws, sigma))
    };
    let (record, folder, samples, draws, sigma) =
        py.detach(read).map_err(|error| mistaken(&error))?;
    let columns = |columns: &[Vec<f64>]| -> Vec<Bound<'_, PyBytes>> {
        columns.iter().map(|column| bytes(py, column)).collect()
    };
    let found = PyDict::new(py);
    let json = workbench::output::pretty(&record).map_err(|error| failed(&error))?;
    found.set_item("record", json)?;
    found.set_item("summary", report::text(&record, None, None))?;
    found.set_item("folder", folder)?;
    found.set_item("samples", columns(&samples.parameters))?;
    found.set_item("weights", bytes(py, &samples.weights))?;
    found.set_item("draws", columns(&draws))?;
    found.set_item("sigma", sigma.as_deref().map(|sigma| bytes(py, sigma)))?;
    Ok(found)
}

/// What a function gave for each sample of a run, row by row, NaN where it failed; none for runs of other simulators.
#[pyfunction]
pub(crate) fn simulated(py: Python<'_>, path: PathBuf) -> PyResult<Option<Bound<'_, PyBytes>>> {
    let read = || {
        let record = record::read(&path)?;
        if record.plan.function().is_none() {
            return Ok(None);
        }
        let rows = report::read_simulated(&record.plan, &path)?;
        let failed = vec![f64::NAN; record.plan.observations()];
        let values = rows.iter().flat_map(|row| row.as_ref().unwrap_or(&failed));
        Ok::<_, InputError>(Some(values.copied().collect::<Vec<f64>>()))
    };
    let values = py.detach(read).map_err(|error| mistaken(&error))?;
    Ok(values.map(|values| bytes(py, &values)))
}

/// The groups of a run as ArviZ names them: plain values, arrays as their shapes and bytes.
#[pyfunction]
pub(crate) fn groups(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = py.detach(|| Groups::read(&path)).map_err(raised)?;
    let variable = |variable: &Variable| {
        let (kind, values) = match &variable.values {
            Values::Real(values) => ("float64", bytes(py, values)),
            Values::Whole(values) => {
                let values: Vec<u8> = values.iter().flat_map(|v| v.to_ne_bytes()).collect();
                ("int64", PyBytes::new(py, &values))
            }
        };
        let attributes = attributes(&variable.attributes);
        (&variable.name, &variable.dims, &variable.shape, kind, values, attributes)
            .into_pyobject(py)
    };
    let all = |variables: &[Variable]| variables.iter().map(variable).collect::<PyResult<Vec<_>>>();
    let groups = PyDict::new(py);
    for group in &read.groups {
        let given = (group.description, all(&group.coordinates)?, all(&group.variables)?);
        groups.set_item(group.name, given)?;
    }
    let found = PyDict::new(py);
    found.set_item("attributes", attributes(&read.attributes))?;
    found.set_item("notes", &read.notes)?;
    found.set_item("groups", groups)?;
    Ok(found)
}

/// Writes the posterior of a run in one of the formats of `calibrate export` into a folder; the file, or the folder of a store.
#[pyfunction]
pub(crate) fn export(
    py: Python<'_>,
    path: PathBuf,
    format: &str,
    out: PathBuf,
) -> PyResult<PathBuf> {
    let Some(wanted) = Format::ALL.into_iter().find(|known| known.name() == format) else {
        let names = Format::ALL.map(Format::name).join(", ");
        return Err(argument(
            "format",
            format_args!("\"{format}\""),
            format_args!("one of {names}"),
        ));
    };
    py.detach(|| export_posterior(&path, &[wanted], Some(&out))).map_err(raised)?;
    Ok(out.join(wanted.file()))
}

/// Attributes as JSON.
fn attributes(attributes: &Attributes) -> String {
    serde_json::Value::Object(attributes.clone()).to_string()
}

/// What a run of pairs predicts, with options of `calibrate predict` by their names: as text, and as JSON.
#[pyfunction]
pub(crate) fn predict(
    py: Python<'_>,
    path: PathBuf,
    targets: Vec<f64>,
    after_s: Vec<f64>,
    asked: &Bound<'_, PyDict>,
) -> PyResult<(String, String)> {
    let number = |name: &str| asked.get_item(name)?.map(|value| value.extract()).transpose();
    let of: Option<String> = asked.get_item("of")?.map(|name| name.extract()).transpose()?;
    let heat: Option<PathBuf> = asked.get_item("heat")?.map(|file| file.extract()).transpose()?;
    let with_noise = asked.get_item("with_noise")?.map(|with| with.is_truthy()).transpose()?;
    let wanted = Wanted {
        targets,
        after_s,
        radius_m: number("radius_m")?,
        with_noise: with_noise.unwrap_or_default(),
        heat: None,
        pulse_energy: number("pulse_energy")?,
        enough: number("energy_for")?.zip(number("probability")?),
    };
    let predicted = py.detach(|| {
        let heat = heat.as_deref().map(HeatFields::open).transpose()?;
        let draws = PairDraws::read_of(&path, of.as_deref())?;
        let found = workbench::predict::predict(&draws, &Wanted { heat, ..wanted })?;
        let json = workbench::output::pretty(&found).map_err(Failure::from)?;
        Ok((found.text(), json))
    });
    predicted.map_err(raised)
}

/// Writes the files that a calibration of an own table needs beside it; gives what was found, and warnings.
#[pyfunction]
pub(crate) fn init(
    table: PathBuf,
    material: Option<String>,
    powder: (Option<f64>, Option<f64>, Option<f64>, Option<f64>),
    final_contact_ratio: Option<f64>,
    overwrite: bool,
) -> PyResult<(String, Vec<String>)> {
    let (radius_m, youngs_modulus_pa, surface_tension_n_per_m, density_kg_per_m3) = powder;
    let options = InitOptions {
        table,
        columns: Columns::default(),
        material: material.as_deref().map(named).transpose()?,
        radius_m,
        youngs_modulus_pa,
        surface_tension_n_per_m,
        density_kg_per_m3,
        final_contact_ratio,
        overwrite,
    };
    let found = workbench::init::init(&options).map_err(raised)?;
    Ok((found.text, found.warnings))
}
