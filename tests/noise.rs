//! Correlated and robust errors from the command line, and the second opinion of independent ones.

use std::fs;

use serde_json::Value;

use crate::sandbox::{Sandbox, root};

#[test]
fn residuals_that_are_alike_show_the_result_under_correlated_errors_beside_the_runs_own() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material ps --samples 8192 --out r");
    ran.succeeded();
    assert!(
        ran.stdout.contains("with correlated errors (sampled again; log evidence 122."),
        "{}",
        ran.stdout
    );
    let file = sandbox.posterior("r");
    let tau_s = &file["sensitivity"]["parameters"][1];
    // By quadrature: 1.285 decades below one second, not 1.149.
    let mean = tau_s["mean"].as_f64().expect("a number");
    assert!((mean + 1.2854).abs() < 0.01, "{mean}");
    assert!((tau_s["shift"].as_f64().expect("a number") + 5.2).abs() < 0.4, "{tau_s}");
    // In closed form it does not depend on how many samples the run has.
    sandbox.run("--material ps --samples 40 --quiet --out few").succeeded();
    let few = &sandbox.posterior("few")["sensitivity"];
    assert_eq!(few["log_evidence"], file["sensitivity"]["log_evidence"]);
    assert_eq!(few["parameters"][1]["mean"], tau_s["mean"]);
    let table = fs::read_to_string(sandbox.path().join("r/table.md")).expect("table.md");
    assert!(table.contains("With correlated errors"), "{table}");
    let json = sandbox.run("--material ps --samples 8192 --out r --json").json();
    assert_eq!(json["trusted"], false, "too narrow intervals are not to be trusted");
    assert_eq!(json["trust"]["verdict"], "converged");
}

#[test]
fn correlated_errors_as_the_headline_have_a_length_and_a_white_share_and_no_second_opinion() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material peek --noise correlated --samples 8192 --out r");
    assert!(ran.succeeded().stdout.contains("errors: correlation length"), "{}", ran.stdout);
    assert!(!ran.stdout.contains("sampled again"), "{}", ran.stdout);
    let file = sandbox.posterior("r");
    assert_eq!(file["sensitivity"], Value::Null);
    let shape = &file["experiments"][0]["observables"][0]["noise_shape"];
    assert_eq!((&shape["kind"], &shape["scale"]), (&"correlated".into(), &"log".into()));
    let draws = fs::read_to_string(sandbox.path().join("r/draws.csv")).expect("draws.csv");
    let names = draws.lines().next().expect("names");
    assert!(names.contains(",sigma [1],correlation_length [1],white_share [1],sample"), "{names}");
    // The same bytes for any number of threads.
    sandbox
        .run("--material peek --noise correlated --samples 8192 --out one --threads 1 --quiet")
        .succeeded();
    let read = |dir: &str| fs::read(sandbox.path().join(dir).join("draws.csv")).expect("draws");
    assert!(read("r") == read("one"));
}

#[test]
fn outliers_are_named_with_file_and_line_by_robust_errors() {
    let table = fs::read_to_string(root().join("experiments/ps-r30.csv")).expect("the table");
    let mut row = 0;
    let mut lines = Vec::new();
    let moved: Vec<String> = table
        .lines()
        .enumerate()
        .map(|(line, text)| {
            let Some((time, ratio)) = text.split_once(',') else { return text.to_owned() };
            let (Ok(_), Ok(ratio)) = (time.parse::<f64>(), ratio.trim().parse::<f64>()) else {
                return text.to_owned();
            };
            row += 1;
            if ![10, 20, 30].contains(&(row - 1)) {
                return text.to_owned();
            }
            lines.push(line + 1);
            format!("{time},{}", ratio + 0.3)
        })
        .collect();
    assert_eq!(lines.len(), 3, "{table}");
    let sandbox = Sandbox::new();
    sandbox.write("ps.csv", moved.join("\n") + "\n");
    let experiment = fs::read_to_string(root().join("experiments/ps-r30.toml")).expect("TOML");
    sandbox.write("e.toml", experiment.replace("ps-r30.csv", "ps.csv"));
    let ran = sandbox.run("--experiment e.toml --noise robust --samples 8192 --out r");
    ran.succeeded();
    let line = ran.stdout.lines().find(|line| line.contains("suspect rows of")).expect("a line");
    assert!(line.contains("ps.csv"), "{line}");
    for expected in &lines {
        assert!(line.contains(&format!("line {expected} (")), "{expected}: {line}");
    }
    assert_eq!(line.matches("line ").count(), 3, "{line}");
}

