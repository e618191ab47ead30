//! `calibrate diff`: two runs side by side.

use std::fs;

use serde_json::Value;

use crate::sandbox::Sandbox;

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn two_noise_models_differ_in_a_field_and_by_what_the_two_posteriors_say() {
    let sandbox = Sandbox::new();
    let run = "--material ps --samples 2048 --no-other-kinetics -q";
    sandbox.run(&format!("{run} --out one")).succeeded();
    sandbox.run(&format!("{run} --noise robust --out other")).succeeded();
    let ran = sandbox.run("diff one other");
    ran.succeeded();
    for words in [
        "one (PS (polystyrene)) and other (PS (polystyrene))",
        "plans differ in",
        "experiments.ps-r30.observables.contact_ratio.noise.kind: inferred -> robust",
        "sd, ",
        " times as wide",
        "a Bayes factor of ",
        "files: results/diff/",
    ] {
        assert!(ran.stdout.contains(words), "{words} is not in\n{}", ran.stdout);
    }
    // Against the two records themselves.
    let found =
        fs::read_to_string(sandbox.path().join("results/diff/diff.json")).expect("diff.json");
    let found: Value = serde_json::from_str(&found).expect("JSON");
    let (one, other) = (sandbox.posterior("one"), sandbox.posterior("other"));
    for (place, moved) in found["parameters"].as_array().expect("a list").iter().enumerate() {
        let of = |record: &Value, field: &str| {
            number(&record["parameters"][place]["in_coordinate"][field])
        };
        let (old, new, sd) = (of(&one, "mean"), of(&other, "mean"), of(&one, "sd"));
        assert!((number(&moved["shift_sd"]) - (new - old) / sd).abs() < 1e-12);
        assert!((number(&moved["widening"]) - of(&other, "sd") / sd).abs() < 1e-12);
        let error = of(&one, "mean_se").hypot(of(&other, "mean_se")) / sd;
        assert!((number(&moved["shift_se"]) - error).abs() < 1e-12);
    }
    let evidence = |record: &Value, field: &str| number(&record["log_evidence"][field]);
    let gained = evidence(&other, "value") - evidence(&one, "value");
    assert!((number(&found["evidence"]["difference"]) - gained).abs() < 1e-12);
    let error = evidence(&one, "se").hypot(evidence(&other, "se"));
    assert!((number(&found["evidence"]["difference_se"]) - error).abs() < 1e-12);
    for name in ["diff.json", "diff.png", "diff.svg", "inputs.json", "report.html"] {
        assert!(sandbox.path().join("results/diff").join(name).is_file(), "{name}");
    }
    let same = sandbox.run("diff one one --out same");
    assert!(same.succeeded().stdout.contains("plans: the same"), "{}", same.stdout);
    assert!(same.stdout.contains("moves by +0.00 ± "), "{}", same.stdout);
    let listed = sandbox.run("runs");
    assert!(listed.succeeded().stdout.contains("difference  one, other"), "{}", listed.stdout);
}

#[test]
fn evidences_of_other_data_are_not_compared_and_other_parameters_are_named() {
    let sandbox = Sandbox::new();
    let run = "--material pa12 --samples 2048 --no-other-kinetics -q";
    sandbox.run(&format!("{run} --out all")).succeeded();
    sandbox.run(&format!("{run} --kinetics frenkel --window 1: --out late")).succeeded();
    let ran = sandbox.run("diff all late --out d");
    for words in [
        "only in all: c1, delta_c",
        "not to be compared, the data are not the same (30 and ",
        "  tau_s ",
        "parameters.c1: ",
        " -> nothing",
    ] {
        assert!(ran.succeeded().stdout.contains(words), "{words} is not in\n{}", ran.stdout);
    }
    assert!(!ran.stdout.contains("Bayes factor"), "{}", ran.stdout);
}

#[test]
fn what_cannot_be_compared_is_refused_with_a_remedy() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 64 --out run -q").succeeded();
    sandbox.run("diff run").refused(&["OTHER"]);
    sandbox.run("diff run nothing").refused(&["nothing", "no such file"]);
    sandbox.run("diff run run --out run").refused(&[
        "run",
        "no run of this program wrote",
        "--out",
    ]);
    let record = sandbox.path().join("run/posterior.json");
    let text = fs::read_to_string(&record).expect("read").replace("\"seed\": 1", "\"seed\": 2");
    fs::write(&record, text).expect("written");
    sandbox.run("diff run run").refused(&["posterior.json", "SHA256SUMS", "damaged or edited"]);
}
