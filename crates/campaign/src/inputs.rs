//! Input files of a run: copied or linked into its folder, or filled in from templates.
//!
//! In a template a placeholder stands between double braces, `{{NAME}}`, as input files are full of single ones.

use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::folder::{PARAMETERS, PROCESS, STDERR, STDOUT};

/// A file or folder that is put into the working folder of each run.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFile {
    /// The file or folder.
    pub from: String,
    /// Its name in the working folder.
    pub to: String,
    /// How it gets there.
    pub by: Put,
}

/// How an input file gets into the working folder of a run.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Put {
    /// Copied, a folder with everything in it.
    Copy,
    /// Linked: all runs read the same file.
    Link,
    /// Copied with `{{NAME}}` replaced by what `{NAME}` stands for in a command.
    Fill,
}

/// A placeholder in a template.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placeholder<'t> {
    /// The line that it is on, from 1.
    pub line: usize,
    /// The name between the braces.
    pub name: &'t str,
    /// Bytes of the text from its first to behind its last brace.
    range: (usize, usize),
}

/// The placeholders of a template: `{{NAME}}`, also with blanks inside the braces. Names begin with a letter and hold
/// letters, digits, `_` and `-`; every other brace is text.
#[must_use]
pub fn placeholders(text: &str) -> Vec<Placeholder<'_>> {
    let mut found = Vec::new();
    let (mut at, mut line) = (0, 1);
    while let Some(next) = text[at..].find("{{") {
        let begin = at + next;
        line += text[at..begin].matches('\n').count();
        at = begin + 2;
        let Some(length) = text[at..].find("}}") else { break };
        let name = text[at..at + length].trim_matches([' ', '\t']);
        let word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-');
        if name.starts_with(char::is_alphabetic) && name.chars().all(word) {
            let end = at + length + 2;
            found.push(Placeholder { line, name, range: (begin, end) });
            at = end;
        }
    }
    found
}

/// A template with its placeholders replaced; unknown ones stay.
pub(crate) fn fill(text: &str, value: impl Fn(&str) -> Option<String>) -> String {
    let mut filled = String::with_capacity(text.len());
    let mut at = 0;
    for Placeholder { name, range: (begin, end), .. } in placeholders(text) {
        if let Some(value) = value(name) {
            filled.push_str(&text[at..begin]);
            filled.push_str(&value);
            at = end;
        }
    }
    filled.push_str(&text[at..]);
    filled
}

/// The files in and below a file or folder, in the order of their names. A link to a folder is not followed.
///
/// # Errors
///
/// What cannot be read, or is neither file nor folder, with its path.
pub fn files_below(path: &Path) -> Result<Vec<PathBuf>, (PathBuf, io::Error)> {
    let at = |error| (path.to_owned(), error);
    let there = fs::metadata(path).map_err(at)?;
    if there.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    if !there.is_dir() {
        let what = io::Error::new(io::ErrorKind::InvalidInput, "neither a file nor a folder");
        return Err(at(what));
    }
    let mut files = Vec::new();
    for entry in entries(path).map_err(at)? {
        if !is_link_to_folder(&entry) {
            files.extend(files_below(&entry)?);
        }
    }
    Ok(files)
}

/// Checks that input files have places of their own in the folder of a run, where none of `results` is.
///
/// # Errors
///
/// The place of the first in the list that has none, and the problem.
pub fn check<'r>(
    files: &[InputFile],
    results: impl Iterator<Item = &'r str> + Clone,
) -> Result<(), (usize, String)> {
    for (i, file) in files.iter().enumerate() {
        let wrong = |problem: String| Err((i, problem));
        if !Path::new(&file.from).is_absolute() {
            return wrong(format!("{:?} is relative; give the whole path", file.from));
        }
        let to = Path::new(&file.to);
        let mut parts = to.components();
        if file.to.is_empty() || !parts.all(|part| matches!(part, Component::Normal(_))) {
            return wrong(format!("{:?} is no name in the folder of a run", file.to));
        }
        if [PARAMETERS, PROCESS, STDOUT, STDERR].iter().any(|own| to.starts_with(own)) {
            return wrong(format!("{:?} is a file that every run has; rename it", file.to));
        }
        let meets =
            |other: &InputFile| to.starts_with(&other.to) || Path::new(&other.to).starts_with(to);
        if let Some(other) = files[..i].iter().find(|other| meets(other)) {
            return wrong(format!(
                "{:?} and {:?} would be in each other's place",
                other.to, file.to
            ));
        }
        // A run that wrote nothing would be read from it, and one that wrote would write through the link.
        for result in results.clone().filter(|result| Path::new(result).starts_with(to)) {
            let below = Path::new(result).strip_prefix(to).unwrap_or(to);
            let is_there = below == Path::new("") || Path::new(&file.from).join(below).exists();
            if file.by != Put::Copy || is_there {
                return wrong(format!("{:?} is where a run leaves its result, {result}", file.to));
            }
        }
    }
    Ok(())
}

