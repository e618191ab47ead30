//! The types that a plan file holds: their names and fields in text.

use std::fmt::{Debug, Display};
use std::str::FromStr;

use dem_core::kinetics::UnknownName;
use dem_core::{Kinetics, Powder, SolverKind, paper};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Holds `name`, `Display`, `FromStr` and serde of a closed list together.
fn hold<T>(all: &[T], name: fn(T) -> &'static str, expected: &[&str])
where
    T: Copy + Debug + Display + PartialEq + FromStr<Err = UnknownName>,
    T: Serialize + DeserializeOwned,
{
    assert_eq!(all.iter().map(|&each| name(each)).collect::<Vec<_>>(), expected);
    for &each in all {
        let name = name(each);
        assert_eq!(each.to_string(), name);
        assert_eq!(name.parse::<T>().as_ref(), Ok(&each));
        let json = serde_json::to_string(&each).expect("a name");
        assert_eq!(json, format!("\"{name}\""));
        assert_eq!(serde_json::from_str::<T>(&json).expect("its own name"), each);
    }
    let by_serde = serde_json::from_str::<T>("\"closed_form\"").expect_err("unknown").to_string();
    let by_name = "closed_form".parse::<T>().expect_err("unknown").to_string();
    for message in [by_serde, by_name] {
        assert!(message.contains("closed_form"), "{message}");
        assert!(expected.iter().all(|name| message.contains(name)), "{message}");
    }
}

#[test]
fn kinetics_and_solvers_have_one_name_in_text_and_in_files() {
    hold(
        &Kinetics::ALL,
        Kinetics::name,
        &["three-stage", "frenkel", "pokluda", "three-stage-pokluda", "regime-map", "bellehumeur"],
    );
    hold(&SolverKind::ALL, SolverKind::name, &["verlet", "quasi-static", "closed-form"]);
    let error = "frenkl".parse::<Kinetics>().expect_err("not a law").to_string();
    assert!(error.contains("'frenkl'") && error.contains("three-stage-pokluda"), "{error}");
}

#[test]
fn a_powder_survives_json_to_the_bit_and_refuses_unknown_fields() {
    let json = serde_json::to_string(&paper::PA12).expect("plain numbers");
    assert_eq!(serde_json::from_str::<Powder>(&json).expect("its own text"), paper::PA12);
    let unknown = json.replace("density_kg_per_m3", "density");
    let message = serde_json::from_str::<Powder>(&unknown).expect_err("unknown").to_string();
    assert!(message.contains("density") && message.contains("density_kg_per_m3"), "{message}");
    let (_, without_radius) = json.split_once(',').expect("four fields");
    let missing = format!("{{{without_radius}");
    let message = serde_json::from_str::<Powder>(&missing).expect_err("missing").to_string();
    assert!(message.contains("radius_m"), "{message}");
}
