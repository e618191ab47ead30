//! Explanations of the same measurements, ranked by their evidence: finished runs, or a plan beside itself with what its radii
//! share as one's own.

mod explained;
mod own;
mod page;
mod priors;
mod ranked;
mod same;
mod text;
mod words;

use std::path::PathBuf;

use figures::{CompareFigure, NamedCurve, Role, Width};

use super::kept::{self, KeptModel, KeptModels};
use crate::calibration::Calibration;
use crate::error::{Failure, InputError, Mistake};
use crate::output::inputs::{InputFile, Inputs, sum_of};
use crate::output::page::FILE_NAME;
use crate::output::{Published, RunFolder, kinds, pretty};
use crate::pair::draws::PairDraws;
use crate::plan::{Planned, shell_word};
use crate::record::{self, Record, locate};
use crate::report::{DRAWS, NamedFigures, TimeScale, draw_all};
use crate::watch::{Watch, Within};

use explained::Explained;
pub use ranked::{Explanation, Explanations, ExplanationsPlan, ExplanationsReport, FitOf};
pub use text::text;

/// Explanations, ranked.
pub struct RankedExplanations {
    /// Contents of `compare.json`.
    pub report: ExplanationsReport,
    kept: Vec<KeptModels>,
    figures: NamedFigures,
    inputs: Option<Inputs>,
    command: String,
}

impl RankedExplanations {
    /// Ranks finished calibrations of the same measurements under the same noise model; `scale` is that of the time axes of the figures.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for fewer than two runs, for runs without an evidence, and for other measurements or another noise model.
    pub fn of_runs(runs: &[PathBuf], scale: TimeScale) -> Result<Self, Failure> {
        if runs.len() < 2 {
            return Err(InputError::new("compare", Mistake::MissingField)
                .found("one run")
                .expected("two finished calibrations of the same measurements, or more")
                .help("calibrate compare results/one results/other")
                .into());
        }
        let records = runs.iter().map(|run| Ok::<_, Failure>(record::read_calibration(run)?));
        let records = records.collect::<Result<Vec<_>, _>>()?;
        let given: Vec<String> = runs.iter().map(|run| run.display().to_string()).collect();
        let names = words::names(records.iter().map(|record| &record.plan), &given);
        let explained: Vec<Explained> = names
            .into_iter()
            .zip(records)
            .map(|(name, record)| Explained { name, record })
            .collect();
        let places = same::places(&explained, &given)?;
        let report = ranked::report(&explained, &places, given.clone(), Vec::new())?;
        let kept = kept_models(&report, &explained, runs)?;
        let words: Vec<String> = given.iter().map(|run| shell_word(run)).collect();
        Ok(Self {
            figures: figures(&report, &explained, &places, scale),
            report,
            inputs: Some(inputs(runs, kept.is_some())?),
            kept: kept.into_iter().collect(),
            command: format!("calibrate compare {}", words.join(" ")),
        })
    }

    /// Calibrates a plan as it stands, with its radii sharing tau_s and the cooling time by a law of R, and with each of the two of one's
    /// own for each radius, and ranks them.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for a plan without anything that two radii share; as [`Calibration::run`].
    pub fn of_plan(
        planned: &Planned,
        scale: TimeScale,
        watch: &dyn Watch,
    ) -> Result<Self, Failure> {
        let own::Variants { laws, plans } = own::variants(&planned.plan)?;
        watch.begin(plans.len() as u64, 0, "calibrations");
        let mut explained = Vec::new();
        for (name, plan) in plans {
            let planned = Planned { plan, ..planned.clone() };
            let found = Calibration::run(&planned, &Within::new(watch, name.clone()))?;
            watch.advance();
            explained.push(Explained { name, record: found.record });
        }
        watch.end();
        let places = same::places(&explained, &[])?;
        let mut report = ranked::report(&explained, &places, Vec::new(), laws)?;
        report.comparisons[0].warnings.extend(planned.warnings.iter().cloned());
        let file = planned.path.as_ref().map(|path| shell_word(&path.display().to_string()));
        Ok(Self {
            figures: figures(&report, &explained, &places, scale),
            report,
            kept: Vec::new(),
            inputs: planned.inputs.clone(),
            command: format!("calibrate compare --plan {}", file.unwrap_or_default()),
        })
    }

