//! Shell scripts in the place of Slurm's commands, and what happens on their cluster.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use super::super::submission::{self, Submission};
use super::super::{Slurm, SlurmSettings};
use crate::campaign::Campaign;
use crate::error::ExecutorError;
use crate::executor::{Event, Executor as _, Stop};
use crate::feed::Feed;
use crate::folder::OUTCOMES;
use crate::outcome::{FailureKind, Outcome};
use crate::record::ResultRecord;
use crate::spec::{Call, CampaignSpec, CommandSpec, Interpolation, OutputSpec, ResultSpec};
use crate::table::Format;
use crate::task::Task;
use crate::{durable, seal};

/// sbatch takes every job, puts its elements into the queue, and writes down how it was called last: who waits for that finds
/// the queue complete.
pub(super) const SBATCH: &str = r#"
n=$(($(cat "$here/count" 2>/dev/null || echo 0) + 1))
echo $n >"$here/count"
for a; do
    case $a in
        --job-name=*) name=${a#*=} ;;
        --array=*) array=${a#*=} ;;
    esac
done
echo "$name|$n|$array|PENDING|Priority" >>"$here/queue"
echo "$@" >>"$here/sbatch.log"
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
pub(super) const SCONTROL: &str = "echo 'MaxArraySize            = 1001'\n";
const SACCT: &str = "echo 'Slurm accounting storage is disabled' >&2; exit 1\n";

pub(super) struct Fake {
    pub(super) _folder: tempfile::TempDir,
    pub(super) programs: PathBuf,
    pub(super) campaign: Campaign,
    pub(super) tasks: Vec<Task>,
    pub(super) settings: SlurmSettings,
    pub(super) events: Vec<Event>,
    pub(super) stop: Stop,
}

impl Fake {
    pub(super) fn new(tasks: u64, retries: u32) -> Self {
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
        let call = Call { timeout_s: 60.0, retries, ..Call::new(vec!["/bin/true".into()]) };
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

    pub(super) fn put(&self, program: &str, script: &str) {
        put(&self.programs, program, script);
    }

    fn slurm(&self) -> Slurm {
        let worker = vec!["/opt/it's here/worker".into(), "run-task".into()];
        let mut slurm = Slurm::new(self.settings.clone(), worker).expect("settings");
        slurm.cluster.client.programs = Some(self.programs.clone());
        slurm
    }

    /// Runs tasks that are given batch after batch, each once the one before the last has ended.
    pub(super) fn run_fed(&mut self, batch: usize) -> Result<(), ExecutorError> {
        let mut slurm = self.slurm();
        let Self { campaign, tasks, events, stop, .. } = self;
        let feed = Feed::new(campaign);
        thread::scope(|scope| {
            scope.spawn(|| feed.serve(&mut slurm, &mut |event| events.push(event), stop));
            let batches: Vec<&[Task]> = tasks.chunks(batch).collect();
            feed.give(batches[0])?;
            let waited = (0..batches.len()).try_for_each(|k| {
                batches.get(k + 1).map_or(Ok(()), |next| feed.give(next))?;
                feed.wait(batches[k])
            });
            feed.close();
            waited
        })
    }

    pub(super) fn run(&mut self) -> Result<(), ExecutorError> {
        let mut slurm = self.slurm();
        let Self { campaign, tasks, events, stop, .. } = self;
        slurm.run(campaign, tasks, &mut |event| events.push(event), stop)
    }

    /// Runs while another thread does what happens meanwhile on the cluster.
    pub(super) fn run_with(
        &mut self,
        cluster: impl FnOnce(&Cluster) + Send,
    ) -> Result<(), ExecutorError> {
        self.beside(cluster, Self::run)
    }

    /// Does something while another thread does what happens meanwhile on the cluster.
    pub(super) fn beside(
        &mut self,
        cluster: impl FnOnce(&Cluster) + Send,
        run: impl FnOnce(&mut Self) -> Result<(), ExecutorError>,
    ) -> Result<(), ExecutorError> {
        let cluster_side = Cluster {
            dir: self.campaign.dir().to_path_buf(),
            programs: self.programs.clone(),
            spec: self.campaign.spec().clone(),
            tasks: self.tasks.clone(),
            stop: self.stop.clone(),
        };
        thread::scope(|scope| {
            scope.spawn(move || {
                // A driver whose cluster does not go on is not waited for.
                let _detach = DetachOnPanic(cluster_side.stop.clone());
                cluster(&cluster_side);
            });
            run(self)
        })
    }

    pub(super) fn submissions(&self) -> Vec<Submission> {
        submission::read_all(self.campaign.dir()).expect("submissions").0
    }

    pub(super) fn notes(&self) -> String {
        let notes = self.events.iter().filter_map(|event| match event {
            Event::Note(words) => Some(words.as_str()),
            _ => None,
        });
        notes.collect::<Vec<_>>().join("\n")
    }

    pub(super) fn failures(&self) -> Vec<(u64, FailureKind)> {
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

struct DetachOnPanic(Stop);

impl Drop for DetachOnPanic {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.detach();
        }
    }
}

/// Events on the cluster while the driver runs.
pub(super) struct Cluster {
    pub(super) dir: PathBuf,
    pub(super) programs: PathBuf,
    pub(super) spec: CampaignSpec,
    pub(super) tasks: Vec<Task>,
    pub(super) stop: Stop,
}

impl Cluster {
    pub(super) fn put(&self, program: &str, script: &str) {
        put(&self.programs, program, script);
    }

    pub(super) fn publish(&self, runs: &[u64]) {
        for task in self.tasks.iter().filter(|task| runs.contains(&task.number)) {
            let values = vec![task.parameters[0] * 2.0];
            let outcome = Outcome::Finished { values, attempts: 1, seconds: 0.1 };
            let record = ResultRecord::new(&self.spec, task, outcome);
            let path = self.dir.join(OUTCOMES).join(format!("{:06}.json", task.number));
            let text = seal::seal_pretty(&record).expect("sealed");
            durable::publish(&path, &text).expect("published");
        }
    }

    pub(super) fn submitted(&self) -> usize {
        let log = fs::read_to_string(self.programs.join("sbatch.log")).unwrap_or_default();
        log.lines().count()
    }

    /// Waits for as many submissions.
    pub(super) fn await_submissions(&self, count: usize) {
        self.wait_for(|| self.submitted() >= count);
    }

    pub(super) fn wait_for(&self, condition: impl Fn() -> bool) {
        let deadline = Instant::now() + Duration::from_secs(60);
        while !condition() {
            if Instant::now() > deadline {
                panic!("this never happened");
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// The queue holds these lines.
    pub(super) fn queue(&self, lines: &str) {
        fs::write(self.programs.join(".queue"), lines).expect("queue");
        fs::rename(self.programs.join(".queue"), self.programs.join("queue")).expect("in place");
    }
}

pub(super) fn sleep_ms(milliseconds: u64) {
    thread::sleep(Duration::from_millis(milliseconds));
}
