//! Files of a run that are read again: cut off or with a bit turned, they are refused by name, or they are whole.

use std::fs;

use proptest::prelude::*;
use workbench::error::Mistake;
use workbench::record;
use workbench::report::{read_draws, read_samples};

use crate::sandbox::Sandbox;

const FILES: [&str; 3] = ["posterior.json", "samples.csv", "draws.csv"];

fn damaged(whole: &[u8], place: usize, turn: Option<u8>) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    match turn {
        Some(bit) => bytes[place] ^= 1 << bit,
        None => bytes.truncate(place),
    }
    bytes
}

/// One run for all cases: its folder, and what its files hold.
fn run() -> (Sandbox, Vec<Vec<u8>>) {
    let sandbox = Sandbox::new();
    sandbox.run("--material pa12 --samples 8192 --no-other-kinetics --quiet --out run").succeeded();
    whole(sandbox)
}

fn whole(sandbox: Sandbox) -> (Sandbox, Vec<Vec<u8>>) {
    let whole = FILES.map(|name| fs::read(sandbox.path().join("run").join(name)).expect(name));
    (sandbox, whole.into())
}

fn hold_every_damage((sandbox, whole): &(Sandbox, Vec<Vec<u8>>), with_sums: bool) {
    let folder = sandbox.path().join("run");
    if !with_sums {
        fs::remove_file(folder.join("SHA256SUMS")).expect("removed");
    }
    let file = record::read(&folder).expect("a posterior");
    // Places near the end and at ends of lines as well as anywhere.
    let place = prop_oneof![
        any::<prop::sample::Index>().prop_map(|i| (i, false)),
        any::<prop::sample::Index>().prop_map(|i| (i, true))
    ];
    let config =
        ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() };
    proptest!(config, |(which in 0..FILES.len(), place in place, turn in prop::option::of(0u8..8))| {
        let bytes = &whole[which];
        let ends: Vec<usize> = (0..bytes.len()).filter(|&at| bytes[at] == b'\n').collect();
        let (index, at_line_end) = place;
        let place = if at_line_end { ends[index.index(ends.len())] + 1 } else { index.index(bytes.len()) };
        let place = place.min(bytes.len() - 1);
        fs::write(folder.join(FILES[which]), damaged(bytes, place, turn)).expect("written");
        let outcome = match FILES[which] {
            "posterior.json" => record::read(&folder).map(|_| ()),
            "samples.csv" => read_samples(&file, &folder).map(|_| ()),
            _ => read_draws(&file, &folder).map(|_| ()),
        };
        fs::write(folder.join(FILES[which]), bytes).expect("written");
        match outcome {
            // A bit of a digit makes another number: only the sum can tell.
            Ok(()) => prop_assert!(!with_sums, "read as if it were whole"),
            Err(error) => {
                let text = error.to_string();
                prop_assert!(text.contains(FILES[which]), "{text}");
                prop_assert!(text.contains("help:") || text.contains("line "), "{text}");
            }
        }
    });
}

#[test]
#[ignore = "long: run by .ci/run"]
fn every_damage_is_seen_where_the_sums_are_there() {
    hold_every_damage(&run(), true);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn without_sums_damage_is_refused_or_read_but_never_a_panic() {
    hold_every_damage(&run(), false);
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn damage_to_tables_with_moved_samples_is_seen_too() {
    let run = whole(Sandbox::with_moved_samples().0);
    hold_every_damage(&run, true);
    hold_every_damage(&run, false);
    hold_cut_tables(&run.0);
}

/// Holds that both tables, cut off at the end of a line, are known not to be whole where there are no sums.
fn hold_cut_tables(sandbox: &Sandbox) {
    let folder = sandbox.path().join("run");
    let file = record::read(&folder).expect("a posterior");
    for name in ["samples.csv", "draws.csv"] {
        let path = folder.join(name);
        let text = fs::read_to_string(&path).expect("text");
        let kept: Vec<&str> = text.lines().take(40).collect();
        fs::write(&path, kept.join("\n") + "\n").expect("written");
        let outcome = match name {
            "samples.csv" => read_samples(&file, &folder).map(|_| ()),
            _ => read_draws(&file, &folder).map(|_| ()),
        };
        assert_eq!(outcome.expect_err(name).mistake, Mistake::Damaged, "{name}");
    }
}

#[test]
fn a_table_cut_off_at_the_end_of_a_line_is_not_whole() {
    let (sandbox, _) = run();
    fs::remove_file(sandbox.path().join("run/SHA256SUMS")).expect("removed");
    hold_cut_tables(&sandbox);
}

#[test]
fn sums_are_those_of_the_common_tool() {
    let (sandbox, _) = run();
    let checked = std::process::Command::new("sha256sum")
        .args(["--check", "--strict", "SHA256SUMS"])
        .current_dir(sandbox.path().join("run"))
        .output();
    match checked {
        Ok(output) => assert!(output.status.success(), "{output:?}"),
        Err(error) => eprintln!("skipped: no sha256sum here ({error})"),
    }
}
