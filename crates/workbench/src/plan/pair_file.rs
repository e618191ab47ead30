//! Built-in simulators of a plan file: the neck growth of a pair.

use std::collections::BTreeMap;
use std::path::Path;

use campaign::template::{Piece, pieces};
use dem_core::{Kinetics, SolverKind};
use smc_calib::{Noise, Parameter};

use super::heats::pairs;
use super::input_files::templates_name;
use super::observable::{checked, noise, window};
use super::pair::{CONTACT_RATIO, PairModel, pair_experiment};
use super::types::{ExperimentPlan, PairPlan, SimulatorPlan, SolverPlan};
use crate::error::{InputError, Mistake, nearest};
use crate::input::columns::Columns;
use crate::input::experiment::{BUILT_IN_NAMES, Experiment};
use crate::input::heat::{HeatFields, field_of};
use crate::input::material::Material;
use crate::input::prior_file;
use crate::input::toml_fields::{At, Fields};
use crate::pair::parameter::ParameterName;

/// Reads a built-in simulator and its observable; `folder` is that of the plan.
pub(super) fn pair(
    folder: &Path,
    fields: &Fields<'_>,
    observables: Option<&Fields<'_>>,
    (parameters, heat): (&[String], Option<&HeatFields>),
    warnings: &mut Vec<String>,
) -> Result<ExperimentPlan, InputError> {
    let experiment_field = fields.text("experiment")?;
    let materials = Material::ALL.map(|material| (material.name(), material));
    let material = fields.choice("material", &materials)?.map(|at| at.value);
    let kinetics = fields
        .choice("kinetics", &Kinetics::ALL.map(|kinetics| (kinetics.name(), kinetics)))?
        .map_or(Kinetics::ThreeStage, |at| at.value);
    let mut solvers = vec![("auto", None)];
    solvers.extend(SolverKind::ALL.map(|kind| (kind.name(), Some(kind))));
    let solver = fields.choice("solver", &solvers)?.and_then(|at| at.value);
    let tolerance = match fields.number("tolerance")? {
        Some(At { value, line }) if !SolverPlan::TOLERANCES.contains(&value) => {
            return Err(fields
                .error("tolerance", line, Mistake::OutOfRange)
                .found(value)
                .expected("an error of a/R between 1e-12 and 0.1"));
        }
        tolerance => tolerance.map_or(SolverPlan::DEFAULT_TOLERANCE, |at| at.value),
    };
    let tau_s_radius_m = fields.positive("tau_s_radius_m", "m")?.map(|at| at.value);
    let renamed = fields.table("parameters")?;
    fields.finish()?;

    let renamed = renamed.map_or_else(|| Ok(BTreeMap::new()), |table| names(&table, parameters))?;
    let experiment = experiment(folder, fields, experiment_field, material)?;
    warnings.extend(experiment.warnings());
    let heat = heat.cloned();
    let model =
        PairModel { kinetics, solver, tolerance, tau_s_radius_m, parameters: renamed, heat };
    let (window, noise) = observable(observables)?;
    let plan = pair_experiment(&experiment, model, window, noise)?;
    if let SimulatorPlan::Builtin(pair) = &plan.simulator {
        check_needed(pair, fields, parameters)?;
    }
    for observable in &plan.observables {
        checked(observable).map_err(|error| {
            let table = observable.table.clone();
            let place = observables.unwrap_or(fields);
            let line = place.line().unwrap_or(1);
            InputError { source_name: place.file_name().into(), ..error }
                .at_line(line)
                .in_field(place.path_of("contact_ratio.noise"))
                .help(format_args!("the measurements are in {table}; choose noise inferred or fixed, or a table with a column sigma"))
        })?;
    }
    Ok(plan)
}

