//! Plan files: what `calibrate --plan FILE` reads, in TOML or JSON. The reference for users is
//! `crates/workbench/docs/plan-files.md`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use dem_core::{Kinetics, SolverKind, choose_solver};
use smc_calib::{FixedSigma, Noise, Observations, Parameter, Prior, Settings};

use super::data_table::DataTable;
use super::plan::{
    BuiltinPlan, CommandPlan, Design, ExecutorPlan, ExperimentPlan, ExternalPlan, Interpolate,
    Keep, ObservablePlan, ResultFormat, ResultPlan, SimulatorPlan, SlurmPlan,
};
use super::sample_table::SampleTable;
use super::template::{self, TemplateError};
use crate::error::{InputError, Mistake, nearest};
use crate::experiment::{BUILT_IN_NAMES, Experiment, is_toml};
use crate::plan::PlannedSolver;
use crate::prior_file::{self, ParameterName};
use crate::text_file;
use crate::toml_fields::{At, Document, Fields};

/// Parameter sets of a plan with commands, where it does not say how many.
const COMMAND_SAMPLES: usize = 300;
/// The same of a plan with built-in simulators alone.
const BUILTIN_SAMPLES: usize = 16_384;
/// Longest time of a run, where the plan does not say.
const TIMEOUT_S: f64 = 3600.0;
/// How often a lost run is tried again, where the plan does not say.
const RETRIES: u32 = 2;

/// A plan file that was read: the plan, and how its runs are executed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanFile {
    /// The file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// What decides the result.
    pub plan: ExternalPlan,
    /// How the runs are executed.
    pub executor: ExecutorPlan,
    /// What is allowed and yet worth saying.
    pub warnings: Vec<String>,
}

impl PlanFile {
    /// Reads a plan and the tables that it names.
    ///
    /// # Errors
    ///
    /// [`InputError`] with file, line, field, value and remedy.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = text_file::read(path)?;
        Self::parse(path, text)
    }

    /// As [`read`](Self::read), with the text of the file given. Tables are looked for beside `path`.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn parse(path: &Path, text: String) -> Result<Self, InputError> {
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
        let reader = Reader { folder: folder_of(path) };
        let (plan, executor, warnings) = reader.plan(path, &document.top())?;
        drop(document);
        Ok(Self { path: path.to_owned(), text, plan, executor, warnings })
    }

    /// The folder that the plan's relative names begin at.
    #[must_use]
    pub fn folder(&self) -> &Path {
        folder_of(&self.path)
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Whether the fields at the top of a file are those of a plan.
pub(crate) fn looks_like_a_plan(keys: &[&str]) -> bool {
    keys.contains(&"parameters") || keys.contains(&"experiments")
}

struct Reader<'p> {
    folder: &'p Path,
}

