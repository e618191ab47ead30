//! `calibrate --plan`, `--resume`, `status`, `export`: calibration of commands, and what survives interruptions.

use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::sandbox::{Ran, Sandbox, root};

/// y = a t, with the time that a run takes and a note of every run that is made.
const LINE_SH: &str = r#"#!/bin/sh
set -eu
echo "$1" >> "$RUNS"
sleep "$2"
awk -v a="$1" 'BEGIN { print "t,y"; for (t = 0; t <= 4; t++) printf "%d,%.17g\n", t, a * t }' > out.csv
"#;
const LINE_CSV: &str = "t,y\n1,2.1\n2,3.9\n3,6.2\n";

/// A plan that calibrates the slope of a line with `samples` runs that take `seconds` each.
fn line_plan(samples: usize, seconds: &str) -> String {
    format!(
        r#"
name = "line"
[parameters.a]
distribution = "uniform"
lower = 0.0
upper = 5.0
[experiments.pull.simulator]
kind = "command"
argv = ["sh", "{{plan_dir}}/line.sh", "{{a}}", "{seconds}"]
environment = {{ RUNS = "{{plan_dir}}/runs.txt" }}
timeout_s = 60
keep = "none"
[experiments.pull.observables.y]
table = "line.csv"
control = "t"
noise = {{ kind = "inferred", s0 = 0.2 }}
result = {{ file = "out.csv", control = "t", value = "y" }}
[sampler]
samples = {samples}
[executor]
kind = "local"
parallel = 2
"#
    )
}

fn line(samples: usize, seconds: &str) -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.write("line.toml", line_plan(samples, seconds));
    sandbox.write("line.sh", LINE_SH);
    sandbox.write("line.csv", LINE_CSV);
    sandbox
}

/// Runs of the simulator so far.
fn runs(sandbox: &Sandbox) -> usize {
    fs::read_to_string(sandbox.path().join("runs.txt")).map_or(0, |text| text.lines().count())
}

fn posterior_bytes(sandbox: &Sandbox, dir: &str) -> Vec<u8> {
    let path = sandbox.path().join(dir).join("posterior.json");
    fs::read(path).expect("posterior.json")
}

/// Reads the posterior of a run and holds it against the schema.
fn posterior(sandbox: &Sandbox, dir: &str) -> Value {
    let file = serde_json::from_slice(&posterior_bytes(sandbox, dir)).expect("JSON");
    let schema = root().join("crates/workbench/schema/posterior.schema.json");
    let schema = fs::read_to_string(schema).expect("the schema");
    let schema = serde_json::from_str(&schema).expect("JSON");
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    let mistakes: Vec<String> =
        validator.iter_errors(&file).map(|error| error.to_string()).collect();
    assert!(mistakes.is_empty(), "{mistakes:#?}");
    file
}

fn status(sandbox: &Sandbox, dir: &str) -> Value {
    let ran = sandbox.run(&format!("status {dir} --json"));
    serde_json::from_str(&ran.succeeded().stdout).expect("JSON")
}

/// A driver that is running.
struct Driver {
    child: Child,
}