/// Calibrated parameters by the names of the model.
fn names(
    table: &Fields<'_>,
    parameters: &[String],
) -> Result<BTreeMap<ParameterName, String>, InputError> {
    let mut names = BTreeMap::new();
    for (at, calibrated) in table.named_texts()? {
        let refused = || table.error(at.value, at.line, Mistake::UnknownName);
        let Some(model) = ParameterName::from_name(at.value) else {
            let known = ParameterName::ALL.map(ParameterName::name);
            return Err(refused()
                .found("no parameter of the neck growth model")
                .expected(format_args!("one of {}", known.join(", ")))
                .help_if(nearest(at.value, known).map(|near| format!("did you mean {near}?"))));
        };
        if !parameters.iter().any(|name| name == calibrated) {
            return Err(refused()
                .found(format_args!("\"{calibrated}\""))
                .expected(format_args!("one of {}", parameters.join(", "))));
        }
        names.insert(model, calibrated.to_owned());
    }
    Ok(names)
}

/// The experiment that a plan names: a description, a table of a material, a built-in experiment, or a material.
fn experiment(
    folder: &Path,
    fields: &Fields<'_>,
    named: Option<At<&str>>,
    material: Option<Material>,
) -> Result<Experiment, InputError> {
    let built_in = BUILT_IN_NAMES.join(", ");
    match (named, material) {
        (None, None) => Err(fields
            .missing("experiment")
            .expected(format_args!("a description (.toml) or one of {built_in}"))),
        (None, Some(material)) => Experiment::of_material(material),
        (Some(At { value, line }), material) => {
            let path = folder.join(value);
            if BUILT_IN_NAMES.contains(&value) && !path.exists() {
                return Experiment::built_in(value);
            }
            Experiment::open(&path, material, &Columns::default()).map_err(|error| {
                if error.mistake == Mistake::MissingFile {
                    error.help(format_args!("built in are {built_in}")).named_in(
                        fields,
                        "experiment",
                        line,
                    )
                } else {
                    error
                }
            })
        }
    }
}

/// Window and noise of the contact ratio, the one observable.
fn observable(tables: Option<&Fields<'_>>) -> Result<(Option<[f64; 2]>, Noise), InputError> {
    let mut read = (None, Noise::default());
    let Some(tables) = tables else { return Ok(read) };
    for (at, table) in tables.named_tables()? {
        if at.value != CONTACT_RATIO {
            return Err(tables
                .error(at.value, at.line, Mistake::UnknownName)
                .found("no observable of the built-in simulator")
                .expected(CONTACT_RATIO)
                .help("other observables are read from a command's results"));
        }
        read.0 = window(&table)?;
        if let Some(table) = table.table("noise")? {
            read.1 = noise(&table)?;
        }
        table.finish()?;
    }
    Ok(read)
}

/// The kinetics have a value for every parameter that they use.
fn check_needed(
    pair: &PairPlan,
    fields: &Fields<'_>,
    parameters: &[String],
) -> Result<(), InputError> {
    let missing = ParameterName::ALL.into_iter().find(|&model| {
        pair.needs(model) && !parameters.iter().any(|name| name == pair.calibrated(model))
    });
    let Some(model) = missing else { return Ok(()) };
    let calibrated = pair.calibrated(model);
    let who = match field_of(model) {
        Some(_) => "heat needs".to_owned(),
        None => format!("{} kinetics need", pair.kinetics),
    };
    Err(fields
        .table_error(Mistake::MissingField)
        .found(format_args!("no parameter {calibrated}"))
        .expected(format_args!("[parameters.{calibrated}], which the {who}"))
        .help_if(field_of(model).map(|field| format!("or state {field} in [heat]"))))
}

