//! Directories in which a campaign may be made: empty, or left by a creation that was cut off.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::durable::TEMPORARY;
use crate::error::CampaignError;
use crate::folder::{ITERATIONS, LOCK, OUTCOMES, RECORD, RESULTS, SLURM, TASKS, WORK, WORKERS};

/// Checks the names of the caller's files: plain, and none that the campaign uses itself.
pub(crate) fn check_names<T>(extra: &BTreeMap<String, T>) -> Result<(), CampaignError> {
    let ours = [RECORD, TASKS, RESULTS, OUTCOMES, ITERATIONS, WORK, WORKERS, LOCK, SLURM];
    for name in extra.keys() {
        let plain = !name.contains(['/', '\\', '\0']) && !name.starts_with('.') && !name.is_empty();
        if !plain || ours.contains(&name.as_str()) {
            return Err(CampaignError::FileName { name: name.clone() });
        }
    }
    Ok(())
}

/// Files of an earlier, unfinished creation, except the lock; refuses a directory with anything else.
pub(crate) fn unfinished(
    dir: &Path,
    extra: &BTreeMap<String, Vec<u8>>,
) -> Result<Vec<PathBuf>, CampaignError> {
    let failed = |error| CampaignError::io("made", dir, error);
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let ours = [LOCK, TASKS, RESULTS, OUTCOMES, ITERATIONS, WORK].contains(&&*name)
            || extra.contains_key(&*name)
            || name.starts_with(TEMPORARY);
        if !ours {
            return Err(CampaignError::Exists { dir: dir.to_path_buf() });
        }
        if name != LOCK {
            found.push(entry.path());
        }
    }
    Ok(found)
}

/// Removes what an earlier creation left; refuses a directory with anything else.
pub(crate) fn clear_unfinished(
    dir: &Path,
    extra: &BTreeMap<String, Vec<u8>>,
) -> Result<(), CampaignError> {
    for path in unfinished(dir, extra)? {
        // Without its record nothing was ever run here: the folders are empty.
        let removed = if path.is_dir() { fs::remove_dir(&path) } else { fs::remove_file(&path) };
        removed.map_err(|_| CampaignError::Exists { dir: dir.to_path_buf() })?;
    }
    Ok(())
}
