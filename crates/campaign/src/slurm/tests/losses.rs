//! Jobs that go on without their driver, end without results, or are cancelled.

use std::fs;
use std::time::{Duration, Instant};

use super::super::submission::{self, Submission};
use super::fake::{Fake, sleep_ms};
use crate::error::ExecutorError;
use crate::executor::{Event, Stop};
use crate::outcome::FailureKind;
use crate::spec::LostRuns;

#[test]
#[ignore = "long: run by .ci/run"]
fn a_queue_that_fails_hangs_or_talks_nonsense_is_never_no_jobs() {
    for broken in [
        "exit 0",
        "echo 'slurm_load_jobs error: Unable to contact slurm controller' >&2; exit 1",
        "sleep 30",
        "echo garbage",
        "kill -9 $$",
    ] {
        let mut fake = Fake::new(2, 5);
        fake.put("squeue", broken);
        fake.run_with(|cluster| {
            cluster.await_submissions(1);
            sleep_ms(1800);
            cluster.publish(&[1, 2]);
        })
        .expect("all ended");
        assert_eq!(fake.submissions().len(), 1, "{broken}: nothing is submitted twice");
        if broken != "sleep 30" {
            assert!(fake.notes().contains("what runs is not known"), "{broken}: {}", fake.notes());
        }
    }
}

#[test]
fn a_run_gone_from_the_queue_is_submitted_again_and_stops_the_driver_when_lost_too_often() {
    let mut fake = Fake::new(3, 1);
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[1]);
        cluster.queue("");
        cluster.await_submissions(2);
        cluster.publish(&[2]);
        cluster.queue("");
    })
    .expect_err("run 3 is lost for the second time");
    let submissions = fake.submissions();
    assert_eq!(submissions.len(), 2);
    assert_eq!(submissions[1].elements, [vec![2], vec![3]], "run 1 had its outcome");
    assert_eq!(fake.failures(), []);
    let retried: Vec<&Event> =
        fake.events.iter().filter(|event| matches!(event, Event::Retried { .. })).collect();
    assert_eq!(retried.len(), 2);
    // The next driver tries it again.
    fake.run_with(|cluster| {
        cluster.await_submissions(3);
        cluster.publish(&[3]);
    })
    .expect("all have outcomes");
}

#[test]
fn a_run_lost_too_often_fails_where_the_command_says_so() {
    let mut fake = Fake::new(1, 0);
    let mut spec = fake.campaign.spec().clone();
    spec.commands[0].call.lost = LostRuns::Fail;
    fake.campaign.set_limits(&spec).expect("limits");
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.queue("");
    })
    .expect("it has an outcome");
    assert_eq!(fake.failures(), [(1, FailureKind::Lost { signal: None })]);
}

#[test]
fn a_cancelled_element_is_lost_at_once_and_a_job_that_can_never_start_is_an_error() {
    let mut fake = Fake::new(1, 1);
    fake.settings.grace_s = 60.0;
    let begun = Instant::now();
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        let queue = fs::read_to_string(cluster.programs.join("queue")).expect("the queue");
        let name = queue.split('|').next().expect("a name").to_owned();
        cluster.queue(&format!("{name}|101|0|CANCELLED by 1000|None\n"));
        cluster.await_submissions(2);
        cluster.publish(&[1]);
    })
    .expect("all have outcomes");
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());

    let mut fake = Fake::new(2, 1);
    let error = fake
        .run_with(|cluster| {
            cluster.await_submissions(1);
            let queue = fs::read_to_string(cluster.programs.join("queue")).expect("the queue");
            let name = queue.split('|').next().expect("a name").to_owned();
            cluster.queue(&format!("{name}|101|[0-1]|PENDING|PartitionTimeLimit\n"));
            cluster.wait_for(|| cluster.programs.join("scancel.log").exists());
        })
        .expect_err("it waits for ever");
    let words = error.to_string();
    assert!(words.contains("PartitionTimeLimit") && words.contains("time_min"), "{words}");
}

#[test]
fn a_result_that_shows_late_counts_and_the_run_is_not_lost() {
    let mut fake = Fake::new(1, 0);
    fake.settings.grace_s = 3.0;
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.queue("");
        sleep_ms(1000);
        cluster.publish(&[1]);
    })
    .expect("ended");
    assert!(fake.failures().is_empty());
    assert_eq!(fake.submissions().len(), 1);
}

#[test]
fn a_driver_takes_up_the_jobs_of_the_one_before_it() {
    let mut fake = Fake::new(3, 0);
    fake.stop.detach();
    // Asked to detach before it began: it submits nothing.
    assert!(matches!(fake.run(), Err(ExecutorError::Interrupted { detached: true })));
    fake.stop = Stop::new();
    let first = fake.run_with(|cluster| {
        cluster.await_submissions(1);
        sleep_ms(100);
        cluster.stop.detach();
    });
    assert!(matches!(first, Err(ExecutorError::Interrupted { detached: true })), "{first:?}");
    fake.stop = Stop::new();
    fake.run_with(|cluster| {
        sleep_ms(800);
        cluster.publish(&[1, 2, 3]);
    })
    .expect("all ended");
    assert_eq!(fake.submissions().len(), 1, "adopted, not submitted again");
    assert!(fake.notes().contains("3 runs are in Slurm's queue already"), "{}", fake.notes());
    assert!(!fake.programs.join("scancel.log").exists(), "nothing was cancelled");
}

