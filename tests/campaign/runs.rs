//! Plans of programs that run through: what is found, what fails, what is refused.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{LINE_CSV, LINE_SH, line, line_plan, status};
use crate::bits::hold_impact;
use crate::sandbox::{Sandbox, root};

#[test]
fn the_example_runs_and_finds_what_it_was_made_of() {
    let sandbox = Sandbox::new();
    for file in ["impact.toml", "impact.sh", "impact-force.txt", "impact-rebound.csv"] {
        let contents = fs::read(root().join("experiments/external").join(file)).expect("a file");
        sandbox.write(&format!("plans/{file}"), contents);
    }
    let checked = sandbox.run("check plans/impact.toml");
    assert!(checked.succeeded().stdout.contains("the plan impact: 2 parameters"), "{checked:?}");
    let before = sandbox.snapshot();
    let dry = sandbox.run("--plan plans/impact.toml --dry-run");
    assert!(dry.succeeded().stdout.contains("impact.sh"), "{}", dry.stdout);
    assert_eq!(sandbox.snapshot(), before, "--dry-run writes nothing");

    let ran = sandbox.run("--plan plans/impact.toml");
    ran.succeeded();
    assert!(ran.stdout.contains("stiffness"), "{}", ran.stdout);
    assert!(ran.stdout.lines().count() < 16, "{}", ran.stdout);
    let file = sandbox.posterior("results/impact");
    for (place, truth) in [(0, 1000.0), (1, 0.0045)] {
        let median = file["parameters"][place]["in_si"]["median"].as_f64().expect("a number");
        assert!((median / truth - 1.0).abs() < 0.15, "{median} for {truth}");
    }
    for name in [
        "corner.png",
        "recursion.svg",
        "convergence.png",
        "fit-force.png",
        "residuals-force.svg",
        "report.html",
        "table.md",
        "table.csv",
        "fit.csv",
        "samples.csv",
        "draws.csv",
        "samples-grainlearning.txt",
    ] {
        assert!(sandbox.path().join("results/impact").join(name).is_file(), "{name}");
    }
    let draws = fs::read_to_string(sandbox.path().join("results/impact/draws.csv"));
    let draws = draws.expect("draws.csv");
    let header = draws.lines().next().expect("a header");
    assert_eq!(
        header,
        "stiffness [N/m],damping [N s/m],z_stiffness [1],z_damping [1],sigma_force [N],sigma_restitution [1],sample"
    );
    let predicted = sandbox.run("predict --posterior results/impact --contact-ratio 0.9");
    predicted.refused(&["drop, which a program simulates", "one pair of particles"]);
    let inspected = sandbox.run("inspect results/impact");
    assert!(inspected.succeeded().stdout.contains("correlation"), "{}", inspected.stdout);
    assert_eq!(status(&sandbox, "results/impact")["state"], "done");
    let snapshot = sandbox.snapshot();
    sandbox.run("plot results/impact").succeeded();
    assert_eq!(sandbox.snapshot(), snapshot, "the figures are drawn again, byte for byte");

    // The same again is not run again, and nothing is lost to a second --plan.
    let again = sandbox.run("--plan plans/impact.toml");
    again.refused(&["holds a run already", "--resume results/impact"]);
    let bytes = sandbox.posterior_bytes("results/impact");
    sandbox.run("--resume results/impact --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/impact"), bytes);
    for command in ["status", "export", "--resume"] {
        sandbox.run(&format!("{command} plans")).refused(&["plans"]);
        sandbox.run(&format!("{command} nowhere")).refused(&["nowhere"]);
    }
    hold_impact(&sandbox.path().join("results/impact"));
}

/// Moments of the parameters of a posterior.
fn moments(file: &Value) -> Vec<f64> {
    let parameters = file["parameters"].as_array().expect("a list");
    let number = |value: &Value| value.as_f64().expect("a number");
    parameters
        .iter()
        .flat_map(|p| [number(&p["in_coordinate"]["mean"]), number(&p["in_coordinate"]["sd"])])
        .chain([number(&file["log_evidence"]["value"])])
        .collect()
}

