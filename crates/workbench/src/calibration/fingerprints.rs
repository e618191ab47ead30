//! Fingerprints of the programs of a plan, and of the files beside the plan that its commands name: whether they are those
//! that the run began with.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use campaign::inputs::files_below;
use campaign::{Campaign, CampaignSpec};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::output::checksums::hex;
use crate::simulator::Change;

/// The file with the fingerprints, beside the runs.
pub(super) const FILE: &str = "programs.json";

/// Most of a file that is read, half of it from its start and half from its end \[bytes\].
const MOST: u64 = 64 << 20;

/// Most characters of the path of a file, as Linux has it.
const LONGEST_NAME: usize = 4096;

/// Fingerprint of each file, by its path: its length and a checksum.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub(super) struct Fingerprints(BTreeMap<String, String>);

impl Fingerprints {
    /// Of everything that can be read now. `folder` is that of the plan.
    pub(super) fn of(spec: &CampaignSpec, folder: &Path) -> Self {
        let prints = files(spec, folder).into_iter().filter_map(|file| {
            let print = match file.is_dir() {
                true => hex(&Sha256::digest(names_below(&file)?)[..16]),
                false => fingerprint(&file).ok()?,
            };
            Some((file.display().to_string(), print))
        });
        Self(prints.collect())
    }

    /// The first file that is another one than in `before`, in words. A file that was not there before is what the runs
    /// write.
    pub(super) fn change(&self, before: &Self) -> Option<String> {
        let (file, _) = before.0.iter().find(|(file, print)| self.0.get(*file) != Some(*print))?;
        let now = if self.0.contains_key(file) {
            "has changed"
        } else {
            "is not there, or another is used,"
        };
        Some(format!("{file} {now} since the run began"))
    }
}

/// The programs of all commands, the files that their arguments name, and those that go into the folders of runs.
pub(super) fn files(spec: &CampaignSpec, folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for command in &spec.commands {
        files.extend(command.call.argv.first().and_then(|program| on_path(program)));
        for argument in &command.call.argv {
            files.extend(named(argument, folder));
        }
        for file in &command.call.files {
            files.push(PathBuf::from(&file.from));
            files.extend(files_below(Path::new(&file.from)).unwrap_or_default());
        }
    }
    files
}

/// Whether the programs of a run are still those that it began with; files are read again only where their length, time
/// of change or place is another than at the last look.
pub(super) struct Guard<'a> {
    spec: &'a CampaignSpec,
    folder: PathBuf,
    before: Fingerprints,
    seen: Option<Vec<Option<String>>>,
    unchecked: Unchecked,
    lenient: bool,
}

impl<'a> Guard<'a> {
    /// `lenient`: what is written and stays the same is the same.
    pub(super) fn new(
        campaign: &'a Campaign,
        folder: &Path,
        before: Fingerprints,
        lenient: bool,
    ) -> Self {
        let (spec, folder, unchecked) =
            (campaign.spec(), folder.to_owned(), Unchecked::of(campaign));
        Self { spec, folder, before, seen: None, unchecked, lenient }
    }

    /// What has changed; `unsure` are the runs of which it will not be known until the next look.
    pub(super) fn change(&mut self, unsure: &BTreeSet<u64>) -> Option<Change> {
        let change = self.looked_at();
        if change.is_none() {
            self.unchecked.note(unsure);
        }
        change
    }

    fn looked_at(&mut self) -> Option<Change> {
        let seen: Vec<_> = self.before.0.keys().map(|file| stamp(Path::new(file))).collect();
        if self.seen.as_ref() == Some(&seen) {
            return None;
        }
        if let Some(change) = Fingerprints::of(self.spec, &self.folder).change(&self.before) {
            return Some(Change::Another(change));
        }
        let earlier = self.seen.replace(seen.clone())?;
        let written = earlier.iter().zip(&seen).position(|(was, is)| was != is)?;
        let file = self.before.0.keys().nth(written)?;
        (!self.lenient).then(|| Change::Written(file.clone()))
    }
}

/// What is told from a look at a file without reading it: where it is, its length, when it changed. Of a folder the names in it.
fn stamp(file: &Path) -> Option<String> {
    if file.is_dir() {
        return names_below(file);
    }
    let length = std::fs::metadata(file).ok()?.len();
    let place = std::fs::canonicalize(file).ok()?;
    Some(format!("{} {length} {:?}", place.display(), last_change(file)?))
}

/// Runs that are being made, beside all others: their programs are looked at only once they have ended.
pub(super) struct Unchecked(PathBuf);

impl Unchecked {
    /// Of the runs in a folder.
    pub(super) fn of(campaign: &Campaign) -> Self {
        Self(campaign.dir().join("unchecked.json"))
    }

    /// Notes the runs that are being made, after a look at their programs. Best effort, as all of this.
    fn note(&self, numbers: &BTreeSet<u64>) {
        let _ = if numbers.is_empty() {
            std::fs::remove_file(&self.0)
        } else {
            std::fs::write(&self.0, serde_json::to_vec(numbers).unwrap_or_default())
        };
    }

    /// The runs that a driver was making when it was killed, where a program or a file beside it was written after they
    /// had begun: it may have been another one for a while.
    pub(super) fn suspects(&self, programs: &Fingerprints) -> Vec<u64> {
        let begun = std::fs::metadata(&self.0).and_then(|file| file.modified());
        let (Ok(text), Ok(begun)) = (std::fs::read(&self.0), begun) else { return Vec::new() };
        let written = programs.0.keys().filter_map(|file| last_change(Path::new(file)));
        if written.max().is_some_and(|written| written >= begun) {
            serde_json::from_slice(&text).unwrap_or_default()
        } else {
            Vec::new()
        }
    }
}