impl Reader<'_> {
    fn plan(
        &self,
        path: &Path,
        fields: &Fields<'_>,
    ) -> Result<(ExternalPlan, ExecutorPlan, Vec<String>), InputError> {
        let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into());
        let name = match fields.text("name")? {
            Some(At { value, line }) => crate::experiment::checked_name(fields, value, line)?,
            None => stem,
        };
        let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
        let title = owned("title")?.unwrap_or_else(|| name.clone());
        let source = owned("source")?;
        let parameters_table = fields.table("parameters")?;
        let experiments_table = fields.table("experiments")?;
        let sampler_table = fields.table("sampler")?;
        let executor_table = fields.table("executor")?;
        fields.finish()?;

        let Some(parameters_table) = parameters_table else {
            return Err(fields
                .missing("parameters")
                .expected("a table for each parameter")
                .help("add [parameters.NAME] with unit, distribution and its numbers"));
        };
        let tables = parameters_table.named_tables()?;
        if tables.is_empty() {
            return Err(parameters_table
                .table_error(Mistake::Empty)
                .found("no parameters")
                .expected("at least one [parameters.NAME]"));
        }
        let mut parameters = Vec::new();
        for (name, table) in &tables {
            parameters.push(parameter(&parameters_table, *name, table)?);
        }
        let names: Vec<String> = parameters.iter().map(|p| p.name.clone()).collect();

        let Some(experiments_table) = experiments_table else {
            return Err(fields
                .missing("experiments")
                .expected("at least one experiment")
                .help("add [experiments.NAME] with a simulator and observables"));
        };
        let mut experiments = Vec::new();
        let mut warnings = Vec::new();
        let mut radii: Vec<(String, f64, bool, Option<usize>)> = Vec::new();
        for (at, table) in experiments_table.named_tables()? {
            check_word(&experiments_table, at, "an experiment")?;
            let experiment = self.experiment(at.value, &table, &names, &mut warnings)?;
            if let SimulatorPlan::Builtin(builtin) = &experiment.simulator {
                for (place, (name, table)) in tables.iter().enumerate() {
                    let models = builtin
                        .parameters
                        .iter()
                        .find(|(_, calibrated)| *calibrated == name.value)
                        .map_or(name.value, |(model, _)| model.as_str());
                    if let Some(model) = ParameterName::from_name(models) {
                        prior_file::check_support(model, table, parameters[place].prior.spec())?;
                    }
                }
                radii.push((
                    at.value.to_owned(),
                    builtin.radius_m,
                    builtin.tau_s_radius_m.is_some(),
                    table.line(),
                ));
            }
            experiments.push(experiment);
        }
        if experiments.is_empty() {
            return Err(experiments_table
                .table_error(Mistake::Empty)
                .found("no experiments")
                .expected("at least one [experiments.NAME]"));
        }
        check_radii(&fields.file_name(), &radii, &experiments)?;
        check_all_used(&tables, &experiments)?;

        let commands = experiments.iter().any(|e| matches!(e.simulator, SimulatorPlan::Command(_)));
        let (sampler, design) =
            self.sampler(sampler_table.as_ref(), commands, &names, &parameters)?;
        let executor = executor(executor_table.as_ref(), commands)?;
        let plan = ExternalPlan {
            name,
            title,
            source,
            parameters,
            experiments,
            sampler,
            design,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let (observations, dimension) = (plan.observations(), plan.parameters.len());
        if observations < dimension {
            warnings.push(
                smc_calib::Warning::FewObservations { observations, parameters: dimension }
                    .to_string(),
            );
        }
        Ok((plan, executor, warnings))
    }

    fn experiment(
        &self,
        name: &str,
        fields: &Fields<'_>,
        parameters: &[String],
        warnings: &mut Vec<String>,
    ) -> Result<ExperimentPlan, InputError> {
        let simulator = fields.table("simulator")?;
        let observables = fields.table("observables")?;
        fields.finish()?;
        let Some(simulator) = simulator else {
            return Err(fields
                .missing("simulator")
                .expected("kind = \"command\" with argv, or kind = \"builtin\" with experiment")
                .help("add the table [experiments.NAME.simulator]"));
        };
        let builtin = simulator
            .choice("kind", &[("builtin", true), ("command", false)])?
            .ok_or_else(|| simulator.missing("kind").expected("\"command\" or \"builtin\""))?;
        if builtin.value {
            self.builtin(name, &simulator, observables.as_ref(), parameters, warnings)
        } else {
            let command = self.command(&simulator, parameters)?;
            let Some(tables) = observables else {
                return Err(fields
                    .missing("observables")
                    .expected("at least one observable")
                    .help("add [experiments.NAME.observables.NAME] with table, value and result"));
            };
            let mut observables = Vec::new();
            for (at, table) in tables.named_tables()? {
                check_word(&tables, at, "an observable")?;
                observables.push(self.observable(at.value, &table)?);
            }
            if observables.is_empty() {
                return Err(tables
                    .table_error(Mistake::Empty)
                    .found("no observables")
                    .expected("at least one"));
            }
            Ok(ExperimentPlan {
                name: name.to_owned(),
                simulator: SimulatorPlan::Command(command),
                observables,
            })
        }
    }

    fn builtin(
        &self,
        name: &str,
        fields: &Fields<'_>,
        observables: Option<&Fields<'_>>,
        parameters: &[String],
        warnings: &mut Vec<String>,
    ) -> Result<ExperimentPlan, InputError> {
        let experiment_field = fields.text("experiment")?.ok_or_else(|| {
            fields.missing("experiment").expected(format_args!(
                "a description (.toml) or one of {}",
                BUILT_IN_NAMES.join(", ")
            ))
        })?;
        let kinetics = fields
            .choice("kinetics", &Kinetics::ALL.map(|kinetics| (kinetics.name(), kinetics)))?
            .map_or(Kinetics::ThreeStage, |at| at.value);
        let mut solvers = vec![("auto", None)];
        solvers.extend(SolverKind::ALL.map(|kind| (kind.name(), Some(kind))));
        let forced = fields.choice("solver", &solvers)?.and_then(|at| at.value);
        let tolerance = fields.positive("tolerance", "1")?.map_or(1e-4, |at| at.value);
        let tau_s_radius = fields.positive("tau_s_radius_m", "m")?.map(|at| at.value);
        let renamed_table = fields.table("parameters")?;
        fields.finish()?;

        let mut renamed = BTreeMap::new();
        if let Some(table) = &renamed_table {
            for (at, calibrated) in table.named_texts()? {
                if ParameterName::from_name(at.value).is_none() {
                    let known = ParameterName::ALL.map(ParameterName::name);
                    return Err(table
                        .error(at.value, at.line, Mistake::UnknownName)
                        .found("no parameter of the neck growth model")
                        .expected(format_args!("one of {}", known.join(", ")))
                        .help_if(
                            nearest(at.value, known).map(|near| format!("did you mean {near}?")),
                        ));
                }
                if !parameters.iter().any(|name| name == calibrated) {
                    return Err(table
                        .error(at.value, at.line, Mistake::UnknownName)
                        .found(format_args!("\"{calibrated}\""))
                        .expected(format_args!("one of {}", parameters.join(", "))));
                }
                renamed.insert(at.value.to_owned(), calibrated.to_owned());
            }
        }
        let path = self.folder.join(experiment_field.value);
        let experiment = if BUILT_IN_NAMES.contains(&experiment_field.value) && !path.exists() {
            Experiment::built_in(experiment_field.value)?
        } else {
            Experiment::read(&path).map_err(|error| {
                if error.mistake == Mistake::MissingFile {
                    error.help(format_args!("built in are {}", BUILT_IN_NAMES.join(", "))).help(
                        format_args!(
                            "{}, line {}, names it",
                            fields.file_name(),
                            experiment_field.line
                        ),
                    )
                } else {
                    error
                }
            })?
        };
        warnings.extend(experiment.warnings());
        for model in ParameterName::ALL {
            let used = match model {
                ParameterName::C1 | ParameterName::DeltaC => kinetics.uses_c1_delta_c(),
                ParameterName::TauS => true,
                ParameterName::Phi => false,
            };
            let calibrated = renamed.get(model.name()).map_or(model.name(), String::as_str);
            if used && !parameters.iter().any(|name| name == calibrated) {
                return Err(fields
                    .table_error(Mistake::MissingField)
                    .found(format_args!("no parameter {calibrated}"))
                    .expected(format_args!(
                        "[parameters.{calibrated}], which the {kinetics} kinetics need"
                    )));
            }
        }
        let powder = experiment.powder;
        let mut plan = BuiltinPlan {
            experiment: experiment.description_name.clone(),
            radius_m: powder.radius_m,
            youngs_modulus_pa: powder.youngs_modulus_pa,
            surface_tension_n_per_m: powder.surface_tension_n_per_m,
            density_kg_per_m3: powder.density_kg_per_m3,
            final_contact_ratio: experiment.final_contact_ratio,
            kinetics: kinetics.name().to_owned(),
            solver: PlannedSolver {
                name: String::new(),
                forced: forced.is_some(),
                reason: String::new(),
                tolerance,
            },
            tau_s_radius_m: tau_s_radius,
            parameters: renamed,
        };
        let scene = plan.scene().map_err(|error| {
            InputError::new(&experiment.description_name, Mistake::OutOfRange).found(error)
        })?;
        match forced {
            Some(kind) => {
                plan.solver.name = kind.name().to_owned();
                plan.solver.reason = format!("{kind}: as asked");
            }
            None => {
                let choice = choose_solver(&scene, kinetics, tolerance);
                plan.solver.name = choice.kind.name().to_owned();
                plan.solver.reason = choice.reason;
            }
        }

        let mut window = None;
        let mut noise = Noise::default();
        if let Some(tables) = observables {
            for (at, table) in tables.named_tables()? {
                if at.value != "contact_ratio" {
                    return Err(tables
                        .error(at.value, at.line, Mistake::UnknownName)
                        .found("no observable of the built-in simulator")
                        .expected("contact_ratio")
                        .help("other observables are read from a command's results"));
                }
                window = window_of(&table)?;
                if let Some(table) = table.table("noise")? {
                    noise = read_noise(&table)?;
                }
                table.finish()?;
            }
        }
        let measured = experiment.observations(window)?;
        let observable = ObservablePlan {
            name: "contact_ratio".to_owned(),
            table: experiment.table_name.clone(),
            control_column: Some("time_s".to_owned()),
            value_column: "contact_ratio".to_owned(),
            unit: String::new(),
            control_unit: "s".to_owned(),
            window: experiment.fitted_window(window),
            control: measured.time_s,
            values: measured.contact_ratio,
            sigma: measured.sigma,
            noise,
            result: None,
        };
        checked(&observable).map_err(|error| error.in_field(fields.path_of("experiment")))?;
        Ok(ExperimentPlan {
            name: name.to_owned(),
            simulator: SimulatorPlan::Builtin(plan),
            observables: vec![observable],
        })
    }

    fn command(
        &self,
        fields: &Fields<'_>,
        parameters: &[String],
    ) -> Result<CommandPlan, InputError> {
        let argv = fields.texts("argv")?.ok_or_else(|| {
            fields
                .missing("argv")
                .expected("the program and its arguments")
                .help("argv = [\"sh\", \"{plan_dir}/simulate.sh\", \"{stiffness}\"]")
        })?;
        let environment_table = fields.table("environment")?;
        let timeout_s = fields.positive("timeout_s", "s")?.map_or(TIMEOUT_S, |at| at.value);
        let retries = fields.whole("retries", 0, 100)?.map_or(RETRIES, |at| at.value as u32);
        let keep = fields
            .choice("keep", &[("failed", Keep::Failed), ("all", Keep::All), ("none", Keep::None)])?
            .map_or(Keep::Failed, |at| at.value);
        fields.finish()?;
        let Some(program) = argv.value.first() else {
            return Err(fields
                .error("argv", argv.line, Mistake::Empty)
                .found("[]")
                .expected("the program and its arguments"));
        };
        for argument in &argv.value {
            template::check(argument, parameters).map_err(|error| {
                template_error(
                    fields.error("argv", argv.line, Mistake::UnknownName),
                    argument,
                    &error,
                    parameters,
                )
            })?;
        }
        self.check_program(fields, program, argv.line)?;
        let mut environment = BTreeMap::new();
        if let Some(table) = &environment_table {
            for (at, value) in table.named_texts()? {
                template::check(value, parameters).map_err(|error| {
                    template_error(
                        table.error(at.value, at.line, Mistake::UnknownName),
                        value,
                        &error,
                        parameters,
                    )
                })?;
                if at.value.is_empty() || at.value.contains(['=', '\0']) || value.contains('\0') {
                    return Err(table
                        .error(at.value, at.line, Mistake::OutOfRange)
                        .found("a name or value that no environment can hold"));
                }
                environment.insert(at.value.to_owned(), value.to_owned());
            }
        }
        Ok(CommandPlan {
            argv: argv.value.into_iter().map(str::to_owned).collect(),
            environment,
            timeout_s,
            retries,
            keep,
        })
    }

    /// A program with a folder in its name must be there; one without is looked for on the path.
    fn check_program(
        &self,
        fields: &Fields<'_>,
        program: &str,
        line: usize,
    ) -> Result<(), InputError> {
        let refused = |found: String| fields.error("argv", line, Mistake::MissingFile).found(found);
        if program.contains('{') && !program.starts_with("{plan_dir}/") {
            return Ok(());
        }
        let beside_plan = program.strip_prefix("{plan_dir}/");
        let relative = beside_plan.unwrap_or(program);
        if beside_plan.is_some() || relative.contains('/') {
            let path = self.folder.join(relative);
            if !path.is_file() {
                return Err(refused(format!("the program {}", path.display()))
                    .expected("a file that is there")
                    .help("a name with a folder begins at the folder of the plan"));
            }
            return Ok(());
        }
        let found = std::env::var_os("PATH").is_some_and(|path| {
            std::env::split_paths(&path).any(|folder| folder.join(relative).is_file())
        });
        if found {
            return Ok(());
        }
        let beside = self.folder.join(relative).is_file();
        Err(refused(format!("the program \"{program}\", which is not on the path"))
            .help_if(beside.then(|| format!("it is beside the plan: write {{plan_dir}}/{program}")))
            .help("install it, or name it with its folder"))
    }

    fn observable(&self, name: &str, fields: &Fields<'_>) -> Result<ObservablePlan, InputError> {
        let table_field = fields
            .text("table")?
            .ok_or_else(|| fields.missing("table").expected("the file of the measurements"))?;
        let control_column = fields.text("control")?.map(|at| at.value.to_owned());
        let value_column = fields.text("value")?.map_or(name, |at| at.value).to_owned();
        let sigma_column = fields.text("sigma")?.map(|at| at.value.to_owned());
        let owned = |key| {
            Ok::<_, InputError>(fields.text(key)?.map_or_else(String::new, |at| at.value.into()))
        };
        let unit = owned("unit")?;
        let control_unit = owned("control_unit")?;
        let window = window_of(fields)?;
        let noise_table = fields.table("noise")?;
        let result_table = fields.table("result")?;
        fields.finish()?;

        let path = self.folder.join(table_field.value);
        let table = DataTable::read(&path).map_err(|error| {
            if error.mistake == Mistake::MissingFile {
                error.help(format_args!(
                    "{}, line {}, names it in table",
                    fields.file_name(),
                    table_field.line
                ))
            } else {
                error
            }
        })?;
        let values = table.column(&value_column)?;
        let sigma = sigma_column.as_deref().map(|column| table.column(column)).transpose()?;
        if let (Some(column), Some(sigma)) = (&sigma_column, &sigma)
            && let Some(row) = sigma.iter().position(|sigma| *sigma <= 0.0)
        {
            return Err(InputError::new(&table.name, Mistake::OutOfRange)
                .at_line(table.line_of(row))
                .in_column(column)
                .found(sigma[row])
                .expected("a standard deviation > 0"));
        }
        let control = match &control_column {
            Some(column) => {
                let control = table.column(column)?;
                if let Some(row) = (1..control.len()).find(|&row| control[row] < control[row - 1]) {
                    return Err(InputError::new(&table.name, Mistake::Unsorted)
                        .at_line(table.line_of(row))
                        .in_column(column)
                        .found(format_args!("{} after {}", control[row], control[row - 1]))
                        .expected("values that do not go back")
                        .help("sort the rows; a loading that turns back is two observables, or one over time"));
                }
                control
            }
            None => (0..values.len()).map(|row| row as f64).collect(),
        };
        if window.is_some() && control_column.is_none() {
            return Err(fields
                .table_error(Mistake::Conflict)
                .found("a window without a control column")
                .help("name the column with control = \"...\", or leave window out"));
        }
        let keep: Vec<usize> = (0..values.len())
            .filter(|&row| {
                window.is_none_or(|[from, to]| from <= control[row] && control[row] <= to)
            })
            .collect();
        if keep.is_empty() {
            return Err(fields
                .table_error(Mistake::EmptyWindow)
                .found(format_args!("no row of {} in the window", table.name))
                .expected(format_args!(
                    "a window that overlaps {} to {}",
                    control[0],
                    control[control.len() - 1]
                )));
        }
        let kept = |column: &[f64]| keep.iter().map(|&row| column[row]).collect::<Vec<_>>();
        let noise = match &noise_table {
            Some(table) => read_noise(table)?,
            None => {
                return Err(fields
                    .missing("noise")
                    .expected("how the measurements scatter")
                    .help("noise = { kind = \"inferred\", nu0 = 4, s0 = ABOUT }, ABOUT in the unit of the values")
                    .help("or noise = { kind = \"fixed\", sigma = KNOWN }, or { kind = \"fixed-table\" } with a sigma column"));
            }
        };
        if matches!(noise, Noise::Fixed { sigma: FixedSigma::PerPoint }) && sigma.is_none() {
            return Err(fields
                .missing("sigma")
                .expected("the column of the standard deviations, which noise fixed-table uses"));
        }
        let Some(result_table) = result_table else {
            return Err(fields
                .missing("result")
                .expected("where a run leaves the simulated values")
                .help("result = { file = \"out.csv\", format = \"csv\", control = \"t\", value = \"f\" }"));
        };
        let result = read_result(&result_table, control_column.is_some())?;
        let observable = ObservablePlan {
            name: name.to_owned(),
            table: table_field.value.to_owned(),
            control_column,
            value_column,
            unit,
            control_unit,
            window,
            control: kept(&control),
            values: kept(&values),
            sigma: sigma.as_deref().map(kept),
            noise,
            result: Some(result),
        };
        checked(&observable)?;
        Ok(observable)
    }

    fn sampler(
        &self,
        fields: Option<&Fields<'_>>,
        commands: bool,
        names: &[String],
        parameters: &[Parameter],
    ) -> Result<(Settings, Option<Design>), InputError> {
        // A run is never made that the plan has not asked for: these settings search for no MAP.
        let default_samples = if commands { COMMAND_SAMPLES } else { BUILTIN_SAMPLES };
        let Some(fields) = fields else {
            return Ok((Settings::for_budget(default_samples), None));
        };
        let samples = fields.whole("samples", 16, 1 << 27)?;
        let mut settings =
            Settings::for_budget(samples.as_ref().map_or(default_samples, |at| at.value as usize));
        if let Some(at) = fields.whole("batch", 1, 10_000)? {
            settings.batch = at.value as usize;
        }
        if let Some(at) = fields.whole("iterations", 1, 1000)? {
            settings.iterations = at.value as usize;
        }
        if let Some(at) = fields.whole("seed", 0, u64::MAX)? {
            settings.seed = at.value;
        }
        if let Some(at) = fields.positive("ess", "1")? {
            settings.ess_target = Some(at.value);
        }
        if let Some(At { value, line }) = fields.number("max_failed_share")? {
            if !(0.0..=1.0).contains(&value) {
                return Err(fields
                    .error("max_failed_share", line, Mistake::OutOfRange)
                    .found(value)
                    .expected("a share from 0 to 1"));
            }
            settings.max_failed_share = value;
        }
        let design_field = fields.text("design")?;
        fields.finish()?;
        let Some(design_field) = design_field else { return Ok((settings, None)) };
        if let Some(at) = samples {
            return Err(fields
                .error("samples", at.line, Mistake::Conflict)
                .found("samples beside a design, which says how many there are")
                .help("leave samples out"));
        }
        let table = SampleTable::read(&self.folder.join(design_field.value)).map_err(|error| {
            if error.mistake == Mistake::MissingFile {
                error.help(format_args!(
                    "{}, line {}, names it in design",
                    fields.file_name(),
                    design_field.line
                ))
            } else {
                error
            }
        })?;
        let sets = table.in_order(names)?;
        if sets.len() < 2 {
            return Err(InputError::new(&table.name, Mistake::Empty)
                .found("one parameter set")
                .expected("at least two, or there is nothing to weight"));
        }
        for (row, set) in sets.iter().enumerate() {
            for (value, parameter) in set.iter().zip(parameters) {
                let (lower, upper) = parameter.prior.support();
                if !(lower..=upper).contains(value) {
                    return Err(InputError::new(&table.name, Mistake::OutOfRange)
                        .at_line(table.line_of(row))
                        .in_column(&parameter.name)
                        .found(value)
                        .expected(format_args!("a value the prior allows, {lower} to {upper}"))
                        .help("widen the prior, or leave the row out"));
                }
            }
        }
        settings.samples = sets.len();
        Ok((settings, Some(Design { file: design_field.value.to_owned(), sets })))
    }
}