#[test]
#[ignore = "long: run by .ci/run"]
fn two_radii_together_are_the_same_through_the_built_in_simulator_and_through_a_command() {
    let parameters = r#"
[parameters.c1]
unit = "1/(Pa s)"
distribution = "log-uniform"
lower = 1e-5
upper = 1e-3
[parameters.tau_s]
unit = "s"
distribution = "log-uniform"
lower = 1.0
upper = 10.0
[parameters.delta_c]
unit = "m"
distribution = "log-uniform"
lower = 1e-8
upper = 1e-6
[sampler]
samples = 64
"#;
    let sandbox = Sandbox::new();
    let mut builtin = format!("name = \"builtin\"\n{parameters}");
    let mut command = format!("name = \"command\"\n{parameters}");
    let calibrate = env!("CARGO_BIN_EXE_calibrate");
    for experiment in ["pa12-r32", "pa12-r30"] {
        let read =
            workbench::input::experiment::Experiment::built_in(experiment).expect("built in");
        let radius = read.powder.radius_m;
        sandbox.write(&format!("{experiment}.csv"), read.table.to_csv());
        builtin.push_str(&format!(
            "[experiments.{experiment}.simulator]\nkind = \"builtin\"\nexperiment = \"{experiment}\"\n\
             solver = \"closed-form\"\ntau_s_radius_m = 31.5e-6\n"
        ));
        command.push_str(&format!(
            r#"
[experiments.{experiment}.simulator]
kind = "command"
argv = ["sh", "-c", """
tau=$(awk 'BEGIN {{{{ printf "%.17g", {{tau_s}} * ({radius:e} / 31.5e-6) }}}}')
exec {calibrate} simulate --experiment {experiment} --solver closed-form --c1 {{c1}} --tau-s $tau \
    --delta-c {{delta_c}} --times {{plan_dir}}/{experiment}.csv --out neck.csv --quiet
"""]
[experiments.{experiment}.observables.contact_ratio]
table = "{experiment}.csv"
control = "time_s"
noise = {{ kind = "inferred", nu0 = 4, s0 = 0.05 }}
result = {{ file = "neck.csv", control = "time_s", value = "contact_ratio", interpolate = "refuse" }}
"#
        ));
    }
    sandbox.write("builtin.toml", builtin);
    sandbox.write("command.toml", command);
    sandbox.run("--plan builtin.toml --quiet").succeeded();
    sandbox.run("--plan command.toml --quiet").succeeded();
    let one = moments(&sandbox.posterior("results/builtin"));
    let other = moments(&sandbox.posterior("results/command"));
    assert_eq!(one.len(), 7);
    for (a, b) in one.iter().zip(&other) {
        assert!((a - b).abs() <= 1e-8 * a.abs().max(1e-3), "{one:?}\n{other:?}");
    }
}

