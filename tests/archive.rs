//! `calibrate archive` and `calibrate reproduce`: a run as one file, and the same run from it.

use std::fs;

use serde_json::Value;

use crate::sandbox::{Sandbox, root};

fn own_run(sandbox: &Sandbox) {
    sandbox.write("my.csv", "time_s,contact_ratio\n0.05,0.6\n0.1,0.8\n0.2,1.0\n0.5,1.05\n");
    let run = "--material ps --experiment my.csv --samples 2048 --seed 3 --out run -q";
    sandbox.run(run).succeeded();
}

/// The rules of RO-Crate 1.1 on the metadata document, the root data entity and data entities.
fn is_ro_crate(text: &str) {
    let crate_: Value = serde_json::from_str(text).expect("JSON");
    assert_eq!(crate_["@context"], "https://w3id.org/ro/crate/1.1/context");
    let graph = crate_["@graph"].as_array().expect("a graph");
    let entity = |id: &Value| graph.iter().find(|one| one["@id"] == *id);
    let ids: std::collections::BTreeSet<&str> =
        graph.iter().map(|one| one["@id"].as_str().expect("each has an @id")).collect();
    assert_eq!(ids.len(), graph.len(), "each entity is there once");
    let descriptor = entity(&"ro-crate-metadata.json".into()).expect("the descriptor");
    assert_eq!(descriptor["@type"], "CreativeWork");
    assert_eq!(descriptor["conformsTo"]["@id"], "https://w3id.org/ro/crate/1.1");
    assert_eq!(descriptor["about"]["@id"], "./");
    let root = entity(&"./".into()).expect("the root");
    assert_eq!(root["@type"], "Dataset");
    for field in ["name", "description", "datePublished"] {
        assert!(root[field].as_str().is_some_and(|text| !text.is_empty()), "{field}");
    }
    let day = root["datePublished"].as_str().expect("a day").as_bytes();
    assert!(day.len() == 10 && day[4] == b'-' && day[7] == b'-', "ISO 8601 to the day at least");
    let parts = root["hasPart"].as_array().expect("parts");
    assert!(parts.len() > 10);
    for part in parts {
        let file = entity(&part["@id"]).expect("each part is described");
        assert_eq!(file["@type"], "File");
        let id = file["@id"].as_str().expect("a name");
        assert!(!id.starts_with('/') && !id.contains([' ', '\\']), "a relative address: {id}");
        assert!(file["contentSize"].is_string() && file["encodingFormat"].is_string(), "{id}");
    }
    // All links within the crate lead somewhere.
    for one in graph {
        for value in one.as_object().expect("an object").values() {
            let linked = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
            for link in linked.iter().filter_map(|link| link["@id"].as_str()) {
                let outside = link.starts_with("https://");
                assert!(outside || ids.contains(link), "{link}");
            }
        }
    }
}

#[test]
fn an_archive_is_a_crate_that_reproduces_to_the_bit_where_its_own_folder_is_gone() {
    let sandbox = Sandbox::new();
    own_run(&sandbox);
    let ran = sandbox.run("archive run run.zip");
    assert!(ran.succeeded().stdout.starts_with("run.zip: 2"), "{}", ran.stdout);
    sandbox.run("archive run/posterior.json again.zip -q").succeeded();
    let read = |name: &str| fs::read(sandbox.path().join(name)).expect(name);
    assert!(read("run.zip") == read("again.zip"), "the same folder gives the same bytes");
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(read("run.zip"))).expect("a zip");
    let mut text = String::new();
    let description = zip.by_name("ro-crate-metadata.json").expect("a description");
    std::io::Read::read_to_string(&mut { description }, &mut text).expect("text");
    is_ro_crate(&text);
    let names: Vec<String> =
        zip.file_names().map(|name| name.expect("a name").into_owned()).collect();
    for name in ["inputs/my.csv", "results/posterior.json", "results/report.html"] {
        assert!(names.iter().any(|one| one == name), "{name}: {names:?}");
    }
    for gone in ["run", "my.csv"] {
        let path = sandbox.path().join(gone);
        fs::rename(path, sandbox.path().join(format!("{gone}-away"))).expect("moved");
    }
    let ran = sandbox.run("reproduce run.zip --threads 1 --json --out new");
    let found: Value = serde_json::from_str(&ran.succeeded().stdout).expect("JSON");
    assert_eq!(found["likeness"], "same-bits");
    assert!(sandbox.path().join("new/report.html").is_file());
}

