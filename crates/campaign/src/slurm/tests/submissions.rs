//! Submissions to Slurm and the meaning of Slurm's answers.

use std::fs;

use super::super::submission;
use super::fake::{Fake, SBATCH, SCONTROL, sleep_ms};
use crate::error::ExecutorError;
use crate::executor::Event;
use crate::outcome::Outcome;

#[test]
fn exactly_the_missing_runs_are_submitted_in_one_array_and_their_outcomes_taken_over() {
    let mut fake = Fake::new(7, 0);
    fake.settings.chunk = 2;
    fake.settings.max_parallel = Some(3);
    fake.settings.partition = Some("short".into());
    fake.settings.memory_mb = Some(500);
    fake.settings.extra = vec!["--qos=low".into()];
    fake.settings.setup = vec!["module load lammps".into()];
    let done = Outcome::Finished { values: vec![1.0], attempts: 1, seconds: 0.0 };
    fake.campaign.record_submitted(&fake.tasks).expect("submitted");
    fake.campaign.record(vec![(2, done)]).expect("recorded");
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[7, 1, 3, 4, 5, 6]);
    })
    .expect("all ended");
    let submissions = fake.submissions();
    assert_eq!(submissions.len(), 1);
    assert_eq!(submissions[0].elements, [vec![1, 3], vec![4, 5], vec![6, 7]]);
    assert_eq!(fake.campaign.outcome(7).expect("there").values(), Some(&[14.0][..]));
    let folder = submissions[0].folder(fake.campaign.dir());
    let elements = fs::read_to_string(folder.join("elements")).expect("elements");
    assert_eq!(elements, "1,3\n4-5\n6-7\n");
    let log = fs::read_to_string(fake.programs.join("sbatch.log")).expect("log");
    for part in [
        "--array=0-2%3 ",
        "--partition=short",
        "--mem=500M",
        "--qos=low",
        "--time=4 ",
        "0001/job.sh",
    ] {
        assert!(log.contains(part), "{part} in {log}");
    }
    // What the script hands to the worker, by the shell itself.
    let script = fs::read_to_string(folder.join("job.sh")).expect("script");
    assert!(script.contains("module load lammps\n"), "{script}");
    let script = script.replace("module load lammps", ":").replace("\nexec ", "\nprintf '%s|' ");
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .env("SLURM_ARRAY_TASK_ID", "1")
        .output()
        .expect("shell");
    let expected =
        format!("/opt/it's here/worker|run-task|{}|--tasks|4-5|", fake.campaign.dir().display());
    assert_eq!(String::from_utf8_lossy(&output.stdout), expected, "{script}");
    let count =
        |wanted: fn(&Event) -> bool| fake.events.iter().filter(|event| wanted(event)).count();
    assert_eq!(count(|event| matches!(event, Event::Queued { .. })), 6);
    assert_eq!(count(|event| matches!(event, Event::Ended { failed: None, .. })), 6);
}

#[test]
fn arrays_are_split_at_the_largest_size_and_only_so_many_run() {
    let mut fake = Fake::new(10, 0);
    fake.put("scontrol", "echo 'MaxArraySize = 4'\n");
    fake.run_with(|cluster| {
        cluster.await_submissions(3);
        cluster.publish(&(1..=10).collect::<Vec<_>>());
    })
    .expect("all ended");
    let sizes: Vec<usize> = fake.submissions().iter().map(|s| s.elements.len()).collect();
    assert_eq!(sizes, [4, 4, 2]);

    let mut fake = Fake::new(10, 0);
    fake.put("scontrol", "echo 'MaxArraySize = 4'\n");
    fake.settings.max_parallel = Some(2);
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        sleep_ms(300);
        assert_eq!(cluster.submitted(), 1, "two elements may run already");
        cluster.publish(&[1, 2, 3]);
        cluster.await_submissions(2);
        cluster.publish(&(4..=10).collect::<Vec<_>>());
    })
    .expect("all ended");
    let limits: Vec<Option<u32>> = fake.submissions().iter().map(|s| s.limit).collect();
    assert_eq!(limits[..2], [Some(2), Some(1)], "one of the first array may still run");
}

#[test]
fn what_slurm_refuses_is_an_error_with_its_words_and_nothing_is_lost() {
    let mut fake = Fake::new(2, 0);
    fake.put("sbatch", "echo 'sbatch: error: invalid partition specified: nope' >&2; exit 1\n");
    let error = fake.run().expect_err("refused");
    assert!(matches!(error, ExecutorError::Scheduler(_)));
    assert!(error.to_string().contains("invalid partition specified: nope"), "{error}");
    // Mended, then resumed.
    fake.put("sbatch", SBATCH);
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[1, 2]);
    })
    .expect("all ended");
}

