//! Error over the number of simulations, from a few dozen to tens of thousands: whether more is always better.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::sync::Mutex;

use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionGrid, WorkPrecisionSeries};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use serde::{Deserialize, Serialize};
use smc_calib::Settings;
use workbench::error::{Failure, RunError};

use crate::args::BudgetsArgs;
use crate::cases::{Case, Errors};
use crate::quantile::{LARGEST, capped_rms, quantile};
use crate::report::{Report, Table, seconds};
use crate::seeds::over_seeds;
use crate::small_budget::problems;
use crate::timing::{Clock, Timing};

/// Largest ratio of an error to that at half the simulations, or at one simulation fewer.
const CLIFF: f64 = 1.25;
/// Errors up to which ratios are judged: a run off by more is not solved.
const SOLVED: f64 = 1.0;
/// Errors below count as this in the table: a hundredth of a standard deviation is not missed. Their own ratios have a list of their own.
const MISSED: f64 = 0.01;
/// Budgets at which the code changes its ways: the first with stages of two, three and four (51, 101, 151, where a process does not run
/// through all samples either), with covariances not searched at every stage (128), in batches of four (201), only in part by a process, and
/// without one.
const THRESHOLDS: [usize; 7] = [51, 101, 128, 151, 201, Settings::PLAIN, Settings::WHOLLY_PLAIN];

const QUANTITIES: [(&str, &str); 3] =
    [("error of the mean", "posterior sd"), ("error of the sd", ""), ("error of ln Z", "")];

const TEXT: &str = "\
Errors of `Settings::for_budget` (root mean square over the seeds, each error counted as 10 at most; mean and sd of the worst parameter) at
32, 48, 64, 96, ... simulations and on both sides of the thresholds of the code. \"Grows by\" is the largest ratio of an error to the same error at half as
many simulations (on thresholds, at one fewer), where that is below 1 and one of the two is above 0.01; the earlier one counts as 0.01 at least. Errors
that were below 0.01 have their own list. A ratio has an uncertainty of about a tenth from 50 seeds and a
quarter from 10, and more where one seed has most of an error: \"at least\" is what one of these ratios exceeds in 95 % of 1000 draws of as many seeds (bootstrap), which one of so many
rows may do by chance. Time is the
processor time of one run with one thread, median, everything beside the simulations of the closed form included. Where the study was ended and
begun again, its run time and date are those of the last part.
";

/// Draws of as many seeds, with replacement, by which ratios are judged, and the share of them that a ratio is at least.
const DRAWS: usize = 1000;
const SURE: f64 = 0.95;

/// Errors of mean, sd and log evidence, and the time of a run.
struct Point {
    samples: usize,
    errors: [f64; 3],
    /// The errors of every draw of the seeds.
    drawn: Vec<[f64; 3]>,
    time_s: f64,
}

/// An error beside that of fewer simulations.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Growth {
    /// Place in [`QUANTITIES`].
    quantity: usize,
    before: f64,
    after: f64,
    /// Of the two, and what it is at least in [`SURE`] of the draws.
    ratio: f64,
    at_least: f64,
}

impl Growth {
    fn line(&self, problem: &str, samples: usize) -> String {
        let Self { quantity, before, after, ratio, at_least } = self;
        let name = QUANTITIES[*quantity].0;
        format!(
            "- {problem}, {samples} simulations, {name}: {ratio:.2}, at least {at_least:.2} ({before:.4} to {after:.4})\n"
        )
    }
}