/// Time at which a file was last written or put into its place, or a link on the way to it was.
fn last_change(file: &Path) -> Option<SystemTime> {
    let links = file.ancestors().filter(|part| part.is_symlink());
    let links = links.filter_map(|link| changed(&std::fs::symlink_metadata(link).ok()?));
    changed(&std::fs::metadata(file).ok()?).into_iter().chain(links).max()
}

fn changed(there: &std::fs::Metadata) -> Option<SystemTime> {
    let written = there.modified().ok()?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let (s, ns) = (u64::try_from(there.ctime()).ok()?, u32::try_from(there.ctime_nsec()).ok()?);
        Some(written.max(SystemTime::UNIX_EPOCH + std::time::Duration::new(s, ns)))
    }
    #[cfg(not(unix))]
    Some(written)
}

/// A program as the system finds it.
fn on_path(program: &str) -> Option<PathBuf> {
    if program.contains('/') {
        return Some(PathBuf::from(program)).filter(|path| path.is_file());
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(program)).find(|path| path.is_file())
}

/// Files in `folder` that a text names by their whole path, also within a script or behind `--option=`, but not those that
/// a script writes to (`> FILE`). Names may hold blanks.
fn named(text: &str, folder: &Path) -> Vec<PathBuf> {
    let Some(beginning) =
        folder.to_str().map(|folder| format!("{}/", folder.trim_end_matches('/')))
    else {
        return Vec::new();
    };
    let ends = |c: char| c.is_whitespace() || "\"'`;|&()<>,:{}".contains(c);
    let read = |at: &usize| {
        !text[..*at]
            .trim_end_matches(|c: char| c.is_whitespace() || "\"'".contains(c))
            .ends_with('>')
    };
    let mentions = text.match_indices(&beginning).map(|(at, _)| at).filter(read);
    let names = mentions.flat_map(|at| {
        let longest = text[at..].char_indices().map(|(i, _)| i).nth(LONGEST_NAME);
        let name = &text[at..at + longest.unwrap_or(text.len() - at)];
        let lengths = name.match_indices(ends).map(|(length, _)| length).chain([name.len()]);
        lengths.map(|length| PathBuf::from(&name[..length]))
    });
    names.filter(|path| path.is_file()).collect()
}

/// The names of all files below a folder, one to a line.
fn names_below(folder: &Path) -> Option<String> {
    let names = files_below(folder).ok()?.into_iter();
    Some(names.map(|name| format!("{}\n", name.display())).collect())
}

fn fingerprint(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let mut sum = Sha256::new();
    let mut add = |file: &mut File, bytes: u64| -> io::Result<()> {
        let mut part = Vec::new();
        file.take(bytes).read_to_end(&mut part)?;
        sum.update(&part);
        Ok(())
    };
    if length <= MOST {
        add(&mut file, MOST)?;
    } else {
        add(&mut file, MOST / 2)?;
        file.seek(SeekFrom::Start(length - MOST / 2))?;
        add(&mut file, MOST / 2)?;
    }
    Ok(format!("{length} bytes, {}", hex(&sum.finalize()[..16])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_in_arguments_and_a_change_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let path = |name: &str| folder.join(name).display().to_string();
        std::fs::write(folder.join("run.sh"), "one").expect("written");
        std::fs::write(folder.join("in.txt"), "two").expect("written");
        let script =
            format!("exec '{}' --input={} >> \"{}\"", path("run.sh"), path("in.txt"), path("log"));
        std::fs::write(folder.join("log"), "a log").expect("written");
        let found = named(&script, folder);
        assert_eq!(found, [folder.join("run.sh"), folder.join("in.txt")]);
        for name in ["my run.sh", "µ (1), it's.sh"] {
            std::fs::write(folder.join(name), "three").expect("written");
            assert_eq!(named(&path(name), folder), [folder.join(name)]);
            let within = format!("sh \"{}\" 1.5", path(name));
            assert_eq!(named(&within, folder), [folder.join(name)]);
        }
        let mut command = campaign::CommandSpec::in_process("x");
        command.call.argv = vec!["sh".into(), "-c".into(), script];
        let spec = CampaignSpec { parameter_names: Vec::new(), commands: vec![command], seed: 1 };
        let before = Fingerprints::of(&spec, folder);
        assert_eq!(before.0.len(), 3, "with the shell: {before:?}");
        assert_eq!(Fingerprints::of(&spec, folder).change(&before), None);
        // What runs write is no change of the program.
        std::fs::write(folder.join("log"), "a longer log").expect("written");
        assert_eq!(Fingerprints::of(&spec, folder).change(&before), None);
        // As long as before, and not the same.
        std::fs::write(folder.join("in.txt"), "TWO").expect("written");
        let said = Fingerprints::of(&spec, folder).change(&before).expect("changed");
        assert!(said.contains("in.txt has changed since the run began"), "{said}");
        std::fs::remove_file(folder.join("in.txt")).expect("removed");
        let said = Fingerprints::of(&spec, folder).change(&before).expect("changed");
        assert!(said.contains("in.txt is not there"), "{said}");
    }
}
