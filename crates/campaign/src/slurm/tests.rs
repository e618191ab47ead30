//! The executor against commands that lie, fail and hang: shell scripts in the place of Slurm's.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use super::submission::{self, Submission};
use super::{Slurm, SlurmSettings};
use crate::campaign::{Campaign, OUTCOMES, ResultRecord};
use crate::error::ExecutorError;
use crate::executor::{Event, Executor as _, Stop};
use crate::outcome::{FailureKind, Outcome};
use crate::spec::{Call, CampaignSpec, CommandSpec, Interpolation, Keep, OutputSpec, ResultSpec};
use crate::table::Format;
use crate::task::Task;
use crate::{durable, seal};

/// sbatch takes every job, writes down how it was called, and puts its elements into the queue.
const SBATCH: &str = r#"
n=$(($(cat "$here/count" 2>/dev/null || echo 0) + 1))
echo $n >"$here/count"
echo "$@" >>"$here/sbatch.log"
for a; do
    case $a in
        --job-name=*) name=${a#*=} ;;
        --array=*) array=${a#*=} ;;
    esac
done
echo "$name|$n|$array|PENDING|Priority" >>"$here/queue"
echo $n
"#;
const SQUEUE: &str = r#"
echo "NAME|ARRAY_JOB_ID|ARRAY_TASK_ID|STATE|REASON"
cat "$here/queue" 2>/dev/null || true
"#;
const SCANCEL: &str = r#"
echo "$@" >>"$here/scancel.log"
rm -f "$here/queue"
"#;
const SCONTROL: &str = "echo 'MaxArraySize            = 1001'\n";
const SACCT: &str = "echo 'Slurm accounting storage is disabled' >&2; exit 1\n";

struct Fake {
    _folder: tempfile::TempDir,
    programs: PathBuf,
    campaign: Campaign,
    tasks: Vec<Task>,
    settings: SlurmSettings,
    events: Vec<Event>,
    stop: Stop,
}

impl Fake {
    fn new(tasks: u64, retries: u32) -> Self {
        let folder = tempfile::tempdir().expect("folder");
        let programs = folder.path().join("programs");
        fs::create_dir(&programs).expect("programs");
        let result = ResultSpec {
            file: "out.csv".into(),
            format: Format::Csv,
            control: None,
            value: "y".into(),
            interpolate: Interpolation::Refuse,
        };
        let call = Call {
            argv: vec!["/bin/true".into()],
            environment: BTreeMap::new(),
            timeout_s: 60.0,
            retries,
            keep: Keep::Failed,
        };
        let outputs = vec![OutputSpec { result, at: vec![0.0] }];
        let command = CommandSpec { name: "nothing".into(), call, outputs };
        let names = vec!["x".into()];
        let spec = CampaignSpec { parameter_names: names, commands: vec![command], seed: 1 };
        let dir = folder.path().join("my run");
        let campaign = Campaign::create(&dir, &spec, &BTreeMap::new()).expect("campaign");
        let task = |number| Task { number, command: 0, parameters: vec![number as f64] };
        let settings = SlurmSettings {
            poll_min_s: 0.02,
            poll_max_s: 0.1,
            grace_s: 0.3,
            command_timeout_s: 1.0,
            ..SlurmSettings::default()
        };
        let fake = Self {
            programs,
            campaign,
            tasks: (1..=tasks).map(task).collect(),
            settings,
            events: Vec::new(),
            stop: Stop::new(),
            _folder: folder,
        };
        for (name, script) in [
            ("sbatch", SBATCH),
            ("squeue", SQUEUE),
            ("scancel", SCANCEL),
            ("scontrol", SCONTROL),
            ("sacct", SACCT),
        ] {
            fake.put(name, script);
        }
        fake
    }

    fn put(&self, program: &str, script: &str) {
        put(&self.programs, program, script);
    }

    fn run(&mut self) -> Result<(), ExecutorError> {
        let worker = vec!["/opt/it's here/worker".into(), "run-task".into()];
        let mut slurm = Slurm::new(self.settings.clone(), worker).expect("settings");
        slurm.client.programs = Some(self.programs.clone());
        let Self { campaign, tasks, events, stop, .. } = self;
        slurm.run(campaign, tasks, &mut |event| events.push(event), stop)
    }

    /// Runs while another thread does what happens meanwhile on the cluster.
    fn run_with(&mut self, cluster: impl FnOnce(&Cluster) + Send) -> Result<(), ExecutorError> {
        let cluster_side = Cluster {
            dir: self.campaign.dir().to_path_buf(),
            programs: self.programs.clone(),
            spec: self.campaign.spec().clone(),
            tasks: self.tasks.clone(),
            stop: self.stop.clone(),
        };
        thread::scope(|scope| {
            scope.spawn(move || cluster(&cluster_side));
            self.run()
        })
    }

    fn submissions(&self) -> Vec<Submission> {
        submission::read_all(self.campaign.dir()).expect("submissions").0
    }

    fn notes(&self) -> String {
        let notes = self.events.iter().filter_map(|event| match event {
            Event::Note(words) => Some(words.as_str()),
            _ => None,
        });
        notes.collect::<Vec<_>>().join("\n")
    }

    fn failures(&self) -> Vec<(u64, FailureKind)> {
        let failure = |task: &Task| {
            let outcome = self.campaign.outcome(task.number)?;
            Some((task.number, outcome.failure()?.clone()))
        };
        self.tasks.iter().filter_map(failure).collect()
    }
}

fn put(programs: &Path, program: &str, script: &str) {
    let path = programs.join(program);
    let aside = programs.join(format!(".{program}"));
    let text = format!("#!/bin/sh\nhere={}\n{script}", programs.display());
    fs::write(&aside, text).expect("script");
    fs::set_permissions(&aside, fs::Permissions::from_mode(0o755)).expect("mode");
    fs::rename(aside, path).expect("in place");
}

/// What happens on the cluster while the driver runs.
struct Cluster {
    dir: PathBuf,
    programs: PathBuf,
    spec: CampaignSpec,
    tasks: Vec<Task>,
    stop: Stop,
}

impl Cluster {
    fn put(&self, program: &str, script: &str) {
        put(&self.programs, program, script);
    }

    fn publish(&self, runs: &[u64]) {
        for task in self.tasks.iter().filter(|task| runs.contains(&task.number)) {
            let values = vec![task.parameters[0] * 2.0];
            let outcome = Outcome::Finished { values, attempts: 1, seconds: 0.1 };
            let record = ResultRecord::new(&self.spec, task, outcome);
            let path = self.dir.join(OUTCOMES).join(format!("{:06}.json", task.number));
            let text = seal::seal_pretty(&record).expect("sealed");
            durable::publish(&path, &text).expect("published");
        }
    }

    fn submitted(&self) -> usize {
        let log = fs::read_to_string(self.programs.join("sbatch.log")).unwrap_or_default();
        log.lines().count()
    }

    /// Waits for as many submissions.
    fn await_submissions(&self, count: usize) {
        self.wait_for(|| self.submitted() >= count);
    }

    fn wait_for(&self, condition: impl Fn() -> bool) {
        let deadline = Instant::now() + Duration::from_secs(20);
        while !condition() {
            if Instant::now() > deadline {
                self.stop.detach();
                panic!("this never happened");
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// The queue holds these lines.
    fn queue(&self, lines: &str) {
        fs::write(self.programs.join(".queue"), lines).expect("queue");
        fs::rename(self.programs.join(".queue"), self.programs.join("queue")).expect("in place");
    }
}

fn sleep_ms(milliseconds: u64) {
    thread::sleep(Duration::from_millis(milliseconds));
}

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
fn a_run_gone_from_the_queue_is_submitted_again_and_fails_when_lost_too_often() {
    let mut fake = Fake::new(3, 1);
    fake.run_with(|cluster| {
        cluster.await_submissions(1);
        cluster.publish(&[1]);
        cluster.queue("");
        cluster.await_submissions(2);
        cluster.publish(&[2]);
        cluster.queue("");
    })
    .expect("all have outcomes");
    let submissions = fake.submissions();
    assert_eq!(submissions.len(), 2);
    assert_eq!(submissions[1].elements, [vec![2], vec![3]], "run 1 had its outcome");
    assert_eq!(fake.failures(), [(3, FailureKind::Lost { signal: None })]);
    let retried: Vec<&Event> =
        fake.events.iter().filter(|event| matches!(event, Event::Retried { .. })).collect();
    assert_eq!(retried.len(), 2);
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
        written: crate::lock::now_s(),
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
        written: crate::lock::now_s() - 10,
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

#[test]
fn job_names_follow_from_the_directory_and_can_be_asked_for() {
    let fake = Fake::new(1, 0);
    let name = submission::job_name(&fake.campaign, 12);
    assert_eq!(name, submission::job_name(&fake.campaign, 12));
    assert!(name.starts_with("myrun-") && name.ends_with("-12"), "{name}");
    assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c)), "{name}");
    assert_ne!(name, submission::job_name(&Fake::new(1, 0).campaign, 12), "another directory");
}
