//! Tasks that are placed while others run, and the cluster of simulated time.

use std::time::{Duration, Instant};

use campaign::{
    Campaign, CampaignError, CommandSpec, Event, Executor, ExecutorError, Feed, InProcess, Local,
    RunTimes, Simulated, SimulatedRun, Stop, Task,
};

use crate::sandbox::{Sandbox, bits, create, shell, spec, task, tasks, values};

/// A giver of five batches of eight tasks: each is placed from the values of the one before the last, and waited for in turn.
fn give(feed: &Feed<'_>, campaign: &Campaign) -> Result<Vec<Task>, ExecutorError> {
    let mut all: Vec<Task> = Vec::new();
    for batch in 0..6 {
        if batch >= 2 {
            feed.wait(&all[8 * (batch - 2)..8 * (batch - 1)])?;
        }
        if batch < 5 {
            let first = |batch: u64| campaign.outcome(8 * batch)?.values().map(|values| values[0]);
            let from = (batch as u64).checked_sub(2).and_then(first).unwrap_or(1.0);
            let place = |k: u64| {
                let number = 8 * batch as u64 + k;
                Task { number, command: 0, parameters: vec![from / 3.0 + k as f64, 0.1] }
            };
            let tasks: Vec<Task> = (0..8).map(place).collect();
            feed.give(&tasks)?;
            all.extend(tasks);
        }
    }
    feed.wait(&all[32..])?;
    feed.close();
    Ok(all)
}

/// Runs what the giver gives; what was given, and the events.
fn feed_to(
    executor: &mut (dyn Executor + Send),
    campaign: &Campaign,
    stop: &Stop,
) -> (Result<Vec<Task>, ExecutorError>, Vec<Event>) {
    let feed = Feed::new(campaign);
    let mut events = Vec::new();
    let given = std::thread::scope(|scope| {
        scope.spawn(|| feed.serve(executor, &mut |event| events.push(event), stop));
        let given = give(&feed, campaign);
        feed.close();
        given
    });
    (given, events)
}

fn sum(task: &Task) -> SimulatedRun {
    SimulatedRun::Values(vec![task.parameters[0] + task.parameters[1]])
}

fn simulated(slots: usize, seed: u64) -> Simulated<fn(&Task) -> SimulatedRun> {
    let mut cluster = Simulated::new(slots, RunTimes::LogNormal(1.0), seed, sum as fn(&_) -> _);
    cluster.loss = 0.1;
    cluster
}

fn in_process() -> CommandSpec {
    CommandSpec::in_process("sum")
}

#[test]
fn what_is_placed_does_not_depend_on_the_executor_or_on_the_order_in_which_runs_end() {
    let given = |executor: &mut (dyn Executor + Send)| {
        let sandbox = Sandbox::new();
        let script = "awk -v a=$1 -v b=$2 'BEGIN {{ printf \"x\\n%.17g\\n\", a + b }}' > out.csv";
        let campaign = create(&sandbox.dir(), &spec(shell(script)));
        let (given, events) = feed_to(executor, &campaign, &Stop::new());
        let ended = events.iter().filter(|event| matches!(event, Event::Ended { .. })).count();
        assert_eq!(ended, 40);
        let given = given.unwrap();
        assert_eq!(campaign.tasks(), given);
        let of = |task: &Task| [bits(&task.parameters), bits(&values(&campaign, task.number))];
        given.iter().map(of).collect::<Vec<_>>()
    };
    let first = given(&mut simulated(1, 0));
    for seed in 1..20 {
        assert_eq!(given(&mut simulated(1 + seed as usize, seed)), first, "seed {seed}");
    }
    assert_eq!(given(&mut Local { parallel: 3 }), first);
    let threads =
        InProcess::new(2, |task: &Task| Ok(vec![task.parameters[0] + task.parameters[1]]));
    assert_eq!(given(&mut threads.unwrap()), first);
}

#[test]
fn a_straggler_does_not_hold_up_the_batches_after_the_next() {
    let sandbox = Sandbox::new();
    // The first run of the first batch waits until one of the second batch has ended.
    let script = "if [ $3 = 0 ]; then while ! [ -e ../../../../ended ]; do sleep 0.02; done; fi; \
                  printf 'x\\n1\\n' > out.csv; if [ $3 = 10 ]; then touch ../../../../ended; fi";
    let campaign = create(&sandbox.dir(), &spec(shell(script)));
    let (given, events) = feed_to(&mut Local { parallel: 2 }, &campaign, &Stop::new());
    assert_eq!(given.unwrap().len(), 40);
    let at = |number| {
        let end = Event::Ended { number, failed: None };
        events.iter().position(|event| *event == end).unwrap()
    };
    assert!(at(9) < at(0) && at(0) < at(16), "batch 2 is placed from batch 0");
}

