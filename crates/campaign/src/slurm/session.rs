//! The loop that submits what is missing, looks for outcomes, asks the queue, and finds what is lost.

use std::collections::{BTreeMap, BTreeSet};
use std::thread;
use std::time::{Duration, Instant};

use super::cluster::Cluster;
use super::job::{Job, Place, Run, Sent};
use super::submission::{self, LOSSES, Loss, Submission};
use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Request, Stop};
use crate::feed::Feed;
use crate::files;
use crate::folder::SLURM;
use crate::journal::Journal;
use crate::spec::LostRuns;

/// A call of [`Slurm::run`](crate::Executor::run).
pub(super) struct Session<'a> {
    pub(super) cluster: &'a Cluster,
    pub(super) campaign: &'a Campaign,
    /// What is to be run.
    feed: &'a Feed<'a>,
    pub(super) watch: &'a mut dyn FnMut(Event),
    pub(super) stop: &'a Stop,
    /// Runs without an outcome.
    pub(super) open: BTreeMap<u64, Run>,
    /// Job arrays with elements that may still give outcomes of them.
    pub(super) jobs: Vec<Job>,
    /// Number of the next submission.
    pub(super) next_number: u32,
    pub(super) losses: Journal,
    /// Runs that shall not share an array element any more: one of those in it needs too much.
    pub(super) alone: BTreeSet<u64>,
    /// The most elements of an array that Slurm takes, as far as it is known.
    pub(super) array_size: Option<usize>,
    /// Runs whose worker cannot do its work, and what it said.
    pub(super) stuck: BTreeMap<u64, String>,
    /// Runs that were lost too often, and how.
    pub(super) given_up: BTreeMap<u64, String>,
    /// Array elements whose worker could not do its work.
    pub(super) broken: u32,
    /// Submissions in a row that never appeared in the queue.
    pub(super) vanished: u32,
    /// Outcomes that came since this began.
    pub(super) ended: usize,
    /// Why jobs in the queue can never start, and what helps.
    pub(super) hopeless: Option<String>,
    /// Whether the queue did not answer the last time.
    pub(super) queue_silent: bool,
    /// Whether the cluster keeps accounts.
    pub(super) accounts: bool,
    pub(super) queue: Clock,
    pub(super) look: Clock,
    pub(super) submit: Clock,
    said: BTreeSet<String>,
}

/// When something is due again: soon at first, then ever less often.
#[derive(Debug)]
pub(super) struct Clock {
    due: Instant,
    wait: Duration,
    least: Duration,
    most: Duration,
}

impl Clock {
    fn new(least_s: f64, most_s: f64) -> Self {
        let least = Duration::from_secs_f64(least_s);
        let most = Duration::from_secs_f64(most_s.max(least_s));
        Self { due: Instant::now(), wait: least, least, most }
    }

    pub(super) fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Done: the next time is later than the last.
    pub(super) fn done(&mut self) {
        self.due = Instant::now() + self.wait;
        self.wait = self.wait.mul_f64(1.5).min(self.most);
    }

    /// Something happened: soon again.
    pub(super) fn soon(&mut self) {
        self.wait = self.least;
        self.due = self.due.min(Instant::now() + self.wait);
    }
}

impl<'a> Session<'a> {
    pub(super) fn begin(
        cluster: &'a Cluster,
        feed: &'a Feed<'a>,
        watch: &'a mut dyn FnMut(Event),
        stop: &'a Stop,
    ) -> Result<Self, ExecutorError> {
        let campaign = feed.campaign();
        let dir = campaign.dir();
        if dir.to_str().is_none_or(|dir| dir.contains(char::is_control)) {
            let words =
                format!("{dir:?}: Slurm takes plain text as a directory; choose another name");
            return Err(ExecutorError::Scheduler(words));
        }
        let settings = &cluster.settings;
        let folder = dir.join(SLURM);
        files::make_folder(&folder)?;
        let path = folder.join(LOSSES);
        if !path.exists() {
            files::write(&path, b"")?;
        }
        let (losses, lost, damage) = Journal::open::<Loss>(&path)?;
        for damage in damage {
            watch(Event::Note(damage.to_string()));
        }
        let (submissions, next_number) = submission::read_all(dir)?;
        let poll_max = settings.poll_max_s;
        let mut session = Self {
            cluster,
            campaign,
            watch,
            stop,
            feed,
            open: BTreeMap::new(),
            jobs: Vec::new(),
            next_number,
            losses,
            alone: BTreeSet::new(),
            array_size: None,
            stuck: BTreeMap::new(),
            given_up: BTreeMap::new(),
            broken: 0,
            vanished: 0,
            ended: 0,
            hopeless: None,
            queue_silent: false,
            accounts: true,
            queue: Clock::new(settings.poll_min_s, poll_max),
            look: Clock::new(settings.poll_min_s, poll_max.min(10.0 * settings.poll_min_s)),
            submit: Clock::new(settings.poll_min_s, poll_max),
            said: BTreeSet::new(),
        };
        session.admit()?;
        session.adopt(submissions, &lost);
        Ok(session)
    }

