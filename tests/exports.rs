//! `calibrate export --format`: a posterior in the formats of other programs. `tests/exports/run.sh` has these programs read it.

use std::fs;
use std::path::Path;

use crate::sandbox::{Sandbox, json, root};

const ALL: &str = "--format zarr,idata-json,stan-csv,draws-csv";

/// The numbers of an array of a store, held against its metadata.
fn array(store: &Path, name: &str) -> Vec<f64> {
    let metadata = json(&store.join(name).join("zarr.json"));
    let shape = metadata["shape"].as_array().expect("a shape");
    let bytes = fs::read(store.join(name).join(format!("c{}", "/0".repeat(shape.len()))));
    let whole = metadata["data_type"] == "int64";
    let number = |bytes: &[u8]| {
        let bytes = bytes.try_into().expect("eight bytes");
        if whole { i64::from_le_bytes(bytes) as f64 } else { f64::from_le_bytes(bytes) }
    };
    let values: Vec<f64> = bytes.expect("a chunk").chunks(8).map(number).collect();
    let wanted: u64 = shape.iter().map(|length| length.as_u64().expect("a length")).product();
    assert_eq!(values.len() as u64, wanted, "{name}");
    let dims = metadata["dimension_names"].as_array().expect("dimensions");
    assert_eq!(dims.len(), shape.len(), "{name}");
    let group = name.split('/').next().expect("a group");
    for (dim, length) in dims.iter().zip(shape) {
        let coordinate = store.join(group).join(dim.as_str().expect("a name")).join("zarr.json");
        assert_eq!(json(&coordinate)["shape"][0], *length, "{name}");
    }
    values
}

/// A column of a table of draws.
fn column(text: &str, name: &str) -> Vec<f64> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let place = lines.next().expect("names").split(',').position(|title| title == name);
    let place = place.unwrap_or_else(|| panic!("no {name}"));
    lines
        .map(|line| line.split(',').nth(place).expect("a cell").parse().expect("a number"))
        .collect()
}

