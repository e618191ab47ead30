//! Plan files: what `calibrate --plan FILE` reads, in TOML or JSON. `crates/guide/pages/plan-files.md` has every
//! field.

use std::path::Path;

use smc_calib::Parameter;

use super::command::command;
use super::earlier::EarlierPosterior;
use super::executor::executor;
use super::heats::check_heats;
use super::input_files::check_places;
use super::made_of;
use super::observable::observable;
use super::pair_file::{check_all_used, check_priors, check_radii, pair};
use super::proposal::{Named, begin_from};
use super::sampler::{Sampling, sampler};
use super::template;
use super::types::{ExecutorPlan, ExperimentPlan, Plan, Planned, SimulatorPlan, is_word};
use crate::error::{InputError, Mistake};
use crate::input::experiment::{checked_name, is_toml};
use crate::input::files_read;
use crate::input::heat::HeatFields;
use crate::input::prior_file;
use crate::input::text_file::{self, folder_of};
use crate::input::toml_fields::{At, Document, Fields};

impl Planned {
    /// Reads a plan file and the tables that it names.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::read_for(path, None)
    }

    /// As [`read`](Self::read), with the text of the file given. Tables are looked for beside `path`.
    pub fn parse(path: &Path, text: String) -> Result<Self, InputError> {
        Self::noted(path, || Self::parse_for(path, text, None))
    }

    /// As [`read`](Self::read), for a run that has begun from this earlier posterior: where the file names it as it did then, it is
    /// not read again.
    pub(crate) fn read_for(
        path: &Path,
        kept: Option<&EarlierPosterior>,
    ) -> Result<Self, InputError> {
        Self::noted(path, || Self::parse_for(path, text_file::read(path)?, kept))
    }

    /// Reads a plan, and notes what was read of its files.
    fn noted(
        path: &Path,
        read: impl FnOnce() -> Result<Self, InputError>,
    ) -> Result<Self, InputError> {
        let (planned, files) = files_read::noted(read);
        let planned = planned?;
        Ok(Self { inputs: Some(made_of::inputs(Some(path), &planned.plan, &files)), ..planned })
    }

    fn parse_for(
        path: &Path,
        text: String,
        kept: Option<&EarlierPosterior>,
    ) -> Result<Self, InputError> {
        let name = path.display().to_string();
        let json = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
        if !json && !is_toml(path) {
            return Err(InputError::new(name, Mistake::Syntax)
                .found("neither .toml nor .json")
                .expected("a plan in TOML or JSON")
                .help("see experiments/external/impact.toml for how it looks"));
        }
        let document =
            if json { Document::parse_json(&name, &text)? } else { Document::parse(&name, &text)? };
        let mut warnings = Vec::new();
        let (plan, executor) = read_plan(path, &document.top(), kept, &mut warnings)?;
        drop(document);
        let path = Some(path.to_owned());
        Ok(Self { plan, executor, warnings, path, text, inputs: None }.warned())
    }
}

fn read_plan(
    path: &Path,
    fields: &Fields<'_>,
    kept: Option<&EarlierPosterior>,
    warnings: &mut Vec<String>,
) -> Result<(Plan, ExecutorPlan), InputError> {
    let name = match fields.text("name")? {
        Some(At { value, line }) => checked_name(fields, value, line)?,
        None => path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into()),
    };
    if name.contains(|c: char| c.is_control() || c == '\\') {
        return Err(fields
            .missing("name")
            .expected(
                "a name for the folder of the results: that of this file has other characters",
            )
            .help("name = \"my-run\""));
    }
    let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
    let title = owned("title")?.unwrap_or_else(|| name.clone());
    let (source, prior_source) = (owned("source")?, owned("prior_source")?);
    let parameters_table = fields.table("parameters")?;
    let experiments_table = fields.table("experiments")?;
    let sampler_table = fields.table("sampler")?;
    let executor_table = fields.table("executor")?;
    let heat_table = fields.table("heat")?;
    fields.finish()?;

    let Some(parameters_table) = parameters_table else {
        return Err(fields
            .missing("parameters")
            .expected("a table for each parameter")
            .help("add [parameters.NAME] with unit, distribution and its numbers"));
    };
    let tables = some_tables(&parameters_table, "no parameters", "at least one [parameters.NAME]")?;
    let parameters = tables
        .iter()
        .map(|(name, table)| parameter(&parameters_table, *name, table))
        .collect::<Result<Vec<_>, _>>()?;
    let Some(experiments_table) = experiments_table else {
        return Err(fields
            .missing("experiments")
            .expected("at least one experiment")
            .help("add [experiments.NAME] with a simulator and observables"));
    };
    let heat = heat_table.map(|heat| HeatFields::read(folder_of(path), &heat)).transpose()?;
    let given = Given { tables: &tables, parameters: &parameters, heat: heat.as_ref() };
    let experiments = experiments(folder_of(path), &experiments_table, &given, warnings)?;
    let commands = experiments.iter().any(|e| matches!(e.simulator, SimulatorPlan::Command(_)));
    let Sampling { settings, design, proposal } =
        sampler(folder_of(path), sampler_table.as_ref(), commands, &parameters)?;
    let executor = executor(executor_table.as_ref(), &experiments)?;
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let mut plan = Plan {
        name,
        title,
        source,
        parameters,
        prior_source,
        experiments,
        sampler: settings,
        design,
        proposal: None,
        population: None,
        version,
    };
    if let (Some(At { value: from, line }), Some(table)) = (proposal, &sampler_table) {
        let place = |mistake| table.error("proposal", line, mistake);
        let named = Named { from, path: &folder_of(path).join(from), place: &place };
        begin_from(&mut plan, &named, kept, warnings)?;
    }
    Ok((plan, executor))
}