#[test]
fn a_driver_that_died_before_it_knew_the_job_number_finds_the_job_by_its_name() {
    let mut fake = Fake::new(2, 0);
    fake.campaign.record_submitted(&fake.tasks).expect("submitted");
    let written = Submission {
        number: 1,
        name: submission::job_name(&fake.campaign, 1),
        elements: vec![vec![1], vec![2]],
        limit: None,
        time_min: 1,
        written: crate::machine::now_s(),
    };
    written.write(fake.campaign.dir(), &fake.settings, &["worker".into()]).expect("written");
    let name = written.name.clone();
    fake.run_with(move |cluster| {
        // Neither is it in the queue yet, as sbatch is on its way.
        sleep_ms(800);
        cluster.queue(&format!("{name}|77|0-1|PENDING|None\n"));
        sleep_ms(500);
        cluster.publish(&[1, 2]);
    })
    .expect("all ended");
    assert_eq!(fake.submissions().len(), 1);
    assert_eq!(written.job(fake.campaign.dir()), Some(77));
}

#[test]
fn a_driver_that_died_before_it_called_sbatch_submits_after_a_while() {
    let mut fake = Fake::new(1, 0);
    fake.campaign.record_submitted(&fake.tasks).expect("submitted");
    let written = Submission {
        number: 1,
        name: submission::job_name(&fake.campaign, 1),
        elements: vec![vec![1]],
        limit: None,
        time_min: 1,
        written: crate::machine::now_s() - 10,
    };
    written.write(fake.campaign.dir(), &fake.settings, &["worker".into()]).expect("written");
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[1]);
    })
    .expect("ended, though nothing may be lost here");
    assert_eq!(fake.submissions().len(), 2);
    assert!(fake.failures().is_empty());
}

#[test]
fn a_run_that_needs_too_much_fails_alone_and_is_not_repeated() {
    let mut fake = Fake::new(3, 2);
    fake.settings.chunk = 3;
    fake.settings.time_min = Some(7);
    let campaign_name = submission::job_name(&fake.campaign, 1);
    let second = submission::job_name(&fake.campaign, 2);
    fake.run_with(move |cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[1]);
        cluster.queue(&format!("{campaign_name}|1|0|TIMEOUT|TimeLimit\n"));
        cluster.await_submissions(2);
        cluster.queue(&format!(
            "{second}|2|0|TIMEOUT|TimeLimit\n{second}|2|1|OUT_OF_MEMORY|OutOfMemory\n"
        ));
    })
    .expect("all have outcomes");
    assert_eq!(fake.submissions()[1].elements, [vec![2], vec![3]], "each alone now");
    let expected = [(2, FailureKind::Timeout { limit_s: 420.0 }), (3, FailureKind::OutOfMemory)];
    assert_eq!(fake.failures(), expected);
    assert_eq!(fake.submissions().len(), 2);
}

#[test]
fn accounts_say_how_a_forgotten_job_ended_where_they_are_kept() {
    let mut fake = Fake::new(1, 2);
    let name = submission::job_name(&fake.campaign, 1);
    let sacct =
        format!("echo 'JobID|JobName|State|ExitCode'; echo '1_0|{name}|OUT_OF_MEMORY|0:125'\n");
    fake.put("sacct", &sacct);
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.queue("");
    })
    .expect("it has an outcome");
    assert_eq!(fake.failures(), [(1, FailureKind::OutOfMemory)]);
}

#[test]
fn workers_that_cannot_work_are_an_error_with_their_words_and_no_failed_runs() {
    let mut fake = Fake::new(5, 5);
    let name = submission::job_name(&fake.campaign, 1);
    let result = fake.run_with(move |cluster| {
        cluster.await_submissions(1);
        let folder = cluster.dir.join("slurm/0001");
        for element in 0..5 {
            fs::write(folder.join(format!("{element}.out")), "worker: not found\n")
                .expect("output");
        }
        cluster.queue(&format!("{name}|1|0-4|FAILED|NonZeroExitCode\n"));
    });
    let error = result.expect_err("hopeless").to_string();
    assert!(error.contains("worker: not found"), "{error}");
    assert!(fake.failures().is_empty(), "they can be made when the worker is mended");
    fake.run_with(|cluster| {
        cluster.await_submissions(2);
        cluster.publish(&[1, 2, 3, 4, 5]);
    })
    .expect("mended");
}

#[test]
fn cancel_ends_the_jobs_and_the_next_driver_submits_at_once() {
    let mut fake = Fake::new(2, 0);
    fake.settings.grace_s = 60.0;
    let cancelled = fake.run_with(|cluster| {
        cluster.await_submissions(1);
        sleep_ms(200);
        cluster.publish(&[2]);
        cluster.stop.cancel();
    });
    assert!(
        matches!(cancelled, Err(ExecutorError::Interrupted { detached: false })),
        "{cancelled:?}"
    );
    let log = fs::read_to_string(fake.programs.join("scancel.log")).expect("called");
    assert_eq!(log.trim(), format!("--name={}", submission::job_name(&fake.campaign, 1)));
    assert!(fake.campaign.outcome(2).is_some(), "what had finished is kept");
    fake.stop = Stop::new();
    let start = Instant::now();
    fake.run_with(|cluster| {
        cluster.await_submissions(2);
        cluster.publish(&[1]);
    })
    .expect("ended, and the cancelled attempt counts for nothing");
    assert!(start.elapsed() < Duration::from_secs(10), "no grace for what this program cancelled");
}

#[test]
fn an_array_that_somebody_cancelled_before_it_began_is_lost_and_submitted_again() {
    let mut fake = Fake::new(2, 1);
    let name = submission::job_name(&fake.campaign, 1);
    fake.run_with(move |cluster| {
        cluster.await_submissions(1);
        // The very words of Slurm 22.05.
        cluster.queue(&format!("{name}|1|N/A|CANCELLED|None\n"));
        cluster.await_submissions(2);
        cluster.publish(&[1, 2]);
    })
    .expect("all ended");
    assert!(fake.failures().is_empty());
    assert!(fake.notes().contains("was cancelled"), "{}", fake.notes());
}
