//! Runs as processes of this machine, a limited number at the same time.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

use crate::attempt::{Ran, Runner};
use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::leftover;
use crate::mailbox::Mailbox;
use crate::outcome::FailureKind;
use crate::persistent::Workers;
use crate::strays::{self, Watchdog};
use crate::task::Task;

/// Number of runs that may be lost too often before no further one is made.
const LOST_MOST: usize = 12;

/// Runs tasks as local processes.
///
/// On Linux this process adopts what its runs leave behind (it becomes a child subreaper), to end it after them.
///
/// Before the first run in a directory that was opened again, it ends the processes that a killed
/// driver of this directory has left on this machine.
///
/// Workers ([`Call::worker`](crate::Call::worker)) stay from one call of [`run`](Executor::run) to the next, as many per
/// command as there are runs at the same time. They are ended with this, or when a call has an error.
#[derive(Debug)]
pub struct Local {
    parallel: usize,
    workers: Option<Workers>,
}

impl Local {
    /// An executor of so many runs at the same time, at least 1.
    #[must_use]
    pub fn new(parallel: usize) -> Self {
        Self { parallel, workers: None }
    }

    /// Has workers ready for the campaign where one of its commands needs them.
    fn keep_workers(&mut self, campaign: &Campaign) {
        let (dir, id, spec) = (campaign.dir(), campaign.id(), campaign.spec());
        if !self.workers.as_ref().is_some_and(|workers| workers.are_of(dir, id)) {
            self.workers = None;
            let needed = spec.commands.iter().any(|command| command.call.worker);
            self.workers = needed.then(|| Workers::new(dir, id, spec));
        }
    }
}

enum News {
    Started(u64),
    Retried(u64, FailureKind),
    Ended(usize, Ran),
    /// Lost too often.
    GivenUp(u64, String, String),
    Gone(ExecutorError),
}

impl Executor for Local {
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        campaign.record_submitted(tasks)?;
        let missing = campaign.missing(tasks);
        let runner = Runner {
            dir: campaign.dir(),
            spec: campaign.spec(),
            mark: Some(campaign.id()),
            workers: None,
            alone: true,
        };
        clear_up(campaign, &runner, watch);
        if missing.is_empty() {
            return Ok(());
        }
        self.keep_workers(campaign);
        let runner = Runner { workers: self.workers.as_ref(), ..runner };
        let next = AtomicUsize::new(0);
        let (sender, receiver) = mpsc::channel();
        // Asked for by the caller, or by a failure after which no further run makes sense.
        let halt = stop.child();
        let watchdog = runner.workers.is_none().then(|| Watchdog::of_runs(campaign.spec()));
        let made = std::thread::scope(|scope| {
            for slot in 0..self.parallel.clamp(1, missing.len()) {
                let sender = sender.clone();
                let (runner, missing, next, halt) = (&runner, &missing, &next, &halt);
                let work = move || work(runner, missing, next, halt, &sender);
                let started = std::thread::Builder::new().spawn_scoped(scope, work);
                match started {
                    Ok(_) => {}
                    Err(error) if slot == 0 => {
                        return Err(ExecutorError::CannotStart {
                            program: "a thread of this program".into(),
                            reason: error.to_string(),
                        });
                    }
                    Err(error) => {
                        watch(Event::Note(format!(
                            "only {slot} runs at a time: the system gives no further thread ({error})"
                        )));
                        break;
                    }
                }
            }
            drop(sender);
            let stored = store_all(campaign, &runner, &missing, &receiver, watch, &halt);
            if stored.is_err() {
                halt.cancel();
            }
            stored
        });
        drop(watchdog);
        let made = made.and_then(|()| {
            let all = campaign.missing(tasks).is_empty();
            if all { Ok(()) } else { Err(ExecutorError::Interrupted { detached: false }) }
        });
        if made.is_err() {
            self.workers = None;
        }
        if self.workers.is_none() {
            strays::end_all();
        }
        made
    }
}

