//! Workers without the lock, as on other machines.

use campaign::{Campaign, CampaignError, ExecutorError, Stop, Worker, run_task, status};

use crate::sandbox::{Sandbox, bits, create, shell, spec, task, tasks, values};

#[test]
fn a_worker_publishes_what_the_driver_collects_and_runs_nothing_twice() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("log");
    let script = format!("echo $3 >> {}; printf 'x\\n%s\\n' $1 > out.csv", log.display());
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    campaign.record_submitted(&tasks(4)).unwrap();
    let worker = Worker::open(campaign.dir()).unwrap();
    for number in [2, 0] {
        let outcome = worker.run(number, &Stop::new()).unwrap();
        assert_eq!(bits(outcome.values().unwrap()), bits(&task(number).parameters[..1]));
        assert_eq!(campaign.outcome(number), None);
    }
    // Seen before it is collected.
    assert_eq!(status(campaign.dir()).unwrap().finished, 2);
    let again = run_task(campaign.dir(), 2, &Stop::new()).unwrap();
    assert_eq!(campaign.collect().unwrap().numbers, [0, 2]);
    assert_eq!(campaign.outcome(2), Some(again.clone()));
    assert_eq!(worker.run(2, &Stop::new()).unwrap(), again);
    assert_eq!(campaign.collect().unwrap().numbers, [] as [u64; 0]);
    assert_eq!(sandbox.lines("log"), ["2", "0"]);

    // A driver that starts again takes what was published meanwhile.
    worker.run(3, &Stop::new()).unwrap();
    drop(campaign);
    let (campaign, damage) = Campaign::open(&sandbox.dir()).unwrap();
    assert_eq!(damage, []);
    assert_eq!(bits(&values(&campaign, 3)), bits(&task(3).parameters[..1]));
    assert_eq!(campaign.missing(&tasks(4)), [task(1)]);
}

#[test]
fn a_worker_says_what_it_cannot_run() {
    let sandbox = Sandbox::new();
    let nothing = run_task(&sandbox.dir(), 1, &Stop::new());
    let Err(ExecutorError::Campaign(CampaignError::NotACampaign { .. })) = nothing else {
        panic!("{nothing:?}");
    };
    let campaign = create(&sandbox.dir(), &spec(shell("sleep 300")));
    let unknown = run_task(campaign.dir(), 1, &Stop::new());
    let Err(ExecutorError::Campaign(CampaignError::InvalidTask { number: 1, .. })) = unknown else {
        panic!("{unknown:?}");
    };
    campaign.record_submitted(&tasks(2)).unwrap();
    let stop = Stop::new();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(200));
            stop.cancel();
        });
        let stopped = run_task(campaign.dir(), 1, &stop);
        assert!(matches!(stopped, Err(ExecutorError::Interrupted { .. })), "{stopped:?}");
    });
    assert_eq!(campaign.collect().unwrap(), campaign::Collected::default());
}

#[test]
fn of_two_attempts_at_the_same_run_the_first_counts() {
    let sandbox = Sandbox::new();
    let count = sandbox.file("count");
    // Gives another value at every attempt, the first one last.
    let script = format!(
        "echo x >> {0}; n=$(wc -l < {0}); if [ $n = 1 ]; then sleep 1; fi; printf 'x\\n%s\\n' $n > out.csv",
        count.display()
    );
    let campaign = create(&sandbox.dir(), &spec(shell(&script)));
    campaign.record_submitted(&tasks(1)).unwrap();
    std::thread::scope(|scope| {
        let slow = scope.spawn(|| run_task(campaign.dir(), 0, &Stop::new()));
        while sandbox.lines("count").is_empty() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        run_task(campaign.dir(), 0, &Stop::new()).unwrap();
        slow.join().unwrap().unwrap();
    });
    campaign.collect().unwrap();
    assert_eq!(values(&campaign, 0), [2.0]);
}

#[test]
fn a_command_that_a_scheduler_ends_together_with_the_worker_has_not_failed() {
    let sandbox = Sandbox::new();
    let log = sandbox.file("log");
    // What programs do that catch SIGTERM, and what others do; nothing may be tried again.
    for (number, ending) in ["exit 143", "kill -TERM $$"].into_iter().enumerate() {
        let dir = sandbox.file(&format!("run-{number}"));
        let mut spec = spec(shell(&format!("echo ended >> {}; {ending}", log.display())));
        spec.commands[0].call.retries = 0;
        let campaign = create(&dir, &spec);
        campaign.record_submitted(&tasks(1)).unwrap();
        let stop = Stop::new();
        let flag = stop.clone();
        let ended = log.clone();
        let scheduler = std::thread::spawn(move || {
            let lines = |path| std::fs::read_to_string(path).unwrap_or_default().lines().count();
            while lines(&ended) <= number {
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
            flag.cancel();
        });
        let result = run_task(campaign.dir(), 0, &stop);
        scheduler.join().unwrap();
        assert!(matches!(result, Err(ExecutorError::Interrupted { .. })), "{ending}: {result:?}");
        assert_eq!(campaign.collect().unwrap().numbers, [] as [u64; 0], "{ending}");
    }
}