/// A word that a parameter, experiment or observable can be called: it appears in file names and placeholders.
fn check_word(fields: &Fields<'_>, at: At<&str>, what: &str) -> Result<(), InputError> {
    let begins = at.value.starts_with(|c: char| c.is_ascii_alphabetic());
    let rest = at.value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if begins && rest && at.value.len() <= 64 {
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
    let prior: Prior = prior_file::any_prior(fields)?;
    Ok(Parameter::new(at.value, unit, prior))
}

fn window_of(fields: &Fields<'_>) -> Result<Option<[f64; 2]>, InputError> {
    match fields.pair("window")? {
        Some(At { value: [from, to], line }) if from > to => Err(fields
            .error("window", line, Mistake::Bounds)
            .found(format_args!("[{from}, {to}]"))
            .expected("[from, to] with from <= to")),
        window => Ok(window.map(|at| at.value)),
    }
}

fn read_noise(fields: &Fields<'_>) -> Result<Noise, InputError> {
    #[derive(Clone, Copy)]
    enum Kind {
        Inferred,
        Fixed,
        Relative,
        Table,
    }
    let kind = fields
        .choice(
            "kind",
            &[
                ("inferred", Kind::Inferred),
                ("fixed", Kind::Fixed),
                ("fixed-relative", Kind::Relative),
                ("fixed-table", Kind::Table),
            ],
        )?
        .ok_or_else(|| {
            fields.missing("kind").expected("one of inferred, fixed, fixed-relative, fixed-table")
        })?
        .value;
    let needed = |key: &'static str, what: &str| {
        fields
            .positive(key, what)?
            .map(|at| at.value)
            .ok_or_else(|| fields.missing(key).expected(format_args!("a number > 0 [{what}]")))
    };
    let noise = match kind {
        Kind::Inferred => Noise::Inferred {
            nu0: fields.positive("nu0", "1")?.map_or(4.0, |at| at.value),
            s0: needed("s0", "unit of the values")?,
        },
        Kind::Fixed => {
            Noise::Fixed { sigma: FixedSigma::Absolute(needed("sigma", "unit of the values")?) }
        }
        Kind::Relative => Noise::Fixed { sigma: FixedSigma::Relative(needed("share", "1")?) },
        Kind::Table => Noise::Fixed { sigma: FixedSigma::PerPoint },
    };
    fields.finish()?;
    Ok(noise)
}

