//! A plan beside the runs of its programs: what is kept there, and how it is found again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use campaign::{Call, Campaign, CampaignError, CampaignSpec, Damage, Outcome};
use serde::{Deserialize, Serialize};

use super::fingerprints::{self, Fingerprints};
use super::same_plan::{SAMPLES, difference, with_limits};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::given_up::{self, GivenUp};
use crate::output::inputs::Inputs;
use crate::output::{CAMPAIGN, INPUTS, pretty};
use crate::plan::{ExecutorPlan, ExperimentPlan, PROGRAM, Plan, Planned, with_folder};

/// The file with the plan as it was understood, tables and all.
const RESOLVED: &str = "resolved-plan.json";

/// A plan as it is kept beside its runs, so that they need no other file to go on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Stored {
    /// The plan file, by its whole path.
    pub(crate) file: PathBuf,
    /// The plan.
    pub(crate) plan: Plan,
    /// How the runs are executed.
    pub(crate) executor: ExecutorPlan,
    /// Warnings on the input.
    pub(crate) warnings: Vec<String>,
    /// What was read of its files, and the programs that its runs are made with; none where that was not noted.
    #[serde(default)]
    pub(crate) inputs: Option<Inputs>,
}

impl Stored {
    fn of(planned: &Planned) -> Result<Self, InputError> {
        let path = planned.path.clone().unwrap_or_else(|| PathBuf::from("plan.toml"));
        let file = std::path::absolute(&path).map_err(|error| {
            InputError::new(path.display().to_string(), Mistake::Unreadable)
                .found(format_args!("has no whole path: {error}"))
        })?;
        let mut stored = Self {
            file,
            plan: planned.plan.clone(),
            executor: planned.executor.clone(),
            warnings: planned.warnings.clone(),
            inputs: planned.inputs.clone(),
        };
        let spec = stored.spec()?;
        stored.note_programs(&spec);
        Ok(stored)
    }

    /// Notes the programs as they are now, in place of others.
    fn note_programs(&mut self, spec: &CampaignSpec) {
        let folder = self.folder().to_owned();
        if let Some(inputs) = &mut self.inputs {
            let files = fingerprints::files(spec, &folder).into_iter();
            inputs.renew(PROGRAM, files.filter(|file| file.is_file()), &folder);
        }
    }

    /// The files that go beside the runs.
    fn extra(&self, planned: &Planned) -> Result<BTreeMap<String, Vec<u8>>, Failure> {
        let json = self.file.extension().is_some_and(|end| end.eq_ignore_ascii_case("json"));
        let name = if json { "plan.json" } else { "plan.toml" };
        let resolved = pretty(self)?;
        let prints = Fingerprints::of(&self.spec()?, self.folder());
        Ok(BTreeMap::from([
            (name.to_owned(), planned.text.clone().into_bytes()),
            (RESOLVED.to_owned(), resolved.into_bytes()),
            (fingerprints::FILE.to_owned(), pretty(&prints)?.into_bytes()),
        ]))
    }

    /// Folder of the plan.
    pub(super) fn folder(&self) -> &Path {
        self.file.parent().unwrap_or(Path::new("/"))
    }

    /// Specification of the campaign.
    fn spec(&self) -> Result<CampaignSpec, InputError> {
        let folder = self.folder();
        let Some(folder_text) = folder.to_str() else {
            return Err(InputError::new(folder.display().to_string(), Mistake::NotUtf8)
                .found("the folder of the plan, whose name is not UTF-8")
                .help("move the plan to another folder"));
        };
        let fill = |text: &String| {
            with_folder(text, folder_text).map_err(|_| {
                InputError::new(self.file.display().to_string(), Mistake::Syntax)
                    .found(format_args!("the template \"{text}\""))
            })
        };
        let command = |experiment: &ExperimentPlan, call: &Call| {
            let mut argv = call.argv.iter().map(fill).collect::<Result<Vec<_>, _>>()?;
            if let Some(program) = argv.first_mut()
                && program.contains('/')
                && Path::new(&*program).is_relative()
            {
                *program = folder.join(&*program).display().to_string();
            }
            let environment = call
                .environment
                .iter()
                .map(|(name, value)| Ok((name.clone(), fill(value)?)))
                .collect::<Result<BTreeMap<_, _>, InputError>>()?;
            Ok(experiment.command(folder, Call { argv, environment, ..call.clone() }))
        };
        let commands = self
            .plan
            .commands()
            .map(|(_, experiment, call)| command(experiment, call))
            .collect::<Result<_, InputError>>()?;
        let (parameter_names, seed) = (self.plan.parameter_names(), self.plan.sampler.seed);
        Ok(CampaignSpec { parameter_names, commands, seed })
    }
}

