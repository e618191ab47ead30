//! Runs as processes of this machine, a limited number at the same time.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::time::Duration;

use crate::attempt::{Ran, Runner};
use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::feed::Feed;
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

/// Longest time until a thread without a task sees that there will be none.
const GLANCE: Duration = Duration::from_millis(50);

enum News {
    Started(u64),
    Retried(u64, FailureKind),
    Ended(Task, Ran),
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
        match self.run_fed(campaign, &Feed::of(campaign, tasks)?, watch, stop) {
            Err(ExecutorError::Interrupted { .. }) if campaign.missing(tasks).is_empty() => Ok(()),
            ran => ran,
        }
    }

    fn run_fed(
        &mut self,
        campaign: &Campaign,
        feed: &Feed<'_>,
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        let runner = Runner {
            dir: campaign.dir(),
            spec: campaign.spec(),
            mark: Some(campaign.id()),
            workers: None,
            alone: true,
        };
        if !campaign.is_new() && campaign.first_look() {
            clean_up(campaign, &runner, watch);
        }
        let Some(first) = feed.next()? else { return Ok(()) };
        let slots = if feed.is_whole() { self.parallel.min(first.len()) } else { self.parallel };
        self.keep_workers(campaign);
        let runner = Runner { workers: self.workers.as_ref(), ..runner };
        let watchdog = runner.workers.is_none().then(|| Watchdog::of_runs(campaign.spec()));
        let (give, queue) = mpsc::channel();
        let (sender, receiver) = mpsc::channel();
        let (queue, open, halt) = (Mutex::new(queue), AtomicUsize::new(0), stop.child());
        let hall = Hall { runner: &runner, feed, queue, open, halt };
        let made = std::thread::scope(|scope| {
            let hall = &hall;
            for slot in 0..slots.max(1) {
                let sender = sender.clone();
                let started =
                    std::thread::Builder::new().spawn_scoped(scope, move || hall.work(&sender));
                match started {
                    Ok(_) => {}
                    Err(error) if slot == 0 => return Err(no_thread(&error)),
                    Err(error) => {
                        watch(Event::Note(format!(
                            "only {slot} runs at a time: the system gives no further thread ({error})"
                        )));
                        break;
                    }
                }
            }
            let fetch = move || hall.fetch(first, &give, &sender);
            if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, fetch) {
                hall.end();
                return Err(no_thread(&error));
            }
            hall.store_all(&receiver, watch)
        });
        drop(watchdog);
        let interrupted = || Err(ExecutorError::Interrupted { detached: false });
        let made = made.and_then(|()| if stop.asked() { interrupted() } else { Ok(()) });
        if made.is_err() {
            self.workers = None;
        }
        if self.workers.is_none() {
            strays::end_all();
        }
        made
    }
}

fn no_thread(error: &std::io::Error) -> ExecutorError {
    let program = "a thread of this program".into();
    ExecutorError::CannotStart { program, reason: error.to_string() }
}

/// Ends what a killed driver has left on this machine.
fn clean_up(campaign: &Campaign, runner: &Runner<'_>, watch: &mut dyn FnMut(Event)) {
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

/// What the threads share.
struct Hall<'a> {
    runner: &'a Runner<'a>,
    feed: &'a Feed<'a>,
    queue: Mutex<mpsc::Receiver<Task>>,
    /// Number of tasks in the queue and in work.
    open: AtomicUsize,
    /// Asked for by the caller, or by a failure after which no further run makes sense.
    halt: Stop,
}

impl Hall<'_> {
    /// No further run is made.
    fn end(&self) {
        self.halt.cancel();
        self.feed.leave();
    }

    /// Takes tasks from the feed until there are none any more.
    fn fetch(&self, first: Vec<Task>, give: &mpsc::Sender<Task>, sender: &mpsc::Sender<News>) {
        let mut fetched = Some(first);
        while let Some(tasks) = fetched {
            self.open.fetch_add(tasks.len(), Ordering::SeqCst);
            // Nobody listens any more only where no further run is made.
            tasks.into_iter().for_each(|task| drop(give.send(task)));
            fetched = self.feed.next().unwrap_or_else(|error| {
                drop(sender.send(News::Gone(error.into())));
                None
            });
        }
        // Nobody waits for what is still in work.
        self.halt.cancel();
    }

    /// The next task; none where no further run is to be made.
    fn next(&self) -> Option<Task> {
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        while !self.halt.asked() {
            match queue.recv_timeout(GLANCE) {
                Ok(task) => return Some(task),
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) => return None,
            }
        }
        // Asked for by the caller: nothing more is taken from the feed.
        self.feed.leave();
        None
    }

    /// Makes one run after the other until all are made, or no further one is to be made.
    fn work(&self, sender: &mpsc::Sender<News>) {
        // Nobody listens any more only where the caller has failed.
        let tell = |news| drop(sender.send(news));
        while let Some(task) = self.next() {
            let number = task.number;
            tell(News::Started(number));
            let lost = |kind: &FailureKind| tell(News::Retried(number, kind.clone()));
            match self.runner.run(&task, &self.halt, lost) {
                Ok(ran) => tell(News::Ended(task, ran)),
                Err(ExecutorError::Interrupted { .. }) => {}
                Err(ExecutorError::Lost { cause, detail, .. }) => {
                    tell(News::GivenUp(number, cause, detail));
                }
                Err(error) => return tell(News::Gone(error)),
            }
        }
    }

    /// Stores what arrives, until every thread is done. After a failure what still arrives is stored, if
    /// it can be, and then the failure is returned.
    fn store_all(
        &self,
        receiver: &mpsc::Receiver<News>,
        watch: &mut dyn FnMut(Event),
    ) -> Result<(), ExecutorError> {
        let mut failure: Option<ExecutorError> = None;
        let mut fail = |error: ExecutorError| {
            self.end();
            failure.get_or_insert(error);
        };
        let (mut lost, mut first_lost) = (Vec::new(), None);
        let campaign = self.feed.campaign();
        let mut mailbox = Mailbox::new(campaign);
        let safe = |ended: Vec<(Task, Ran)>, watch: &mut dyn FnMut(Event)| {
            for (task, ran) in ended {
                self.runner.tidy(&task, &ran);
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
                    News::Ended(task, ran) => {
                        self.open.fetch_sub(1, Ordering::SeqCst);
                        ended.push((task.number, ran.outcome.clone(), (task, ran)));
                    }
                    News::GivenUp(number, cause, detail) => {
                        self.open.fetch_sub(1, Ordering::SeqCst);
                        lost.push(number);
                        first_lost.get_or_insert((cause, detail));
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
            self.feed.look();
            let none_left = !lost.is_empty() && self.open.load(Ordering::SeqCst) == 0;
            if none_left || lost.len() >= LOST_MOST {
                self.end();
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
}
