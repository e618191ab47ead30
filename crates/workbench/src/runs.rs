//! What results there are in a folder: an entry for each, and which of them were superseded.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::Serialize;
use serde_json::Value;

use crate::calibration::read_stored;
use crate::error::{InputError, Mistake};
use crate::input::text_file;
use crate::output::date::{ago, iso_day, written};
use crate::output::{CAMPAIGN, kinds, on_one_line};
use crate::plan::{Plan, shell_word};
use crate::record::{self, FILE_NAME};
use crate::report::aligned;

/// Largest record that is read \[bytes\].
const LARGEST: u64 = 256 << 20;

/// A result, or a folder that has none.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Listed {
    /// Name of its folder.
    pub name: String,
    /// The folder.
    #[serde(skip)]
    pub path: PathBuf,
    /// Kind of the run; empty for a folder that is none.
    pub kind: String,
    /// The material, or the name of the plan or scene.
    pub what: String,
    /// Its data.
    pub data: String,
    /// How far it is to be trusted.
    pub trust: String,
    /// The day that it was written on, in UTC.
    pub written: Option<String>,
    /// How long ago that was \[s\].
    pub age_s: Option<u64>,
    /// Size of the folder \[bytes\].
    pub bytes: u64,
    /// Whether a newer run has its name: it was moved aside.
    pub superseded: bool,
    /// Why it cannot be read, or is no run.
    pub problem: Option<String>,
}

/// The results in a folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Listing {
    /// The folder.
    pub dir: PathBuf,
    /// The folders in it, by name.
    pub runs: Vec<Listed>,
    /// The command that removes the superseded runs; none where there are none.
    pub remove: Option<String>,
}

/// Lists the results in the folders of a folder; of a folder that is a run itself, that one.
///
/// # Errors
///
/// [`InputError`] for a folder that is not there or cannot be read. What is wrong with a single run is told in its entry.
pub fn list(dir: &Path, now: SystemTime) -> Result<Listing, InputError> {
    let place = dir.display().to_string();
    let refused = |error: io::Error| {
        match error.kind() {
        io::ErrorKind::NotFound => InputError::new(&place, Mistake::MissingFile)
            .found("no such folder")
            .expected("a folder with results")
            .help("results are written to results/ unless --out says another: calibrate --material ps"),
        _ => InputError::new(&place, Mistake::Unreadable)
            .found(format_args!("cannot be read as a folder: {error}")),
    }
    };
    let mut folders = Vec::new();
    for entry in fs::read_dir(dir).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.starts_with('.') && entry.path().is_dir() {
            folders.push((name, entry.path()));
        }
    }
    if is_run(dir) {
        let whole = std::path::absolute(dir).unwrap_or_else(|_| dir.to_owned());
        let name = whole.file_name().map_or_else(String::new, |name| name.to_string_lossy().into());
        folders = vec![(name, dir.to_owned())];
    }
    folders.sort_by(|a, b| by_number(&a.0).cmp(&by_number(&b.0)));
    let mut runs: Vec<Listed> =
        folders.iter().map(|(name, path)| listed(name, path, now)).collect();
    let superseded: Vec<bool> = runs.iter().map(|run| is_superseded(run, &runs)).collect();
    runs.iter_mut().zip(superseded).for_each(|(run, superseded)| run.superseded = superseded);
    let old = runs.iter().filter(|run| run.superseded);
    let old: Vec<String> = old.map(|run| shell_word(&run.path.display().to_string())).collect();
    let remove = (!old.is_empty()).then(|| format!("rm -r -- {}", old.join(" ")));
    Ok(Listing { dir: dir.to_owned(), runs, remove })
}

/// Whether a run was moved aside for one that is whole, of the same kind and the same material or plan. Runs are moved aside with
/// numbers from 1 on: a name that ends in a number by chance (`v1.5`) has none of the others before it.
fn is_superseded(run: &Listed, runs: &[Listed]) -> bool {
    let (newer, number) = by_number(&run.name);
    let there = |name: &str| runs.iter().any(|other| other.name == name);
    let whole = |other: &Listed| {
        other.name == newer
            && other.problem.is_none()
            && other.kind == run.kind
            && other.what == run.what
            && !other.trust.contains("unfinished")
    };
    let series = (1..number).all(|before| there(&format!("{newer}.{before}")));
    number > 0
        && !run.kind.is_empty()
        && run.name == format!("{newer}.{number}")
        && !run.name.contains(|c: char| c.is_control() || c == char::REPLACEMENT_CHARACTER)
        && series
        && runs.iter().any(whole)
}

/// A name and the number that a run which was moved aside has behind it, `ps.2`; 0 without one.
fn by_number(name: &str) -> (&str, u64) {
    match name.rsplit_once('.').map(|(start, number)| (start, number.parse::<u64>())) {
        Some((start, Ok(number @ 1..))) if !start.is_empty() => (start, number),
        _ => (name, 0),
    }
}