fn read_result(fields: &Fields<'_>, has_control: bool) -> Result<ResultPlan, InputError> {
    let file = fields
        .text("file")?
        .ok_or_else(|| fields.missing("file").expected("a file in the folder of the run"))?;
    let relative = Path::new(file.value);
    if relative.is_absolute()
        || relative.components().any(|part| part == std::path::Component::ParentDir)
    {
        return Err(fields
            .error("file", file.line, Mistake::OutOfRange)
            .found(format_args!("\"{}\"", file.value))
            .expected("a file in the folder of the run")
            .help("every run has a folder of its own; let the command write there"));
    }
    let format = fields.choice(
        "format",
        &[
            ("csv", ResultFormat::Csv),
            ("whitespace", ResultFormat::Whitespace),
            ("json", ResultFormat::Json),
        ],
    )?;
    let format = match format {
        Some(at) => at.value,
        None => match relative.extension().and_then(|extension| extension.to_str()) {
            Some("csv") => ResultFormat::Csv,
            Some("json") => ResultFormat::Json,
            Some("txt" | "dat") => ResultFormat::Whitespace,
            _ => {
                return Err(fields.missing("format").expected(
                    "\"csv\", \"whitespace\" or \"json\", which the file's name does not say",
                ));
            }
        },
    };
    let value = fields
        .text("value")?
        .ok_or_else(|| fields.missing("value").expected("the column of the simulated values"))?;
    let control = fields.text("control")?;
    let interpolate = fields.choice(
        "interpolate",
        &[("linear", Interpolate::Linear), ("refuse", Interpolate::Refuse)],
    )?;
    fields.finish()?;
    match (has_control, &control) {
        (true, None) => {
            return Err(fields.missing("control").expected(
                "the result's column of the control variable, as the measurements have one",
            ));
        }
        (false, Some(at)) => {
            return Err(fields
                .error("control", at.line, Mistake::Conflict)
                .found("a control column of the result, but none of the measurements")
                .help("name the measurements' column with control beside table"));
        }
        _ => {}
    }
    if let (false, Some(At { value: Interpolate::Linear, line })) = (has_control, interpolate) {
        return Err(fields
            .error("interpolate", line, Mistake::Conflict)
            .found("interpolation without a control variable"));
    }
    Ok(ResultPlan {
        file: file.value.to_owned(),
        format,
        control: control.map(|at| at.value.to_owned()),
        value: value.value.to_owned(),
        interpolate: interpolate
            .map_or(if has_control { Interpolate::Linear } else { Interpolate::Refuse }, |at| {
                at.value
            }),
    })
}

