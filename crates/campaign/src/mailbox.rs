//! Outcomes on their way from threads to the journal.
//!
//! An outcome is written as soon as it arrives, so that it survives a killed driver. Only a flush survives a crash of the
//! machine. It costs milliseconds, so that outcomes that arrive within a short time share one: a crash costs at most the
//! outcomes of that time.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::campaign::Campaign;
use crate::error::CampaignError;
use crate::outcome::Outcome;

/// Shortest time between two flushes.
const SHARED: Duration = Duration::from_millis(100);

/// Writes outcomes, and keeps a value with each until it is flushed.
pub(crate) struct Mailbox<'a, T> {
    campaign: &'a Campaign,
    written: Vec<T>,
    flushed: Option<Instant>,
}

impl<'a, T> Mailbox<'a, T> {
    pub(crate) fn new(campaign: &'a Campaign) -> Self {
        Self { campaign, written: Vec::new(), flushed: None }
    }

    /// Waits for news or until a flush is due, and returns the news; none once all senders are gone.
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

    /// Flushes if a flush is due, and returns the values of the outcomes that are now safe.
    pub(crate) fn flush_if_due(&mut self) -> Result<Vec<T>, CampaignError> {
        if self.written.is_empty() || !self.patience().is_zero() {
            return Ok(Vec::new());
        }
        self.flush()
    }

    /// Flushes, and returns the values of the outcomes that are now safe.
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
