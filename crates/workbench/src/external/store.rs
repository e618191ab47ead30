//! A plan in the folder of its run: what is kept beside the runs, and how it is found again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use campaign::{
    Campaign, CampaignError, CampaignSpec, CommandSpec, Damage, Format, Interpolation, OutputSpec,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::plan::{
    ExecutorPlan, ExternalPlan, Interpolate, Keep, ObservablePlan, ResultFormat, SimulatorPlan,
};
use super::plan_file::PlanFile;
use super::template;
use crate::error::{Failure, InputError, Mistake, RunError};

/// The file with the plan as it was understood, tables and all.
pub(crate) const RESOLVED: &str = "resolved-plan.json";

/// What is kept of a plan, so that a run needs no other file to go on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    /// The plan file, by its whole path.
    pub(crate) file: PathBuf,
    /// The plan.
    pub(crate) plan: ExternalPlan,
    /// How the runs are executed.
    pub(crate) executor: ExecutorPlan,
    /// Warnings on the input.
    pub(crate) warnings: Vec<String>,
}

impl Stored {
    pub(crate) fn of(file: &PlanFile) -> Result<Self, InputError> {
        let path = std::path::absolute(&file.path).map_err(|error| {
            InputError::new(file.path.display().to_string(), Mistake::Unreadable)
                .found(format_args!("has no whole path: {error}"))
        })?;
        Ok(Self {
            file: path,
            plan: file.plan.clone(),
            executor: file.executor.clone(),
            warnings: file.warnings.clone(),
        })
    }

    /// The files that go beside the runs.
    fn extra(&self, file: &PlanFile) -> Result<BTreeMap<String, Vec<u8>>, Failure> {
        let json = self.file.extension().is_some_and(|end| end.eq_ignore_ascii_case("json"));
        let name = if json { "plan.json" } else { "plan.toml" };
        let resolved = crate::run::pretty(self)?;
        Ok(BTreeMap::from([
            (name.to_owned(), file.text.clone().into_bytes()),
            (RESOLVED.to_owned(), resolved.into_bytes()),
        ]))
    }

    /// What the campaign runs.
    pub(crate) fn spec(&self) -> Result<CampaignSpec, InputError> {
        let folder = self.file.parent().unwrap_or(Path::new("/"));
        let Some(folder_text) = folder.to_str() else {
            return Err(InputError::new(folder.display().to_string(), Mistake::NotUtf8)
                .found("the folder of the plan, whose name is not UTF-8")
                .help("move the plan to another folder"));
        };
        let fill = |text: &String| {
            template::with_folder(text, folder_text).map_err(|_| {
                InputError::new(self.file.display().to_string(), Mistake::Syntax)
                    .found(format_args!("the template \"{text}\""))
            })
        };
        let mut commands = Vec::new();
        for experiment in &self.plan.experiments {
            let SimulatorPlan::Command(command) = &experiment.simulator else { continue };
            let mut argv = command.argv.iter().map(fill).collect::<Result<Vec<_>, _>>()?;
            if let Some(program) = argv.first_mut()
                && program.contains('/')
                && Path::new(&*program).is_relative()
            {
                *program = folder.join(&*program).display().to_string();
            }
            let environment = command
                .environment
                .iter()
                .map(|(name, value)| Ok((name.clone(), fill(value)?)))
                .collect::<Result<BTreeMap<_, _>, InputError>>()?;
            commands.push(CommandSpec {
                name: experiment.name.clone(),
                argv,
                environment,
                timeout_s: command.timeout_s,
                retries: command.retries,
                outputs: experiment.observables.iter().filter_map(output).collect(),
                keep: match command.keep {
                    Keep::Failed => campaign::Keep::Failed,
                    Keep::All => campaign::Keep::All,
                    Keep::None => campaign::Keep::None,
                },
            });
        }
        if commands.is_empty() {
            // Built-in simulators alone: their curves are computed again where they are needed.
            commands.push(CommandSpec {
                name: "builtin".to_owned(),
                argv: Vec::new(),
                environment: BTreeMap::new(),
                timeout_s: 1.0,
                retries: 0,
                outputs: Vec::new(),
                keep: campaign::Keep::None,
            });
        }
        Ok(CampaignSpec {
            parameter_names: self.plan.parameter_names(),
            commands,
            seed: self.plan.sampler.seed,
        })
    }
}

