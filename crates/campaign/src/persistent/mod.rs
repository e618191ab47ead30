//! Workers: programs that stay, and are asked for one run after the other.

mod program;
mod protocol;

use std::fs::{self, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serde_json::Value;

use crate::error::{CampaignError, ExecutorError};
use crate::executor::Stop;
use crate::folder::{ANSWER, STDERR, WORKERS};
use crate::judge::{self, Verdict};
use crate::outcome::FailureKind;
use crate::process::Ended;
use crate::spec::{Call, CampaignSpec, CommandSpec};
use crate::strays::{self, Watchdog};
use crate::streams;
use crate::task::Task;
use crate::template;

use program::{Program, Reply};
use protocol::Answer;

/// The workers of a driver. They are ended when this is dropped.
#[derive(Debug)]
pub(crate) struct Workers {
    /// Folder of the campaign.
    dir: PathBuf,
    /// Value of [`MARK`](strays::MARK) in the processes.
    campaign: String,
    idle: Mutex<Vec<Worker>>,
    started: AtomicU64,
    _watchdog: Watchdog,
}

/// A worker that said hello.
#[derive(Debug)]
struct Worker {
    program: Program,
    /// Place of its command.
    command: usize,
    /// Number of requests so far.
    requests: u64,
}

/// Why there is no worker.
enum NoWorker {
    /// What this means for the attempt that needs one.
    Verdict(Verdict),
    /// None can be started.
    Error(ExecutorError),
}

/// An attempt at a run by a worker.
struct Attempt<'a> {
    command: &'a CommandSpec,
    folder: &'a Path,
    stop: &'a Stop,
    disk_was_full: bool,
}

impl Workers {
    /// No worker yet for the campaign in `dir`; what a killed driver left there must have been ended.
    pub(crate) fn new(dir: &Path, campaign: &str, spec: &CampaignSpec) -> Self {
        let _ = fs::remove_dir_all(dir.join(WORKERS));
        Self {
            dir: dir.to_owned(),
            campaign: campaign.to_owned(),
            idle: Mutex::default(),
            started: AtomicU64::new(0),
            _watchdog: Watchdog::of_runs(spec),
        }
    }

    /// Whether these are workers of this campaign.
    pub(crate) fn are_of(&self, dir: &Path, campaign: &str) -> bool {
        self.dir == dir && self.campaign == campaign
    }

    /// Makes an attempt at a run in `folder`, by a worker that is idle or a new one; only by such where `new` is set.
    pub(crate) fn ask(
        &self,
        spec: &CampaignSpec,
        task: &Task,
        folder: &Path,
        (stop, new): (&Stop, bool),
    ) -> Result<Verdict, ExecutorError> {
        let command = &spec.commands[task.command];
        let mut attempt = Attempt { command, folder, stop, disk_was_full: false };
        let idle = if new { None } else { self.idle_one(task.command) };
        let worker = match idle {
            Some(worker) => Ok(worker),
            None => self.start(spec, task.command, &mut attempt),
        };
        let mut worker = match worker {
            Ok(worker) => worker,
            Err(NoWorker::Verdict(verdict)) => return Ok(verdict),
            Err(NoWorker::Error(error)) => return Err(error),
        };
        let (verdict, stays) = attempt.verdict(&mut worker, spec, task)?;
        if stays {
            self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(worker);
        }
        Ok(verdict)
    }

    /// An idle worker; those that ended meanwhile are dropped.
    fn idle_one(&self, command: usize) -> Option<Worker> {
        loop {
            let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
            let place = idle.iter().rposition(|worker| worker.command == command)?;
            let mut worker = idle.swap_remove(place);
            drop(idle);
            if !worker.program.has_ended() {
                return Some(worker);
            }
        }
    }

    fn start(
        &self,
        spec: &CampaignSpec,
        command: usize,
        attempt: &mut Attempt<'_>,
    ) -> Result<Worker, NoWorker> {
        let number = self.started.fetch_add(1, Ordering::Relaxed) + 1;
        let folder = self.dir.join(WORKERS).join(number.to_string());
        fs::create_dir_all(&folder)
            .map_err(|error| NoWorker::Error(CampaignError::io("made", &folder, error).into()))?;
        attempt.start(spec, command, folder, Some(&self.campaign))
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        let idle = std::mem::take(self.idle.get_mut().unwrap_or_else(PoisonError::into_inner));
        std::thread::scope(|scope| {
            for mut worker in idle {
                worker.program.close();
                // Each takes its time to end. Where there is no thread it is dropped here.
                let end = std::thread::Builder::new().spawn_scoped(scope, move || drop(worker));
                drop(end);
            }
        });
        strays::end_all();
        let _ = fs::remove_dir(self.dir.join(WORKERS));
    }
}

