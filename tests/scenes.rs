//! `calibrate scene` and `calibrate densify`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::sandbox::{Sandbox, json, root};

/// Forty particles in a periodic box: quick to compute, and with a density.
pub(crate) const PACKING: &str = r#"
name = "forty"
[material]
youngs_modulus_pa = 1.65e9
surface_tension_n_per_m = 40.7e-3
density_kg_per_m3 = 1000.0
[sintering]
kinetics = "three-stage"
c1 = 1.177e-5
tau_s = 3.81
delta_c = 9.55e-8
calibrated_radius_m = 31.5e-6
[box]
sides = ["periodic", "periodic", "periodic"]
free = true
[particles.packing]
count = 40
radii = { equal = { radius_m = 31.5e-6 } }
seed = 3
[[phases]]
name = "heat"
duration_s = 1.5
heated = true
mode = "quasi-static"
outputs = 12
tolerance = 1e-2
"#;

/// The pair of the paper, from balance to balance.
pub(crate) fn pair(outputs: usize) -> String {
    let text = fs::read_to_string(root().join("experiments/scenes/pair.toml")).expect("the scene");
    format!("{text}mode = \"quasi-static\"\noutputs = {outputs}\ntolerance = 1e-4\n")
}

fn frenkel(text: &str) -> String {
    text.replace("three-stage", "frenkel")
}

/// A calibration with well-known times, and a scene of its kinetics.
fn calibrated(scene: &str) -> Sandbox {
    let sandbox = Sandbox::new();
    sandbox
        .run("--material pa12 --kinetics frenkel --samples 8192 --no-other-kinetics --out post -q")
        .succeeded();
    sandbox.write("scene.toml", scene);
    sandbox
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            files.extend(self::files(&path).into_iter().map(|(of, b)| (format!("{name}/{of}"), b)));
        } else if name != "timings.json" {
            files.insert(name, fs::read(&path).expect("a file"));
        }
    }
    files
}

#[track_caller]
fn same_files(one: &Path, other: &Path) {
    let (one, other) = (files(one), files(other));
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(*bytes == other[name], "{name} differs");
    }
}

#[test]
fn every_example_is_accepted_by_dry_run_and_check() {
    let sandbox = Sandbox::new();
    let scenes = root().join("experiments/scenes");
    let mut count = 0;
    for entry in fs::read_dir(&scenes).expect("the scenes") {
        let path = entry.expect("an entry").path().display().to_string();
        let dry = sandbox.run_args(&["scene", &path, "--dry-run"]);
        assert!(dry.succeeded().stdout.contains("particles"), "{}", dry.stdout);
        let check = sandbox.run_args(&["check", &path]);
        assert!(check.succeeded().stdout.contains("a scene of many particles"), "{}", check.stdout);
        count += 1;
    }
    assert!(count >= 6);
    assert!(sandbox.snapshot().is_empty(), "a dry run wrote something");
}

#[test]
fn a_scene_gives_series_summary_pictures_and_vtk_files() {
    let sandbox = Sandbox::new();
    sandbox.write("pair.toml", pair(10));
    let ran = sandbox.run("scene pair.toml --vtk");
    assert!(
        ran.succeeded().stdout.contains("pair: 2 particles, 11 observations"),
        "{}",
        ran.stdout
    );
    let out = sandbox.path().join("results/pair");
    let names: Vec<String> =
        files(&out).into_keys().filter(|name| !name.starts_with("vtk")).collect();
    let expected = [
        "bed-start.png",
        "bed.png",
        "inputs.json",
        "report.html",
        "scene.json",
        "series.csv",
        "series.png",
        "series.svg",
    ];
    assert_eq!(names, expected);
    let frames = fs::read_dir(out.join("vtk")).expect("VTK files").count();
    assert_eq!(frames, 11);
    let record = json(&out.join("scene.json"));
    assert_eq!(record["particles"], 2);
    // Full coalescence, 2^(1/3), at 6.2 s of 8 s.
    let end = record["end"]["mean_contact_ratio"].as_f64().expect("a number");
    assert!((end - 2f64.cbrt()).abs() < 1e-3, "{end}");
    assert!(record["end"]["relative_density"].is_null(), "an open pair has no density");
    let series = fs::read_to_string(out.join("series.csv")).expect("series.csv");
    assert_eq!(series.lines().count(), 12);
    let hidden = fs::read_dir(sandbox.path().join("results")).expect("results").count();
    assert_eq!(hidden, 1, "something is left beside the results");
    // The same again replaces it; with other options the old one is kept.
    assert!(sandbox.run("scene pair.toml --vtk").succeeded().stderr.contains("replaced"));
    assert!(sandbox.run("scene pair.toml").succeeded().stderr.contains("moved"));
}

