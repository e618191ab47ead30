//! Everything that the runs of programs have so far as tables, also while they run.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use campaign::{Contents, Outcome, Task};
use smc_calib::{Likelihood, Posterior, Sample, Simulator as _};

use super::files::FOLDER;
use super::replay::{Replay, Simulated};
use crate::calibration::{read_stored, refuse_older_layout, refused};
use crate::error::{Failure, InputError, Mistake};
use crate::given_up;
use crate::input::sample_table;
use crate::output::{self, CAMPAIGN};
use crate::plan::{Plan, sample_of};
use crate::record::FILE_NAME;
use crate::report::quoted;

/// Tables that were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// Their folder.
    pub out: PathBuf,
    /// Number of samples.
    pub samples: usize,
    /// Number of samples with weights.
    pub weighted: usize,
    /// Number of runs.
    pub runs: usize,
}

/// Writes the tables of the run in a folder, to `out` or to `export` in it.
///
/// # Errors
///
/// [`Failure::Input`] for a folder without runs of programs, or a place that cannot be written.
pub fn export(dir: &Path, out: Option<&Path>) -> Result<Exported, Failure> {
    refuse_older_layout(dir)?;
    if dir.join(FILE_NAME).is_file() && !dir.join(CAMPAIGN).is_dir() {
        let name = dir.display();
        return Err(InputError::new(name.to_string(), Mistake::Conflict)
            .found("a finished run that was computed in this program, without runs of others")
            .help(format_args!("all its samples with their weights are in {name}/samples.csv"))
            .help(format_args!(
                "its posterior for ArviZ or R: calibrate export {name} --format zarr"
            ))
            .into());
    }
    let contents = campaign::contents(&dir.join(CAMPAIGN)).map_err(|error| refused(dir, error))?;
    let stored = read_stored(dir)?;
    let plan = &stored.plan;
    let out = out.map_or_else(|| dir.join(FOLDER), Path::to_owned);
    fs::create_dir_all(&out).map_err(|error| {
        InputError::new("--out", Mistake::Unwritable)
            .found(format_args!("{} ({error})", out.display()))
            .expected("a folder for the tables")
    })?;
    let replay = Replay::new(plan, Some(&contents), given_up::read(&dir.join(CAMPAIGN)))?;
    let posterior = replay.posterior();
    let samples = samples(&replay, posterior.as_ref());
    let sets: Vec<&[f64]> = samples.iter().map(|sample| sample.theta).collect();
    let names = plan.parameter_names();
    let grain_learning = sample_table::write(&plan.name, &names, sets.iter().copied());
    for (name, text) in [
        ("samples.csv", samples_csv(plan, &replay, &samples)),
        ("runs.csv", runs_csv(plan, &contents)),
        ("samples-grainlearning.txt", grain_learning),
    ] {
        output::write_file(&out.join(name), text.as_bytes())?;
    }
    let weighted = samples.iter().filter(|sample| sample.judged.is_some()).count();
    Ok(Exported { out, samples: samples.len(), weighted, runs: contents.tasks.len() })
}

/// A sample so far.
struct SampleSoFar<'a> {
    number: usize,
    theta: &'a [f64],
    /// The sampler's account of it, where its stage is complete.
    judged: Option<&'a Sample>,
}

/// Every sample that is known: those of complete stages with their weights, those that were submitted after them.
fn samples<'a>(replay: &'a Replay<'_>, posterior: Option<&'a Posterior>) -> Vec<SampleSoFar<'a>> {
    let mut samples: Vec<SampleSoFar<'a>> = posterior
        .map_or(&[][..], |posterior| &posterior.samples)
        .iter()
        .enumerate()
        .map(|(number, sample)| SampleSoFar { number, theta: &sample.theta, judged: Some(sample) })
        .collect();
    let known = samples.len();
    let mut later: Vec<(usize, &Task)> = replay
        .tasks
        .iter()
        .map(|task| (sample_of(replay.plan, task.number).0, task))
        .filter(|(sample, _)| *sample >= known)
        .collect();
    later.sort_by_key(|(sample, task)| (*sample, task.number));
    later.dedup_by_key(|(sample, _)| *sample);
    samples.extend(later.into_iter().map(|(number, task)| SampleSoFar {
        number,
        theta: &task.parameters,
        judged: None,
    }));
    samples
}

