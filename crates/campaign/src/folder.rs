//! Names and places of the files in a campaign's directory.

use std::fs;
use std::path::{Path, PathBuf};

/// The file that says what is run. A directory without it is not a campaign.
pub(crate) const RECORD: &str = "campaign.json";
/// Every task.
pub(crate) const TASKS: &str = "tasks.jsonl";
/// Every outcome.
pub(crate) const RESULTS: &str = "results.jsonl";
/// Outcomes of workers, until they are collected.
pub(crate) const OUTCOMES: &str = "outcomes";
/// Records of the caller's iterations.
pub(crate) const ITERATIONS: &str = "iterations";
/// Working directories of the runs.
pub(crate) const WORK: &str = "work";
/// Folders of the workers that are there.
pub(crate) const WORKERS: &str = "workers";
/// The values that a worker answered with, in the folder of an attempt.
pub const ANSWER: &str = "answer.json";
/// The file that is locked while a driver has the directory.
pub(crate) const LOCK: &str = "lock";
/// Job arrays submitted to Slurm.
pub(crate) const SLURM: &str = "slurm";

/// The parameters of a run, in its folder.
pub(crate) const PARAMETERS: &str = "parameters.json";
/// The process that makes an attempt at a run, in its folder.
pub(crate) const PROCESS: &str = "process.json";
/// What a run writes to its standard output, in its folder.
pub(crate) const STDOUT: &str = "stdout";
/// What a run writes to its standard error, in its folder.
pub(crate) const STDERR: &str = "stderr";

/// The number in `000012.json`.
pub(crate) fn number_of(path: &Path) -> Option<u64> {
    let stem = path.file_name()?.to_str()?.strip_suffix(".json")?;
    if stem.bytes().all(|byte| byte.is_ascii_digit()) { stem.parse().ok() } else { None }
}

/// The folder of the attempts at a run.
pub(crate) fn task_folder(dir: &Path, number: u64) -> PathBuf {
    dir.join(WORK).join(format!("{number:06}"))
}

/// Number of the last attempt in a folder of attempts; 0 where there is none.
pub(crate) fn last_attempt(folder: &Path) -> u32 {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    entries
        .flatten()
        .filter_map(|entry| entry.file_name().to_str()?.strip_prefix("attempt-")?.parse().ok())
        .max()
        .unwrap_or(0)
}
