use proptest::prelude::*;

use super::*;
use crate::calibration::{RunOptions, run};
use crate::input::material::Material;
use crate::plan::PairOptions;
use crate::watch::Unwatched;

/// A run in a folder, of which the record alone is left.
fn record_alone(folder: &Path) -> PathBuf {
    let options = PairOptions { material: Some(Material::Ps), samples: 64, ..Default::default() };
    let out = folder.join("run");
    let options_of_run = RunOptions {
        out: Some(out.clone()),
        without_other_kinetics: true,
        ..RunOptions::default()
    };
    run(&options.plan().expect("a plan"), &options_of_run, &Unwatched::default()).expect("runs");
    for entry in fs::read_dir(&out).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.file_name() != Some(record::FILE_NAME.as_ref()) {
            fs::remove_file(path).expect("removed");
        }
    }
    out
}

/// Writes files of these names below a folder, as far as it can have them.
fn written(folder: &Path, names: &[String]) -> Vec<String> {
    let write = |name: &&String| {
        let parts: Vec<_> = Path::new(name).components().collect();
        let below = parts.iter().all(|part| matches!(part, std::path::Component::Normal(_)));
        let path = folder.join(name);
        let parent = path.parent().unwrap_or(folder);
        below
            && !parts.is_empty()
            && fs::create_dir_all(parent).is_ok()
            && fs::write(&path, name.as_str()).is_ok()
    };
    names.iter().filter(write).cloned().collect()
}

#[test]
#[ignore = "long: run by .ci/run"]
fn whatever_files_are_called_the_archive_opens_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = record_alone(folder.path());
    let before = fs::read(run.join(record::FILE_NAME)).expect("read");
    let odd = || "[a-bA-B:. \\\\\n\u{1b}äÄ]{1,4}";
    let name = prop_oneof![odd(), "[A-Ba-b./]{1,9}", Just("posterior.JSON".to_owned())];
    let names = || prop::collection::vec(name.clone(), 0..12);
    let config = ProptestConfig { cases: 24, failure_persistence: None, ..Default::default() };
    let mut runner = proptest::test_runner::TestRunner::new(config);
    runner
        .run(&(names(), names()), |(results, inputs)| {
            fs::remove_dir_all(&run).expect("removed");
            fs::create_dir(&run).expect("made");
            let flat: Vec<String> = results.iter().map(|name| name.replace('/', "_")).collect();
            written(&run, &flat);
            fs::write(run.join(record::FILE_NAME), &before).expect("written");
            let place = tempfile::tempdir().expect("a temporary folder");
            let own = place.path().display().to_string();
            let files = written(place.path(), &inputs).into_iter().map(|name| {
                let name = format!("{own}/{name}");
                let (bytes, sha256) =
                    crate::output::inputs::sum_of(Path::new(&name)).expect("a sum");
                InputFile { role: "measurements".to_owned(), name, bytes, sha256 }
            });
            let inputs = Inputs { files: files.collect() };
            fs::write(run.join(FILE_NAME), pretty(&inputs).expect("JSON")).expect("written");
            let out = place.path().join("run.zip");
            let packed = pack(&run, &out).expect("packed");
            // What is written is what opens; all else is noted.
            let into = place.path().join("into");
            fs::create_dir(&into).expect("made");
            let unpacked = unpack(&out, &into, &Limits::default()).expect("opens");
            prop_assert_eq!(unpacked.sums.len(), packed.files);
            prop_assert!(packed.notes.iter().all(|note| !note.contains(char::is_control)));
            let again = fs::read(into.join(RESULTS).join(record::FILE_NAME)).expect("there");
            prop_assert_eq!(&again, &before);
            Ok(())
        })
        .expect("opens");
}
