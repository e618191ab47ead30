//! Archives that may come from anybody: read into a folder of their own, or refused with what is wrong with them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::Path;

use sha2::{Digest as _, Sha256};
use zip::{CompressionMethod, ZipArchive};

use super::description::{DESCRIPTION, RESULTS, sums as sums_listed};
use super::names::{Names, checked_name};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::output::INPUTS;
use crate::output::checksums::hex;
use crate::plan::shell_word;

/// What an archive may ask of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Size of the file itself \[bytes\].
    pub packed: u64,
    /// Size of all that it holds \[bytes\].
    pub unpacked: u64,
    /// Number of its files.
    pub files: usize,
    /// How many times larger a file of more than a MiB may be than it is packed: tables of numbers reach about five, nothing
    /// more than 1032 in this format.
    pub ratio: u64,
    /// How many times larger all files together may be than the archive.
    pub total_ratio: u64,
    /// Size of all files together up to which that does not count \[bytes\].
    pub small: u64,
}

impl Default for Limits {
    fn default() -> Self {
        let (ratio, total_ratio, small) = (200, 20, 64 << 20);
        Self { packed: 2 << 30, unpacked: 4 << 30, files: 10_000, ratio, total_ratio, small }
    }
}

/// From which size on the ratio of a file counts \[bytes\].
const SMALL: u64 = 1 << 20;

impl Limits {
    /// The largest size of a file that is packed in so many bytes.
    pub(super) fn of_file(&self, packed: u64) -> u64 {
        SMALL.max(self.ratio.saturating_mul(packed))
    }

    /// The largest size of all files of an archive of so many bytes.
    pub(super) fn of_all(&self, packed: u64) -> u64 {
        self.unpacked.min(self.small.max(self.total_ratio.saturating_mul(packed)))
    }
}

/// An archive that was read: its files and their sums.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unpacked {
    /// SHA-256 by name.
    pub sums: BTreeMap<String, String>,
}

/// Reads an archive into an empty folder.
///
/// # Errors
///
/// [`Failure::Input`] for what is no archive of a calibration, is damaged, or would write outside, over or beyond its limits; then the
/// folder holds a part of it at most. [`Failure::Run`] for a folder that cannot be written.
pub fn unpack(archive: &Path, folder: &Path, limits: &Limits) -> Result<Unpacked, Failure> {
    let place = archive.display().to_string();
    let unreadable = |error: io::Error| match error.kind() {
        io::ErrorKind::NotFound => InputError::new(&place, Mistake::MissingFile)
            .found("no such file")
            .expected("an archive that calibrate archive wrote"),
        _ => InputError::new(&place, Mistake::Unreadable)
            .found(format_args!("cannot be read: {error}")),
    };
    let file = File::open(archive).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(InputError::new(&place, Mistake::Unreadable)
            .found("a folder")
            .expected("an archive that calibrate archive wrote")
            .help(format_args!("to pack a run: calibrate archive {} run.zip", shell_word(&place)))
            .into());
    }
    let reader = Reader { place: &place, folder, limits };
    reader.check(
        metadata.len() <= limits.packed,
        "an archive that is too large",
        &limits.packed,
    )?;
    let mut zip = ZipArchive::new(file).map_err(|error| reader.damaged(&error.to_string()))?;
    reader.check(zip.len() <= limits.files, "an archive of too many files", &limits.files)?;
    if zip.has_duplicate_names() {
        return Err(reader.hostile("two files of the same name").into());
    }
    let sums = reader.all(&mut zip, limits.of_all(metadata.len()))?;
    reader.compare(&sums)?;
    Ok(Unpacked { sums })
}

/// The error of an archive that this program did not write.
pub(super) fn hostile(place: &str, found: &str) -> InputError {
    InputError::new(place, Mistake::NotOurs)
        .found(found)
        .expected("an archive that calibrate archive wrote, as it was written")
        .help("nothing of it was run; ask whoever sent it for another")
}

struct Reader<'a> {
    place: &'a str,
    folder: &'a Path,
    limits: &'a Limits,
}