/// Makes the folder of the runs in the folder of a calibration.
pub(super) fn create(dir: &Path, planned: &Planned) -> Result<(Campaign, Stored), Failure> {
    let stored = Stored::of(planned)?;
    let (spec, extra) = (stored.spec()?, stored.extra(planned)?);
    refuse_older_layout(dir)?;
    // What a full disk left of a run that had not begun is used again.
    let runs = dir.join(CAMPAIGN);
    let has_begun = || runs.join("campaign.json").exists();
    let begun = has_begun();
    // The plan of an archive and its files are in the folder itself.
    let inputs = std::path::absolute(dir.join(INPUTS)).is_ok_and(|it| stored.file.starts_with(it));
    let is_ours = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|entry| {
            let name = entry.file_name();
            (name == CAMPAIGN && !begun) || (name == INPUTS && inputs)
        })
    };
    let occupied = std::fs::read_dir(dir).is_ok_and(|mut entries| !entries.all(is_ours));
    if occupied {
        return Err(exists(dir).into());
    }
    let campaign = Campaign::create(&runs, &spec, &extra).map_err(|error| match error {
        CampaignError::DiskFull { .. } if !has_begun() => {
            let name = dir.display();
            RunError::new(format_args!("{name}: the disk is full, and the run has not begun"))
                .help("make room, then begin it again with the same command")
                .into()
        }
        error => refused(dir, error),
    })?;
    Ok((campaign, stored))
}

/// Refuses the runs of another user, whose commands would be run, unless that was asked for.
pub(super) fn check_owner(dir: &Path, accept: bool) -> Result<(), InputError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let own = rustix::process::geteuid().as_raw();
        let owner = dir.join(CAMPAIGN).join("campaign.json").symlink_metadata().map(|it| it.uid());
        if let (Ok(owner), false) = (owner, accept)
            && owner != own
        {
            let name = dir.display();
            return Err(InputError::new(name.to_string(), Mistake::NotOurs)
                .found(format_args!("a run of another user (number {owner})"))
                .help(format_args!(
                    "to resume it runs its commands as you: look at {name}/{CAMPAIGN}/campaign.json, then: calibrate \
                     --resume {name} --accept-owner"
                )));
        }
    }
    #[cfg(not(unix))]
    let _ = (dir, accept);
    Ok(())
}

/// A folder that a new run cannot have.
fn exists(dir: &Path) -> InputError {
    let name = dir.display().to_string();
    let error = InputError::new(&name, Mistake::NotOurs);
    if dir.join(CAMPAIGN).is_dir() {
        error
            .found("a folder that holds a run already")
            .help(format_args!("go on with it: calibrate --resume {name}"))
            .help("or begin another beside it, with --out")
    } else {
        error
            .found("a folder that holds something else than the runs of a plan")
            .help("choose another folder with --out, or move this one away")
    }
}

/// Refuses a run of an earlier version, whose runs lie in the folder itself.
pub(crate) fn refuse_older_layout(dir: &Path) -> Result<(), InputError> {
    if !dir.join("campaign.json").is_file() || dir.join(CAMPAIGN).is_dir() {
        return Ok(());
    }
    let name = dir.display();
    Err(InputError::new(name.to_string(), Mistake::NotOurs)
        .found("a run in the layout of an older version of calibrate, with its runs in the folder itself")
        .expected(format_args!("the runs in {name}/{CAMPAIGN}"))
        .help("go on with the version of calibrate that began it, or begin anew with --plan and another --out"))
}