    /// Takes the tasks that were given since the last time; false where nothing more is to be run.
    fn admit(&mut self) -> Result<bool, ExecutorError> {
        let Some(tasks) = self.feed.now()? else { return Ok(false) };
        for task in tasks {
            let command = self.campaign.spec().commands.get(task.command);
            let Some(call) = command.map(|command| &command.call) else { continue };
            let fails_when_lost = call.lost == LostRuns::Fail;
            let (retries, timeout_s) = (call.retries, call.timeout_s);
            let run =
                Run { retries, fails_when_lost, timeout_s, lost: 0, broken: 0, started: false };
            self.open.insert(task.number, run);
            self.submit.soon();
        }
        Ok(true)
    }

    /// Takes up what an earlier driver submitted, as far as its runs are still open.
    fn adopt(&mut self, submissions: Vec<Submission>, losses: &[Loss]) {
        for loss in losses.iter().filter(|loss| loss.counts) {
            for run in &loss.runs {
                if let Some(run) = self.open.get_mut(run) {
                    run.lost += 1;
                }
            }
        }
        for submission in submissions {
            // Another name: the directory was copied or moved, and its jobs, if there are any, write elsewhere.
            if submission.name == submission::job_name(self.campaign, submission.number) {
                let job = Job::adopted(submission, self.campaign.dir(), losses);
                if job.is_live(&self.open) {
                    self.jobs.push(job);
                }
            }
        }
    }

    pub(super) fn run(mut self) -> Result<(), ExecutorError> {
        loop {
            if self.look.is_due() {
                self.collect()?;
            }
            if !self.admit()? {
                // Nobody waits for what still runs.
                return if self.open.is_empty() { Ok(()) } else { self.cancel() };
            }
            if let Some(outage) = self.campaign.outage() {
                // The others wait for the same, or fail by it.
                return self.cancel().and(Err(outage));
            }
            match self.stop.request() {
                Request::Run => {}
                Request::Detach => return Err(ExecutorError::Interrupted { detached: true }),
                Request::Cancel => {
                    self.cancel()?;
                    return Err(ExecutorError::Interrupted { detached: false });
                }
            }
            if self.queue.is_due() {
                self.ask_queue()?;
                if let Some(words) = self.hopeless.take() {
                    return self.cancel().and(Err(ExecutorError::Scheduler(words)));
                }
                self.judge()?;
            }
            self.give_up()?;
            if self.submit.is_due() {
                self.submit_missing()?;
            }
            self.wait();
        }
    }

    /// Takes over the outcomes that are there.
    pub(super) fn collect(&mut self) -> Result<(), ExecutorError> {
        let collected = self.campaign.collect()?;
        for damage in &collected.damage {
            (self.watch)(Event::Note(format!("{damage}; its run is made again")));
        }
        self.look.done();
        let open: Vec<u64> = self.open.keys().copied().collect();
        for number in open {
            if let Some(outcome) = self.campaign.outcome(number) {
                self.open.remove(&number);
                self.stuck.remove(&number);
                self.given_up.remove(&number);
                self.ended += 1;
                self.look.soon();
                // Room for others, where only so many may run.
                self.submit.soon();
                (self.watch)(Event::Ended { number, failed: outcome.failure().cloned() });
            }
        }
        Ok(())
    }

    /// Cancels the jobs, waits until they are out of the queue, and keeps the outcomes they gave.
    pub(super) fn cancel(&mut self) -> Result<(), ExecutorError> {
        let deadline = Instant::now() + self.cluster.client.patience;
        for job in
            self.jobs.iter().filter(|job| job.sent != Sent::NotYet && job.is_live(&self.open))
        {
            if self.cluster.client.cancel(&job.submission.name).is_err() {
                let name = &job.submission.name;
                let words = format!("scancel failed; the job may go on: scancel --name={name}");
                (self.watch)(Event::Note(words));
            }
        }
        let mut pause = Duration::from_millis(100);
        while Instant::now() < deadline && !self.all_gone()? {
            thread::sleep(pause);
            pause = pause.mul_f64(1.5).min(Duration::from_secs(2));
        }
        self.collect()?;
        // So that the next driver need not look for them.
        let mut losses = Vec::new();
        for job in &self.jobs {
            for (element, runs) in job.live(&self.open) {
                if matches!(job.places[element], Place::Gone { .. }) || job.sent == Sent::NotYet {
                    losses.push(job.loss(element, runs, "was cancelled by this program", false));
                }
            }
        }
        self.losses.append(&losses)?;
        Ok(())
    }

    /// Whether the queue has none of the jobs any more.
    fn all_gone(&mut self) -> Result<bool, ExecutorError> {
        self.ask_queue()?;
        let waited_for = |job: &Job| {
            job.live(&self.open).any(|(element, _)| {
                job.sent != Sent::NotYet && !matches!(job.places[element], Place::Gone { .. })
            })
        };
        Ok(!self.queue_silent && !self.jobs.iter().any(waited_for))
    }

    fn wait(&self) {
        let asked = self.stop.request();
        while self.stop.request() == asked
            && !(self.queue.is_due() || self.look.is_due() || self.submit.is_due())
        {
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Tells the user something, but not again and again.
    pub(super) fn note_once(&mut self, topic: &str, words: String) {
        if self.said.insert(topic.to_owned()) {
            (self.watch)(Event::Note(words));
        }
    }
}
