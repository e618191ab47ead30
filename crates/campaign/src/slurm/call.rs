//! Calls of Slurm's commands, none of which may hang this program.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

/// Answer of a command.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Answer {
    pub(super) success: bool,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

impl Answer {
    /// The command's words on its failure.
    pub(super) fn words(&self) -> String {
        let stderr = self.stderr.trim();
        let text = if stderr.is_empty() { self.stdout.trim() } else { stderr };
        if text.is_empty() { "it failed without a word".into() } else { text.into() }
    }
}

/// Why a command did not answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum NoAnswer {
    /// The program is not on this machine, or cannot be started.
    CannotStart(String),
    /// It did not end in time, and was ended.
    Silent,
    /// The caller was asked to stop.
    Interrupted,
}

/// Runs a command to its end, for at most `patience`.
///
/// It has a process group of its own, so that Ctrl-C in the terminal does not reach it halfway through a submission, and so
/// that all of it can be ended. Environment variables that Slurm takes as options of these commands are not passed on: they
/// may be meant for other jobs.
pub(super) fn call(
    command: &mut Command,
    patience: Duration,
    interrupted: &dyn Fn() -> bool,
) -> Result<Answer, NoAnswer> {
    clean_environment(command);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    own_group(command);
    let mut child = command.spawn().map_err(|error| NoAnswer::CannotStart(error.to_string()))?;
    let stdout = read_aside(child.stdout.take());
    let stderr = read_aside(child.stderr.take());
    let deadline = Instant::now() + patience;
    let mut pause = Duration::from_millis(1);
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if interrupted() => {
                end(&mut child);
                return Err(NoAnswer::Interrupted);
            }
            Ok(None) if Instant::now() < deadline => {
                thread::sleep(pause);
                pause = (pause * 2).min(Duration::from_millis(50));
            }
            Ok(None) | Err(_) => {
                end(&mut child);
                return Err(NoAnswer::Silent);
            }
        }
    };
    // A descendant may hold the pipes open after the command's own end.
    let rest = Duration::from_secs(2).min(patience);
    match (stdout.recv_timeout(rest), stderr.recv_timeout(rest)) {
        (Ok(stdout), Ok(stderr)) => Ok(Answer { success: status.success(), stdout, stderr }),
        _ => {
            end(&mut child);
            Err(NoAnswer::Silent)
        }
    }
}

fn clean_environment(command: &mut Command) {
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        let meddles =
            ["SQUEUE_", "SACCT_", "SCANCEL_"].iter().any(|prefix| text.starts_with(prefix))
                || ["SBATCH_ARRAY_INX", "SBATCH_WAIT", "SBATCH_JOB_NAME"].contains(&&*text);
        if meddles {
            command.env_remove(&name);
        }
    }
    // Otherwise squeue cuts lists of elements off after 64 characters.
    command.env("SLURM_BITSTR_LEN", "0");
}

fn read_aside(pipe: Option<impl Read + Send + 'static>) -> Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    // Where no thread can be had, the sender is dropped: no answer.
    let _ = thread::Builder::new().name("slurm-answer".into()).spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe
            && pipe.read_to_end(&mut bytes).is_err()
        {
            return;
        }
        let _ = sender.send(String::from_utf8_lossy(&bytes).into_owned());
    });
    receiver
}

#[cfg(unix)]
fn own_group(command: &mut Command) {
    use std::os::unix::process::CommandExt;
    command.process_group(0);
}

#[cfg(not(unix))]
fn own_group(_: &mut Command) {}

/// Ends the command and what it started.
fn end(child: &mut Child) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}

#[cfg(all(test, unix))]
mod tests {
    use std::process::Command;
    use std::time::{Duration, Instant};

    use crate::slurm::call::{NoAnswer, call};

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn an_answer_has_everything_that_was_said() {
        let script = "yes | head -c 300000; echo words >&2; exit 3";
        let answer =
            call(&mut shell(script), Duration::from_secs(20), &|| false).expect("an answer");
        assert!(!answer.success);
        assert_eq!(answer.stdout.len(), 300_000);
        assert_eq!(answer.words(), "words");
    }

    #[test]
    fn a_command_that_hangs_is_silent_after_the_time_given() {
        let start = Instant::now();
        let hanging = call(&mut shell("sleep 60"), Duration::from_millis(200), &|| false);
        assert_eq!(hanging, Err(NoAnswer::Silent));
        let held_open =
            call(&mut shell("sleep 60 & echo 1"), Duration::from_millis(200), &|| false);
        assert_eq!(held_open, Err(NoAnswer::Silent), "a descendant holds the pipe");
        assert!(start.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_call_can_be_interrupted() {
        let start = Instant::now();
        let answer = call(&mut shell("sleep 60"), Duration::from_secs(50), &|| true);
        assert_eq!(answer, Err(NoAnswer::Interrupted));
        assert!(start.elapsed() < Duration::from_secs(10));
    }

    #[test]
    fn a_program_that_is_not_there_is_named_as_such() {
        let answer = call(&mut Command::new("no-such-slurm"), Duration::from_secs(1), &|| false);
        assert!(matches!(answer, Err(NoAnswer::CannotStart(_))), "{answer:?}");
    }
}
