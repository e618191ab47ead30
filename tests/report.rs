//! `report.html`: one file for readers who were not there.

use std::fs;

use crate::sandbox::{Sandbox, root};

/// A text as a page writes it.
fn escaped(text: &str) -> String {
    let pairs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;"), ("'", "&#x27;")];
    let text = pairs.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to));
    text.replace('/', "&#x2f;")
}

fn page(sandbox: &Sandbox, folder: &str) -> String {
    fs::read_to_string(sandbox.path().join(folder).join("report.html")).expect("report.html")
}

#[test]
fn the_report_holds_the_summary_the_figures_the_command_and_the_sums_and_is_small() {
    let sandbox = Sandbox::new();
    sandbox.write("my.csv", "time_s,contact_ratio\n0.05,0.6\n0.1,0.8\n0.2,1.0\n0.5,1.05\n");
    let command =
        "calibrate --material ps --experiment my.csv --noise robust --samples 8192 --seed 3";
    let ran = sandbox.run(&format!("{} --out a&b", command.trim_start_matches("calibrate ")));
    let html = page(&sandbox, "a&b");
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    let mut lines = ran.succeeded().stdout.lines();
    let first = lines.next().expect("a headline");
    let (headline, _) = first.rsplit_once(" in ").expect("how long it took");
    assert!(html.contains(&escaped(headline)), "{headline}");
    // The page says what helps of any copy of the folder.
    for line in lines.filter(|line| !line.starts_with("  files:")) {
        let line = line.replace("a&b", "DIR");
        assert!(html.contains(&escaped(&line)), "{line}");
    }
    for shown in
        [command, "Posterior of each parameter", "Inverse-Gamma", "log-uniform", "EPJ Web of"]
    {
        assert!(html.contains(&escaped(shown)), "{shown}");
    }
    let sums = fs::read_to_string(sandbox.path().join("a&b/SHA256SUMS")).expect("the sums");
    for (sum, name) in sums.lines().filter_map(|line| line.split_once("  ")) {
        assert!(html.contains(sum) && html.contains(name), "{name}");
    }
    let inputs = sandbox.json("a&b/inputs.json");
    assert_eq!(inputs["files"][0]["name"], "my.csv");
    assert!(html.contains(inputs["files"][0]["sha256"].as_str().expect("a sum")));
    assert_eq!(html.matches("<img ").count(), 5);
    // The command is that which was given: it makes the same posterior.
    let arguments = format!("{} --out again", command.trim_start_matches("calibrate "));
    sandbox.run(&arguments).succeeded();
    assert_eq!(sandbox.posterior_bytes("again"), sandbox.posterior_bytes("a&b"));
}

#[test]
fn a_report_is_made_again_to_the_byte_and_also_of_a_run_that_has_none() {
    let sandbox = Sandbox::new();
    sandbox.run("--material pa12 --samples 8192 --out run").succeeded();
    let first = page(&sandbox, "run");
    fs::remove_file(sandbox.path().join("run/report.html")).expect("removed");
    let ran = sandbox.run("report run");
    assert_eq!(ran.succeeded().stdout, "run/report.html\n");
    assert!(page(&sandbox, "run") == first, "another report");
    for missing in ["inputs.json", "SHA256SUMS"] {
        fs::remove_file(sandbox.path().join("run").join(missing)).expect("removed");
    }
    assert_eq!(sandbox.run("report run/posterior.json --out x.html -q").succeeded().stdout, "");
    assert!(sandbox.path().join("x.html").is_file());
}

#[test]
fn a_report_of_what_is_no_calibration_or_damaged_is_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("report nothing").refused(&["nothing", "no such file"]);
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --out run -q").succeeded();
    sandbox.run("report run --out .").refused(&["a folder", "expected a file", "--out"]);
    sandbox.write("run/inputs.json", "{");
    sandbox.run("report run").refused(&["run/inputs.json", "no list of input files", "help: "]);
    fs::remove_file(sandbox.path().join("run/inputs.json")).expect("removed");
    let samples = sandbox.path().join("run/samples.csv");
    fs::write(&samples, fs::read_to_string(&samples).expect("read") + "1\n").expect("written");
    sandbox.run("report run").refused(&["samples.csv"]);
}

