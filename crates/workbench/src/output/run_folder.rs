//! The folder of a run: its results appear whole or not at all.
//!
//! A run is written into a hidden sibling of its folder (`results/.ps.tmp-PID`), flushed, and renamed
//! into place. What was there before is never touched until then:
//!
//! - nothing there: the folder appears, complete;
//! - a run of the same plan: the two folders change places in one step, and the old one is removed,
//!   unless it holds files that the new one does not (a user's notes): then it is kept;
//! - a run of another plan: it is kept as `ps.1`, `ps.2`, ...;
//! - anything else: refused before the run starts.
//!
//! A run of this program is recognised by its record, a JSON file with an object `plan`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use campaign::durable;
use serde_json::Value;

use super::CAMPAIGN;
use super::exchange::exchange;
use super::file::{plain, unwritable};
use crate::error::{InputError, Mistake, RunError};
use crate::input::text_file::folder_of;

/// A hidden folder of a run that was killed is removed when it is older than this: writing takes
/// seconds, and on a shared disk its process may live on another machine.
const STALE: Duration = Duration::from_secs(600);

/// A folder that results can be published to, checked before the run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    target: PathBuf,
    record: &'static str,
}

/// How the results came into place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Published {
    /// There was nothing before.
    New,
    /// A run of the same plan was replaced.
    Replaced,
    /// The old folder was kept under this name.
    MovedAside {
        /// Where it is now.
        kept: PathBuf,
        /// Whether the plans were the same, and the old folder was kept for files that the new one has not.
        same_plan: bool,
        /// Earlier runs that are kept by now, this one among them.
        earlier: usize,
    },
}

impl RunFolder {
    /// Checks that results can be written to `target`, without writing anything: the nearest existing
    /// folder takes files, and what is at `target` is nothing, an empty folder or a run of ours, with
    /// its `record`.
    ///
    /// # Errors
    ///
    /// [`InputError`] that names the folder, what is wrong with it and what to do.
    pub fn prepare(target: &Path, record: &'static str) -> Result<Self, InputError> {
        let name = target.display().to_string();
        if name.is_empty() {
            return Err(InputError::new("--out", Mistake::Unwritable)
                .found("an empty name")
                .expected("a folder, as in results/my-run"));
        }
        // A link to a folder stays a link: what it points to is replaced.
        if target.symlink_metadata().is_ok() && !target.exists() {
            return Err(InputError::new(&name, Mistake::Unwritable)
                .found("a link that leads nowhere")
                .expected("a folder for the results")
                .help("remove the link, or choose another folder with --out"));
        }
        let target = if target.exists() {
            fs::canonicalize(target).map_err(|error| unwritable(target, &error))?
        } else {
            target.to_path_buf()
        };
        if target.file_name().is_none() || target.is_file() {
            return Err(InputError::new(&name, Mistake::Unwritable)
                .found(if target.is_file() { "a file" } else { "not the name of a folder" })
                .expected("a folder for the results")
                .help("choose another with --out"));
        }
        let folder = Self { target, record };
        if folder.target.join(CAMPAIGN).is_dir() {
            return Err(InputError::new(&name, Mistake::NotOurs)
                .found("a folder that holds the runs of programs, which are not made again for nothing")
                .help("choose another folder with --out, or move this one away"));
        }
        if folder.occupied().map_err(|error| unwritable(&folder.target, &error))? {
            recorded_plan(&folder.target, record).map_err(|why| {
                InputError::new(&name, Mistake::NotOurs)
                    .found(format_args!("a folder that no run of this program wrote ({why})"))
                    .help("choose another folder with --out, or move this one away")
            })?;
        }
        folder.probe()?;
        Ok(folder)
    }

    /// The folder, with links resolved.
    pub fn path(&self) -> &Path {
        &self.target
    }