#[test]
fn whoever_waits_is_told_why_the_executor_stopped() {
    let cases = [("kill -KILL $$", "lost more often"), ("exit 3", "looks like an outage, ")];
    for (script, words) in cases {
        let sandbox = Sandbox::new();
        let mut command = shell(script);
        command.call.retries = 0;
        let campaign = create(&sandbox.dir(), &spec(command));
        let (given, _) = feed_to(&mut Local { parallel: 2 }, &campaign, &Stop::new());
        let error = given.unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(in_process()));
    let stop = Stop::new();
    stop.cancel();
    let (given, _) = feed_to(&mut simulated(3, 1), &campaign, &stop);
    assert!(matches!(given, Err(ExecutorError::Interrupted { .. })), "{given:?}");
}

#[test]
fn a_task_that_cannot_be_is_refused_where_it_is_given() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(in_process()));
    let feed = Feed::new(&campaign);
    feed.give(&[task(1)]).unwrap();
    let other = Task { parameters: vec![0.0, 0.0], ..task(1) };
    assert!(matches!(feed.give(&[other]), Err(CampaignError::TaskDiffers { number: 1, .. })));
}

#[test]
fn what_nobody_waits_for_any_more_is_ended() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(shell("sleep 30")));
    let feed = Feed::new(&campaign);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(|| feed.serve(&mut Local { parallel: 2 }, &mut |_| (), &Stop::new()));
        scope.spawn(|| feed.wait(&tasks(4)));
        std::thread::sleep(Duration::from_millis(300));
        feed.close();
    });
    assert!(begun.elapsed() < Duration::from_secs(15));
    assert!(tasks(4).iter().all(|task| campaign.outcome(task.number).is_none()));
}

#[test]
fn simulated_runs_take_the_time_of_their_law_and_slots_the_sum() {
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(in_process()));
    let mut equal = Simulated::new(64, RunTimes::Equal, 1, sum);
    equal.run(&campaign, &tasks(1000), &mut |_| (), &Stop::new()).unwrap();
    let account = equal.account;
    assert_eq!((account.until_end, account.until_last_start), (16.0, 15.0));
    assert_eq!((account.worked, account.worked_until_last_start), (1000.0, 15.0 * 64.0));

    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(in_process()));
    let mut cluster = simulated(100, 7);
    let all = tasks(20_000);
    cluster.run(&campaign, &all, &mut |_| (), &Stop::new()).unwrap();
    let seconds = |task: &Task| campaign.outcome(task.number).unwrap().seconds();
    let times: Vec<f64> = all.iter().map(seconds).collect();
    let n = times.len() as f64;
    // Log-normal: mean 1, and the logarithm normal with mean -1/2 and standard deviation 1.
    let mean = times.iter().sum::<f64>() / n;
    let ln: Vec<f64> = times.iter().map(|time| time.ln()).collect();
    let ln_mean = ln.iter().sum::<f64>() / n;
    let ln_sd = (ln.iter().map(|l| (l - ln_mean).powi(2)).sum::<f64>() / n).sqrt();
    assert!((mean - 1.0).abs() < 4.0 * 1.31 / n.sqrt(), "{mean}");
    assert!((ln_mean + 0.5).abs() < 4.0 / n.sqrt(), "{ln_mean}");
    assert!((ln_sd - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{ln_sd}");
    // Attempts are lost with probability 0.1, after half of their time on average.
    let (account, lost) = (cluster.account, 0.1 / 0.9 * n);
    assert!((account.lost as f64 - lost).abs() < 4.0 * (lost / 0.9).sqrt(), "{account:?}");
    let worked = times.iter().sum::<f64>() + 0.5 * lost;
    assert!((account.worked / worked - 1.0).abs() < 0.01, "{account:?} {worked}");

    // Until the last start no slot stands idle.
    let sandbox = Sandbox::new();
    let campaign = create(&sandbox.dir(), &spec(in_process()));
    let mut cluster = Simulated { loss: 0.0, ..simulated(100, 8) };
    cluster.run(&campaign, &tasks(2000), &mut |_| (), &Stop::new()).unwrap();
    let account = cluster.account;
    assert!(
        (account.worked_until_last_start / (100.0 * account.until_last_start) - 1.0).abs() < 1e-6
    );
    assert!(account.until_end > account.until_last_start + 1.0 && account.lost == 0);
}

#[test]
fn a_simulated_run_fails_by_its_parameters_alone() {
    let ends = |slots, seed| {
        let sandbox = Sandbox::new();
        let campaign = create(&sandbox.dir(), &spec(in_process()));
        let outcome = |task: &Task| match task.number % 3 {
            0 => SimulatedRun::Fails,
            _ => sum(task),
        };
        let mut cluster = Simulated::new(slots, RunTimes::LogNormal(1.0), seed, outcome);
        cluster.run(&campaign, &tasks(60), &mut |_| (), &Stop::new()).unwrap();
        let values = |task: &Task| campaign.outcome(task.number).unwrap().values().map(bits);
        tasks(60).iter().map(values).collect::<Vec<_>>()
    };
    let first = ends(1, 1);
    assert_eq!(first.iter().filter(|values| values.is_none()).count(), 20);
    assert!(ends(7, 2) == first && ends(60, 3) == first);
}
