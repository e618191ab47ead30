//! A cluster of simulated time, on which nothing runs: to see what a driver costs, and what it makes of many slots.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap, VecDeque};
use std::f64::consts::TAU;

use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor, Stop};
use crate::feed::Feed;
use crate::mailbox::Mailbox;
use crate::outcome::{FailureKind, Outcome};
use crate::task::Task;

/// How long runs take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RunTimes {
    /// All the same.
    Equal,
    /// Log-normal: the standard deviation of the logarithm.
    LogNormal(f64),
}

/// What is simulated of a run.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulatedRun {
    /// It gives these values.
    Values(Vec<f64>),
    /// It fails.
    Fails,
}

/// Time on the slots of a [`Simulated`] cluster, in units of the mean run time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Account {
    /// Until the last run ended.
    pub until_end: f64,
    /// Until the last run began: from then on slots are free for others.
    pub until_last_start: f64,
    /// Time in which slots worked, summed over them.
    pub worked: f64,
    /// The same until the last run began.
    pub worked_until_last_start: f64,
    /// Attempts that were lost.
    pub lost: u64,
}

/// Runs tasks on slots that only wait, in simulated time.
///
/// A run's time, its failing and its losses follow from `seed`, its number and attempt, whatever runs beside it. Placing tasks
/// takes no simulated time. Slots take tasks in the order in which they were given; a lost attempt goes back to the end of
/// the queue.
pub struct Simulated<F> {
    /// Number of runs at the same time, at least 1.
    pub slots: usize,
    /// How long runs take; the mean is 1.
    pub run_times: RunTimes,
    /// Probability that an attempt is lost, after a uniform share of its time; below 1.
    pub loss: f64,
    /// Seed of run times and losses.
    pub seed: u64,
    /// What a run comes to.
    pub outcome: F,
    /// What the slots did, over all calls.
    pub account: Account,
}

/// An end of an attempt: the time in units of 2^-32 of the mean run time, and the run.
type End = Reverse<(u64, u64)>;

/// A call.
struct Session<'a, F> {
    cluster: &'a mut Simulated<F>,
    queue: VecDeque<(Task, u32)>,
    /// Tasks on slots by run, with the attempt and whether it is lost.
    running: HashMap<u64, (Task, u32, bool)>,
    ends: BinaryHeap<End>,
    now: u64,
    /// Time in which slots worked, in the same units, until now and until the last start.
    worked: u128,
    worked_until_last_start: u128,
}

const UNIT: f64 = 4_294_967_296.0;

impl<F: Fn(&Task) -> SimulatedRun> Simulated<F> {
    /// A cluster without losses.
    pub fn new(slots: usize, run_times: RunTimes, seed: u64, outcome: F) -> Self {
        Self { slots, run_times, loss: 0.0, seed, outcome, account: Account::default() }
    }

