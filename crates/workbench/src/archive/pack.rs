//! A calibration as one file.

use std::collections::BTreeSet;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use super::description::{DESCRIPTION, Entry, RESULTS, describe};
use super::names::{Names, Places, checked_name};
use super::unpack::{Limits, unpack};
use crate::calibration::read_stored;
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file::folder_of;
use crate::output::checksums::FILE_NAME as SUMS;
use crate::output::inputs::{FILE_NAME, InputFile, Inputs};
use crate::output::{CAMPAIGN, INPUTS, on_one_line, pretty, write_file};
use crate::plan::{PLAN, PROGRAM, Plan};
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

/// Packs the calibration in a folder, with the files that it was made of, into `out`. The same folder gives the same bytes, and
/// what is written can be opened by [`reproduce`](super::reproduce).
///
/// # Errors
///
/// [`Failure::Input`] for a folder without a calibration, for a file of its programs that is not there or has changed since, and
/// for a plan whose programs could not be run again of an archive; [`Failure::Run`] for a file that cannot be written.
pub fn pack(run: &Path, out: &Path) -> Result<Packed, Failure> {
    let record = record::read(run)?;
    let file = record::locate(run);
    let folder = folder_of(&file);
    let mut packing = Packing { members: Vec::new(), names: Names::default(), notes: Vec::new() };
    packing.names.add(DESCRIPTION).map_err(RunError::new)?;
    packing.results(folder, &file, out)?;
    let plan_folder = match folder.join(CAMPAIGN).is_dir() {
        true => folder_of(&read_stored(folder)?.file).to_owned(),
        false => PathBuf::new(),
    };
    match Inputs::read(folder)? {
        None => packing.notes.push(
            "its input files are not noted and not packed: an earlier version began this run"
                .to_owned(),
        ),
        Some(inputs) => packing.inputs(&inputs, &record.plan, &plan_folder)?,
    }
    let Packing { mut members, notes, .. } = packing;
    let entries: Vec<&Entry> = members.iter().map(|member| &member.entry).collect();
    let written = crate::output::date::written(&file);
    let description = pretty(&describe(&record, &entries, written))?.into_bytes();
    let entry = Entry::of(DESCRIPTION.to_owned(), &description, "description");
    members.insert(0, Member { entry, bytes: description, executable: false });
    let bytes = zipped(&members).and_then(|bytes| openable(bytes, &members)).map_err(|error| {
        RunError::new(format_args!("{}: cannot be packed: {error}", out.display()))
    })?;
    write_file(out, &bytes)?;
    Ok(Packed { files: members.len(), bytes: bytes.len() as u64, notes })
}

/// What goes into an archive.
struct Packing {
    members: Vec<Member>,
    names: Names,
    notes: Vec<String>,
}

impl Packing {
    /// The files of the results: those of the folder itself, not the runs of programs, hidden ones, or the archive.
    fn results(&mut self, folder: &Path, record: &Path, out: &Path) -> Result<(), Failure> {
        let refused = |error| {
            InputError::new(folder.display().to_string(), Mistake::Unreadable)
                .found(format_args!("cannot be read: {error}"))
        };
        let archive = fs::canonicalize(out).ok();
        let mut paths = Vec::new();
        for entry in fs::read_dir(folder).map_err(refused)? {
            let entry = entry.map_err(refused)?;
            let is_file = entry.file_type().map_err(refused)?.is_file();
            let hidden = entry.file_name().to_string_lossy().starts_with('.');
            let is_archive = archive.is_some() && fs::canonicalize(entry.path()).ok() == archive;
            if is_file && !hidden && !is_archive {
                paths.push(entry.path());
            }
        }
        // Files of the run come before those of others that cannot be beside them.
        let of_run = [record::FILE_NAME, FILE_NAME, SUMS, "samples.csv", "draws.csv"];
        let later =
            |path: &PathBuf| !of_run.iter().any(|name| path.file_name() == Some(name.as_ref()));
        paths.sort_by_key(|path| (path != record, later(path), path.clone()));
        for path in paths {
            // A record may have another name, as it was named.
            let name = if path == record {
                Some(record::FILE_NAME)
            } else {
                path.file_name().and_then(|name| name.to_str())
            };
            let name = name.map(|name| format!("{RESULTS}/{name}"));
            let name = name.ok_or("a name that is not UTF-8").and_then(|name| {
                checked_name(name.as_bytes())?;
                self.names.add(&name).map(|()| name)
            });
            match name {
                Ok(name) => self.add(name, read(&path)?, "result", false),
                Err(why) => self.notes.push(left_out(&path.display().to_string(), why)),
            }
        }
        Ok(())
    }

