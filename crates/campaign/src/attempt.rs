//! The attempts at one run: their directories, the call of the command, and what came out.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::error::{CampaignError, ExecutorError};
use crate::executor::Stop;
use crate::folder::{PARAMETERS, PROCESS, STDERR, STDOUT, last_attempt, task_folder};
use crate::inputs;
use crate::judge::{self, Verdict};
use crate::outcome::{FailureKind, Outcome};
use crate::persistent::Workers;
use crate::process::{self, Ended};
use crate::spec::{Call, CampaignSpec, CommandSpec, Keep, LostRuns};
use crate::task::Task;
use crate::{machine, strays, streams, template};

/// Pause before a run counts as lost or failed: what killed it may be about to stop this program too.
const PAUSE: Duration = Duration::from_millis(100);

/// The process that makes an attempt.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Process {
    pub(crate) pid: u32,
    pub(crate) host: String,
    pub(crate) boot: String,
    /// Seconds since 1970.
    pub(crate) started: u64,
}

impl Process {
    fn this() -> Self {
        let (pid, host) = (std::process::id(), machine::host());
        Self { pid, host, boot: machine::boot(), started: machine::now_s() }
    }

    /// Whether it is running; none where it is on another machine.
    pub(crate) fn is_running(&self) -> Option<bool> {
        if self.host != machine::host() {
            return None;
        }
        Some(self.boot == machine::boot() && machine::process_exists(self.pid))
    }
}

/// Makes attempts.
#[derive(Debug)]
pub(crate) struct Runner<'a> {
    /// Directory of the campaign, absolute.
    pub(crate) dir: &'a Path,
    pub(crate) spec: &'a CampaignSpec,
    /// Value of [`MARK`](strays::MARK) in the processes.
    pub(crate) mark: Option<&'a str>,
    /// Workers of the commands that have some; only a driver on its own machine keeps them.
    pub(crate) workers: Option<&'a Workers>,
    /// Whether no other process can be making attempts, so that those that are there were abandoned.
    pub(crate) alone: bool,
}

/// Attempts at a run that are made again, by reason.
#[derive(Default)]
struct Tries {
    lost: u32,
    later: u32,
    cut: bool,
}

/// What follows from an attempt.
enum Next {
    Values(Vec<f64>),
    Failed(FailureKind, String),
    /// Another one, after a pause.
    Again(FailureKind, Duration),
    /// Called too often: the last answer in words, and its particulars.
    NotNow(String, String),
    /// Lost too often, in words, and particulars.
    Lost(String, String),
}

impl Tries {
    fn next(&mut self, call: &Call, verdict: Verdict) -> Next {
        let limits = &call.try_later;
        match verdict {
            Verdict::Values(values) => Next::Values(values),
            Verdict::Later(kind, detail) if self.later == limits.retries => {
                Next::NotNow(kind.to_string(), detail)
            }
            Verdict::Later(kind, _) => {
                self.later += 1;
                Next::Again(kind, limits.pause(self.later - 1))
            }
            Verdict::Lost(kind, _) if self.lost < call.retries => {
                self.lost += 1;
                Next::Again(kind, Duration::ZERO)
            }
            Verdict::Lost(kind, detail) if call.lost == LostRuns::Stop => {
                Next::Lost(kind.to_string(), detail)
            }
            Verdict::Cut(kind, _) if !self.cut && call.retries > 0 => {
                self.cut = true;
                Next::Again(kind, Duration::ZERO)
            }
            Verdict::Lost(kind, detail)
            | Verdict::Cut(kind, detail)
            | Verdict::Failed(kind, detail) => Next::Failed(kind, detail),
        }
    }
}

/// A run that ended, and the directories of its attempts.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) outcome: Outcome,
    folders: Vec<PathBuf>,
}