impl Attempt<'_> {
    /// Starts a worker in `folder`, and waits until it is ready.
    fn start(
        &mut self,
        spec: &CampaignSpec,
        command: usize,
        folder: PathBuf,
        campaign: Option<&str>,
    ) -> Result<Worker, NoWorker> {
        let call = &self.command.call;
        let plain = |text: &String| template::fill(text, |_| None);
        let name = plain(&call.argv[0]);
        let mut program = Command::new(&name);
        program
            .args(call.argv[1..].iter().map(plain))
            .envs(call.environment.iter().map(|(name, value)| (name, plain(value))));
        strays::mark(&mut program, &folder, campaign);
        let stderr = streams::create(&folder.join(STDERR));
        let stderr = stderr.map_err(|error| NoWorker::Error(error.into()))?;
        program.stderr(stderr);
        let mut program = Program::start(&mut program, folder.clone()).map_err(|error| {
            if judge::is_shortage(&error) || !folder.is_dir() {
                NoWorker::Verdict(judge::judge(self.command, self.folder, None, false))
            } else {
                NoWorker::Error(ExecutorError::cannot_start(name.clone(), &error))
            }
        })?;
        let hello = protocol::hello(spec, self.command);
        let reply = self.exchange(&mut program, &hello);
        let refused = |reason: String| {
            let said = streams::end_of(&self.folder.join(STDERR));
            let said = if said.is_empty() { said } else { format!("; it said:\n{said}") };
            let reason = format!("it does not get ready as a worker: {reason}{said}");
            NoWorker::Error(ExecutorError::CannotStart { program: name.clone(), reason })
        };
        match reply {
            Some(Reply::Line(line)) => match protocol::check_hello(&line) {
                Ok(()) => Ok(Worker { program, command, requests: 0 }),
                Err(problem) => Err(refused(problem)),
            },
            Some(Reply::Ended(Ended::Stopped)) => {
                Err(NoWorker::Error(ExecutorError::Interrupted { detached: false }))
            }
            Some(Reply::Ended(ended)) => match self.judge(Some(ended)) {
                Verdict::Failed(kind @ FailureKind::Timeout { .. }, _) => Err(refused(format!(
                    "{kind}; every line that it prints must be flushed at once (in Python print(..., flush=True))"
                ))),
                Verdict::Failed(kind, _) | Verdict::Cut(kind, _) => Err(refused(kind.to_string())),
                verdict => Err(NoWorker::Verdict(verdict)),
            },
            Some(Reply::TooLong) => Err(refused("its first line has no end".into())),
            Some(Reply::Partial(_) | Reply::Nothing) => {
                Err(refused("it ended, or closed its stdout, without a first line".into()))
            }
            None => Err(NoWorker::Verdict(self.judge(None))),
        }
    }

    /// Asks for a run; also whether the worker can be asked for another.
    fn verdict(
        &mut self,
        worker: &mut Worker,
        spec: &CampaignSpec,
        task: &Task,
    ) -> Result<(Verdict, bool), ExecutorError> {
        let used = worker.requests > 0;
        worker.requests += 1;
        let request = protocol::request(worker.requests, spec, task, self.folder);
        let reply = self.exchange(&mut worker.program, &request);
        let (verdict, answered) = match reply {
            Some(Reply::Ended(Ended::Stopped)) => {
                return Err(ExecutorError::Interrupted { detached: false });
            }
            Some(Reply::Line(line)) => match protocol::answer(&line, worker.requests) {
                Ok(Answer::Values(values)) => (self.values(&values), true),
                Ok(Answer::Failure { code, message }) => (self.failure(code, &message), true),
                Err(problem) => (self.bad(problem, &line), false),
            },
            Some(Reply::Partial(line)) => (cut(self.bad("cut off", &line)), false),
            Some(Reply::Nothing) => (self.bad("none before its end", b""), false),
            Some(Reply::TooLong) => (self.bad("longer than 64 MiB", b""), false),
            Some(Reply::Ended(ended)) => (self.judge(Some(ended)), false),
            None => (self.judge(None), false),
        };
        // What other runs have left may be the reason: a second attempt, by a new worker, tells.
        let verdict = if used && !answered { cut(verdict) } else { verdict };
        Ok((verdict, answered))
    }

    /// One line for another; none where the system fails.
    fn exchange(&mut self, program: &mut Program, line: &[u8]) -> Option<Reply> {
        let limit = limit(&self.command.call);
        let stderr = program.folder().join(STDERR);
        let (folder, stop, was_full) = (self.folder, self.stop, &mut self.disk_was_full);
        // It may have written while it had nothing to do.
        streams::bound(&stderr);
        let reply = program.exchange(line, limit, stop, &mut || {
            *was_full |= judge::disk_is_full(folder);
            streams::bound(&stderr);
        });
        streams::bound(&stderr);
        program.move_stderr(&folder.join(STDERR));
        reply.ok()
    }

    fn judge(&self, ended: Option<Ended>) -> Verdict {
        judge::judge(self.command, self.folder, ended, self.disk_was_full)
    }

    /// Values are read as if a command had left them in a file.
    fn values(&self, values: &Value) -> Verdict {
        match fs::write(self.folder.join(ANSWER), values.to_string()) {
            Ok(()) => self.judge(Some(Ended::Exit(0))),
            Err(error) => {
                let detail = format!("{ANSWER} cannot be written: {error}");
                Verdict::Lost(FailureKind::Lost { signal: None }, detail)
            }
        }
    }

    /// A failure counts as the exit code of a command that leaves the message on stderr.
    fn failure(&self, code: i32, message: &str) -> Verdict {
        let add = || -> io::Result<()> {
            let mut stderr = OpenOptions::new();
            let mut stderr = stderr.append(true).create(true).open(self.folder.join(STDERR))?;
            writeln!(stderr, "{message}")
        };
        match add() {
            Ok(()) => self.judge(Some(Ended::Exit(code))),
            Err(error) => {
                let detail = format!("{message} ({STDERR} cannot be written: {error})");
                Verdict::Lost(FailureKind::Lost { signal: None }, detail)
            }
        }
    }

    fn bad(&self, problem: &str, line: &[u8]) -> Verdict {
        let kind = FailureKind::BadAnswer { problem: problem.to_owned() };
        let (line, said) = (protocol::beginning(line), streams::end_of(&self.folder.join(STDERR)));
        let detail = if line.is_empty() { said } else { format!("{line:?} {said}") };
        judge::blame(kind, detail, self.folder, self.disk_was_full)
    }
}

