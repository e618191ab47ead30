//! Submissions, written to disk before sbatch is called.
//!
//! ```text
//! slurm/losses.jsonl             runs whose array elements ended without a result
//! slurm/0003/submission.json     the runs of each array element, the name of the job
//! slurm/0003/elements            the same, a line for each element: what the job reads
//! slurm/0003/job.sh              the script that was submitted
//! slurm/0003/job                 the number that Slurm gave the job
//! slurm/0003/17.out              what element 17 printed
//! ```

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::settings::SlurmSettings;
use crate::campaign::Campaign;
use crate::error::CampaignError;
use crate::folder::SLURM;
use crate::{durable, files, machine, numbers, seal};

pub(super) const LOSSES: &str = "losses.jsonl";
const SUBMISSION: &str = "submission.json";
const SCRIPT: &str = "job.sh";
const JOB: &str = "job";
const ELEMENTS: &str = "elements";

/// A job array: given to sbatch, or about to be when its driver died.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Submission {
    /// Its number in this campaign, from 1.
    pub(super) number: u32,
    /// Name of the job, by which it is found in the queue.
    pub(super) name: String,
    /// The runs of each array element, from element 0.
    pub(super) elements: Vec<Vec<u64>>,
    /// Most elements that run at the same time.
    pub(super) limit: Option<u32>,
    /// Time limit of an element \[min\].
    pub(super) time_min: u32,
    /// When this was written \[s since 1970\].
    pub(super) written: u64,
}

/// An array element that ended (or went) without the results of some of its runs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Loss {
    pub(super) submission: u32,
    pub(super) element: u32,
    /// The runs without results.
    pub(super) runs: Vec<u64>,
    /// The cause, in words.
    pub(super) cause: String,
    /// Whether it counts against the limit of attempts at a run.
    pub(super) counts: bool,
}

/// Name of a job, the same whenever the same directory submits it: what a restarted driver looks for. Directories of the
/// same name are told apart, and so is a copy of a directory.
pub(super) fn job_name(campaign: &Campaign, number: u32) -> String {
    let stem = campaign.dir().file_name().map(|name| name.to_string_lossy().into_owned());
    let plain = |c: &char| c.is_ascii_alphanumeric() || *c == '_';
    let stem: String = stem.unwrap_or_default().chars().filter(plain).take(20).collect();
    let mut digest = seal::Digest::new();
    digest.add(campaign.dir().as_os_str().as_encoded_bytes());
    digest.add(campaign.id().as_bytes());
    format!("{stem}-{}-{number}", seal::hex(digest.finish()))
}

/// Every submission that can be read, by number, and the next free number.
pub(super) fn read_all(dir: &Path) -> Result<(Vec<Submission>, u32), CampaignError> {
    let folder = dir.join(SLURM);
    let failed = |error| CampaignError::io("read", &folder, error);
    let mut submissions = Vec::new();
    let mut next = 1;
    let entries = match fs::read_dir(&folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Ok((submissions, next));
        }
        entries => entries.map_err(failed)?,
    };
    for entry in entries {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        let Some(number) = name.and_then(|name| name.parse::<u32>().ok()) else { continue };
        next = next.max(number.saturating_add(1));
        // One that cannot be read has runs that will be submitted again: twice, at worst.
        if let Ok(Some(text)) = files::read(&path.join(SUBMISSION))
            && let Ok(submission) = seal::unseal::<Submission>(&text)
            && submission.number == number
        {
            submissions.push(submission);
        }
    }
    submissions.sort_by_key(|submission| submission.number);
    Ok((submissions, next))
}

impl Submission {
    /// Folder of its files.
    pub(super) fn folder(&self, dir: &Path) -> PathBuf {
        dir.join(SLURM).join(self.folder_name())
    }

    fn folder_name(&self) -> String {
        format!("{:04}", self.number)
    }

    /// The number that Slurm gave the job, where it is known.
    pub(super) fn job(&self, dir: &Path) -> Option<u64> {
        let text = fs::read_to_string(self.folder(dir).join(JOB)).ok()?;
        text.trim().parse().ok()
    }

    /// Writes the number down that Slurm gave the job.
    pub(super) fn write_job(&self, dir: &Path, job: u64) -> Result<(), CampaignError> {
        files::write(&self.folder(dir).join(JOB), format!("{job}\n").as_bytes())
    }