impl Driver {
    fn start(sandbox: &Sandbox, arguments: &str) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_calibrate"))
            .current_dir(sandbox.path())
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command starts");
        Self { child }
    }

    fn signal(&self, signal: Signal) {
        // It may have ended by itself.
        let _ = kill_process(Pid::from_child(&self.child), signal);
    }

    fn wait(mut self) -> (Option<i32>, String) {
        let status = self.child.wait().expect("it ends");
        let mut stderr = String::new();
        self.child.stderr.take().expect("piped").read_to_string(&mut stderr).expect("UTF-8");
        (status.code(), stderr)
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until something is true, for at most half a minute.
#[track_caller]
fn until(what: &str, mut is: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is() {
        assert!(begun.elapsed() < Duration::from_secs(30), "{what} did not happen");
        std::thread::sleep(Duration::from_millis(5));
    }
}

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
    let file = posterior(&sandbox, "results/impact");
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
    let bytes = posterior_bytes(&sandbox, "results/impact");
    sandbox.run("--resume results/impact --quiet").succeeded();
    assert_eq!(posterior_bytes(&sandbox, "results/impact"), bytes);
    for command in ["status", "export", "--resume"] {
        sandbox.run(&format!("{command} plans")).refused(&["plans"]);
        sandbox.run(&format!("{command} nowhere")).refused(&["nowhere"]);
    }
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
        let read = workbench::experiment::Experiment::built_in(experiment).expect("built in");
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
    let one = moments(&posterior(&sandbox, "results/builtin"));
    let other = moments(&posterior(&sandbox, "results/command"));
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
    let file = posterior(&sandbox, "results/line");
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

fn walk(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    entries
        .map(|entry| entry.expect("an entry").path())
        .flat_map(|path| if path.is_dir() { walk(&path) } else { vec![path] })
        .collect()
}

#[test]
fn an_interrupted_run_is_taken_up_with_the_same_bits_and_one_driver_has_it() {
    let whole = line(24, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    let bytes = posterior_bytes(&whole, "results/line");
    assert_eq!(runs(&whole), 24);

    for (signal, code) in
        [(Signal::INT, Some(130)), (Signal::TERM, Some(130)), (Signal::KILL, None)]
    {
        // The plan says how long a run takes, and is a part of the posterior: the script takes its time itself.
        let sandbox = line(24, "0");
        sandbox.write("line.sh", LINE_SH.replace("sleep \"$2\"", "sleep 0.1"));
        let driver = Driver::start(&sandbox, "--plan line.toml");
        until("a few runs", || runs(&sandbox) >= 5);
        let second = sandbox.run("--resume results/line");
        assert_eq!(second.code, 1, "{second:#?}");
        assert!(second.stderr.contains("is in use by process"), "{second:#?}");
        let running = status(&sandbox, "results/line");
        assert_eq!((&running["state"], &running["total"]), (&"running".into(), &24.into()));
        let mid = sandbox.run("export results/line --out mid");
        assert!(mid.succeeded().stdout.contains("samples"), "{mid:?}");
        let header = fs::read_to_string(sandbox.path().join("mid/samples.csv")).expect("samples");
        assert!(header.starts_with("sample,a [1],state"), "{header}");
        driver.signal(signal);
        let (exit, stderr) = driver.wait();
        assert_eq!(exit, code, "{stderr}");
        if code.is_some() {
            assert!(stderr.contains("calibrate --resume results/line"), "{stderr}");
            assert!(stderr.contains("of 24 runs have ended"), "{stderr}");
        }
        let stopped = status(&sandbox, "results/line");
        assert_eq!(stopped["state"], "stopped", "{stopped:#?}");
        let finished = stopped["finished"].as_u64().expect("a number") as usize;
        assert!((1..24).contains(&finished), "{finished}");
        let before = runs(&sandbox);
        sandbox.run("--resume results/line --quiet").succeeded();
        assert_eq!(posterior_bytes(&sandbox, "results/line"), bytes);
        assert_eq!(runs(&sandbox) - before, 24 - finished, "nothing that finished is run again");
    }
}

#[test]
fn a_changed_plan_and_damaged_files_are_named_and_the_rest_is_used() {
    let sandbox = line(24, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let bytes = posterior_bytes(&sandbox, "results/line");

    // Another plan is refused, by its first difference; another executor is not.
    sandbox.write("other.toml", line_plan(24, "0").replace("upper = 5.0", "upper = 6.0"));
    sandbox.run("--resume results/line --plan other.toml").refused(&[
        "other.toml",
        "upper",
        "6.0",
        "5.0",
    ]);
    sandbox.write("other.toml", line_plan(24, "0").replace("parallel = 2", "parallel = 1"));
    sandbox.run("--resume results/line --plan other.toml --quiet").succeeded();
    sandbox.write("line.toml", line_plan(32, "0"));
    let noted = sandbox.run("--resume results/line");
    assert!(noted.succeeded().stderr.contains("has changed since the run began"), "{noted:#?}");
    sandbox.write("line.toml", line_plan(24, "0"));

    // One flipped digit of one result: that run is made again, and no other.
    let journal = sandbox.path().join("results/line/campaign/results.jsonl");
    let text = fs::read_to_string(&journal).expect("results.jsonl");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let place = lines[7].find("values").expect("values") + 12;
    let digit = lines[7][place..].find(|c: char| c.is_ascii_digit()).expect("a digit") + place;
    let flipped = if &lines[7][digit..=digit] == "1" { "2" } else { "1" };
    lines[7].replace_range(digit..=digit, flipped);
    fs::write(&journal, lines.join("\n") + "\n").expect("written");
    let before = runs(&sandbox);
    let ran = sandbox.run("--resume results/line");
    ran.succeeded();
    assert!(ran.stderr.contains("results.jsonl, line 8"), "{}", ran.stderr);
    assert_eq!(runs(&sandbox) - before, 1);
    assert_eq!(posterior_bytes(&sandbox, "results/line"), bytes);

    // A damaged plan is mended with the plan.
    let resolved = sandbox.path().join("results/line/campaign/resolved-plan.json");
    let text = fs::read_to_string(&resolved).expect("the plan").replace("\"line\"", "\"lime\"");
    fs::write(&resolved, text).expect("written");
    sandbox.run("--resume results/line").refused_with_warnings(&["resolved-plan.json", "--plan"]);
    let before = runs(&sandbox);
    sandbox.run("--resume results/line --plan line.toml").succeeded();
    assert_eq!(posterior_bytes(&sandbox, "results/line"), bytes);
    assert_eq!(runs(&sandbox), before);
    let record = sandbox.path().join("results/line/campaign/campaign.json");
    let text = fs::read_to_string(&record).expect("campaign.json");
    fs::write(&record, &text[..text.len() / 2]).expect("cut off");
    sandbox.run("--resume results/line").refused(&["campaign.json", "--plan FILE"]);
    sandbox.run("--resume results/line --plan line.toml").succeeded();
    assert_eq!(posterior_bytes(&sandbox, "results/line"), bytes);
    assert_eq!(runs(&sandbox), before, "its runs are used");
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
fn a_full_disk_stops_the_run_with_a_clear_word_and_loses_nothing() {
    let whole = line(48, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    let sandbox = line(48, "0");
    // No file may grow beyond 10 kB: the journal of results reaches that in the middle of the run.
    let output = Command::new("sh")
        .current_dir(sandbox.path())
        .args(["-c", "trap '' XFSZ; ulimit -f 20; exec \"$0\" --plan line.toml"])
        .arg(env!("CARGO_BIN_EXE_calibrate"))
        .output()
        .expect("sh");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("disk is full"), "{stderr}");
    assert!(stderr.contains("calibrate --resume results/line"), "{stderr}");
    let stored = status(&sandbox, "results/line")["finished"].as_u64().expect("a number");
    assert!(stored > 0, "{stored}");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(posterior_bytes(&sandbox, "results/line"), posterior_bytes(&whole, "results/line"));
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
    let back = workbench::sample_table::SampleTable::read(&written).expect("a table");
    assert_eq!(back.parameters, ["a"]);
    assert_eq!(back.rows.len(), 4);
    for (row, truth) in back.rows.iter().zip([1.9, 2.05, 2.2, 4.9]) {
        assert!((row[0] - truth).abs() < 1e-12, "{row:?}");
    }
    // Weights are the likelihoods: of the inferred noise, a Student t of 4 + 3 degrees of freedom.
    let file = posterior(&sandbox, "results/line");
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

/// Numbers that look random, from a seed.
struct Random(u64);

impl Random {
    fn share(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1u64 << 31) as f64
    }
}

/// `cargo test -p calibrate --test e2e a_hundred_kills -- --ignored --nocapture`: a stage of its own in `.ci/run`.
#[test]
#[ignore = "takes a minute or two"]
fn a_hundred_kills_at_random_moments_and_the_same_posterior() {
    const KILLS: usize = 100;
    let sandbox = line(24, "0");
    let begun = Instant::now();
    sandbox.run("--plan line.toml --quiet").succeeded();
    let whole = begun.elapsed();
    let bytes = posterior_bytes(&sandbox, "results/line");
    let seed = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let mut random = Random(seed);
    let (mut kills, mut finished, mut made) = (0, 0, 0);
    while kills < KILLS || finished == 0 {
        let dir = format!("run-{finished}");
        made += 1;
        let there = sandbox.path().join(&dir).join("campaign/campaign.json").is_file();
        let arguments = if there {
            format!("--resume {dir} --quiet")
        } else {
            format!("--plan line.toml --out {dir} --quiet")
        };
        // The moments are spread over a whole run, and beyond the end of a resumed one.
        let patience = whole.mul_f64(random.share());
        let mut driver = Driver::start(&sandbox, &arguments);
        let started = Instant::now();
        let ended = loop {
            if let Some(status) = driver.child.try_wait().expect("a child") {
                break Some(status);
            }
            if started.elapsed() >= patience && kills < KILLS {
                driver.signal(Signal::KILL);
                break None;
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        let (code, stderr) = driver.wait();
        match (ended, code) {
            (None, None) => kills += 1,
            (_, Some(0)) => {
                assert!(posterior_bytes(&sandbox, &dir) == bytes, "{dir} differs");
                finished += 1;
            }
            other => panic!("{dir}: {other:?}\n{stderr}"),
        }
    }
    eprintln!(
        "{kills} kills in {made} starts, {finished} runs to the end, each the same; {:.0} s",
        begun.elapsed().as_secs_f64()
    );
}

/// A Slurm of two nodes on this machine, for as long as the test takes.
struct Cluster {
    folder: tempfile::TempDir,
}

impl Cluster {
    /// None where Slurm is not installed.
    fn up() -> Option<Self> {
        let script = root().join("tests/slurm/cluster.sh");
        if !Command::new(&script).arg("missing").status().expect("the script").success() {
            return None;
        }
        let cluster = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        let up = Command::new(script).arg("up").arg(cluster.dir()).status().expect("the script");
        assert!(up.success(), "the cluster does not come up");
        Some(cluster)
    }

    fn dir(&self) -> PathBuf {
        self.folder.path().join("cluster")
    }

    /// Starts the command with the environment in which sbatch and squeue speak to the cluster.
    fn start(&self, sandbox: &Sandbox, arguments: &str) -> Driver {
        let child = Command::new("bash")
            .current_dir(sandbox.path())
            .args(["-c", "source \"$0/env\"; exec \"$@\""])
            .arg(self.dir())
            .arg(env!("CARGO_BIN_EXE_calibrate"))
            .args(arguments.split_whitespace())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("bash");
        Driver { child }
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let script = root().join("tests/slurm/cluster.sh");
        let _ = Command::new(script).arg("down").arg(self.dir()).status();
    }
}

/// `cargo test -p calibrate --test e2e a_real_slurm -- --ignored --nocapture`, with Debian's slurm-wlm and munge.
#[test]
#[ignore = "needs Slurm, and takes half a minute"]
fn a_real_slurm_gives_the_bits_of_local_runs_through_every_interruption() {
    let Some(cluster) = Cluster::up() else {
        eprintln!("skipped: Slurm is not installed (as root: tests/slurm/cluster.sh install)");
        return;
    };
    let sandbox = line(24, "0.2");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let bytes = posterior_bytes(&sandbox, "results/line");
    let executor = "kind = \"slurm\"\nchunk = 3\npoll_min_s = 0.1\npoll_max_s = 0.5\ngrace_s = 2\n";
    let local = "kind = \"local\"\nparallel = 2\n";
    sandbox.write("slurm.toml", line_plan(24, "0.2").replace(local, executor));
    // (name, options, what happens in the middle of the run)
    for (name, options, signal) in [
        ("whole", "", None),
        ("detached", "", Some(Signal::INT)),
        ("cancelled", "--on-interrupt cancel", Some(Signal::INT)),
        ("killed", "", Some(Signal::KILL)),
    ] {
        let before = runs(&sandbox);
        let driver =
            cluster.start(&sandbox, &format!("--plan slurm.toml --out {name} --quiet {options}"));
        if let Some(signal) = signal {
            until("a few runs", || runs(&sandbox) >= before + 3);
            driver.signal(signal);
            let (code, stderr) = driver.wait();
            assert_eq!(code, if signal == Signal::INT { Some(130) } else { None }, "{stderr}");
            assert_eq!(
                stderr.contains("jobs on the cluster go on"),
                name == "detached",
                "{stderr}"
            );
            let resumed = cluster.start(&sandbox, &format!("--resume {name} --quiet"));
            let (code, stderr) = resumed.wait();
            assert_eq!(code, Some(0), "{name}: {stderr}");
        } else {
            let (code, stderr) = driver.wait();
            assert_eq!(code, Some(0), "{name}: {stderr}");
        }
        assert!(posterior_bytes(&sandbox, name) == bytes, "{name} differs from the local run");
        if name != "cancelled" {
            assert_eq!(runs(&sandbox) - before, 24, "{name}: no run is made twice");
        }
    }
}

impl Ran {
    /// As [`Ran::refused`], with warnings before the error.
    #[track_caller]
    fn refused_with_warnings(&self, words: &[&str]) {
        assert_eq!(self.code, 2, "{self:#?}");
        assert!(self.stderr.contains("\nerror: "), "{self:#?}");
        for word in words {
            assert!(self.stderr.contains(word), "{word:?} is not in\n{}", self.stderr);
        }
    }
}
