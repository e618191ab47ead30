//! Records that anybody may have changed: whatever is in them, a report, a comparison, a listing and an archive of them end with a
//! result or an error, never with a panic.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::{Config, TestRunner};
use serde_json::{Value, json};

use crate::sandbox::{Sandbox, json};

/// What is put in place of a value.
fn values() -> impl Strategy<Value = Value> {
    let numbers =
        [0.0, -1.0, 1e-320, -1e308, 1e308, 1e15, 0.5, 4.0, 4096.0, 4_294_967_296.0, 1.8e19];
    prop_oneof![
        prop::sample::select(numbers.to_vec()).prop_map(|number| json!(number)),
        any::<i64>().prop_map(|number| json!(number)),
        (0..40u64).prop_map(|number| json!(number)),
        Just(Value::Null),
        Just(json!([])),
        Just(json!([[], [1e308, -1e308]])),
        Just(json!({})),
        any::<bool>().prop_map(Value::Bool),
        "\\PC{0,12}".prop_map(Value::String),
        Just(json!("a\n\u{1b}[31m\u{7}/../b")),
        Just(json!("x".repeat(5000))),
    ]
}

/// A change: which value, by what it is replaced, or how its list or object becomes another.
#[derive(Debug, Clone)]
enum Change {
    Put(Value),
    Remove,
    Twice,
    /// Another value of the same record.
    Swap(Index),
}

fn change() -> impl Strategy<Value = (Index, Change)> {
    let change = prop_oneof![
        6 => values().prop_map(Change::Put),
        2 => Just(Change::Remove),
        1 => Just(Change::Twice),
        2 => any::<Index>().prop_map(Change::Swap),
    ];
    (any::<Index>(), change)
}

/// The addresses of all values.
fn addresses(value: &Value, own: String, all: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                let name = name.replace('~', "~0").replace('/', "~1");
                addresses(value, format!("{own}/{name}"), all);
            }
        }
        Value::Array(list) => {
            // The first and last of long lists stand for all.
            for (at, value) in list.iter().enumerate() {
                if at < 2 || at + 1 == list.len() {
                    addresses(value, format!("{own}/{at}"), all);
                }
            }
        }
        _ => {}
    }
    all.push(own);
}

fn changed(record: &Value, changes: &[(Index, Change)]) -> Value {
    let mut record = record.clone();
    for (index, change) in changes {
        let mut all = Vec::new();
        addresses(&record, String::new(), &mut all);
        let place = index.get(&all).clone();
        let (parent, name) = place.rsplit_once('/').unwrap_or(("", ""));
        let value = match change {
            Change::Put(value) => value.clone(),
            Change::Swap(other) => {
                record.pointer(other.get(&all).as_str()).cloned().unwrap_or_default()
            }
            Change::Remove | Change::Twice => {
                let once = record.pointer(&place).cloned().unwrap_or_default();
                let twice = matches!(change, Change::Twice);
                match (record.pointer_mut(parent), name.parse::<usize>()) {
                    (Some(Value::Array(list)), Ok(_)) if twice => list.push(once),
                    (Some(Value::Array(list)), Ok(at)) if at < list.len() => {
                        list.remove(at);
                    }
                    (Some(Value::Object(fields)), _) if !twice => {
                        fields.remove(name);
                    }
                    _ => {}
                }
                continue;
            }
        };
        if let Some(place) = record.pointer_mut(&place) {
            *place = value;
        }
    }
    record
}

/// All that reads a run; none of it may panic.
fn read_by_all(run: &Path, good: &Path, out: &Path) {
    let _ = workbench::report::again(run);
    for pair in [[run, good], [good, run]] {
        if let Ok(compared) = workbench::diff::compare(pair[0], pair[1]) {
            let text = workbench::diff::text(&compared.diff);
            assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
        }
    }
    let _ = workbench::archive::pack(run, &out.join("run.zip"));
    let listing = workbench::runs::list(run.parent().expect("a parent"), SystemTime::now());
    let text = listing.expect("a folder").text();
    assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
}

fn hostile(cases: u32, command: &str) {
    let sandbox = Sandbox::new();
    sandbox.run(command).succeeded();
    let good = sandbox.path().join("good");
    let (runs, out) = (sandbox.path().join("runs"), sandbox.path().join("out"));
    fs::create_dir(&out).expect("a folder");
    fs::create_dir_all(runs.join("run")).expect("a folder");
    for name in ["samples.csv", "draws.csv", "inputs.json", "posterior.json", "SHA256SUMS"] {
        fs::copy(good.join(name), runs.join("run").join(name)).expect(name);
    }
    let records = ["posterior.json", "inputs.json"].map(|name| json(&good.join(name)));
    let lines = fs::read_to_string(good.join("SHA256SUMS")).expect("sums");
    // A failure is shown soon.
    let config =
        Config { cases, failure_persistence: None, max_shrink_iters: 40, ..Config::default() };
    let which = prop_oneof![6 => Just(0usize), 1 => Just(1), 1 => Just(2)];
    let changes = prop::collection::vec(change(), 1..3);
    let (odd, cut) = ("\\PC{0,30}", any::<Index>());
    TestRunner::new(config)
        .run(&(which, changes, odd, cut), |(which, changes, odd, cut)| {
            let run = runs.join("run");
            let write = |name: &str, text: String| fs::write(run.join(name), text).expect(name);
            for (name, record) in ["posterior.json", "inputs.json"].into_iter().zip(&records) {
                write(name, record.to_string() + "\n");
            }
            let _ = fs::remove_file(run.join("SHA256SUMS"));
            match which {
                2 => {
                    let at = cut.index(lines.len());
                    write("SHA256SUMS", format!("{}{odd}{}", &lines[..at], &lines[at..]));
                }
                which => {
                    let name = ["posterior.json", "inputs.json"][which];
                    write(name, changed(&records[which], &changes).to_string() + "\n");
                }
            }
            read_by_all(&run, &good, &out);
            Ok(())
        })
        .expect("no panic");
}

const PAIR: &str = "--material ps --samples 32 --noise robust -q --out good";

#[test]
#[ignore = "long: run by .ci/run"]
fn a_record_with_a_shorter_list_is_refused_by_the_name_of_the_list() {
    let sandbox = Sandbox::new();
    sandbox.run(PAIR).succeeded();
    let record = sandbox.posterior("good");
    assert!(record["log_evidence"]["process_value"].is_number(), "a process has a part in it");
    let parse = |record: &Value| workbench::record::parse("x", &(record.to_string() + "\n"));
    assert!(parse(&record).is_ok());
    for (list, field) in [
        ("/map/theta", "map"),
        ("/parameters", "parameters"),
        ("/correlation/1", "correlation"),
        ("/path/0/parameters", "path"),
        ("/experiments", "experiments"),
        ("/experiments/0/observables/0/map", "observables"),
        ("/experiments/0/neck_growth/curves/curve90/1", "curves"),
    ] {
        let mut record = record.clone();
        record.pointer_mut(list).and_then(Value::as_array_mut).expect(list).pop();
        let error = parse(&record).expect_err(list);
        assert!(error.field.as_deref().is_some_and(|it| it.ends_with(field)), "{error}");
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_few_changed_records_are_read_or_refused_without_a_panic() {
    hostile(12, PAIR);
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn three_hundred_changed_records_are_read_or_refused_without_a_panic() {
    hostile(300, PAIR);
}