/// SHA-256 of an input of a run.
fn sum_of(sandbox: &Sandbox, run: &str, role: &str) -> String {
    let inputs = sandbox.json(&format!("{run}/inputs.json"));
    let files = inputs["files"].as_array().expect("a list");
    let file = files.iter().find(|file| file["role"] == role).expect(role);
    file["sha256"].as_str().expect("a sum").to_owned()
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_extended_run_names_what_was_read_for_it_and_the_commands_that_made_it() {
    let sandbox = Sandbox::new();
    let table = "time_s,contact_ratio\n0.05,0.6\n0.1,0.8\n0.2,1.0\n0.5,1.05\n";
    sandbox.write("my.csv", table);
    let begin = "--material ps --experiment my.csv --samples 8192 --seed 3";
    sandbox.run(&format!("{begin} -q")).succeeded();
    let before = sum_of(&sandbox, "results/my", "experiment");
    sandbox.write("my.csv", table.replace("0.8", "0.9"));
    sandbox.run("--continue-from results/my --samples 12000 -q").succeeded();
    sandbox.run("--continue-from results/my --samples 16384 -q").succeeded();
    assert_eq!(
        sum_of(&sandbox, "results/my", "experiment"),
        before,
        "what was read, not what is there"
    );
    sandbox.write("my.csv", table);
    sandbox.run("report results/my -q").succeeded();
    let html = page(&sandbox, "results/my");
    let commands = [
        format!("calibrate {begin}"),
        "calibrate --continue-from results/my --samples 12000".to_owned(),
        "calibrate --continue-from results/my --samples 16384".to_owned(),
    ];
    assert!(html.contains(&escaped(&commands.join("\n"))), "{html}");
    assert!(html.contains("This run was extended, from 8192 simulations to 16384."));
    // They make it again.
    let other = Sandbox::new();
    other.write("my.csv", table);
    for command in &commands {
        other.run(command.trim_start_matches("calibrate ")).succeeded();
    }
    assert_eq!(other.posterior_bytes("results/my"), sandbox.posterior_bytes("results/my"));
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_run_of_programs_names_the_files_that_it_began_with() {
    let sandbox = Sandbox::new();
    for name in ["impact.sh", "impact-force.txt", "impact-rebound.csv", "impact.toml"] {
        let text = fs::read_to_string(root().join("experiments/external").join(name)).expect(name);
        sandbox.write(name, text.replace("samples = 300", "samples = 40"));
    }
    sandbox.run("--plan impact.toml -q").succeeded();
    let sums = |role| sum_of(&sandbox, "results/impact", role);
    let before = [sums("measurements"), sums("plan")];
    for name in ["impact-force.txt", "impact.toml"] {
        let text = fs::read_to_string(sandbox.path().join(name)).expect(name);
        sandbox.write(name, text + "# noted since\n");
    }
    sandbox.run("--resume results/impact --samples 60 -q").succeeded();
    assert_eq!([sums("measurements"), sums("plan")], before);
    let html = page(&sandbox, "results/impact");
    let commands = "calibrate --plan impact.toml\ncalibrate --resume results/impact --samples 60";
    assert!(html.contains(&escaped(commands)), "{html}");
}

#[test]
fn other_kinds_of_run_are_named_with_the_report_that_they_have() {
    let sandbox = Sandbox::new();
    let pair = fs::read_to_string(root().join("experiments/scenes/pair.toml")).expect("a scene");
    sandbox.write("pair.toml", pair.replace("duration_s = 8.0", "duration_s = 0.01"));
    sandbox.run("scene pair.toml -q --out scene").succeeded();
    for command in [
        "report scene",
        "archive scene x.zip",
        "diff scene scene",
        "inspect scene",
        "report scene/scene.json",
    ] {
        sandbox.run(command).refused(&[
            "a scene (scene.json)",
            "a calibration",
            "scene/report.html is",
        ]);
    }
}
