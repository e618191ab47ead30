//! The progress of a campaign, as another process sees it.

use std::time::Duration;

use campaign::{CampaignError, Executor, Local, Outcome, Stop, status};

use crate::sandbox::{Sandbox, create, rows, run, shell, spec, tasks};

#[test]
fn an_empty_campaign_has_a_status_and_an_empty_directory_has_none() {
    let sandbox = Sandbox::new();
    let error = status(&sandbox.dir()).unwrap_err();
    assert!(matches!(error, CampaignError::NotACampaign { .. }), "{error}");
    let campaign = create(&sandbox.dir(), &spec(shell("true")));
    let empty = status(campaign.dir()).unwrap();
    assert_eq!((empty.submitted, empty.finished, empty.running, empty.queued), (0, 0, 0, 0));
    assert_eq!((empty.time_left_s, empty.seconds_per_run), (None, None));
    assert!(empty.driver.is_some());
}

#[test]
fn failures_are_counted_by_cause() {
    let sandbox = Sandbox::new();
    let script = "case $3 in [0-2]) exit 4;; 3) kill -SEGV $$;; esac; printf 'x\\n1\\n' > out.csv";
    let campaign = create(&sandbox.dir(), &spec(shell(script)));
    run(&campaign, &tasks(10));
    let seen = status(campaign.dir()).unwrap();
    assert_eq!((seen.finished, seen.failures(), seen.queued, seen.running), (6, 4, 0, 0));
    let causes: Vec<_> = seen.failed.iter().map(|(cause, n)| (cause.as_str(), *n)).collect();
    assert_eq!(causes, [("crashed with signal 11 (SIGSEGV)", 1), ("exit code 4", 3)]);
    assert_eq!(seen.time_left_s, Some(0.0));
}

#[test]
fn the_time_left_follows_from_what_ended_and_how_many_run() {
    let sandbox = Sandbox::new();
    let mut command = shell("printf 'x\\n1\\n' > out.csv");
    command.outputs = vec![rows("out.csv", "x", 1)];
    let campaign = create(&sandbox.dir(), &spec(command));
    campaign.record_submitted(&tasks(20)).unwrap();
    // Four runs of 30 s that ended just now were made at the same time.
    let outcome = Outcome::Finished { values: vec![1.0], attempts: 1, seconds: 30.0 };
    campaign.record((0..4).map(|number| (number, outcome.clone())).collect()).unwrap();
    let seen = status(campaign.dir()).unwrap();
    assert_eq!((seen.finished, seen.queued, seen.parallel), (4, 16, 4));
    assert_eq!(seen.seconds_per_run, Some(30.0));
    assert_eq!(seen.time_left_s, Some(16.0 * 30.0 / 4.0));
}

#[test]
fn the_status_can_be_read_while_runs_are_made() {
    let sandbox = Sandbox::new();
    let script = "sleep 0.05; printf 'x\\n1\\n' > out.csv";
    let campaign = create(&sandbox.dir(), &spec(shell(script)));
    let dir = sandbox.dir();
    let stop = Stop::new();
    let seen = std::thread::scope(|scope| {
        let asking = scope.spawn(|| {
            let mut seen = Vec::new();
            while !stop.asked() {
                seen.push(status(&dir).unwrap());
                std::thread::sleep(Duration::from_millis(5));
            }
            seen
        });
        Local::new(2).run(&campaign, &tasks(20), &mut |_| (), &Stop::new()).unwrap();
        stop.cancel();
        asking.join().unwrap()
    });
    assert!(seen.len() > 10);
    for status in &seen {
        let sum = status.finished + status.failures() + status.running + status.queued;
        assert_eq!(sum, status.submitted, "{status:?}");
        assert!(status.driver.is_some());
    }
    assert!(seen.windows(2).all(|pair| pair[0].finished <= pair[1].finished));
    assert!(seen.iter().any(|status| status.running == 2));
    // And nobody was kept from the lock by it.
    drop(campaign);
    assert_eq!(status(&dir).unwrap().driver, None);
}
