use super::*;
use crate::input::toml_fields::Document;
use proptest::prelude::*;

fn read(text: &str) -> Result<HeatFields, InputError> {
    let document = Document::parse("my.toml", text)?;
    let heat = document.top().table("heat")?.expect("a table [heat]");
    HeatFields::read(Path::new("."), &heat)
}

fn plan(lines: &str) -> Result<HeatPlan, InputError> {
    read(&format!("[heat]\n{lines}")).and_then(|fields| fields.plan())
}

#[test]
fn mistakes_are_told_with_field_value_and_remedy() {
    let pulse = "history = \"pulse\"\n";
    let oven =
        "history = \"ramp-and-hold\"\nmobility = \"arrhenius\"\nreference_temperature_k = 450\n";
    for (text, says) in [
        (String::new(), "field heat.mobility"),
        ("mobility = \"direct\"".to_owned(), "field heat.history"),
        (format!("{pulse}mobility = \"arhenius\""), "did you mean \"arrhenius\"?"),
        (format!("{pulse}mobility = \"threshold-power\"\npulse_energy = 3"), "reference_energy"),
        (format!("{pulse}mobility = \"arrhenius\""), "reference_temperature_k"),
        (
            format!("{pulse}mobility = \"wlf\"\nreference_temperature_k = 373\npulse_energy = 3"),
            "ambient_temperature_k",
        ),
        (format!("{pulse}mobility = \"direct\"\nwlf_c1 = 13"), "wlf_c1, which history = \"pulse\""),
        (format!("{pulse}mobility = \"direct\"\ncooling_time_s = -1"), "found -1"),
        (format!("{pulse}ambient_temperature_k = 0.5"), "0 C is 273.15 K"),
        (format!("{pulse}coolin_time_s = 1"), "did you mean heat.cooling_time_s?"),
        ("history = \"constant\"\nmobility = \"direct\"".to_owned(), "laws of pulses"),
        (oven.to_owned(), "start_temperature_k"),
        (
            format!(
                "{oven}start_temperature_k = 300\nrate_k_per_s = 1\nhold_temperature_k = 450\nhold_s = 9"
            ),
            "cooling_rate_k_per_s",
        ),
        ("history = \"table\"\ntable = \"nowhere.csv\"".to_owned(), "nowhere.csv"),
    ] {
        let error = plan(&text).expect_err(&text).to_string();
        assert!(error.contains(says), "{text}\n{error}");
    }
}

#[test]
fn a_cooling_time_that_goes_with_no_power_of_r_is_the_same_at_every_radius() {
    let text = "history = \"pulse\"\nmobility = \"direct\"\ncooling_time_s = 0.4\ncooling_radius_m = 60e-6\n";
    let end = |power: &str, radius_m: f64| {
        let plan = plan(&format!("{text}cooling_power = {power}")).expect("a heat");
        plan.at(radius_m, |_| None).expect("all is stated").reduced_time_at_end()
    };
    assert_eq!(end("0", 30e-6), end("0", 60e-6));
    assert_eq!(end("0.0", 30e-6), end("1", 60e-6));
    assert!(plan(&format!("{text}cooling_power = -0.1")).is_err());
}

#[test]
fn a_table_of_temperatures_is_read_with_the_line_of_what_is_wrong() {
    let folder = tempfile::tempdir().expect("a folder");
    let read = |table: &str| {
        std::fs::write(folder.path().join("oven.csv"), table).expect("a table");
        let text = "[heat]\nhistory = \"table\"\ntable = \"oven.csv\"\nmobility = \"arrhenius\"\nreference_temperature_k = 450\n";
        let document = Document::parse("my.toml", text).expect("TOML");
        let heat = document.top().table("heat").expect("a table").expect("a table");
        HeatFields::read(folder.path(), &heat).and_then(|fields| fields.plan())
    };
    match read("time_s,temperature_k\n0,300\n10,450\n").expect("a heat").history {
        HistoryPlan::Table { time_s, temperature_k, .. } => {
            assert_eq!((time_s, temperature_k), (vec![0.0, 10.0], vec![300.0, 450.0]));
        }
        other => panic!("{other:?}"),
    }
    for (table, says) in [
        ("time_s,temperature_k\n0,300\n0,450\n", "line 3, column time_s"),
        ("time_s,temperature_k\n0,-20\n", "0 C is 273.15 K"),
        ("time_s,t\n0,300\n", "temperature_k"),
        ("time_s,temperature_k\n0,warm\n", "line 2"),
    ] {
        let error = read(table).expect_err(table).to_string();
        assert!(error.contains(says), "{table}\n{error}");
    }
}

#[test]
fn what_a_plan_says_goes_before_what_the_experiment_says_field_by_field() {
    let own = read("[heat]\nhistory = \"pulse\"\npulse_energy = 19\nmobility = \"direct\"")
        .expect("fields");
    let plan =
        read("[heat]\nmobility = \"threshold-power\"\nreference_energy = 29").expect("fields");
    let both = plan.or(&own).plan().expect("a heat");
    assert_eq!(both.law, LawPlan::ThresholdPower { reference_energy: 29.0 });
    assert_eq!(both.energy(), Some(19.0));
}

proptest! {
    #[test]
    fn any_fields_give_a_heat_or_an_error(
        lines in proptest::collection::vec(
            ("(history|mobility|pulse_energy|cooling_time_s|reference_energy|wlf_c1|start_s|table|temperature_k)",
             "(\"(pulse|constant|direct|wlf|arrhenius|x)\"|-?[0-9]{1,3}|nan|inf|1e400|\\[1\\]|true)"),
            0..8,
        )
    ) {
        let text: String = lines.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        if let Ok(heat) = plan(&text) {
            let _ = heat.at(30e-6, |_| Some(1.0));
        }
    }
}
