//! Runs that are extended: all that they have made counts, and none of it is made again.

use std::fs;

use rustix::process::Signal;

use super::{Driver, line, line_plan, runs, status, until};
use crate::sandbox::Sandbox;

/// Parameters and weights of the samples, by stage; without the weights, which further samples change.
fn samples(sandbox: &Sandbox, folder: &str) -> Vec<String> {
    let text = fs::read_to_string(sandbox.path().join(folder).join("samples.csv"));
    let text = text.expect("samples.csv");
    let place = text.lines().next().expect("a header").split(',').position(|at| at == "a");
    let place = place.unwrap_or(0);
    let value = |line: &str| line.split(',').nth(place).expect("a value").to_owned();
    text.lines().skip(1).map(value).collect()
}

#[test]
fn a_run_of_a_program_is_extended_and_nothing_is_run_twice() {
    let sandbox = line(40, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    assert_eq!(runs(&sandbox), 40);
    let before = samples(&sandbox, "results/line");

    let ran = sandbox.run("--resume results/line --samples 80 --quiet");
    ran.succeeded();
    assert_eq!(runs(&sandbox), 80, "80 runs in all");
    let after = samples(&sandbox, "results/line");
    assert_eq!((after.len(), &after[..40]), (80, &before[..]));
    let file = sandbox.posterior("results/line");
    assert_eq!(file["plan"]["sampler"]["samples"], 80);
    assert_eq!(file["plan"]["sampler"]["earlier"], serde_json::json!([40]));
    assert_eq!(status(&sandbox, "results/line")["state"], "done");

    // Once more, and the run is that of its plan file all the same.
    sandbox.run("--resume results/line --samples 100 --quiet").succeeded();
    assert_eq!(runs(&sandbox), 100);
    let bytes = sandbox.posterior_bytes("results/line");
    let again = sandbox.run("--resume results/line --plan line.toml");
    assert!(!again.succeeded().stderr.contains("has changed"), "{}", again.stderr);
    let again = sandbox.run("--resume results/line");
    assert!(!again.succeeded().stderr.contains("has changed"), "{}", again.stderr);
    assert_eq!((runs(&sandbox), sandbox.posterior_bytes("results/line")), (100, bytes));
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_plan_file_with_the_number_of_an_extended_run_is_that_of_the_run() {
    // With other defaults for the number after it.
    let sandbox = line(199, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    sandbox.run("--resume results/line --samples 202 --quiet").succeeded();
    let bytes = sandbox.posterior_bytes("results/line");
    sandbox.write("line.toml", line_plan(202, "0"));
    let again = sandbox.run("--resume results/line --plan line.toml");
    assert!(!again.succeeded().stderr.contains("has changed"), "{}", again.stderr);
    assert_eq!((runs(&sandbox), sandbox.posterior_bytes("results/line")), (202, bytes));
    // One that chooses something is another.
    let chosen = line_plan(202, "0").replace("samples = 202", "samples = 202\nbatch = 7");
    sandbox.write("line.toml", chosen);
    sandbox.run("--resume results/line --plan line.toml").refused(&["batch"]);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_extension_that_is_interrupted_goes_on() {
    let whole = line(30, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    whole.run("--resume results/line --samples 60 --quiet").succeeded();

    let sandbox = line(30, "0.05");
    sandbox.run("--plan line.toml --quiet").succeeded();
    let driver = Driver::start(&sandbox, "--resume results/line --samples 60");
    until("a further run", || runs(&sandbox) > 36);
    assert_eq!(status(&sandbox, "results/line")["state"], "running");
    driver.signal(Signal::INT);
    driver.wait();
    let stopped = status(&sandbox, "results/line");
    assert_eq!((&stopped["state"], &stopped["total"]), (&"stopped".into(), &60.into()));
    // The result of the first 30 is there until there is that of all.
    assert_eq!(sandbox.posterior("results/line")["plan"]["sampler"]["samples"], 30);
    let made = status(&sandbox, "results/line")["finished"].as_u64().expect("a number");
    assert!((30..60).contains(&made), "{made}");
    // The same command once more is the same extension.
    sandbox.run("--resume results/line --samples 60 --quiet").succeeded();
    assert_eq!(samples(&sandbox, "results/line"), samples(&whole, "results/line"));
    assert_eq!(status(&sandbox, "results/line")["finished"], 60);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_run_that_was_interrupted_is_extended_before_it_is_done() {
    let whole = line(30, "0");
    whole.run("--plan line.toml --quiet").succeeded();
    whole.run("--resume results/line --samples 60 --quiet").succeeded();

    let sandbox = line(30, "0.05");
    let driver = Driver::start(&sandbox, "--plan line.toml");
    until("a run", || runs(&sandbox) > 9);
    driver.signal(Signal::INT);
    driver.wait();
    sandbox.run("--resume results/line --samples 60 --quiet").succeeded();
    assert_eq!(samples(&sandbox, "results/line"), samples(&whole, "results/line"));
}

#[test]
fn an_extension_that_cannot_be_is_refused_with_what_can() {
    let sandbox = line(20, "0");
    sandbox.run("--plan line.toml --quiet").succeeded();
    for few in [16, 20] {
        let ran = sandbox.run(&format!("--resume results/line --samples {few}"));
        ran.refused(&["more than the 20 simulations", "results/line", "--samples 40"]);
    }
    sandbox.run("--resume results/line --samples 0").refused(&["from 16 to"]);
    sandbox.run("--resume results/line --samples 1e9").refused(&["from 16 to"]);
    sandbox.run("--resume nowhere --samples 40").refused(&["nowhere"]);
    let other = sandbox.run("--continue-from results/line --samples 40");
    other.refused(&["programs", "calibrate --resume results/line --samples 40"]);
    // More samples in the plan file are no extension, and the refusal says what is.
    sandbox.write("line.toml", line_plan(50, "0"));
    let ran = sandbox.run("--resume results/line --plan line.toml");
    ran.refused(&["sampler.samples", "calibrate --resume results/line --samples 50"]);
    // Fewer are no way to go on with it either.
    sandbox.write("line.toml", line_plan(16, "0"));
    let ran = sandbox.run("--resume results/line --plan line.toml");
    ran.refused(&["all 20 that it has count", "go on with them: calibrate --resume results/line"]);
    let other = sandbox.run("--continue-from results/line --samples 16");
    other.refused(&["calibrate --resume results/line --samples 40"]);
    assert_eq!(runs(&sandbox), 20);

    sandbox.write("sets.csv", "a\n1\n2\n3\n");
    let design = line_plan(20, "0").replace("samples = 20", "design = \"sets.csv\"");
    sandbox.write("sets.toml", design.replace("name = \"line\"", "name = \"sets\""));
    sandbox.run("--plan sets.toml --quiet");
    sandbox.run("--resume results/sets --samples 40").refused(&["design", "add sets"]);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_run_of_a_material_is_continued_with_all_its_samples() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps -n 4096 --no-other-kinetics --quiet").succeeded();
    let before = samples(&sandbox, "results/ps");
    let dry = sandbox.run("--continue-from results/ps --samples 8192 --dry-run");
    let said = &dry.succeeded().stdout;
    assert!(said.contains("8192 simulations (4096 of them those of the run"), "{said}");

    let options = "--samples 8192 --no-other-kinetics --verify --quiet";
    let ran = sandbox.run(&format!("--continue-from results/ps {options} --out twice"));
    ran.succeeded();
    assert_eq!(samples(&sandbox, "results/ps"), before, "--out leaves the run alone");
    let after = samples(&sandbox, "twice");
    assert_eq!((after.len(), &after[..4096]), (8192, &before[..]));
    let ran = sandbox.run(&format!("--continue-from results/ps/posterior.json {options}"));
    ran.succeeded();
    assert_eq!(samples(&sandbox, "results/ps"), after);
    assert_eq!(samples(&sandbox, "results/ps.1"), before, "the former result is moved aside");
    assert_eq!(sandbox.posterior_bytes("results/ps"), sandbox.posterior_bytes("twice"));

    let ran = sandbox.run("--continue-from results/ps --samples 8192");
    ran.refused(&["more than the 8192 simulations", "results/ps", "--samples 16384"]);
    sandbox.run("--resume results/ps --samples 16384").refused(&["--continue-from results/ps"]);
    sandbox.run("--continue-from results/ps").refused(&["--samples"]);
    sandbox.run("--continue-from nowhere --samples 64").refused(&["nowhere"]);
    let options = "--continue-from results/ps --samples 16384";
    sandbox.run(&format!("{options} --material ps")).refused(&["--material"]);
    sandbox.run(&format!("{options} --seed 2")).refused(&["--seed"]);
    sandbox.run("--material ps -n 8192 --noise ess-target:0.2 --out tuned").succeeded();
    sandbox.run("--continue-from tuned --samples 16384").refused(&["ess-target"]);
}

#[test]
fn a_number_that_is_refused_gives_up_no_failed_run() {
    let sandbox = line(20, "0");
    let fails = "n=$(wc -l < \"$RUNS\"); if [ $((n % 3)) = 0 ]; then exit 4; fi\n";
    let script = fs::read_to_string(sandbox.path().join("line.sh")).expect("the script");
    sandbox.write("line.sh", script.replace("sleep", &format!("{fails}sleep")));
    sandbox.run("--plan line.toml --quiet").succeeded();
    let before = status(&sandbox, "results/line");
    assert!(before["failed"].as_u64().expect("a number") > 0, "{before}");
    let files = sandbox.snapshot();
    let ran = sandbox.run("--resume results/line --retry-failed --samples 16");
    ran.refused(&["more than the 20 simulations"]);
    assert_eq!(status(&sandbox, "results/line"), before);
    let left = |name: &str| {
        let path = sandbox.path().join("results/line").join(name);
        fs::read(&path).ok() == files.get(&path).cloned()
    };
    for name in ["posterior.json", "SHA256SUMS", "campaign/results.jsonl", "campaign/campaign.json"]
    {
        assert!(left(name), "{name}");
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_continued_run_says_where_its_first_samples_are_not_those_of_the_run_it_extends() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps -n 60 --no-other-kinetics --quiet").succeeded();
    let more = "--continue-from results/ps --samples 80 --no-other-kinetics --quiet --out more";
    let ran = sandbox.run(more);
    assert!(!ran.succeeded().stderr.contains("are not the first"), "{}", ran.stderr);
    let path = sandbox.path().join("results/ps/samples.csv");
    let text = fs::read_to_string(&path).expect("rows");
    let row = text.lines().nth(8).expect("a row").to_owned();
    let (first, rest) = row.split_once(',').expect("cells");
    let other = format!("{:e},{rest}", first.parse::<f64>().expect("a number") * (1.0 + 1e-15));
    fs::write(&path, text.replacen(&row, &other, 1)).expect("another number");
    fs::remove_file(sandbox.path().join("results/ps/SHA256SUMS")).expect("the sums");
    let ran = sandbox.run(more);
    let said = &ran.succeeded().stderr;
    assert!(said.contains("results/ps are not the first of this run, from number 8 on"), "{said}");
    assert!(said.contains("80 simulations made now"), "{said}");
    fs::remove_file(path).expect("the samples");
    let ran = sandbox.run(more);
    assert!(ran.succeeded().stderr.contains("cannot be compared"), "{}", ran.stderr);
}

#[test]
fn what_helps_is_said_with_the_folder_of_the_run() {
    let sandbox = Sandbox::new();
    let wanted = "calibrate --continue-from kept/here --samples 16384";
    let ran = sandbox.run("--material peek -n 16 --no-other-kinetics --out kept/here");
    assert!(ran.succeeded().stdout.contains(wanted), "{}", ran.stdout);
    let ran = sandbox.run("--material peek -n 16 --no-other-kinetics --out kept/here --quiet");
    assert!(ran.succeeded().stderr.contains(wanted), "{}", ran.stderr);
    for named in ["kept/here", "kept/here/posterior.json"] {
        let ran = sandbox.run(&format!("inspect {named}"));
        assert!(ran.succeeded().stdout.contains(wanted), "{}", ran.stdout);
    }
    // The record is the same wherever it is.
    let bytes = String::from_utf8(sandbox.posterior_bytes("kept/here")).expect("UTF-8");
    assert!(bytes.contains("--continue-from DIR ") && !bytes.contains("kept"));
}