/// Opens the runs in the folder of a calibration. A plan that is given must be the run's own; it mends a damaged copy,
/// and how its runs are executed is taken from it.
pub(super) fn open(
    dir: &Path,
    given: Option<&Planned>,
) -> Result<(Campaign, Stored, Vec<Damage>), Failure> {
    refuse_older_layout(dir)?;
    let runs = dir.join(CAMPAIGN);
    let (mut campaign, damage) = match given {
        None => Campaign::open(&runs),
        Some(planned) => {
            let stored = Stored::of(planned)?;
            Campaign::restore(&runs, &stored.spec()?, &stored.extra(planned)?)
        }
    }
    .map_err(|error| refused(dir, error))?;
    let place = runs.join(RESOLVED).display().to_string();
    let Some(bytes) = campaign.extra(RESOLVED) else {
        let damaged = damage.iter().filter(|damage| !damage.torn).map(ToString::to_string);
        return Err(damaged
            .fold(InputError::new(place, Mistake::Syntax), InputError::help)
            .found("damaged or missing: what was run is not known from it")
            .help(format_args!(
                "give the plan again: calibrate --resume {} --plan FILE; finished runs are kept",
                dir.display()
            ))
            .into());
    };
    let mut stored: Stored = serde_json::from_slice(bytes).map_err(|error| {
        InputError::new(place, Mistake::Syntax)
            .found(format_args!("no plan of this version ({error})"))
            .help(format_args!(
                "go on with the version of calibrate that began it, or begin anew with --plan {} --out ANOTHER",
                runs.join("plan.toml").display()
            ))
    })?;
    // The limits of the last resume that gave some.
    for (call, command) in stored.plan.calls_mut().zip(&campaign.spec().commands) {
        call.set_limits(&command.call);
    }
    if let Some(planned) = given {
        if let Some(difference) = difference(&stored.plan, &planned.plan) {
            return Err(other_plan(dir, planned, difference).into());
        }
        stored.plan = with_limits(&stored.plan, &planned.plan);
        let spec = stored.spec()?;
        campaign.set_limits(&spec).map_err(|error| refused(dir, error))?;
        stored.executor.clone_from(&planned.executor);
    }
    Ok((campaign, stored, damage))
}

/// Refuses a plan that is not that of the run.
fn other_plan(
    dir: &Path,
    planned: &Planned,
    (field, was, is): (String, String, String),
) -> InputError {
    let file = planned.path.as_deref().unwrap_or(Path::new("plan"));
    let error = InputError::new(file.display().to_string(), Mistake::Conflict);
    let (name, asked) = (dir.display(), planned.plan.sampler.samples);
    let has = was.parse().unwrap_or(usize::MAX);
    let error = match field == SAMPLES {
        true if asked > has => error.help(format_args!(
            "to give the run more: calibrate --resume {name} --samples {asked}"
        )),
        true => error.help(format_args!(
            "all {was} that it has count; to go on with them: calibrate --resume {name}"
        )),
        false => error,
    };
    error
        .in_field(field)
        .found(is)
        .expected(format_args!("{was}, as in the run in {}", dir.display()))
        .help("a run goes on with the plan it began with; begin another with --plan and --out")
        .help("only [executor], timeout_s, retries, try_later, lost and keep may be others")
}

/// Puts a plan in place of that which a run began with; runs that are there have to stay those that it asks for first.
pub(super) fn replace_plan(
    dir: &Path,
    campaign: &mut Campaign,
    stored: &Stored,
) -> Result<(), Failure> {
    let bytes = pretty(stored)?.into_bytes();
    campaign.replace_extra(RESOLVED, &bytes).map_err(|error| refused(dir, error))
}

/// The programs that the runs in a folder were begun with; none where that is not known.
pub(super) fn began_with(campaign: &Campaign) -> Fingerprints {
    let stored = campaign.extra(fingerprints::FILE);
    stored.and_then(|text| serde_json::from_slice(text).ok()).unwrap_or_default()
}

/// The failures of a run that were given up while what they had placed was kept.
pub(super) fn given_up(campaign: &Campaign) -> GivenUp {
    let stored = campaign.extra(given_up::FILE);
    stored.and_then(|text| serde_json::from_slice(text).ok()).unwrap_or_default()
}