fn is_run(folder: &Path) -> bool {
    folder.join(CAMPAIGN).is_dir() || kinds::of(folder).is_some()
}

fn listed(name: &str, folder: &Path, now: SystemTime) -> Listed {
    let (path, bytes) = (folder.to_owned(), size_of(folder));
    let mut run = Listed { name: name.to_owned(), path, bytes, ..Listed::default() };
    let described = match kinds::of(folder) {
        Some((record, kind)) => {
            run.kind = kind.to_owned();
            let day = written(&folder.join(record));
            run.written = day.map(iso_day);
            run.age_s = day.and_then(|day| now.duration_since(day).ok()).map(|age| age.as_secs());
            if record == FILE_NAME {
                calibration(folder, &mut run)
            } else {
                other(&folder.join(record), &mut run)
            }
        }
        None if folder.join(CAMPAIGN).is_dir() => {
            run.kind = "calibration".to_owned();
            unfinished(folder, &mut run)
        }
        None => Err("no run of this program".to_owned()),
    };
    run.problem = described.err();
    run
}

fn calibration(folder: &Path, run: &mut Listed) -> Result<(), String> {
    let record = record::read(folder).map_err(|error| short(&error))?;
    describe(&record.plan, run);
    run.trust = match (record.trusted(), record.trust.converged()) {
        (false, true) => "careful".to_owned(),
        _ => record.trust.verdict.to_string(),
    };
    Ok(())
}

/// A run of programs that has no result yet.
fn unfinished(folder: &Path, run: &mut Listed) -> Result<(), String> {
    let stored = read_stored(folder).map_err(|error| error.to_string())?;
    describe(&stored.plan, run);
    run.trust = "unfinished".to_owned();
    Ok(())
}

fn describe(plan: &Plan, run: &mut Listed) {
    run.what.clone_from(&plan.name);
    run.data = tables(plan.observables().map(|(_, observable)| observable.table.as_str()));
}

/// Names of tables without their folders.
fn tables<'t>(tables: impl Iterator<Item = &'t str>) -> String {
    let mut names: Vec<&str> =
        tables.map(|table| table.rsplit(['/', ' ']).next().unwrap_or(table)).collect();
    names.dedup();
    match names[..] {
        [first, _, _, ..] => format!("{first} and {} more", names.len() - 1),
        _ => names.join(", "),
    }
}

/// Records of other kinds, of which a few fields are read.
fn other(file: &Path, run: &mut Listed) -> Result<(), String> {
    let text = text_file::read_up_to(file, LARGEST).map_err(|error| short(&error))?;
    let damaged = |why: &str| format!("damaged: {why}");
    let record: Value =
        serde_json::from_str(&text).map_err(|error| damaged(&format!("no JSON ({error})")))?;
    let plan = record.get("plan").filter(|plan| plan.is_object());
    let plan = plan.ok_or_else(|| damaged("without a plan"))?;
    let texts = |list: &Value, field: &str| -> Vec<String> {
        let all = list.as_array().into_iter().flatten();
        all.filter_map(|one| one[field].as_str().map(str::to_owned)).collect()
    };
    let plans = |list: &Value| -> String {
        let experiments =
            list.as_array().into_iter().flatten().flat_map(|plan| {
                plan["experiments"].as_array().into_iter().flatten().flat_map(|experiment| {
                    experiment["observables"].as_array().into_iter().flatten()
                })
            });
        tables(experiments.filter_map(|observable| observable["table"].as_str()))
    };
    let count = |list: &Value| list.as_array().map_or(0, Vec::len);
    let mut warnings = count(&record["advice"]);
    match run.kind.as_str() {
        "comparison" => {
            run.what = texts(&plan["experiments"], "name").join(", ");
            run.data = plans(&plan["experiments"]);
            let all = record["comparisons"].as_array().into_iter().flatten();
            warnings = all.map(|one| count(&one["warnings"])).sum();
        }
        "table 3" => {
            run.what = texts(&plan["materials"], "name").join(", ");
            run.data = plans(&plan["materials"]);
            let all = record["materials"].as_array().into_iter().flatten();
            warnings = all.map(|one| count(&one["advice"])).sum();
        }
        "scene" => {
            run.what = plan["name"].as_str().unwrap_or_default().to_owned();
            run.data = format!("{} particles", record["particles"]);
        }
        "difference" => {
            let all = plan["runs"].as_array().into_iter().flatten();
            let names: Vec<&str> = all.filter_map(Value::as_str).collect();
            run.what = names.join(", ");
        }
        _ => {
            run.what = plan["scene_name"].as_str().unwrap_or_default().to_owned();
            let of = plan["posterior_name"].as_str().unwrap_or_default();
            run.data = format!("{} draws of {of}", count(&record["draws"]));
        }
    }
    run.trust = match warnings {
        0 => "no warnings".to_owned(),
        1 => "1 warning".to_owned(),
        n => format!("{n} warnings"),
    };
    Ok(())
}