#[test]
fn a_bed_heated_past_its_end_is_at_most_full_in_every_output_and_may_stop_there() {
    let sandbox = Sandbox::new();
    let long = frenkel(PACKING).replace("duration_s = 1.5", "duration_s = 8.0");
    sandbox.write("past.toml", &long);
    let ran = sandbox.run("scene past.toml --out past");
    let stdout = &ran.succeeded().stdout;
    assert!(stdout.contains("heat          density 1.000 (closed pores)"), "{stdout}");
    assert!(
        stdout.contains("careful: from t =") && stdout.contains("open and closed pores"),
        "{stdout}"
    );
    let series = fs::read_to_string(sandbox.path().join("past/series.csv")).expect("series.csv");
    let header: Vec<&str> = series.lines().next().expect("a header").split(',').collect();
    let column = header.iter().position(|name| *name == "relative_density").expect("a column");
    for row in series.lines().skip(1) {
        let density: f64 = row.split(',').nth(column).expect("a cell").parse().expect("a number");
        assert!(density <= 1.0, "{row}");
    }
    assert!(series.contains(",pairs\n") && series.ends_with(",pores\n"), "{series}");
    let record = sandbox.json("past/scene.json");
    let end = record["pairs_end"]["relative_density"].as_f64().expect("the pairs end");
    assert!((0.8..0.95).contains(&end), "{end}");

    let stop = long.replace("\"frenkel\"", "\"frenkel\"\nwhen_necks_meet = \"stop\"");
    sandbox.write("stop.toml", stop);
    let ran = sandbox.run("scene stop.toml --vtk --out stop");
    assert!(ran.succeeded().stdout.contains("the run ended there"), "{}", ran.stdout);
    let record = sandbox.json("stop/scene.json");
    let observations = record["observations"].as_u64().expect("a number");
    assert!(observations < 13 && record["end"] == record["pairs_end"], "{observations}");
    let frames = fs::read_dir(sandbox.path().join("stop/vtk")).expect("VTK files").count();
    assert_eq!(frames as u64, observations);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_scene_is_the_same_from_toml_and_json_on_one_thread_and_three() {
    let sandbox = Sandbox::new();
    sandbox.write("forty.toml", PACKING);
    sandbox.run("scene forty.toml --threads 1 --out one").succeeded();
    let plan = sandbox.run("scene forty.toml --dry-run --json").json();
    sandbox.write("forty.json", plan["scene"].to_string());
    sandbox.run("check forty.json").succeeded();
    sandbox.run("scene forty.json --threads 3 --out three").succeeded();
    // These name the scene's file and its sum.
    for run in ["one", "three"] {
        for file in ["inputs.json", "report.html"] {
            fs::remove_file(sandbox.path().join(run).join(file)).expect("removed");
        }
    }
    same_files(&sandbox.path().join("one"), &sandbox.path().join("three"));
}

/// Starts the command and kills it once a file of its unfinished work is there.
fn kill_when(sandbox: &Sandbox, arguments: &[&str], work: &str, file: &str) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_calibrate"))
        .current_dir(sandbox.path())
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command starts");
    let start = Instant::now();
    let found = || {
        let folders = fs::read_dir(sandbox.path()).expect("the sandbox").flatten();
        folders
            .filter(|folder| folder.file_name().to_string_lossy().starts_with(work))
            .flat_map(|folder| fs::read_dir(folder.path()).into_iter().flatten().flatten())
            .any(|entry| entry.file_name().to_string_lossy().starts_with(file))
    };
    while !found() {
        assert!(start.elapsed() < Duration::from_secs(120), "no {file} appears");
        assert!(
            child.try_wait().expect("waits").is_none(),
            "it was done before it could be killed"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("killed");
    child.wait().expect("ends");
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_killed_scene_goes_on_to_the_same_bits() {
    let sandbox = Sandbox::new();
    // Dynamic and long enough for a few checkpoints.
    let text = pair(10).replace("mode = \"quasi-static\"", "step_over_collision_time = 0.0005");
    let text = text.replace("outputs = 10", "outputs = 60");
    let pulse = "\n[heat]\nhistory = \"pulse\"\nmobility = \"direct\"\ncooling_time_s = 3.0\n";
    for (text, killed) in [(text.clone(), "killed"), (format!("{text}{pulse}"), "pulse")] {
        sandbox.write("pair.toml", text);
        kill_when(
            &sandbox,
            &["scene", "pair.toml", "--out", killed, "--vtk"],
            &format!(".{killed}.work-"),
            "checkpoint",
        );
        assert!(!sandbox.path().join(killed).exists(), "half a result");
        sandbox.run(&format!("scene pair.toml --out {killed} --vtk")).succeeded();
        sandbox.run("scene pair.toml --out whole --vtk").succeeded();
        same_files(&sandbox.path().join(killed), &sandbox.path().join("whole"));
    }
}

#[test]
fn bad_scenes_are_refused_with_field_and_remedy_and_nothing_is_written() {
    let sandbox = Sandbox::new();
    let cases = [
        ("count = 40", "count = 0", "particles.packing.count"),
        ("radius_m = 31.5e-6 }", "radius_m = 0.0 }", "radius"),
        ("tolerance = 1e-2", "tolerance = 7.0", "[[phases]] 1 (heat): tolerance"),
        ("tolerance = 1e-2", "tolerence = 1e-2", "tolerence"),
        ("\"three-stage\"", "\"four-stage\"", "sintering.kinetics"),
        ("[sintering]", "[sinterin]", "sinterin"),
        ("free = true", "free = true\nsize_m = [1e-5, 1e-5, 1e-5]", "box.size_m"),
    ];
    for (from, to, word) in cases {
        sandbox.write("bad.toml", PACKING.replace(from, to));
        sandbox.run("scene bad.toml").refused(&["bad.toml", word]);
    }
    sandbox.run("scene none.toml").refused(&["none.toml: no such file"]);
    sandbox.write("bad.toml", "");
    sandbox.run("scene bad.toml").refused(&["an empty file", "experiments/scenes"]);
    let overlapping = pair(4).replace("62.9685e-6", "60e-6");
    sandbox.write("bad.toml", overlapping);
    sandbox.run("scene bad.toml").refused(&["particles 0 and 1 overlap", "move them apart"]);
    let unstable = pair(4).replace("mode = \"quasi-static\"", "step_over_collision_time = 0.3");
    sandbox.write("bad.toml", unstable);
    sandbox.run("scene bad.toml").refused(&["stability limit", "step_over_collision_time"]);
    sandbox.write("notes/mine.txt", "mine");
    sandbox.write("pair.toml", pair(4));
    sandbox.run("scene pair.toml --out notes").refused(&["notes", "no scene.json"]);
    assert!(!sandbox.path().join("results/forty").exists());
}

/// The pair through the bed engine against the exact curves of `predict`, for the same draws.
#[test]
fn densify_of_the_pair_agrees_with_predict_draw_by_draw() {
    let sandbox = Sandbox::new();
    sandbox
        .run("--material pa12 --samples 8192 --no-other-kinetics --out post --quiet")
        .succeeded();
    sandbox.write("pair.toml", pair(400));
    sandbox
        .run("densify --posterior post --scene pair.toml --draws 5 --contact-ratio 0.9 --out bed --quiet")
        .succeeded();
    let report = sandbox.json("bed/densify.json");
    let draws = report["draws"].as_array().expect("draws");
    assert_eq!(draws.len(), 5);
    let table = fs::read_to_string(sandbox.path().join("post/draws.csv")).expect("draws.csv");
    let rows: Vec<&str> = table.lines().collect();
    fs::remove_file(sandbox.path().join("post/SHA256SUMS")).expect("removed");
    for draw in draws {
        // The posterior with this one draw, as often as it has draws.
        let row = draw["row"].as_u64().expect("a row") as usize;
        let same = format!("{}\n", rows[row + 1]).repeat(rows.len() - 1);
        sandbox.write("post/draws.csv", format!("{}\n{same}", rows[0]));
        let predicted = sandbox.run("predict --posterior post --contact-ratio 0.9 --json").json();
        let exact = predicted["sintering"][0]["time_s"]["median"].as_f64().expect("a time");
        let found = draw["time_to_target_s"].as_f64().expect("a time");
        assert!((found / exact - 1.0).abs() < 2e-3, "{found}, exactly {exact}");
    }
}

#[test]
fn densify_says_the_same_on_any_number_of_threads_and_takes_finished_beds_up() {
    let sandbox = calibrated(&frenkel(PACKING));
    let common = "densify --posterior post --scene scene.toml --draws 5";
    let ran = sandbox.run(&format!("{common} --threads 1 --out one"));
    assert!(
        ran.succeeded().stdout.contains("relative density 0.900 is reached after"),
        "{}",
        ran.stdout
    );
    assert!(ran.stdout.contains("5 draws are few"), "{}", ran.stdout);
    for line in [
        "Kingery and Berg",
        "closed pores (Mackenzie and Shuttleworth)",
        "the posterior's part alone",
    ] {
        assert!(ran.stdout.contains(line), "{line}: {}", ran.stdout);
    }
    sandbox.run(&format!("{common} --threads 3 --out three")).succeeded();
    let (one, three) = (sandbox.path().join("one"), sandbox.path().join("three"));
    same_files(&one, &three);
    // By pairs that approach half as far, and by pores, the same density takes longer.
    let report = json(&one.join("densify.json"));
    let median = |time: &Value| time["median"].as_f64().expect("reached");
    let times: Vec<f64> = report["other_laws"]
        .as_array()
        .expect("laws")
        .iter()
        .map(|law| median(&law["time_s"]))
        .collect();
    let bed = median(&report["target"]["time_s"]);
    assert!(times.len() == 5 && times[..3].is_sorted(), "{times:?}");
    assert!((bed / times[0] - 1.0).abs() < 0.05, "a bed is its affine formula: {bed} {times:?}");
    assert!(times[4] > 2.0 * bed, "{bed} {times:?}");
    let names: Vec<String> = files(&one).into_keys().filter(|name| !name.contains('/')).collect();
    let expected = ["densify.csv", "densify.json", "densify.png", "densify.svg", "draws.csv"];
    assert_eq!(names, [&expected[..], &["inputs.json", "report.html"]].concat());
    // Another target from the same beds.
    let again = sandbox.run(&format!("{common} --target 0.8 --out one"));
    assert!(
        again.succeeded().stderr.contains("5 of 5 draws are there already"),
        "{}",
        again.stderr
    );
    let time =
        |folder: &Path| json(&folder.join("densify.json"))["target"]["time_s"]["median"].as_f64();
    assert!(time(&one) < time(&three), "{:?} {:?}", time(&one), time(&three));
}

#[test]
fn a_killed_densify_goes_on_to_the_same_bits_and_notices_another_scene() {
    let sandbox = calibrated(&frenkel(PACKING));
    let arguments: Vec<&str> =
        "densify --posterior post --scene scene.toml --draws 6 --threads 1 --out killed"
            .split(' ')
            .collect();
    kill_when(&sandbox, &arguments, ".killed.work-", "draw-");
    let again = sandbox.run_args(&arguments);
    assert!(again.succeeded().stderr.contains("of 6 draws are there already"), "{}", again.stderr);
    sandbox.run_args(&[&arguments[..10], &["whole"]].concat()).succeeded();
    same_files(&sandbox.path().join("killed"), &sandbox.path().join("whole"));
    // Beds of another scene are not taken for these.
    let text = fs::read_to_string(sandbox.path().join("scene.toml")).expect("the scene");
    sandbox.write("scene.toml", text.replace("duration_s = 1.5", "duration_s = 1.0"));
    let other = sandbox.run_args(&arguments);
    assert!(!other.succeeded().stderr.contains("there already"), "{}", other.stderr);
    assert!(other.stderr.contains("moved the earlier run"), "{}", other.stderr);
}

#[test]
fn what_densify_cannot_use_is_refused_with_a_remedy() {
    let sandbox = calibrated(&frenkel(PACKING));
    let run = |scene: &str, options: &str| {
        sandbox.write("other.toml", scene);
        sandbox.run(&format!("densify --posterior post --scene other.toml --draws 3 {options}"))
    };
    run(PACKING, "").refused(&["sintering.kinetics", "three-stage", "frenkel", "--kinetics"]);
    let cold = frenkel(PACKING).replace("heated = true", "heated = false");
    run(&cold, "").refused(&["heated = true"]);
    let without = frenkel(PACKING);
    let (start, end) = (without.find("[sintering]"), without.find("[box]"));
    let without =
        format!("{}{}", &without[..start.expect("is there")], &without[end.expect("is there")..]);
    run(&without.replace("heated = true", "heated = false"), "")
        .refused(&["sintering", "kinetics"]);
    run(&frenkel(&pair(4)), "").refused(&["--contact-ratio"]);
    run(&frenkel(PACKING), "--target 90").refused(&["0.9"]);
    run(&frenkel(PACKING), "--draws 100000").refused(&["--draws"]);
    run(&frenkel(PACKING), "--target 0.8 --contact-ratio 0.5").refused(&["--contact-ratio"]);
    sandbox.run("densify --posterior nowhere --scene scene.toml").refused(&["nowhere"]);
    sandbox.run("densify --posterior post --scene none.toml").refused(&["none.toml"]);
    let before = sandbox.snapshot();
    sandbox.run("densify --posterior post --scene scene.toml --dry-run").succeeded();
    assert_eq!(sandbox.snapshot(), before);
    fs::remove_file(sandbox.path().join("post/draws.csv")).expect("removed");
    sandbox
        .run("densify --posterior post --scene scene.toml --draws 3")
        .refused(&["draws.csv: no such file", "beside posterior.json"]);
}

#[test]
fn draws_of_a_tuned_noise_and_of_another_powder_are_named_as_such() {
    let sandbox = Sandbox::new();
    sandbox
        .run("--material pa12 --kinetics frenkel --noise ess-target:0.2 --samples 8192 --out post --quiet")
        .succeeded();
    let scene = frenkel(PACKING)
        .replace("40.7e-3", "35.0e-3")
        .replace("duration_s = 1.5", "duration_s = 0.1");
    sandbox.write("scene.toml", scene);
    let ran = sandbox.run("densify --posterior post --scene scene.toml --draws 3 --out bed");
    assert!(ran.succeeded().stdout.contains("not of a posterior"), "{}", ran.stdout);
    assert!(ran.stdout.contains("surface tension"), "{}", ran.stdout);
    assert!(ran.stdout.contains("3 of 3 draws do not reach it"), "{}", ran.stdout);
    let report = sandbox.json("bed/densify.json");
    assert!(report["target"]["time_s"]["median"].is_null());
    assert_eq!(report["target"]["never"], 3);
}

#[test]
fn a_contact_ratio_that_the_pairs_do_not_live_to_see_is_told_as_such() {
    let sandbox = calibrated(&frenkel(PACKING));
    let ran = sandbox
        .run("densify --posterior post --scene scene.toml --draws 3 --contact-ratio 1.0 --out bed");
    let stdout = &ran.succeeded().stdout;
    assert!(
        stdout.contains("3 of 3 draws do not reach it: their pairs end at a smaller"),
        "{stdout}"
    );
    assert!(!stdout.contains("within the scene's time and count"), "{stdout}");
    let report = sandbox.json("bed/densify.json");
    assert_eq!(report["target"]["ended_below"], 3);
}