    /// Whether a run is there already.
    pub fn occupied(&self) -> io::Result<bool> {
        match fs::read_dir(&self.target) {
            Ok(mut entries) => Ok(entries.next().is_some()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(error),
        }
    }

    pub(crate) fn parent(&self) -> &Path {
        folder_of(&self.target)
    }

    pub(crate) fn name(&self) -> String {
        self.target.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    }

    /// Tries whether the nearest folder that exists takes files.
    fn probe(&self) -> Result<(), InputError> {
        let existing = self
            .parent()
            .ancestors()
            .map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder })
            .find(|folder| folder.symlink_metadata().is_ok())
            .unwrap_or(Path::new("."));
        tempfile::Builder::new()
            .prefix(".calibrate-probe-")
            .tempdir_in(existing)
            .and_then(tempfile::TempDir::close)
            .map_err(|error| unwritable(&self.target, &error))
    }

    /// Makes the hidden folder to write into, and removes those of runs that were killed.
    pub fn stage(&self) -> Result<Staging, RunError> {
        let failed = |error| failed(&self.target, "cannot be written", &error);
        fs::create_dir_all(self.parent()).map_err(failed)?;
        self.remove_stale();
        let path = self.parent().join(format!(".{}.tmp-{}", self.name(), std::process::id()));
        if path.exists() {
            // Left by a killed process that happened to have our number.
            fs::remove_dir_all(&path).map_err(failed)?;
        }
        fs::create_dir(&path).map_err(failed)?;
        Ok(Staging { folder: self.clone(), path })
    }

    fn remove_stale(&self) {
        let prefix = format!(".{}.tmp-", self.name());
        let Ok(entries) = fs::read_dir(self.parent()) else { return };
        for entry in entries.flatten() {
            let name = entry.file_name();
            let process = name.to_str().and_then(|name| name.strip_prefix(&prefix)?.parse().ok());
            let old = entry
                .metadata()
                .and_then(|metadata| metadata.modified())
                .is_ok_and(|modified| modified.elapsed().is_ok_and(|age| age > STALE));
            if let Some(process) = process
                && old
                && !is_running(process)
            {
                // Best effort: it is hidden and harmless.
                let _ = fs::remove_dir_all(entry.path());
            }
        }
    }

    /// The first of `NAME.1`, `NAME.2`, ... that is free.
    fn aside(&self) -> PathBuf {
        let mut number = 1u64;
        loop {
            let path = self.parent().join(format!("{}.{number}", self.name()));
            if path.symlink_metadata().is_err() {
                return path;
            }
            number += 1;
        }
    }
}

impl RunFolder {
    /// Number of folders `NAME.1`, `NAME.2`, ... beside the results.
    fn kept(&self) -> usize {
        let Ok(entries) = fs::read_dir(self.parent()) else { return 0 };
        let start = format!("{}.", self.name());
        let names = entries.flatten().map(|entry| entry.file_name());
        names
            .filter(|name| {
                let number = name.to_string_lossy().strip_prefix(&start).map(str::parse::<u64>);
                matches!(number, Some(Ok(1..)))
            })
            .count()
    }
}

/// A hidden folder that is being filled. Dropped without [`publish`](Self::publish) it disappears.
#[derive(Debug)]
pub struct Staging {
    folder: RunFolder,
    path: PathBuf,
}