/// The tables in a table that must hold one at least.
fn some_tables<'d>(
    fields: &Fields<'d>,
    found: &str,
    expected: &str,
) -> Result<Vec<(At<&'d str>, Fields<'d>)>, InputError> {
    let tables = fields.named_tables()?;
    if tables.is_empty() {
        return Err(fields.table_error(Mistake::Empty).found(found).expected(expected));
    }
    Ok(tables)
}

/// What a plan gives all its experiments.
struct Given<'g> {
    /// The tables of the parameters, with their names.
    tables: &'g [(At<&'g str>, Fields<'g>)],
    parameters: &'g [Parameter],
    heat: Option<&'g HeatFields>,
}

fn experiments(
    folder: &Path,
    fields: &Fields<'_>,
    given: &Given<'_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<ExperimentPlan>, InputError> {
    let &Given { tables, parameters, heat } = given;
    let names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();
    let own = some_tables(fields, "no experiments", "at least one [experiments.NAME]")?;
    let mut experiments = Vec::new();
    for (at, table) in &own {
        check_word(fields, *at, "an experiment")?;
        let experiment = experiment(folder, at.value, table, (&names, heat), warnings)?;
        if let SimulatorPlan::Builtin(pair) = &experiment.simulator {
            check_priors(pair, tables, parameters)?;
        }
        experiments.push(experiment);
    }
    check_radii(fields, &own, &experiments)?;
    check_heats(fields, &own, &experiments, heat)?;
    check_all_used(folder, tables, &experiments)?;
    let observables = experiments.iter().flat_map(|experiment| &experiment.observables);
    if observables.clone().count() > 1 && observables.clone().any(|o| o.noise.is_tuned()) {
        return Err(fields
            .table_error(Mistake::Conflict)
            .found("noise ess-target beside other observables")
            .expected("one observable, where the noise is tuned")
            .help("choose noise inferred or fixed"));
    }
    Ok(experiments)
}

fn experiment(
    folder: &Path,
    name: &str,
    fields: &Fields<'_>,
    (parameters, heat): (&[String], Option<&HeatFields>),
    warnings: &mut Vec<String>,
) -> Result<ExperimentPlan, InputError> {
    let simulator = fields.table("simulator")?;
    let observables = fields.table("observables")?;
    fields.finish()?;
    let Some(simulator) = simulator else {
        return Err(fields
            .missing("simulator")
            .expected(
                "kind = \"command\" or \"worker\" with argv, or kind = \"builtin\" with experiment",
            )
            .help("add the table [experiments.NAME.simulator]"));
    };
    #[derive(Clone, Copy, PartialEq)]
    enum Kind {
        Builtin,
        Command,
        Worker,
    }
    let kinds = [("builtin", Kind::Builtin), ("command", Kind::Command), ("worker", Kind::Worker)];
    let kind = simulator.choice("kind", &kinds)?.ok_or_else(|| {
        simulator.missing("kind").expected("\"command\", \"worker\" or \"builtin\"")
    })?;
    if kind.value == Kind::Builtin {
        let pair = pair(folder, &simulator, observables.as_ref(), (parameters, heat), warnings)?;
        return Ok(ExperimentPlan { name: name.to_owned(), ..pair });
    }
    let worker = kind.value == Kind::Worker;
    let call = command(folder, &simulator, (parameters, worker))?;
    let Some(tables) = observables else {
        return Err(fields
            .missing("observables")
            .expected("at least one observable")
            .help("add [experiments.NAME.observables.NAME] with table, value and result"));
    };
    let observables = some_tables(&tables, "no observables", "at least one")?
        .iter()
        .map(|(at, table)| {
            check_word(&tables, *at, "an observable")?;
            observable(folder, at.value, table, worker)
        })
        .collect::<Result<_, _>>()?;
    let experiment = ExperimentPlan {
        name: name.to_owned(),
        simulator: SimulatorPlan::Command(call.clone()),
        observables,
    };
    check_places(&simulator, &experiment.command(folder, call))?;
    Ok(experiment)
}

fn check_word(fields: &Fields<'_>, at: At<&str>, what: &str) -> Result<(), InputError> {
    if is_word(at.value) {
        return Ok(());
    }
    Err(fields
        .error(at.value, at.line, Mistake::OutOfRange)
        .found(format_args!("\"{}\" as the name of {what}", at.value))
        .expected("a letter, then letters, digits, _ and -, at most 64"))
}

fn parameter(
    parent: &Fields<'_>,
    at: At<&str>,
    fields: &Fields<'_>,
) -> Result<Parameter, InputError> {
    check_word(parent, at, "a parameter")?;
    if template::RESERVED.contains(&at.value) {
        return Err(parent
            .error(at.value, at.line, Mistake::Conflict)
            .found(format_args!("\"{}\", which is a placeholder already", at.value))
            .expected("another name"));
    }
    let unit = fields.text("unit")?.map_or("1", |at| at.value);
    let prior = prior_file::any_prior(fields)?;
    Ok(Parameter::new(at.value, unit, prior))
}

#[cfg(test)]
mod tests;
