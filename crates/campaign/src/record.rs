//! The records that make up a campaign: what is run, and how a run ended.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::CampaignError;
use crate::folder::{RECORD, TASKS};
use crate::outcome::Outcome;
use crate::spec::CampaignSpec;
use crate::task::Task;
use crate::{create, files, machine, seal};

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
    /// Checksums of files that are being replaced: such a file is whole as it was and as it will be.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(crate) replacing: BTreeMap<String, String>,
    /// The directory that it was written in, by which a copy is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    place: Option<Place>,
}

/// A directory as the file system knows it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Place {
    path: String,
    device: u64,
    inode: u64,
}

impl Place {
    /// None where the system has no such numbers.
    fn of(dir: &Path) -> Option<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let there = dir.metadata().ok()?;
            let path = dir.to_string_lossy().into_owned();
            Some(Self { path, device: there.dev(), inode: there.ino() })
        }
        #[cfg(not(unix))]
        {
            let _ = dir;
            None
        }
    }

    /// Whether both are the same directory. It may have been renamed; and another machine may see the same file system
    /// under another device number.
    fn is_same(&self, other: &Self) -> bool {
        self.inode == other.inode && (self.device == other.device || self.path == other.path)
    }
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
        let files =
            extra.iter().map(|(name, text)| (name.clone(), seal::hex(seal::checksum(text))));
        let (id, place) = (Self::new_id(dir), Place::of(dir));
        let (files, replacing) = (files.collect(), BTreeMap::new());
        Self { format: FORMAT, id, spec: spec.clone(), files, replacing, place }
    }

    fn new_id(dir: &Path) -> String {
        let mut digest = seal::Digest::new();
        digest.add(dir.as_os_str().as_encoded_bytes());
        digest.add(machine::host().as_bytes());
        digest.add(&std::process::id().to_le_bytes());
        let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        digest.add(&time.map_or(0, |time| time.as_nanos()).to_le_bytes());
        seal::hex(digest.finish())
    }

    /// Whether it was written in another directory than `dir`, which then is a copy.
    pub(crate) fn is_of_another(&self, dir: &Path) -> bool {
        let (written, here) = (self.place.as_ref(), Place::of(dir));
        written.zip(here.as_ref()).is_some_and(|(written, here)| !written.is_same(here))
    }

    /// Makes it the record of `dir`, with a name of its own where that is a copy; whether anything changed.
    pub(crate) fn settle(&mut self, dir: &Path) -> bool {
        if self.is_of_another(dir) {
            self.id = Self::new_id(dir);
        }
        let here = Place::of(dir);
        let changed = self.place != here;
        self.place = here;
        changed
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
        // A record that came from elsewhere must not lead to other files.
        create::check_names(&record.files)?;
        create::check_names(&record.replacing)?;
        Ok(record)
    }
}
