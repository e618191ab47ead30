//! `calibrate plot`: the figures of a saved run, from its files alone.

use std::fs;

use crate::sandbox::Sandbox;

const FIGURES: [&str; 5] = ["fit", "corner", "recursion", "convergence", "residuals"];

fn figure(sandbox: &Sandbox, folder: &str, name: &str) -> Vec<u8> {
    fs::read(sandbox.path().join(folder).join(name)).expect("a figure")
}

#[test]
fn saved_figures_are_redrawn_byte_for_byte_and_options_change_them() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --quiet --out run").succeeded();
    let before = sandbox.snapshot();
    sandbox.run("plot run --quiet").succeeded();
    assert_eq!(sandbox.snapshot(), before, "redrawn in place, the folder is the same");
    sandbox.run("plot run/posterior.json --out again").succeeded();
    sandbox.run("plot run --log-time --width full --out other --quiet").succeeded();
    for name in FIGURES {
        for kind in ["png", "svg"] {
            let name = format!("{name}.{kind}");
            let own = figure(&sandbox, "run", &name);
            assert_eq!(figure(&sandbox, "again", &name), own, "{name}");
            assert_ne!(figure(&sandbox, "other", &name), own, "{name} at full width");
        }
    }
    for file in ["posterior.json", "samples.csv"] {
        assert!(!sandbox.path().join("again").join(file).exists(), "only figures are written");
    }
}

#[test]
fn runs_that_are_damaged_or_not_whole_are_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("plot nowhere").refused(&["nowhere", "no such file"]);
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --quiet --out run").succeeded();
    let samples = fs::read_to_string(sandbox.path().join("run/samples.csv")).expect("samples");
    let cut = &samples[..samples.len() / 2];
    sandbox.write("run/samples.csv", cut.rsplit_once(',').expect("a comma").0);
    sandbox.run("plot run").refused(&["samples.csv", "cut off"]);
    fs::remove_file(sandbox.path().join("run/samples.csv")).expect("removed");
    sandbox.run("plot run").refused(&["samples.csv", "no such file"]);
    sandbox.write("run/posterior.json", "{\"schema_version\": 1, ");
    sandbox.run("plot run").refused(&["posterior.json", "cut off"]);
    sandbox.run("plot run --width huge").refused(&["--width", "column"]);
}