fn executor(fields: Option<&Fields<'_>>, commands: bool) -> Result<ExecutorPlan, InputError> {
    let Some(fields) = fields else {
        return Ok(if commands {
            ExecutorPlan::Local { parallel: None }
        } else {
            ExecutorPlan::Threads { threads: None }
        });
    };
    #[derive(Clone, Copy, PartialEq)]
    enum Kind {
        Threads,
        Local,
        Slurm,
    }
    let kind = fields
        .choice(
            "kind",
            &[("threads", Kind::Threads), ("local", Kind::Local), ("slurm", Kind::Slurm)],
        )?
        .ok_or_else(|| fields.missing("kind").expected("\"threads\", \"local\" or \"slurm\""))?;
    if commands == (kind.value == Kind::Threads) {
        return Err(fields
            .error("kind", kind.line, Mistake::Conflict)
            .found(if commands {
                "threads, which run built-in simulators alone"
            } else {
                "an executor of commands, and the plan has none"
            })
            .expected(if commands { "\"local\" or \"slurm\"" } else { "\"threads\"" })
            .help("leave [executor] out for the default"));
    }
    let few = |key, most| Ok::<_, InputError>(fields.whole(key, 1, most)?.map(|at| at.value));
    let read = match kind.value {
        Kind::Threads => {
            ExecutorPlan::Threads { threads: few("threads", 1024)?.map(|threads| threads as usize) }
        }
        Kind::Local => ExecutorPlan::Local {
            parallel: few("parallel", 1 << 16)?.map(|parallel| parallel as usize),
        },
        Kind::Slurm => {
            let owned = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
            let list =
                |key| {
                    Ok::<_, InputError>(fields.texts(key)?.map_or_else(Vec::new, |at| {
                        at.value.into_iter().map(str::to_owned).collect()
                    }))
                };
            let seconds = |key| Ok::<_, InputError>(fields.positive(key, "s")?.map(|at| at.value));
            let u32_of = |key, most: u32| {
                Ok::<_, InputError>(few(key, u64::from(most))?.map(|value| value as u32))
            };
            let extra = list("extra")?;
            if let Some(option) = extra.iter().find(|option| !option.starts_with("--"))
                && let Some(At { line, .. }) = fields.texts("extra")?
            {
                return Err(fields
                    .error("extra", line, Mistake::OutOfRange)
                    .found(format_args!("\"{option}\""))
                    .expected(
                        "options of sbatch in their long form, one per entry: \"--qos=low\"",
                    ));
            }
            ExecutorPlan::Slurm(SlurmPlan {
                partition: owned("partition")?,
                account: owned("account")?,
                time_min: u32_of("time_min", 525_600)?,
                memory_mb: few("memory_mb", 1 << 30)?,
                cpus: u32_of("cpus", 1 << 16)?,
                extra,
                setup: list("setup")?,
                max_parallel: u32_of("max_parallel", 1 << 20)?,
                chunk: u32_of("chunk", 1 << 20)?,
                poll_min_s: seconds("poll_min_s")?,
                poll_max_s: seconds("poll_max_s")?,
                grace_s: seconds("grace_s")?,
                command_timeout_s: seconds("command_timeout_s")?,
            })
        }
    };
    fields.finish()?;
    Ok(read)
}