#[test]
fn an_input_that_has_changed_is_left_out_and_said() {
    let sandbox = Sandbox::new();
    own_run(&sandbox);
    sandbox.write("my.csv", "time_s,contact_ratio\n0.05,0.7\n");
    let ran = sandbox.run("archive run run.zip");
    assert!(ran.succeeded().stderr.contains("note: my.csv"), "{}", ran.stderr);
    assert!(ran.stderr.contains("has changed since"), "{}", ran.stderr);
    let ran = sandbox.run("reproduce run.zip");
    assert_eq!(
        ran.succeeded().stdout,
        "my (by the same version, 0.2.0): same bits\n".replace("0.2.0", env!("CARGO_PKG_VERSION"))
    );
}

#[test]
fn programs_of_an_archive_are_run_after_a_yes_and_give_the_same_bits() {
    let sandbox = Sandbox::new();
    fs::create_dir(sandbox.path().join("plans")).expect("a folder");
    for name in ["impact.sh", "impact-force.txt", "impact-rebound.csv"] {
        let from = root().join("experiments/external").join(name);
        fs::copy(from, sandbox.path().join("plans").join(name)).expect(name);
    }
    let plan = fs::read_to_string(root().join("experiments/external/impact.toml")).expect("a plan");
    let few = plan.replace("samples = 300", "samples = 40");
    assert_ne!(plan, few, "the example has another number of samples");
    sandbox.write("plans/impact.toml", few);
    sandbox.run("--plan plans/impact.toml --out run -q").succeeded();
    sandbox.run("archive run run.zip").succeeded();
    let before = sandbox.snapshot();
    sandbox.run("reproduce run.zip").refused(&[
        "run.zip",
        "an archive that runs programs: sh ",
        "impact.sh",
        "--yes",
    ]);
    assert!(sandbox.snapshot() == before, "nothing was written");
    let away = sandbox.path().join("away");
    fs::rename(sandbox.path().join("plans"), &away).expect("moved");
    let ran = sandbox.run("reproduce run.zip --yes");
    assert!(ran.succeeded().stdout.contains("same bits"), "{ran:#?}");
    // Without its program nothing is packed.
    sandbox.run("archive run other.zip").refused(&[
        "impact",
        "is not there any more",
        "put the former",
    ]);
}

#[test]
fn what_is_no_archive_or_no_run_is_refused_with_a_remedy() {
    let sandbox = Sandbox::new();
    own_run(&sandbox);
    sandbox.run("archive run run.zip").succeeded();
    sandbox.run("archive nothing x.zip").refused(&["nothing", "no such file"]);
    sandbox.run("archive run run").refused(&["a folder", "expected a file"]);
    sandbox.run("reproduce none.zip").refused(&["none.zip", "no such file"]);
    sandbox.run("reproduce run").refused(&["a folder", "calibrate archive run run.zip"]);
    sandbox.run("reproduce my.csv").refused(&["my.csv", "a damaged archive, or no archive"]);
    let bytes = fs::read(sandbox.path().join("run.zip")).expect("read");
    sandbox.write("cut.zip", &bytes[..bytes.len() / 2]);
    sandbox.run("reproduce cut.zip").refused(&["cut.zip", "copy it again"]);
}

/// A record can say anything; its names go into those of files.
#[test]
fn names_of_a_record_that_lead_elsewhere_are_refused() {
    let sandbox = Sandbox::new();
    sandbox.run("--material ps --samples 64 --out run -q").succeeded();
    let record = sandbox.path().join("run/posterior.json");
    let text = fs::read_to_string(&record).expect("read");
    let odd = text.replace("\"name\": \"ps-r30\"", "\"name\": \"../../ps\"");
    assert_ne!(text, odd);
    fs::write(&record, odd).expect("written");
    fs::remove_file(sandbox.path().join("run/SHA256SUMS")).expect("removed");
    sandbox
        .run("archive run x.zip")
        .refused(&["the name \"../../ps\"", "not written by this program"]);
    let much = text.replace("\"draws\": 4096", "\"draws\": 4096000000");
    assert_ne!(text, much);
    fs::write(&record, much).expect("written");
    sandbox.run("archive run x.zip").succeeded();
    sandbox.run("reproduce x.zip").refused(&["x.zip, field plan.sampler.draws", "4096000000"]);
}
