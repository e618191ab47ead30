//! Outcomes on their way from threads to the journal.
//!
//! Each is written as soon as it arrives, which a killed driver survives. What a crash of the machine survives, a
//! flush, costs milliseconds, and is therefore shared by what arrives within a short time: the runs
//! that such a crash can cost took less than that.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::campaign::Campaign;
use crate::error::CampaignError;
use crate::outcome::Outcome;

/// Outcomes are flushed at once where the last flush was longer ago than this, else at the end of it.
const SHARED: Duration = Duration::from_millis(100);

/// Writes outcomes, and keeps with each what is to be done once it is flushed.
pub(crate) struct Mailbox<'a, T> {
    campaign: &'a Campaign,
    written: Vec<T>,
    flushed: Option<Instant>,
}

impl<'a, T> Mailbox<'a, T> {
    pub(crate) fn new(campaign: &'a Campaign) -> Self {
        Self { campaign, written: Vec::new(), flushed: None }
    }

    /// What has arrived: waits until there is something, or a flush is due. None at the end.
    pub(crate) fn receive<N>(&self, receiver: &Receiver<N>) -> Option<Vec<N>> {
        let first = if self.written.is_empty() {
            Some(receiver.recv().ok()?)
        } else {
            match receiver.recv_timeout(self.patience()) {
                Ok(news) => Some(news),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        };
        Some(first.into_iter().chain(receiver.try_iter()).collect())
    }

    /// Writes outcomes.
    pub(crate) fn write(&mut self, ended: Vec<(u64, Outcome, T)>) -> Result<(), CampaignError> {
        let mut outcomes = Vec::with_capacity(ended.len());
        let mut rest = Vec::with_capacity(ended.len());
        for (number, outcome, and) in ended {
            outcomes.push((number, outcome));
            rest.push(and);
        }
        self.campaign.write_outcomes(outcomes)?;
        self.written.append(&mut rest);
        Ok(())
    }

    /// Flushes if it is time to, and gives what belongs to the outcomes that are safe by it.
    pub(crate) fn flush_if_due(&mut self) -> Result<Vec<T>, CampaignError> {
        if self.written.is_empty() || !self.patience().is_zero() {
            return Ok(Vec::new());
        }
        self.flush()
    }

    /// Flushes, and gives what belongs to the outcomes that are safe by it.
    pub(crate) fn flush(&mut self) -> Result<Vec<T>, CampaignError> {
        if !self.written.is_empty() {
            self.campaign.flush_outcomes()?;
            self.flushed = Some(Instant::now());
        }
        Ok(std::mem::take(&mut self.written))
    }

    fn patience(&self) -> Duration {
        self.flushed.map_or(Duration::ZERO, |at| SHARED.saturating_sub(at.elapsed()))
    }
}