fn template_error(
    base: InputError,
    template: &str,
    error: &TemplateError,
    parameters: &[String],
) -> InputError {
    match error {
        TemplateError::Unbalanced => base
            .found(format_args!("\"{template}\""))
            .expected("braces in pairs, around the name of a placeholder")
            .help("a brace that is none is written twice: {{ and }}"),
        TemplateError::Unknown(name) => {
            let known = parameters.iter().map(String::as_str).chain(template::RESERVED);
            base.found(format_args!("the placeholder {{{name}}}"))
                .expected(format_args!(
                    "one of {}, {}",
                    parameters.join(", "),
                    template::RESERVED.join(", ")
                ))
                .help_if(nearest(name, known).map(|near| format!("did you mean {{{near}}}?")))
                .help("a brace that is none is written twice: {{ and }}")
        }
    }
}

/// The observations as the sampler takes them; a plan's numbers were checked by then, all but the noise.
fn checked(observable: &ObservablePlan) -> Result<(), InputError> {
    let refused = |error: &dyn std::fmt::Display| {
        InputError::new(&observable.table, Mistake::OutOfRange).found(error)
    };
    let observations = observations(observable).map_err(|error| refused(&error))?;
    smc_calib::Likelihood::new(&observable.noise, &observations)
        .map(drop)
        .map_err(|error| refused(&error))
}

/// The observations of one observable, as the sampler takes them.
///
/// # Errors
///
/// As the sampler says, for a file that was edited.
pub fn observations(
    observable: &ObservablePlan,
) -> Result<Observations, smc_calib::ObservationError> {
    let observations = Observations::new(observable.control.clone(), observable.values.clone())?;
    match &observable.sigma {
        Some(sigma) => observations.with_sigma(sigma.clone()),
        None => Ok(observations),
    }
}

/// Where radii differ, the plan must say which one tau_s belongs to.
fn check_radii(
    file: &str,
    radii: &[(String, f64, bool, Option<usize>)],
    experiments: &[ExperimentPlan],
) -> Result<(), InputError> {
    let tau_of = |name: &str| {
        experiments.iter().find(|experiment| experiment.name == name).and_then(|experiment| {
            match &experiment.simulator {
                SimulatorPlan::Builtin(builtin) => {
                    Some(builtin.parameters.get("tau_s").map_or("tau_s", String::as_str))
                }
                SimulatorPlan::Command(_) => None,
            }
        })
    };
    for (place, (name, radius, stated, line)) in radii.iter().enumerate() {
        let other = radii.iter().enumerate().find(|(at, (other, r, ..))| {
            *at != place && r != radius && tau_of(other) == tau_of(name)
        });
        if let (false, Some((_, (other, r, ..)))) = (stated, other) {
            let mut error = InputError::new(file, Mistake::MissingField)
                .in_field(format_args!("experiments.{name}.simulator.tau_s_radius_m"))
                .found(format_args!(
                    "missing, and {name} has R = {radius} m where {other} has {r} m"
                ))
                .expected("the radius that the shared tau_s belongs to [m]")
                .help("tau_s grows with the radius: this pair then sinters with tau_s R / tau_s_radius_m")
                .help("or give each experiment a tau_s of its own: parameters = { tau_s = \"...\" }");
            error.line = *line;
            return Err(error);
        }
    }
    Ok(())
}

