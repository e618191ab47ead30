use dem_core::paper;
use proptest::prelude::*;

use super::*;

const TABLE: &str = "time_s,contact_ratio\n0,0.1\n1,0.5\n2,1.0\n";

fn parse(text: &str) -> Result<Experiment, InputError> {
    Experiment::parse("my.toml", "my", text, |name, _, _| {
        Ok((name.to_owned(), ObservationTable::parse(name, TABLE)?))
    })
}

#[test]
fn a_description_needs_only_a_table_and_a_material() {
    let experiment = parse("table = \"t.csv\"\nmaterial = \"pa12\"\n").expect("valid");
    assert_eq!(experiment.name, "my");
    assert_eq!(experiment.powder, paper::PA12);
    assert_eq!(experiment.final_contact_ratio, 2f64.cbrt());
    assert_eq!(experiment.table_name, "t.csv");
    assert_eq!(experiment.observations(None).expect("all").len(), 3);
    assert_eq!(experiment.observations(Some([0.5, 1.5])).expect("one").len(), 1);
    let open = Some([0.5, f64::INFINITY]);
    assert_eq!(experiment.observations(open).expect("two").len(), 2);
    assert_eq!(experiment.fitted_window(open), Some([0.5, 2.0]));
    assert_eq!(experiment.fitted_window(None), None);
}

#[test]
fn a_powder_of_ones_own_has_the_density_of_table_2_unless_it_says_otherwise() {
    let text = "table = \"t.csv\"\n[powder]\nradius_m = 20e-6\nyoungs_modulus_pa = 2_000_000_000\n\
                surface_tension_n_per_m = 0.03\n";
    let experiment = parse(text).expect("valid");
    assert_eq!(experiment.material, None);
    assert_eq!(experiment.powder.radius_m, 20e-6);
    assert_eq!(experiment.powder.youngs_modulus_pa, 2e9);
    assert_eq!(experiment.powder.density_kg_per_m3, 1000.0);
    let denser = parse(&format!("{text}density_kg_per_m3 = 1200\n")).expect("valid");
    assert_eq!(denser.powder.density_kg_per_m3, 1200.0);
}

#[test]
fn each_mistake_names_its_line_and_field() {
    let ps = "material = \"ps\"\ntable = \"t.csv\"\n";
    let powder =
        "table = \"t.csv\"\n[powder]\nyoungs_modulus_pa = 2e9\nsurface_tension_n_per_m = 0.03\n";
    for (text, kind, line, says) in [
        ("material = \"ps\"\n".to_owned(), Mistake::MissingField, None, "field table"),
        ("table = \"t.csv\"\n".to_owned(), Mistake::MissingField, None, "[powder]"),
        (
            "table = \"t.csv\"\nmaterial = \"pa21\"".to_owned(),
            Mistake::UnknownName,
            Some(2),
            "did you mean \"pa12\"?",
        ),
        (format!("{ps}titel = \"x\"\n"), Mistake::UnknownField, Some(3), "did you mean title?"),
        (format!("{ps}radius_m = 30.5\n"), Mistake::OutOfRange, Some(3), "radius_m = 30.5e-6"),
        (format!("{ps}radius_m = 0\n"), Mistake::OutOfRange, Some(3), "a number > 0 [m]"),
        (format!("{ps}radius_m = -1e-6\n"), Mistake::Negative, Some(3), "radius_m"),
        (format!("{ps}radius_m = nan\n"), Mistake::NotFinite, Some(3), "radius_m"),
        (format!("{ps}radius_m = \"30 um\"\n"), Mistake::WrongType, Some(3), "without quotes"),
        (format!("{ps}final_contact_ratio = 0\n"), Mistake::OutOfRange, Some(3), "phi"),
        (format!("{ps}final_contact_ratio = 126\n"), Mistake::OutOfRange, Some(3), "phi"),
        (format!("{ps}window_s = [2, 1]\n"), Mistake::Bounds, Some(3), "swap"),
        (format!("{ps}window_s = [5, 6]\n"), Mistake::EmptyWindow, Some(3), "0 s to 2 s"),
        (format!("{ps}window_s = [5]\n"), Mistake::WrongType, Some(3), "two numbers"),
        (format!("{ps}window_s = 5\n"), Mistake::WrongType, Some(3), "two numbers"),
        (format!("{ps}name = \"../x\"\n"), Mistake::OutOfRange, Some(3), "folder"),
        (format!("{ps}source = \"\"\n"), Mistake::Empty, Some(3), "leave"),
        (format!("{ps}[powder]\n"), Mistake::Conflict, Some(1), "both material and [powder]"),
        (format!("{ps}name =\n"), Mistake::Syntax, Some(3), "not TOML"),
        (powder.to_owned(), Mistake::MissingField, Some(2), "powder.radius_m"),
        (format!("{powder}radius_m = 20\n"), Mistake::OutOfRange, Some(5), "is that in um?"),
        (format!("{powder}radius_m = 2e-5\nrho = 1\n"), Mistake::UnknownField, Some(6), "known"),
        (format!("radius_m = 2e-5\n{powder}"), Mistake::Conflict, None, "move radius_m"),
        (
            format!("{powder}radius_m = 2e-5\nwindow_s = [0, 1]\n"),
            Mistake::UnknownField,
            Some(6),
            "move window_s above the line [powder]",
        ),
        (format!("powder = 3\n{ps}"), Mistake::WrongType, Some(1), "a table [powder]"),
    ] {
        let error = parse(&text).expect_err(&text);
        assert_eq!((error.mistake, error.line), (kind, line), "{text}\n{error}");
        assert!(error.to_string().contains(says), "{text}\n{error}");
        assert!(error.to_string().starts_with("my.toml"), "{error}");
    }
    let gigapascal = powder.replace("2e9", "1.6").replace("[powder]", "[powder]\nradius_m = 2e-5");
    let error = parse(&gigapascal).expect_err("GPa");
    assert!(error.to_string().contains("write youngs_modulus_pa = 1.6e9"), "{error}");
}