/// Puts an input file into the working folder of a run.
pub(crate) fn put(
    file: &InputFile,
    folder: &Path,
    value: impl Fn(&str) -> Option<String>,
) -> io::Result<()> {
    let (from, to) = (Path::new(&file.from), folder.join(&file.to));
    if let Some(parent) = to.parent() {
        fs::create_dir_all(parent)?;
    }
    if file.by == Put::Copy && folder.canonicalize()?.starts_with(from.canonicalize()?) {
        let what = "the folder of the runs lies in it; give --out another place";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    match file.by {
        Put::Copy => copy(from, &to),
        Put::Link => link(from, &to),
        Put::Fill => {
            fs::write(&to, fill(&fs::read_to_string(from)?, value))?;
            fs::set_permissions(&to, from.metadata()?.permissions())
        }
    }
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    if !from.is_dir() {
        if !from.metadata()?.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "neither file nor folder"));
        }
        return fs::copy(from, to).map(drop);
    }
    fs::create_dir(to)?;
    for entry in entries(from)? {
        let to = to.join(entry.file_name().unwrap_or_default());
        if is_link_to_folder(&entry) {
            link(&fs::canonicalize(&entry)?, &to)
        } else {
            copy(&entry, &to)
        }?;
    }
    Ok(())
}

fn link(from: &Path, to: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(from, to)
    }
    #[cfg(not(unix))]
    {
        copy(from, to)
    }
}

/// What is in a folder, without links that lead nowhere (as editors leave them).
fn entries(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.map(|entry| Ok(entry?.path()));
    let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
    entries.retain(|entry| entry.exists());
    entries.sort();
    Ok(entries)
}

