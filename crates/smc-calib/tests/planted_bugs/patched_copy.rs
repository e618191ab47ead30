//! A copy of the crate with the mistakes put in: small replacements of text that call [`mistakes.rs`](mistakes.rs) at
//! the seams between formulas.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// File, its text, and what the copy has in place of it.
type Patch = (&'static str, &'static str, &'static str);

const PATCHES: [Patch; 11] = [
    ("lib.rs", "mod path;\n", "mod path;\nmod planted;\n"),
    (
        "mixture.rs",
        "Self { weight, mean, factor, inverse, peak: ln_peak.exp() }",
        "crate::planted::component(Self { weight, mean, factor, inverse, peak: ln_peak.exp() })",
    ),
    (
        "sampler.rs",
        "                let net =\n",
        "                let k = crate::planted::scrambling(k);\n                let net =\n",
    ),
    (
        "sampler.rs",
        "let mut z = vec![0.0; points * d];",
        "let net = crate::planted::net(net, width, proposal.degrees_of_freedom);\n\
         let mut z = vec![0.0; points * d];",
    ),
    (
        "sampler.rs",
        "self.proposals.push((replicates.len(), proposal));",
        "self.proposals.push((replicates.len(), crate::planted::remembered(proposal, stage)));",
    ),
    (
        "sampler.rs",
        "self.pool.ln_base().iter().zip(&self.pool.ln_l)",
        "self.pool.ln_base().iter().zip(crate::planted::likelihoods(&self.pool.ln_l))",
    ),
    (
        "control/frozen.rs",
        "self.pool.ln_l[range.clone()].iter().zip(&ln_q).map(|(l, q)| l - q)",
        "crate::planted::likelihoods(&self.pool.ln_l[range.clone()]).iter().zip(&ln_q).map(|(l, q)| l - q)",
    ),
    (
        "pool.rs",
        "(student / total).ln() - ln_prior))\n            .collect();\n",
        "(student / total).ln() - ln_prior))\n            .collect();\n        crate::planted::mixture(self, proposals);\n",
    ),
    (
        "noise/likelihood.rs",
        "outputs.iter().zip(&self.values).map(|(o, y)| (y - o) * (y - o)).sum()",
        "crate::planted::outputs(outputs).iter().zip(&self.values).map(|(o, y)| (y - o) * (y - o)).sum()",
    ),
    (
        "estimate.rs",
        "(self.wider * squares / (r * (r - 1)) as f64).max(unknown).sqrt()",
        "crate::planted::standard_error((self.wider * squares / (r * (r - 1)) as f64).max(unknown).sqrt(), r)",
    ),
    (
        "noise_summary.rs",
        "(0.5 * (sum0 + s) / g).sqrt()",
        "crate::planted::sigma((0.5 * (sum0 + s) / g).sqrt())",
    ),
];

/// A source file of the crate with its patches.
///
/// # Panics
/// Where a patch does not fit in exactly one place.
pub(crate) fn patched(file: &str, text: String) -> String {
    PATCHES.iter().filter(|patch| patch.0 == file).fold(text, |text, (_, from, to)| {
        let places = text.matches(from).count();
        assert_eq!(places, 1, "the patch of src/{file} fits in {places} places:\n{from}");
        text.replace(from, to)
    })
}

/// Puts all patches into the sources of the crate, in memory.
///
/// # Panics
/// As [`patched`].
pub(crate) fn patch_all() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (file, ..) in PATCHES {
        patched(file, fs::read_to_string(sources.join(file)).unwrap());
    }
}

/// The copy, a workspace of its own.
pub(crate) struct PatchedCopy {
    root: PathBuf,
}

impl PatchedCopy {
    /// Writes the copy into the build folder.
    pub(crate) fn write() -> Self {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let workspace = here.ancestors().nth(2).unwrap();
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("planted-mistakes");
        let copy = root.join("crates/smc-calib");
        let manifest = fs::read_to_string(workspace.join("Cargo.toml")).unwrap();
        let (_, shared) = manifest.split_once("[workspace.package]").unwrap();
        let members = "[workspace]\nresolver = \"3\"\nmembers = [\"crates/smc-calib\"]\n";
        write(&root.join("Cargo.toml"), format!("{members}\n[workspace.package]{shared}"));
        write(&root.join("Cargo.lock"), fs::read_to_string(workspace.join("Cargo.lock")).unwrap());
        for part in ["README.md", "src", "tests/planted_bugs"] {
            copy_into(&here.join(part), &copy.join(part));
        }
        // These tests need none of the packages that the crate's others do.
        let manifest = fs::read_to_string(here.join("Cargo.toml")).unwrap();
        let (own, _) = manifest.split_once("[dev-dependencies]").unwrap();
        write(&copy.join("Cargo.toml"), format!("{own}[lints]\nworkspace = true\n"));
        let mistakes = include_str!("mistakes.rs").to_owned();
        write(&copy.join("src/planted.rs"), mistakes);
        Self { root }
    }

    /// Runs an ignored test of this file in the copy, with one mistake planted; what it printed.
    pub(crate) fn run(&self, test: &str, mistake: &str) -> String {
        let run = Command::new(env!("CARGO"))
            .args(["test", "--offline", "--quiet", "--package", "smc-calib"])
            .args(["--test", "planted_bugs", "--", "--ignored", "--exact", "--nocapture", test])
            .current_dir(&self.root)
            // Of its own: in a shared one the copy would be taken for the crate itself, mistakes and all.
            .env("CARGO_TARGET_DIR", self.root.join("target"))
            .env("PLANTED", mistake)
            .output()
            .unwrap();
        let printed = String::from_utf8_lossy(&run.stdout).into_owned();
        assert!(run.status.success(), "{printed}\n{}", String::from_utf8_lossy(&run.stderr));
        printed
    }
}

/// Copies a file or a folder, sources patched.
fn copy_into(from: &Path, to: &Path) {
    if !from.is_dir() {
        let text = fs::read_to_string(from).unwrap();
        let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let in_src = from.strip_prefix(sources).ok().and_then(Path::to_str);
        write(to, if let Some(name) = in_src { patched(name, text) } else { text });
        return;
    }
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        copy_into(&path, &to.join(path.file_name().unwrap()));
    }
}

/// Writes a file where it differs, so that nothing is compiled again for nothing.
fn write(path: &Path, text: String) {
    if fs::read_to_string(path).is_ok_and(|old| old == text) {
        return;
    }
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}