pub(crate) fn run(args: &BudgetsArgs, out: &Path) -> Result<(), Failure> {
    let BudgetsArgs { least, most, .. } = *args;
    let budgets = budgets(least, most);
    if budgets.is_empty() {
        let none = format_args!(
            "no number of simulations of this study (32, 48, 50, 51, 64, ...) lies between --least {least} and --most {most}"
        );
        return Err(RunError::new(none).into());
    }
    let mut report = Report::begin(out, "budgets")?;
    let runs = Runs::open(&report)?;
    let mut table = Table::new(&[
        "problem",
        "simulations",
        "mean [posterior sd]",
        "sd, relative",
        "ln Z",
        "grows by",
        "at least",
        "processor time",
    ]);
    let mut cliffs = [const { String::new() }; 3];
    let mut curves = Vec::new();
    for (name, case) in problems(&args.only)? {
        let mut points: Vec<Point> = Vec::new();
        for &samples in &budgets {
            eprintln!("{name}, {samples} simulations");
            let runs = over_seeds(args.seeds, &|seed| runs.of(&name, &case, samples, seed))?;
            let point = Point::of(case.exact.mean.len(), samples, &runs);
            for growth in growths(&points, &point, 0.0) {
                if growth.before < MISSED && growth.at_least > CLIFF {
                    cliffs[2] += &growth.line(&name, samples);
                }
            }
            let judged: Vec<Growth> = growths(&points, &point, MISSED)
                .into_iter()
                .filter(|growth| growth.before.max(growth.after) >= MISSED)
                .collect();
            for growth in judged.iter().filter(|growth| growth.ratio > CLIFF) {
                cliffs[usize::from(growth.at_least <= CLIFF)] += &growth.line(&name, samples);
            }
            let errors = point.errors.map(|error| format!("{error:.3}"));
            let largest = |of: &dyn Fn(&Growth) -> f64| {
                let largest = judged.iter().map(of).reduce(f64::max);
                largest.map_or("-".to_owned(), |ratio| format!("{ratio:.2}"))
            };
            let growth = [largest(&|g| g.ratio), largest(&|g| g.at_least)];
            let what = [name.clone(), samples.to_string()];
            table.push([&what[..], &errors, &growth, &[seconds(point.time_s)]].concat());
            points.push(point);
        }
        curves.push((name, points));
        report.table(&table)?;
        report.figure("figure", &figure(&curves))?;
        let said = |lines: &str| if lines.is_empty() { "none\n" } else { lines }.to_owned();
        let [sure, unsure, small] = cliffs.each_ref().map(|lines| said(lines));
        let found = format!(
            "Errors that grow by more than {CLIFF}, as 95 % of the draws say too:\n\n{sure}\n\
             Errors that grow by more than {CLIFF}, as chance may make them:\n\n{unsure}\n\
             Errors that were below {MISSED} and grow by more than {CLIFF}, as 95 % of the draws say too:\n\n{small}"
        );
        let text = format!("{} seeds. {TEXT}\n{found}\n{}", args.seeds, table.markdown());
        report.page("Error over the number of simulations", &text)?;
    }
    Ok(())
}

/// 32, 48, 64, 96, ..., every threshold and one less than it, from `least` to `most`.
fn budgets(least: usize, most: usize) -> Vec<usize> {
    let doubling = (5..).map(|k| 1 << k).take_while(|n| *n <= most);
    let mut budgets: Vec<usize> = doubling.flat_map(|n| [n, n + n / 2]).collect();
    budgets.extend(THRESHOLDS.iter().flat_map(|n| [n - 1, *n]));
    budgets.retain(|n| (least..=most).contains(n));
    budgets.sort_unstable();
    budgets.dedup();
    budgets
}

impl Point {
    fn of(d: usize, samples: usize, runs: &[Run]) -> Self {
        let all: Vec<&Run> = runs.iter().collect();
        let mut random = ChaCha8Rng::seed_from_u64(samples as u64);
        let mut draw = || -> Vec<&Run> {
            runs.iter().map(|_| &runs[random.random_range(0..runs.len())]).collect()
        };
        Self {
            samples,
            errors: errors(d, &all),
            drawn: (0..DRAWS).map(|_| errors(d, &draw())).collect(),
            time_s: Timing::of(runs.iter().map(|run| run.time_s).collect()).median_s,
        }
    }
}

/// Errors of mean and sd, of the worst of d parameters, and of the log evidence.
fn errors(d: usize, runs: &[&Run]) -> [f64; 3] {
    // A run without an answer counts as much as one that is off by as much as counts.
    let over = |error: &dyn Fn(&Errors) -> f64| {
        capped_rms(runs.iter().map(|run| run.errors.as_ref().map_or(LARGEST, error)))
    };
    let worst = |of: &dyn Fn(&Errors, usize) -> f64| {
        (0..d).map(|j| over(&|e| of(e, j))).fold(0.0, f64::max)
    };
    [
        worst(&|e, j| e.mean[j]),
        worst(&|e, j| e.sd[j]),
        over(&|e| e.log_evidence.unwrap_or(f64::NAN)),
    ]
}

/// One run of the study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Run {
    problem: String,
    samples: usize,
    seed: u64,
    time_s: f64,
    /// None where there is no answer, or none of some number (JSON has no infinity).
    errors: Option<Errors>,
    revision: String,
}

/// The runs, kept in `runs.jsonl` beside the report: the study takes hours, and one that is begun again at the same commit goes on.
struct Runs {
    revision: String,
    before: Vec<Run>,
    file: Mutex<File>,
}

/// Runs of a commit among the lines of a file; a line that a kill has cut is none.
fn of_commit(text: &str, commit: &str) -> Vec<Run> {
    let lines = text.lines().filter_map(|line| serde_json::from_str::<Run>(line).ok());
    lines.filter(|run| run.revision == commit).collect()
}