/// A mistake without its place, which the entry has.
fn short(error: &InputError) -> String {
    error.found.as_ref().map_or_else(|| error.to_string(), |found| format!("damaged: {found}"))
}

/// Size of all files below a folder; links are not followed.
fn size_of(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.metadata() {
            Ok(metadata) if metadata.is_dir() => size_of(&entry.path()),
            Ok(metadata) if metadata.is_file() => metadata.len(),
            _ => 0,
        })
        .sum()
}

/// A size with three digits at most: `2.5 MB`.
fn size(bytes: u64) -> String {
    let units = [(1e9, "GB"), (1e6, "MB"), (1e3, "kB")];
    let of = |(unit, name): &(f64, &str)| {
        let value = bytes as f64 / unit;
        (value >= 1.0).then(|| {
            if value < 10.0 { format!("{value:.1} {name}") } else { format!("{value:.0} {name}") }
        })
    };
    units.iter().find_map(of).unwrap_or_else(|| format!("{bytes} B"))
}

impl Listing {
    /// The listing as a table, with the folders that are no runs and the command that removes what was superseded below it.
    pub fn text(&self) -> String {
        let (runs, others): (Vec<&Listed>, Vec<&Listed>) =
            self.runs.iter().partition(|run| run.problem.is_none());
        let dir = on_one_line(&self.dir.display().to_string());
        let mut text = String::new();
        if runs.is_empty() {
            text.push_str(&format!("{dir}: no results\n"));
        } else {
            let mut rows = vec![
                ["name", "kind", "of", "data", "trust", "written", "age", "size"]
                    .map(str::to_owned),
            ];
            rows.extend(runs.iter().map(|run| {
                let aside = if run.superseded { " (superseded)" } else { "" };
                let dash = || "–".to_owned();
                let age = run.age_s.map(std::time::Duration::from_secs);
                [
                    format!("{}{aside}", run.name),
                    run.kind.clone(),
                    run.what.clone(),
                    run.data.clone(),
                    run.trust.clone(),
                    run.written.clone().unwrap_or_else(dash),
                    age.map_or_else(dash, ago),
                    size(run.bytes),
                ]
                .map(|cell| on_one_line(&cell))
            }));
            text.push_str(&aligned(&rows));
        }
        for run in others {
            let path = on_one_line(&run.path.display().to_string());
            let why = on_one_line(run.problem.as_deref().unwrap_or_default());
            text.push_str(&format!("{path}: {why}\n"));
        }
        if let Some(remove) = &self.remove {
            text.push_str(&format!("to remove what was superseded:\n  {remove}\n"));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_moved_aside_are_told_by_their_number() {
        assert_eq!(by_number("ps.2"), ("ps", 2));
        assert_eq!(by_number("ps.1.12"), ("ps.1", 12));
        for name in ["ps", "ps.0", "ps.a", ".2", "v0.2b", "ps."] {
            assert_eq!(by_number(name), (name, 0), "{name}");
        }
    }

    #[test]
    fn only_a_run_that_was_moved_aside_for_a_whole_one_of_its_kind_is_superseded() {
        let run = |name: &str| Listed {
            name: name.to_owned(),
            kind: "calibration".to_owned(),
            what: "ps".to_owned(),
            trust: "good".to_owned(),
            ..Listed::default()
        };
        let superseded = |runs: &[Listed]| -> Vec<String> {
            let of = runs.iter().filter(|run| is_superseded(run, runs));
            of.map(|run| run.name.clone()).collect()
        };
        assert_eq!(superseded(&[run("ps"), run("ps.1"), run("ps.2")]), ["ps.1", "ps.2"]);
        assert!(superseded(&[run("v1"), run("v1.5"), run("v0"), run("v0.05")]).is_empty());
        for newer in [
            Listed { problem: Some("damaged".to_owned()), ..run("ps") },
            Listed { trust: "unfinished".to_owned(), ..run("ps") },
            Listed { what: "peek".to_owned(), ..run("ps") },
            Listed { kind: "scene".to_owned(), ..run("ps") },
        ] {
            assert!(superseded(&[newer, run("ps.1")]).is_empty());
        }
        assert!(superseded(&[run("u\u{fffd}"), run("u\u{fffd}.1")]).is_empty());
    }

    #[test]
    fn sizes_have_three_digits_at_most() {
        let shown = [0, 999, 1000, 5_640_000, 12_345_678, 3_200_000_000].map(size);
        assert_eq!(shown, ["0 B", "999 B", "1.0 kB", "5.6 MB", "12 MB", "3.2 GB"]);
    }

    #[test]
    fn tables_are_named_without_their_folders() {
        assert_eq!(tables(["built-in experiments/ps-r30.csv"].into_iter()), "ps-r30.csv");
        assert_eq!(tables(["a/x.csv", "y.csv"].into_iter()), "x.csv, y.csv");
        assert_eq!(tables(["x", "y", "z"].into_iter()), "x and 2 more");
    }
}
