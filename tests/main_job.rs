//! `calibrate --material ps|pa12|peek`: what a run leaves behind, and what it says.

use std::fs;

use crate::sandbox::Sandbox;

const FILES: [&str; 20] = [
    "SHA256SUMS",
    "convergence.png",
    "convergence.svg",
    "corner.png",
    "corner.svg",
    "draws.csv",
    "fit.csv",
    "fit.png",
    "fit.svg",
    "inputs.json",
    "posterior.json",
    "recursion.png",
    "recursion.svg",
    "report.html",
    "residuals.png",
    "residuals.svg",
    "samples.csv",
    "table.csv",
    "table.md",
    "timings.json",
];

fn names(sandbox: &Sandbox, folder: &str) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(sandbox.path().join(folder))
        .expect("the folder of the run")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The default budget of each material against quadrature: `--verify` fails where they differ.
#[test]
#[ignore = "long: run by .ci/run"]
fn each_material_at_the_default_budget_agrees_with_quadrature() {
    for material in ["ps", "pa12", "peek"] {
        let sandbox = Sandbox::new();
        let ran = sandbox.run(&format!("--material {material} --verify"));
        ran.succeeded();
        assert!(ran.stdout.contains("trust: good; worth "), "{}", ran.stdout);
        assert!(ran.stderr.contains("quadrature"), "{}", ran.stderr);
        assert!(!ran.stdout.contains("careful: two modes"), "{}", ran.stdout);
        assert!(ran.stdout.contains("as printed in Table 3"), "{}", ran.stdout);
        assert_eq!(names(&sandbox, &format!("results/{material}")), FILES);
    }
}

/// A thousand simulations, placed by the surrogate, against quadrature. The default sampler has no answer there.
#[test]
#[ignore = "longer: run by .ci/long"]
fn each_material_at_a_thousand_simulations_agrees_with_quadrature() {
    for material in ["ps", "pa12", "peek"] {
        let sandbox = Sandbox::new();
        let ran = sandbox.run(&format!("--material {material} --samples 1000 --verify"));
        ran.succeeded();
        assert!(!ran.stdout.contains("NOT TO BE TRUSTED"), "{}", ran.stdout);
    }
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material ps --samples 1000 --iterations 8");
    assert!(ran.succeeded().stdout.contains("NOT TO BE TRUSTED"), "{}", ran.stdout);
}

/// Of so few simulations weights may not have the moments that are known: how far those of `samples.csv` are off is said.
#[test]
#[ignore = "long: run by .ci/run"]
fn samples_that_do_not_have_the_moments_of_the_result_are_said_to_be_off_by_as_much_as_they_are() {
    let sandbox = Sandbox::new();
    let moved = (1..=10).find_map(|seed| {
        sandbox
            .run(&format!(
                "--material ps --samples 50 --seed {seed} --solver quasi-static --no-other-kinetics"
            ))
            .succeeded();
        let found = sandbox.posterior("results/ps");
        let concerns = found["trust"]["concerns"].as_array().expect("concerns").clone();
        let told = concerns.into_iter().find(|concern| concern["kind"] == "samples-moved");
        told.map(|told| (found, told))
    });
    let (found, told) = moved.expect("one of ten seeds");
    let text = fs::read_to_string(sandbox.path().join("results/ps/samples.csv")).expect("rows");
    let rows: Vec<Vec<f64>> =
        text.lines().filter_map(|line| line.split(',').map(|x| x.parse().ok()).collect()).collect();
    let header: Vec<&str> = text.lines().next().expect("a header").split(',').collect();
    let weight = header.iter().position(|name| *name == "weight").expect("weights");
    assert_eq!(rows.len(), 50);
    let moment = |of: &dyn Fn(&Vec<f64>) -> f64| -> f64 {
        rows.iter().map(|row| row[weight] * of(row)).sum()
    };
    let all = moment(&|_| 1.0);
    let mean: Vec<f64> = (0..3).map(|j| moment(&|row| row[j].log10()) / all).collect();
    let covariance = |i: usize, j: usize| {
        moment(&|row| (row[i].log10() - mean[i]) * (row[j].log10() - mean[j])) / all
    };
    let (mut off, mut correlation) = ([0.0_f64; 2], 0.0_f64);
    for j in 0..3 {
        let sd = covariance(j, j).sqrt();
        let known =
            |name: &str| found["parameters"][j]["in_coordinate"][name].as_f64().expect("a number");
        off[0] = off[0].max((mean[j] - known("mean")).abs() / known("sd"));
        off[1] = off[1].max((sd / known("sd") - 1.0).abs());
        for i in 0..j {
            let known = found["correlation"][j][i].as_f64().expect("a number");
            let own = covariance(i, j) / (covariance(i, i) * covariance(j, j)).sqrt();
            correlation = correlation.max((own - known).abs());
        }
    }
    for (name, off) in [("mean", off[0]), ("sd", off[1]), ("correlation", correlation)] {
        let told = told[name].as_f64().expect("a number");
        assert!((told - off).abs() < 1e-6, "{name}: {told} {off}");
    }
    let table = fs::read_to_string(sandbox.path().join("results/ps/table.md")).expect("a table");
    assert!(table.contains("samples-moved"), "{table}");
}

