//! A folder for one test, and the command run in it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// A folder that goes when the test ends.
pub(crate) struct Sandbox {
    folder: TempDir,
}

/// What a run of the command did.
#[derive(Debug)]
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    /// With a run of PS by 50 simulations in the folder `run`, whose samples were moved to moments that are known better than by their
    /// weights; and its seed.
    pub(crate) fn with_moved_samples() -> (Self, u64) {
        let run = |seed: u64| {
            let sandbox = Self::new();
            let options = "--samples 50 --no-other-kinetics --quiet --out run";
            sandbox.run(&format!("--material ps --seed {seed} {options}")).succeeded();
            (sandbox, seed)
        };
        let moved = |(sandbox, _): &(Self, u64)| {
            let samples = fs::read_to_string(sandbox.path().join("run/samples.csv"));
            samples.expect("samples").contains("moved_c1")
        };
        (1..=10).map(run).find(moved).expect("one of ten seeds")
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file, with the folders it is in.
    pub(crate) fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().expect("has a parent")).expect("a folder");
        fs::write(path, contents).expect("a file");
    }

    /// Runs `calibrate` here, with arguments separated by spaces.
    pub(crate) fn run(&self, arguments: &str) -> Ran {
        self.run_args(&arguments.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `calibrate` here.
    pub(crate) fn run_args(&self, arguments: &[&str]) -> Ran {
        let output = Command::new(env!("CARGO_BIN_EXE_calibrate"))
            .current_dir(self.path())
            .args(arguments)
            .output();
        Ran::of(output.expect("the command starts"))
    }

    /// A JSON file here.
    #[track_caller]
    pub(crate) fn json(&self, path: &str) -> Value {
        json(&self.path().join(path))
    }

    /// The bytes of a run's `posterior.json`.
    #[track_caller]
    pub(crate) fn posterior_bytes(&self, folder: &str) -> Vec<u8> {
        fs::read(self.path().join(folder).join("posterior.json")).expect("posterior.json")
    }

    /// A run's `posterior.json`, held against the schema.
    #[track_caller]
    pub(crate) fn posterior(&self, folder: &str) -> Value {
        let file = self.json(&format!("{folder}/posterior.json"));
        let schema = json(&root().join("crates/workbench/schema/posterior.schema.json"));
        let validator = jsonschema::validator_for(&schema).expect("a schema");
        let mistakes: Vec<String> =
            validator.iter_errors(&file).map(|error| error.to_string()).collect();
        assert!(mistakes.is_empty(), "{mistakes:#?}");
        file
    }

    /// Every file with its contents, to see that nothing changed.
    pub(crate) fn snapshot(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(self.path(), &mut files);
        files
    }
}

fn collect(folder: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.insert(path.clone(), Vec::new());
            collect(&path, files);
        } else {
            files.insert(path.clone(), fs::read(&path).expect("a file"));
        }
    }
}

impl Ran {
    pub(crate) fn of(output: Output) -> Self {
        Self {
            code: output.status.code().expect("the command ends by itself"),
            stdout: String::from_utf8(output.stdout).expect("UTF-8"),
            stderr: String::from_utf8(output.stderr).expect("UTF-8"),
        }
    }

    /// The command did what it was asked.
    #[track_caller]
    pub(crate) fn succeeded(&self) -> &Self {
        assert_eq!(self.code, 0, "{self:#?}");
        self
    }

    /// What a command that did what it was asked wrote to standard output.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.succeeded().stdout).expect("JSON")
    }

    /// The command refused with exit 2, one `error:`, and these words on standard error.
    #[track_caller]
    pub(crate) fn refused(&self, words: &[&str]) -> &Self {
        assert_eq!(self.code, 2, "{self:#?}");
        assert_eq!(self.stdout, "", "{self:#?}");
        assert!(self.stderr.starts_with("error: "), "{self:#?}");
        assert!(!self.stderr.contains("panicked"), "{self:#?}");
        for word in words {
            assert!(self.stderr.contains(word), "{word:?} is not in\n{}", self.stderr);
        }
        self
    }
}

/// A JSON file.
#[track_caller]
pub(crate) fn json(path: &Path) -> Value {
    let text = fs::read_to_string(path);
    let text = text.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}

/// The root of the repository.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}