/// Refuses to go on with other programs than those that a run began with, or takes them for its own.
pub(super) fn check_programs(
    dir: &Path,
    campaign: &mut Campaign,
    stored: &mut Stored,
    (accept, damaged): (bool, bool),
    given_up: &dyn Fn(&Outcome) -> bool,
) -> Result<Option<String>, Failure> {
    let now = Fingerprints::of(campaign.spec(), stored.folder());
    let known = campaign.extra(fingerprints::FILE).is_some();
    let change = if damaged {
        Some(format!("a damaged {}: what the runs were made with is not known", fingerprints::FILE))
    } else {
        now.change(&began_with(campaign))
    };
    if known && change.is_none() {
        return Ok(None);
    }
    let outcomes = campaign.tasks();
    let mut outcomes = outcomes.iter().filter_map(|task| campaign.outcome(task.number));
    let finished = outcomes.any(|outcome| !given_up(&outcome));
    if let (Some(change), true, false) = (&change, finished, accept) {
        return Err(InputError::new(dir.display().to_string(), Mistake::Conflict)
            .found(change)
            .expected("the programs and files that its finished runs were made with")
            .help("put the former one back, or begin another run with --plan and --out")
            .help(format_args!(
                "if it gives the same results: calibrate --resume {} --accept-changes",
                dir.display()
            ))
            .into());
    }
    let bytes = pretty(&now)?.into_bytes();
    campaign.replace_extra(fingerprints::FILE, &bytes).map_err(|error| refused(dir, error))?;
    stored.note_programs(campaign.spec());
    replace_plan(dir, campaign, stored)?;
    Ok(change)
}

/// Reads the plan of a run without its lock, while it may be running.
pub(crate) fn read_stored(dir: &Path) -> Result<Stored, Failure> {
    refuse_older_layout(dir)?;
    let path = dir.join(CAMPAIGN).join(RESOLVED);
    let text = crate::input::text_file::read(&path)?;
    serde_json::from_str(&text).map_err(|error| {
        InputError::new(path.display().to_string(), Mistake::Syntax)
            .at_line(error.line().max(1))
            .found(format_args!("no plan of this version ({error})"))
            .help(format_args!("calibrate --resume {} --plan FILE mends it", dir.display()))
            .into()
    })
}

/// A campaign's refusal as the user meets it.
pub(crate) fn refused(dir: &Path, error: CampaignError) -> Failure {
    let name = dir.display().to_string();
    match &error {
        CampaignError::Exists { .. } => exists(dir).into(),
        CampaignError::NotACampaign { .. } => {
            let error = InputError::new(&name, Mistake::NotOurs);
            if dir.join(crate::record::FILE_NAME).is_file() {
                return error
                    .found("a run that is finished, computed in this program: it has no runs to go on with")
                    .help(format_args!("its results: calibrate inspect {name}"))
                    .help(format_args!("more simulations: calibrate --continue-from {name} --samples N"))
                    .into();
            }
            let found =
                if dir.exists() { "a folder without a run of a plan" } else { "no such folder" };
            error
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
        CampaignError::LockLost { .. } => RunError::new(&error)
            .help(format_args!("once no other process has it: calibrate --resume {name}"))
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
    use campaign::slurm::SlurmSettings;

    #[test]
    fn every_executor_is_stored_and_read_back() {
        let full = SlurmSettings {
            partition: Some("short".to_owned()),
            extra: vec!["--qos=low".to_owned()],
            chunk: 3,
            poll_min_s: 0.5,
            ..SlurmSettings::default()
        };
        for executor in [
            ExecutorPlan::Threads { threads: None },
            ExecutorPlan::Local { parallel: Some(3) },
            ExecutorPlan::Slurm(SlurmSettings::default()),
            ExecutorPlan::Slurm(full),
        ] {
            let text = serde_json::to_string(&executor).expect("JSON");
            assert_eq!(serde_json::from_str::<ExecutorPlan>(&text).expect(&text), executor);
        }
    }
}
