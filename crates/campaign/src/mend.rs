//! Repair of a directory when it is opened: its record, its folders and the caller's files.

use std::collections::BTreeMap;
use std::path::Path;

use crate::error::{CampaignError, Damage};
use crate::folder::{ITERATIONS, OUTCOMES, RECORD, RESULTS, TASKS, WORK};
use crate::record::Record;
use crate::spec::CampaignSpec;
use crate::{durable, files, seal};

/// A specification and files with which damaged ones are replaced.
pub(crate) type Given<'a> = Option<(&'a CampaignSpec, &'a BTreeMap<String, Vec<u8>>)>;

/// A directory whose record, folders and files are in order.
#[derive(Debug)]
pub(crate) struct Mended {
    pub(crate) record: Record,
    /// The caller's files that are whole.
    pub(crate) extra: BTreeMap<String, Vec<u8>>,
    /// Damage that was found and mended.
    pub(crate) damage: Vec<Damage>,
    /// Whether the directory is a copy of another one.
    pub(crate) copied: bool,
}

/// Sets aside what is damaged, replaces it by what is given, and makes folders that are not there.
pub(crate) fn mend(dir: &Path, given: Given<'_>) -> Result<Mended, CampaignError> {
    let mut damage = Vec::new();
    for name in [RECORD, TASKS, RESULTS] {
        let file = dir.join(name);
        if file.is_symlink() {
            return Err(CampaignError::Damaged { file, what: "it is a link".to_owned() });
        }
    }
    let (mut record, mut rewrite) = match (Record::read(dir), given) {
        (Ok(record), _) => (record, false),
        (Err(CampaignError::Damaged { file, what }), Some((spec, extra))) => {
            damage.push(away(&file, &what)?);
            (Record::new(dir, spec, extra), true)
        }
        (Err(error), _) => return Err(error),
    };
    mend_folders(dir, &mut damage)?;
    let mut extra = BTreeMap::new();
    rewrite |= settle_replaced(dir, &mut record)?;
    for (name, sum) in &record.files.clone() {
        let path = dir.join(name);
        if let Some(contents) = whole(&path, sum)? {
            extra.insert(name.clone(), contents);
            continue;
        }
        damage.push(away(&path, "its checksum does not fit")?);
        if let Some(contents) = given.and_then(|(_, extra)| extra.get(name)) {
            files::write(&path, contents)?;
            record.files.insert(name.clone(), seal::hex(seal::checksum(contents)));
            rewrite = true;
            extra.insert(name.clone(), contents.clone());
        }
    }
    let copied = record.is_of_another(dir);
    if record.settle(dir) || rewrite {
        record.write(dir)?;
    }
    Ok(Mended { record, extra, damage, copied })
}

/// The contents of a file, if they have this checksum.
fn whole(path: &Path, sum: &str) -> Result<Option<Vec<u8>>, CampaignError> {
    let contents = if path.is_dir() { None } else { files::read(path)? };
    Ok(contents.filter(|contents| seal::hex(seal::checksum(contents)) == sum))
}

/// Takes files that a driver has replaced before it was killed for the new ones; whether the record has changed.
fn settle_replaced(dir: &Path, record: &mut Record) -> Result<bool, CampaignError> {
    let replacing = std::mem::take(&mut record.replacing);
    for (name, sum) in &replacing {
        if whole(&dir.join(name), sum)?.is_some() {
            record.files.insert(name.clone(), sum.clone());
        }
    }
    Ok(!replacing.is_empty())
}

fn mend_folders(dir: &Path, damage: &mut Vec<Damage>) -> Result<(), CampaignError> {
    for name in [OUTCOMES, ITERATIONS, WORK] {
        let path = dir.join(name);
        // A link to a folder elsewhere is none of this campaign's.
        if path.is_symlink() || !path.is_dir() {
            damage.push(away(&path, "it is not a directory of its own")?);
            files::make_folder(&path)?;
        }
        durable::remove_stale(&path);
    }
    durable::remove_stale(dir);
    Ok(())
}

/// Sets aside what is at `path`, for the reason given, if anything is there.
fn away(path: &Path, what: &str) -> Result<Damage, CampaignError> {
    if path.symlink_metadata().is_ok() {
        files::set_aside(path, what)
    } else {
        Ok(Damage::of(path, "it is not there"))
    }
}
