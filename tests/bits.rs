//! The numbers of the calibrations and of a scene, to the bit: hashes of `samples.csv`, `draws.csv` and `series.csv` that
//! a change of the code must keep. Where a change of numbers is meant, the changelog says so and the hashes are renewed
//! (`sha256sum` of the files that the commands below write).
//!
//! The bits belong to a kind of machine: exponentials and logarithms are those of its C library, and vectors are as wide
//! as its processor's. On another kind the tests say so and hold nothing.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use sha2::{Digest as _, Sha256};

use crate::sandbox::{Sandbox, root};

/// Fingerprint of the kind of machine that the hashes were taken on.
const MACHINE: &str = "9d865ad1e097da21";

/// Arguments of the command, and the files that it leaves with the first digits of their SHA-256.
type Kept = (&'static str, &'static [(&'static str, &'static str)]);

const KEPT: [Kept; 10] = [
    (
        "--material ps --seed 1 --no-other-kinetics",
        &[("samples.csv", "f9f8a002d9309ebc"), ("draws.csv", "cd6d919643663ff6")],
    ),
    (
        "--material ps --seed 2 --no-other-kinetics",
        &[("samples.csv", "c7c4424f36cf0ed9"), ("draws.csv", "c2728e1c61a1f2d2")],
    ),
    (
        "--material ps --solver quasi-static --samples 2048",
        &[("samples.csv", "b4a4fb814a3b5dfe"), ("draws.csv", "22cce442acff51c6")],
    ),
    (
        "--material pa12 --seed 1 --no-other-kinetics",
        &[("samples.csv", "71d1a0c2b3acaee9"), ("draws.csv", "f6b5885bdda982d3")],
    ),
    (
        "--material pa12 --seed 2 --no-other-kinetics",
        &[("samples.csv", "dbfc4594f355bae5"), ("draws.csv", "060a64fda61dcceb")],
    ),
    (
        "--material pa12 --solver quasi-static",
        &[("samples.csv", "a5af69d75cc5817e"), ("draws.csv", "3a0185f3f23a0fff")],
    ),
    (
        "--material peek --seed 1 --no-other-kinetics",
        &[("samples.csv", "5876d340d257033a"), ("draws.csv", "a910fe64588a0ded")],
    ),
    (
        "--material peek --seed 2 --no-other-kinetics",
        &[("samples.csv", "90b188caa1346089"), ("draws.csv", "f8879997d510aee3")],
    ),
    (
        "--material peek --solver quasi-static --samples 60",
        &[("samples.csv", "ec3fbea2f5cf8e21"), ("draws.csv", "18d7c288d74eb921")],
    ),
    ("scene experiments/scenes/four-particles.toml", &[("series.csv", "78d3c6ecd45f4b48")]),
];

/// Of `--plan experiments/external/impact.toml`, held by `campaign::runs::the_example_runs_and_finds_what_it_was_made_of`.
const IMPACT: [(&str, &str); 2] =
    [("samples.csv", "43b6b95976d6acf1"), ("draws.csv", "86bda836bb7c014c")];

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().take(8).fold(String::new(), |mut hex, byte| {
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// Elementary functions of the C library on a grid, and the width of the processor's vectors.
fn machine() -> String {
    let mut bytes = Vec::new();
    for k in 1..4000 {
        let x = 0.37 * f64::from(k);
        let values = [(-0.01 * x).exp(), x.ln(), x.powf(0.731), (0.01 * x).exp_m1(), x.cbrt()];
        let more = [x.ln_1p(), x.log10(), x.sin(), (0.001 * x).tanh()];
        bytes.extend(values.into_iter().chain(more).flat_map(f64::to_le_bytes));
    }
    #[cfg(target_arch = "x86_64")]
    let vectors = [
        std::is_x86_feature_detected!("fma"),
        std::is_x86_feature_detected!("avx2"),
        std::is_x86_feature_detected!("avx512f"),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let vectors = [false; 3];
    bytes.extend(vectors.map(u8::from));
    hash(&bytes)
}

/// Whether this is another kind of machine, which it says.
fn skipped() -> bool {
    let here = machine();
    if here != MACHINE {
        eprintln!("SKIPPED: this is another kind of machine ({here}), with bits of its own");
    }
    here != MACHINE
}

/// Holds files of a run against the first digits of their hashes.
fn hold(what: &str, folder: &Path, files: &[(&str, &str)]) {
    for (name, kept) in files {
        let found = fs::read(folder.join(name)).expect("a file of the run");
        assert_eq!(hash(&found), *kept, "{what}: {name}");
    }
}

/// Holds the run of the example of a program against its hashes.
pub(crate) fn hold_impact(folder: &Path) {
    if !skipped() {
        hold("impact", folder, &IMPACT);
    }
}

#[test]
fn the_numbers_are_the_same_bits_as_before() {
    if skipped() {
        return;
    }
    for (arguments, files) in KEPT {
        let arguments =
            arguments.replace("experiments/", &format!("{}/experiments/", root().display()));
        let sandbox = Sandbox::new();
        sandbox.run(&format!("{arguments} --quiet --out run")).succeeded();
        hold(&arguments, &sandbox.path().join("run"), files);
    }
}
