//! `calibrate compare`: the six kinetics on the same data, under each noise.

use std::fs;

use serde_json::Value;

use crate::sandbox::{Sandbox, root};

const KINETICS: [&str; 6] =
    ["frenkel", "pokluda", "three-stage", "three-stage-pokluda", "regime-map", "bellehumeur"];

fn compared(sandbox: &Sandbox, arguments: &str) -> Value {
    let report = sandbox.run(&format!("compare {arguments} --json")).json();
    report["comparisons"].as_array().expect("comparisons")[0].clone()
}

fn entry<'a>(comparison: &'a Value, kinetics: &str) -> &'a Value {
    let entries = comparison["entries"].as_array().expect("entries");
    entries.iter().find(|entry| entry["kinetics"] == kinetics).expect("the kinetics")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
#[ignore = "long: run by .ci/run"]
fn evidences_are_those_of_the_main_job_and_factors_those_of_the_evidences() {
    let sandbox = Sandbox::new();
    let comparison = compared(&sandbox, "--material peek --samples 8192 --noise inferred --out c");
    let evidence = |kinetics| number(&entry(&comparison, kinetics)["log_evidence"]);
    let best = KINETICS.map(evidence).into_iter().fold(f64::NEG_INFINITY, f64::max);
    for kinetics in KINETICS {
        let one = entry(&comparison, kinetics);
        assert_eq!(number(&one["log_bayes_factor"]), evidence(kinetics) - best);
        sandbox
            .run(&format!(
                "--material peek --kinetics {kinetics} --samples 8192 --quiet --out {kinetics}"
            ))
            .succeeded();
        let file = sandbox.posterior(kinetics);
        assert_eq!(file["log_evidence"]["value"], one["log_evidence"], "{kinetics}");
        assert_eq!(
            file["experiments"][0]["neck_growth"]["fit"]["map"]["rmse"], one["error"]["rmse"],
            "{kinetics}"
        );
    }
    // A parabola cannot be the delay of PEEK: the one finding that no seed or budget may change.
    assert_eq!(number(&entry(&comparison, "three-stage")["log_bayes_factor"]), 0.0);
    assert_eq!(entry(&comparison, "frenkel")["strength"], "very-strong");
    for name in [
        "compare.json",
        "compare.md",
        "compare.csv",
        "compare-peek.png",
        "compare-peek.svg",
        "report.html",
    ] {
        assert!(sandbox.path().join("c").join(name).exists(), "{name}");
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn observations_that_weights_cannot_leave_out_are_left_out_by_calibrating_again() {
    // PS: the row at the knee decides so much that k-hat is above the limit for every kinetics.
    let comparison = compared(&Sandbox::new(), "--material ps --samples 8192 --noise inferred");
    for kinetics in KINETICS {
        let one = entry(&comparison, kinetics);
        let points = one["leave_one_out"]["points"].as_array().expect("points");
        let unreliable: Vec<u64> = points
            .iter()
            .filter(|point| number(&point["khat"]) > 0.7)
            .map(|point| point["index"].as_u64().expect("an index"))
            .collect();
        let refitted: Vec<u64> = one["refitted"]
            .as_array()
            .expect("indices")
            .iter()
            .map(|index| index.as_u64().expect("an index"))
            .collect();
        assert_eq!(refitted, unreliable, "{kinetics}");
        let sum: f64 = points.iter().map(|point| number(&point["ln_density"])).sum();
        assert!((sum - number(&one["leave_one_out"]["ln_density"])).abs() < 1e-9, "{kinetics}");
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_report_says_what_is_fair_what_is_informed_and_where_phi_came_from() {
    let sandbox = Sandbox::new();
    sandbox
        .run("compare --material ps --samples 8192 --noise inferred --out c --quiet")
        .succeeded();
    let text = fs::read_to_string(sandbox.path().join("c/compare.md")).expect("compare.md");
    for words in [
        "Priors are fair",
        "Kass and Raftery",
        "the data support",
        "read off the data",
        "C1 and delta_c enter only as c1 * delta_c^2",
        "k-hat",
    ] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    let with_phi =
        compared(&sandbox, "--material ps --samples 8192 --noise inferred --phi --out p");
    for kinetics in KINETICS {
        let informed = entry(&with_phi, kinetics)["informed"].as_array().expect("parameters");
        let phi = informed.iter().find(|one| one["name"] == "phi").expect("phi");
        let median = number(&phi["median"]);
        assert!(
            (1.04..1.12).contains(&median),
            "{kinetics}: the plateau is near 1.08, not {median}"
        );
    }
    let warnings = with_phi["warnings"].to_string();
    assert!(!warnings.contains("read off the data"), "{warnings}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn priors_that_change_nothing_and_other_warnings_on_the_input_are_said_as_a_plain_run_says_them() {
    let sandbox = Sandbox::new();
    let prior = root().join("priors/ps-pulse.toml").display().to_string();
    let options = "--samples 8192 --noise fixed:0.1 --out c --quiet";
    let warned = sandbox.run(&format!("compare -e ps-r30 -p {prior} {options}"));
    assert!(warned.succeeded().stdout.is_empty(), "{}", warned.stdout);
    let said = "the prior of cooling_time changes nothing in ps-r30";
    assert_eq!(warned.stderr.matches(said).count(), 1, "{}", warned.stderr);
    assert!(warned.stderr.contains("warning: ps-r30: "), "{}", warned.stderr);
    let text = fs::read_to_string(sandbox.path().join("c/compare.md")).expect("compare.md");
    assert!(text.contains(said), "{text}");
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn the_table_of_kinetics_and_noise_says_which_noise_the_data_prefer_and_what_it_changes() {
    let sandbox = Sandbox::new();
    let comparison = compared(&sandbox, "--material peek --samples 8192 --out c");
    let entries = comparison["entries"].as_array().expect("entries");
    assert_eq!(entries.len(), 18, "six kinetics under three noise models");
    let total: f64 = entries.iter().map(|entry| number(&entry["probability"])).sum();
    assert!((total - 1.0).abs() < 1e-12, "{total}");
    let cell = |kinetics: &str, noise: &str| {
        let found = entries.iter().find(|one| one["kinetics"] == kinetics && one["noise"] == noise);
        number(&found.expect("a cell")["log_evidence"])
    };
    // By quadrature over parameters, correlation length and white share: 46.166.
    let found = cell("three-stage", "correlated");
    assert!((found - 46.166).abs() < 0.1, "{found}");
    let ln_k = |noise| cell("three-stage", noise) - cell("frenkel", noise);
    assert!(ln_k("independent") > 17.0 && ln_k("correlated") < 6.0, "no common factor");
    let text = fs::read_to_string(sandbox.path().join("c/compare.md")).expect("compare.md");
    for words in [
        "| kinetics | log Z, independent errors | log Z, correlated errors | log Z, robust errors |",
        "The data prefer correlated errors",
        "three-stage is the best kinetics under every noise",
    ] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    assert!(!text.contains("they are worth about"), "independence is not mended by counting");
}

#[test]
fn the_regime_map_reports_the_product_that_it_sees() {
    let sandbox = Sandbox::new();
    let line = "--material pa12 --kinetics regime-map --samples 8192 --out r";
    let ran = sandbox.run(line);
    assert!(ran.succeeded().stdout.contains("c1 * delta_c^2"), "{}", ran.stdout);
    assert!(ran.stdout.contains("enter only as"), "{}", ran.stdout);
    let file = sandbox.posterior("r");
    let product = &file["experiments"][0]["neck_growth"]["product"];
    // Exactly the product of what is beside it: at the MAP.
    let theta = file["map"]["theta"].as_array().expect("numbers");
    let expected = number(&theta[0]) * number(&theta[2]).powi(2);
    assert!((number(&product["map"]) / expected - 1.0).abs() < 1e-12);
    assert!(
        fs::read_to_string(sandbox.path().join("r/table.md"))
            .expect("a table")
            .contains("| c1 * delta_c^2 | m2/(Pa s) |")
    );
    sandbox.run("--material pa12 --samples 8192 --out t --quiet").succeeded();
    let other = sandbox.posterior("t");
    assert!(
        other["experiments"][0]["neck_growth"]["product"].is_null(),
        "three stages separate the two"
    );
}

#[test]
fn mistakes_are_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("compare --material pekk").refused(&["peek"]);
    sandbox.run("compare --prior p.toml").refused(&["--experiment"]);
    sandbox.run("compare --noise inferred,robus").refused(&["--noise", "robus", "mean robust?"]);
    sandbox.run("compare --noise ess-target:0.2").refused(&["--noise", "no evidence"]);
    sandbox.run("compare --noise robust,robust").refused(&["--noise", "robust noise twice"]);
    sandbox.run("compare --experiment no.toml").refused(&["no.toml", "no such file"]);
    sandbox.write("notes/mine.txt", "mine");
    sandbox.run("compare --material ps --out notes").refused(&["notes", "--out"]);
}

/// A finished calibration in a folder of the sandbox.
fn calibrated(sandbox: &Sandbox, options: &str, out: &str) {
    let quiet = format!("{options} --samples 8192 --no-other-kinetics --quiet --out {out}");
    sandbox.run(&quiet).succeeded();
}

/// Two explanations of the plateau of one polystyrene pair.
fn phi_and_pulse(sandbox: &Sandbox) {
    calibrated(sandbox, "--material ps --noise correlated", "phi");
    let [pulse, prior] = ["experiments/heat/ps-r30-pulse.toml", "priors/ps-pulse.toml"]
        .map(|file| root().join(file).display().to_string());
    calibrated(sandbox, &format!("-e {pulse} -p {prior} --noise correlated"), "pulse");
}

#[test]
fn finished_runs_of_one_table_are_ranked_by_their_evidence_and_named_by_what_they_explain_it_with()
{
    let sandbox = Sandbox::new();
    phi_and_pulse(&sandbox);
    let found = compared(&sandbox, "phi pulse --out c");
    let evidence = |run: &str| {
        let file = sandbox.posterior(run);
        number(&file["log_evidence"]["value"])
    };
    let all = found["explanations"].as_array().expect("explanations");
    let [phi, pulse] = [&all[0], &all[1]];
    assert_eq!(phi["name"], "three-stage, phi = 1.08");
    assert_eq!(pulse["name"], "three-stage, it cooled (direct)");
    assert_eq!(number(&phi["log_evidence"]), evidence("phi"));
    assert_eq!(number(&pulse["log_evidence"]), evidence("pulse"));
    let factor = evidence("phi") - evidence("pulse");
    assert_eq!(number(&phi["log_bayes_factor"]), factor);
    // Cooling is favoured by a factor of some hundreds.
    assert!((-8.0..-5.0).contains(&factor), "{factor}");
    let odds = number(&phi["probability"]) / number(&pulse["probability"]);
    assert!((odds - factor.exp()).abs() < 1e-12, "{odds}");
    let warnings = found["warnings"].to_string();
    for kind in ["priors-differ", "final-contact-ratio-read-off"] {
        assert!(warnings.contains(kind), "{warnings}");
    }
    for name in ["compare.md", "compare.csv", "compare-ps-r30.svg", "report.html", "models-ps.json"]
    {
        assert!(sandbox.path().join("c").join(name).exists(), "{name}");
    }
    // What was read of the runs stands in the inputs: their records and their draws.
    let inputs = fs::read_to_string(sandbox.path().join("c/inputs.json")).expect("inputs");
    for run in ["phi", "pulse"] {
        let sums = fs::read_to_string(sandbox.path().join(run).join("SHA256SUMS")).expect("sums");
        for file in ["posterior.json", "draws.csv"] {
            let sum = sums.lines().find(|line| line.ends_with(file)).expect(file);
            let sum = sum.split_whitespace().next().expect("a sum");
            assert!(inputs.contains(sum) && inputs.contains(&format!("{run}/{file}")), "{inputs}");
        }
    }
    let page = fs::read_to_string(sandbox.path().join("c/report.html")).expect("a report");
    assert!(page.contains("phi = 1.08") && page.contains("it cooled (direct)"));
    let average = sandbox.run("predict --average c --contact-ratio 1.1").succeeded().stdout.clone();
    assert!(average.contains("  three-stage, it cooled (direct) with correlated"), "{average}");
    // Each explanation has an end of its own, so that none is named.
    assert!(average.contains("never reached") && !average.contains("(phi ="), "{average}");
    let listed = sandbox.run("runs c").succeeded().stdout.clone();
    assert!(listed.contains("comparison") && listed.contains("warnings"), "{listed}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn runs_of_other_measurements_or_another_noise_are_not_ranked() {
    let sandbox = Sandbox::new();
    calibrated(&sandbox, "--material ps", "ps");
    calibrated(&sandbox, "--material ps --kinetics frenkel --noise robust", "robust");
    calibrated(&sandbox, "--material ps --kinetics frenkel --window 0.01:1", "window");
    calibrated(&sandbox, "--material ps --kinetics frenkel --noise ess-target:0.2", "tuned");
    sandbox.run("compare ps").refused(&["one run", "two finished calibrations"]);
    sandbox.run("compare ps ps").refused(&["the calibration of ps once more"]);
    sandbox.run("compare ps robust").refused(&["robust errors", "independent", "--noise"]);
    sandbox.run("compare ps window").refused(&["window", "no measurements like", "--window"]);
    sandbox.run("compare ps tuned").refused(&["tuned noise", "evidence"]);
    sandbox.run("compare ps nothing").refused(&["nothing"]);
    // One explanation counts once, however often and under whatever name it was calibrated.
    calibrated(&sandbox, "--material ps --seed 2", "again");
    let seeds = ["again", "the explanation of ps once more", "seed 2 and 8192", "leave one"];
    sandbox.run("compare ps again").refused(&seeds);
    calibrated(&sandbox, "--experiment ps-r30 --seed 3", "named");
    sandbox.run("compare ps named").refused(&["the explanation of ps once more"]);
    assert!(!sandbox.path().join("results/compare").exists());
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_plan_of_two_radii_says_by_evidence_that_the_data_contradict_a_tau_s_in_proportion_to_r() {
    let sandbox = Sandbox::new();
    let heat = root().join("experiments/heat");
    let plan = fs::read_to_string(heat.join("ps-radii-phi.toml")).expect("a plan");
    let near = format!("\"{}\"", heat.join("ps-r60-e29-phi.toml").display());
    let plan =
        plan.replace("\"ps-r60-e29-phi.toml\"", &near).replace("samples = 16384", "samples = 8192");
    sandbox.write("radii.toml", &plan);
    let found = compared(&sandbox, "--plan radii.toml --out c");
    let names: Vec<&str> = found["explanations"]
        .as_array()
        .expect("explanations")
        .iter()
        .map(|one| one["name"].as_str().expect("a name"))
        .collect();
    assert_eq!(names, ["shared", "own tau_s"]);
    let verdict = found["verdict"].to_string();
    assert!(
        verdict.contains("The data contradict \\\"tau_s in proportion to R\\\": very strong"),
        "{verdict}"
    );
    let own = &found["explanations"][1]["informed"];
    let median = |name: &str| {
        let all = own.as_array().expect("parameters");
        number(&all.iter().find(|one| one["name"] == name).expect(name)["median"])
    };
    assert!(median("tau_s") > 1.8 * median("tau_s_r30"), "{own}");
    // The pair whose errors are stated as smaller than any shared curve leaves them is named, and the other is not.
    let (first, second) = plan.split_once("[experiments.r30.simulator]").expect("two pairs");
    let correlated = "kind = \"correlated\", s0 = 0.04";
    let stated = format!(
        "{}[experiments.r30.simulator]{}",
        first.replace(correlated, "kind = \"fixed\", sigma = 0.2"),
        second.replace(correlated, "kind = \"fixed\", sigma = 0.015"),
    );
    sandbox.write("stated.toml", stated);
    let said = sandbox.run("--plan stated.toml --out run").succeeded().stdout.clone();
    assert!(said.contains("; as far off again: p "), "{said}");
    assert!(said.contains("r30.contact_ratio: its measurements contradict"), "{said}");
    assert!(!said.contains("r60.contact_ratio: its measurements contradict"), "{said}");
    let too_large = said.lines().filter(|line| line.contains("noise is larger than the scatter"));
    let too_large: Vec<&str> = too_large.collect();
    assert!(too_large.len() == 1 && too_large[0].contains("fit of r60"), "{said}");
    // Without its text a comparison gives its warnings, as all commands do.
    let few = plan.replace("samples = 8192", "samples = 64");
    sandbox.write("radii.toml", few);
    let warned = sandbox.run("compare --plan radii.toml --out few --quiet");
    assert!(warned.succeeded().stdout.is_empty() && warned.stderr.contains("warning: "));
    let power = heat.join("ps-power.toml").display().to_string();
    sandbox.run(&format!("compare --plan {power}")).refused(&["two radii", "tau_s_radius_m"]);
    let program = root().join("experiments/external/impact.toml").display().to_string();
    sandbox.run(&format!("compare --plan {program}")).refused(&[
        "experiment drop",
        "a program (sh ",
        "impact.sh",
        "calibrate compare RUN RUN",
    ]);
}

#[test]
fn a_run_of_one_observable_has_no_replicated_data_beside_it() {
    let sandbox = Sandbox::new();
    calibrated(&sandbox, "--material ps --kinetics frenkel", "ps");
    let file = sandbox.posterior("ps");
    assert!(file["experiments"][0]["observables"][0]["check"].is_null());
}

#[test]
fn a_program_is_another_explanation_where_it_was_changed_and_not_where_only_its_seed_was() {
    let sandbox = Sandbox::new();
    let external = root().join("experiments/external");
    let read = |file: &str| fs::read_to_string(external.join(file)).expect(file);
    for file in ["impact.sh", "impact-force.txt", "impact-rebound.csv"] {
        sandbox.write(file, read(file));
    }
    let plan = read("impact.toml").replace("samples = 300", "samples = 24");
    sandbox.write("one.toml", &plan);
    sandbox.write("two.toml", plan.replace("seed = 1", "seed = 2"));
    for (plan, out) in [("one", "one"), ("two", "two")] {
        sandbox.run(&format!("--plan {plan}.toml --out {out} --quiet")).succeeded();
    }
    sandbox.run("compare one two").refused(&["the explanation of one once more", "seed 2"]);
    sandbox.write("impact.sh", read("impact.sh").replace("mass = 1e-6", "mass = 1.1e-6"));
    sandbox.run("--plan two.toml --out heavier --quiet").succeeded();
    sandbox.run("compare one heavier").succeeded();
}