#[test]
fn failing_runs_are_counted_by_cause_and_the_rest_is_used() {
    let sandbox = line(48, "0");
    sandbox.write(
        "line.sh",
        r#"#!/bin/sh
case $(awk -v a="$1" 'BEGIN { print int(a * 2) }') in
0) echo "no convergence" >&2; exit 3 ;;
1) sleep 100 & wait ;;
2) printf 't,y\n1,nan\n2,2\n3,3\n' > out.csv ;;
3) printf 't,z\n1,1\n2,2\n3,3\n' > out.csv ;;
*) awk -v a="$1" 'BEGIN { print "t,y"; for (t = 0; t <= 4; t++) print t "," a * t }' > out.csv ;;
esac
"#,
    );
    // A first stage from the prior that is large enough to meet every cause.
    let plan = line_plan(48, "0")
        .replace("timeout_s = 60", "timeout_s = 0.3")
        .replace("samples = 48", "samples = 48\nbatch = 32");
    sandbox.write("line.toml", plan.replace("\"none\"", "\"failed\""));
    let ran = sandbox.run("--plan line.toml");
    ran.succeeded();
    let file = sandbox.posterior("results/line");
    sandbox.run("export results/line").succeeded();
    let samples = fs::read_to_string(sandbox.path().join("results/line/export/samples.csv"));
    let samples = samples.expect("samples.csv");
    // What each sample must have come to, from its parameter alone.
    let mut expected = [0; 5];
    for row in samples.lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let a: f64 = fields[1].parse().expect("a number");
        let class = ((a * 2.0) as usize).min(4);
        expected[class] += 1;
        assert_eq!(fields[2], if class < 4 { "failed" } else { "finished" }, "{row}");
    }
    assert!(expected.iter().all(|&count| count > 0), "{expected:?}");
    let failures = file["failures"].as_array().expect("a list");
    assert_eq!(failures.len(), 4, "{failures:#?}");
    for (word, count) in [("code 3", expected[0]), ("0.3 s", expected[1]), ("z", 0)] {
        let found = failures
            .iter()
            .find(|failure| failure["cause"].as_str().is_some_and(|cause| cause.contains(word)));
        if count > 0 {
            let found = found.unwrap_or_else(|| panic!("{word} is not in {failures:#?}"));
            assert_eq!(found["count"], count, "{failures:#?}");
        }
    }
    let mut counts: Vec<u64> =
        failures.iter().filter_map(|failure| failure["count"].as_u64()).collect();
    counts.sort_unstable();
    let mut wanted: Vec<u64> = expected[..4].to_vec();
    wanted.sort_unstable();
    assert_eq!(counts, wanted, "{failures:#?}");
    let state = status(&sandbox, "results/line");
    assert_eq!(state["failed"], wanted.iter().sum::<u64>(), "{state:#?}");
    assert!(ran.stdout.contains("failed"), "{}", ran.stdout);
    // The folders of failed runs stay, with what they said.
    let said = walk(&sandbox.path().join("results/line/campaign/work"))
        .iter()
        .filter(|path| path.ends_with("stderr"))
        .any(|path| fs::read_to_string(path).is_ok_and(|text| text.contains("no convergence")));
    assert!(said, "stderr of failed runs is kept");
}

pub(super) fn walk(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    entries
        .map(|entry| entry.expect("an entry").path())
        .flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] })
        .collect()
}

#[test]
fn a_simulator_that_never_works_is_a_failed_run_and_a_plan_in_json_is_a_plan() {
    let sandbox = line(24, "0");
    sandbox.write("line.sh", "echo broken >&2; exit 7\n");
    let ran = sandbox.run("--plan line.toml");
    assert_eq!(ran.code, 1, "{ran:#?}");
    for words in ["exit code 7", "calibrate export results/line"] {
        assert!(ran.stderr.contains(words), "{words} is not in\n{}", ran.stderr);
    }
    sandbox.run("export results/line").succeeded();
    let written = fs::read_to_string(sandbox.path().join("results/line/export/runs.csv"));
    assert!(written.expect("runs.csv").contains("exit code 7"));
    let stopped = status(&sandbox, "results/line");
    assert_eq!((&stopped["state"], &stopped["reported"]), (&"stopped".into(), &false.into()));
    sandbox.run("inspect results/line").refused(&["no posterior yet", "--resume"]);

    let value: toml::Value = toml::from_str(&line_plan(24, "0")).expect("TOML");
    sandbox.write("json/line.json", serde_json::to_string(&value).expect("JSON"));
    sandbox.write("json/line.sh", LINE_SH);
    sandbox.write("json/line.csv", LINE_CSV);
    let checked = sandbox.run("check json/line.json");
    assert!(checked.succeeded().stdout.contains("the plan line: 1 parameter,"), "{checked:?}");
    sandbox.run("--plan json/line.json --out json/run --quiet").succeeded();
    assert_eq!(status(&sandbox, "json/run")["state"], "done");
}