#[test]
fn built_in_experiments_are_those_of_the_paper() {
    for name in BUILT_IN_NAMES {
        let experiment = Experiment::built_in(name).expect(name);
        assert_eq!(experiment.name, name);
        assert!(experiment.source.is_some() && experiment.title.is_some(), "{name}");
        assert_eq!(experiment.warnings(), Vec::<String>::new());
    }
    for (material, points, phi) in [
        (Material::Ps, 44, 1.08),
        (Material::Pa12, 30, full_coalescence()),
        (Material::Peek, 26, full_coalescence()),
    ] {
        let experiment = Experiment::of_material(material).expect("built in");
        assert_eq!(experiment.material, Some(material));
        assert_eq!(experiment.powder, material.powder());
        assert_eq!(experiment.observations(None).expect("all").len(), points);
        assert_eq!(experiment.final_contact_ratio, phi);
    }
    for (name, measured_um) in [("pa12-r30", 30.4), ("pa12-r29-3", 29.3), ("pa12-r28-9", 28.8)] {
        let other_pair = Experiment::built_in(name).expect("built in");
        let transferred = 31.5e-6 * measured_um / 32.1;
        assert!((other_pair.powder.radius_m / transferred - 1.0).abs() < 2e-6, "{name}");
        let measured_m = other_pair.measured_radius_m.expect("a measured radius");
        assert!((1e6 * measured_m / measured_um - 1.0).abs() < 1e-12, "{name}");
    }
    let misspelt = Experiment::built_in("pa12-r23").expect_err("unknown");
    assert!(misspelt.to_string().contains("did you mean pa12-r32?"), "{misspelt}");
}

proptest! {
    #[test]
    fn arbitrary_descriptions_never_panic(text in ".*") {
        let _ = parse(&text);
    }

    #[test]
    fn nearly_valid_descriptions_never_panic(
        keys in proptest::collection::vec(
            ("(table|material|radius_m|window_s|name|powder|\\[powder\\]|[a-z_.]{1,9})",
             "(\"[a-z0-9.]{0,6}\"|-?[0-9]{1,4}(\\.[0-9])?(e-?[0-9]{1,3})?|nan|inf|\\[[0-9, ]{0,8}\\]|0x1f|true|1979-05-27|\\{a=1\\})"),
            0..6),
    ) {
        let text: String = keys.iter().map(|(key, value)| format!("{key} = {value}\n")).collect();
        let _ = parse(&text);
    }
}

#[test]
fn necks_in_metres_are_told_with_their_conversion_and_divided_when_it_is_said() {
    let table = "time_s,contact_ratio\n0,3e-6\n1,12e-6\n2,24.4e-6\n";
    let read = |text: &str| {
        Experiment::parse("my.toml", "my", text, |name, columns, radius_m| {
            let table = ObservationTable::parse_as(name, table, columns, Some(radius_m))?;
            Ok((name.to_owned(), table))
        })
        .expect(text)
    };
    let text = "table = \"t.csv\"\nmaterial = \"ps\"\n";
    let warnings = read(text).warnings();
    let says = "necks in metres? the largest is then a/R = 0.800; ";
    assert!(warnings.len() == 1 && warnings[0].contains(says), "{warnings:?}");
    let said = read(&format!("{text}[columns]\nquantity = \"neck-radius\"\nvalue_unit = \"m\"\n"));
    assert_eq!(said.warnings(), Vec::<String>::new());
    assert!((said.table.contact_ratio[2] - 0.8).abs() < 1e-12);
    // The radius of the pair that was measured, where it is not that of the model.
    let columns =
        "measured_radius_m = 24.4e-6\n[columns]\nquantity = \"neck-radius\"\nvalue_unit = \"m\"\n";
    assert!((read(&format!("{text}{columns}")).table.contact_ratio[2] - 1.0).abs() < 1e-12);
}