impl Runner<'_> {
    /// Makes the run; `lost` is called for every attempt that is made again. A run that is lost too often has no outcome
    /// ([`ExecutorError::Lost`]), unless the command says that it failed.
    pub(crate) fn run(
        &self,
        task: &Task,
        stop: &Stop,
        mut lost: impl FnMut(&FailureKind),
    ) -> Result<Ran, ExecutorError> {
        let command = self.spec.commands.get(task.command).filter(|c| !c.call.argv.is_empty());
        let command = command.ok_or_else(|| ExecutorError::CannotStart {
            program: format!("command {}", task.command),
            reason: "it has no program".into(),
        })?;
        let mut folders = Vec::new();
        if self.alone && command.call.keep != Keep::All {
            self.remove(task, &abandoned(&task_folder(self.dir, task.number)));
        }
        let mut tries = Tries::default();
        for attempts in 1.. {
            if stop.asked() {
                self.discard(command, task, &folders);
                return Err(ExecutorError::Interrupted { detached: false });
            }
            let folder = self.begin(task)?;
            folders.push(folder.clone());
            let start = Instant::now();
            let verdict = match self.attempt(command, task, &folder, (stop, tries.cut)) {
                Ok(verdict) => verdict,
                Err(error) => {
                    self.discard(command, task, &folders);
                    return Err(error);
                }
            };
            let seconds = start.elapsed().as_secs_f64();
            if !matches!(verdict, Verdict::Values(_)) {
                if judge::disk_is_full(&folder) {
                    return Err(CampaignError::DiskFull { path: folder }.into());
                }
                // A scheduler ends the command and this program at the same moment: the command
                // then did not fail, however it ended.
                if !(self.alone && matches!(verdict, Verdict::Failed(..) | Verdict::Cut(..))) {
                    wait(PAUSE, stop);
                }
                if stop.asked() {
                    self.discard(command, task, &folders);
                    return Err(ExecutorError::Interrupted { detached: false });
                }
            }
            let number = task.number;
            let outcome = match tries.next(&command.call, verdict) {
                Next::Again(kind, pause) => {
                    lost(&kind);
                    wait(pause, stop);
                    continue;
                }
                Next::NotNow(cause, detail) => {
                    return Err(ExecutorError::NotNow { number, attempts, cause, detail });
                }
                Next::Lost(cause, detail) => {
                    return Err(ExecutorError::Lost { numbers: vec![number], cause, detail });
                }
                Next::Values(values) => Outcome::Finished { values, attempts, seconds },
                Next::Failed(kind, detail) => Outcome::Failed { kind, detail, attempts, seconds },
            };
            return Ok(Ran { outcome, folders });
        }
        Err(ExecutorError::Interrupted { detached: false })
    }

    /// Calls the command once, and says what came of it; a worker must be `new` where an earlier one is suspected.
    fn attempt(
        &self,
        command: &CommandSpec,
        task: &Task,
        folder: &Path,
        (stop, new): (&Stop, bool),
    ) -> Result<Verdict, ExecutorError> {
        if command.call.worker {
            let ask = |workers: &Workers| workers.ask(self.spec, task, folder, (stop, new));
            let asked = self.workers.map(ask);
            let _ = fs::remove_file(folder.join(PROCESS));
            return asked.unwrap_or_else(|| Err(no_workers(command)));
        }
        let mut disk_was_full = false;
        let ended = self.call(command, task, folder, stop, &mut || {
            disk_was_full |= judge::disk_is_full(folder);
            for stream in [STDOUT, STDERR] {
                streams::bound(&folder.join(stream));
            }
        });
        let _ = fs::remove_file(folder.join(PROCESS));
        match ended? {
            Some(Ended::Stopped) => Err(ExecutorError::Interrupted { detached: false }),
            ended => Ok(judge::judge(command, folder, ended, disk_was_full)),
        }
    }

    /// Removes the working directories that do not stay, once the outcome is stored. Best effort.
    pub(crate) fn tidy(&self, task: &Task, ran: &Ran) {
        if !self.stays(task, &ran.outcome) {
            self.remove(task, &ran.folders);
        } else {
            for folder in &ran.folders {
                for stream in [STDOUT, STDERR] {
                    let _ = streams::shorten(&folder.join(stream));
                }
            }
        }
    }

    /// Same as [`tidy`](Self::tidy), for a driver that was killed before it could tidy up.
    pub(crate) fn sweep(&self, task: &Task, outcome: &Outcome) {
        let folder = task_folder(self.dir, task.number);
        if !self.stays(task, outcome) && folder.is_dir() {
            self.remove(task, &abandoned(&folder));
        }
    }

    fn stays(&self, task: &Task, outcome: &Outcome) -> bool {
        match self.spec.commands.get(task.command).map_or(Keep::All, |command| command.call.keep) {
            Keep::All => true,
            Keep::Failed => outcome.failure().is_some(),
            Keep::None => false,
        }
    }

    fn discard(&self, command: &CommandSpec, task: &Task, folders: &[PathBuf]) {
        if command.call.keep != Keep::All {
            self.remove(task, folders);
        }
    }

    fn remove(&self, task: &Task, folders: &[PathBuf]) {
        for folder in folders {
            let _ = fs::remove_dir_all(folder);
        }
        // Stays where another machine makes an attempt too.
        let _ = fs::remove_dir(task_folder(self.dir, task.number));
    }

    /// Makes the directory of the next attempt, which nobody else has, with the parameters in it.
    fn begin(&self, task: &Task) -> Result<PathBuf, CampaignError> {
        let all = task_folder(self.dir, task.number);
        let failed = |error| CampaignError::io("made", &all, error);
        let mut attempt = match fs::create_dir(&all) {
            Ok(()) => 1,
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => last_attempt(&all) + 1,
            Err(error) => return Err(failed(error)),
        };
        let folder = loop {
            let folder = all.join(format!("attempt-{attempt}"));
            match fs::create_dir(&folder) {
                Ok(()) => break folder,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => attempt += 1,
                Err(error) => return Err(failed(error)),
            }
        };
        let names = self.spec.parameter_names.iter().cloned();
        let values = task.parameters.iter().map(|&value| Value::from(value));
        let parameters = json!({
            "run": task.number,
            "seed": self.spec.seed_of(task.number),
            "command": self.spec.commands[task.command].name,
            "parameters": names.zip(values).collect::<Map<_, _>>(),
        });
        write(&folder.join(PARAMETERS), format!("{parameters:#}\n").as_bytes())?;
        for file in &self.spec.commands[task.command].call.files {
            let value = |name: &str| self.value(task, &folder, name);
            inputs::put(file, &folder, value).map_err(|error| {
                CampaignError::io("put into the folder of a run", Path::new(&file.from), error)
            })?;
        }
        let process = serde_json::to_vec(&Process::this()).unwrap_or_default();
        write(&folder.join(PROCESS), &process)?;
        Ok(folder)
    }

    /// Calls the command, and `glance` every moment while it runs; none where the system had no room for another process,
    /// or the working folder has vanished.
    fn call(
        &self,
        spec: &CommandSpec,
        task: &Task,
        folder: &Path,
        stop: &Stop,
        glance: &mut dyn FnMut(),
    ) -> Result<Option<Ended>, ExecutorError> {
        let fill = |text: &String| template::fill(text, |name| self.value(task, folder, name));
        let stream = |name: &str| streams::create(&folder.join(name));
        let program = fill(&spec.call.argv[0]);
        let mut command = Command::new(&program);
        command
            .args(spec.call.argv[1..].iter().map(fill))
            .current_dir(folder)
            .envs(spec.call.environment.iter().map(|(name, value)| (name, fill(value))))
            .stdin(Stdio::null())
            .stdout(stream(STDOUT)?)
            .stderr(stream(STDERR)?);
        strays::mark(&mut command, folder, self.mark);
        let limit = Duration::try_from_secs_f64(spec.call.timeout_s).unwrap_or(Duration::MAX);
        match process::run(&mut command, limit, stop, glance) {
            Ok(ended) => Ok(Some(ended)),
            Err(error) if judge::is_shortage(&error) || !folder.is_dir() => Ok(None),
            Err(error) => Err(ExecutorError::cannot_start(program, &error)),
        }
    }

    fn value(&self, task: &Task, folder: &Path, name: &str) -> Option<String> {
        match name {
            "parameters" => Some(folder.join(PARAMETERS).to_string_lossy().into_owned()),
            "run" => Some(task.number.to_string()),
            "seed" => Some(self.spec.seed_of(task.number).to_string()),
            name => {
                let place = self.spec.parameter_names.iter().position(|known| known == name)?;
                Some(template::number(*task.parameters.get(place)?))
            }
        }
    }
}

/// Directories of attempts that a killed driver has left; those that another machine may be making are not among them.
fn abandoned(folder: &Path) -> Vec<PathBuf> {
    let Ok(attempts) = fs::read_dir(folder) else { return Vec::new() };
    let paths = attempts.flatten().map(|attempt| attempt.path());
    let left = paths.filter(|path| match fs::read(path.join(PROCESS)) {
        Ok(text) => serde_json::from_slice::<Process>(&text)
            .map_or(true, |process| process.is_running() == Some(false)),
        Err(_) => true,
    });
    left.collect()
}

/// Where no workers are kept, their commands cannot be run.
pub(crate) fn no_workers(command: &CommandSpec) -> ExecutorError {
    ExecutorError::CannotStart {
        program: command.call.argv.first().cloned().unwrap_or_default(),
        reason: format!("the worker of {} is only kept by local processes", command.name),
    }
}

fn wait(pause: Duration, stop: &Stop) {
    let start = Instant::now();
    while start.elapsed() < pause && !stop.asked() {
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn write(path: &Path, contents: &[u8]) -> Result<(), CampaignError> {
    // Not flushed: after a crash of the machine the attempt is made again.
    fs::write(path, contents).map_err(|error| CampaignError::io("written", path, error))
}
