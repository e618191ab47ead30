//! Runs of a simulator in this process, on a pool of threads.

use std::sync::mpsc;
use std::time::Instant;

use rayon::prelude::*;

use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::mailbox::Mailbox;
use crate::outcome::{FailureKind, Outcome};
use crate::task::Task;

/// Failure of a simulator in this process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fault {
    /// These parameters cannot be simulated. Give the same words for the same cause: failures are counted by them.
    Run(String),
    /// No run can succeed: the executor stops, and no outcome is stored for this run.
    Fatal(String),
}

/// Runs tasks by a function, on a pool of threads of its own.
///
/// The function gives the values of all observables of the task's command, one after the other.
pub struct InProcess<F> {
    simulate: F,
    pool: rayon::ThreadPool,
}

impl<F> InProcess<F>
where
    F: Fn(&Task) -> Result<Vec<f64>, Fault> + Sync,
{
    /// An executor that calls `simulate` on `threads` threads; 0 for as many as the machine has.
    ///
    /// # Errors
    ///
    /// [`ExecutorError::CannotStart`] where the system gives no threads.
    pub fn new(threads: usize, simulate: F) -> Result<Self, ExecutorError> {
        let pool =
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| {
                ExecutorError::CannotStart {
                    program: format!("{threads} threads"),
                    reason: error.to_string(),
                }
            })?;
        Ok(Self { simulate, pool })
    }

    fn simulate(&self, task: &Task) -> Result<Outcome, String> {
        let start = Instant::now();
        let result = (self.simulate)(task);
        let seconds = start.elapsed().as_secs_f64();
        let failed = |kind, detail| Outcome::Failed { kind, detail, attempts: 1, seconds };
        match result {
            Ok(values) => Ok(match values.iter().position(|value| !value.is_finite()) {
                None => Outcome::Finished { values, attempts: 1, seconds },
                Some(place) => failed(
                    FailureKind::NotANumber { file: None, column: "an output".into() },
                    format!("output {place} is {}", values[place]),
                ),
            }),
            Err(Fault::Run(cause)) => Ok(failed(FailureKind::Simulator { cause }, String::new())),
            Err(Fault::Fatal(cause)) => Err(cause),
        }
    }
}

impl<F> Executor for InProcess<F>
where
    F: Fn(&Task) -> Result<Vec<f64>, Fault> + Sync,
{
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        campaign.record_submitted(tasks)?;
        let missing = campaign.missing(tasks);
        let (sender, receiver) = mpsc::channel();
        // Set where nothing further may be started: asked for, or after a failure.
        let halt = stop.child();
        std::thread::scope(|scope| {
            let this = &*self;
            let (missing, halt) = (&missing, &halt);
            scope.spawn(move || {
                this.pool.install(|| {
                    missing.par_iter().for_each_with(sender, |sender, task| {
                        if !halt.asked() {
                            let result = this.simulate(task);
                            if result.is_err() {
                                halt.cancel();
                            }
                            // Nobody listens any more only where the caller has failed.
                            let _ = sender.send((task.number, result));
                        }
                    });
                });
            });
            let stored = store_all(campaign, &receiver, watch);
            if stored.is_err() {
                halt.cancel();
            }
            stored
        })?;
        if stop.asked() && !campaign.missing(tasks).is_empty() {
            return Err(ExecutorError::Interrupted { detached: false });
        }
        Ok(())
    }
}

type Ended = (u64, Result<Outcome, String>);

/// Stores what arrives, until every sender is gone.
fn store_all(
    campaign: &Campaign,
    receiver: &mpsc::Receiver<Ended>,
    watch: &mut dyn FnMut(Event),
) -> Result<(), ExecutorError> {
    let mut fatal = None;
    let mut mailbox = Mailbox::new(campaign);
    while let Some(news) = mailbox.receive(receiver) {
        let mut ended = Vec::new();
        for (number, result) in news {
            match result {
                Ok(outcome) => {
                    let failed = outcome.failure().cloned();
                    ended.push((number, outcome, Event::Ended { number, failed }));
                }
                Err(cause) => _ = fatal.get_or_insert(cause),
            }
        }
        mailbox.write(ended)?;
        mailbox.flush_if_due()?.into_iter().for_each(&mut *watch);
    }
    mailbox.flush()?.into_iter().for_each(&mut *watch);
    fatal.map_or(Ok(()), |cause| Err(ExecutorError::Simulator(cause)))
}
