//! `calibrate diff`: two runs side by side.

use std::fs;

use serde_json::Value;

use crate::sandbox::Sandbox;

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn moves_of_a_run_whose_verdict_is_not_to_be_trusted_have_no_standard_errors() {
    let sandbox = Sandbox::new();
    let run = "--material ps --no-other-kinetics -q";
    sandbox.run(&format!("{run} --samples 8192 --out one")).succeeded();
    sandbox.run(&format!("{run} --samples 16 --out other")).succeeded();
    let trust = |name: &str| sandbox.posterior(name)["trust"]["evidence_error_known"].clone();
    assert_eq!([trust("one"), trust("other")], [Value::Bool(true), Value::Bool(false)]);
    let ran = sandbox.run("diff one other");
    assert!(ran.succeeded().stdout.contains(" sd (error unknown), "), "{}", ran.stdout);
    // Nothing is said of errors that are not shown.
    assert!(!ran.stdout.contains("errors: "), "{}", ran.stdout);
    let found = sandbox.json("results/diff/diff.json");
    for moved in found["parameters"].as_array().expect("a list") {
        assert!(moved["shift_sd"].is_number() && moved["shift_se"].is_null(), "{moved}");
    }
    let (known, unknown) = (sandbox.run("inspect one"), sandbox.run("inspect other"));
    let line = "mean and sd in the priors' coordinates";
    for (ran, errors, sign) in [
        (known, "with Monte Carlo standard errors", true),
        (unknown, "their errors unknown", false),
    ] {
        let shown = &ran.succeeded().stdout;
        let after = shown.split_once(&format!("{line}, {errors}")).expect("a headline").1;
        let moments = after.split("correlation").next().expect("a part");
        assert_eq!(moments.contains("+-"), sign, "{moments}");
    }
}

#[test]
fn two_noise_models_differ_in_a_field_and_by_what_the_two_posteriors_say() {
    let sandbox = Sandbox::new();
    let run = "--material ps --samples 8192 --no-other-kinetics -q";
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
    let found = sandbox.json("results/diff/diff.json");
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
    assert!(same.stdout.contains("moves by +0.00"), "{}", same.stdout);
    let listed = sandbox.run("runs");
    assert!(listed.succeeded().stdout.contains("difference  one, other"), "{}", listed.stdout);
}

#[test]
fn evidences_of_other_data_are_not_compared_and_other_parameters_are_named() {
    let sandbox = Sandbox::new();
    let run = "--material pa12 --samples 8192 --no-other-kinetics -q";
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
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --out run -q").succeeded();
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

#[test]
fn units_that_differ_are_not_subtracted_and_a_seed_that_is_the_same_is_said() {
    let sandbox = Sandbox::new();
    let run = "--material ps --samples 8192 --no-other-kinetics -q";
    sandbox.run(&format!("{run} --out one")).succeeded();
    sandbox.run(&format!("{run} --seed 2 --out other")).succeeded();
    let ran = sandbox.run("diff one one");
    assert!(ran.succeeded().stdout.contains("both are one result"), "{}", ran.stdout);
    let ran = sandbox.run("diff one other");
    assert!(!ran.succeeded().stdout.contains("seed 1,"), "exit 0 although they differ: {ran:#?}");
    let mut record = sandbox.posterior("one");
    let named = |one: &Value| one["name"] == "tau_s";
    for one in record["plan"]["parameters"].as_array_mut().expect("a list") {
        if named(one) {
            one["unit"] = "ms".into();
        }
    }
    for one in record["parameters"].as_array_mut().expect("a list") {
        if named(&one["parameter"]) {
            one["parameter"]["unit"] = "ms".into();
        }
    }
    sandbox.write("milli/posterior.json", record.to_string() + "\n");
    for name in ["draws.csv", "samples.csv"] {
        let text = fs::read_to_string(sandbox.path().join("one").join(name)).expect(name);
        sandbox.write(&format!("milli/{name}"), text);
    }
    let ran = sandbox.run("diff one milli --out d");
    for words in [
        " s -> ",
        " ms; its units are not the same, s and ms",
        "both runs have the seed 1, so that",
    ] {
        assert!(ran.succeeded().stdout.contains(words), "{words}: {}", ran.stdout);
    }
    let found = sandbox.json("d/diff.json");
    let all = found["parameters"].as_array().expect("a list");
    let tau = all.iter().find(|one| one["name"] == "tau_s").expect("tau_s");
    assert!(tau["shift_sd"].is_null() && tau["widening"].is_null(), "{tau}");
}

#[test]
fn odd_names_of_folders_stay_on_their_line_and_are_quoted_in_remedies() {
    let sandbox = Sandbox::new();
    let odd = "results/my\nrun $HOME";
    for seed in ["1", "2"] {
        let run = ["--material", "ps", "--samples", "8192", "--seed", seed, "--out", odd, "-q"];
        sandbox.run_args(&run).succeeded();
    }
    let ran = sandbox.run_args(&["diff", odd, odd]);
    assert!(ran.succeeded().stdout.starts_with("results/my\\nrun $HOME ("), "{}", ran.stdout);
    let remedy = r"(calibrate inspect $'results/my\012run $HOME')";
    assert!(ran.stdout.contains(remedy), "{}", ran.stdout);
    let listed = sandbox.run("runs");
    let lines: Vec<&str> = listed.succeeded().stdout.lines().collect();
    assert!(lines.iter().any(|line| line.starts_with("my\\nrun $HOME ")), "{lines:#?}");
    sandbox.write("results/bad/posterior.json", "{");
    let one = sandbox.run("runs results/bad");
    assert!(one.succeeded().stdout.contains("\nresults/bad: damaged"), "{}", one.stdout);
}
