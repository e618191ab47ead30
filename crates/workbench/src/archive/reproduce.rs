//! An archived calibration, run again and held against itself.

use std::path::Path;

use serde::Serialize;

use super::description::{INPUTS, RESULTS};
use super::unpack::{Limits, unpack};
use crate::calibration::{self, RunOptions, again};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file;
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::page::PLAN;
use crate::plan::SAMPLES;
use crate::record::{self, Record};
use crate::watch::Watch;

/// Standard errors of a difference up to which it is one of chance: by chance beyond in one of 15 000 comparisons.
const ERRORS: f64 = 4.0;

/// How alike two results are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Likeness {
    /// Every number is the same.
    SameBits,
    /// They differ by what other random numbers would do.
    WithinMonteCarloError,
    /// They differ by more.
    Different,
}

/// How much a quantity has moved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The quantity: mean of a parameter, log evidence.
    pub quantity: String,
    /// New minus archived; of a parameter in posterior standard deviations.
    pub difference: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// An archived calibration beside the same, run again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reproduction {
    /// Name of the run.
    pub name: String,
    /// Version that made the archived results, and this one.
    pub versions: [String; 2],
    /// How alike the results are.
    pub likeness: Likeness,
    /// Each quantity; empty where all bits are the same.
    pub outcomes: Vec<Outcome>,
}

/// Unpacks an archive, runs its calibration again in a temporary folder, or in `out`, and compares. Before programs are run
/// `allow` is asked, with their command lines.
///
/// # Errors
///
/// [`Failure::Input`] for an archive that is damaged or hostile, and where `allow` says no; else as a run.
pub fn reproduce(
    archive: &Path,
    options: &RunOptions,
    allow: &dyn Fn(&[String]) -> Result<bool, Failure>,
    watch: &dyn Watch,
) -> Result<Reproduction, Failure> {
    let place = archive.display().to_string();
    let folder =
        tempfile::Builder::new().prefix("calibrate-reproduce-").tempdir().map_err(|error| {
            RunError::new(format_args!("no temporary folder: {error}")).help("set TMPDIR to one")
        })?;
    unpack(archive, folder.path(), &Limits::default())?;
    let results = folder.path().join(RESULTS);
    let of_archive = |error: InputError| InputError {
        source_name: format!("{place}, {}", record::FILE_NAME).into(),
        ..error
    };
    let archived = record::read(&results).map_err(of_archive)?;
    check(&place, &archived)?;
    let commands: Vec<String> =
        archived.plan.commands().map(|(_, _, call)| call.argv.join(" ")).collect();
    if !commands.is_empty() && !allow(&commands)? {
        return Err(InputError::new(&place, Mistake::Conflict)
            .found(format_args!("an archive that runs programs: {}", commands.join("; ")))
            .expected("your word that they may be run")
            .help("look at them in its folder inputs (unzip -l), then say --yes")
            .into());
    }
    let inputs = Inputs::read(&results)?.unwrap_or_default();
    let plan_file = inputs.by_role(PLAN).map(|file| folder.path().join(INPUTS).join(&file.name));
    let text = match &plan_file {
        Some(file) if file.is_file() => text_file::read(file)?,
        _ => String::new(),
    };
    let path = (!commands.is_empty())
        .then(|| plan_file.unwrap_or_else(|| folder.path().join(INPUTS).join("plan.toml")));
    let planned = again(&archived, path, text);
    let without_other_kinetics = archived
        .experiments
        .iter()
        .filter_map(|experiment| experiment.neck_growth.as_ref())
        .all(|neck| neck.other_kinetics.is_empty());
    let out = options.out.clone().unwrap_or_else(|| folder.path().join("again"));
    let options = RunOptions { out: Some(out), without_other_kinetics, ..options.clone() };
    let finished = calibration::run(&planned, &options, watch)?;
    Ok(compared(&archived, &finished.record))
}

/// Refuses a plan that asks for more than any that this program makes.
fn check(place: &str, archived: &Record) -> Result<(), InputError> {
    let sampler = &archived.plan.sampler;
    let numbers = [
        ("samples", sampler.samples, SAMPLES),
        ("draws", sampler.draws, 0..=1 << 27),
        ("map_simulations", sampler.map_simulations, 0..=1 << 27),
    ];
    match numbers.into_iter().find(|(_, number, range)| !range.contains(number)) {
        None => Ok(()),
        Some((field, number, range)) => Err(InputError::new(place, Mistake::OutOfRange)
            .in_field(format_args!("plan.sampler.{field}"))
            .found(number)
            .expected(format_args!("a number from {} to {}", range.start(), range.end()))
            .help("it was not written by this program; ask whoever sent it")),
    }
}

