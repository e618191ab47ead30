//! Runs of programs that stopped, as the user meets them; and failed runs that are made once more.

use std::collections::BTreeMap;
use std::path::Path;

use campaign::{Campaign, ExecutorError, Outcome};

use super::store::{self, refused};
use crate::error::{Failure, InputError, Mistake, RunError};
use crate::given_up::{self, GivenUp};
use crate::output::{CAMPAIGN, checksums, pretty};
use crate::plan::{Plan, sample_of};
use crate::record::FILE_NAME;

/// Number of failed runs by cause.
fn causes(campaign: &Campaign) -> BTreeMap<String, u64> {
    let mut causes = BTreeMap::new();
    for task in campaign.tasks() {
        let outcome = campaign.outcome(task.number);
        if let Some(kind) = outcome.as_ref().and_then(Outcome::failure) {
            *causes.entry(kind.to_string()).or_insert(0) += 1;
        }
    }
    causes
}

/// Whether an outcome is a failure whose cause, or what the run wrote to stderr last, contains the words asked for.
pub(super) fn is_wanted(words: &str, outcome: &Outcome) -> bool {
    let Outcome::Failed { kind, detail, .. } = outcome else { return false };
    let words = words.to_lowercase();
    [kind.to_string(), detail.clone()].iter().any(|said| said.to_lowercase().contains(&words))
}

/// Refuses words that no failed run has said.
pub(super) fn check_cause(campaign: &Campaign, words: &str) -> Result<(), Failure> {
    let there = causes(campaign);
    let tasks = campaign.tasks();
    let mut outcomes = tasks.iter().filter_map(|task| campaign.outcome(task.number));
    if there.is_empty() || outcomes.any(|outcome| is_wanted(words, &outcome)) {
        return Ok(());
    }
    let counted = there.iter().map(|(words, count)| format!("{words} ({count} runs)"));
    Err(InputError::new("--retry-failed", Mistake::UnknownName)
        .found(format_args!("no run that failed by \"{words}\""))
        .expected(format_args!(
            "words of: {}; or of what they wrote to stderr last",
            counted.collect::<Vec<_>>().join(", ")
        ))
        .into())
}

/// Gives up the outcomes of runs that failed with these words, so that they are made once more; returns their number. With
/// `keep_placed` the runs that were placed with them stay. A result that had counted them is put aside: the run has none until
/// they are made.
pub(super) fn retry_failed(
    dir: &Path,
    campaign: &mut Campaign,
    plan: &Plan,
    (words, keep_placed): (&str, bool),
) -> Result<usize, Failure> {
    let refused = |error| refused(dir, error);
    let mut wanted = BTreeMap::new();
    let tasks = campaign.tasks();
    for task in &tasks {
        let outcome = campaign.outcome(task.number);
        if let Some(outcome) = outcome.filter(|outcome| is_wanted(words, outcome)) {
            let cause = outcome.failure().map_or_else(String::new, ToString::to_string);
            wanted.insert(task.number, cause);
        }
    }
    if !wanted.is_empty() {
        // The sums last: without them the other files are read as they are.
        put_aside(dir, FILE_NAME)?;
        put_aside(dir, checksums::FILE_NAME)?;
    }
    let before = store::given_up(campaign);
    // The sets of a design are placed by nothing.
    if keep_placed && plan.design.is_none() {
        if wanted.is_empty() {
            return Ok(0);
        }
        let again: Vec<u64> = wanted.keys().copied().collect();
        let placed = tasks.last().map_or(0, |last| sample_of(plan, last.number).0 + 1);
        let mut now = before;
        now.add(placed, wanted);
        // First: a failure that is still there counts as one in any case.
        campaign.replace_extra(given_up::FILE, pretty(&now)?.as_bytes()).map_err(refused)?;
        return campaign.forget(&again).map_err(refused);
    }
    if !before.is_empty() {
        // In this order: what is placed anew is placed as if nothing had been given up.
        campaign.place_again().map_err(refused)?;
        let none = pretty(&GivenUp::default())?;
        campaign.replace_extra(given_up::FILE, none.as_bytes()).map_err(refused)?;
    }
    let again = campaign.forget_failed(&|outcome| is_wanted(words, outcome)).map_err(refused)?;
    Ok(again.len())
}

/// Moves a file of a result that no longer holds beside the runs, as `NAME.retried-1`.
fn put_aside(dir: &Path, file: &str) -> Result<(), RunError> {
    let (path, runs) = (dir.join(file), dir.join(CAMPAIGN));
    if !path.is_file() {
        return Ok(());
    }
    let name = |k: u32| runs.join(format!("{file}.retried-{k}"));
    let aside = (1..).map(name).find(|path| !path.exists());
    aside.map_or(Ok(()), |aside| std::fs::rename(&path, aside)).map_err(|error| {
        RunError::new(format_args!("{}: cannot be put aside: {error}", path.display()))
    })
}

/// What the last failed run of the commonest cause wrote to stderr: `run 7: license server down`.
pub(super) fn last_words(campaign: &Campaign) -> Option<String> {
    let causes = causes(campaign);
    let (commonest, _) = causes.iter().max_by_key(|(_, count)| **count)?;
    campaign.tasks().iter().rev().find_map(|task| match campaign.outcome(task.number)? {
        Outcome::Failed { kind, detail, .. }
            if kind.to_string() == *commonest && !detail.is_empty() =>
        {
            Some(format!("run {}: {detail}", task.number))
        }
        _ => None,
    })
}

/// Why an executor stopped other than by an interruption.
pub(super) fn failure(dir: &Path, error: ExecutorError) -> Failure {
    let name = dir.display();
    let resume = format!("then: calibrate --resume {name}");
    let of = RunError::new(&error);
    match error {
        ExecutorError::CannotStart { .. } => of
            .help("install the program, or correct argv in the plan and begin another run")
            .help(resume)
            .into(),
        ExecutorError::Outage { .. } => of
            .help(format_args!(
                "mend what is out of order, then make these runs once more: calibrate --resume {name} --retry-failed"
            ))
            .help(format_args!(
                "if it is the parameters that fail, count them as failed and go on: calibrate --resume {name}"
            ))
            .help(format_args!("causes and runs as tables: calibrate export {name}"))
            .into(),
        ExecutorError::Simulator(_) => of
            .help(format_args!("put the former one back, {resume}"))
            .help(format_args!(
                "if it gives the same results: calibrate --resume {name} --accept-changes"
            ))
            .into(),
        ExecutorError::NotNow { .. } => {
            of.help("once the program can be called").help(resume).into()
        }
        ExecutorError::Lost { .. } => of
            .help(format_args!("to try again: calibrate --resume {name}"))
            .help(format_args!(
                "if it is the parameters that decide, as by the memory they need: lost = \"fail\" beside argv in the plan, \
                 then: calibrate --resume {name} --plan FILE"
            ))
            .into(),
        ExecutorError::Campaign(error) => refused(dir, error),
        _ => of.help(resume).into(),
    }
}
