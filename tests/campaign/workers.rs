//! Plans whose simulators are workers: programs that stay, and are asked for one run after the other.

use std::fs;

use rustix::process::Signal;

use super::{Driver, runs, status, until};
use crate::sandbox::Sandbox;

/// The line as a worker; `at_start` and `before` are done before its first line and before each answer.
pub(super) fn script(at_start: &str, before: &str) -> String {
    format!(
        r#"#!/bin/sh
set -eu
touch "$RUNS"
{at_start}
get() {{ echo "$line" | sed "s/.*\"$1\":\"*\([^,\"}}]*\).*/\1/"; }}
read -r line; echo '{{"protocol": 1}}'
while read -r line; do
id=$(get id); a=$(get a); folder=$(get folder); echo "$a" >> "$RUNS"
{before}
awk -v a="$a" -v id="$id" 'BEGIN {{ for (t = 0; t <= 4; t++) y = y sprintf("%s%.17g", t ? ", " : "", a * t)
    printf "{{\"id\": %d, \"values\": {{\"t\": [0, 1, 2, 3, 4], \"y\": [%s]}}}}\n", id, y }}'
done
"#
    )
}

/// The plan of the line, by a worker.
pub(super) fn line_plan(samples: usize) -> String {
    let plan = super::line_plan(samples, "0")
        .replace("kind = \"command\"", "kind = \"worker\"")
        .replace("\"{plan_dir}/line.sh\", \"{a}\", \"0\"", "\"{plan_dir}/worker.sh\"");
    let result = "result = { file = \"out.csv\", control = \"t\", value = \"y\" }\n";
    assert!(plan.contains("worker.sh\"]") && plan.contains(result), "{plan}");
    plan.replace(result, "")
}

pub(super) fn line(samples: usize) -> Sandbox {
    let sandbox = super::line(samples, "0");
    sandbox.write("line.toml", line_plan(samples));
    sandbox.write("worker.sh", script("echo $$ >> \"$RUNS.starts\"", ":"));
    sandbox
}

fn starts(sandbox: &Sandbox) -> usize {
    let starts = fs::read_to_string(sandbox.path().join("runs.txt.starts"));
    starts.map_or(0, |text| text.lines().count())
}