/// Two results of one plan.
fn compared(archived: &Record, again: &Record) -> Reproduction {
    let versions = [archived.plan.version.clone(), again.plan.version.clone()];
    let name = archived.plan.name.clone();
    let mut same_version = again.clone();
    same_version.plan.version.clone_from(&archived.plan.version);
    if same_version == *archived {
        return Reproduction { name, versions, likeness: Likeness::SameBits, outcomes: Vec::new() };
    }
    let mut outcomes: Vec<Outcome> = archived
        .parameters
        .iter()
        .zip(&again.parameters)
        .map(|(old, new)| {
            let (name, old, new) = (&old.parameter.name, &old.in_coordinate, &new.in_coordinate);
            let sd = if old.sd > 0.0 { old.sd } else { f64::MIN_POSITIVE };
            Outcome {
                quantity: format!("mean of {name}"),
                difference: (new.mean - old.mean) / sd,
                standard_error: old.mean_se.hypot(new.mean_se) / sd,
            }
        })
        .collect();
    let (old, new) = (&archived.log_evidence, &again.log_evidence);
    outcomes.push(Outcome {
        quantity: "log evidence".to_owned(),
        difference: new.value - old.value,
        standard_error: old.se.hypot(new.se),
    });
    let within = |one: &Outcome| one.difference.abs() <= ERRORS * one.standard_error;
    let likeness = match outcomes.iter().all(within) {
        true => Likeness::WithinMonteCarloError,
        false => Likeness::Different,
    };
    Reproduction { name, versions, likeness, outcomes }
}

impl Reproduction {
    /// The comparison in words.
    pub fn text(&self) -> String {
        let [old, new] = &self.versions;
        let by = if old == new {
            format!("by the same version, {old}")
        } else {
            format!("archived by version {old}, run by {new}")
        };
        let mut text = format!("{} ({by}): ", self.name);
        let parameters = self.outcomes.iter().filter(|one| one.quantity != "log evidence");
        let largest = parameters.map(|one| one.difference.abs()).fold(0.0, f64::max);
        let largest = significant(largest, 2);
        text.push_str(&match self.likeness {
            Likeness::SameBits => "same bits\n".to_owned(),
            Likeness::WithinMonteCarloError => {
                format!("same within Monte Carlo error: largest difference {largest} sd\n")
            }
            Likeness::Different => {
                format!(
                    "DIFFERENT, by more than Monte Carlo error: largest difference {largest} sd\n"
                )
            }
        });
        for one in &self.outcomes {
            let unit = if one.quantity == "log evidence" { "" } else { " sd" };
            text.push_str(&format!(
                "  {:<20} moves by {:>9}{unit}, with a standard error of {}\n",
                one.quantity,
                significant(one.difference, 2),
                significant(one.standard_error, 2)
            ));
        }
        text
    }

    /// Whether it is reproduced.
    ///
    /// # Errors
    ///
    /// [`RunError`] where results differ by more than Monte Carlo error.
    pub fn passed(&self) -> Result<(), RunError> {
        if self.likeness != Likeness::Different {
            return Ok(());
        }
        Err(RunError::new(format_args!("{}: the results are not reproduced", self.name)).help(
            "another version samples otherwise: compare the warnings of both; where both are trusted, one of them is wrong",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    fn record(seed: u64) -> Record {
        let options = PairOptions {
            material: Some(Material::Ps),
            samples: 4096,
            seed,
            ..PairOptions::default()
        };
        let planned = options.plan().expect("a plan");
        Calibration::run(&planned, &Unwatched::default()).expect("runs").record
    }

    #[test]
    fn the_same_seed_is_the_same_bits_another_is_monte_carlo_error_and_a_shift_is_neither() {
        let one = record(1);
        let mut other_version = one.clone();
        other_version.plan.version = "0.0.1".to_owned();
        assert_eq!(compared(&one, &one).likeness, Likeness::SameBits);
        let same = compared(&one, &other_version);
        assert_eq!(same.likeness, Likeness::SameBits);
        assert!(same.text().contains("archived by version") && same.text().contains("same bits"));
        let other = compared(&one, &record(2));
        assert_eq!(other.likeness, Likeness::WithinMonteCarloError, "{}", other.text());
        assert!(other.passed().is_ok() && other.text().contains("largest difference 0.0"));
        let mut shifted = one.clone();
        shifted.parameters[1].in_coordinate.mean += one.parameters[1].in_coordinate.sd;
        let shifted = compared(&one, &shifted);
        assert_eq!(shifted.likeness, Likeness::Different);
        assert!((shifted.outcomes[1].difference - 1.0).abs() < 1e-9);
        assert!(
            shifted.passed().is_err() && shifted.text().contains("1.0 sd"),
            "{}",
            shifted.text()
        );
    }
}
