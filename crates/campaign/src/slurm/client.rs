//! Slurm's commands, with typed answers.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::call::{NoAnswer, call};
use super::parse::{self, AccountRow, QueueRow};
use crate::executor::Stop;

/// Calls Slurm's commands.
#[derive(Debug, Clone)]
pub(super) struct Client {
    /// Folder of the commands; none for those on `PATH`.
    pub(super) programs: Option<PathBuf>,
    pub(super) patience: Duration,
}

/// Why a question has no answer; never to be taken for "no".
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Unknown {
    /// The commands of Slurm are not on this machine.
    NotInstalled(String),
    /// They failed, hang, or print something that cannot be understood.
    Words(String),
    /// The caller was asked to stop while it waited.
    Interrupted,
}

/// Why a job array was not submitted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum NotSubmitted {
    /// Slurm will not take it, now or later: its words.
    Refused(String),
    /// The array has too many elements for Slurm, or for this user at present.
    TooMany(String),
    /// Slurm did not take it, and may later.
    Busy(String),
    /// Slurm may have taken it.
    Unknown(String),
    /// The commands of Slurm are not on this machine.
    NotInstalled(String),
}

impl Client {
    fn command(&self, program: &str) -> Command {
        match &self.programs {
            Some(folder) => Command::new(folder.join(program)),
            None => Command::new(program),
        }
    }

    /// Runs a command and gives what it printed.
    fn ask(
        &self,
        program: &str,
        arguments: &[String],
        interrupted: &dyn Fn() -> bool,
    ) -> Result<String, Unknown> {
        let mut command = self.command(program);
        command.args(arguments);
        match call(&mut command, self.patience, interrupted) {
            Ok(answer) if answer.success => Ok(answer.stdout),
            Ok(answer) => Err(Unknown::Words(format!("{program}: {}", answer.words()))),
            Err(NoAnswer::CannotStart(why)) => {
                Err(Unknown::NotInstalled(not_installed(program, &why)))
            }
            Err(NoAnswer::Silent) => Err(Unknown::Words(self.silent(program))),
            Err(NoAnswer::Interrupted) => Err(Unknown::Interrupted),
        }
    }

    fn silent(&self, program: &str) -> String {
        format!("{program} does not answer within {} s", self.patience.as_secs_f64())
    }

    /// Submits a job array and gives its number. Not interrupted: whether it was taken must be known.
    pub(super) fn submit(&self, dir: &Path, arguments: &[String]) -> Result<u64, NotSubmitted> {
        let mut command = self.command("sbatch");
        command.args(arguments).current_dir(dir);
        match call(&mut command, self.patience, &|| false) {
            Ok(answer) if answer.success => {
                parse::sbatch(&answer.stdout).map_err(NotSubmitted::Unknown)
            }
            Ok(answer) => Err(refusal(answer.words())),
            Err(NoAnswer::CannotStart(why)) => {
                Err(NotSubmitted::NotInstalled(not_installed("sbatch", &why)))
            }
            Err(NoAnswer::Silent | NoAnswer::Interrupted) => {
                Err(NotSubmitted::Unknown(self.silent("sbatch")))
            }
        }
    }

    /// The jobs of these names, those that ended too as long as Slurm remembers them.
    pub(super) fn queue(&self, names: &[&str], stop: &Stop) -> Result<Vec<QueueRow>, Unknown> {
        let asked = stop.request();
        let arguments = [
            format!("--name={}", names.join(",")),
            "--states=all".into(),
            format!("--format={}", parse::SQUEUE_FORMAT),
        ];
        let text = self.ask("squeue", &arguments, &|| stop.request() != asked)?;
        parse::squeue(&text).map_err(Unknown::Words)
    }

    /// The most elements that a job array may have.
    pub(super) fn max_array_size(&self, stop: &Stop) -> Result<u32, Unknown> {
        let arguments = ["show".into(), "config".into()];
        let text = self.ask("scontrol", &arguments, &|| stop.asked())?;
        parse::max_array_size(&text).map_err(Unknown::Words)
    }

    /// How jobs ended, where the cluster keeps accounts.
    pub(super) fn accounts(&self, jobs: &[u64], stop: &Stop) -> Result<Vec<AccountRow>, Unknown> {
        let jobs: Vec<String> = jobs.iter().map(u64::to_string).collect();
        let arguments = [
            "--allocations".into(),
            "--parsable2".into(),
            format!("--jobs={}", jobs.join(",")),
            format!("--format={}", parse::SACCT_FORMAT),
        ];
        let text = self.ask("sacct", &arguments, &|| stop.asked())?;
        parse::sacct(&text).map_err(Unknown::Words)
    }

    /// Cancels the job of this name, all its elements.
    pub(super) fn cancel(&self, name: &str) -> Result<(), Unknown> {
        self.ask("scancel", &[format!("--name={name}")], &|| false).map(drop)
    }
}

fn not_installed(program: &str, why: &str) -> String {
    format!(
        "{program} cannot be started ({why}): is this a machine of the cluster, with Slurm's commands?"
    )
}

/// Sorts a refusal: final, too large, or to be tried again.
fn refusal(words: String) -> NotSubmitted {
    let has = |patterns: &[&str]| patterns.iter().any(|pattern| words.contains(pattern));
    if has(&["MaxSubmitJob", "Invalid job array specification"]) {
        NotSubmitted::TooMany(words)
    } else if has(&["Socket timed out", "Zero Bytes", "Connection reset", "Unexpected message"]) {
        NotSubmitted::Unknown(words)
    } else if has(&[
        "Unable to contact",
        "temporarily un",
        "not responding",
        "standby mode",
        "Connection refused",
        "Connection timed out",
        "munge",
        "authentication",
    ]) {
        NotSubmitted::Busy(words)
    } else {
        NotSubmitted::Refused(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_told_from_what_passes() {
        let of = |words: &str| refusal(words.to_owned());
        for (words, kind) in [
            ("sbatch: error: invalid partition specified: nope", "refused"),
            (
                "sbatch: error: Batch job submission failed: Invalid account or account/partition",
                "refused",
            ),
            (
                "sbatch: error: Batch job submission failed: Invalid job array specification",
                "too many",
            ),
            ("sbatch: error: QOSMaxSubmitJobPerUserLimit", "too many"),
            ("slurm_load_jobs error: Unable to contact slurm controller (connect failure)", "busy"),
            (
                "sbatch: error: Slurm temporarily unable to accept job, sleeping and retrying",
                "busy",
            ),
            ("sbatch: error: If munged is up, restart with --num-threads=10", "busy"),
            (
                "sbatch: error: Batch job submission failed: Socket timed out on send/recv operation",
                "unknown",
            ),
        ] {
            let found = match of(words) {
                NotSubmitted::Refused(_) => "refused",
                NotSubmitted::TooMany(_) => "too many",
                NotSubmitted::Busy(_) => "busy",
                NotSubmitted::Unknown(_) => "unknown",
                NotSubmitted::NotInstalled(_) => "not installed",
            };
            assert_eq!(found, kind, "{words}");
        }
    }
}