#[test]
#[ignore = "long: run by .ci/run"]
fn all_formats_have_the_same_draws_and_a_store_is_whole() {
    let sandbox = Sandbox::new();
    sandbox.run("--material pa12 -n 50 --out run").succeeded();
    let said = sandbox.run(&format!("export run {ALL}"));
    assert_eq!(said.succeeded().stdout.lines().count(), 4, "{said:#?}");
    let folder = sandbox.path().join("run/export");
    let store = folder.join("posterior.zarr");
    let root = json(&store.join("zarr.json"));
    let consolidated = root["consolidated_metadata"]["metadata"].as_object().expect("metadata");
    for (path, metadata) in consolidated {
        assert_eq!(*metadata, json(&store.join(path).join("zarr.json")), "{path}");
        if metadata["node_type"] == "array" {
            array(&store, path);
        }
    }
    let record = sandbox.posterior("run");
    assert_eq!(root["attributes"]["importance_ess"], record["trust"]["effective_samples"]);
    assert_eq!(root["attributes"]["log_evidence"], record["log_evidence"]["value"]);
    assert_eq!(consolidated["posterior/tau_s"]["attributes"]["units"], "s");
    assert_eq!(consolidated["observed_data/time_s"]["attributes"]["units"], "s");
    let idata = json(&folder.join("posterior-idata.json"));
    let stan = fs::read_to_string(folder.join("posterior-stan.csv")).expect("a table");
    let table = fs::read_to_string(folder.join("posterior-draws.csv")).expect("a table");
    for name in ["c1", "tau_s", "delta_c", "sigma"] {
        let drawn = array(&store, &format!("posterior/{name}"));
        let worth = [&record["trust"]["effective_samples"], &record["ess"]["by_errors"]];
        let most = worth.iter().filter_map(|worth| worth.as_f64()).fold(0.0, f64::max);
        assert!(drawn.len() as f64 <= most, "{} {most}", drawn.len());
        let of_json = idata["posterior"][name][0].as_array().expect("one chain");
        let of_json: Vec<f64> =
            of_json.iter().map(|value| value.as_f64().expect("a number")).collect();
        assert_eq!(drawn, of_json, "{name}");
        assert_eq!(drawn, column(&stan, name), "{name}");
        assert_eq!(drawn, column(&table, name), "{name}");
    }
    let pointwise = array(&store, "log_likelihood/contact_ratio");
    let width = array(&store, "observed_data/contact_ratio").len();
    let second: Vec<f64> = pointwise.iter().skip(1).step_by(width).copied().collect();
    assert_eq!(second, column(&stan, "log_lik.2"));
    assert_eq!(second, column(&table, "log_lik[2]"));
    assert_eq!(array(&store, "sample_stats/lp"), column(&stan, "lp__"));
    // What is there is not overwritten, and nothing else is written then.
    let before = sandbox.snapshot();
    sandbox.run("export run --format draws-csv,zarr").refused(&[
        "posterior.zarr",
        "already",
        "--out",
    ]);
    let no_folder = "export run --format zarr --out run/posterior.json";
    sandbox.run(no_folder).refused(&["--out", "run/posterior.json"]);
    assert!(sandbox.snapshot() == before, "nothing is written");
    sandbox.run("export run/posterior.json --format draws-csv --out elsewhere").succeeded();
    let again = fs::read_to_string(sandbox.path().join("elsewhere/posterior-draws.csv"));
    assert_eq!(again.expect("a table"), table);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_run_of_programs_is_exported_from_its_stored_runs_and_says_what_is_missing_without_them() {
    let sandbox = Sandbox::new();
    for file in ["two.toml", "line.sh", "line.csv", "twice.csv"] {
        let text = fs::read_to_string(root().join("tests/exports").join(file)).expect("a file");
        sandbox.write(file, text.replace("samples = 400", "samples = 64"));
    }
    sandbox.run("--plan two.toml --out run").succeeded();
    sandbox.run(&format!("export run {ALL} --quiet")).succeeded();
    let store = sandbox.path().join("run/export/posterior.zarr");
    let noise = ["sigma_force", "correlation_length_force", "white_share_force", "sigma_double"];
    for name in noise {
        assert!(array(&store, &format!("posterior/{name}")).iter().all(|value| *value > 0.0));
        assert!(array(&store, &format!("prior/{name}")).iter().all(|value| *value > 0.0));
    }
    // Two observations at one time have numbers, and their times beside them.
    assert_eq!(array(&store, "log_likelihood/double_row"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(array(&store, "constant_data/double_time"), [0.5, 1.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(array(&store, "log_likelihood/force_time").len(), 8);
    for group in ["log_likelihood", "posterior_predictive"] {
        assert!(array(&store, &format!("{group}/force")).iter().all(|value| value.is_finite()));
    }
    // Results that were sent without their runs.
    fs::rename(sandbox.path().join("run/campaign"), sandbox.path().join("kept")).expect("moved");
    let said = sandbox.run(&format!("export run {ALL} --out without"));
    assert!(said.succeeded().stderr.contains("log_likelihood"), "{said:#?}");
    let without = sandbox.path().join("without/posterior.zarr");
    assert!(!without.join("log_likelihood").exists() && without.join("sample_stats").exists());
    assert_eq!(array(&without, "posterior/a"), array(&store, "posterior/a"));
    let stan = fs::read_to_string(sandbox.path().join("without/posterior-stan.csv"));
    assert!(column(&stan.expect("a table"), "lp__").iter().all(|value| value.is_nan()));
}

/// The plan of a calibration of PS by 50 runs of a program that computes the closed form.
fn plan_of_program(sandbox: &Sandbox, seed: u64) {
    let ps = workbench::input::experiment::Experiment::built_in("ps-r30").expect("built in");
    sandbox.write("ps-r30.csv", ps.table.to_csv());
    let mut plan = format!("name = \"program\"\n[sampler]\nsamples = 50\nseed = {seed}\n");
    for (name, unit, lower, upper) in
        [("c1", "1/(Pa s)", 1e-6, 1e-1), ("tau_s", "s", 1e-2, 1.0), ("delta_c", "m", 1e-8, 3e-6)]
    {
        plan += &format!(
            "[parameters.{name}]\nunit = \"{unit}\"\ndistribution = \"log-uniform\"\nlower = {lower:e}\nupper = {upper:e}\n"
        );
    }
    let program = r#"
[experiments.ps-r30.simulator]
kind = "command"
argv = ["CALIBRATE", "simulate", "--experiment", "ps-r30", "--solver", "closed-form", "--c1", "{c1}", "--tau-s", "{tau_s}",
    "--delta-c", "{delta_c}", "--times", "{plan_dir}/ps-r30.csv", "--out", "neck.csv", "--quiet"]
[experiments.ps-r30.observables.contact_ratio]
table = "ps-r30.csv"
control = "time_s"
noise = { kind = "inferred", nu0 = 4, s0 = 0.05 }
result = { file = "neck.csv", control = "time_s", value = "contact_ratio", interpolate = "refuse" }
"#;
    plan += &program.replace("CALIBRATE", env!("CARGO_BIN_EXE_calibrate"));
    sandbox.write("program.toml", plan);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn draws_of_a_process_through_the_runs_of_a_program_have_nearly_the_likelihoods_of_runs_at_them() {
    let (sandbox, seed) = Sandbox::with_moved_samples();
    plan_of_program(&sandbox, seed);
    sandbox.run("--plan program.toml --quiet --out program").succeeded();
    let exported = |run: &str| {
        sandbox.run(&format!("export {run} --format draws-csv --quiet")).succeeded();
        fs::read_to_string(sandbox.path().join(run).join("export/posterior-draws.csv"))
            .expect("a table")
    };
    let [built_in, program] = ["run", "program"].map(exported);
    for name in ["c1", "tau_s", "delta_c", "log_lik[1]", "log_lik[9]", "y_rep[2]"] {
        let [built_in, program] = [&built_in, &program].map(|text| column(text, name));
        assert!(built_in.len() > 4, "{name}: {} draws", built_in.len());
        assert_eq!(built_in.len(), program.len(), "{name}");
        let pairs = built_in.iter().zip(&program);
        let mut off: Vec<f64> = pairs.clone().map(|(a, b)| (a - b).abs()).collect();
        off.sort_by(f64::total_cmp);
        // The built-in model is simulated at the draws, outputs of the program are predicted there.
        if name.contains('[') {
            assert!(off[off.len() / 2] < 0.1, "seed {seed}, {name}: {off:?}");
        } else {
            let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-6 * a.abs();
            assert!(pairs.clone().all(same), "seed {seed}, {name}: {off:?}");
        }
    }
}

#[test]
fn what_has_no_posterior_is_refused_in_a_sentence() {
    let sandbox = Sandbox::new();
    sandbox.run("export nothing --format zarr").refused(&["nothing"]);
    sandbox.run("export nothing --format netcdf").refused(&["netcdf", "zarr"]);
    sandbox.write("compared/compare.json", "{}");
    sandbox
        .run("export compared --format zarr")
        .refused(&["comparison", "predict --average compared"]);
    sandbox.run("--material ps -n 64 --noise ess-target:0.2 --out tuned").succeeded();
    sandbox.run("export tuned --format zarr").refused(&[
        "ess-target",
        "no posterior",
        "samples.csv",
    ]);
    sandbox.run("export tuned").refused(&["calibrate export tuned --format zarr"]);
}