fn output(observable: &ObservablePlan) -> Option<OutputSpec> {
    let result = observable.result.as_ref()?;
    Some(OutputSpec {
        file: result.file.clone(),
        format: match result.format {
            ResultFormat::Csv => Format::Csv,
            ResultFormat::Whitespace => Format::Whitespace,
            ResultFormat::Json => Format::Json,
        },
        value: result.value.clone(),
        control: result.control.clone(),
        at: observable.control.clone(),
        interpolate: match result.interpolate {
            Interpolate::Linear => Interpolation::Linear,
            Interpolate::Refuse => Interpolation::Refuse,
        },
    })
}

/// Makes the folder of a run.
pub(crate) fn create(dir: &Path, file: &PlanFile) -> Result<(Campaign, Stored), Failure> {
    let stored = Stored::of(file)?;
    let campaign = Campaign::create(dir, &stored.spec()?, &stored.extra(file)?)
        .map_err(|error| refused(dir, error))?;
    Ok((campaign, stored))
}

/// Opens the folder of a run. A plan that is given must be the run's own; it mends a damaged copy, and how its runs
/// are executed is taken from it.
pub(crate) fn open(
    dir: &Path,
    given: Option<&PlanFile>,
) -> Result<(Campaign, Stored, Vec<Damage>), Failure> {
    let (campaign, damage) = match given {
        None => Campaign::open(dir),
        Some(file) => {
            let stored = Stored::of(file)?;
            Campaign::restore(dir, &stored.spec()?, &stored.extra(file)?)
        }
    }
    .map_err(|error| refused(dir, error))?;
    let Some(bytes) = campaign.extra(RESOLVED) else {
        report_damage(&damage);
        return Err(InputError::new(dir.join(RESOLVED).display().to_string(), Mistake::Syntax)
            .found("damaged or missing: what was run is not known from it")
            .help(format_args!(
                "give the plan again: calibrate --resume {} --plan FILE; finished runs are kept",
                dir.display()
            ))
            .into());
    };
    let mut stored: Stored = serde_json::from_slice(bytes).map_err(|error| {
        InputError::new(dir.join(RESOLVED).display().to_string(), Mistake::Syntax)
            .found(format_args!("no plan of this version ({error})"))
            .help(format_args!(
                "go on with the version of calibrate that began it, or begin anew with --plan {} --out ANOTHER",
                dir.join("plan.toml").display()
            ))
    })?;
    if let Some(file) = given {
        if let Some((field, was, is)) = difference(&stored.plan, &file.plan) {
            return Err(InputError::new(file.path.display().to_string(), Mistake::Conflict)
                .in_field(field)
                .found(is)
                .expected(format_args!("{was}, as in the run in {}", dir.display()))
                .help("a run goes on with the plan it began with; begin another with --plan and --out")
                .help("only [executor] may be another")
                .into());
        }
        stored.executor.clone_from(&file.executor);
    }
    Ok((campaign, stored, damage))
}

/// Reads the plan of a run without its lock, while it may be running.
pub(crate) fn read(dir: &Path) -> Result<Stored, Failure> {
    let path = dir.join(RESOLVED);
    let text = crate::text_file::read(&path)?;
    serde_json::from_str(&text).map_err(|error| {
        InputError::new(path.display().to_string(), Mistake::Syntax)
            .at_line(error.line().max(1))
            .found(format_args!("no plan of this version ({error})"))
            .help(format_args!("calibrate --resume {} --plan FILE mends it", dir.display()))
            .into()
    })
}

/// Where two plans differ first: the field, and both values. The version of the program is no part of this.
fn difference(was: &ExternalPlan, is: &ExternalPlan) -> Option<(String, String, String)> {
    let was = ExternalPlan { version: is.version.clone(), ..was.clone() };
    let tree = |plan: &ExternalPlan| serde_json::to_value(plan).unwrap_or(Value::Null);
    first_difference("", &tree(&was), &tree(is))
}

