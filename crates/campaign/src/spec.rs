//! Specification of the runs: commands, their parameters, and the place of their results.

use std::collections::BTreeMap;
use std::path::{Component, Path};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::folder::ANSWER;
use crate::inputs::{self, InputFile};
use crate::table::Format;
use crate::template;

/// Everything that a campaign runs. It is stored in the campaign's directory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignSpec {
    /// Names of the parameters, in the order in which tasks give their values.
    pub parameter_names: Vec<String>,
    /// One command per experiment; a task names its command by the place in this list.
    pub commands: Vec<CommandSpec>,
    /// Seed of the campaign, from which the seed of each run (`{seed}`) follows.
    #[serde(default)]
    pub seed: u64,
}

#[cfg(test)]
impl CampaignSpec {
    /// One parameter, and the square of it computed in the process.
    pub(crate) fn of_squares() -> Self {
        Self {
            parameter_names: vec!["x".into()],
            commands: vec![CommandSpec::in_process("square")],
            seed: 1,
        }
    }
}

/// One simulator: how it is called, and where its results are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CommandSpec {
    /// Name of the experiment that it simulates.
    pub name: String,
    /// Call of the program.
    pub call: Call,
    /// Places of the results, one entry per observable.
    pub outputs: Vec<OutputSpec>,
}

/// Call of a program for each run, in a working directory of its own.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Call {
    /// Program and arguments; empty for a simulator in this process ([`InProcess`](crate::InProcess)).
    ///
    /// The program is found by `PATH`, or given by its absolute path. Placeholders: `{NAME}` for the value of a
    /// parameter, `{parameters}` for the path of the JSON file with all of them, `{run}` for the number of the run,
    /// `{seed}` for its seed (1 to 900 000 000), `{{` and `}}` for braces.
    pub argv: Vec<String>,
    /// Whether the program stays and is asked for one run after the other, by lines of JSON on its stdin and stdout
    /// (docs/worker-protocol.md); it has no placeholders then, and no result but its answer and what it writes to the
    /// folder of the run.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub worker: bool,
    /// Files that are put into the working directory before the call.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<InputFile>,
    /// Environment variables set in addition to the driver's, with placeholders as in `argv`.
    pub environment: BTreeMap<String, String>,
    /// Time limit of one attempt \[s\], after which its whole process group is ended.
    pub timeout_s: f64,
    /// Number of times that a lost run (killed from outside, or by an error of the disk) is tried again. A failed run is
    /// not.
    pub retries: u32,
    /// Exit codes by which the program asks to be called again later.
    #[serde(default)]
    pub try_later: TryLater,
    /// What follows where a run is lost more often than it is tried again.
    #[serde(default)]
    pub lost: LostRuns,
    /// Working directories that stay after their runs.
    pub keep: Keep,
}

/// Exit codes that say "not now": no licence, no server. They say nothing about the parameters.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TryLater {
    /// The codes, 1 to 255.
    pub exit_codes: Vec<i32>,
    /// Pause before the first further attempt \[s\]; each pause is twice the one before, up to a minute.
    pub pause_s: f64,
    /// Number of further attempts at a run, after which the driver stops, to be resumed.
    pub retries: u32,
}

impl Default for TryLater {
    /// EX_TEMPFAIL of sysexits.h, for seven minutes.
    fn default() -> Self {
        Self { exit_codes: vec![75], pause_s: 1.0, retries: 12 }
    }
}

impl TryLater {
    /// Pause before the further attempt `k`, from 0.
    ///
    /// # Formula
    ///
    /// min(`pause_s` 2^k, max(60 s, `pause_s`))
    pub(crate) fn pause(&self, k: u32) -> Duration {
        let longest = self.pause_s.max(60.0);
        Duration::try_from_secs_f64((self.pause_s * 2.0_f64.powi(k.min(64) as i32)).min(longest))
            .unwrap_or(Duration::from_secs(60))
    }

    /// Checks the numbers; the field of an error is `exit_codes` or `pause_s`.
    ///
    /// # Errors
    ///
    /// [`SpecError`] with the first mistake.
    pub fn check(&self) -> Result<(), SpecError> {
        if let Some(code) = self.exit_codes.iter().find(|code| !(1..=255).contains(*code)) {
            let problem = format!("{code} is not an exit code of a failure; give 1 to 255");
            return wrong("exit_codes".into(), problem);
        }
        if !(0.0..=86_400.0).contains(&self.pause_s) {
            let problem = format!("{} is not a pause; give seconds, 0 to 86400", self.pause_s);
            return wrong("pause_s".into(), problem);
        }
        Ok(())
    }
}

