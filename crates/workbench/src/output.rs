//! Results on disk: whole or not at all.
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
//! A run of ours is recognised by its record, a JSON file with an object `plan`.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Serialize;
use serde_json::Value;

use crate::error::{InputError, Mistake, RunError};

/// Folder of the runs of programs, in the folder of a calibration.
pub const CAMPAIGN: &str = "campaign";

/// A hidden folder of a run that was killed is removed when it is older than this: writing takes
/// seconds, and on a shared disk its process may live on another machine.
const STALE: Duration = Duration::from_secs(600);

/// A folder that results can be published to, checked before the run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunFolder {
    target: PathBuf,
    record: &'static str,
}

/// Takes a file name and its bytes.
pub type WriteFile<'a> = dyn Fn(&str, &[u8]) -> Result<(), RunError> + Sync + 'a;

/// What to do about results that cannot be written.
#[must_use]
pub fn make_room(error: RunError) -> RunError {
    error.help("make room on the disk, or choose another folder with --out")
}

/// JSON as it is written to files.
///
/// # Errors
///
/// [`RunError`] for a value that JSON cannot hold.
pub fn pretty(value: &impl Serialize) -> Result<String, RunError> {
    let mut text = serde_json::to_string_pretty(value).map_err(|error| {
        RunError::new(format_args!("the result cannot be written as JSON: {error}"))
    })?;
    text.push('\n');
    Ok(text)
}

/// A pool of the asked number of threads, or of all cores.
///
/// # Errors
///
/// [`InputError`] for more threads than the machine can start.
pub fn pool(threads: Option<usize>) -> Result<rayon::ThreadPool, InputError> {
    rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(|error| {
        InputError::new("--threads", Mistake::OutOfRange)
            .found(threads.map_or_else(|| "all cores".to_owned(), |n| n.to_string()))
            .expected(format_args!("as many threads as the machine can start ({error})"))
    })
}