impl Runs {
    fn open(report: &Report) -> Result<Self, RunError> {
        let path = report.path("runs.jsonl");
        let place = |error| RunError::new(format_args!("{}: {error}", path.display()));
        let text = fs::read_to_string(&path).unwrap_or_default();
        let commit = report.commit();
        let before = commit.map_or_else(Vec::new, |commit| of_commit(&text, commit));
        let revision = commit.unwrap_or_default().to_owned();
        let mut file = OpenOptions::new().create(true).append(true).open(&path).map_err(place)?;
        if !text.is_empty() && !text.ends_with('\n') {
            writeln!(file).map_err(place)?;
        }
        Ok(Self { revision, before, file: Mutex::new(file) })
    }

    fn of(&self, problem: &str, case: &Case, samples: usize, seed: u64) -> Result<Run, RunError> {
        let same = |run: &&Run| (&*run.problem, run.samples, run.seed) == (problem, samples, seed);
        if let Some(run) = self.before.iter().find(same) {
            return Ok(run.clone());
        }
        let settings = Settings { seed, ..Settings::for_budget(samples) };
        let (time_s, found) = Clock::Thread.measure(|| case.sampled(&settings));
        let errors = found.ok().map(|run| Errors::of(&case.exact, &run.estimate));
        let finite = |e: &Errors| e.mean.iter().chain(&e.sd).all(|x| x.is_finite());
        let run = Run {
            problem: problem.to_owned(),
            samples,
            seed,
            time_s,
            errors: errors.filter(finite),
            revision: self.revision.clone(),
        };
        let line = serde_json::to_string(&run).map_err(RunError::new)? + "\n";
        let mut file = self.file.lock().map_err(|_| RunError::new("a thread has ended"))?;
        file.write_all(line.as_bytes()).map_err(RunError::new)?;
        Ok(run)
    }
}

/// Errors beside those at half the simulations, or at one fewer, where these are there and were solved. An earlier error counts as `floor`
/// at least.
fn growths(before: &[Point], point: &Point, floor: f64) -> Vec<Growth> {
    let known = |n: &usize| [2 * n, n + 1].contains(&point.samples);
    let before = before.iter().filter(|earlier| known(&earlier.samples));
    let both = before.flat_map(|earlier| (0..QUANTITIES.len()).map(move |q| (earlier, q)));
    both.filter(|(earlier, q)| earlier.errors[*q] < SOLVED)
        .map(|(earlier, quantity)| {
            let ratio = |a: &[f64; 3], b: &[f64; 3]| b[quantity] / a[quantity].max(floor);
            let draws = earlier.drawn.iter().zip(&point.drawn);
            let mut drawn: Vec<f64> = draws.map(|(a, b)| ratio(a, b)).collect();
            drawn.sort_by(f64::total_cmp);
            Growth {
                quantity,
                before: earlier.errors[quantity],
                after: point.errors[quantity],
                ratio: ratio(&earlier.errors, &point.errors),
                at_least: quantile(&drawn, 1.0 - SURE),
            }
        })
        .collect()
}

