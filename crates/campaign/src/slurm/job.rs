//! A job array that is waited for.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use super::parse::Ending;
use super::submission::{Loss, Submission};

/// A run without an outcome.
#[derive(Debug)]
pub(super) struct Run {
    /// Number of times that it may be lost and made again.
    pub(super) retries: u32,
    /// Whether it counts as failed where it is lost more often.
    pub(super) fails_when_lost: bool,
    pub(super) timeout_s: f64,
    /// Number of times that it was lost.
    pub(super) lost: u32,
    /// Number of times that its worker could not do its work.
    pub(super) broken: u32,
    /// Whether its start was reported.
    pub(super) started: bool,
}

/// A job array with the states of its elements.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) submission: Submission,
    pub(super) sent: Sent,
    /// The number that Slurm gave it.
    pub(super) id: Option<u64>,
    /// State of each of its elements.
    pub(super) places: Vec<Place>,
    /// Whether an earlier driver submitted it.
    pub(super) adopted: bool,
    /// Whether it was counted as one that never was in the queue.
    pub(super) vanished: bool,
}

/// Whether sbatch took a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sent {
    /// The job is on disk, and sbatch has not taken it.
    NotYet,
    /// sbatch may have taken it.
    Perhaps,
    /// The job has a number, or was seen in the queue.
    Yes,
}

/// State of an array element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// The queue was not asked yet.
    Unknown,
    Waiting,
    Running,
    /// The element ended, or is not in the queue.
    Gone {
        since: Instant,
        /// Number of times that the queue reported so.
        looks: u32,
        ending: Option<Ending>,
    },
    /// Its runs are no longer waited for.
    Over,
}

impl Job {
    /// A job that was just written down.
    pub(super) fn new(submission: Submission) -> Self {
        let places = vec![Place::Unknown; submission.elements.len()];
        Self { submission, sent: Sent::NotYet, id: None, places, adopted: false, vanished: false }
    }

    /// A job that an earlier driver wrote down.
    pub(super) fn adopted(submission: Submission, dir: &Path, losses: &[Loss]) -> Self {
        let id = submission.job(dir);
        let sent = if id.is_some() { Sent::Yes } else { Sent::Perhaps };
        let mut places = vec![Place::Unknown; submission.elements.len()];
        for loss in losses.iter().filter(|loss| loss.submission == submission.number) {
            if let Some(place) = places.get_mut(loss.element as usize) {
                *place = Place::Over;
            }
        }
        // An earlier driver may have died before it called sbatch: that says nothing about Slurm.
        Self { submission, sent, id, places, adopted: true, vanished: true }
    }

    /// Elements that may still give outcomes of open runs, and these runs.
    pub(super) fn live<'a>(
        &'a self,
        open: &'a BTreeMap<u64, Run>,
    ) -> impl Iterator<Item = (usize, Vec<u64>)> + 'a {
        let elements = self.submission.elements.iter().zip(&self.places).enumerate();
        elements.filter(|(_, (_, place))| **place != Place::Over).filter_map(|(i, (runs, _))| {
            let runs: Vec<u64> =
                runs.iter().copied().filter(|run| open.contains_key(run)).collect();
            (!runs.is_empty()).then_some((i, runs))
        })
    }

    /// Whether it may still give outcomes of open runs.
    pub(super) fn is_live(&self, open: &BTreeMap<u64, Run>) -> bool {
        self.live(open).next().is_some()
    }

    /// The record of an element that is over without the outcomes of `runs`.
    pub(super) fn loss(&self, element: usize, runs: Vec<u64>, cause: &str, counts: bool) -> Loss {
        // An array has at most MaxArraySize elements, a number of 32 bits.
        let element = u32::try_from(element).unwrap_or(u32::MAX);
        Loss { submission: self.submission.number, element, runs, cause: cause.into(), counts }
    }

    /// The element as messages call it.
    pub(super) fn element_name(&self, element: usize) -> String {
        match self.id {
            Some(id) => format!("job {id}_{element}"),
            None => format!("job {}, element {element}", self.submission.name),
        }
    }
}