/// A parameter that no experiment can see is most likely misspelt. A command sees all in its parameter file.
fn check_all_used(
    tables: &[(At<&str>, Fields<'_>)],
    experiments: &[ExperimentPlan],
) -> Result<(), InputError> {
    for (at, table) in tables {
        let used = experiments.iter().any(|experiment| match &experiment.simulator {
            SimulatorPlan::Command(_) => true,
            SimulatorPlan::Builtin(builtin) => {
                builtin.parameters.values().any(|name| name == at.value)
                    || (ParameterName::from_name(at.value).is_some()
                        && !builtin.parameters.contains_key(at.value))
            }
        });
        if !used {
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

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = r#"
[parameters.k]
unit = "N/m"
distribution = "log-uniform"
lower = 1
upper = 10

[experiments.pull.simulator]
kind = "command"
argv = ["sh", "-c", "echo {k} {{}} > out.txt"]

[experiments.pull.observables.force]
table = "force.txt"
control = "u"
value = "f"
noise = { kind = "inferred", s0 = 0.1 }
result = { file = "out.csv", control = "x", value = "y" }

[sampler]
samples = 40
"#;
    const TABLE: &str = "# u f s\n0 0 0.1\n1 2 0.1\n2 4 0.2\n";

    struct Place {
        folder: tempfile::TempDir,
    }

    impl Place {
        fn new() -> Self {
            let folder = tempfile::tempdir().expect("a temporary folder");
            std::fs::write(folder.path().join("force.txt"), TABLE).expect("written");
            Self { folder }
        }

        fn read(&self, text: &str) -> Result<PlanFile, InputError> {
            PlanFile::parse(&self.folder.path().join("my.toml"), text.to_owned())
        }
    }

    #[test]
    fn a_plan_is_read_with_its_defaults() {
        let file = Place::new().read(PLAN).expect("a plan");
        let plan = &file.plan;
        assert_eq!((plan.name.as_str(), plan.title.as_str()), ("my", "my"));
        assert_eq!(plan.parameter_names(), ["k"]);
        assert_eq!((plan.sampler.samples, plan.sampler.map_simulations), (40, 0));
        let observable = &plan.experiments[0].observables[0];
        assert_eq!(observable.control, [0.0, 1.0, 2.0]);
        assert_eq!(observable.values, [0.0, 2.0, 4.0]);
        assert_eq!(observable.noise, Noise::Inferred { nu0: 4.0, s0: 0.1 });
        let result = observable.result.as_ref().expect("a result");
        assert_eq!((result.format, result.interpolate), (ResultFormat::Csv, Interpolate::Linear));
        let SimulatorPlan::Command(command) = &plan.experiments[0].simulator else {
            panic!("a command");
        };
        assert_eq!((command.timeout_s, command.retries, command.keep), (3600.0, 2, Keep::Failed));
        assert_eq!(file.executor, ExecutorPlan::Local { parallel: None });
        let text = serde_json::to_string(plan).expect("JSON");
        assert_eq!(serde_json::from_str::<ExternalPlan>(&text).expect("back"), *plan);
    }

    #[test]
    fn the_same_plan_in_json_is_the_same_plan() {
        let place = Place::new();
        let value: toml::Value = toml::from_str(PLAN).expect("TOML");
        let json = serde_json::to_string_pretty(&value).expect("JSON");
        let path = place.folder.path().join("my.json");
        let from_json = PlanFile::parse(&path, json).expect("a plan");
        assert_eq!(from_json.plan, place.read(PLAN).expect("a plan").plan);
        let broken = "{\n \"parameters\": {\n  \"k\": { \"unit\": 3 }\n } }";
        let error = PlanFile::parse(&path, broken.to_owned()).expect_err("wrong type");
        assert_eq!((error.mistake, error.line), (Mistake::WrongType, Some(3)), "{error}");
        for (text, mistake) in [
            ("", Mistake::Syntax),
            ("{", Mistake::Syntax),
            ("[1]", Mistake::WrongType),
            ("{\"name\": null}", Mistake::WrongType),
            ("{\"name\": \"a\", \"name\": \"b\"}", Mistake::Duplicate),
            ("{\"name\": \"a\",}", Mistake::Syntax),
            ("{} x", Mistake::Syntax),
        ] {
            let error = PlanFile::parse(&path, text.to_owned()).expect_err(text);
            assert_eq!(error.mistake, mistake, "{text}: {error}");
        }
    }

    #[test]
    fn each_mistake_names_its_line_and_field() {
        let place = Place::new();
        for (old, new, says) in [
            ("unit = ", "units = ", "parameters.k.unit?"),
            ("lower = 1\n", "lower = 11\n", "parameters.k.lower"),
            ("lower = 1\n", "", "field parameters.k.lower"),
            ("[parameters.k]", "[parameters.run]", "placeholder"),
            ("[parameters.k]", "[parameters.\"k m\"]", "a letter"),
            ("kind = \"command\"", "kind = \"comand\"", "did you mean \"command\"?"),
            ("kind = \"command\"\n", "", "experiments.pull.simulator.kind"),
            ("{k}", "{kk}", "did you mean {k}?"),
            ("{{}}", "{}", "one of k, parameters"),
            ("{{}}", "}", "written twice"),
            ("\"sh\", ", "\"no-such-program-anywhere\", ", "not on the path"),
            ("\"sh\", ", "\"./nothing.sh\", ", "nothing.sh"),
            ("\"sh\", ", "\"{plan_dir}/nothing.sh\", ", "a file that is there"),
            ("argv = [\"sh\"", "argv = [3", "text in quotes"),
            ("argv = ", "timeout_s = -1\nargv = ", "timeout_s"),
            ("argv = ", "retries = 1.5\nargv = ", "whole number"),
            ("argv = ", "keep = \"al\"\nargv = ", "did you mean \"all\"?"),
            ("table = \"force.txt\"", "table = \"forse.txt\"", "force.txt?"),
            ("value = \"f\"", "value = \"g\"", "column g"),
            ("control = \"u\"", "control = \"v\"", "column v"),
            ("noise = { kind = \"inferred\", s0 = 0.1 }\n", "", "how the measurements scatter"),
            ("s0 = 0.1", "s0 = 0", "noise.s0"),
            ("{ kind = \"inferred\", s0 = 0.1 }", "{ kind = \"inferred\" }", "noise.s0"),
            (
                "{ kind = \"inferred\", s0 = 0.1 }",
                "{ kind = \"fixed-table\" }",
                "standard deviations",
            ),
            (
                "{ kind = \"inferred\", s0 = 0.1 }",
                "{ kind = \"fixed-relative\", share = 0.1 }",
                "zero",
            ),
            ("out.csv", "../out.csv", "folder of the run"),
            ("out.csv", "out", "does not say"),
            ("control = \"x\", ", "", "result.control"),
            ("value = \"y\" }", "value = \"y\", interpolate = \"cubic\" }", "linear, refuse"),
            ("samples = 40", "samples = 4", "from 16 to"),
            ("samples = 40", "sample = 40", "sampler.samples?"),
            ("samples = 40", "design = \"no.txt\"", "no.txt"),
            ("[sampler]", "[executor]\nkind = \"threads\"\n[sampler]", "built-in simulators alone"),
            (
                "[sampler]",
                "[executor]\nkind = \"slurm\"\nextra = [\"-q low\"]\n[sampler]",
                "long form",
            ),
            ("[sampler]", "[samples]\n", "sampler?"),
        ] {
            assert!(PLAN.contains(old), "{old}");
            let error = place.read(&PLAN.replacen(old, new, 1)).expect_err(new);
            assert!(error.to_string().contains(says), "{new}:\n{error}");
            let of_the_plan = error.source_name.ends_with("my.toml");
            assert!(!of_the_plan || error.line.is_some() || says == "sampler?", "{error}");
        }
    }

    #[test]
    fn parts_that_are_missing_are_named() {
        let place = Place::new();
        for (text, says) in [
            ("", "field parameters"),
            ("[parameters]\n[experiments]\n", "at least one [parameters.NAME]"),
            ("parameters = 3\n", "a table [parameters]"),
            (&PLAN[..PLAN.find("[experiments.pull.simulator]").expect("there")], "experiments"),
            (
                &PLAN[..PLAN.find("[experiments.pull.observables").expect("there")],
                "experiments.pull.observables",
            ),
        ] {
            let error = place.read(text).expect_err(text);
            assert!(error.to_string().contains(says), "{text}:\n{error}");
        }
    }

    const PAIRS: &str = r#"
[parameters.c1]
distribution = "log-uniform"
lower = 1e-8
upper = 1e-2
[parameters.tau_s]
unit = "s"
distribution = "log-uniform"
lower = 0.5
upper = 50
[parameters.delta_c]
distribution = "log-uniform"
lower = 1e-8
upper = 3e-6
[experiments.r32.simulator]
kind = "builtin"
experiment = "pa12-r32"
tau_s_radius_m = 31.5e-6
[experiments.r30.simulator]
kind = "builtin"
experiment = "pa12-r30"
tau_s_radius_m = 31.5e-6
[experiments.r30.observables.contact_ratio]
window = [0.0, 10.0]
noise = { kind = "fixed", sigma = 0.05 }
"#;

    #[test]
    fn pairs_of_two_radii_share_parameters_and_must_say_whose_tau_s_it_is() {
        let place = Place::new();
        let plan = place.read(PAIRS).expect("a plan").plan;
        assert_eq!(plan.experiments.len(), 2);
        assert_eq!(plan.experiments[0].observables[0].values.len(), 30);
        assert!(plan.experiments[1].observables[0].values.len() < 30);
        let error = place
            .read(&PAIRS.replacen("tau_s_radius_m = 31.5e-6\n", "", 1))
            .expect_err("whose tau_s?");
        assert!(error.to_string().contains("tau_s_radius_m"), "{error}");
        let own = PAIRS.replace("tau_s_radius_m = 31.5e-6\n", "").replace(
            "experiment = \"pa12-r30\"\n",
            "experiment = \"pa12-r30\"\nparameters = { tau_s = \"tau_30\" }\n",
        );
        let error = place.read(&own).expect_err("no such parameter");
        assert!(error.to_string().contains("tau_30"), "{error}");
        let own = own.replacen(
            "[parameters.delta_c]",
            "[parameters.tau_30]\ndistribution = \"uniform\"\nlower = 1\nupper = 9\n[parameters.delta_c]",
            1,
        );
        place.read(&own).expect("a tau_s of its own");
        for (old, new, says) in [
            ("lower = 0.5\n", "lower = -0.5\n", "parameters.tau_s.lower"),
            ("[parameters.delta_c]", "[parameters.delta_d]", "delta_c"),
            ("\"pa12-r30\"", "\"pa12-r31\"", "pa12-r31"),
            ("observables.contact_ratio", "observables.force", "contact_ratio"),
            ("window = [0.0, 10.0]", "window = [100.0, 101.0]", "window"),
            ("tau_s_radius_m", "tau_radius_m", "tau_s_radius_m?"),
        ] {
            let error = place.read(&PAIRS.replacen(old, new, 1)).expect_err(new);
            assert!(error.to_string().contains(says), "{new}:\n{error}");
        }
    }

    #[test]
    fn a_design_gives_the_parameter_sets_and_must_lie_in_the_prior() {
        let place = Place::new();
        let design = place.folder.path().join("sets.txt");
        std::fs::write(&design, "!OMP_NUM_THREADS description key k\n1 a 0 2\n1 b 1 3\n")
            .expect("written");
        let text = PLAN.replace("samples = 40", "design = \"sets.txt\"");
        let plan = place.read(&text).expect("a plan").plan;
        assert_eq!(plan.design.as_ref().expect("a design").sets, [[2.0], [3.0]]);
        assert_eq!(plan.budget(), 2);
        let error = place.read(&text.replace("design", "samples = 99\ndesign")).expect_err("both");
        assert_eq!(error.mistake, Mistake::Conflict);
        std::fs::write(&design, "description k\na 2\nb 30\n").expect("written");
        let error = place.read(&text).expect_err("out of the prior");
        assert_eq!((error.mistake, error.line), (Mistake::OutOfRange, Some(3)));
    }
}
