//! Consequences of array elements that ended without the results of their runs.

use std::time::Duration;

use super::client::Unknown;
use super::job::{Place, Sent};
use super::parse::Ending;
use super::session::Session;
use super::submission::Loss;
use crate::error::ExecutorError;
use crate::executor::Event;
use crate::outcome::{FailureKind, Outcome};

/// Number of array elements that fail before any run has ended from which on the set-up counts as wrong.
const BROKEN_MOST: u32 = 3;
/// Number of submissions in a row that may never appear in the queue.
const VANISHED_MOST: u32 = 5;

const AGAIN: &str = "its runs are submitted again, as often as retries allow; to end everything, interrupt this program";
const ALONE: &str = "its runs are submitted again, each in an array element of its own";

/// The consequence of an element that ended without the results of its runs.
enum Verdict {
    /// Its runs are submitted again, as often as they may be.
    Again,
    /// Its runs are submitted again, each in an element of its own.
    Alone,
    /// Its only run needs more than it may have.
    TooMuch(FailureKind),
    /// The worker cannot do its work.
    Broken,
    /// It was never in the queue.
    Vanished,
}

impl Session<'_> {
    /// Decides on elements that are gone for so long that their results would be here.
    pub(super) fn judge(&mut self) -> Result<(), ExecutorError> {
        if self.queue_silent || self.overdue().is_empty() {
            return Ok(());
        }
        // The last look before a run counts as lost.
        self.collect()?;
        self.ask_accounts();
        for (job, element, runs) in self.overdue() {
            self.decide(job, element, runs)?;
        }
        Ok(())
    }

    /// Elements that are gone, by the place of their job and their own, with the runs that they owe.
    fn overdue(&self) -> Vec<(usize, usize, Vec<u64>)> {
        let grace = Duration::from_secs_f64(self.cluster.settings.grace_s);
        let mut overdue = Vec::new();
        for (i, job) in self.jobs.iter().enumerate() {
            // It may still be on its way from an sbatch that did not answer, or lost its driver.
            let on_its_way = job.sent == Sent::Perhaps
                && job.submission.age_s() as f64
                    <= self.cluster.settings.grace_s + self.cluster.settings.command_timeout_s;
            for (element, runs) in job.live(&self.open) {
                // Slurm's word: no result is on its way.
                let cancelled = |ending| ending == Some(Ending::Cancelled);
                if let Place::Gone { since, looks, ending } = job.places[element]
                    && (cancelled(ending) || looks >= 2 && since.elapsed() >= grace)
                    && !on_its_way
                {
                    overdue.push((i, element, runs));
                }
            }
        }
        overdue
    }

    /// Asks the cluster's accounts how elements ended that the queue has forgotten.
    fn ask_accounts(&mut self) {
        let forgotten: Vec<(usize, usize)> = self
            .overdue()
            .into_iter()
            .map(|(job, element, _)| (job, element))
            .filter(|&(job, element)| {
                matches!(self.jobs[job].places[element], Place::Gone { ending: None, .. })
            })
            .collect();
        let mut ids: Vec<u64> =
            forgotten.iter().filter_map(|&(job, _)| self.jobs[job].id).collect();
        ids.dedup();
        if ids.is_empty() || !self.accounts {
            return;
        }
        match self.cluster.client.accounts(&ids, self.stop) {
            Ok(rows) => {
                for (job, element) in forgotten {
                    let job = &mut self.jobs[job];
                    let number = u32::try_from(element).unwrap_or(u32::MAX);
                    let row = rows.iter().find(|row| {
                        row.name == job.submission.name && row.elements.may_hold(number)
                    });
                    if let Some(row) = row {
                        job.remember(element, row.state);
                    }
                }
            }
            // Most clusters that keep none say so at once. They are a help, not needed.
            Err(Unknown::Words(_) | Unknown::NotInstalled(_)) => self.accounts = false,
            Err(Unknown::Interrupted) => {}
        }
    }

    fn decide(&mut self, at: usize, element: usize, runs: Vec<u64>) -> Result<(), ExecutorError> {
        let job = &self.jobs[at];
        let ending = match job.places[element] {
            Place::Gone { ending, .. } => ending,
            _ => None,
        };
        let name = job.element_name(element);
        let how = ending.map_or("is gone from the queue without a result", Ending::words);
        let printed = job.submission.printed(self.campaign.dir(), element);
        let mut cause = format!("Slurm's {name} {how}");
        if !printed.is_empty() {
            cause = format!("{cause}; it printed:\n{printed}");
        }
        let verdict = self.verdict(at, element, ending);
        let counts = matches!(verdict, Verdict::Again);
        let loss = job.loss(element, runs.clone(), &cause, counts);
        self.put_down(at, element, loss)?;
        match verdict {
            Verdict::Again => {
                self.note_once(how, format!("{cause}\n{AGAIN}"));
                self.lose(&runs, &cause)?;
            }
            Verdict::Alone => {
                self.note_once(how, format!("{cause}\n{ALONE}"));
                self.alone.extend(runs);
            }
            Verdict::TooMuch(kind) => self.fail(&runs, &kind, &cause)?,
            Verdict::Broken => {
                self.note_once(how, cause.clone());
                self.broken += 1;
                for number in runs {
                    if let Some(run) = self.open.get_mut(&number) {
                        run.broken += 1;
                        if run.broken > 1 {
                            self.stuck.insert(number, cause.clone());
                        }
                    }
                }
                let hopeless = self.ended == 0 && self.broken >= BROKEN_MOST;
                if hopeless {
                    return Err(ExecutorError::Scheduler(broken_words(&cause)));
                }
            }
            Verdict::Vanished => {
                let job = &mut self.jobs[at];
                self.vanished += u32::from(!job.vanished);
                job.vanished = true;
                if self.vanished >= VANISHED_MOST {
                    let words = format!(
                        "{VANISHED_MOST} job arrays were given to sbatch, and none of them ever was in \
                         the queue; try: sbatch --array=0 --wrap true"
                    );
                    return Err(ExecutorError::Scheduler(words));
                }
            }
        }
        self.submit.soon();
        Ok(())
    }

    fn verdict(&self, at: usize, element: usize, ending: Option<Ending>) -> Verdict {
        let job = &self.jobs[at];
        let single = job.submission.elements[element].len() == 1;
        match ending {
            None if job.sent == Sent::Perhaps => Verdict::Vanished,
            Some(Ending::ExitCode) => Verdict::Broken,
            Some(Ending::TimeLimit | Ending::OutOfMemory) if !single => Verdict::Alone,
            Some(Ending::TimeLimit) => {
                let limit_s = 60.0 * f64::from(job.submission.time_min);
                Verdict::TooMuch(FailureKind::Timeout { limit_s })
            }
            Some(Ending::OutOfMemory) => Verdict::TooMuch(FailureKind::OutOfMemory),
            Some(Ending::Completed | Ending::Cancelled | Ending::Killed) | None => Verdict::Again,
        }
    }

    /// Writes down that an element is over, before anything follows from it.
    pub(super) fn put_down(
        &mut self,
        at: usize,
        element: usize,
        loss: Loss,
    ) -> Result<(), ExecutorError> {
        self.losses.append(&[loss])?;
        self.jobs[at].places[element] = Place::Over;
        Ok(())
    }

    /// Runs whose job is gone: again, or given up where that was too often.
    fn lose(&mut self, runs: &[u64], cause: &str) -> Result<(), ExecutorError> {
        let kind = FailureKind::Lost { signal: None };
        let mut hopeless = Vec::new();
        for &number in runs {
            let Some(run) = self.open.get_mut(&number) else { continue };
            run.lost += 1;
            run.started = false;
            if run.lost > run.retries && run.fails_when_lost {
                hopeless.push(number);
            } else if run.lost > run.retries {
                self.given_up.insert(number, cause.to_owned());
            } else {
                (self.watch)(Event::Retried { number, kind: kind.clone() });
            }
        }
        self.fail(&hopeless, &kind, cause)
    }

    /// Stores that runs failed for good.
    fn fail(
        &mut self,
        runs: &[u64],
        kind: &FailureKind,
        detail: &str,
    ) -> Result<(), ExecutorError> {
        let outcome = |number: u64| Outcome::Failed {
            kind: kind.clone(),
            detail: detail.to_owned(),
            attempts: self.campaign.attempts(number).max(1),
            seconds: 0.0,
        };
        let outcomes = runs.iter().map(|&number| (number, outcome(number))).collect();
        self.campaign.record(outcomes)?;
        self.collect()
    }

    /// Ends with an error where only runs are left that were lost too often, or whose workers cannot do their work.
    pub(super) fn give_up(&self) -> Result<(), ExecutorError> {
        let waits = |run: &u64| !(self.stuck.contains_key(run) || self.given_up.contains_key(run));
        if self.open.keys().any(waits) {
            return Ok(());
        }
        match (self.stuck.values().next(), self.given_up.values().next()) {
            (Some(cause), _) => Err(ExecutorError::Scheduler(broken_words(cause))),
            (None, Some(detail)) => {
                let numbers = self.given_up.keys().copied().collect();
                let cause = FailureKind::Lost { signal: None }.to_string();
                Err(ExecutorError::Lost { numbers, cause, detail: detail.clone() })
            }
            (None, None) => Ok(()),
        }
    }
}

fn broken_words(cause: &str) -> String {
    format!("{cause}\nthe worker of an array element cannot do its work; mend it, then resume")
}