    /// The files that the run was made of; names begin at `folder`.
    fn inputs(&mut self, inputs: &Inputs, plan: &Plan, folder: &Path) -> Result<(), InputError> {
        let of_programs = plan.commands().next().is_some();
        if of_programs {
            check_calls(plan, folder)?;
        }
        let places = Places::of(inputs);
        for input in &inputs.files {
            let InputFile { name, role, sha256, .. } = input;
            let needed = of_programs && [PLAN, PROGRAM].contains(&role.as_str());
            if role == PROGRAM && Path::new(name).is_absolute() {
                self.notes
                    .push(format!("{name} is not in it, but its sum: a program of this machine"));
                continue;
            }
            let path = folder.join(name);
            let refused = |found: &str| {
                InputError::new(path.display().to_string(), Mistake::MissingFile)
                    .found(found)
                    .expected(format_args!(
                        "the {role} that the run was made with, SHA-256 {sha256}"
                    ))
            };
            let there = path.is_file();
            let is_it = there.then(|| read(&path)).transpose()?.filter(|bytes| {
                let entry = Entry::of(String::new(), bytes, role);
                entry.has_sum(sha256)
            });
            let Some(bytes) = is_it else {
                let found =
                    if there { "has changed since the run" } else { "is not there any more" };
                if needed {
                    return Err(refused(found)
                        .help("put the former one back: without it nothing can be reproduced"));
                }
                self.notes.push(format!(
                    "{name} ({role}) is not in it, as it {found}; what was read of it is in posterior.json"
                ));
                continue;
            };
            let place = places.place(name).and_then(|place| {
                let place = format!("{INPUTS}/{place}");
                self.names.add(&place).map(|()| place)
            });
            match place {
                Ok(place) => self.add(place, bytes, role, is_executable(&path)),
                Err(why) if needed => {
                    return Err(refused(why).help(
                        "give it another name or place, and run the plan again with another --out",
                    ));
                }
                Err(why) => self.notes.push(left_out(&format!("{name} ({role})"), why)),
            }
        }
        Ok(())
    }

    fn add(&mut self, name: String, bytes: Vec<u8>, role: &str, executable: bool) {
        self.members.push(Member { entry: Entry::of(name, &bytes, role), bytes, executable });
    }
}

fn left_out(name: &str, why: &str) -> String {
    format!("{} is not in it, as not every system can have it: {why}", on_one_line(name))
}

/// Refuses programs that name files by whole paths, which are only on this machine. That of a program itself may be whole: it is
/// one of the machine, and known by its sum.
fn check_calls(plan: &Plan, folder: &Path) -> Result<(), InputError> {
    let refused = |experiment: &str, word: &str| {
        InputError::new(&plan.name, Mistake::Conflict)
            .in_field(format_args!("experiments.{experiment}"))
            .found(format_args!("{}, which is on this machine alone", on_one_line(word)))
            .expected("names that begin at the folder of the plan, as {plan_dir}/run.sh")
            .help("name it so in the plan, and run it again with another --out: such files are packed")
    };
    let own = folder.display().to_string();
    for (_, experiment, call) in plan.commands() {
        let given = call.files.iter().map(|file| &file.from);
        let given = given.filter(|from| Path::new(from).is_absolute());
        let words = call.argv.iter().skip(1).chain(call.environment.values());
        let whole = |word: &&String| {
            let path = Path::new(word);
            (!own.is_empty() && word.contains(&own)) || (path.is_absolute() && path.is_file())
        };
        if let Some(word) = given.chain(words.filter(whole)).next() {
            return Err(refused(&experiment.name, word));
        }
        let program = call.argv.first().filter(|program| {
            Path::new(program).is_absolute() && Path::new(program).starts_with(folder)
        });
        if let Some(program) = program {
            return Err(refused(&experiment.name, program));
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<Vec<u8>, InputError> {
    fs::read(path).map_err(|error| {
        InputError::new(path.display().to_string(), Mistake::Unreadable)
            .found(format_args!("cannot be read: {error}"))
    })
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

type Zipped = Result<Vec<u8>, Box<dyn std::error::Error>>;

/// The members as a ZIP file. Those that would pass for a bomb, as they grow to hundreds of times their packed size, are not made
/// smaller.
fn zipped(members: &[Member]) -> Zipped {
    let limits = Limits::default();
    let bytes = zipped_without(members, &|_| false)?;
    let mut zip = ZipArchive::new(Cursor::new(&bytes))?;
    let (mut as_they_are, mut all) = (BTreeSet::new(), 0);
    for index in 0..zip.len() {
        let file = zip.by_index_raw(index)?;
        all += file.size();
        if file.size() > limits.of_file(file.compressed_size()) {
            as_they_are.insert(index);
        }
    }
    if all > limits.of_all(bytes.len() as u64) {
        return zipped_without(members, &|_| true);
    }
    match as_they_are.is_empty() {
        true => Ok(bytes),
        false => zipped_without(members, &|place| as_they_are.contains(&place)),
    }
}

/// The members as a ZIP file, some of them as they are.
fn zipped_without(members: &[Member], as_it_is: &dyn Fn(usize) -> bool) -> Zipped {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (place, Member { entry, bytes, executable }) in members.iter().enumerate() {
        let method = match as_it_is(place) {
            true => CompressionMethod::Stored,
            false => CompressionMethod::Deflated,
        };
        let options = SimpleFileOptions::default()
            .compression_method(method)
            .last_modified_time(DateTime::default())
            .unix_permissions(if *executable { 0o755 } else { 0o644 });
        zip.start_file(entry.id.as_str(), options)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// An archive that opens as [`reproduce`](super::reproduce) opens it.
fn openable(bytes: Vec<u8>, members: &[Member]) -> Zipped {
    let folder = tempfile::tempdir()?;
    let (file, into) = (folder.path().join("run.zip"), folder.path().join("run"));
    fs::write(&file, &bytes)?;
    fs::create_dir(&into)?;
    match unpack(&file, &into, &Limits::default()) {
        Ok(unpacked) if unpacked.sums.len() == members.len() => Ok(bytes),
        Ok(_) => Err("files of it are lost".into()),
        Err(Failure::Input(error)) => {
            Err(error.found.as_ref().map_or_else(|| error.to_string(), ToString::to_string).into())
        }
        Err(error) => Err(error.to_string().into()),
    }
}

#[cfg(test)]
mod tests;