fn is_link_to_folder(path: &Path) -> bool {
    path.is_symlink() && path.is_dir()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placeholders_stand_between_double_braces_and_every_other_brace_is_text() {
        let text = "variable k equal {{k}}\nprint \"${k} {k} {{ tau_s }} {{1}} {{}} {{a b}} {\"a\": {\"b\": 1}}\"\n\n{{µ}}{{{k}}}";
        let names: Vec<(usize, &str)> =
            placeholders(text).iter().map(|found| (found.line, found.name)).collect();
        assert_eq!(names, [(1, "k"), (2, "tau_s"), (4, "µ")]);
        let value = |name: &str| (name == "k").then(|| "{{k}}".to_owned());
        assert_eq!(fill("{{k}}{{x}} {{ k }}", value), "{{k}}{{x}} {{k}}");
        for text in ["", "{{", "}}", "{{k", "k}}", "{{}}", "{ {k} }", "{{\n}}", "{{{{"] {
            assert_eq!(fill(text, value), text);
        }
    }

    fn checked(files: &[(&str, &str, Put)], result: &str) -> Result<(), (usize, String)> {
        let of = |(from, to, by): &(&str, &str, Put)| InputFile {
            from: (*from).into(),
            to: (*to).into(),
            by: *by,
        };
        check(&files.iter().map(of).collect::<Vec<_>>(), [result].into_iter())
    }

    #[test]
    fn input_files_have_places_of_their_own_in_the_folder_of_a_run() {
        use Put::{Copy, Fill, Link};
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir(folder.path().join("case")).expect("made");
        fs::write(folder.path().join("case/old.csv"), "t\n1\n").expect("written");
        let case = folder.path().join("case").display().to_string();
        let case = case.as_str();
        type Given<'a> = (&'a [(&'a str, &'a str, Put)], &'a str);
        let right: [Given<'_>; 4] = [
            (&[("/a", "a", Copy), ("/b", "b", Link), ("/c", "d/c", Fill)], "out.csv"),
            (&[("/a", "stdout.txt", Copy)], "out.csv"),
            (&[(case, "case", Copy)], "case/new.csv"),
            (&[], "out.csv"),
        ];
        for (files, result) in right {
            assert_eq!(checked(files, result), Ok(()), "{files:?}");
        }
        let wrong: [(Given<'_>, &str); 11] = [
            ((&[("a", "a", Copy)], "out.csv"), "relative"),
            ((&[("/a", "", Copy)], "out.csv"), "no name"),
            ((&[("/a", "/b", Copy)], "out.csv"), "no name"),
            ((&[("/a", "x/../b", Copy)], "out.csv"), "no name"),
            ((&[("/a", "parameters.json", Copy)], "out.csv"), "every run has"),
            ((&[("/a", "stdout/b", Copy)], "out.csv"), "every run has"),
            ((&[("/a", "b", Copy), ("/c", "b", Link)], "out.csv"), "each other's place"),
            ((&[("/a", "b/c", Copy), ("/c", "b", Link)], "out.csv"), "each other's place"),
            ((&[("/a", "out.csv", Fill)], "out.csv"), "leaves its result"),
            ((&[("/a", "case", Link)], "case/out.csv"), "leaves its result"),
            ((&[(case, "case", Copy)], "case/old.csv"), "leaves its result"),
        ];
        for ((files, result), words) in wrong {
            let (place, problem) = checked(files, result).expect_err(words);
            assert!(problem.contains(words) && place + 1 == files.len(), "{problem}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn folders_are_copied_whole_and_links_in_them_lead_where_they_led() {
        let dir = tempfile::tempdir().expect("a folder");
        let (from, run) = (dir.path().join("from"), dir.path().join("run"));
        fs::create_dir_all(from.join("deep/er")).expect("made");
        fs::create_dir(&run).expect("made");
        fs::write(from.join("deep/er/x"), "x").expect("written");
        fs::write(from.join("y"), "y").expect("written");
        // A folder that holds itself.
        std::os::unix::fs::symlink("..", from.join("deep/loop")).expect("linked");
        std::os::unix::fs::symlink("../y", from.join("deep/y")).expect("linked");
        std::os::unix::fs::symlink("nowhere", from.join("deep/.#y")).expect("linked");
        let whole = from.display().to_string();
        let put_in = |by, to: &str| {
            let file = InputFile { from: whole.clone(), to: to.into(), by };
            put(&file, &run, |_| None).expect("put");
        };
        put_in(Put::Copy, "copied");
        put_in(Put::Link, "a/linked");
        let text = |name: &str| fs::read_to_string(run.join(name)).expect(name);
        for folder in ["copied", "a/linked"] {
            assert_eq!(text(&format!("{folder}/deep/er/x")), "x");
            assert_eq!(text(&format!("{folder}/deep/y")), "y");
            assert_eq!(text(&format!("{folder}/deep/loop/y")), "y");
        }
        let names = ["deep/er/x", "deep/y", "y"].map(|name| from.join(name));
        assert_eq!(files_below(&from).expect("read"), names);
        // A folder with that of the run in it would be copied into itself.
        let within =
            InputFile { from: dir.path().display().to_string(), to: "z".into(), by: Put::Copy };
        assert!(
            put(&within, &run, |_| None).expect_err("within").to_string().contains("lies in it")
        );
        // What is neither file nor folder would be waited for.
        let pipe = from.join("pipe");
        let mkfifo = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
        assert!(mkfifo.success());
        assert_eq!(files_below(&from).expect_err("a pipe").0, pipe);
        let file = InputFile { from: whole, to: "again".into(), by: Put::Copy };
        assert!(put(&file, &run, |_| None).is_err());
    }
}
