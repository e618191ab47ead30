//! `calibrate runs`: what results are there.

use std::fs;

use crate::sandbox::{Sandbox, root};

#[test]
fn results_are_listed_with_what_is_superseded_damaged_or_none() {
    let sandbox = Sandbox::new();
    for seed in [1, 2] {
        let run = format!("--material ps --samples 8192 --seed {seed} -q --no-other-kinetics");
        sandbox.run(&run).succeeded();
    }
    let pair = fs::read_to_string(root().join("experiments/scenes/pair.toml")).expect("a scene");
    sandbox.write("pair.toml", pair.replace("duration_s = 8.0", "duration_s = 0.01"));
    sandbox.run("scene pair.toml -q").succeeded();
    sandbox.write("results/notes/mine.txt", "mine");
    sandbox.write("results/broken/posterior.json", "{\"schema_version\": 2,");
    sandbox.write("results/half/scene.json", "{\"plan\": 3}");
    let before = sandbox.snapshot();
    let ran = sandbox.run("runs");
    let lines: Vec<&str> = ran.succeeded().stdout.lines().collect();
    assert!(lines[0].starts_with("name") && lines[0].ends_with("size"), "{lines:#?}");
    let line = |start: &str| {
        let found = lines.iter().find(|line| line.starts_with(start));
        *found.unwrap_or_else(|| panic!("{start} is not in {lines:#?}"))
    };
    for words in ["scene", "2 particles", "1 warning", " MB"] {
        assert!(line("pair ").contains(words), "{words}: {lines:#?}");
    }
    for name in ["ps ", "ps.1 (superseded)"] {
        assert!(line(name).contains("calibration  ps"), "{lines:#?}");
        assert!(line(name).contains("ps-r30.csv") && line(name).contains("second"), "{lines:#?}");
    }
    assert!(line("results/notes").ends_with("no run of this program"));
    assert!(line("results/broken").contains("damaged: the end of the file"), "{lines:#?}");
    assert!(line("results/half").contains("damaged: without a plan"), "{lines:#?}");
    assert_eq!(line("  rm "), "  rm -r -- results/ps.1");
    assert!(sandbox.snapshot() == before, "nothing is changed");

    let json = sandbox.run("runs --json").json();
    let runs = json["runs"].as_array().expect("a list");
    assert_eq!(runs.len(), 6);
    let day = runs.iter().find(|run| run["name"] == "ps").expect("ps")["written"].clone();
    assert!(day.as_str().is_some_and(|day| day.starts_with("20") && day.len() == 10), "{day}");
    // What the command removes is what was superseded.
    fs::remove_dir_all(sandbox.path().join("results/ps.1")).expect("removed");
    let after = sandbox.run("runs results");
    assert!(!after.succeeded().stdout.contains("superseded"), "{}", after.stdout);
    let one = sandbox.run("runs results/ps");
    assert_eq!(one.succeeded().stdout.lines().count(), 2, "{}", one.stdout);
}

#[test]
fn a_folder_without_results_says_so_and_one_that_is_not_there_is_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("runs").refused(&["results", "no such folder", "calibrate --material ps"]);
    sandbox.write("results/.hidden/x", "x");
    assert_eq!(sandbox.run("runs").succeeded().stdout, "results: no results\n");
    sandbox.write("file", "x");
    sandbox.run("runs file").refused(&["file", "cannot be read as a folder"]);
}