impl Staging {
    /// The hidden folder, to write the files into.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file of the results, in a folder of its own where its name has one. `shown` is how messages call the
    /// results' folder.
    pub fn write(&self, shown: &Path, name: &str, bytes: &[u8]) -> Result<(), RunError> {
        let path = self.path.join(name);
        path.parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, bytes))
            .map_err(|error| {
                RunError::new(format_args!(
                    "{}: {name} cannot be written: {error}",
                    shown.display()
                ))
            })
    }

    /// A hidden folder in the folder of a calibration whose runs are kept there. Those of drivers that were killed are
    /// removed: the folder is this driver's alone.
    pub fn beside_runs(dir: &Path, record: &'static str) -> Result<Self, RunError> {
        let prefix = ".report.tmp-";
        for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(prefix) {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        let path = dir.join(format!("{prefix}{}", std::process::id()));
        fs::create_dir(&path).map_err(|error| failed(dir, "cannot be written", &error))?;
        Ok(Self { folder: RunFolder { target: dir.to_owned(), record }, path })
    }

    /// Flushes the files to disk and puts them beside the runs, the record last: while it is there, all others belong
    /// to it.
    ///
    /// # Errors
    ///
    /// [`RunError`]; without the record the folder is that of a run without results, which can be taken up again.
    pub fn publish_beside_runs(self) -> Result<Published, RunError> {
        let RunFolder { target, record } = &self.folder;
        let mut published = Published::New;
        let mut put = || -> io::Result<()> {
            durable::flush_tree(&self.path)?;
            match fs::remove_file(target.join(record)) {
                Ok(()) => published = Published::Replaced,
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
            for entry in fs::read_dir(&self.path)? {
                let name = entry?.file_name();
                if name.to_str() != Some(*record) {
                    fs::rename(self.path.join(&name), target.join(&name))?;
                }
            }
            flush_names(target);
            fs::rename(self.path.join(record), target.join(record))?;
            flush_names(target);
            Ok(())
        };
        put().map_err(|error| failed(target, "results cannot be put into place", &error))?;
        Ok(published)
    }

    /// Flushes the files to disk and renames the folder into place. The record must be among them.
    ///
    /// # Errors
    ///
    /// [`RunError`]; the old results are then still in place, or under the name that the message says.
    pub fn publish(self) -> Result<Published, RunError> {
        let RunFolder { target, record } = &self.folder;
        let failed = |error| failed(target, "cannot be put into place", &error);
        let new_plan = recorded_plan(&self.path, record).map_err(|why| {
            RunError::new(format_args!("{}: nothing to publish: {why}", target.display()))
        })?;
        durable::flush_tree(&self.path).map_err(failed)?;
        if !self.folder.occupied().map_err(failed)? {
            fs::rename(&self.path, target).map_err(failed)?;
            flush_names(self.folder.parent());
            return Ok(Published::New);
        }
        let old_plan = recorded_plan(target, record).map_err(|why| {
            RunError::new(format_args!(
                "{}: was changed by somebody else during the run ({why})",
                target.display()
            ))
            .help("choose another folder with --out")
        })?;
        let same_plan = old_plan == new_plan;
        if same_plan && contains_all(&self.path, target).map_err(failed)? {
            exchange(&self.path, target).map_err(failed)?;
            flush_names(self.folder.parent());
            // The hidden folder now holds the old run, and goes with `self`.
            return Ok(Published::Replaced);
        }
        // The new run first gets the free name and then changes places with the old one, so that
        // at every moment both are there under a name that nobody removes.
        let kept = self.folder.aside();
        fs::rename(&self.path, &kept).map_err(failed)?;
        exchange(&kept, target).map_err(|error| {
            RunError::new(format_args!(
                "{}: cannot be put into place: {}; the new results are in {}",
                target.display(),
                plain(&error),
                kept.display()
            ))
        })?;
        flush_names(self.folder.parent());
        let earlier = self.folder.kept();
        Ok(Published::MovedAside { kept, same_plan, earlier })
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        if self.path.exists() {
            // Best effort: it is hidden, and the next run removes it.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

fn failed(folder: &Path, what: &str, error: &io::Error) -> RunError {
    RunError::new(format_args!("{}: {what}: {}", folder.display(), plain(error)))
}

/// The plan in the record of a run; the error says why the folder is not that of a run.
fn recorded_plan(folder: &Path, record: &str) -> Result<Value, String> {
    #[derive(serde::Deserialize)]
    struct Record {
        plan: Value,
    }
    let text = fs::read(folder.join(record)).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => format!("it has no {record}"),
        _ => format!("its {record} cannot be read: {error}"),
    })?;
    let parsed: Record = serde_json::from_slice(&text)
        .map_err(|error| format!("its {record} is not whole: {error}"))?;
    if parsed.plan.is_object() { Ok(parsed.plan) } else { Err(format!("its {record} has no plan")) }
}

/// Whether every file of `old` is in `new` too.
fn contains_all(new: &Path, old: &Path) -> io::Result<bool> {
    for entry in fs::read_dir(old)? {
        let entry = entry?;
        let counterpart = new.join(entry.file_name());
        let covered = if entry.file_type()?.is_dir() {
            counterpart.is_dir() && contains_all(&counterpart, &entry.path())?
        } else {
            counterpart.is_file()
        };
        if !covered {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Flushes a folder's list of names as far as the system can: what it names is in place already.
fn flush_names(folder: &Path) {
    let _ = durable::flush_folder(folder);
}

#[cfg(unix)]
fn is_running(process: i32) -> bool {
    rustix::process::Pid::from_raw(process).is_some_and(|pid| {
        // Not allowed to signal it means that it is there.
        rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH)
    })
}

#[cfg(not(unix))]
fn is_running(_process: i32) -> bool {
    true
}

#[cfg(test)]
mod tests;