    /// Time of an attempt, in units of the mean.
    ///
    /// # Formula
    ///
    /// 1, or exp(s n - s^2/2), n standard normal: the mean is 1.
    fn run_time(&self, number: u64, attempt: u32) -> f64 {
        match self.run_times {
            RunTimes::Equal => 1.0,
            RunTimes::LogNormal(s) => {
                // Box and Muller.
                let [u, v] = [0, 1].map(|k| self.uniform(number, attempt, k));
                let normal = (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos();
                (s * normal - 0.5 * s * s).exp()
            }
        }
    }

    /// A number in [0, 1) that belongs to an attempt: SplitMix64 of all that is given.
    fn uniform(&self, number: u64, attempt: u32, which: u64) -> f64 {
        let mut z = self.seed;
        for part in [number, u64::from(attempt), which] {
            z = z.wrapping_add(part.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^= z >> 31;
        }
        (z >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl<F: Fn(&Task) -> SimulatedRun> Session<'_, F> {
    /// Puts tasks on free slots.
    fn start(&mut self, watch: &mut dyn FnMut(Event)) {
        while self.running.len() < self.cluster.slots.max(1) {
            let Some((task, attempt)) = self.queue.pop_front() else { return };
            let number = task.number;
            let lost = self.cluster.uniform(number, attempt, 2) < self.cluster.loss;
            let share = if lost { self.cluster.uniform(number, attempt, 3) } else { 1.0 };
            let time = (share * self.cluster.run_time(number, attempt) * UNIT) as u64;
            self.ends.push(Reverse((self.now + time, number)));
            self.running.insert(number, (task, attempt, lost));
            self.worked_until_last_start = self.worked;
            self.cluster.account.until_last_start = self.now as f64 / UNIT;
            watch(Event::Started { number });
        }
    }

    /// Goes on to the next moment at which attempts end, and gives what came of them.
    fn end(&mut self, watch: &mut dyn FnMut(Event)) -> Vec<(u64, Outcome, Event)> {
        let mut ended = Vec::new();
        let Some(Reverse((time, _))) = self.ends.peek().copied() else { return ended };
        self.worked += u128::from(time - self.now) * self.running.len() as u128;
        self.now = time;
        while let Some(Reverse((at, number))) = self.ends.peek().copied() {
            if at > time {
                break;
            }
            self.ends.pop();
            let Some((task, attempt, lost)) = self.running.remove(&number) else { continue };
            if lost {
                self.cluster.account.lost += 1;
                watch(Event::Retried { number, kind: FailureKind::Lost { signal: None } });
                self.queue.push_back((task, attempt + 1));
                continue;
            }
            let seconds = self.cluster.run_time(number, attempt);
            let outcome = match (self.cluster.outcome)(&task) {
                SimulatedRun::Values(values) => {
                    Outcome::Finished { values, attempts: attempt, seconds }
                }
                SimulatedRun::Fails => {
                    let (kind, detail) = (FailureKind::ExitCode { code: 1 }, String::new());
                    Outcome::Failed { kind, detail, attempts: attempt, seconds }
                }
            };
            let failed = outcome.failure().cloned();
            ended.push((number, outcome, Event::Ended { number, failed }));
        }
        ended
    }
}

impl<F: Fn(&Task) -> SimulatedRun> Executor for Simulated<F> {
    fn run(
        &mut self,
        campaign: &Campaign,
        tasks: &[Task],
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        self.run_fed(campaign, &Feed::of(campaign, tasks)?, watch, stop)
    }

    fn run_fed(
        &mut self,
        campaign: &Campaign,
        feed: &Feed<'_>,
        watch: &mut dyn FnMut(Event),
        stop: &Stop,
    ) -> Result<(), ExecutorError> {
        let before = self.account;
        let mut session = Session {
            queue: VecDeque::new(),
            running: HashMap::new(),
            ends: BinaryHeap::new(),
            now: (before.until_end * UNIT) as u64,
            worked: (before.worked * UNIT) as u128,
            worked_until_last_start: (before.worked_until_last_start * UNIT) as u128,
            cluster: self,
        };
        let mut mailbox = Mailbox::new(campaign);
        let ended = loop {
            let Some(tasks) = feed.now()? else { break Ok(()) };
            session.queue.extend(tasks.into_iter().map(|task| (task, 1)));
            session.start(watch);
            let ended = session.end(watch);
            mailbox.write(ended)?;
            mailbox.flush_if_due()?.into_iter().for_each(&mut *watch);
            if let Some(outage) = campaign.outage() {
                break Err(outage);
            }
            if stop.asked() {
                break Err(ExecutorError::Interrupted { detached: false });
            }
        };
        mailbox.flush()?.into_iter().for_each(&mut *watch);
        let account = Account {
            until_end: session.now as f64 / UNIT,
            worked: session.worked as f64 / UNIT,
            worked_until_last_start: session.worked_until_last_start as f64 / UNIT,
            ..session.cluster.account
        };
        session.cluster.account = account;
        ended
    }
}
