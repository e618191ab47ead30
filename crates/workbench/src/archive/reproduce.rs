//! An archived calibration, run again and held against itself.

use std::path::Path;

use campaign::Call;
use serde::Serialize;
use tempfile::TempDir;

use super::description::RESULTS;
use super::programs;
use super::unpack::{Limits, unpack};
use crate::calibration::{self, RunOptions, again};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::number::significant;
use crate::output::inputs::Inputs;
use crate::output::on_one_line;
use crate::plan::{Planned, SAMPLES, shell_word};
use crate::record::{self, Record};
use crate::watch::Watch;

/// Standard errors of a difference up to which it is one of chance: beyond by chance in one of 15 000 comparisons of normal
/// quantities with known errors, somewhat more often with errors from sixteen sub-nets.
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
    /// One of them is not to be trusted, and neither are its errors: whether they differ by more than chance is not known.
    NotKnown,
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
    /// Programs of this machine that are not those of the archived run.
    pub other_programs: Vec<String>,
}

/// Unpacks an archive, runs its calibration again in a temporary folder, or in `out`, and compares. Before programs are run
/// `allow` is asked, with their command lines.
///
/// # Errors
///
/// [`Failure::Input`] for an archive that is damaged or hostile, and where `allow` says no; else as a run. A run of programs that
/// does not end well stays where the error says it is.
pub fn reproduce(
    archive: &Path,
    options: &RunOptions,
    allow: &dyn Fn(&[String]) -> Result<bool, Failure>,
    watch: &dyn Watch,
) -> Result<Reproduction, Failure> {
    let place = archive.display().to_string();
    let folder = temporary(options.out.as_deref())?;
    let unpacked = unpack(archive, folder.path(), &Limits::default())?;
    let results = folder.path().join(RESULTS);
    let of_archive = |error: InputError| InputError {
        source_name: format!("{place}, {}", record::FILE_NAME).into(),
        ..error
    };
    let archived = record::read(&results).map_err(of_archive)?;
    calibration::refuse_population(&archived, &place)?;
    check(&place, &archived)?;
    let commands: Vec<String> = archived.plan.commands().map(|(_, _, call)| asked(call)).collect();
    if !commands.is_empty() && !allow(&commands)? {
        return Err(InputError::new(&place, Mistake::Conflict)
            .found(format_args!("an archive that runs programs: {}", commands.join("; ")))
            .expected("your word that they may be run")
            .help("look at them in its folder inputs (unzip -l), then say --yes")
            .into());
    }
    let without_other_kinetics = archived
        .experiments
        .iter()
        .filter_map(|experiment| experiment.neck_growth.as_ref())
        .all(|neck| neck.other_kinetics.is_empty());
    let inputs = Inputs::read(&results)?;
    let options = RunOptions { without_other_kinetics, ..options.clone() };
    if commands.is_empty() {
        let again = again(&archived, None, String::new());
        let out = options.out.clone().unwrap_or_else(|| folder.path().join("again"));
        let options = RunOptions { out: Some(out), ..options };
        let finished = calibration::run(&Planned { inputs, ..again }, &options, watch)?;
        return Ok(compared(&archived, &finished.record, Vec::new()));
    }
    let inputs = inputs.unwrap_or_default();
    let others = programs::compare(&place, &inputs, &unpacked)?;
    let (planned, out) = programs::plan(&place, &archived, inputs, (folder.path(), &options))?;
    let options = RunOptions { out: Some(out), ..options };
    match calibration::run(&planned, &options, watch) {
        Ok(finished) => Ok(compared(&archived, &finished.record, others)),
        Err(failure) => Err(programs::kept(failure, folder)),
    }
}

/// A temporary folder: beside the results, where they have a place, so that files can be moved there.
fn temporary(out: Option<&Path>) -> Result<TempDir, RunError> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".calibrate-reproduce-");
    let beside = out.and_then(|out| {
        let whole = std::path::absolute(out).ok()?;
        whole.ancestors().skip(1).find(|folder| folder.is_dir()).map(Path::to_owned)
    });
    match beside {
        Some(folder) => builder.tempdir_in(folder),
        None => builder.tempdir(),
    }
    .map_err(|error| {
        RunError::new(format_args!("no temporary folder: {error}"))
            .help("set TMPDIR to one, or choose another --out")
    })
}