/// Samples and draws of the posterior: all of it but the plan.
fn samples(sandbox: &Sandbox) -> [Vec<u8>; 2] {
    ["samples.csv", "draws.csv"]
        .map(|file| fs::read(sandbox.path().join("results/line").join(file)).expect(file))
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_worker_gives_the_posterior_of_the_command_to_the_bit_for_any_number_of_slots() {
    let command = super::line(48, "0");
    command.run("--plan line.toml --quiet").succeeded();
    for slots in [1, 3] {
        let sandbox = line(48);
        let parallel = format!("parallel = {slots}");
        sandbox.write("line.toml", line_plan(48).replace("parallel = 2", &parallel));
        sandbox.run("--plan line.toml --quiet").succeeded();
        assert!(samples(&sandbox) == samples(&command), "{slots} slots");
        assert_eq!(
            (runs(&sandbox), status(&sandbox, "results/line")["finished"].clone()),
            (48, 48.into())
        );
        // They stay through all stages.
        assert!((1..=slots).contains(&starts(&sandbox)), "{} starts", starts(&sandbox));
        let inspected = sandbox.run("inspect results/line");
        assert!(inspected.succeeded().stdout.contains("median"), "{}", inspected.stdout);
    }
}

#[test]
fn workers_make_the_runs_of_stages_that_overlap() {
    let overlapped = |plan: String| plan.replace("[sampler]\n", "[sampler]\noverlap = 8\n");
    let command = super::line(48, "0");
    command.write("line.toml", overlapped(super::line_plan(48, "0")));
    command.run("--plan line.toml --quiet").succeeded();
    let sandbox = line(48);
    sandbox.write("line.toml", overlapped(line_plan(48)));
    sandbox.run("--plan line.toml --quiet").succeeded();
    assert!(samples(&sandbox) == samples(&command));
    assert!((1..=2).contains(&starts(&sandbox)), "{} starts", starts(&sandbox));
}

#[test]
fn a_plan_with_a_worker_is_told_in_words_and_its_mistakes_are_named() {
    let sandbox = line(24);
    let checked = sandbox.run("check line.toml");
    for words in ["worker      sh", "worker.sh", "y of the answer, interpolated"] {
        assert!(checked.succeeded().stdout.contains(words), "{words}\n{}", checked.stdout);
    }
    let dry = sandbox.run("--plan line.toml --dry-run");
    assert!(dry.succeeded().stdout.contains("worker      sh"), "{}", dry.stdout);
    let with = |from: &str, to: &str| {
        let plan = line_plan(24);
        assert!(plan.contains(from), "{from}");
        sandbox.write("wrong.toml", plan.replace(from, to));
        sandbox.run("check wrong.toml")
    };
    let argv = "\"{plan_dir}/worker.sh\"";
    for name in ["a", "run", "seed", "parameters"] {
        let argument = format!("{argv}, \"{{{name}}}\"");
        let place = format!("placeholder {{{name}}} of a worker");
        with(argv, &argument).refused(&[&place, "{plan_dir} alone", "with every request"]);
    }
    with("RUNS = \"", "A = \"{a}\", RUNS = \"").refused(&["environment.A", "of a worker"]);
    with("\"sh\"", "\"no-such-program\"").refused(&["argv", "not on the path"]);
    with("\"sh\"", "\"./worker\"").refused(&["argv", "a file that is there", "./worker"]);
    with("kind = \"worker\"", "kind = \"wroker\"").refused(&["did you mean \"worker\"?"]);
    with("kind = \"local\"\nparallel = 2", "kind = \"slurm\"").refused(&[
        "executor.kind",
        "Slurm, which keeps no workers, and pull has one",
        "kind = \"command\" in [experiments.pull.simulator]",
    ]);
    let noise = "noise = ";
    with(noise, "result = { control = \"t\", format = \"csv\" }\nnoise = ")
        .refused(&["result.format", "unknown field"]);
    with("control = \"t\"", "result = { control = \"t\" }")
        .refused(&["result.control", "none of the measurements"]);
    // Columns of other names, and a file in the folder of the run.
    with(
        noise,
        "result = { value = \"force\", control = \"time\", interpolate = \"refuse\" }\nnoise = ",
    )
    .succeeded();
    let file = "result = { file = \"out.csv\", value = \"y\", control = \"t\" }\nnoise = ";
    assert!(with(noise, file).succeeded().stdout.contains("y of out.csv (csv)"));
}

#[test]
fn faults_of_a_worker_leave_no_trace_in_the_result_and_interruptions_neither() {
    let quiet = line(24);
    quiet.run("--plan line.toml --quiet").succeeded();
    let sandbox = line(24);
    let slow = "if [ ! -e \"$(dirname \"$RUNS\")/go\" ]; then sleep 0.1; fi
if [ $(wc -l < \"$RUNS\") = 5 ]; then echo nonsense; fi; if [ $(wc -l < \"$RUNS\") = 9 ]; then exit 1; fi";
    sandbox.write("worker.sh", script("", slow));
    for (signal, at) in [(Signal::INT, 4), (Signal::KILL, 12)] {
        let begun = sandbox.path().join("results/line").is_dir();
        let arguments = if begun { "--resume results/line" } else { "--plan line.toml" };
        let driver = Driver::start(&sandbox, arguments);
        until("some runs", || runs(&sandbox) >= at);
        driver.signal(signal);
        let (code, stderr) = driver.wait();
        assert!(code == if signal == Signal::INT { Some(130) } else { None }, "{code:?} {stderr}");
    }
    sandbox.write("go", "");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));
    assert!(!sandbox.path().join("results/line/campaign/workers").exists());
}

#[test]
#[ignore = "long: run by .ci/run"]
fn failures_of_a_worker_can_be_given_up_and_its_later_calls_are_obeyed() {
    let quiet = line(24);
    quiet.run("--plan line.toml --quiet").succeeded();
    let down = |code: u32| {
        let failure =
            format!("{{\\\"code\\\": {code}, \\\"message\\\": \\\"license server down\\\"}}");
        let check = format!(
            "if [ -e \"$(dirname \"$RUNS\")/down\" ]; then echo \"{{\\\"id\\\": $id, \\\"failure\\\": {failure}}}\"; continue; fi"
        );
        let sandbox = line(24);
        sandbox.write("worker.sh", script("", &check));
        sandbox.write("down", "");
        sandbox
    };
    let sandbox = down(3);
    let ran = sandbox.run("--plan line.toml");
    for words in ["looks like an outage", "exit code 3", "license server down"] {
        assert!(ran.code == 1 && ran.stderr.contains(words), "{words}\n{}", ran.stderr);
    }
    fs::remove_file(sandbox.path().join("down")).expect("removed");
    sandbox.run("--resume results/line --retry-failed --quiet").succeeded();
    assert_eq!(sandbox.posterior_bytes("results/line"), quiet.posterior_bytes("results/line"));

    let sandbox = down(75);
    let later = "timeout_s = 60\ntry_later = { pause_s = 0.02, retries = 2 }";
    sandbox.write("line.toml", line_plan(24).replace("timeout_s = 60", later));
    let ran = sandbox.run("--plan line.toml");
    let asked = "asked 3 times to be called later: exit code 75";
    assert!(ran.code == 1 && ran.stderr.contains(asked), "{}", ran.stderr);
    fs::remove_file(sandbox.path().join("down")).expect("removed");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert!(samples(&sandbox) == samples(&quiet));
}

#[test]
fn a_worker_that_is_replaced_or_does_not_get_ready_stops_the_run_without_a_failure() {
    let sandbox = line(24);
    let replaces = "if [ $(wc -l < \"$RUNS\") -ge 10 ] && mkdir \"$0.once\" 2>/dev/null; then echo '# another' >> \"$0\"; fi";
    sandbox.write("worker.sh", script("", replaces));
    let ran = sandbox.run("--plan line.toml");
    for words in ["worker.sh has changed since the run began", "--accept-changes"] {
        assert!(ran.code == 1 && ran.stderr.contains(words), "{words}\n{}", ran.stderr);
    }
    sandbox.run("--resume results/line --accept-changes --quiet").succeeded();
    assert_eq!(status(&sandbox, "results/line")["failed"], 0);

    let sandbox = line(24);
    let broken = "if [ -e \"$(dirname \"$RUNS\")/broken\" ]; then echo 'no module' >&2; exit 1; fi";
    sandbox.write("worker.sh", script(broken, ":"));
    sandbox.write("broken", "");
    let ran = sandbox.run("--plan line.toml");
    for words in
        ["does not get ready as a worker: exit code 1", "no module", "--resume results/line"]
    {
        assert!(ran.code == 1 && ran.stderr.contains(words), "{words}\n{}", ran.stderr);
    }
    fs::remove_file(sandbox.path().join("broken")).expect("removed");
    sandbox.run("--resume results/line --quiet").succeeded();
    assert_eq!(
        (runs(&sandbox), status(&sandbox, "results/line")["failed"].clone()),
        (24, 0.into())
    );
}
