//! The records that make up a campaign: what is run, and how a run ended.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::CampaignError;
use crate::folder::{RECORD, TASKS};
use crate::outcome::Outcome;
use crate::spec::CampaignSpec;
use crate::task::Task;
use crate::{files, machine, seal};

/// Format of the directory.
const FORMAT: u64 = 2;

/// Contents of `campaign.json`.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Record {
    format: u64,
    /// A text that no other campaign has; the processes of this one carry it in their environment.
    pub(crate) id: String,
    pub(crate) spec: CampaignSpec,
    /// Checksums of the caller's files, by name.
    pub(crate) files: BTreeMap<String, String>,
}

/// A line of `results.jsonl` and a file in `outcomes`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ResultRecord {
    pub(crate) number: u64,
    /// Fingerprint of the task that this is the result of.
    pub(crate) task: String,
    pub(crate) outcome: Outcome,
    /// Time at which it ended \[s since 1970\].
    pub(crate) ended: u64,
}

impl ResultRecord {
    pub(crate) fn new(spec: &CampaignSpec, task: &Task, outcome: Outcome) -> Self {
        let fingerprint = seal::hex(spec.fingerprint(task));
        Self { number: task.number, task: fingerprint, outcome, ended: machine::now_s() }
    }
}

impl Record {
    pub(crate) fn new(dir: &Path, spec: &CampaignSpec, extra: &BTreeMap<String, Vec<u8>>) -> Self {
        let mut digest = seal::Digest::new();
        digest.add(dir.as_os_str().as_encoded_bytes());
        digest.add(machine::host().as_bytes());
        digest.add(&std::process::id().to_le_bytes());
        let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        digest.add(&time.map_or(0, |time| time.as_nanos()).to_le_bytes());
        let files =
            extra.iter().map(|(name, text)| (name.clone(), seal::hex(seal::checksum(text))));
        let id = seal::hex(digest.finish());
        Self { format: FORMAT, id, spec: spec.clone(), files: files.collect() }
    }

    pub(crate) fn write(&self, dir: &Path) -> Result<(), CampaignError> {
        files::write_sealed(&dir.join(RECORD), self)
    }

    /// Same as [`read`](Self::read), for a directory that may not hold a campaign at all.
    pub(crate) fn read_present(dir: &Path) -> Result<Self, CampaignError> {
        if !dir.join(RECORD).exists() && !dir.join(TASKS).exists() {
            return Err(CampaignError::NotACampaign { dir: dir.to_path_buf() });
        }
        Self::read(dir)
    }

    pub(crate) fn read(dir: &Path) -> Result<Self, CampaignError> {
        #[derive(Deserialize)]
        struct Any {
            format: u64,
        }
        let path = dir.join(RECORD);
        let damaged = |what: String| CampaignError::Damaged { file: path.clone(), what };
        if path.is_dir() {
            return Err(damaged("it is a directory".into()));
        }
        let text = files::read(&path)?.ok_or_else(|| damaged("it is not there".into()))?;
        let Any { format } = seal::unseal(&text).map_err(damaged)?;
        if format != FORMAT {
            let (found, expected) = (format, FORMAT);
            return Err(CampaignError::Format { file: path, found, expected });
        }
        let record: Self = seal::unseal(&text).map_err(damaged)?;
        record.spec.check()?;
        Ok(record)
    }
}
