//! Tasks that are placed while others run.
//!
//! Two threads take turns: a giver, which places tasks from the outcomes of some earlier ones, and an executor. While the
//! giver waits for outcomes, what it has given runs; what it gives depends on which outcomes it waited for, never on which
//! of the others were there.

use std::collections::HashSet;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use crate::campaign::Campaign;
use crate::error::{CampaignError, ExecutorError};
use crate::task::Task;

/// Tasks on their way from a giver to an executor ([`Executor::run_fed`](crate::Executor::run_fed)).
#[derive(Debug)]
pub struct Feed<'a> {
    campaign: &'a Campaign,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// Numbers of all tasks that were given.
    given: HashSet<u64>,
    /// Those that the executor has not taken.
    new: Vec<Task>,
    /// Whether the giver waits, and for which runs; the first `ended` of them have ended.
    waits: bool,
    wanted: Vec<u64>,
    ended: usize,
    /// Whether nothing more is given, once what is wanted has ended.
    last: bool,
    /// Whether the giver is gone.
    closed: bool,
    /// Whether the executor takes nothing more.
    left: bool,
    /// Whether the executor is gone, and why.
    gone: bool,
    failure: Option<ExecutorError>,
}

impl<'a> Feed<'a> {
    /// A feed that nothing was given to.
    #[must_use]
    pub fn new(campaign: &'a Campaign) -> Self {
        Self { campaign, state: Mutex::default(), changed: Condvar::new() }
    }

    /// The directory of the runs.
    pub(crate) fn campaign(&self) -> &'a Campaign {
        self.campaign
    }

    /// Whether everything was given at its beginning.
    pub(crate) fn is_whole(&self) -> bool {
        self.state().last
    }

    /// A feed of these tasks and no other.
    ///
    /// # Errors
    ///
    /// As [`Campaign::record_submitted`].
    pub fn of(campaign: &'a Campaign, tasks: &[Task]) -> Result<Self, CampaignError> {
        let feed = Self::new(campaign);
        feed.give(tasks)?;
        {
            let mut state = feed.state();
            state.wanted = tasks.iter().map(|task| task.number).collect();
            (state.waits, state.last) = (true, true);
        }
        Ok(feed)
    }

    /// Stores tasks ([`Campaign::record_submitted`]) and gives them to the executor, those that were not given before.
    ///
    /// # Errors
    ///
    /// As [`Campaign::record_submitted`].
    pub fn give(&self, tasks: &[Task]) -> Result<(), CampaignError> {
        self.campaign.record_submitted(tasks)?;
        let mut state = self.state();
        let new: Vec<Task> =
            tasks.iter().filter(|task| state.given.insert(task.number)).cloned().collect();
        state.new.extend(new);
        Ok(())
    }

    /// Gives tasks, and waits until each of them has an outcome.
    ///
    /// # Errors
    ///
    /// The executor's, where it stopped before.
    pub fn wait(&self, tasks: &[Task]) -> Result<(), ExecutorError> {
        self.give(tasks)?;
        let mut state = self.state();
        state.wanted = tasks.iter().map(|task| task.number).collect();
        (state.ended, state.waits) = (0, true);
        self.changed.notify_all();
        while state.waits && !state.gone {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if state.waits && !self.has_ended(&mut state) {
            let failure = state.failure.take();
            return Err(failure.unwrap_or(ExecutorError::Interrupted { detached: false }));
        }
        state.waits = false;
        Ok(())
    }

    /// Says that nothing more is given, and nobody waits for what was.
    pub fn close(&self) {
        self.state().closed = true;
        self.changed.notify_all();
    }

    /// Same as [`close`](Self::close), and waits until the executor is gone: then nothing runs any more. For feeds that one is
    /// [serving](Self::serve).
    pub fn finish(&self) {
        self.close();
        let state = self.state();
        let gone = self.changed.wait_while(state, |state| !state.gone);
        drop(gone.unwrap_or_else(PoisonError::into_inner));
    }

    /// For executors: the tasks that were given since the last call and have no outcome; waits until there are some, and gives
    /// none once nothing more is to be run.
    ///
    /// # Errors
    ///
    /// A failed write.
    pub fn next(&self) -> Result<Option<Vec<Task>>, CampaignError> {
        self.take(true)
    }

    /// Same as [`next`](Self::next), but waits for the giver's turn alone: the tasks are empty where it waits for outcomes
    /// that are not there yet.
    ///
    /// # Errors
    ///
    /// A failed write.
    pub fn now(&self) -> Result<Option<Vec<Task>>, CampaignError> {
        self.take(false)
    }

    /// For executors: tells a thread in [`next`](Self::next) that outcomes were stored.
    pub fn look(&self) {
        // Whoever waits holds the lock between its own look and its sleep.
        drop(self.state());
        self.changed.notify_all();
    }

    /// For executors: nothing more is taken, whoever asks for it.
    pub fn leave(&self) {
        self.state().left = true;
        self.changed.notify_all();
    }

    /// Keeps why the executor failed, for whoever waits.
    pub(crate) fn fail(&self, error: ExecutorError) {
        self.state().failure = Some(error);
    }

    /// Nobody shall wait for an executor that is gone.
    pub(crate) fn end(&self) {
        self.state().gone = true;
        self.changed.notify_all();
    }

    fn take(&self, patient: bool) -> Result<Option<Vec<Task>>, CampaignError> {
        let mut state = self.state();
        loop {
            if state.closed || state.left {
                return Ok(None);
            }
            if state.waits {
                if !self.has_ended(&mut state) {
                    let new = self.campaign.missing(&std::mem::take(&mut state.new));
                    if !(patient && new.is_empty()) {
                        return Ok(Some(new));
                    }
                } else if state.last {
                    return Ok(None);
                } else {
                    // What is placed from outcomes must not be safer than they are.
                    self.campaign.flush_outcomes()?;
                    state.waits = false;
                    self.changed.notify_all();
                }
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Whether all that is waited for has ended.
    fn has_ended(&self, state: &mut State) -> bool {
        let rest = &state.wanted[state.ended..];
        state.ended +=
            rest.iter().take_while(|number| self.campaign.outcome(**number).is_some()).count();
        state.ended == state.wanted.len()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Every change of the state is whole before anything can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
