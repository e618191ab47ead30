//! `calibrate predict`: from a saved posterior to sintering times.

use crate::sandbox::Sandbox;

fn calibrated(options: &str) -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox.run(&format!("--samples 8192 --no-other-kinetics --out run {options}")).succeeded();
    sandbox
}

fn json(sandbox: &Sandbox, options: &str) -> serde_json::Value {
    sandbox.run(&format!("predict --posterior run --json {options}")).json()
}

/// Frenkel's law without a knee: x = x0 + t/tau_s, so that the time to a/R is tau_s (ratio^2 - x0), draw by
/// draw, and so is every quantile.
#[test]
fn frenkel_times_are_the_draws_of_tau_s_times_a_constant() {
    let sandbox = calibrated("--material pa12 --kinetics frenkel");
    let predicted = json(&sandbox, "--contact-ratio 0.9");
    let time = &predicted["sintering"][0]["time_s"];
    let draws = std::fs::read_to_string(sandbox.path().join("run/draws.csv")).expect("draws.csv");
    let mut tau_s: Vec<f64> = draws
        .lines()
        .skip(1)
        .map(|line| line.split(',').next().expect("a column").parse().expect("a number"))
        .collect();
    tau_s.sort_by(f64::total_cmp);
    let median = 0.5 * (tau_s[tau_s.len() / 2 - 1] + tau_s[tau_s.len() / 2]);
    let expected = median * (0.81 - 1e-3);
    let found = time["median"].as_f64().expect("a number");
    assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

#[test]
fn coalescence_in_percent_is_the_contact_ratio_of_one_and_time_and_ratio_are_inverse() {
    let sandbox = calibrated("--material peek");
    let by_ratio = json(&sandbox, "--contact-ratio 0.6");
    let by_percent = json(&sandbox, "--coalescence 60%");
    assert_eq!(by_ratio["sintering"], by_percent["sintering"]);
    let median = by_ratio["sintering"][0]["time_s"]["median"].as_f64().expect("a number");
    let after = json(&sandbox, &format!("--after {median}"));
    let ratio = after["after"][0]["contact_ratio"]["median"].as_f64().expect("a number");
    assert!((ratio - 0.6).abs() < 1e-3, "{ratio}");
}

#[test]
fn frenkel_times_scale_with_the_radius_and_draws_that_never_arrive_are_counted() {
    let sandbox = calibrated("--material ps --kinetics frenkel");
    let own = json(&sandbox, "--contact-ratio 0.9");
    let double = json(&sandbox, "--contact-ratio 0.9 --radius-m 61e-6");
    let median = |value: &serde_json::Value| {
        value["sintering"][0]["time_s"]["median"].as_f64().expect("a number")
    };
    assert!((median(&double) / median(&own) - 2.0).abs() < 1e-9);
    // phi of PS is 1.08.
    let beyond = json(&sandbox, "--contact-ratio 1.1");
    assert!(beyond["sintering"][0]["time_s"].is_null());
    assert_eq!(beyond["sintering"][0]["never"], beyond["sintering"][0]["draws"]);
    let said = sandbox.run("predict --posterior run --contact-ratio 1.1");
    let text = &said.succeeded().stdout;
    assert!(text.contains("a/R = 1.10 is never reached (phi = 1.080)"), "{text}");
    assert!(!text.contains("not in the interval"), "{text}");
}

#[test]
fn nothing_to_predict_and_missing_or_damaged_draws_are_refused() {
    let sandbox = calibrated("--material ps");
    sandbox.run("predict --posterior run").refused(&["--contact-ratio"]);
    sandbox.run("predict --posterior nowhere --after 1").refused(&["nowhere"]);
    sandbox.run("predict --posterior run --after 1 --radius-m 1e9").refused(&["radius"]);
    sandbox.write("run/draws.csv", "c1,tau_s,delta_c\n1,2,three\n");
    sandbox.run("predict --posterior run --after 1").refused(&["draws.csv, line 2", "three"]);
}

const TWO_PAIRS: &str = r#"
name = "two"
[parameters.tau_s]
unit = "s"
distribution = "log-uniform"
lower = 1.0
upper = 10.0
[experiments.large.simulator]
kind = "builtin"
experiment = "pa12-r32"
kinetics = "frenkel"
tau_s_radius_m = 31.5e-6
[experiments.small.simulator]
kind = "builtin"
experiment = "pa12-r30"
kinetics = "frenkel"
tau_s_radius_m = 31.5e-6
[sampler]
samples = 8192
"#;

#[test]
fn the_run_of_a_plan_with_one_pair_predicts_as_that_of_its_material() {
    let sandbox = Sandbox::new();
    let run = "--material pa12 --kinetics frenkel --samples 8192";
    sandbox.run(&format!("{run} --out run")).succeeded();
    let of_material = json(&sandbox, "--contact-ratio 0.9 --after 1");
    let plan = sandbox.run(&format!("{run} --dry-run --toml")).succeeded().stdout.clone();
    sandbox.write("plan.toml", plan);
    sandbox.run("--plan plan.toml --out run --quiet").succeeded();
    let of_plan = json(&sandbox, "--contact-ratio 0.9 --after 1");
    assert_eq!(of_plan, of_material);
}

#[test]
fn a_run_without_one_pair_is_refused_with_what_it_has_instead() {
    let sandbox = Sandbox::new();
    sandbox.write("two.toml", TWO_PAIRS);
    sandbox.run("--plan two.toml --out two --quiet").succeeded();
    let words = ["2 experiments", "one pair of particles"];
    sandbox.run("predict --posterior two --after 1").refused(&words);
    sandbox.write("scene.toml", "");
    sandbox.run("densify --posterior two --scene scene.toml").refused(&words);
    sandbox.run("validate --plan two.toml").refused(&words);
}