    /// The last lines that the element printed.
    pub(super) fn printed(&self, dir: &Path, element: usize) -> String {
        let text = fs::read(self.folder(dir).join(format!("{element}.out"))).unwrap_or_default();
        let text = String::from_utf8_lossy(&text[text.len().saturating_sub(2000)..]).into_owned();
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        lines[lines.len().saturating_sub(5)..].join("\n")
    }

    /// Time since it was written \[s\].
    pub(super) fn age_s(&self) -> u64 {
        machine::now_s().saturating_sub(self.written)
    }

    /// Writes everything that the job needs, flushed to disk, and gives the arguments for sbatch.
    pub(super) fn write(
        &self,
        dir: &Path,
        settings: &SlurmSettings,
        worker: &[String],
    ) -> Result<Vec<String>, CampaignError> {
        let folder = self.folder(dir);
        files::make_folder(&folder)?;
        let mut elements = String::new();
        for runs in &self.elements {
            elements.push_str(&numbers::format(runs));
            elements.push('\n');
        }
        files::write(&folder.join(ELEMENTS), elements.as_bytes())?;
        let arguments = self.arguments(dir, settings);
        let script = self.script(dir, settings, worker, &arguments);
        files::write(&folder.join(SCRIPT), script.as_bytes())?;
        files::write_sealed(&folder.join(SUBMISSION), self)?;
        let parent = dir.join(SLURM);
        durable::flush_folder(&parent).map_err(|e| CampaignError::io("written", &parent, e))?;
        Ok(arguments)
    }

    /// Arguments of sbatch. On its command line they count more than what the environment says (`SBATCH_TIMELIMIT`, ...).
    fn arguments(&self, dir: &Path, settings: &SlurmSettings) -> Vec<String> {
        let mut array = format!("--array=0-{}", self.elements.len().saturating_sub(1));
        if let Some(limit) = self.limit {
            // Writing to a String cannot fail.
            let _ = write!(array, "%{limit}");
        }
        let folder = format!("{SLURM}/{}", self.folder_name());
        let mut arguments = vec![
            "--parsable".into(),
            format!("--job-name={}", self.name),
            array,
            format!("--chdir={}", dir.display()),
            format!("--output={folder}/%a.out"),
            "--open-mode=append".into(),
            format!("--time={}", self.time_min),
            // A run that is lost is submitted anew, and counted.
            "--no-requeue".into(),
        ];
        let mut option = |name: &str, value: Option<String>| {
            arguments.extend(value.map(|value| format!("--{name}={value}")));
        };
        option("partition", settings.partition.clone());
        option("account", settings.account.clone());
        option("mem", settings.memory_mb.map(|mb| format!("{mb}M")));
        option("cpus-per-task", settings.cpus.map(|cpus| cpus.to_string()));
        arguments.extend(settings.extra.iter().cloned());
        arguments.push(format!("{folder}/{SCRIPT}"));
        arguments
    }

    fn script(
        &self,
        dir: &Path,
        settings: &SlurmSettings,
        worker: &[String],
        arguments: &[String],
    ) -> String {
        let dir = dir.display().to_string();
        let command: Vec<String> = worker.iter().chain([&dir]).map(|part| quoted(part)).collect();
        let shown: Vec<String> = arguments.iter().map(|part| quoted(part)).collect();
        let setup: String = settings.setup.iter().map(|line| format!("{line}\n")).collect();
        format!(
            "#!/bin/sh\n\
             # Each element of this job array makes the runs in its line of the file {ELEMENTS}.\n\
             # Submitted in the run directory by: sbatch {}\n\
             cd {} || exit 1\n\
             {setup}\
             tasks=$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" {SLURM}/{}/{ELEMENTS})\n\
             exec {} --tasks \"$tasks\"\n",
            shown.join(" "),
            quoted(&dir),
            self.folder_name(),
            command.join(" "),
        )
    }
}

/// A word as the shell reads it back.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// Splits runs into array elements of at most `chunk`; those in `alone` have an element each.
pub(super) fn elements(runs: &[u64], chunk: u32, alone: &BTreeSet<u64>) -> Vec<Vec<u64>> {
    let (single, shared): (Vec<u64>, Vec<u64>) = runs.iter().partition(|run| alone.contains(run));
    let chunk = (chunk as usize).max(1);
    let mut elements: Vec<Vec<u64>> = shared.chunks(chunk).map(<[u64]>::to_vec).collect();
    elements.extend(single.into_iter().map(|run| vec![run]));
    elements
}