#[test]
fn sample_tables_of_grain_learning_are_run_as_they_stand_and_written_again() {
    let sandbox = line(24, "0");
    let table = "!OMP_NUM_THREADS description key a \n 8 Iter0-Sample0 0 1.9\n 8 Iter0-Sample1 1 2.05\n\
                 \x208 Iter0-Sample2 2 2.2\n 8 Iter0-Sample3 3 4.9\n";
    sandbox.write("sets.txt", table);
    sandbox.write("line.toml", line_plan(24, "0").replace("samples = 24", "design = \"sets.txt\""));
    let ran = sandbox.run("--plan line.toml");
    assert!(ran.succeeded().stdout.contains("weighted as draws from the prior"), "{}", ran.stdout);
    let run = fs::read_to_string(sandbox.path().join("runs.txt")).expect("runs");
    let mut run: Vec<&str> = run.lines().collect();
    run.sort_unstable();
    assert_eq!(run, ["1.9", "2.05", "2.2", "4.9"], "the very parameters of the table");
    sandbox.run("export results/line").succeeded();
    let written = sandbox.path().join("results/line/export/samples-grainlearning.txt");
    let back = workbench::input::sample_table::SampleTable::read(&written).expect("a table");
    assert_eq!(back.parameters, ["a"]);
    assert_eq!(back.rows.len(), 4);
    for (row, truth) in back.rows.iter().zip([1.9, 2.05, 2.2, 4.9]) {
        assert!((row[0] - truth).abs() < 1e-12, "{row:?}");
    }
    // Weights are the likelihoods: of the inferred noise, a Student t of 4 + 3 degrees of freedom.
    let file = sandbox.posterior("results/line");
    let weight = |a: f64| {
        let s: f64 = [(1.0, 2.1), (2.0, 3.9), (3.0, 6.2)]
            .map(|(t, y)| (y - a * t) * (y - a * t))
            .iter()
            .sum();
        (1.0 + s / (4.0 * 0.04)).powf(-3.5)
    };
    let sets = [1.9, 2.05, 2.2, 4.9];
    let total: f64 = sets.iter().map(|&a| weight(a)).sum();
    let mean = sets.iter().map(|&a| a * weight(a)).sum::<f64>() / total;
    let found = file["parameters"][0]["in_si"]["mean"].as_f64().expect("a number");
    assert!((found - mean).abs() < 1e-9, "{found} for {mean}");
}

/// Until version 0.1.0 the runs lay in the folder itself, and the results in `report/`.
#[test]
fn a_run_in_the_layout_of_an_older_version_is_refused_with_a_sentence_and_left_alone() {
    let sandbox = line(24, "0");
    sandbox.write("old/campaign.json", "{\"format\":1}");
    sandbox.write("old/report/posterior.json", "{\"schema_version\":1}");
    let before = sandbox.snapshot();
    for command in
        ["--resume old", "status old", "export old", "--plan line.toml --out old", "inspect old"]
    {
        sandbox.run(command).refused(&["older version", "--out"]);
    }
    assert_eq!(sandbox.snapshot(), before);
}