/// Ends and removes what an earlier driver of the campaign has left, once.
fn clear_up(campaign: &Campaign, runner: &Runner<'_>, watch: &mut dyn FnMut(Event)) {
    if campaign.is_new() || !campaign.first_look() {
        return;
    }
    let ended = leftover::end(campaign.id());
    if ended > 0 {
        watch(Event::Note(format!(
            "ended {ended} processes that a killed driver of this directory had left"
        )));
    }
    for task in campaign.tasks() {
        if let Some(outcome) = campaign.outcome(task.number) {
            runner.sweep(&task, &outcome);
        }
    }
}

/// Makes one run after the other until all are made, or no further one is to be made.
fn work(
    runner: &Runner<'_>,
    tasks: &[Task],
    next: &AtomicUsize,
    halt: &Stop,
    sender: &mpsc::Sender<News>,
) {
    // Nobody listens any more only where the caller has failed.
    let tell = |news| drop(sender.send(news));
    while !halt.asked() {
        let place = next.fetch_add(1, Ordering::Relaxed);
        let Some(task) = tasks.get(place) else { return };
        tell(News::Started(task.number));
        let lost = |kind: &FailureKind| tell(News::Retried(task.number, kind.clone()));
        match runner.run(task, halt, lost) {
            Ok(ran) => tell(News::Ended(place, ran)),
            Err(ExecutorError::Interrupted { .. }) => return,
            Err(ExecutorError::Lost { cause, detail, .. }) => {
                tell(News::GivenUp(task.number, cause, detail));
            }
            Err(error) => return tell(News::Gone(error)),
        }
    }
}

/// Stores what arrives, until every thread is done. After a failure what still arrives is stored, if
/// it can be, and then the failure is returned.
fn store_all(
    campaign: &Campaign,
    runner: &Runner<'_>,
    tasks: &[Task],
    receiver: &mpsc::Receiver<News>,
    watch: &mut dyn FnMut(Event),
    halt: &Stop,
) -> Result<(), ExecutorError> {
    let mut failure: Option<ExecutorError> = None;
    let mut fail = |error: ExecutorError| {
        halt.cancel();
        failure.get_or_insert(error);
    };
    let (mut lost, mut first_lost) = (Vec::new(), None);
    let mut mailbox = Mailbox::new(campaign);
    let safe = |ended: Vec<(usize, Ran)>, watch: &mut dyn FnMut(Event)| {
        for (place, ran) in ended {
            let task = &tasks[place];
            runner.tidy(task, &ran);
            let failed = ran.outcome.failure().cloned();
            watch(Event::Ended { number: task.number, failed });
        }
    };
    while let Some(news) = mailbox.receive(receiver) {
        let mut ended = Vec::new();
        for news in news {
            match news {
                News::Started(number) => watch(Event::Started { number }),
                News::Retried(number, kind) => watch(Event::Retried { number, kind }),
                News::Ended(place, ran) => {
                    ended.push((tasks[place].number, ran.outcome.clone(), (place, ran)));
                }
                News::GivenUp(number, cause, detail) => {
                    lost.push(number);
                    first_lost.get_or_insert((cause, detail));
                    if lost.len() >= LOST_MOST {
                        halt.cancel();
                    }
                }
                News::Gone(error) => fail(error),
            }
        }
        let stored = mailbox.write(ended).and_then(|()| mailbox.flush_if_due());
        match stored {
            Ok(ended) => safe(ended, watch),
            Err(error) => fail(error.into()),
        }
        if let Some(outage) = campaign.outage() {
            fail(outage);
        }
    }
    match mailbox.flush() {
        Ok(ended) => safe(ended, watch),
        Err(error) => fail(error.into()),
    }
    if let Some((cause, detail)) = first_lost {
        lost.sort_unstable();
        fail(ExecutorError::Lost { numbers: lost, cause, detail });
    }
    failure.map_or(Ok(()), Err)
}