    /// Writes the folder of the comparison.
    ///
    /// # Errors
    ///
    /// [`Failure::Run`] for a file that cannot be written; nothing has been published then.
    pub fn publish(&self, folder: &RunFolder) -> Result<Published, Failure> {
        let staging = folder.stage()?;
        let write = |name: &str, bytes: &[u8]| staging.write(folder.path(), name, bytes);
        write(kinds::COMPARISON, pretty(&self.report)?.as_bytes())?;
        write("compare.md", text::markdown(&self.report, &self.command).as_bytes())?;
        write("compare.csv", text::csv(&self.report).as_bytes())?;
        let sums = kept::write(&self.kept, &write)?;
        let drawn = draw_all(&self.figures, Width::Column, &write)?;
        self.inputs.as_ref().map_or(Ok(()), |inputs| inputs.write(&write))?;
        let page = page::page(&self.report, &drawn, (self.inputs.as_ref(), &self.command), &sums);
        write(FILE_NAME, page.html()?.as_bytes())?;
        Ok(staging.publish()?)
    }
}

/// Draws of the explanations, where each is of one pair: what their average is made of.
fn kept_models(
    report: &ExplanationsReport,
    explained: &[Explained],
    runs: &[PathBuf],
) -> Result<Option<KeptModels>, Failure> {
    if explained.iter().any(|one| one.record.pair().is_err()) {
        return Ok(None);
    }
    let of = |(one, run): (&Explained, &PathBuf)| {
        let (_, measured) = one.record.plan.pair()?;
        let draws = PairDraws::read(run)?;
        Ok::<_, Failure>(KeptModel::of_draws(draws, &measured.noise, one.name.clone()))
    };
    let models = explained.iter().zip(runs).map(of).collect::<Result<Vec<_>, _>>()?;
    let probabilities = report.ranked().explanations.iter().map(|one| one.probability);
    let plan = &explained[0].record.plan;
    Ok(Some(KeptModels::new((&plan.name, &plan.title), probabilities, models)))
}

/// The best curves of all explanations, a figure for each pair of particles.
fn figures(
    report: &ExplanationsReport,
    explained: &[Explained],
    places: &[Vec<usize>],
    scale: TimeScale,
) -> NamedFigures {
    let mut figures = NamedFigures::new();
    let Some(first) = explained.first() else { return figures };
    for (k, (experiment, measured)) in first.record.plan.observables().enumerate() {
        let mut figure = CompareFigure {
            title: report.ranked().explanations[0].fits[k].label.clone(),
            control: measured.control.clone(),
            value: measured.values.clone(),
            ..CompareFigure::default()
        };
        figure.axes.log_control = scale.is_log(&figure.control, &figure.value);
        for (place, (one, places)) in explained.iter().zip(places).enumerate() {
            let Some((curves, map)) = curve(&one.record, places[k]) else { continue };
            figure.grid.clone_from(&curves.time_s);
            figure.curves.push(NamedCurve {
                name: one.name.clone(),
                role: Role::Series(place),
                curve: curves.map.clone(),
                at_data: map.to_vec(),
            });
        }
        // A program's experiment has no curve between its observations.
        if figure.curves.len() == explained.len() {
            figures.push((format!("compare-{}", experiment.name), Box::new(figure)));
        }
    }
    figures
}

/// The best curve of an observable, where it is that of a pair.
fn curve(record: &Record, place: usize) -> Option<(&record::Curves, &[f64])> {
    let mut all = record
        .experiments
        .iter()
        .flat_map(|experiment| experiment.observables.iter().map(move |found| (experiment, found)));
    let (experiment, found) = all.nth(place)?;
    Some((&experiment.neck_growth.as_ref()?.curves, &found.map))
}

/// The files of the runs that are compared, by name and sum: their records, and their draws where these were read.
fn inputs(runs: &[PathBuf], with_draws: bool) -> Result<Inputs, InputError> {
    let file = |(role, path): (&str, PathBuf)| {
        let name = path.display().to_string();
        let (bytes, sha256) = sum_of(&path)
            .map_err(|error| InputError::new(&name, Mistake::Unreadable).found(error))?;
        Ok(InputFile { role: role.to_owned(), name, bytes, sha256 })
    };
    let of_run = |run: &PathBuf| {
        let record = locate(run);
        let draws = with_draws.then(|| ("draws", record.with_file_name(DRAWS)));
        [("posterior", record)].into_iter().chain(draws)
    };
    let files = runs.iter().flat_map(of_run).map(file);
    Ok(Inputs { files: files.collect::<Result<_, InputError>>()? })
}