/// A failure that a second attempt may not have.
fn cut(verdict: Verdict) -> Verdict {
    match verdict {
        Verdict::Failed(kind, detail) => Verdict::Cut(kind, detail),
        other => other,
    }
}

fn limit(call: &Call) -> Duration {
    Duration::try_from_secs_f64(call.timeout_s).unwrap_or(Duration::MAX)
}

/// Asks one worker of `spec` for all tasks of its first command, one after the other, without a campaign: the exchange
/// alone, as for measurements. `folder` is empty, and its working directory. Gives the columns that it answered with.
///
/// # Errors
///
/// [`ExecutorError`] where it does not start, or does not answer a request with values.
pub fn ask_worker(
    spec: &CampaignSpec,
    tasks: &[Task],
    folder: &Path,
) -> Result<Vec<Value>, ExecutorError> {
    spec.check().map_err(CampaignError::from)?;
    let (command, stop) = (&spec.commands[0], Stop::new());
    let mut attempt = Attempt { command, folder, stop: &stop, disk_was_full: false };
    let own = folder.join("worker");
    fs::create_dir(&own).map_err(|error| CampaignError::io("made", &own, error))?;
    let mut worker = attempt.start(spec, 0, own, None).map_err(|no| match no {
        NoWorker::Error(error) => error,
        NoWorker::Verdict(_) => ExecutorError::Simulator("the worker does not start now".into()),
    })?;
    let limit = limit(&command.call);
    let values = tasks.iter().map(|task| {
        worker.requests += 1;
        let request = protocol::request(worker.requests, spec, task, folder);
        let problem = match worker.program.exchange(&request, limit, &stop, &mut || ()) {
            Ok(Reply::Line(line)) => match protocol::answer(&line, worker.requests) {
                Ok(Answer::Values(values)) => return Ok(values),
                Ok(Answer::Failure { code, message }) => format!("exit code {code}: {message}"),
                Err(problem) => problem.to_owned(),
            },
            Ok(_) => "none".to_owned(),
            Err(error) => error.to_string(),
        };
        let number = task.number;
        Err(ExecutorError::Simulator(format!("run {number}: the worker's answer: {problem}")))
    });
    values.collect()
}