/// On both sides of the number from which on samples are placed without the surrogate, and of earlier ones.
#[test]
#[ignore = "longer: run by .ci/long"]
fn no_number_of_simulations_between_a_thousand_and_a_few_thousand_is_a_cliff() {
    for samples in [1001, 2047, 2048] {
        let options = format!("--material peek --samples {samples} --no-other-kinetics --verify");
        Sandbox::new().run(&options).succeeded();
    }
}

/// Moments and evidence computed once by another program: midpoint sums on grids of 300^3 points in log10 of
/// the parameters, over the box that holds the mass, with the closed form, priors and likelihood written down
/// again from the paper.
#[test]
fn the_posteriors_agree_with_an_independent_program() {
    struct Known {
        material: &'static str,
        log_evidence: f64,
        mean: [f64; 3],
        sd: [f64; 3],
    }
    let known = [
        Known {
            material: "ps",
            log_evidence: 86.337,
            mean: [-3.668_8, -1.149_44, -6.853_9],
            sd: [0.104_25, 0.026_34, 0.148_0],
        },
        Known {
            material: "pa12",
            log_evidence: 54.106_84,
            mean: [-3.402_34, 0.590_99, -7.200_48],
            sd: [0.797_64, 0.017_59, 0.437_23],
        },
        Known {
            material: "peek",
            log_evidence: 38.871_44,
            mean: [-6.076_73, 1.380_12, -6.320_84],
            sd: [0.037_78, 0.023_27, 0.065_30],
        },
    ];
    for Known { material, log_evidence, mean, sd } in known {
        let sandbox = Sandbox::new();
        sandbox.run(&format!("--material {material} --quiet")).succeeded();
        let file = sandbox.posterior(&format!("results/{material}"));
        let found = file["log_evidence"]["value"].as_f64().expect("a number");
        assert!((found - log_evidence).abs() < 0.02, "{material}: log evidence {found}");
        for place in 0..3 {
            let moments = &file["parameters"][place]["in_coordinate"];
            let (found_mean, found_sd) =
                (moments["mean"].as_f64().expect("mean"), moments["sd"].as_f64().expect("sd"));
            let error = (found_mean - mean[place]).abs() / sd[place];
            assert!(error < 0.03, "{material}, parameter {place}: mean {found_mean}");
            let error = (found_sd / sd[place] - 1.0).abs();
            assert!(error < 0.03, "{material}, parameter {place}: sd {found_sd}");
        }
    }
}

#[test]
fn the_same_plan_replaces_its_run_and_another_plan_moves_it_aside() {
    let sandbox = Sandbox::new();
    let first = sandbox.run("--material ps --samples 8192 --out run");
    first.succeeded();
    let again = sandbox.run("--material ps --samples 8192 --out run");
    assert!(again.succeeded().stderr.contains("replaced the earlier run"), "{}", again.stderr);
    assert!(!sandbox.path().join("run.1").exists());
    let other = sandbox.run("--material ps --samples 8192 --seed 2 --out run");
    assert!(other.succeeded().stderr.contains("run.1"), "{}", other.stderr);
    assert_eq!(sandbox.posterior("run.1")["plan"]["sampler"]["seed"], 1);
    assert_eq!(sandbox.posterior("run")["plan"]["sampler"]["seed"], 2);
}

