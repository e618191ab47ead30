//! The states of the jobs, as the queue reports them.

use std::time::Instant;

use super::client::Unknown;
use super::job::{Job, Place, Sent};
use super::parse::{QueueRow, State};
use super::session::Session;
use crate::error::ExecutorError;
use crate::executor::Event;

/// Reasons for which jobs wait that need no words.
const USUAL_REASONS: [&str; 5] =
    ["None", "Priority", "Resources", "JobArrayTaskLimit", "BeginTime"];

/// Reasons for which a job waits until somebody changes it or the cluster, with the remedy in the plan.
const HOPELESS_REASONS: [(&str, &str); 9] = [
    ("PartitionTimeLimit", "make [executor] time_min or chunk smaller, or name another partition"),
    ("PartitionNodeLimit", "ask for fewer cpus in [executor], or name another partition"),
    ("BadConstraints", "correct extra in [executor]: no node has what it asks for"),
    ("InvalidAccount", "correct account in [executor]"),
    ("InvalidQOS", "correct --qos in extra of [executor]"),
    ("QOSMaxWallDurationPerJobLimit", "make [executor] time_min or chunk smaller"),
    ("AssocMaxWallDurationPerJobLimit", "make [executor] time_min or chunk smaller"),
    ("QOSMaxMemoryPerJob", "make [executor] memory_mb smaller"),
    ("QOSMaxCpuPerJobLimit", "make [executor] cpus smaller"),
];

fn hopeless(reason: &str) -> Option<(&'static str, &'static str)> {
    HOPELESS_REASONS.into_iter().find(|(known, _)| *known == reason)
}

impl Session<'_> {
    /// Asks the queue where the jobs are. Without an answer everything stays as it was.
    pub(super) fn ask_queue(&mut self) -> Result<(), ExecutorError> {
        self.queue.done();
        let names: Vec<&str> = self
            .jobs
            .iter()
            .filter(|job| job.sent != Sent::NotYet && job.is_live(&self.open))
            .map(|job| job.submission.name.as_str())
            .collect();
        if names.is_empty() {
            self.queue_silent = false;
            return Ok(());
        }
        match self.cluster.client.queue(&names, self.stop) {
            Ok(rows) => {
                if self.queue_silent {
                    (self.watch)(Event::Note("squeue answers again".into()));
                }
                self.queue_silent = false;
                self.place(&rows)
            }
            Err(Unknown::Interrupted) => Ok(()),
            Err(Unknown::NotInstalled(words)) => Err(ExecutorError::Scheduler(words)),
            Err(Unknown::Words(words)) => {
                if !self.queue_silent {
                    let words = format!(
                        "what runs is not known ({words}); results are still looked for, nothing is \
                         submitted twice"
                    );
                    (self.watch)(Event::Note(words));
                }
                self.queue_silent = true;
                Ok(())
            }
        }
    }

    /// Sets the state of each element.
    fn place(&mut self, rows: &[QueueRow]) -> Result<(), ExecutorError> {
        let mut queued = Vec::new();
        let mut started = Vec::new();
        let mut reasons = Vec::new();
        for job in self.jobs.iter_mut().filter(|job| job.sent != Sent::NotYet) {
            let name = &job.submission.name;
            let rows: Vec<&QueueRow> = rows.iter().filter(|row| row.name == *name).collect();
            if let Some(row) = rows.first() {
                job.sent = Sent::Yes;
                self.vanished = 0;
                if job.id != Some(row.job) {
                    job.id = Some(row.job);
                    job.submission.write_job(self.campaign.dir(), row.job)?;
                }
            }
            let live: Vec<(usize, Vec<u64>)> = job.live(&self.open).collect();
            for (element, runs) in live {
                let row = row_of(&rows, element);
                let before = job.places[element];
                job.places[element] = next_place(before, row);
                let alive = matches!(job.places[element], Place::Waiting | Place::Running);
                if job.adopted && alive && before == Place::Unknown {
                    queued.extend(&runs);
                }
                match (job.places[element], row) {
                    (Place::Running, _) => started.extend(runs.first()),
                    (Place::Waiting, Some(row)) => reasons.push(row.reason.clone()),
                    (Place::Gone { looks: 1, .. }, _) => {
                        self.look.soon();
                        self.queue.soon();
                    }
                    _ => {}
                }
            }
        }
        if !queued.is_empty() {
            let words =
                format!("{} runs are in Slurm's queue already; waiting for them", queued.len());
            (self.watch)(Event::Note(words));
        }
        for number in queued {
            (self.watch)(Event::Queued { number });
        }
        for number in started {
            if let Some(run) = self.open.get_mut(&number)
                && !run.started
            {
                run.started = true;
                (self.watch)(Event::Started { number });
            }
        }
        if let Some((reason, remedy)) = reasons.iter().find_map(|reason| hopeless(reason)) {
            self.hopeless = Some(format!(
                "runs would wait in Slurm's queue for ever because of {reason}: {remedy}; the jobs were taken back"
            ));
        }
        for reason in reasons {
            if !USUAL_REASONS.contains(&reason.as_str()) {
                let words = format!("runs wait in Slurm's queue because of {reason}");
                self.note_once(&reason, words);
            }
        }
        Ok(())
    }
}

/// The queue's line about an element: one that names it, or else one that may include it.
fn row_of<'a>(rows: &[&'a QueueRow], element: usize) -> Option<&'a QueueRow> {
    let element = u32::try_from(element).ok()?;
    let named = rows.iter().find(|row| row.elements.name(element));
    named.or_else(|| rows.iter().find(|row| row.elements.may_hold(element))).copied()
}

fn next_place(before: Place, row: Option<&QueueRow>) -> Place {
    let ending = match row.map(|row| row.state) {
        Some(State::Pending) => return Place::Waiting,
        Some(State::Running) => return Place::Running,
        Some(State::Ended(ending)) => Some(ending),
        None => None,
    };
    match before {
        Place::Gone { since, looks, ending: known } => {
            Place::Gone { since, looks: looks.saturating_add(1), ending: ending.or(known) }
        }
        _ => Place::Gone { since: Instant::now(), looks: 1, ending },
    }
}

/// Endings from the accounts, for elements that the queue has forgotten.
impl Job {
    pub(super) fn remember(&mut self, element: usize, state: State) {
        if let (Place::Gone { ending, .. }, State::Ended(known)) =
            (&mut self.places[element], state)
        {
            *ending = ending.or(Some(known));
        }
    }
}