/// The priors of a pair's parameters allow only what the model has.
pub(super) fn check_priors(
    pair: &PairPlan,
    tables: &[(At<&str>, Fields<'_>)],
    parameters: &[Parameter],
) -> Result<(), InputError> {
    for ((_, table), parameter) in tables.iter().zip(parameters) {
        let model =
            ParameterName::ALL.into_iter().find(|model| pair.calibrated(*model) == parameter.name);
        if let Some(model) = model {
            prior_file::check_support(model, table, parameter.prior.spec())?;
        }
    }
    Ok(())
}

/// Where pairs of several radii share a tau_s, the plan says which radius it belongs to.
pub(super) fn check_radii(
    fields: &Fields<'_>,
    tables: &[(At<&str>, Fields<'_>)],
    experiments: &[ExperimentPlan],
) -> Result<(), InputError> {
    for (experiment, pair) in pairs(experiments).filter(|(_, pair)| pair.tau_s_radius_m.is_none()) {
        let (name, radius) = (&experiment.name, pair.powder.radius_m);
        let tau_s = pair.calibrated(ParameterName::TauS);
        let other = pairs(experiments).find(|(_, other)| {
            other.powder.radius_m != radius && other.calibrated(ParameterName::TauS) == tau_s
        });
        if let Some((other, other_pair)) = other {
            let mut error = fields
                .table_error(Mistake::MissingField)
                .in_field(format_args!("experiments.{name}.simulator.tau_s_radius_m"))
                .found(format_args!(
                    "missing, and {name} has R = {radius} m where {} has {} m",
                    other.name, other_pair.powder.radius_m
                ))
                .expected("the radius that the shared tau_s belongs to [m]")
                .help("tau_s grows with the radius: this pair then sinters with tau_s R / tau_s_radius_m")
                .help("or give each experiment a tau_s of its own: parameters = { tau_s = \"...\" }");
            error.line = tables.iter().find(|(at, _)| at.value == name).map(|(at, _)| at.line);
            return Err(error);
        }
    }
    Ok(())
}

/// A parameter that no experiment uses is most likely misspelt. A command gets all in its parameter file.
pub(super) fn check_all_used(
    folder: &Path,
    tables: &[(At<&str>, Fields<'_>)],
    experiments: &[ExperimentPlan],
) -> Result<(), InputError> {
    let commands = pairs(experiments).count() < experiments.len();
    for (at, table) in tables {
        let used = pairs(experiments).any(|(_, pair)| {
            ParameterName::ALL.iter().any(|m| {
                let read = !m.is_of_heat() || pair.takes(*m);
                read && pair.calibrated(*m) == at.value
            })
        });
        if !used && !commands_name(folder, experiments, at.value) {
            if commands {
                return Err(table
                    .table_error(Mistake::UnknownName)
                    .found("a parameter that no command uses")
                    .expected(format_args!(
                        "{{{0}}} or {{parameters}} in argv or environment, or {{{{{0}}}}} in a template",
                        at.value
                    ))
                    .help("a parameter that changes nothing costs runs; leave it out"));
            }
            let known = ParameterName::ALL.map(ParameterName::name);
            return Err(table
                .table_error(Mistake::UnknownName)
                .found("a parameter that no experiment uses")
                .expected(format_args!("one of {}", known.join(", ")))
                .help_if(nearest(at.value, known).map(|near| format!("did you mean {near}?"))));
        }
    }
    Ok(())
}

/// Whether a command, or a template of its input files, has a placeholder for a parameter, or for the file with all of them.
/// A worker gets all parameters.
fn commands_name(folder: &Path, experiments: &[ExperimentPlan], parameter: &str) -> bool {
    let names = |text: &String| {
        let pieces = pieces(text).unwrap_or_default();
        [parameter, "parameters"].iter().any(|name| pieces.contains(&Piece::Name(name)))
    };
    experiments.iter().any(|experiment| match &experiment.simulator {
        SimulatorPlan::Command(call) if call.worker => true,
        SimulatorPlan::Command(call) => {
            call.argv.iter().chain(call.environment.values()).any(names)
                || templates_name(folder, &call.files, parameter)
        }
        SimulatorPlan::Builtin(_) | SimulatorPlan::Function { .. } => false,
    })
}
