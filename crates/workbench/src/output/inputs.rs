//! `inputs.json`: the files that a run was made of, by name and SHA-256 of what was read of them; of programs as they were when
//! the run began.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::checksums::hex;
use super::{WriteFile, pretty};
use crate::error::{InputError, Mistake, RunError};
use crate::input::files_read::FilesRead;
use crate::input::text_file;

/// Name of the file.
pub const FILE_NAME: &str = "inputs.json";

/// A file that a run was made of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputFile {
    /// Its part in the run: measurements, priors, plan, program.
    pub role: String,
    /// Its name, as it was given; of a file beside or below the plan from the plan's folder on.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// Its SHA-256.
    pub sha256: String,
}

/// The files that a run was made of. What is built into the program is not among them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Inputs {
    /// The files, each once.
    pub files: Vec<InputFile>,
}

impl Inputs {
    /// Of files by their roles, as far as they were read. A file below `folder` is named from there on.
    pub(crate) fn of(
        files: impl IntoIterator<Item = (&'static str, PathBuf)>,
        folder: Option<&Path>,
        read: &FilesRead,
    ) -> Self {
        let mut inputs = Self::default();
        for (role, path) in files {
            if let Some((bytes, sum)) = read.of(&path) {
                inputs.add(role, name_of(&path, folder), (bytes, hex(&sum)));
            }
        }
        inputs
    }

    /// Adds files of a role that are not read by this program, as they are now, in place of those of that role.
    pub(crate) fn renew(
        &mut self,
        role: &'static str,
        files: impl IntoIterator<Item = PathBuf>,
        folder: &Path,
    ) {
        self.files.retain(|file| file.role != role);
        for path in files {
            if let Ok(sum) = sum_of(&path) {
                self.add(role, name_of(&path, Some(folder)), sum);
            }
        }
    }

    /// Those of several runs together; none where those of one are not known.
    pub(crate) fn together<'i>(all: impl IntoIterator<Item = Option<&'i Self>>) -> Option<Self> {
        all.into_iter().try_fold(Self::default(), |mut together, one| {
            for file in &one?.files {
                together.add(&file.role, file.name.clone(), (file.bytes, file.sha256.clone()));
            }
            Some(together)
        })
    }

    fn add(&mut self, role: &str, name: String, (bytes, sha256): (u64, String)) {
        if self.files.iter().all(|file| file.name != name) {
            self.files.push(InputFile { role: role.to_owned(), name, bytes, sha256 });
        }
    }

    /// Writes `inputs.json`.
    ///
    /// # Errors
    ///
    /// What `write` says.
    pub fn write(&self, write: &WriteFile<'_>) -> Result<(), RunError> {
        write(FILE_NAME, pretty(self)?.as_bytes())
    }

    /// Those of the run in a folder; none where an earlier version did not note them.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a file that is damaged.
    pub fn read(folder: &Path) -> Result<Option<Self>, InputError> {
        let path = folder.join(FILE_NAME);
        if !path.exists() {
            return Ok(None);
        }
        let text = text_file::read(&path)?;
        serde_json::from_str(&text).map(Some).map_err(|error| {
            InputError::new(path.display().to_string(), Mistake::Damaged)
                .at_line(error.line().max(1))
                .found(format_args!("no list of input files ({error})"))
                .help("copy the folder again, or remove this file: the report is then made without it")
        })
    }

    /// The file of a role, where there is one.
    pub fn by_role(&self, role: &str) -> Option<&InputFile> {
        self.files.iter().find(|file| file.role == role)
    }
}

/// The name of a file, from the folder on where it is below.
fn name_of(path: &Path, folder: Option<&Path>) -> String {
    folder.and_then(|folder| path.strip_prefix(folder).ok()).unwrap_or(path).display().to_string()
}

/// Length and SHA-256 of a file as it is now.
pub(crate) fn sum_of(path: &Path) -> io::Result<(u64, String)> {
    if !path.is_file() {
        return Err(io::ErrorKind::NotFound.into());
    }
    let (mut file, mut digest) = (std::fs::File::open(path)?, Sha256::new());
    let mut bytes = 0;
    let mut piece = vec![0; 1 << 16];
    loop {
        match io::Read::read(&mut file, &mut piece)? {
            0 => return Ok((bytes, hex(&digest.finalize()))),
            length => {
                digest.update(&piece[..length]);
                bytes += length as u64;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::files_read::noted;

    #[test]
    fn files_are_named_from_the_folder_of_the_plan_on_and_each_once_with_what_was_read_of_it() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("a.csv");
        std::fs::write(&file, "abc").expect("written");
        let (_, read) = noted(|| text_file::read(&file).expect("read"));
        std::fs::write(&file, "written since").expect("written");
        let files = || [("measurements", file.clone()), ("again", file.clone())];
        let not_read = [("priors", folder.path().join("none.toml"))];
        let of =
            || Inputs::of(files().into_iter().chain(not_read.clone()), Some(folder.path()), &read);
        let mut inputs = of();
        // NIST FIPS 180-4, example "abc".
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let [one] = &inputs.files[..] else { panic!("{inputs:?}") };
        assert_eq!((one.name.as_str(), one.bytes, one.sha256.as_str()), ("a.csv", 3, sum));
        assert_eq!(inputs.by_role("measurements"), Some(one));
        assert_eq!(Inputs::together([Some(&inputs), Some(&inputs)]), Some(inputs.clone()));
        assert_eq!(Inputs::together([Some(&inputs), None]), None);
        // A program is as it is now, and the one before it is no part of the run any more.
        let program = folder.path().join("run.sh");
        for text in ["one", "another"] {
            std::fs::write(&program, text).expect("written");
            inputs.renew("program", [program.clone()], folder.path());
        }
        let [_, run] = &inputs.files[..] else { panic!("{inputs:?}") };
        assert_eq!((run.name.as_str(), run.bytes), ("run.sh", 7));
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).map_err(RunError::new)
        };
        assert_eq!(Inputs::read(folder.path()), Ok(None));
        inputs.write(&write).expect("written");
        assert_eq!(Inputs::read(folder.path()), Ok(Some(inputs)));
        std::fs::write(folder.path().join(FILE_NAME), "{").expect("written");
        let error = Inputs::read(folder.path()).expect_err("damaged");
        assert_eq!(error.mistake, Mistake::Damaged);
    }
}