fn figure(curves: &[(String, Vec<Point>)]) -> WorkPrecisionGrid {
    let panel = |quantity: usize, problems: &[(String, Vec<Point>)]| WorkPrecisionFigure {
        title: String::new(),
        cost_name: "simulations".to_owned(),
        cost_unit: String::new(),
        error_name: QUANTITIES[quantity].0.to_owned(),
        error_unit: QUANTITIES[quantity].1.to_owned(),
        series: problems
            .iter()
            .enumerate()
            .map(|(k, (name, points))| {
                let error: Vec<f64> = points.iter().map(|p| p.errors[quantity].max(1e-6)).collect();
                WorkPrecisionSeries {
                    name: name.clone(),
                    role: Role::Series(k),
                    cost: points.iter().map(|p| p.samples as f64).collect(),
                    band: Band { lower: error.clone(), upper: error.clone() },
                    error,
                }
            })
            .collect(),
        guide_slope: Some(-0.5),
    };
    // No more curves in a panel than there are colours.
    let rows = curves
        .chunks(4)
        .flat_map(|problems| (0..3).map(|quantity| vec![panel(quantity, problems)]))
        .collect();
    WorkPrecisionGrid { title: "Error over the number of simulations".to_owned(), rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point whose errors are these in so many of the draws, and 1 in the rest.
    fn drawn(samples: usize, error: f64, times: usize) -> Point {
        let drawn = (0..DRAWS).map(|k| [if k < times { error } else { 1.0 }; 3]).collect();
        Point { samples, errors: [error; 3], drawn, time_s: 0.0 }
    }

    fn point(samples: usize, error: f64) -> Point {
        drawn(samples, error, DRAWS)
    }

    fn run(seed: u64, revision: &str) -> Run {
        Run {
            problem: "banana".to_owned(),
            samples: 64,
            seed,
            time_s: 0.1,
            errors: Some(Errors { mean: vec![0.1], sd: vec![-0.2], log_evidence: Some(0.3) }),
            revision: revision.to_owned(),
        }
    }

    #[test]
    fn an_error_is_held_against_half_the_budget_and_against_one_fewer_and_only_where_that_was_solved()
     {
        let before = [point(64, 0.1), point(96, 0.2), point(127, 0.4), point(1024, 3.0)];
        let ratios = |point: &Point| -> Vec<f64> {
            let growths = growths(&before, point, MISSED);
            assert!(growths.iter().all(|growth| growth.ratio == growth.at_least));
            growths.iter().map(|growth| growth.ratio).collect()
        };
        assert_eq!(ratios(&point(128, 0.2)), [2.0, 2.0, 2.0, 0.5, 0.5, 0.5]);
        assert_eq!(ratios(&point(192, 0.1)), [0.5; 3]);
        assert!(ratios(&point(2048, 6.0)).is_empty());
        assert!(ratios(&point(100, 6.0)).is_empty());
    }

    #[test]
    fn an_error_that_is_not_missed_counts_as_a_hundredth_and_has_its_own_ratio_too() {
        let ratio = |floor| growths(&[point(64, 0.005)], &point(128, 0.5), floor)[0].ratio;
        assert_eq!([ratio(MISSED), ratio(0.0)], [50.0, 100.0]);
    }

    #[test]
    fn a_ratio_is_at_least_what_it_is_in_all_but_one_of_twenty_draws_of_the_seeds() {
        let at_least =
            |times| growths(&[drawn(64, 0.5, times)], &point(128, 1.0), MISSED)[0].at_least;
        assert_eq!([at_least(951), at_least(949)], [2.0, 1.0]);
    }

    #[test]
    fn errors_of_draws_spread_as_those_of_so_many_seeds() {
        // Squares that are 0 or 4: the mean of 40 has a relative standard deviation of 1 / sqrt(40).
        let run = |seed: u64| {
            let off = if seed.is_multiple_of(2) { 2.0 } else { 0.0 };
            let errors = Errors { mean: vec![0.5, off], sd: vec![off, 0.5], log_evidence: None };
            Run { errors: Some(errors), seed, ..run(seed, "") }
        };
        let runs: Vec<Run> = (0..40).map(run).collect();
        let point = Point::of(2, 64, &runs);
        assert_eq!(point.errors, [2.0f64.sqrt(), 2.0f64.sqrt(), LARGEST]);
        let off = point.drawn.iter().map(|drawn| (drawn[0] * drawn[0] / 2.0 - 1.0).powi(2));
        let variance = off.sum::<f64>() / DRAWS as f64;
        assert!((0.85 / 40.0..1.15 / 40.0).contains(&variance), "{variance}");
    }

    #[test]
    fn numbers_of_simulations_are_those_between_and_may_be_none() {
        assert_eq!(budgets(40, 64), [48, 50, 51, 64]);
        assert!(budgets(52, 63).is_empty());
        assert!(budgets(64, 32).is_empty());
    }

    #[test]
    fn runs_of_the_same_commit_are_read_back_and_a_line_that_was_cut_is_none() {
        let runs = [run(1, "abc"), run(2, "abd"), run(3, "abc")];
        let lines = runs.each_ref().map(|run| serde_json::to_string(run).expect("JSON") + "\n");
        let text = lines.concat() + &lines[0][..40];
        assert_eq!(of_commit(&text, "abc"), [runs[0].clone(), runs[2].clone()]);
    }

    #[test]
    fn budgets_double_in_two_steps_and_hold_both_sides_of_every_threshold() {
        assert_eq!(budgets(129, 256), [150, 151, 192, 200, 201, 256]);
        let budgets = budgets(0, 4096);
        assert!(budgets.starts_with(&[32, 48, 50, 51, 64, 96, 100, 101, 127, 128]), "{budgets:?}");
        for threshold in THRESHOLDS.into_iter().filter(|n| *n <= 4096) {
            assert!(budgets.windows(2).any(|pair| pair == [threshold - 1, threshold]));
        }
        assert_eq!(budgets.last(), Some(&4096));
    }
}
