//! Submission of what is missing.

use std::collections::BTreeSet;

use super::client::{NotSubmitted, Unknown};
use super::job::{Job, Place, Sent};
use super::session::Session;
use super::submission::{self, Submission};
use crate::error::ExecutorError;
use crate::executor::Event;
use crate::machine;

impl Session<'_> {
    /// Submits the open runs that no job will give an outcome of.
    pub(super) fn submit_missing(&mut self) -> Result<(), ExecutorError> {
        self.submit.done();
        let unsent = |job: &Job| job.sent == Sent::NotYet;
        while let Some(at) = self.jobs.iter().position(unsent) {
            if !self.send(at)? {
                return Ok(());
            }
        }
        let missing = self.missing();
        if missing.is_empty() {
            return Ok(());
        }
        let Some(size) = self.array_size()? else { return Ok(()) };
        let elements = submission::elements(&missing, self.cluster.settings.chunk, &self.alone);
        for elements in elements.chunks(size) {
            let limit = match self.cluster.settings.max_parallel.map(|most| self.left_of(most)) {
                // Others of ours must end first.
                Some(0) => break,
                limit => limit,
            };
            let number = self.next_number;
            self.next_number += 1;
            let submission = Submission {
                number,
                name: submission::job_name(self.campaign, number),
                elements: elements.to_vec(),
                limit,
                time_min: self.time_min(elements),
                written: machine::now_s(),
            };
            self.jobs.push(Job::new(submission));
            if !self.send(self.jobs.len() - 1)? {
                break;
            }
        }
        Ok(())
    }

    /// Open runs that are in no live element of a job.
    fn missing(&self) -> Vec<u64> {
        let covered: BTreeSet<u64> = self
            .jobs
            .iter()
            .flat_map(|job| job.live(&self.open))
            .flat_map(|(_, runs)| runs)
            .collect();
        let wanted = |run: &u64| {
            !(covered.contains(run)
                || self.stuck.contains_key(run)
                || self.given_up.contains_key(run))
        };
        self.open.keys().copied().filter(wanted).collect()
    }

    /// Largest number of elements of an array; `None` while Slurm does not tell it.
    fn array_size(&mut self) -> Result<Option<usize>, ExecutorError> {
        if self.array_size.is_none() {
            match self.cluster.client.max_array_size(self.stop) {
                Ok(size) => self.array_size = Some(size as usize),
                Err(Unknown::Interrupted) => {}
                Err(Unknown::NotInstalled(words)) => return Err(ExecutorError::Scheduler(words)),
                Err(Unknown::Words(words)) => {
                    let words = format!("nothing can be submitted now ({words}); trying again");
                    self.note_once("size unknown", words);
                }
            }
        }
        Ok(self.array_size)
    }

    /// Number of further elements that may run at the same time.
    fn left_of(&self, most: u32) -> u32 {
        let used: usize = self
            .jobs
            .iter()
            .map(|job| {
                let live = job.live(&self.open).count();
                job.submission.limit.map_or(live, |limit| live.min(limit as usize))
            })
            .sum();
        most.saturating_sub(u32::try_from(used).unwrap_or(u32::MAX))
    }

    /// The time limit of the elements of an array \[min\].
    fn time_min(&self, elements: &[Vec<u64>]) -> u32 {
        if let Some(time_min) = self.cluster.settings.time_min {
            return time_min;
        }
        let seconds_of = |run: &u64| self.open.get(run).map_or(0.0, |run| run.timeout_s + 30.0);
        let longest = elements.iter().map(|runs| runs.iter().map(seconds_of).sum());
        let seconds: f64 = longest.fold(0.0, f64::max);
        // A cast saturates.
        (seconds / 60.0).ceil() as u32 + 1
    }

    /// Gives a job to sbatch. Whether more may be given now.
    fn send(&mut self, at: usize) -> Result<bool, ExecutorError> {
        let dir = self.campaign.dir();
        let job = &mut self.jobs[at];
        job.submission.written = machine::now_s();
        let arguments = job.submission.write(dir, &self.cluster.settings, &self.cluster.worker)?;
        match self.cluster.client.submit(dir, &arguments) {
            Ok(id) => {
                job.sent = Sent::Yes;
                job.id = Some(id);
                job.submission.write_job(dir, id)?;
                let runs: Vec<u64> = job.live(&self.open).flat_map(|(_, runs)| runs).collect();
                for number in runs {
                    (self.watch)(Event::Queued { number });
                }
                self.vanished = 0;
                self.queue.soon();
                Ok(true)
            }
            Err(NotSubmitted::Refused(words)) => {
                self.forget(at, &words)?;
                Err(ExecutorError::Scheduler(format!("Slurm refuses the runs: {words}")))
            }
            Err(NotSubmitted::NotInstalled(words)) => {
                self.forget(at, &words)?;
                Err(ExecutorError::Scheduler(words))
            }
            Err(NotSubmitted::TooMany(words)) => self.send_fewer(at, &words),
            Err(NotSubmitted::Busy(words)) => {
                self.note_once("busy", format!("Slurm takes no jobs now ({words}); trying again"));
                Ok(false)
            }
            Err(NotSubmitted::Unknown(words)) => {
                job.sent = Sent::Perhaps;
                self.queue.soon();
                let words = format!(
                    "whether Slurm took a job array is not known ({words}); looking for it in the queue"
                );
                self.note_once("perhaps", words);
                Ok(false)
            }
        }
    }

    /// Slurm finds an array too large: smaller ones, down to one element.
    fn send_fewer(&mut self, at: usize, words: &str) -> Result<bool, ExecutorError> {
        let length = self.jobs[at].submission.elements.len();
        let others =
            self.jobs.iter().enumerate().any(|(i, job)| i != at && job.is_live(&self.open));
        if length == 1 && !others {
            self.forget(at, words)?;
            return Err(ExecutorError::Scheduler(format!("Slurm refuses the runs: {words}")));
        }
        if length > 1 {
            self.array_size = Some(length / 2);
            self.forget(at, words)?;
            self.submit.soon();
        }
        let words =
            format!("Slurm takes no more array elements at once ({words}); giving it fewer");
        self.note_once("too many", words);
        Ok(false)
    }

    /// Writes down that a job was not submitted.
    fn forget(&mut self, at: usize, words: &str) -> Result<(), ExecutorError> {
        let live: Vec<(usize, Vec<u64>)> = self.jobs[at].live(&self.open).collect();
        let losses: Vec<_> = live
            .into_iter()
            .map(|(element, runs)| self.jobs[at].loss(element, runs, words, false))
            .collect();
        self.losses.append(&losses)?;
        self.jobs[at].places.fill(Place::Over);
        self.jobs[at].sent = Sent::Yes;
        Ok(())
    }
}