#[test]
fn commands_that_are_not_there_are_named() {
    let mut fake = Fake::new(1, 0);
    fs::remove_file(fake.programs.join("scontrol")).expect("removed");
    let error = fake.run().expect_err("no scontrol").to_string();
    assert!(error.contains("scontrol") && error.contains("a machine of the cluster"), "{error}");
    fake.put("scontrol", SCONTROL);
    fs::remove_file(fake.programs.join("sbatch")).expect("removed");
    let error = fake.run().expect_err("no sbatch").to_string();
    assert!(error.contains("sbatch"), "{error}");
}

#[test]
fn a_controller_that_is_away_for_a_while_is_waited_for() {
    let mut fake = Fake::new(1, 0);
    fake.put("sbatch", "echo 'sbatch: error: Unable to contact slurm controller' >&2; exit 1\n");
    fake.put("scontrol", "echo 'Unable to contact slurm controller' >&2; exit 1\n");
    fake.run_with(|cluster| {
        sleep_ms(200);
        cluster.put("scontrol", SCONTROL);
        sleep_ms(300);
        cluster.put("sbatch", SBATCH);
        cluster.await_submissions(1);
        cluster.publish(&[1]);
    })
    .expect("ended");
    assert!(fake.notes().contains("trying again"), "{}", fake.notes());
    assert_eq!(fake.submissions().len(), 1, "the same submission, sent again");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn an_sbatch_without_an_answer_is_looked_for_in_the_queue_and_not_repeated() {
    let mut fake = Fake::new(1, 0);
    // It hangs after the job was taken.
    fake.put("sbatch", &format!("{SBATCH}\nexec >&- 2>&-\nsleep 30\n"));
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        sleep_ms(3500);
        cluster.publish(&[1]);
    })
    .expect("ended");
    assert_eq!(fake.submissions().len(), 1);
    assert!(
        fake.notes().contains("whether Slurm took a job array is not known"),
        "{}",
        fake.notes()
    );
    // It says nothing, and no job is ever seen.
    let mut fake = Fake::new(1, 0);
    fake.settings.command_timeout_s = 0.3;
    fake.settings.grace_s = 0.1;
    fake.put("sbatch", "exit 0\n");
    let error = fake.run().expect_err("in vain").to_string();
    assert!(error.contains("none of them ever was in the queue"), "{error}");
}

#[test]
fn fewer_elements_are_submitted_where_the_user_may_have_no_more() {
    let mut fake = Fake::new(10, 0);
    let limited = format!(
        "for a; do case $a in --array=0-[0-2]|--array=0-[0-2]%*|--array=0) ok=1;; esac; done\n\
         if [ -z \"$ok\" ]; then echo 'sbatch: error: QOSMaxSubmitJobPerUserLimit' >&2; exit 1; fi\n\
         {SBATCH}"
    );
    fake.put("sbatch", &limited);
    fake.run_with(|cluster| {
        cluster.await_submissions(5);
        cluster.publish(&(1..=10).collect::<Vec<_>>());
    })
    .expect("all ended");
    let log = fs::read_to_string(fake.programs.join("sbatch.log")).expect("log");
    assert_eq!(log.lines().count(), 5, "10 to 5 to 2 elements: {log}");
}

#[test]
fn job_names_follow_from_the_directory_and_can_be_asked_for() {
    let fake = Fake::new(1, 0);
    let name = submission::job_name(&fake.campaign, 12);
    assert_eq!(name, submission::job_name(&fake.campaign, 12));
    assert!(name.starts_with("myrun-") && name.ends_with("-12"), "{name}");
    assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c)), "{name}");
    assert_ne!(name, submission::job_name(&Fake::new(1, 0).campaign, 12), "another directory");
}

#[test]
fn tasks_that_are_given_while_others_run_are_submitted_beside_them() {
    let mut fake = Fake::new(6, 0);
    let cluster = |cluster: &super::fake::Cluster| {
        // Both first batches are there before anything has ended; the straggler 1 holds up the third.
        cluster.await_submissions(1);
        cluster.publish(&[2, 3, 4]);
        sleep_ms(300);
        let before = cluster.submitted();
        cluster.publish(&[1]);
        cluster.await_submissions(before + 1);
        cluster.publish(&[5, 6]);
    };
    fake.beside(cluster, |fake| fake.run_fed(2)).expect("all ended");
    let runs = |submission: &submission::Submission| submission.elements.concat();
    let mut submitted: Vec<Vec<u64>> = fake.submissions().iter().map(runs).collect();
    assert_eq!(submitted.pop(), Some(vec![5, 6]));
    assert_eq!(submitted.concat(), [1, 2, 3, 4]);
}
