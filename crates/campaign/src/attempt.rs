//! The attempts at one run: their directories, the call of the command, and what came out.

use std::fs::{self, File};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::error::{CampaignError, ExecutorError};
use crate::executor::Stop;
use crate::folder::{last_attempt, task_folder};
use crate::machine;
use crate::outcome::{FailureKind, Outcome};
use crate::process::{self, Ended};
use crate::results;
use crate::spec::{CampaignSpec, CommandSpec, Keep};
use crate::task::Task;
use crate::template;

pub(crate) const PARAMETERS: &str = "parameters.json";
pub(crate) const PROCESS: &str = "process.json";
const STDOUT: &str = "stdout";
const STDERR: &str = "stderr";

/// Environment variable of every process that a driver starts on its own machine, by which they are found after a crash of
/// the driver.
pub(crate) const MARK: &str = "CAMPAIGN_RUNS";

/// Length of the start and the end of a captured stream that are kept of a failed run \[bytes\].
const KEPT_START: u64 = 64 << 10;
const KEPT_END: u64 = 256 << 10;

/// Length of the end of stderr that goes into the outcome \[bytes\].
const DETAIL_BYTES: u64 = 1000;

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
    /// Value of [`MARK`] in the processes.
    pub(crate) mark: Option<&'a str>,
    /// Whether no other process can be making attempts, so that those that are there were abandoned.
    pub(crate) alone: bool,
}

/// A run that ended, and the directories of its attempts.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) outcome: Outcome,
    folders: Vec<PathBuf>,
}