#[test]
fn input_files_are_put_into_the_folder_of_every_run_and_a_change_is_noticed() {
    let sandbox = line(24, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    // The same line, by a program that reads an input file, a table that is linked and a folder that is copied.
    sandbox.write("inputs/line.in", "# ${a} {a}\nslope={{a}}\nseed={{ seed }} run={{run}}\n");
    sandbox.write("inputs/times.txt", "0 1 2 3 4\n");
    sandbox.write(
        "case/deep/program.awk",
        "BEGIN { print \"t,y\" } { for (i = 1; i <= NF; i++) printf \"%d,%.17g\\n\", $i, a * $i }",
    );
    let reads = "set -eu; echo x >> \"$RUNS\"; grep -q '^# ${{a}} {{a}}$' line.in; . ./line.in; touch case/mine; \
                 awk -v a=$slope -f case/deep/program.awk times.txt > out.csv";
    let argv = format!("argv = [\"sh\", \"-c\", {reads:?}]");
    let files =
        "copy = [\"case\"]\nlink = [\"inputs/times.txt\"]\ntemplates = [\"inputs/line.in\"]";
    let plan = line_plan(24, "0").replace(
        "argv = [\"sh\", \"{plan_dir}/line.sh\", \"{a}\", \"0\"]",
        &format!("{argv}\n{files}"),
    );
    sandbox.write("files.toml", plan.as_str());
    let said = sandbox.run("--plan files.toml --dry-run");
    assert!(said.succeeded().stdout.contains("filled in   inputs/line.in"), "{}", said.stdout);
    sandbox.run("--plan files.toml --out results/files --quiet").succeeded();
    let samples =
        |run: &str| fs::read(sandbox.path().join("results").join(run).join("samples.csv"));
    assert!(samples("files").expect("samples") == samples("line").expect("samples"));
    assert!(!sandbox.path().join("case/mine").exists(), "runs have copies");

    // One more file in a folder that is copied is a change too.
    sandbox.write("case/deep/more", "");
    sandbox.run("--resume results/files").refused(&["case has changed since the run began"]);
    fs::remove_file(sandbox.path().join("case/deep/more")).expect("removed");
    sandbox.run("--resume results/files --quiet").succeeded();
    // Changed after the run: it is not taken up with both.
    sandbox.write("case/deep/program.awk", "BEGIN { print 1 }");
    sandbox.run("--resume results/files").refused(&["program.awk has changed since the run began"]);

    for (what, by, words) in [
        ("\"inputs/line.in\"", "\"inputs/lines.in\"", ["templates", "lines.in"]),
        ("\"case\"", "\"case\", \"inputs/times.txt\"", ["times.txt", "each other's place"]),
        ("\"case\"", "\"out.csv\"", ["out.csv", "leaves its result"]),
        ("\"case\"", "\"parameters.json\"", ["parameters.json", "every run has"]),
        ("\"case\"", "\"..\"", ["copy", "the name of a file or folder"]),
        ("\"inputs/line.in\"", "\"inputs/times.txt\"", ["times.txt", "stands in copy or link"]),
        ("\"inputs/line.in\"", "\"wrong.in\"", ["wrong.in, line 2", "{{aa}}"]),
        ("\"inputs/line.in\"", "\"other.in\"", ["parameters.a", "no command uses"]),
        ("\"inputs/line.in\"", "\"case\"", ["case", "a directory"]),
    ] {
        sandbox.write("out.csv", "t,y\n");
        sandbox.write("parameters.json", "{}");
        sandbox.write("wrong.in", "{{a}}\n{{aa}}\n");
        sandbox.write("other.in", "{{run}}\n");
        sandbox.write("wrong.toml", plan.replace(what, by));
        sandbox.run("check wrong.toml").refused(&words);
    }
}

#[test]
fn the_weights_of_grain_learnings_own_files_are_its_own() {
    let folder = root().join("experiments/external/grainlearning");
    let sandbox = Sandbox::new();
    for entry in fs::read_dir(&folder).expect("the folder").flatten() {
        fs::copy(entry.path(), sandbox.path().join(entry.file_name())).expect("copied");
    }
    sandbox.run("--plan hyperbola.toml --quiet").succeeded();
    let samples = sandbox.path().join("results/hyperbola/samples.csv");
    let samples = fs::read_to_string(samples).expect("samples");
    let mut rows = samples.lines().filter(|line| !line.starts_with('#'));
    let weight = rows.next().and_then(|head| head.split(',').position(|column| column == "weight"));
    let weight = weight.expect("a column of weights");
    let ours: Vec<f64> = rows
        .map(|row| row.split(',').nth(weight).expect("a weight").parse().expect("a number"))
        .collect();
    let theirs = fs::read_to_string(folder.join("hyperbola-weights.txt")).expect("its weights");
    let theirs: Vec<f64> =
        theirs.lines().skip(1).map(|line| line.parse().expect("a number")).collect();
    assert_eq!((ours.len(), theirs.len()), (20, 20));
    for (ours, theirs) in ours.iter().zip(&theirs) {
        assert!((ours - theirs).abs() < 1e-10, "{ours} {theirs}");
    }
}