#[test]
fn an_own_powder_is_calibrated_from_files_alone() {
    let sandbox = Sandbox::new();
    let root = crate::sandbox::root();
    for (folder, name) in [
        ("experiments", "example-my-powder.toml"),
        ("experiments", "example-my-powder.csv"),
        ("priors", "example-my-powder.toml"),
    ] {
        let contents = fs::read(root.join(folder).join(name)).expect("the example");
        sandbox.write(&format!("{folder}/{name}"), contents);
    }
    let ran = sandbox.run(
        "--experiment experiments/example-my-powder.toml --prior priors/example-my-powder.toml --samples 8192",
    );
    ran.succeeded();
    assert_eq!(names(&sandbox, "results/my-powder"), FILES);
    let file = sandbox.posterior("results/my-powder");
    assert!(
        file["experiments"][0]["neck_growth"]["paper"].is_null(),
        "a powder of one's own has no values in the paper"
    );
    assert!(!ran.stdout.contains("Table 3"), "{}", ran.stdout);
    assert_eq!(file["plan"]["experiments"][0]["simulator"]["powder"]["radius_m"], 21.0e-6);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn every_kinetics_calibrates_and_regime_map_says_what_it_cannot_tell_apart() {
    for (kinetics, expected) in [
        ("three-stage", 3),
        ("frenkel", 1),
        ("pokluda", 1),
        ("three-stage-pokluda", 3),
        ("regime-map", 3),
        ("bellehumeur", 2),
    ] {
        let sandbox = Sandbox::new();
        let ran =
            sandbox.run(&format!("--material ps --samples 8192 --kinetics {kinetics} --out run"));
        ran.succeeded();
        let parameters = sandbox.posterior("run")["parameters"].as_array().expect("a list").len();
        assert_eq!(parameters, expected, "{kinetics}");
        let product = ran.stdout.contains("c1 * delta_c^2");
        assert_eq!(product, kinetics == "regime-map", "{kinetics}: {}", ran.stdout);
    }
}

#[test]
fn each_solver_that_is_forced_gives_the_same_posterior_as_the_closed_form() {
    let mean = |options: &str| {
        let sandbox = Sandbox::new();
        sandbox.run(&format!("--material pa12 --samples 8192 --out run {options}")).succeeded();
        let file = sandbox.posterior("run");
        assert!(
            file["plan"]["experiments"][0]["simulator"]["solver"]["reason"]
                .as_str()
                .is_some_and(|reason| !reason.is_empty())
        );
        file["parameters"][1]["in_coordinate"]["mean"].as_f64().expect("a number")
    };
    let closed_form = mean("");
    let quasi_static = mean("--solver quasi-static --tolerance 1e-8");
    assert!((closed_form - quasi_static).abs() < 1e-5, "{closed_form} {quasi_static}");
}

#[test]
fn a_dry_run_prints_the_plan_and_writes_nothing() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material peek --dry-run");
    ran.succeeded();
    for word in ["26 points of", "log-uniform", "closed-form", "16384 simulations", "results/peek"]
    {
        assert!(ran.stdout.contains(word), "{word} is not in\n{}", ran.stdout);
    }
    assert!(sandbox.snapshot().is_empty());
    let plan = sandbox.run("--material peek --dry-run --json").json();
    assert_eq!(plan["sampler"]["samples"], 16_384);
}

#[test]
fn tuned_noise_is_labelled_as_no_posterior_in_every_output() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("--material ps --samples 8192 --noise ess-target:0.2 --out run");
    ran.succeeded();
    assert!(ran.stdout.contains("NOT A POSTERIOR"), "{}", ran.stdout);
    assert!(ran.stdout.contains("NOT TO BE TRUSTED"), "{}", ran.stdout);
    assert_eq!(sandbox.posterior("run")["is_posterior"], false);
    let table = fs::read_to_string(sandbox.path().join("run/table.md")).expect("table.md");
    assert!(table.contains("Not a posterior"), "{table}");
    let inspected = sandbox.run("inspect run");
    assert!(inspected.succeeded().stdout.contains("NOT A POSTERIOR"), "{}", inspected.stdout);
}

#[test]
fn inspect_reads_a_run_and_check_says_whether_to_trust_it() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 8192 --out run").succeeded();
    let ran = sandbox.run("inspect run/posterior.json");
    for word in ["MAP", "95 %", "Table 3", "correlation", "stage", "log evidence"] {
        assert!(ran.succeeded().stdout.contains(word), "{word} is not in\n{}", ran.stdout);
    }
    let summary = sandbox.run("inspect run --json").json();
    assert_eq!(summary["name"], "ps");
    assert!(sandbox.run("check run").succeeded().stdout.contains("a posterior of PS"));
}

#[test]
fn a_posterior_that_is_cut_off_edited_or_of_another_version_is_refused_with_its_place() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --out run").succeeded();
    let path = sandbox.path().join("run/posterior.json");
    let whole = fs::read_to_string(&path).expect("posterior.json");
    fs::write(&path, &whole[..whole.len() / 2]).expect("cut");
    sandbox.run("inspect run").refused(&["posterior.json", "line", "cut off"]);
    fs::write(&path, whole.replacen("\"schema_version\": 2", "\"schema_version\": 99", 1))
        .expect("changed");
    sandbox.run("inspect run").refused(&["schema_version", "99", "expected 2"]);
    fs::write(&path, whole.replacen("\"is_posterior\":", "\"is_posteriar\":", 1)).expect("changed");
    sandbox.run("inspect run").refused(&["posterior.json", "is_posteriar"]);
    fs::write(&path, "").expect("emptied");
    sandbox.run("inspect run").refused(&["an empty file"]);
    sandbox.run("inspect nowhere").refused(&["nowhere"]);
}