/// What follows where a run is lost more often than it is tried again.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LostRuns {
    /// The run has no outcome: the driver makes the others and stops, to be resumed.
    #[default]
    Stop,
    /// It counts as failed: right where parameters decide on it, as by the memory that they need.
    Fail,
}

/// Place of one observable after a run, and the points at which it is compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSpec {
    /// Place of the values.
    pub result: ResultSpec,
    /// The observation points: values of the control, in the unit of its column.
    pub at: Vec<f64>,
}

/// Where a run leaves the values of one observable.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultSpec {
    /// File, relative to the working directory of the run.
    pub file: String,
    /// Format of the file.
    pub format: Format,
    /// Column of the control variable (time, strain, ...); without one the rows are the observation points, in order.
    pub control: Option<String>,
    /// Column of the values.
    pub value: String,
    /// Whether values between two rows are interpolated.
    pub interpolate: Interpolation,
}

/// Whether values between two rows of a result may be interpolated.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// Linearly between the two rows around the observation point.
    Linear,
    /// Never: the table must have a row at each observation point, in their order.
    #[default]
    Refuse,
}

/// Working directories that stay after their runs.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Keep {
    /// Directories of failed runs.
    #[default]
    Failed,
    /// All.
    All,
    /// None.
    None,
}

/// A specification that cannot be run.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{field}: {problem}")]
pub struct SpecError {
    /// The field, as in `commands[0].outputs[1].result.file`.
    pub field: String,
    /// The problem, with the value and the remedy.
    pub problem: String,
}

impl Call {
    /// A call of a program with the limits that hold where none are given: an hour, two further attempts at a lost run,
    /// folders of failed runs stay.
    #[must_use]
    pub fn new(argv: Vec<String>) -> Self {
        Self {
            argv,
            worker: false,
            files: Vec::new(),
            environment: BTreeMap::new(),
            timeout_s: 3600.0,
            retries: 2,
            try_later: TryLater::default(),
            lost: LostRuns::default(),
            keep: Keep::default(),
        }
    }

    /// Takes everything over that decides only on whether a run gets made, and not on its values: limits, retries,
    /// folders that stay.
    pub fn set_limits(&mut self, of: &Self) {
        let Self {
            argv: _,
            worker: _,
            files: _,
            environment: _,
            timeout_s,
            retries,
            try_later,
            lost,
            keep,
        } = of;
        (self.timeout_s, self.retries, self.lost, self.keep) = (*timeout_s, *retries, *lost, *keep);
        self.try_later.clone_from(try_later);
    }
}

impl CommandSpec {
    /// A simulator in this process ([`InProcess`](crate::InProcess)) that gives any number of values.
    #[must_use]
    pub fn in_process(name: &str) -> Self {
        let call = Call { timeout_s: 1.0, retries: 0, keep: Keep::None, ..Call::new(Vec::new()) };
        Self { name: name.to_owned(), call, outputs: Vec::new() }
    }

    /// Checks that the input files have places of their own in the folder of a run.
    ///
    /// # Errors
    ///
    /// [`SpecError`] with the first that has none; its field is `files[0]`.
    pub fn check_files(&self) -> Result<(), SpecError> {
        let results = self.outputs.iter().map(|output| output.result.file.as_str());
        let results = results.chain(self.call.worker.then_some(ANSWER));
        inputs::check(&self.call.files, results)
            .map_err(|(i, problem)| SpecError { field: format!("files[{i}]"), problem })
    }

    /// Number of values that one run gives: the observation points of all observables.
    #[must_use]
    pub fn values(&self) -> usize {
        self.outputs.iter().map(|output| output.at.len()).sum()
    }
}