fn samples_csv(plan: &Plan, replay: &Replay<'_>, samples: &[SampleSoFar<'_>]) -> String {
    let likelihoods: Vec<_> = plan
        .groups()
        .unwrap_or_default()
        .into_iter()
        .filter_map(|group| Likelihood::new(&group.noise, &group.observations).ok())
        .collect();
    let mut text = String::from("sample");
    for parameter in &plan.parameters {
        text.push(',');
        text.push_str(&quoted(&format!("{} [{}]", parameter.name, parameter.unit)));
    }
    text.push_str(",state,cause,log_likelihood,weight,stage");
    for (experiment, observable) in plan.observables() {
        let label = plan.label(experiment, observable);
        for control in &observable.control {
            let _ = match &observable.control_column {
                Some(column) => {
                    write!(text, ",{}", quoted(&format!("{label} at {column} = {control}")))
                }
                None => write!(text, ",{}", quoted(&format!("{label} in row {control}"))),
            };
        }
    }
    text.push('\n');
    for sample in samples {
        let _ = write!(text, "{}", sample.number + 1);
        for value in sample.theta {
            let _ = write!(text, ",{value:e}");
        }
        let simulated = replay.sample(sample.number, sample.theta);
        let (state, cause, values) = match &simulated {
            Simulated::Values(values) => ("finished", "", values.as_slice()),
            Simulated::Failed(cause) => ("failed", cause.as_str(), &[][..]),
            Simulated::Missing => ("missing", "", &[][..]),
        };
        let log_likelihood = sample.judged.and_then(|judged| judged.log_likelihood).or_else(|| {
            let mut rest = values;
            let mut sum = 0.0;
            for likelihood in &likelihoods {
                let width = likelihood.values().len();
                if rest.len() < width {
                    return None;
                }
                let (own, after) = rest.split_at(width);
                sum += likelihood.ln_joint(own);
                rest = after;
            }
            Some(sum)
        });
        let or_empty = |text: Option<String>| text.unwrap_or_default();
        let _ = write!(
            text,
            ",{state},{},{},{},{}",
            quoted(cause),
            or_empty(log_likelihood.map(|l| l.to_string())),
            or_empty(sample.judged.map(|judged| format!("{:e}", judged.weight))),
            or_empty(sample.judged.map(|judged| judged.stage.to_string())),
        );
        for place in 0..replay.observables() {
            text.push(',');
            if let Some(value) = values.get(place) {
                let _ = write!(text, "{value:e}");
            }
        }
        text.push('\n');
    }
    text
}

fn runs_csv(plan: &Plan, contents: &Contents) -> String {
    let mut text = String::from("run,sample,experiment,state,cause,detail,attempts,seconds\n");
    for task in &contents.tasks {
        let (sample, experiment) = sample_of(plan, task.number);
        let name = plan.experiments.get(experiment).map_or("", |experiment| &experiment.name);
        let _ = write!(text, "{},{},{}", task.number, sample + 1, quoted(name));
        let _ = match contents.outcomes.get(&task.number) {
            Some(Outcome::Finished { attempts, seconds, .. }) => {
                writeln!(text, ",finished,,,{attempts},{seconds}")
            }
            Some(Outcome::Failed { kind, detail, attempts, seconds }) => writeln!(
                text,
                ",failed,{},{},{attempts},{seconds}",
                quoted(&kind.to_string()),
                quoted(detail)
            ),
            None => writeln!(text, ",missing,,,,"),
        };
    }
    text
}
