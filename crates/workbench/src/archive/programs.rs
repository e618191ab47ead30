//! The programs of an archived run: whether they are those of the run, and where they are for another one.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::names::Places;
use super::unpack::{Unpacked, hostile};
use crate::calibration::{RunOptions, again};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file;
use crate::output::inputs::{InputFile, Inputs, sum_of};
use crate::output::{INPUTS, on_one_line};
use crate::plan::{PLAN, PROGRAM, Planned};
use crate::record::Record;

/// Holds the programs and files of runs against the sums that the run noted. Those that are packed must be the same; those of
/// this machine that are others are given, in words.
pub(super) fn compare(
    place: &str,
    inputs: &Inputs,
    unpacked: &Unpacked,
) -> Result<Vec<String>, InputError> {
    let places = Places::of(inputs);
    let mut others = Vec::new();
    for InputFile { role, name, sha256, .. } in &inputs.files {
        let shown = on_one_line(name);
        if role != PROGRAM {
            continue;
        }
        if Path::new(name).is_absolute() {
            match sum_of(Path::new(name)) {
                Ok((_, sum)) if sum == *sha256 => {}
                Ok(_) => others.push(format!("{shown} is not the one of the archived run")),
                Err(_) => others.push(format!("{shown} is not there")),
            }
            continue;
        }
        let packed = places
            .place(name)
            .map_err(|what| hostile(place, &format!("{what}: \"{shown}\"")))
            .map(|packed| unpacked.sums.get(&format!("{INPUTS}/{packed}")))?;
        match packed {
            Some(sum) if sum == sha256 => {}
            Some(_) => {
                let what = format!("\"{shown}\", which is not what the run was made with");
                return Err(hostile(place, &what));
            }
            None => {
                let what = format!("a run that was made with \"{shown}\", which is not in it");
                return Err(hostile(place, &what));
            }
        }
    }
    Ok(others)
}

/// The plan of an archived run with its files in their places, and the folder of the results. Where results are kept, the files
/// are put beside them, so that the run can be resumed and archived.
pub(super) fn plan(
    place: &str,
    archived: &Record,
    mut inputs: Inputs,
    (folder, options): (&Path, &RunOptions),
) -> Result<(Planned, PathBuf), Failure> {
    let places = Places::of(&inputs);
    let mut files = folder.join(INPUTS);
    let out = match &options.out {
        None => folder.join("again"),
        Some(out) => {
            files = move_to(&files, out)?;
            out.clone()
        }
    };
    let below = files.join(places.of_plan());
    let mut plan = None;
    for file in &mut inputs.files {
        let own = places.place(&file.name).map(|own| files.join(own));
        let is_there = own.as_ref().is_ok_and(|own| own.is_file());
        if file.role == PLAN && !is_there {
            let what = format!("a plan that is not in it: \"{}\"", on_one_line(&file.name));
            return Err(hostile(place, &what).into());
        }
        if file.role == PLAN {
            plan = own.ok();
        } else if file.role != PROGRAM && is_there {
            let name = places.name_in_place(&file.name);
            file.name = name.unwrap_or_else(|_| file.name.clone());
        }
    }
    let text = plan.as_deref().map_or(Ok(String::new()), text_file::read)?;
    let plan = plan.unwrap_or_else(|| below.join("plan.toml"));
    let planned = again(archived, Some(plan), text);
    Ok((Planned { inputs: Some(inputs), ..planned }, out))
}

/// Moves the files of an archive into a folder of results that holds nothing yet.
fn move_to(files: &Path, out: &Path) -> Result<PathBuf, Failure> {
    if fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some()) {
        return Err(InputError::new(out.display().to_string(), Mistake::NotOurs)
            .found("a folder that holds something already")
            .expected("a new folder for the run and its files")
            .help("choose another folder with --out, or move this one away")
            .into());
    }
    let unwritten = |error| {
        RunError::new(format_args!("{}: cannot be written: {error}", out.display()))
            .help("choose another folder with --out")
    };
    fs::create_dir_all(out).map_err(unwritten)?;
    let moved = std::path::absolute(out.join(INPUTS)).map_err(unwritten)?;
    if files.is_dir() {
        fs::rename(files, &moved).map_err(unwritten)?;
    }
    Ok(moved)
}

/// A failure of the run, whose words name files in a temporary folder: it stays.
pub(super) fn kept(failure: Failure, folder: TempDir) -> Failure {
    let used = fs::read_dir(folder.path().join("again")).is_ok();
    if !used {
        return failure;
    }
    let words =
        format!("the run and its files are in {}: remove it when done", folder.keep().display());
    match failure {
        Failure::Run(error) => error.help(words).into(),
        Failure::Input(error) => error.help(words).into(),
        Failure::Paused(text) => Failure::Paused(format!("{text}\n  {words}")),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    fn file(role: &str, name: &str, sha256: &str) -> InputFile {
        InputFile { role: role.into(), name: name.into(), bytes: 0, sha256: sha256.into() }
    }

    #[test]
    fn a_plan_of_an_archive_lies_in_it_or_is_refused() {
        let ps =
            PairOptions { material: Some(Material::Ps), samples: 64, ..PairOptions::default() };
        let planned = ps.plan().expect("a plan");
        let record = Calibration::run(&planned, &Unwatched::default()).expect("runs").record;
        let folder = tempfile::tempdir().expect("a folder");
        let inputs = folder.path().join(INPUTS);
        fs::create_dir(&inputs).expect("a folder");
        fs::write(folder.path().join("outside.toml"), "").expect("written");
        fs::write(inputs.join("inside.toml"), "text").expect("written");
        let named = |name: &str| {
            let inputs = Inputs { files: vec![file(PLAN, name, "")] };
            plan("a.zip", &record, inputs, (folder.path(), &RunOptions::default()))
        };
        let outside = folder.path().join("outside.toml").display().to_string();
        for name in ["../outside.toml", &outside, "/proc/self/mem", "not-there.toml", "a/../../x"] {
            assert!(named(name).is_err(), "{name}");
        }
        let (planned, out) = named("inside.toml").expect("a plan");
        assert_eq!(
            (planned.path, out),
            (Some(inputs.join("inside.toml")), folder.path().join("again"))
        );
        assert_eq!(planned.text, "text");
    }

    #[test]
    fn programs_that_are_others_are_refused_or_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let program = folder.path().join("solver");
        fs::write(&program, "one").expect("written");
        let (_, sum) = sum_of(&program).expect("a sum");
        let name = program.display().to_string();
        let unpacked = Unpacked { sums: [("inputs/run.sh".to_owned(), "1".to_owned())].into() };
        let found = |files: Vec<InputFile>| compare("a.zip", &Inputs { files }, &unpacked);
        let same = vec![file(PROGRAM, "run.sh", "1"), file(PROGRAM, &name, &sum)];
        assert_eq!(found(same.clone()), Ok(Vec::new()));
        fs::write(&program, "two").expect("written");
        let others = found(same.clone()).expect("found");
        assert!(others[0].ends_with("solver is not the one of the archived run"), "{others:?}");
        fs::remove_file(&program).expect("removed");
        assert!(found(same).expect("found")[0].ends_with("solver is not there"));
        let error = found(vec![file(PROGRAM, "run.sh", "2")]).expect_err("another").to_string();
        assert!(error.contains("which is not what the run was made with"), "{error}");
        let error = found(vec![file(PROGRAM, "gone.sh", "1")]).expect_err("gone").to_string();
        assert!(error.contains("\"gone.sh\", which is not in it"), "{error}");
    }
}
