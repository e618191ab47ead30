use std::fs;

use serde_json::Value;
use smc_calib::PriorSpec;

use super::*;
use crate::pair::parameter::ParameterName;
use crate::plan::PairOptions;

/// Writes the table of a built-in experiment into a folder, and initialises it with the constants of its material.
fn of_material(folder: &Path, material: Material) -> Initialised {
    let experiment = Experiment::of_material(material).expect("built in");
    let table = folder.join(format!("{material}.csv"));
    fs::write(&table, experiment.table.to_csv()).expect("written");
    let radius_m = Some(experiment.powder.radius_m);
    let options =
        InitOptions { table, material: Some(material), radius_m, ..InitOptions::default() };
    init(&options).expect("initialised")
}

#[test]
fn proposed_priors_hold_the_posteriors_of_all_materials_of_the_paper_and_their_plateaus() {
    let table3 = concat!(env!("CARGO_MANIFEST_DIR"), "/../../results/table3/table3.json");
    let table3: Value =
        serde_json::from_str(&fs::read_to_string(table3).expect("Table 3")).expect("JSON");
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (material, phi) in
        [(Material::Ps, 1.08..=1.10), (Material::Pa12, 1.2..=1.26), (Material::Peek, 1.2..=1.26)]
    {
        let said = of_material(folder.path(), material);
        let experiment =
            Experiment::read(&folder.path().join(format!("{material}.toml")), &Columns::default())
                .expect("written");
        let priors = PriorFile::read(&folder.path().join(format!("{material}-priors.toml")))
            .expect("written");
        assert_eq!(experiment.powder, material.powder());
        let written = fs::read_to_string(folder.path().join(format!("{material}.toml")));
        let says = written.expect("a description").contains("heat.md");
        assert_eq!(says, material == Material::Ps, "only a plateau may be a cooling: {material}");
        assert!(phi.contains(&experiment.final_contact_ratio), "{material}: {}", said.text);
        let materials = table3["materials"].as_array().expect("a list");
        let found =
            materials.iter().find(|found| found["name"] == material.name()).expect("the material");
        let mut held = 0;
        for row in found["rows"].as_array().expect("rows").iter().filter(|row| row["form"] == "si")
        {
            let name =
                row["parameter"].as_str().and_then(ParameterName::from_name).expect("a name");
            let PriorSpec::LogUniform { lower, upper } = *priors.get(name).expect("a prior").spec()
            else {
                panic!("{name:?} is not log-uniform")
            };
            let [low, high] = [0, 1]
                .map(|end| 10f64.powf(row["log10"]["eti95"][end].as_f64().expect("a number")));
            assert!(
                lower <= low && high <= upper,
                "{material} {name:?}: {low} .. {high} is not in {lower} .. {upper}"
            );
            held += 1;
        }
        assert_eq!(held, 3, "{found}");
    }
}

#[test]
fn the_same_table_gives_the_same_files_and_none_is_written_over_unasked() {
    let (one, other) =
        (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    let files = ["pa12.toml", "pa12-priors.toml", "pa12-data.png", "pa12-data.svg"];
    let read = |folder: &Path| files.map(|file| fs::read(folder.join(file)).expect(file));
    of_material(one.path(), Material::Pa12);
    of_material(other.path(), Material::Pa12);
    assert_eq!(read(one.path()), read(other.path()));
    let table = one.path().join("pa12.csv");
    let mut again = InitOptions {
        table,
        material: Some(Material::Pa12),
        radius_m: Some(20e-6),
        ..InitOptions::default()
    };
    let before = read(one.path());
    let error = init(&again).expect_err("files are there").to_string();
    assert!(
        files.iter().all(|file| error.contains(file)) && error.contains("--overwrite"),
        "{error}"
    );
    assert_eq!(read(one.path()), before);
    again.overwrite = true;
    init(&again).expect("written over");
    assert!(
        fs::read_to_string(one.path().join("pa12.toml")).expect("text").contains("radius_m = 2e-5")
    );
}

#[test]
fn what_was_said_of_the_columns_stands_in_the_experiment_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let table = folder.path().join("my data (1).txt");
    fs::write(&table, "clock;\"w \"\"x\"\"\"\n1,500;2,125\n2,500;10,125\n").expect("written");
    let options = InitOptions {
        table,
        columns: Columns {
            time: Some("clock".to_owned()),
            value: Some("w \"x\"".to_owned()),
            time_unit: crate::input::columns::Unit::parse("min"),
            value_unit: crate::input::columns::Unit::parse("um"),
            quantity: Some(crate::input::columns::Quantity::NeckDiameter),
            decimal: Some(crate::input::columns::DecimalMark::Comma),
            ..Columns::default()
        },
        radius_m: Some(10e-6),
        youngs_modulus_pa: Some(2e9),
        surface_tension_n_per_m: Some(0.03),
        ..InitOptions::default()
    };
    let done = init(&options).expect("initialised");
    assert!(done.text.contains("/my-data--1.toml"), "{}", done.text);
    let [experiment, prior] =
        ["my-data--1.toml", "my-data--1-priors.toml"].map(|file| folder.path().join(file));
    let read = Experiment::read(&experiment, &Columns::default()).expect("reads back");
    assert_eq!(read.table.time_s, [90.0, 150.0]);
    assert!((read.table.contact_ratio[1] - 10.125 / 20.0).abs() < 1e-14);
    let plan =
        PairOptions { experiment: Some(experiment), prior: Some(prior), ..PairOptions::default() };
    assert_eq!(plan.plan().expect("a plan").plan.parameters.len(), 3);
}

#[test]
fn everything_that_is_open_is_told_at_once() {
    let error = init(&InitOptions { table: "t.csv".into(), ..InitOptions::default() });
    let error = error.expect_err("open").to_string();
    for option in
        ["--radius-m 30e-6", "--youngs-modulus-pa 1.6e9", "--surface-tension-n-per-m 0.035"]
    {
        assert!(error.contains(option), "{error}");
    }
}

#[test]
fn bounds_are_rounded_outwards_to_one_digit() {
    let down = |value| one_digit(value, f64::floor);
    let up = |value| one_digit(value, f64::ceil);
    assert_eq!([down(0.234), down(3e-5), down(9.99e-8)], [0.2, 3e-5, 9e-8]);
    assert_eq!([up(0.234), up(3e-5), up(9.99)], [0.3, 3e-5, 10.0]);
}