impl Reader<'_> {
    fn hostile(&self, found: &str) -> InputError {
        hostile(self.place, found)
    }

    fn damaged(&self, why: &str) -> InputError {
        InputError::new(self.place, Mistake::Damaged)
            .found(format_args!("a damaged archive, or no archive ({why})"))
            .expected("an archive that calibrate archive wrote")
            .help("copy it again")
    }

    fn check(
        &self,
        holds: bool,
        found: &str,
        limit: &dyn std::fmt::Display,
    ) -> Result<(), InputError> {
        if holds { Ok(()) } else { Err(self.hostile(&format!("{found} (the limit is {limit})"))) }
    }

    /// Reads every file; gives their sums.
    fn all(
        &self,
        zip: &mut ZipArchive<File>,
        mut left: u64,
    ) -> Result<BTreeMap<String, String>, Failure> {
        let mut sums = BTreeMap::new();
        let mut names = Names::default();
        for index in 0..zip.len() {
            let mut file = zip.by_index(index).map_err(|error| self.damaged(&error.to_string()))?;
            let raw = file.name_raw().to_vec();
            let shown = String::from_utf8_lossy(&raw).into_owned();
            let name = checked_name(&raw)
                .map_err(|what| self.hostile(&format!("{what}: \"{shown}\"")))?
                .to_owned();
            names.add(&name).map_err(|what| self.hostile(&format!("{what}: \"{name}\"")))?;
            const KIND: u32 = 0o170_000;
            let kind = file.unix_mode().unwrap_or(0) & KIND;
            if file.is_symlink() || ![0, 0o100_000, 0o040_000].contains(&kind) {
                return Err(self
                    .hostile(&format!("\"{name}\", which is a link or a device and no file"))
                    .into());
            }
            if name.ends_with('/') {
                continue;
            }
            let ours = name == DESCRIPTION
                || [RESULTS, INPUTS].iter().any(|top| name.starts_with(&format!("{top}/")));
            if !ours {
                return Err(self
                    .hostile(&format!("\"{name}\", which is neither a result nor an input"))
                    .into());
            }
            let known = [CompressionMethod::Stored, CompressionMethod::Deflated];
            if file.encrypted() || !known.contains(&file.compression()) {
                return Err(self
                    .hostile(&format!("\"{name}\", packed in another way than this program packs"))
                    .into());
            }
            let most = left.min(self.limits.of_file(file.compressed_size()));
            let executable = file.unix_mode().is_some_and(|mode| mode & 0o111 != 0);
            let (length, sum) = self.one(&name, &mut file, most, executable)?;
            left -= length;
            sums.insert(name, sum);
        }
        Ok(sums)
    }

    /// Reads one file, of at most so many bytes: counted as they come, whatever its header says.
    fn one(
        &self,
        name: &str,
        file: &mut impl io::Read,
        most: u64,
        executable: bool,
    ) -> Result<(u64, String), Failure> {
        let path = self.folder.join(name);
        let unwritten = |error: io::Error| {
            RunError::new(format_args!("{}: cannot be written: {error}", path.display()))
                .help("make room on the disk")
        };
        fs::create_dir_all(path.parent().unwrap_or(self.folder)).map_err(unwritten)?;
        let mut out = File::create_new(&path).map_err(unwritten)?;
        let (mut digest, mut length) = (Sha256::new(), 0);
        let mut piece = vec![0; 1 << 16];
        loop {
            let got = file
                .read(&mut piece)
                .map_err(|error| self.damaged(&format!("\"{name}\": {error}")))?;
            if got == 0 {
                break;
            }
            length += got as u64;
            if length > most {
                return Err(self
                    .hostile(&format!("\"{name}\", which unpacks to more than {most} bytes"))
                    .into());
            }
            digest.update(&piece[..got]);
            out.write_all(&piece[..got]).map_err(unwritten)?;
        }
        if executable {
            make_executable(&out).map_err(unwritten)?;
        }
        Ok((length, hex(&digest.finalize())))
    }

    /// Holds the files against the description: each is listed with its sum, and all that are listed are there.
    fn compare(&self, sums: &BTreeMap<String, String>) -> Result<(), InputError> {
        let mut text = String::new();
        let listed = File::open(self.folder.join(DESCRIPTION))
            .and_then(|file| file.take(64 << 20).read_to_string(&mut text))
            .ok()
            .and_then(|_| sums_listed(&text));
        let Some(listed) = listed else {
            return Err(self.damaged(&format!("without a {DESCRIPTION} that lists its files")));
        };
        let listed: BTreeMap<String, String> = listed.into_iter().collect();
        for (name, sum) in &listed {
            match sums.get(name) {
                None => return Err(self.damaged(&format!("\"{name}\" is listed and not there"))),
                Some(own) if own != sum => {
                    return Err(self.damaged(&format!("\"{name}\" is not what its SHA-256 says")));
                }
                Some(_) => {}
            }
        }
        match sums.keys().find(|name| *name != DESCRIPTION && !listed.contains_key(*name)) {
            Some(name) => {
                Err(self.hostile(&format!("\"{name}\", which its description does not list")))
            }
            None => Ok(()),
        }
    }
}

#[cfg(unix)]
fn make_executable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    file.set_permissions(fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn make_executable(_file: &File) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests;