fn first_difference(path: &str, was: &Value, is: &Value) -> Option<(String, String, String)> {
    let inner = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (was, is) {
        (Value::Object(a), Value::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            let value =
                |map: &serde_json::Map<_, _>, key| map.get(key).cloned().unwrap_or_default();
            keys.into_iter()
                .find_map(|key| first_difference(&inner(key), &value(a, key), &value(b, key)))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => (0..a.len()).find_map(|k| {
            let name = a[k].get("name").and_then(Value::as_str);
            let key = name.map_or_else(|| k.to_string(), str::to_owned);
            first_difference(&inner(&key), &a[k], &b[k])
        }),
        (Value::Array(a), Value::Array(b)) => {
            Some((path.to_owned(), format!("{} entries", a.len()), format!("{} entries", b.len())))
        }
        (a, b) if a == b => None,
        (a, b) => Some((path.to_owned(), a.to_string(), b.to_string())),
    }
}

/// Says what was damaged. A line that was being written when the driver was killed is no damage.
pub(crate) fn report_damage(damage: &[Damage]) {
    for damage in damage.iter().filter(|damage| !damage.torn) {
        eprintln!("warning: {damage}; what it held is made again, the rest is used");
    }
}

/// A campaign's refusal as the user meets it.
pub(crate) fn refused(dir: &Path, error: CampaignError) -> Failure {
    let name = dir.display().to_string();
    match &error {
        CampaignError::Exists { .. } => {
            let ours = dir.join(RESOLVED).exists() || dir.join("campaign.json").exists();
            let error = InputError::new(&name, Mistake::NotOurs);
            if ours {
                error
                    .found("a folder that holds a run already")
                    .help(format_args!("go on with it: calibrate --resume {name}"))
                    .help("or begin another beside it, with --out")
                    .into()
            } else {
                error
                    .found("a folder that no plan's run wrote")
                    .help("choose another folder with --out, or move this one away")
                    .into()
            }
        }
        CampaignError::NotACampaign { .. } => {
            let found =
                if dir.exists() { "a folder without a run of a plan" } else { "no such folder" };
            InputError::new(&name, Mistake::NotOurs)
                .found(found)
                .expected("the folder of a run that was begun with calibrate --plan")
                .into()
        }
        CampaignError::Spec(spec) => InputError::new(&name, Mistake::OutOfRange).found(spec).into(),
        CampaignError::Damaged { .. } => InputError::new(&name, Mistake::Syntax)
            .found(&error)
            .help(format_args!("calibrate --resume {name} --plan FILE; finished runs are kept"))
            .into(),
        CampaignError::Locked { .. } => RunError::new(&error)
            .help(format_args!("to see how far it is: calibrate status {name}"))
            .into(),
        CampaignError::TaskDiffers { .. } => RunError::new(&error)
            .help(
                "go on with the version of calibrate, and the kind of machine, that began the run",
            )
            .help(format_args!("what finished can be had as tables: calibrate export {name}"))
            .into(),
        CampaignError::DiskFull { .. } => {
            RunError::new(&error).help(format_args!("then: calibrate --resume {name}")).into()
        }
        _ => RunError::new(error).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::external::plan::SlurmPlan;

    #[test]
    fn every_executor_is_stored_and_read_back() {
        let full = SlurmPlan {
            partition: Some("short".to_owned()),
            extra: vec!["--qos=low".to_owned()],
            chunk: Some(3),
            poll_min_s: Some(0.5),
            ..SlurmPlan::default()
        };
        for executor in [
            ExecutorPlan::Threads { threads: None },
            ExecutorPlan::Local { parallel: Some(3) },
            ExecutorPlan::Slurm(SlurmPlan::default()),
            ExecutorPlan::Slurm(full),
        ] {
            let text = serde_json::to_string(&executor).expect("JSON");
            assert_eq!(serde_json::from_str::<ExecutorPlan>(&text).expect(&text), executor);
        }
    }

    #[test]
    fn the_first_difference_is_named_with_its_place() {
        let was =
            serde_json::json!({"a": 1, "list": [{"name": "k", "x": 1.5}, {"name": "c", "x": 2}]});
        let mut is = was.clone();
        assert_eq!(first_difference("", &was, &is), None);
        is["list"][1]["x"] = 3.into();
        let (field, from, to) = first_difference("", &was, &is).expect("differs");
        assert_eq!((field.as_str(), from.as_str(), to.as_str()), ("list.c.x", "2", "3"));
        is["list"] = serde_json::json!([]);
        assert_eq!(first_difference("", &was, &is).expect("shorter").0, "list");
    }
}