#[test]
fn a_run_that_cannot_succeed_ends_with_exit_1_the_reason_and_nothing_written() {
    let sandbox = Sandbox::new();
    // Far more certain measurements than any curve can meet: every likelihood is zero.
    let ran = sandbox.run("--material ps --noise fixed:1e-300 --samples 8192 --out run");
    assert_eq!(ran.code, 1, "{ran:#?}");
    assert!(ran.stderr.contains("evidence"), "{ran:#?}");
    assert!(!sandbox.path().join("run").exists());
}

#[test]
fn fewer_points_than_parameters_are_calibrated_with_a_warning() {
    let sandbox = Sandbox::new();
    sandbox.write("two.csv", "time_s,contact_ratio\n1.0,0.4\n3.0,0.9\n");
    let ran = sandbox
        .run("--material pa12 --experiment two.csv --samples 8192 --no-other-kinetics --out run");
    assert!(ran.succeeded().stdout.contains("2 observations for 3 parameters"), "{}", ran.stdout);
}

#[test]
fn the_papers_tau_s_moves_with_the_radius_of_the_experiment() {
    let sandbox = Sandbox::new();
    sandbox.run("-e pa12-r30 --samples 8192 --out run").succeeded();
    let file = sandbox.posterior("run");
    let tau_s = file["experiments"][0]["neck_growth"]["paper"]["si"][1].as_f64().expect("a number");
    // 1.2e-4 / 31.5e-6 s, times 29.8318/31.5.
    assert!((tau_s - 3.6078).abs() < 1e-3, "{tau_s}");
    let simulated = sandbox.run("simulate -e pa12-r30 --table3");
    assert!(simulated.succeeded().stderr.contains("tau_s = 3.608 s"), "{}", simulated.stderr);
}

#[test]
fn the_band_of_a_new_measurement_is_wider_than_that_of_the_curve_or_left_out() {
    let sandbox = Sandbox::new();
    sandbox.run("-m ps --noise fixed-relative:0.05 --samples 8192 --out relative").succeeded();
    let curves = &sandbox.posterior("relative")["experiments"][0]["neck_growth"]["curves"];
    let width = |band: &str, point: usize| {
        let end = |side: usize| curves[band][side][point].as_f64().expect("a number");
        end(1) - end(0)
    };
    let last = curves["time_s"].as_array().expect("times").len() - 1;
    // 90 % of a normal distribution of sd 5 % of the plateau at 1.08.
    assert!((width("noisy90", last) / (2.0 * 1.645 * 0.05 * 1.08) - 1.0).abs() < 0.05);
    assert!(width("curve90", last) < 1e-3);

    sandbox.write("own.csv", "time_s,contact_ratio,sigma\n1,0.4,0.02\n3,0.9,0.03\n9,1.2,0.02\n");
    sandbox.run("-m pa12 -e own.csv --noise fixed:table --samples 8192 --out rows").succeeded();
    assert!(
        sandbox.posterior("rows")["experiments"][0]["neck_growth"]["curves"]["noisy90"].is_null()
    );
}

#[test]
#[ignore = "long: run by .ci/run"]
fn one_observation_at_time_zero_and_the_fewest_samples_give_a_result_with_warnings() {
    let sandbox = Sandbox::new();
    let ran = sandbox.run("-m pa12 --window :0.3 --samples 8192 --out zero");
    assert!(ran.succeeded().stdout.contains("NOT INFORMED"), "{}", ran.stdout);
    assert!(sandbox.posterior("zero")["experiments"][0]["neck_growth"]["fit"]["frenkel"].is_null());
    // The process knows after fifty what few weighted samples do not.
    for (number, verdict) in [
        ("16", "NOT TO BE TRUSTED"),
        ("17", "NOT TO BE TRUSTED"),
        ("31", "NOT TO BE TRUSTED"),
        ("50", "rough; means and evidence are known as by"),
    ] {
        let ran = sandbox.run(&format!("-m ps --samples {number} --out few"));
        assert!(ran.succeeded().stdout.contains(verdict), "{}", ran.stdout);
        sandbox.posterior("few");
    }
    sandbox.run("-m ps --samples 15").refused(&["16"]);
}

/// Ctrl-C in the middle of slow simulations: exit 130, the earlier run as it was, nothing hidden left.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_the_earlier_results_and_nothing_else() {
    use std::process::{Command, Stdio};
    let sandbox = Sandbox::new();
    sandbox.run("-m peek --samples 8192 --out run").succeeded();
    let before = sandbox.snapshot();
    let child = Command::new(env!("CARGO_BIN_EXE_calibrate"))
        .current_dir(sandbox.path())
        .args("-m peek --solver verlet --samples 16384 --out run".split(' '))
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    std::thread::sleep(std::time::Duration::from_secs(1));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill runs").success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("interrupted"));
    assert!(before == sandbox.snapshot());
}