#[test]
fn noise_that_cannot_be_had_is_refused_with_the_reason() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --noise correlated:robust").refused(&["outliers among correlated"]);
    sandbox
        .run("--material ps --noise correlated:4")
        .refused(&["correlated:4,0.05", "correlated:log"]);
    sandbox.run("--material ps --noise robust:4,-1").refused(&["--noise"]);
    sandbox.write("e.toml", "table = \"t.csv\"\nmaterial = \"ps\"\n");
    sandbox
        .write("t.csv", "time_s,contact_ratio,sigma\n0.01,0.2,0.01\n0.1,0.9,0.01\n0.5,1.07,0.01\n");
    let ran = sandbox.run("--experiment e.toml --dry-run");
    assert!(ran.succeeded().stdout.contains("are not used") || ran.stderr.contains("are not used"));
}

#[test]
fn kinetics_that_fit_better_are_named_with_their_sintering_time() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material ps --out r");
    let line = ran.succeeded().stdout.lines().find(|line| line.contains("other kinetics fit"));
    let line = line.expect("a line");
    assert!(line.contains("three-stage-pokluda (Bayes factor 2"), "{line}");
    assert!(line.contains("apart from that above"), "{line}");
    let quiet = sandbox.run("--material ps --no-other-kinetics --out q");
    assert!(!quiet.succeeded().stdout.contains("other kinetics"), "{}", quiet.stdout);
    let read = |dir: &str| fs::read(sandbox.path().join(dir).join("samples.csv")).expect("samples");
    assert!(read("r") == read("q"));
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_second_opinion_that_is_not_given_is_said_and_lengths_have_the_unit_of_their_scale() {
    let sandbox = Sandbox::new();
    let mut drift = 0.0;
    let rows: String = (1..=201)
        .map(|k| {
            let t_s = 0.02 * f64::from(k);
            drift += 0.02 * f64::from(k * 7919 % 101 - 50) / 50.0;
            format!("{t_s:.3},{:.4}\n", 1.08 - 0.8 * (-t_s / 0.3).exp() + 0.2 * drift)
        })
        .collect();
    let table = |rows: &str| format!("time_s,contact_ratio\n{rows}");
    fs::write(sandbox.path().join("many.csv"), table(&rows)).expect("written");
    let ran = sandbox.run("--material ps --experiment many.csv --samples 8192 --out many");
    assert!(
        ran.succeeded().stdout.contains("not computed beside the result for 201 observations"),
        "{}",
        ran.stdout
    );
    // One row fewer, and it is there.
    let fewer: String = rows.lines().skip(1).map(|line| format!("{line}\n")).collect();
    fs::write(sandbox.path().join("fewer.csv"), table(&fewer)).expect("written");
    let ran = sandbox.run("--material ps --experiment fewer.csv --samples 8192 --out fewer");
    assert!(ran.succeeded().stdout.contains("with correlated errors (sampled"), "{}", ran.stdout);
    sandbox
        .run("--material peek --noise correlated:linear --samples 8192 --out linear --quiet")
        .succeeded();
    let draws = fs::read_to_string(sandbox.path().join("linear/draws.csv")).expect("draws.csv");
    assert!(draws.contains(",correlation_length [s],white_share [1],"), "{draws}");
}