impl Runner<'_> {
    /// Makes the run; `lost` is called for every attempt that is made again.
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
        for attempts in 1.. {
            if stop.asked() {
                self.discard(command, task, &folders);
                return Err(ExecutorError::Interrupted { detached: false });
            }
            let folder = self.begin(task)?;
            folders.push(folder.clone());
            let start = Instant::now();
            let ended = self.call(command, task, &folder, stop);
            let seconds = start.elapsed().as_secs_f64();
            let _ = fs::remove_file(folder.join(PROCESS));
            let result = match ended {
                Ok(Some(Ended::Stopped)) => {
                    self.discard(command, task, &folders);
                    return Err(ExecutorError::Interrupted { detached: false });
                }
                Ok(ended) => judge(command, &folder, ended),
                Err(error) => {
                    self.discard(command, task, &folders);
                    return Err(error);
                }
            };
            let outcome = match result {
                Ok(values) => Outcome::Finished { values, attempts, seconds },
                Err((kind, detail)) => {
                    if disk_is_full(&folder) {
                        return Err(CampaignError::DiskFull { path: folder }.into());
                    }
                    // A scheduler ends the command and this program at the same moment: the command
                    // then did not fail, however it ended.
                    if kind.is_lost() || !self.alone {
                        pause(stop);
                        if stop.asked() {
                            self.discard(command, task, &folders);
                            return Err(ExecutorError::Interrupted { detached: false });
                        }
                    }
                    if kind.is_lost() && attempts <= command.call.retries {
                        lost(&kind);
                        continue;
                    }
                    Outcome::Failed { kind, detail, attempts, seconds }
                }
            };
            return Ok(Ran { outcome, folders });
        }
        Err(ExecutorError::Interrupted { detached: false })
    }

    /// Removes the working directories that do not stay, once the outcome is stored. Best effort.
    pub(crate) fn tidy(&self, task: &Task, ran: &Ran) {
        if !self.stays(task, &ran.outcome) {
            self.remove(task, &ran.folders);
        } else if ran.outcome.failure().is_some() {
            for folder in &ran.folders {
                for stream in [STDOUT, STDERR] {
                    let _ = shorten(&folder.join(stream));
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
        let process = serde_json::to_vec(&Process::this()).unwrap_or_default();
        write(&folder.join(PROCESS), &process)?;
        Ok(folder)
    }

    /// Calls the command; none where the system had no room for another process.
    fn call(
        &self,
        spec: &CommandSpec,
        task: &Task,
        folder: &Path,
        stop: &Stop,
    ) -> Result<Option<Ended>, ExecutorError> {
        let fill = |text: &String| template::fill(text, |name| self.value(task, folder, name));
        let stream = |name: &str| {
            let path = folder.join(name);
            File::create_new(&path).map_err(|error| CampaignError::io("written", &path, error))
        };
        let program = fill(&spec.call.argv[0]);
        let mut command = Command::new(&program);
        command
            .args(spec.call.argv[1..].iter().map(fill))
            .current_dir(folder)
            .envs(spec.call.environment.iter().map(|(name, value)| (name, fill(value))))
            .stdin(Stdio::null())
            .stdout(stream(STDOUT)?)
            .stderr(stream(STDERR)?);
        if let Some(mark) = self.mark {
            command.env(MARK, mark);
        }
        let limit = Duration::try_from_secs_f64(spec.call.timeout_s).unwrap_or(Duration::MAX);
        match process::run(&mut command, limit, stop) {
            Ok(ended) => Ok(Some(ended)),
            Err(error) if is_shortage(&error) => Ok(None),
            Err(error) => {
                let reason = match error.kind() {
                    io::ErrorKind::NotFound => {
                        "there is no such program (or not the interpreter that it names)".to_owned()
                    }
                    io::ErrorKind::PermissionDenied => "it is not executable".to_owned(),
                    _ => error.to_string(),
                };
                Err(ExecutorError::CannotStart { program, reason })
            }
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

/// Whether a process could not be made for want of resources, which may pass.
fn is_shortage(error: &io::Error) -> bool {
    use io::ErrorKind::{OutOfMemory, WouldBlock};
    #[cfg(unix)]
    let files = [rustix::io::Errno::MFILE, rustix::io::Errno::NFILE]
        .iter()
        .any(|errno| error.raw_os_error() == Some(errno.raw_os_error()));
    #[cfg(not(unix))]
    let files = false;
    files || matches!(error.kind(), OutOfMemory | WouldBlock)
}

fn pause(stop: &Stop) {
    let start = Instant::now();
    while start.elapsed() < PAUSE && !stop.asked() {
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn write(path: &Path, contents: &[u8]) -> Result<(), CampaignError> {
    // Not flushed: after a crash of the machine the attempt is made again.
    fs::write(path, contents).map_err(|error| CampaignError::io("written", path, error))
}

/// The values of a run, or the cause of its failure.
fn judge(
    command: &CommandSpec,
    folder: &Path,
    ended: Option<Ended>,
) -> Result<Vec<f64>, (FailureKind, String)> {
    let kind = match ended {
        Some(Ended::Exit(0)) => {
            let read = results::read(folder, &command.outputs);
            return read.map_err(|refusal| (refusal.kind, refusal.detail));
        }
        // A shell says so of a child that was killed.
        Some(Ended::Exit(code)) if lost_signal(code - 128) => {
            FailureKind::Lost { signal: Some(code - 128) }
        }
        Some(Ended::Exit(code)) => FailureKind::ExitCode { code },
        Some(Ended::Signal(signal)) if own_fault(signal) => FailureKind::Crashed { signal },
        Some(Ended::Signal(signal)) => FailureKind::Lost { signal: Some(signal) },
        Some(Ended::TimedOut) => FailureKind::Timeout { limit_s: command.call.timeout_s },
        Some(Ended::Stopped) | None => FailureKind::Lost { signal: None },
    };
    let detail = match ended {
        None => "the system had no room for another process".to_owned(),
        Some(_) => end_of(&folder.join(STDERR)),
    };
    Err((kind, detail))
}

/// Signals that come from outside: hang-up, interrupt, kill, termination.
fn lost_signal(signal: i32) -> bool {
    matches!(signal, 1 | 2 | 9 | 15)
}

/// Signals that a program brings upon itself: illegal instruction, trap, abort, bus error, arithmetic,
/// segment, broken pipe, bad system call.
fn own_fault(signal: i32) -> bool {
    #[cfg(unix)]
    {
        use rustix::process::Signal;
        let own = [
            Signal::ILL,
            Signal::TRAP,
            Signal::ABORT,
            Signal::BUS,
            Signal::FPE,
            Signal::SEGV,
            Signal::PIPE,
            Signal::SYS,
            Signal::XFSZ,
        ];
        own.iter().any(|own| own.as_raw() == signal)
    }
    #[cfg(not(unix))]
    {
        let _ = signal;
        false
    }
}

/// The last lines of a captured stream, without control characters.
fn end_of(path: &Path) -> String {
    let read = || -> io::Result<Vec<u8>> {
        let mut file = File::open(path)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(DETAIL_BYTES)))?;
        let mut bytes = Vec::new();
        file.take(DETAIL_BYTES).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = read().unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == char::REPLACEMENT_CHARACTER);
    text.chars().map(|c| if c.is_control() && c != '\n' { ' ' } else { c }).collect()
}

/// Cuts the middle out of a long captured stream.
fn shorten(path: &Path) -> io::Result<()> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    if length <= KEPT_START + KEPT_END {
        return Ok(());
    }
    let mut text = Vec::new();
    (&mut file).take(KEPT_START).read_to_end(&mut text)?;
    let left_out = length - KEPT_START - KEPT_END;
    writeln!(text, "\n[... {left_out} bytes left out ...]")?;
    file.seek(SeekFrom::Start(length - KEPT_END))?;
    file.take(KEPT_END).read_to_end(&mut text)?;
    let aside = path.with_extension("short");
    fs::write(&aside, text)?;
    fs::rename(aside, path)
}

/// Whether the disk is full, which makes programs fail in many ways.
fn disk_is_full(folder: &Path) -> bool {
    #[cfg(unix)]
    {
        let Ok(disk) = rustix::fs::statvfs(folder) else { return false };
        let unit = disk.f_frsize.max(1);
        let enough = (disk.f_blocks * unit / 100).min(1 << 20);
        disk.f_bavail * unit < enough || (disk.f_files > 0 && disk.f_favail == 0)
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_stream_keeps_its_start_and_its_end() {
        let folder = tempfile::tempdir().expect("a directory");
        let path = folder.path().join("stdout");
        let middle = vec![b'.'; 3 << 20];
        let text = [b"first\n", &middle[..], b"\nlast\n"].concat();
        fs::write(&path, &text).expect("written");
        shorten(&path).expect("shortened");
        let short = fs::read(&path).expect("there");
        assert!(short.starts_with(b"first\n.") && short.ends_with(b".\nlast\n"));
        let left_out = text.len() as u64 - KEPT_START - KEPT_END;
        let note = format!("\n[... {left_out} bytes left out ...]\n");
        assert_eq!(short.len() as u64, KEPT_START + KEPT_END + note.len() as u64);
        assert!(String::from_utf8(short).expect("text").contains(&note));
    }

    #[test]
    fn signals_from_outside_and_a_programs_own_are_told_apart() {
        for signal in 1..32 {
            assert!(!(lost_signal(signal) && own_fault(signal)), "{signal}");
        }
        assert!(own_fault(11) && own_fault(6) && lost_signal(9) && lost_signal(15));
    }
}
