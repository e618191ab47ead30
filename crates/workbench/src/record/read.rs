//! Reading a `posterior.json`.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{Record, lengths};
use crate::error::{InputError, Mistake};
use crate::input::text_file::folder_of;
use crate::output::{checksums, kinds};
use crate::plan::Plan;

/// Version of the layout of `posterior.json`; a reader refuses others.
pub const SCHEMA_VERSION: u32 = 2;

/// Name of the file in a run's folder.
pub const FILE_NAME: &str = crate::output::kinds::CALIBRATION;

/// The file that a path means: itself, or the one in the folder that it names.
pub fn locate(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(FILE_NAME) } else { path.to_owned() }
}

/// Reads a finished calibration that has an evidence: no population, and not with tuned noise.
///
/// # Errors
///
/// As [`read`], and for a run that is none.
pub fn read_calibration(path: &Path) -> Result<Record, InputError> {
    let record = read(path)?;
    let refused =
        |found: &str| InputError::new(path.display().to_string(), Mistake::Conflict).found(found);
    if record.population.is_some() {
        return Err(refused("a population")
            .expected("a calibration")
            .help("name the runs that it was made of, and the new ones"));
    }
    if !record.is_posterior {
        return Err(refused("a run with tuned noise, which is no posterior")
            .expected("a posterior with its evidence")
            .help("calibrate it with --noise inferred or correlated"));
    }
    Ok(record)
}

/// Reads a `posterior.json`, or the one in a folder.
///
/// # Errors
///
/// [`InputError`] that names file, line and remedy for a file that is missing, cut off, not a posterior, or of another
/// version, and for a run that has no posterior yet.
pub fn read(path: &Path) -> Result<Record, InputError> {
    let file = locate(path);
    if path.is_dir() && !file.is_file() {
        let name = path.display();
        if path.join("report").join(FILE_NAME).is_file() {
            return Err(InputError::new(name.to_string(), Mistake::OutOfRange)
                .found("the run of a plan in the layout of an older version, with its results in report/")
                .help("run the plan again with this version: calibrate --plan FILE --out ANOTHER"));
        }
        if path.join(crate::output::CAMPAIGN).is_dir() {
            return Err(InputError::new(name.to_string(), Mistake::MissingFile)
                .found("a run that has no posterior yet")
                .help(format_args!("how far it is: calibrate status {name}"))
                .help(format_args!("to go on with it: calibrate --resume {name}")));
        }
    }
    if let Some((record, kind)) = kinds::of(path).filter(|(record, _)| *record != FILE_NAME) {
        let folder = if path.is_dir() { path } else { folder_of(path) };
        let report = folder.join("report.html");
        return Err(InputError::new(path.display().to_string(), Mistake::Conflict)
            .found(format_args!("a {kind} ({record})"))
            .expected("a calibration: a posterior.json, or the folder it is in")
            .help_if(report.is_file().then(|| {
                format!("{} is its report, with the command that makes it again", report.display())
            })));
    }
    checksums::read_as(&file, parse)
}

/// As [`read`], from text; `name` is what errors call it.
pub fn parse(name: &str, text: &str) -> Result<Record, InputError> {
    #[derive(Deserialize)]
    struct Version {
        schema_version: u32,
    }
    if text.trim().is_empty() {
        return Err(InputError::new(name, Mistake::Empty)
            .found("an empty file")
            .expected("a posterior.json")
            .help("run the calibration again: calibrate --material ps"));
    }
    let version: Version =
        serde_json::from_str(text).map_err(|error| bad_json(name, text, &error))?;
    if version.schema_version != SCHEMA_VERSION {
        return Err(InputError::new(name, Mistake::OutOfRange)
            .in_field("schema_version")
            .found(version.schema_version)
            .expected(SCHEMA_VERSION)
            .help("it was written by another version of calibrate; run the calibration again")
            .help("a material takes less than a second; the runs of a plan are kept and resumed by the version that made them"));
    }
    let record: Record =
        serde_json::from_str(text).map_err(|error| bad_json(name, text, &error))?;
    if !record.plan.has_plain_name() {
        return Err(InputError::new(name, Mistake::Damaged)
            .in_field("plan.name")
            .found(format_args!("{:?}", record.plan.name))
            .expected("the name of a folder, without control characters")
            .help("it was not written by this program; ask whoever sent it"));
    }
    match record.plan.odd_name() {
        None => lengths::check(name, &record).map(|()| record),
        // Names go into those of files.
        Some(odd) => Err(InputError::new(name, Mistake::Damaged)
            .in_field("plan")
            .found(format_args!("the name \"{odd}\""))
            .expected("a letter, then letters, digits, _ and -, at most 64")
            .help("it was not written by this program; ask whoever sent it")),
    }
}

fn cut_off(base: InputError) -> InputError {
    base.found("the end of the file")
        .expected("the rest of a posterior.json")
        .help("the file is cut off; run the calibration again or copy the file again")
}

fn bad_json(name: &str, text: &str, error: &serde_json::Error) -> InputError {
    let base = InputError::new(name, Mistake::Syntax).at_line(error.line().max(1));
    // A file that is cut off can end in the middle of a number or a name.
    let at_its_end = !text.ends_with('\n') && error.line() >= text.lines().count();
    match error.classify() {
        serde_json::error::Category::Eof => cut_off(base),
        serde_json::error::Category::Syntax if at_its_end => cut_off(base),
        serde_json::error::Category::Syntax => base
            .found(format_args!("something that is not JSON ({error})"))
            .expected("a posterior.json")
            .help("run the calibration again, or copy the file again"),
        _ => base
            .found(format_args!("JSON that is no posterior ({error})"))
            .expected("a posterior.json written by this program")
            .help("name the posterior.json of a run, or its folder"),
    }
}

/// Whether the result is that of the plan: an extended run has that of fewer runs until it is done.
pub(crate) fn is_reported(dir: &Path, plan: &Plan) -> bool {
    let there = dir.join(FILE_NAME).is_file();
    let of_plan = || read(dir).is_ok_and(|record| record.plan.sampler == plan.sampler);
    there && (plan.sampler.earlier.is_empty() || of_plan())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The committed schema is what the types say; `UPDATE_SCHEMA=1 cargo test -p workbench schema` writes it anew.
    #[test]
    fn the_committed_schema_is_that_of_the_types() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("schema").join("posterior.schema.json");
        let schema = schemars::schema_for!(Record);
        let mut text = serde_json::to_string_pretty(&schema).expect("a schema is JSON");
        text.push('\n');
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::create_dir_all(path.parent().expect("has a parent")).expect("a folder");
            std::fs::write(&path, &text).expect("the schema");
        }
        let committed = std::fs::read_to_string(&path).expect("the committed schema");
        assert!(committed == text, "run UPDATE_SCHEMA=1 cargo test -p workbench schema");
    }
}