impl CampaignSpec {
    /// Checks what can be checked before anything runs.
    ///
    /// # Errors
    ///
    /// [`SpecError`] with the first mistake.
    pub fn check(&self) -> Result<(), SpecError> {
        let mut seen = Vec::new();
        for (i, name) in self.parameter_names.iter().enumerate() {
            let field = || format!("parameter_names[{i}]");
            if name.is_empty() || name.contains(['{', '}']) || name.contains(char::is_control) {
                return wrong(
                    field(),
                    format!("{name:?} cannot be a placeholder; use a plain name"),
                );
            }
            if template::RESERVED.contains(&name.as_str()) {
                return wrong(field(), format!("{name:?} is taken by the placeholder; rename it"));
            }
            if seen.contains(&name) {
                return wrong(field(), format!("{name:?} is there twice"));
            }
            seen.push(name);
        }
        if self.commands.is_empty() {
            return wrong("commands".into(), "there is none".into());
        }
        for (i, command) in self.commands.iter().enumerate() {
            self.check_command(&format!("commands[{i}]"), command)?;
        }
        Ok(())
    }

    fn check_command(&self, place: &str, command: &CommandSpec) -> Result<(), SpecError> {
        let call = &command.call;
        if !(call.timeout_s.is_finite() && call.timeout_s > 0.0) {
            let problem = format!("{} is not a time; give seconds above 0", call.timeout_s);
            return wrong(format!("{place}.call.timeout_s"), problem);
        }
        call.try_later.check().map_err(|error| SpecError {
            field: format!("{place}.call.try_later.{}", error.field),
            ..error
        })?;
        for (i, argument) in call.argv.iter().enumerate() {
            self.check_template(format!("{place}.call.argv[{i}]"), argument, call.worker)?;
        }
        if call.worker && call.argv.is_empty() {
            return wrong(format!("{place}.call.worker"), "it has no program".into());
        }
        if let Some(program) = call.argv.first() {
            let field = || format!("{place}.call.argv[0]");
            if program.is_empty() {
                return wrong(field(), "the program has no name".into());
            }
            if program.contains('/') && !Path::new(program).is_absolute() {
                let problem = format!(
                    "{program:?} is relative, and each run has its own working directory; \
                     give the whole path"
                );
                return wrong(field(), problem);
            }
            if command.outputs.is_empty() {
                return wrong(format!("{place}.outputs"), "there is none".into());
            }
        }
        for (name, value) in &call.environment {
            let field = format!("{place}.call.environment.{name}");
            if name.is_empty() || name.contains(['=', '\0']) {
                return wrong(field, "not the name of an environment variable".into());
            }
            self.check_template(field, value, call.worker)?;
        }
        command.check_files().map_err(|error| SpecError {
            field: format!("{place}.call.{}", error.field),
            ..error
        })?;
        for (i, output) in command.outputs.iter().enumerate() {
            check_output(&format!("{place}.outputs[{i}]"), output)?;
        }
        Ok(())
    }

    fn check_template(&self, field: String, text: &str, worker: bool) -> Result<(), SpecError> {
        if text.contains('\0') {
            return wrong(field, "holds a NUL byte".into());
        }
        if worker && let Some(name) = template::first_name(text) {
            let problem = format!(
                "{{{name}}} is of one run, and a worker makes many; it gets it with every request"
            );
            return wrong(field, problem);
        }
        match template::check(text, &self.parameter_names) {
            Ok(()) => Ok(()),
            Err(problem) => wrong(field, problem),
        }
    }
}

fn check_output(place: &str, output: &OutputSpec) -> Result<(), SpecError> {
    let result = &output.result;
    let path = Path::new(&result.file);
    let inside =
        path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if result.file.is_empty() || !inside {
        let problem = format!(
            "{:?} is not in the working directory of the run; give a relative path without ..",
            result.file
        );
        return wrong(format!("{place}.result.file"), problem);
    }
    if result.value.is_empty() {
        return wrong(format!("{place}.result.value"), "the column has no name".into());
    }
    if output.at.is_empty() {
        return wrong(format!("{place}.at"), "no observation points".into());
    }
    if let Some(at) = output.at.iter().find(|at| !at.is_finite()) {
        return wrong(format!("{place}.at"), format!("{at} is not a finite number"));
    }
    if result.control.is_none() && result.interpolate == Interpolation::Linear {
        let problem = "linear interpolation needs a control column".into();
        return wrong(format!("{place}.result.interpolate"), problem);
    }
    Ok(())
}

fn wrong(field: String, problem: String) -> Result<(), SpecError> {
    Err(SpecError { field, problem })
}
