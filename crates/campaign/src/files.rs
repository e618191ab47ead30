//! The files of a campaign: [`durable`] writes and bounded reads that say which file failed, and damaged files set aside.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::durable;
use crate::error::{CampaignError, Damage};
use crate::folder::number_of;
use crate::seal;

/// Largest file that is read \[bytes\].
const LARGEST_BYTES: u64 = 1 << 30;

/// Writes a file whole.
pub(crate) fn write(path: &Path, contents: &[u8]) -> Result<(), CampaignError> {
    durable::write(path, contents).map_err(|error| CampaignError::io("written", path, error))
}

/// Writes an object whole, as JSON with its checksum.
pub(crate) fn write_sealed<T: Serialize>(path: &Path, object: &T) -> Result<(), CampaignError> {
    let text = seal::seal_pretty(object)
        .map_err(|error| CampaignError::io("written", path, error.into()))?;
    write(path, &text)
}

/// Makes a folder and those it is in, where they are not there.
pub(crate) fn make_folder(path: &Path) -> Result<(), CampaignError> {
    fs::create_dir_all(path).map_err(|error| CampaignError::io("made", path, error))
}

/// Reads a file; none where it is not there.
pub(crate) fn read(path: &Path) -> Result<Option<Vec<u8>>, CampaignError> {
    let mut bytes = Vec::new();
    let read =
        File::open(path).and_then(|file| file.take(LARGEST_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 > LARGEST_BYTES => {
            let error = io::Error::other("it is larger than 1 GiB");
            Err(CampaignError::io("read", path, error))
        }
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(CampaignError::io("read", path, error)),
    }
}

/// Reads the sealed objects in a folder, each from the file of its number; `what` names an object: "iteration". Damaged
/// files are set aside and added to `damage`.
pub(crate) fn read_numbered<T: DeserializeOwned>(
    folder: &Path,
    what: &str,
    number: impl Fn(&T) -> u64,
    damage: &mut Vec<Damage>,
) -> Result<Vec<(PathBuf, T)>, CampaignError> {
    let failed = |error| CampaignError::io("read", folder, error);
    let mut objects = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let Some(expected) = number_of(&path) else { continue };
        if path.is_dir() {
            damage.push(set_aside(&path, "it is a directory")?);
            continue;
        }
        let Some(text) = read(&path)? else { continue };
        match seal::unseal(&text) {
            Ok(object) if number(&object) == expected => objects.push((path, object)),
            Ok(object) => {
                let problem = format!("it is {what} {}", number(&object));
                damage.push(set_aside(&path, problem)?);
            }
            Err(problem) => damage.push(set_aside(&path, problem)?),
        }
    }
    Ok(objects)
}

/// The first of `NAME.damaged-1`, `NAME.damaged-2`, ... that is free.
pub(crate) fn damaged_name(path: &Path) -> PathBuf {
    free_name(path, "damaged")
}

/// The first of `NAME.END-1`, `NAME.END-2`, ... that is free.
pub(crate) fn free_name(path: &Path, end: &str) -> PathBuf {
    let mut number = 1u64;
    loop {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".{end}-{number}"));
        let name = PathBuf::from(name);
        if name.symlink_metadata().is_err() {
            return name;
        }
        number += 1;
    }
}

/// Renames a damaged file, or what is in its place, and returns what the caller reports.
pub(crate) fn set_aside(path: &Path, what: impl Into<String>) -> Result<Damage, CampaignError> {
    let place = damaged_name(path);
    fs::rename(path, &place).map_err(|error| CampaignError::io("set aside", path, error))?;
    Ok(Damage { set_aside: Some(place), ..Damage::of(path, what) })
}