/// All that a call does to this machine, in one line: variables, command, files that it is given.
fn asked(call: &Call) -> String {
    let variables = call.environment.iter().map(|(name, value)| format!("{name}={value}"));
    let words =
        variables.chain(call.argv.iter().cloned()).map(|word| shell_word(&on_one_line(&word)));
    let mut line = words.collect::<Vec<_>>().join(" ");
    let files: Vec<String> =
        call.files.iter().map(|file| shell_word(&on_one_line(&file.from))).collect();
    if !files.is_empty() {
        line += &format!(" (given {})", files.join(", "));
    }
    line
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
fn compared(archived: &Record, again: &Record, other_programs: Vec<String>) -> Reproduction {
    let versions = [archived.plan.version.clone(), again.plan.version.clone()];
    let name = archived.plan.name.clone();
    let mut same_version = again.clone();
    same_version.plan.version.clone_from(&archived.plan.version);
    if same_version == *archived {
        let (likeness, outcomes) = (Likeness::SameBits, Vec::new());
        return Reproduction { name, versions, likeness, outcomes, other_programs };
    }
    let mut outcomes: Vec<Outcome> = archived
        .parameters
        .iter()
        .zip(&again.parameters)
        .flat_map(|(old, new)| {
            let (name, old, new) = (&old.parameter.name, &old.in_coordinate, &new.in_coordinate);
            let unit = if new.sd > 0.0 { new.sd } else { f64::MIN_POSITIVE };
            let outcome =
                |quantity: &str, [old, new]: [f64; 2], [old_se, new_se]: [f64; 2]| Outcome {
                    quantity: format!("{quantity} of {name}"),
                    difference: (new - old) / unit,
                    standard_error: old_se.hypot(new_se) / unit,
                };
            [
                outcome("mean", [old.mean, new.mean], [old.mean_se, new.mean_se]),
                outcome("sd", [old.sd, new.sd], [old.sd_se, new.sd_se]),
            ]
        })
        .collect();
    let (old, new) = (&archived.log_evidence, &again.log_evidence);
    outcomes.push(Outcome {
        quantity: "log evidence".to_owned(),
        difference: new.value - old.value,
        standard_error: old.se.hypot(new.se),
    });
    let within = |one: &Outcome| one.difference.abs() <= ERRORS * one.standard_error;
    let names = |record: &Record| -> Vec<String> {
        record.parameters.iter().map(|one| one.parameter.name.clone()).collect()
    };
    let likeness = if names(archived) != names(again) {
        Likeness::Different
    } else if !(archived.errors_known() && again.errors_known()) {
        Likeness::NotKnown
    } else if outcomes.iter().all(within) {
        Likeness::WithinMonteCarloError
    } else {
        Likeness::Different
    };
    Reproduction { name, versions, likeness, outcomes, other_programs }
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
            Likeness::NotKnown => {
                format!(
                    "not known whether by more than Monte Carlo error, as one of the two is not to be trusted: largest difference {largest} sd\n"
                )
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
        for program in &self.other_programs {
            text.push_str(&format!("  run with another program: {program}\n"));
        }
        text
    }

    /// Whether it is reproduced.
    ///
    /// # Errors
    ///
    /// [`RunError`] where results differ by more than Monte Carlo error, or where that is not known.
    pub fn passed(&self) -> Result<(), RunError> {
        let help = match self.likeness {
            Likeness::SameBits | Likeness::WithinMonteCarloError => return Ok(()),
            Likeness::NotKnown => {
                "archive a run of more simulations: with few the errors themselves are not known"
            }
            Likeness::Different => {
                "the same version gives the same bits on the same kind of machine; where the version is another, compare the warnings of both"
            }
        };
        Err(RunError::new(format_args!("{}: the results are not reproduced", self.name)).help(help))
    }
}

#[cfg(test)]
mod tests {
    use smc_calib::Verdict;

    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::PairOptions;
    use crate::watch::Unwatched;

    fn record(seed: u64) -> Record {
        let options = PairOptions {
            material: Some(Material::Ps),
            samples: smc_calib::Settings::WHOLLY_PLAIN,
            seed,
            ..PairOptions::default()
        };
        let planned = options.plan().expect("a plan");
        Calibration::run(&planned, &Unwatched::default()).expect("runs").record
    }

    #[test]
    fn a_program_is_asked_about_with_its_variables_its_files_and_the_bounds_of_its_arguments() {
        let impact = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/external/impact.toml");
        let planned = crate::plan::Planned::read(Path::new(impact)).expect("a plan");
        let (_, _, call) = planned.plan.commands().next().expect("a command");
        let mut call = call.clone();
        call.argv = vec!["sh".to_owned(), "a b".to_owned(), "x\nRun them? no".to_owned()];
        call.environment = [("LD_PRELOAD".to_owned(), "./evil.so".to_owned())].into();
        let line = asked(&call);
        assert!(line.starts_with("LD_PRELOAD=./evil.so sh 'a b' 'x\\nRun them? no'"), "{line}");
    }

    #[test]
    fn a_result_that_is_not_to_be_trusted_is_not_said_to_be_reproduced_or_not() {
        let one = record(1);
        let mut other = record(2);
        other.trust.verdict = Verdict::Untrusted;
        let found = compared(&one, &other, Vec::new());
        assert_eq!(found.likeness, Likeness::NotKnown);
        assert!(found.passed().is_err() && found.text().contains("not known"), "{}", found.text());
        let mut fewer = one.clone();
        fewer.parameters.pop();
        assert_eq!(compared(&one, &fewer, Vec::new()).likeness, Likeness::Different);
        let mut wider = one.clone();
        wider.parameters[0].in_coordinate.sd *= 5.0;
        assert_eq!(compared(&one, &wider, Vec::new()).likeness, Likeness::Different);
    }

    #[test]
    fn the_same_seed_is_the_same_bits_another_is_monte_carlo_error_and_a_shift_is_neither() {
        let one = record(1);
        let mut other_version = one.clone();
        other_version.plan.version = "0.0.1".to_owned();
        assert_eq!(compared(&one, &one, Vec::new()).likeness, Likeness::SameBits);
        let same = compared(&one, &other_version, Vec::new());
        assert_eq!(same.likeness, Likeness::SameBits);
        assert!(same.text().contains("archived by version") && same.text().contains("same bits"));
        let other = compared(&one, &record(2), Vec::new());
        assert_eq!(other.likeness, Likeness::WithinMonteCarloError, "{}", other.text());
        assert!(other.passed().is_ok() && other.text().contains("largest difference 0.0"));
        let mut shifted = one.clone();
        shifted.parameters[1].in_coordinate.mean += one.parameters[1].in_coordinate.sd;
        let shifted = compared(&one, &shifted, Vec::new());
        assert_eq!(shifted.likeness, Likeness::Different);
        assert!((shifted.outcomes[2].difference - 1.0).abs() < 1e-9);
        assert!(
            shifted.passed().is_err() && shifted.text().contains("1.0 sd"),
            "{}",
            shifted.text()
        );
    }
}
