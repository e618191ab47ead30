//! `calibrate archive` and `calibrate reproduce`: a run as one file, and the same run from it.

use std::fs;

use serde_json::Value;

use crate::sandbox::{Sandbox, root};

fn own_run(sandbox: &Sandbox) {
    sandbox.write("my.csv", "time_s,contact_ratio\n0.05,0.6\n0.1,0.8\n0.2,1.0\n0.5,1.05\n");
    let run = "--material ps --experiment my.csv --samples 8192 --seed 3 --out run -q";
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
    let found = sandbox.run("reproduce run.zip --threads 1 --json --out new").json();
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
#[ignore = "long: run by .ci/run"]
fn programs_of_an_archive_are_run_after_a_yes_and_give_the_same_bits() {
    let sandbox = Sandbox::new();
    few_impacts(&sandbox, "plans", |plan| plan);
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
    sandbox.run("--material ps --samples 8192 --no-other-kinetics --out run -q").succeeded();
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

/// The example of a program in a folder, with few runs.
fn few_impacts(sandbox: &Sandbox, folder: &str, change: impl Fn(String) -> String) {
    for name in ["impact.sh", "impact-force.txt", "impact-rebound.csv"] {
        let from = root().join("experiments/external").join(name);
        sandbox.write(&format!("{folder}/{name}"), fs::read(from).expect(name));
    }
    let plan = fs::read_to_string(root().join("experiments/external/impact.toml")).expect("a plan");
    let plan = change(plan.replace("samples = 300", "samples = 40"));
    sandbox.write(&format!("{folder}/impact.toml"), plan);
}

#[test]
fn what_is_packed_opens_whatever_lies_in_the_folder_of_the_run() {
    let sandbox = Sandbox::new();
    own_run(&sandbox);
    for name in ["a:b.txt", "Notes.md", "notes.md", "Posterior.json", "end.", "tab\there", "r\\s"] {
        sandbox.write(&format!("run/{name}"), "mine");
    }
    sandbox.write("run/zeros.bin", vec![0; 3 << 20]);
    // Once more, with the archive itself in the folder.
    let mut bytes = Vec::new();
    for _ in 0..2 {
        let ran = sandbox.run("archive run run/out.zip");
        for words in
            ["a:b.txt is not in it", "notes.md is not in it", "Posterior.json is not", "a colon"]
        {
            assert!(ran.succeeded().stderr.contains(words), "{words}: {}", ran.stderr);
        }
        assert!(!ran.stderr.contains('\t') && ran.stderr.contains("tab\\there"), "{}", ran.stderr);
        bytes.push(fs::read(sandbox.path().join("run/out.zip")).expect("an archive"));
    }
    assert!(bytes[0] == bytes[1], "the archive is no part of itself");
    let ran = sandbox.run("reproduce run/out.zip");
    assert!(ran.succeeded().stdout.contains("same bits"), "{ran:#?}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_plan_with_files_above_its_folder_is_reproduced_kept_extended_and_packed_again() {
    let sandbox = Sandbox::new();
    few_impacts(&sandbox, "study/plans/deep", |plan| {
        plan.replace("{plan_dir}/impact.sh", "{plan_dir}/../../common/impact.sh")
            .replace("\"impact-force.txt\"", "\"../data/impact-force.txt\"")
    });
    for (from, to) in [("impact.sh", "common"), ("impact-force.txt", "plans/data")] {
        let folder = sandbox.path().join("study").join(to);
        fs::create_dir_all(&folder).expect("a folder");
        let from_path = sandbox.path().join("study/plans/deep").join(from);
        fs::rename(from_path, folder.join(from)).expect("moved");
    }
    sandbox.run("--plan study/plans/deep/impact.toml --out run -q").succeeded();
    sandbox.run("archive run run.zip").succeeded();
    for gone in ["study", "run"] {
        let path = sandbox.path().join(gone);
        fs::rename(path, sandbox.path().join(format!("{gone}-away"))).expect("moved");
    }
    let ran = sandbox.run("reproduce run.zip --yes --out kept");
    assert!(ran.succeeded().stdout.contains("same bits"), "{ran:#?}");
    assert_eq!(sandbox.posterior_bytes("kept"), sandbox.posterior_bytes("run-away"));
    sandbox.run("archive kept kept.zip").succeeded();
    sandbox.run("--resume kept --samples 60 -q").succeeded();
    sandbox.run("archive kept more.zip").succeeded();
    fs::rename(sandbox.path().join("kept"), sandbox.path().join("kept-away")).expect("moved");
    for archive in ["kept.zip", "more.zip"] {
        let ran = sandbox.run(&format!("reproduce {archive} --yes"));
        assert!(ran.succeeded().stdout.contains("same bits"), "{ran:#?}");
    }
    sandbox.run("reproduce run.zip --yes --out study-away").refused(&["holds something already"]);
}

#[test]
fn a_plan_that_names_a_file_of_this_machine_alone_is_not_packed() {
    let sandbox = Sandbox::new();
    let whole = sandbox.path().canonicalize().expect("a folder").join("tools/impact.sh");
    few_impacts(&sandbox, "tools", |plan| {
        plan.replace("{plan_dir}/impact.sh", &whole.display().to_string())
    });
    sandbox.run("--plan tools/impact.toml --out run -q").succeeded();
    let ran = sandbox.run("archive run run.zip");
    ran.refused(&["tools/impact.sh, which is on this machine alone", "{plan_dir}/run.sh"]);
    assert!(!sandbox.path().join("run.zip").exists());
}

#[test]
fn a_reproduction_that_fails_stays_where_its_remedies_name_it() {
    let sandbox = Sandbox::new();
    few_impacts(&sandbox, "plans", |plan| plan);
    let flag = sandbox.path().join("licence");
    sandbox.write("licence", "");
    let script = fs::read_to_string(sandbox.path().join("plans/impact.sh")).expect("a script");
    let asks = format!("set -eu\n[ -e '{}' ] || exit 7", flag.display());
    sandbox.write("plans/impact.sh", script.replace("set -eu", &asks));
    sandbox.run("--plan plans/impact.toml --out run -q").succeeded();
    sandbox.run("archive run run.zip").succeeded();
    fs::remove_file(&flag).expect("removed");
    let ran = sandbox.run("reproduce run.zip --yes");
    assert_eq!(ran.code, 1, "{ran:#?}");
    let (_, rest) = ran.stderr.split_once("the run and its files are in ").expect("a place");
    let (folder, _) = rest.split_once(": remove it").expect("its end");
    sandbox.run_args(&["status", &format!("{folder}/again")]).succeeded();
    let files = fs::read_dir(format!("{folder}/inputs")).expect("its files").count();
    fs::remove_dir_all(folder).expect("removed");
    assert_eq!(files, 4, "{ran:#?}");
}

#[test]
fn a_result_that_differs_is_said_and_ends_with_exit_1() {
    let sandbox = Sandbox::new();
    own_run(&sandbox);
    let mut record = sandbox.posterior("run");
    let found = &mut record["parameters"][0]["in_coordinate"];
    let moved = found["mean"].as_f64().expect("a mean") + found["sd"].as_f64().expect("an sd");
    found["mean"] = moved.into();
    sandbox.write("run/posterior.json", record.to_string() + "\n");
    fs::remove_file(sandbox.path().join("run/SHA256SUMS")).expect("removed");
    sandbox.run("archive run run.zip").succeeded();
    let ran = sandbox.run("reproduce run.zip");
    assert_eq!(ran.code, 1, "{ran:#?}");
    assert!(ran.stdout.contains("DIFFERENT, by more than Monte Carlo error"), "{ran:#?}");
    assert!(ran.stderr.contains("the results are not reproduced"), "{ran:#?}");
}