/// What became of the folder.
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
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.target
    }

    /// Whether a run is there already.
    ///
    /// # Errors
    ///
    /// Where the folder cannot be read.
    pub fn occupied(&self) -> io::Result<bool> {
        match fs::read_dir(&self.target) {
            Ok(mut entries) => Ok(entries.next().is_some()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(error),
        }
    }

    pub(crate) fn parent(&self) -> &Path {
        match self.target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        }
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
    ///
    /// # Errors
    ///
    /// [`RunError`] where it cannot be made.
    pub fn stage(&self) -> Result<Staging, RunError> {
        let failed = |error: io::Error| {
            RunError::new(format_args!(
                "{}: cannot be written: {}",
                self.target.display(),
                plain(&error)
            ))
        };
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

/// A hidden folder that is being filled. Dropped without [`publish`](Self::publish) it disappears.
#[derive(Debug)]
pub struct Staging {
    folder: RunFolder,
    path: PathBuf,
}

impl Staging {
    /// Where to write the files.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a file of the results, in a folder of its own where its name has one. `shown` is how messages call the
    /// results' folder.
    ///
    /// # Errors
    ///
    /// [`RunError`] with the name of the file.
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
    ///
    /// # Errors
    ///
    /// [`RunError`] where it cannot be made.
    pub fn beside_runs(dir: &Path, record: &'static str) -> Result<Self, RunError> {
        let prefix = ".report.tmp-";
        for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(prefix) {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        let path = dir.join(format!("{prefix}{}", std::process::id()));
        fs::create_dir(&path).map_err(|error| {
            RunError::new(format_args!("{}: cannot be written: {}", dir.display(), plain(&error)))
        })?;
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
            flush(&self.path)?;
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
            flush_folder(target);
            fs::rename(self.path.join(record), target.join(record))?;
            flush_folder(target);
            Ok(())
        };
        put().map_err(|error| {
            RunError::new(format_args!(
                "{}: results cannot be put into place: {}",
                target.display(),
                plain(&error)
            ))
        })?;
        Ok(published)
    }

    /// Flushes the files to disk and renames the folder into place. The record must be among them.
    ///
    /// # Errors
    ///
    /// [`RunError`]; the old results are then still in place, or under the name that the message says.
    pub fn publish(self) -> Result<Published, RunError> {
        let RunFolder { target, record } = &self.folder;
        let failed = |error: io::Error| {
            RunError::new(format_args!(
                "{}: cannot be put into place: {}",
                target.display(),
                plain(&error)
            ))
        };
        let new_plan = recorded_plan(&self.path, record).map_err(|why| {
            RunError::new(format_args!("{}: nothing to publish: {why}", target.display()))
        })?;
        flush(&self.path).map_err(failed)?;
        if !self.folder.occupied().map_err(failed)? {
            fs::rename(&self.path, target).map_err(failed)?;
            flush_folder(self.folder.parent());
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
            flush_folder(self.folder.parent());
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
        flush_folder(self.folder.parent());
        Ok(Published::MovedAside { kept, same_plan })
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

/// The plan in the record of a run, or why it is none.
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

/// Lets two folders change places, in one step where the system can.
fn exchange(a: &Path, b: &Path) -> io::Result<()> {
    #[cfg(any(target_os = "linux", target_os = "android", target_vendor = "apple"))]
    {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        match renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE) {
            Ok(()) => return Ok(()),
            // A file system that cannot: in three steps below.
            Err(
                rustix::io::Errno::NOSYS | rustix::io::Errno::INVAL | rustix::io::Errno::NOTSUP,
            ) => {}
            Err(error) => return Err(error.into()),
        }
    }
    exchange_in_steps(a, b)
}

/// As [`exchange`], with a moment in which `b` is not there; undone where a step fails.
fn exchange_in_steps(a: &Path, b: &Path) -> io::Result<()> {
    let mut between = a.as_os_str().to_owned();
    between.push("-old");
    let between = PathBuf::from(between);
    fs::rename(b, &between)?;
    if let Err(error) = fs::rename(a, b) {
        fs::rename(&between, b)?;
        return Err(error);
    }
    fs::rename(&between, a)
}

/// Flushes every file of a folder, and the folder.
fn flush(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            flush(&entry.path())?;
        } else {
            File::open(entry.path())?.sync_all()?;
        }
    }
    flush_folder(folder);
    Ok(())
}

/// Flushes a folder's list of names. Best effort: not every system can, and the files are safe.
fn flush_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
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

/// The system's words without its number.
fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    let end = text.find(" (os error").unwrap_or(text.len());
    let mut text = text[..end].to_owned();
    text[..1].make_ascii_lowercase();
    // The part that names a temporary file is noise.
    match text.find(" at path ") {
        Some(place) => text[..place].to_owned(),
        None => text,
    }
}

fn unwritable(path: &Path, error: &io::Error) -> InputError {
    InputError::new(path.display().to_string(), Mistake::Unwritable)
        .found(format_args!("cannot be written: {}", plain(error)))
        .help("choose another place with --out, or make this one writable")
}

/// Checks that a file can be written, without touching it.
///
/// # Errors
///
/// [`InputError`] that names it.
pub fn check_file(path: &Path) -> Result<(), InputError> {
    if path.is_dir() {
        return Err(InputError::new(path.display().to_string(), Mistake::Unwritable)
            .found("a folder")
            .expected("a file")
            .help("choose another name with --out"));
    }
    if is_device(path) {
        return Ok(());
    }
    temporary_beside(path).map(drop).map_err(|error| unwritable(path, &error))
}

/// Writes a file whole: aside, flushed, renamed. A device or pipe is written directly.
///
/// # Errors
///
/// [`RunError`] that names it; what was there before is then untouched.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), RunError> {
    let write = || {
        if is_device(path) {
            return fs::OpenOptions::new().write(true).open(path)?.write_all(contents);
        }
        let mut file = temporary_beside(path)?;
        file.write_all(contents)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    write().map_err(|error: io::Error| {
        RunError::new(format_args!("{}: cannot be written: {}", path.display(), plain(&error)))
    })
}

fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

fn temporary_beside(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".calibrate-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Like any other file, as the umask says, not private as temporary files are.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::FILE_NAME;

    fn run(target: &Path, plan: &str, files: &[&str]) -> Published {
        let folder = RunFolder::prepare(target, FILE_NAME).expect("can be written");
        let staging = folder.stage().expect("staged");
        fill(staging.path(), plan, files);
        staging.publish().expect("published")
    }

    fn fill(folder: &Path, plan: &str, files: &[&str]) {
        let record = format!("{{\"plan\": {{\"seed\": {plan}}}, \"samples\": [1]}}");
        fs::write(folder.join(FILE_NAME), record).expect("written");
        for file in files {
            fs::write(folder.join(file), plan).expect("written");
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_run_appears_whole_is_replaced_by_the_same_plan_and_kept_for_another() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("results/ps");
        assert_eq!(run(&target, "1", &["a.csv"]), Published::New);
        assert_eq!(run(&target, "1", &["a.csv", "b.csv"]), Published::Replaced);
        assert_eq!(names(&target), ["a.csv", "b.csv", "posterior.json"]);
        let target_path = fs::canonicalize(&target).expect("there");
        let aside = |n| target_path.with_file_name(format!("ps.{n}"));
        let kept = |n, same_plan| Published::MovedAside { kept: aside(n), same_plan };
        assert_eq!(run(&target, "2", &[]), kept(1, false));
        assert_eq!(names(&aside(1)), ["a.csv", "b.csv", "posterior.json"]);
        assert_eq!(run(&target, "3", &[]), kept(2, false));
        assert_eq!(names(&folder.path().join("results")), ["ps", "ps.1", "ps.2"]);
    }

    #[test]
    fn a_users_notes_in_an_old_run_are_kept() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("ps");
        run(&target, "1", &[]);
        fs::write(target.join("notes.txt"), "mine").expect("written");
        assert!(matches!(run(&target, "1", &[]), Published::MovedAside { same_plan: true, .. }));
        assert_eq!(names(&folder.path().join("ps.1")), ["notes.txt", "posterior.json"]);
        assert_eq!(names(&target), ["posterior.json"]);
    }

    #[test]
    fn a_folder_that_is_not_ours_is_refused_and_left_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("thesis");
        fs::create_dir(&target).expect("made");
        assert!(RunFolder::prepare(&target, FILE_NAME).is_ok(), "an empty folder is fine");
        for record in [None, Some("{\"plan\": {\"se"), Some("{\"plan\": 3}"), Some("[]")] {
            fs::write(target.join("chapter1.tex"), "text").expect("written");
            if let Some(record) = record {
                fs::write(target.join(FILE_NAME), record).expect("written");
            }
            let before = names(&target);
            let error = RunFolder::prepare(&target, FILE_NAME).expect_err("not ours");
            assert_eq!(error.mistake, Mistake::NotOurs, "{error}");
            assert!(error.to_string().contains("--out"), "{error}");
            assert_eq!(names(&target), before);
        }
        assert_eq!(names(folder.path()), ["thesis"]);
    }

    #[test]
    fn a_place_that_cannot_be_written_is_refused_before_the_run() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("written");
        let mut places =
            vec![file.clone(), file.join("results"), PathBuf::from("/"), PathBuf::new()];
        if cfg!(target_os = "linux") {
            places.push(PathBuf::from("/proc/results"));
        }
        for place in places {
            let error = RunFolder::prepare(&place, FILE_NAME).expect_err("unwritable");
            assert_eq!(error.mistake, Mistake::Unwritable, "{error}");
        }
        assert!(check_file(&file.join("x.csv")).is_err());
        assert_eq!(check_file(folder.path()).expect_err("folder").mistake, Mistake::Unwritable);
        assert_eq!(names(folder.path()), ["file"], "checking writes nothing");
    }

    #[cfg(unix)]
    #[test]
    fn a_read_only_parent_is_refused_before_the_run() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let parent = folder.path().join("read-only");
        fs::create_dir(&parent).expect("made");
        fs::set_permissions(&parent, fs::Permissions::from_mode(0o555)).expect("set");
        // The superuser writes anywhere.
        let superuser = fs::write(parent.join("probe"), "").is_ok();
        let prepared = RunFolder::prepare(&parent.join("ps"), FILE_NAME);
        fs::set_permissions(&parent, fs::Permissions::from_mode(0o755)).expect("set");
        if superuser {
            assert!(prepared.is_ok());
        } else {
            assert_eq!(prepared.expect_err("read-only").mistake, Mistake::Unwritable);
        }
    }

    #[test]
    fn an_unfinished_run_leaves_nothing_and_the_old_results_alone() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("ps");
        run(&target, "1", &["a.csv"]);
        let prepared = RunFolder::prepare(&target, FILE_NAME).expect("ours");
        let staging = prepared.stage().expect("staged");
        fill(staging.path(), "2", &[]);
        drop(staging);
        assert_eq!(names(folder.path()), ["ps"]);
        let staging = prepared.stage().expect("staged");
        assert!(staging.publish().is_err(), "a run without its record");
        assert_eq!(names(folder.path()), ["ps"]);
        assert_eq!(names(&target), ["a.csv", "posterior.json"]);
    }

    #[test]
    fn folders_of_killed_runs_are_removed_when_old_and_ignored_before() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let target = folder.path().join("ps");
        // Beyond any process number; the other is of this very process's parent family: alive.
        let dead = folder.path().join(format!(".ps.tmp-{}", i32::MAX));
        let recent = folder.path().join(format!(".ps.tmp-{}", i32::MAX - 1));
        let living = folder.path().join(".ps.tmp-1");
        let other = folder.path().join(".pa12.tmp-notanumber");
        let old = std::time::SystemTime::now() - 2 * STALE;
        for (path, is_old) in [(&dead, true), (&recent, false), (&living, true), (&other, true)] {
            fs::create_dir(path).expect("made");
            if is_old {
                File::open(path).and_then(|file| file.set_modified(old)).expect("aged");
            }
        }
        assert_eq!(run(&target, "1", &[]), Published::New);
        assert!(!dead.exists() && recent.exists() && living.exists() && other.exists());
    }

    #[test]
    fn folders_change_places_with_and_without_the_systems_help() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        fs::create_dir(&a).expect("made");
        fs::create_dir(&b).expect("made");
        fs::write(a.join("in-a"), "").expect("written");
        exchange(&a, &b).expect("exchanged");
        assert!(b.join("in-a").exists());
        exchange_in_steps(&a, &b).expect("exchanged");
        assert!(a.join("in-a").exists());
        assert_eq!(names(folder.path()), ["a", "b"]);
    }

    #[test]
    fn a_file_is_written_whole_and_over_an_old_one() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("x.csv");
        check_file(&file).expect("can be written");
        assert!(names(folder.path()).is_empty());
        write_file(&file, b"old").expect("written");
        write_file(&file, b"new").expect("written");
        assert_eq!(fs::read(&file).expect("read"), b"new");
        assert_eq!(names(folder.path()), ["x.csv"]);
    }
}
