//! The first hour of a user: a spreadsheet's table, `init`, `check`, a calibration, a prediction, with no edit by hand.

use std::fs;

use serde_json::Value;

use crate::sandbox::{Sandbox, json, root};

/// The pair of PA12 as a German spreadsheet exports it: minutes, micrometres, decimal commas, in Windows-1252.
fn spreadsheet() -> Vec<u8> {
    let path = root().join("experiments/pa12-r32.csv");
    let published = fs::read_to_string(path).expect("the table");
    let mut text = "Probe;t [min];Hals-Radius (\u{b5}m);T [\u{b0}C];Bemerkung;;\r\n".to_owned();
    let rows = published.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    for row in rows {
        let (time_s, ratio) = row.split_once(',').expect("two columns");
        let [time_s, ratio]: [f64; 2] = [time_s, ratio].map(|cell| cell.parse().expect("a number"));
        let row = format!("A;{};{};180,5;;;\r\n", time_s / 60.0, ratio * 31.5);
        text += &row.replace('.', ",");
    }
    text += ";;;;;;\r\n;;;;Ende;;\r\n";
    text.chars().map(|c| u8::try_from(u32::from(c)).expect("Windows-1252")).collect()
}

#[test]
fn a_spreadsheet_becomes_a_posterior_and_a_prediction_by_the_commands_that_init_prints() {
    let sandbox = Sandbox::new();
    sandbox.write("PA12 Messung.csv", spreadsheet());
    let init = ["init", "PA12 Messung.csv", "--material", "pa12", "--radius-m", "31.5e-6"];
    let said = sandbox.run_args(&init).succeeded().stdout.clone();
    for words in [
        "\"t [min]\" as times in min",
        "as neck-radius in um",
        "decimal commas, cells between semicolons",
        "not read: Probe, T [\u{b0}C], Bemerkung",
        "1 row without numbers left out",
        "text in Windows-1252",
    ] {
        assert!(said.contains(words), "{words:?} is not in\n{said}");
    }
    assert!(sandbox.path().join("PA12-Messung-data.svg").exists());
    let commands: Vec<&str> =
        said.lines().filter_map(|line| line.trim().strip_prefix("calibrate ")).collect();
    assert_eq!(commands.len(), 3, "{said}");
    for command in &commands {
        let ran = sandbox.run(command);
        assert!(!ran.succeeded().stderr.contains("warning"), "{command}: {ran:?}");
    }
    // The data are those of the paper: so is the sintering time.
    let table3 = json(&root().join("results/table3/table3.json"));
    let of = |list: &Value, key: &str, name: &str| -> Value {
        let mut all = list.as_array().expect("a list").iter();
        all.find(|one| one[key] == name).expect(name).clone()
    };
    let rows = of(&table3["materials"], "name", "pa12")["rows"].clone();
    let si: Vec<Value> =
        rows.as_array().expect("rows").iter().filter(|row| row["form"] == "si").cloned().collect();
    let committed = of(&Value::from(si), "parameter", "tau_s")["log10"]["eti95"].clone();
    let posterior = sandbox.posterior("results/PA12-Messung");
    let parameters = posterior["parameters"].as_array().expect("parameters");
    let tau_s =
        parameters.iter().find(|found| found["parameter"]["name"] == "tau_s").expect("tau_s");
    let median = tau_s["in_coordinate"]["median"].as_f64().expect("a number");
    let [low, high] = [0, 1].map(|end| committed[end].as_f64().expect("a number"));
    assert!(low < median && median < high, "{median} is not in {low} .. {high}");
    let read = &posterior["plan"]["experiments"][0]["observables"][0]["table_read"];
    assert!(read.as_str().is_some_and(|how| how.contains("divided by R = 31.50 um")), "{read}");
}

#[test]
fn init_says_at_once_what_is_open_and_never_writes_over_a_file_unasked() {
    let sandbox = Sandbox::new();
    sandbox.write("my.csv", spreadsheet());
    let before = sandbox.snapshot();
    let open =
        ["--radius-m 30e-6", "--youngs-modulus-pa", "--surface-tension-n-per-m", "--material"];
    sandbox.run("init my.csv").refused(&open);
    sandbox.run("init my.csv --material ps --radius-m 30").refused(&["write 30e-6"]);
    sandbox.run("init no.csv --material ps --radius-m 3e-5").refused(&["no.csv: no such file"]);
    sandbox
        .run("init my.csv --material ps --radius-m 3e-5 --time-column u")
        .refused(&["column u: missing", "--time-column"]);
    assert_eq!(sandbox.snapshot(), before);
    sandbox.write("my-priors.toml", "mine");
    let before = sandbox.snapshot();
    let known = "init my.csv --material ps --radius-m 30e-6";
    sandbox.run(known).refused(&["my-priors.toml: there already", "--overwrite"]);
    assert_eq!(sandbox.snapshot(), before);
    sandbox.run(&format!("{known} --overwrite")).succeeded();
    sandbox.run("check my.toml my-priors.toml").succeeded();
    sandbox.run("init my.toml --material ps --radius-m 3e-5").refused(&["a TOML file"]);
}

#[test]
fn columns_are_mapped_by_options_or_in_the_experiment_file_to_the_same_table() {
    let sandbox = Sandbox::new();
    sandbox.write("t.csv", "clock;w\n1,500;12,125\n2,250;20,500\n3,000;31,125\n");
    let said = "--time-column clock --value-column w --time-unit min --quantity neck-diameter \
                --value-unit um --decimal comma";
    sandbox.write(
        "t.toml",
        "table = \"t.csv\"\nmaterial = \"ps\"\n[columns]\ntime = \"clock\"\nvalue = \"w\"\n\
         time_unit = \"min\"\nquantity = \"neck-diameter\"\nvalue_unit = \"um\"\ndecimal = \"comma\"\n",
    );
    let plan = |arguments: &str| -> Value {
        let plan = sandbox.run(&format!("{arguments} --dry-run --json")).json();
        plan["experiments"][0]["observables"][0].clone()
    };
    let by_options = plan(&format!("--material ps --experiment t.csv {said}"));
    let by_file = plan("--experiment t.toml");
    assert_eq!(by_options["control"], serde_json::json!([90.0, 135.0, 180.0]));
    for field in ["control", "values", "lines", "table_read"] {
        assert_eq!(by_options[field], by_file[field], "{field}");
    }
    sandbox.run(&format!("check t.toml {said}")).succeeded();
    sandbox.run("--material ps --experiment t.csv").refused(&["t.csv", "column time_s: missing"]);
    sandbox.run(&format!("--material ps {said}")).refused(&["--experiment"]);
    sandbox
        .run("--material ps --experiment t.csv --quantity width")
        .refused(&["neck-radius", "contact-over-diameter"]);
    sandbox
        .run("--material ps --experiment t.csv --time-unit um")
        .refused(&["one of the units s, ms, us, min, h"]);
}
