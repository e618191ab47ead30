//! Commands, specifications and tasks of the tests.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use campaign::{
    Call, Campaign, CampaignSpec, CommandSpec, Event, Executor, ExecutorError, Format,
    Interpolation, Local, OutputSpec, ResultSpec, Stop, Task,
};

/// A directory for one test.
pub(crate) struct Sandbox {
    folder: tempfile::TempDir,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// Where the campaign is.
    pub(crate) fn dir(&self) -> PathBuf {
        self.folder.path().join("campaign")
    }

    /// A file beside the campaign.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Lines of a file beside the campaign; none where it is not there.
    pub(crate) fn lines(&self, name: &str) -> Vec<String> {
        let text = std::fs::read_to_string(self.file(name)).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }
}

/// A shell script that gets a, b and the number of the run as $1, $2, $3, and leaves x in out.csv.
pub(crate) fn shell(script: &str) -> CommandSpec {
    let argv = ["sh", "-c", script, "sh", "{a}", "{b}", "{run}"].map(str::to_owned).to_vec();
    let call = Call { timeout_s: 60.0, ..Call::new(argv) };
    CommandSpec { name: "shell".into(), call, outputs: vec![rows("out.csv", "x", 1)] }
}

/// A column of a CSV file, as it is.
pub(crate) fn rows(file: &str, value: &str, rows: u32) -> OutputSpec {
    let result = ResultSpec {
        file: file.into(),
        format: Format::Csv,
        control: None,
        value: value.into(),
        interpolate: Interpolation::Refuse,
    };
    OutputSpec { result, at: (0..rows).map(f64::from).collect() }
}

pub(crate) fn spec(command: CommandSpec) -> CampaignSpec {
    CampaignSpec { parameter_names: vec!["a".into(), "b".into()], commands: vec![command], seed: 5 }
}

pub(crate) fn tasks(count: u64) -> Vec<Task> {
    (0..count).map(task).collect()
}

pub(crate) fn task(number: u64) -> Task {
    let x = number as f64;
    Task { number, command: 0, parameters: vec![0.1 + x / 3.0, -1e-9 * x] }
}

pub(crate) fn create(dir: &Path, spec: &CampaignSpec) -> Campaign {
    Campaign::create(dir, spec, &BTreeMap::new()).unwrap()
}

/// Runs tasks on two processes and gives what happened.
pub(crate) fn run(campaign: &Campaign, tasks: &[Task]) -> Vec<Event> {
    let mut events = Vec::new();
    let mut local = Local::new(2);
    local.run(campaign, tasks, &mut |event| events.push(event), &Stop::new()).unwrap();
    events
}

/// Same as [`run`], for tasks that cannot all be made.
pub(crate) fn fails(campaign: &Campaign, tasks: &[Task]) -> ExecutorError {
    let mut local = Local::new(2);
    local.run(campaign, tasks, &mut |_| (), &Stop::new()).unwrap_err()
}

pub(crate) fn values(campaign: &Campaign, number: u64) -> Vec<f64> {
    let outcome = campaign.outcome(number);
    let outcome = outcome.unwrap_or_else(|| panic!("run {number} has no outcome"));
    outcome.values().unwrap_or_else(|| panic!("run {number}: {outcome:?}")).to_vec()
}

pub(crate) fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Whether a process that was started by a test is gone; a zombie is.
pub(crate) fn is_gone(pid: i32) -> bool {
    for _ in 0..150 {
        match std::fs::read_to_string(format!("/proc/{pid}/stat")) {
            Ok(stat) if !stat.contains(") Z ") => {}
            _ => return true,
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    false
}

/// This test program again, with one of its ignored tests as the whole program, which finds `dir` in `CAMPAIGN_TEST`.
/// `wrapper` is a command line that it is put behind.
pub(crate) fn this_program(wrapper: &[&str], test: &str, dir: &Path) -> std::process::Command {
    let program = std::env::current_exe().unwrap();
    let mut line: Vec<&str> = wrapper.to_vec();
    line.extend([program.to_str().unwrap(), "--exact", test, "--ignored", "--nocapture"]);
    let mut command = std::process::Command::new(line[0]);
    command.args(&line[1..]).env("CAMPAIGN_TEST", dir).env("RUST_BACKTRACE", "0");
    command.stdin(std::process::Stdio::null());
    command
}

/// A driver in a process of its own, the ignored test `kills::driver`, once its runs have left two lines in `file`.
pub(crate) fn running_driver(sandbox: &Sandbox, file: &str) -> std::process::Child {
    let mut driver = this_program(&[], "kills::driver", &sandbox.dir());
    let driver = driver.stdout(std::process::Stdio::null()).spawn().unwrap();
    let start = std::time::Instant::now();
    while sandbox.lines(file).len() < 2 && start.elapsed().as_secs() < 30 {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    driver
}

/// The directory that [`this_program`] was given; none where the test was started by hand.
pub(crate) fn given_dir() -> Option<PathBuf> {
    std::env::var_os("CAMPAIGN_TEST").map(PathBuf::from)
}
