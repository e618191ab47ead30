//! Names of files in an archive: which there may be, and where the files of the user are.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use crate::output::inputs::Inputs;

/// A name of a file within an archive, or what is wrong with it.
pub(super) fn checked_name(name: &[u8]) -> Result<&str, &'static str> {
    let name = std::str::from_utf8(name).map_err(|_| "a name that is not UTF-8")?;
    if name.contains('\\') {
        return Err("a name with a backslash");
    }
    if name.starts_with('/') {
        return Err("a name that begins at the root of the disk");
    }
    if name.contains(':') {
        return Err("a name with a colon, as of a drive");
    }
    if name.chars().any(char::is_control) {
        return Err("a name with control characters");
    }
    let mut parts = name.strip_suffix('/').unwrap_or(name).split('/');
    if parts.clone().any(|part| part == "..") {
        return Err("a name that leads out of its folder (..)");
    }
    if parts.clone().any(|part| part.is_empty() || part == "." || part.len() > 255)
        || name.len() > 4096
    {
        return Err("a name with an empty, dotted or overlong part");
    }
    // What some systems cannot tell from another name, or take for a device.
    if parts.any(|part| part.ends_with(['.', ' '])) {
        return Err("a name with a dot or a blank at its end");
    }
    Ok(name)
}

/// Names that can be beside each other on any system: capitals do not count.
#[derive(Debug, Default)]
pub(super) struct Names {
    files: BTreeSet<String>,
    folders: BTreeSet<String>,
}

impl Names {
    /// Adds a name, that of a folder with a slash at its end, or says what it cannot be beside.
    pub(super) fn add(&mut self, name: &str) -> Result<(), &'static str> {
        let name = name.to_lowercase();
        let folders: Vec<&str> = name.match_indices('/').map(|(at, _)| &name[..at]).collect();
        let is_file = |folder: &&str| self.files.contains(*folder);
        if folders.iter().any(is_file) || self.folders.contains(&name) {
            return Err("a name that is both a file and a folder");
        }
        self.folders.extend(folders.into_iter().map(str::to_owned));
        if name.ends_with('/') || self.files.insert(name) {
            Ok(())
        } else {
            Err("two files of the same name")
        }
    }
}

/// What the folder of a plan is called in an archive where some of its files are not below it.
const OF_THE_PLAN: &str = "of-the-plan";
/// The folder of files that were named by their whole paths.
const FROM_ROOT: &str = "from-root";

/// Where the files that a run was made of are in an archive, which follows from their names alone. They are where they were
/// from the folder of the plan on, which lies as deep as the names that begin with `..` lead up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Places {
    depth: usize,
}

impl Places {
    pub(super) fn of(inputs: &Inputs) -> Self {
        const DEEPEST: usize = 64;
        let up = |name: &str| {
            let parts = Path::new(name).components().filter(|part| *part != Component::CurDir);
            parts.take_while(|part| *part == Component::ParentDir).count()
        };
        let depth = inputs.files.iter().map(|file| up(&file.name)).max().unwrap_or(0);
        Self { depth: depth.min(DEEPEST) }
    }

    /// The folder of the plan, from that of the inputs on.
    pub(super) fn of_plan(self) -> String {
        vec![OF_THE_PLAN; self.depth].join("/")
    }

    /// The place of a file, from the folder of the inputs on; or why there is none.
    pub(super) fn place(self, name: &str) -> Result<String, &'static str> {
        let mut place: Vec<&str> = vec![OF_THE_PLAN; self.depth];
        let mut up = true;
        for part in Path::new(name).components() {
            match part {
                Component::CurDir => {}
                Component::RootDir => place = vec![FROM_ROOT],
                Component::ParentDir if up && !Path::new(name).is_absolute() => {
                    place.pop().ok_or("a name that leads up too far")?;
                }
                Component::ParentDir => return Err("a name that leads up after it has led down"),
                Component::Normal(part) => {
                    up = false;
                    place.push(part.to_str().ok_or("a name that is not UTF-8")?);
                }
                Component::Prefix(_) => return Err("a name with a drive"),
            }
        }
        if up {
            return Err("not the name of a file");
        }
        let place = place.join("/");
        checked_name(place.as_bytes()).map(str::to_owned)
    }

    /// The name that a file has from the folder of the plan on, once it is in its place.
    pub(super) fn name_in_place(self, name: &str) -> Result<String, &'static str> {
        let place = self.place(name)?;
        Ok(if Path::new(name).is_absolute() {
            format!("{}{place}", "../".repeat(self.depth))
        } else {
            name.to_owned()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::inputs::InputFile;

    fn places(names: &[&str]) -> Places {
        let file = |name: &&str| InputFile {
            role: String::new(),
            name: (*name).to_owned(),
            bytes: 0,
            sha256: String::new(),
        };
        Places::of(&Inputs { files: names.iter().map(file).collect() })
    }

    #[test]
    fn files_beside_the_plan_above_it_and_elsewhere_have_places_of_their_own() {
        let below = places(&["plan.toml", "./sub/a.csv"]);
        assert_eq!(below.of_plan(), "");
        assert_eq!(below.place("./sub/a.csv").as_deref(), Ok("sub/a.csv"));
        let above = places(&["plan.toml", "../../common/mesh.stl", "../b.csv", "/data/c.csv"]);
        assert_eq!(above.of_plan(), "of-the-plan/of-the-plan");
        for (name, place) in [
            ("plan.toml", "of-the-plan/of-the-plan/plan.toml"),
            ("../../common/mesh.stl", "common/mesh.stl"),
            ("../b.csv", "of-the-plan/b.csv"),
            ("/data/c.csv", "from-root/data/c.csv"),
        ] {
            assert_eq!(above.place(name).as_deref(), Ok(place));
        }
        assert_eq!(above.name_in_place("/data/c.csv").as_deref(), Ok("../../from-root/data/c.csv"));
        assert_eq!(above.name_in_place("../b.csv").as_deref(), Ok("../b.csv"));
        for name in ["a/../../b", "../../../b", "a:b", "a\nb", "", "/../b", "a."] {
            assert!(above.place(name).is_err(), "{name}");
        }
    }

    #[test]
    fn a_name_is_a_file_or_a_folder_and_there_once() {
        let mut names = Names::default();
        for name in ["results/a", "results/b/c", "results/b/", "results/b/d"] {
            assert_eq!(names.add(name), Ok(()), "{name}");
        }
        assert_eq!(names.add("results/A"), Err("two files of the same name"));
        for name in ["results/a/x", "results/B", "results/a/"] {
            assert_eq!(names.add(name), Err("a name that is both a file and a folder"), "{name}");
        }
    }
}
