//! A calibration as one file.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Component, Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::description::{DESCRIPTION, Entry, INPUTS, RESULTS, describe};
use super::unpack::checked_name;
use crate::calibration::read_stored;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file::folder_of;
use crate::output::inputs::{InputFile, Inputs, sum_of};
use crate::output::{CAMPAIGN, pretty, write_file};
use crate::record;

/// An archive that was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packed {
    /// Number of files.
    pub files: usize,
    /// Its size \[bytes\].
    pub bytes: u64,
    /// What is not in it, and why.
    pub notes: Vec<String>,
}

/// A file that goes into an archive.
struct Member {
    entry: Entry,
    bytes: Vec<u8>,
    executable: bool,
}

/// Packs the calibration in a folder, with the files that it was made of, into `out`. The same folder gives the same bytes.
///
/// # Errors
///
/// [`Failure::Input`] for a folder without a calibration, and for a file of its programs that is not there or has changed since;
/// [`Failure::Run`] for a file that cannot be written.
pub fn pack(run: &Path, out: &Path) -> Result<Packed, Failure> {
    let record = record::read(run)?;
    let file = record::locate(run);
    let folder = folder_of(&file);
    let mut members = Vec::new();
    for name in names_of_results(folder)? {
        let bytes = read(&folder.join(&name))?;
        let entry = Entry::of(format!("{RESULTS}/{name}"), &bytes, "result");
        members.push(Member { entry, bytes, executable: false });
    }
    let plan_folder = match folder.join(CAMPAIGN).is_dir() {
        true => folder_of(&read_stored(folder)?.file).to_owned(),
        false => PathBuf::new(),
    };
    let of_programs = record.plan.commands().next().is_some();
    let mut notes = Vec::new();
    match Inputs::read(folder)? {
        None => notes.push("its files are not noted: it was made by an earlier version".to_owned()),
        Some(inputs) => {
            for input in inputs.files {
                match member(&input, &plan_folder, of_programs)? {
                    Ok(member) => members.push(member),
                    Err(note) => notes.push(note),
                }
            }
        }
    }
    let entries: Vec<&Entry> = members.iter().map(|member| &member.entry).collect();
    let written = crate::output::date::written(&file);
    let description = pretty(&describe(&record, &entries, written))?.into_bytes();
    let entry = Entry::of(DESCRIPTION.to_owned(), &description, "description");
    members.insert(0, Member { entry, bytes: description, executable: false });
    let bytes = zipped(&members).map_err(|error| {
        RunError::new(format_args!("{}: cannot be packed: {error}", out.display()))
    })?;
    write_file(out, &bytes)?;
    Ok(Packed { files: members.len(), bytes: bytes.len() as u64, notes })
}

/// Names of the files of the results, in order: those of the folder itself, not the runs of programs, nor hidden ones.
fn names_of_results(folder: &Path) -> Result<Vec<String>, InputError> {
    let refused = |error| {
        InputError::new(folder.display().to_string(), Mistake::Unreadable)
            .found(format_args!("cannot be read: {error}"))
    };
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let is_file = entry.file_type().map_err(refused)?.is_file();
        let name = entry.file_name();
        names.extend(
            name.to_str().filter(|name| is_file && !name.starts_with('.')).map(str::to_owned),
        );
    }
    names.sort();
    Ok(names)
}

fn read(path: &Path) -> Result<Vec<u8>, InputError> {
    fs::read(path).map_err(|error| {
        InputError::new(path.display().to_string(), Mistake::Unreadable)
            .found(format_args!("cannot be read: {error}"))
    })
}

/// An input as a member, or the reason why it is left out.
fn member(
    input: &InputFile,
    folder: &Path,
    of_programs: bool,
) -> Result<Result<Member, String>, InputError> {
    let InputFile { name, role, sha256, .. } = input;
    let path = folder.join(name);
    let Some(place) = place_of(name) else {
        return Ok(Err(format!(
            "{name} ({role}) is not in it: only its name and sum are, as it is not below the plan or the folder that the command was given in"
        )));
    };
    let is_it = sum_of(&path).is_ok_and(|(_, sum)| sum == *sha256);
    if !is_it && of_programs {
        let found =
            if path.is_file() { "has changed since the run" } else { "is not there any more" };
        return Err(InputError::new(path.display().to_string(), Mistake::MissingFile)
            .found(found)
            .expected(format_args!("the {role} that the run was made with, SHA-256 {sha256}"))
            .help("put the former one back: without it nothing can be reproduced"));
    }
    if !is_it {
        return Ok(Err(format!(
            "{name} ({role}) is not in it, as it is not there or has changed since; what was read of it is in posterior.json"
        )));
    }
    let bytes = read(&path)?;
    let entry = Entry::of(format!("{INPUTS}/{place}"), &bytes, role);
    Ok(Ok(Member { entry, bytes, executable: is_executable(&path) }))
}

/// The place of an input in the archive; none for a name that leads out of the folder.
fn place_of(name: &str) -> Option<String> {
    let parts: Option<Vec<&str>> = Path::new(name)
        .components()
        .filter(|part| !matches!(part, Component::CurDir))
        .map(|part| match part {
            Component::Normal(part) => part.to_str(),
            _ => None,
        })
        .collect();
    let place = parts?.join("/");
    checked_name(place.as_bytes()).is_ok().then_some(place)
}

#[cfg(unix)]
fn is_executable(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    path.metadata().is_ok_and(|metadata| metadata.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_executable(_path: &Path) -> bool {
    false
}

fn zipped(members: &[Member]) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for Member { entry, bytes, executable } in members {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(if *executable { 0o755 } else { 0o644 });
        zip.start_file(entry.id.as_str(), options)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}
