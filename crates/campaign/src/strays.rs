//! Processes that a run leaves behind beyond its process group: daemons, and what a killed driver cannot end any more.
//!
//! On Linux this process adopts what its runs leave (it is a child subreaper), so that such processes are found among its
//! own children, by the attempt that they carry in their environment. Elsewhere only the process group of a run is ended.

use std::path::Path;
use std::process::Command;

use crate::machine;
use crate::spec::CampaignSpec;

/// Environment variable of every process that a driver starts on its own machine, by which they are found after a crash of
/// the driver.
pub(crate) const MARK: &str = "CAMPAIGN_RUNS";

/// Environment variable with the driver itself: nothing is ended whose driver lives.
pub(crate) const DRIVER: &str = "CAMPAIGN_DRIVER";

/// Environment variable with the folder of the attempt that a process belongs to.
pub(crate) const ATTEMPT: &str = "CAMPAIGN_ATTEMPT";

/// Marks what `command` starts: by the folder of its attempt, and, where `campaign` is given, by that and this driver.
pub(crate) fn mark(command: &mut Command, attempt: &Path, campaign: Option<&str>) {
    command.env(ATTEMPT, attempt);
    if let Some(campaign) = campaign {
        command.env(MARK, campaign);
        if let Some(driver) = machine::process_name(std::process::id()) {
            command.env(DRIVER, driver);
        }
    }
}

#[cfg(target_os = "linux")]
mod linux {
    use std::fs;
    use std::path::Path;
    use std::sync::OnceLock;
    use std::time::{Duration, Instant};

    use rustix::process::{Pid, Signal, WaitOptions};

    use crate::machine::{environment, process_stat};

    /// Longest time for which killed processes are waited for.
    const PATIENCE: Duration = Duration::from_secs(1);

    /// Whether every orphan that this process adopts was left by a run: it had no children before, and is not the one that
    /// adopts the orphans of the whole machine or container.
    static ALL_OF_RUNS: OnceLock<bool> = OnceLock::new();

    /// From now on orphans of this process's children become its own children.
    pub(crate) fn adopt() {
        ALL_OF_RUNS.get_or_init(|| {
            let alone = std::process::id() != 1 && children().is_empty();
            // Where it is refused, what leaves its group is not found.
            let _ = rustix::process::set_child_subreaper(Some(rustix::process::getpid()));
            alone
        });
    }

    /// Ends what is left of an attempt whose process group `group` was killed.
    pub(crate) fn end_of_attempt(group: Pid, attempt: &Path) {
        let begun = Instant::now();
        // Members of the group that were orphaned, so that they do not stay as zombies; once it is empty, everything
        // that had left it is this process's child.
        while rustix::process::test_kill_process_group(group).is_ok() && begun.elapsed() < PATIENCE
        {
            if !matches!(rustix::process::waitpgid(group, WaitOptions::NOHANG), Ok(Some(_))) {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        let entry =
            [super::ATTEMPT.as_bytes(), b"=", attempt.as_os_str().as_encoded_bytes()].concat();
        end(|pid| environment(pid).contains(&entry));
    }

    /// Ends the adopted processes of other sessions that runs left: those with the mark of a run, and all others where
    /// nothing but runs can have left them. To be called while no run goes on.
    pub(crate) fn end_all() {
        let all = ALL_OF_RUNS.get().copied().unwrap_or(false);
        let mark = [super::MARK.as_bytes(), b"="].concat();
        end(|pid| all || environment(pid).iter().any(|own| own.starts_with(&mark)));
    }

    /// Ends the adopted processes of other sessions that are chosen, and what these leave.
    fn end(chosen: impl Fn(i32) -> bool) {
        let begun = Instant::now();
        loop {
            let mut left = false;
            for (pid, zombie) in adopted() {
                let Some(process) = Pid::from_raw(pid) else { continue };
                if zombie {
                    let _ = rustix::process::waitpid(Some(process), WaitOptions::NOHANG);
                } else if chosen(pid) {
                    let _ = rustix::process::kill_process(process, Signal::KILL);
                    left = true;
                }
            }
            if !left || begun.elapsed() > PATIENCE {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Children of the first thread, which orphans go to.
    fn children() -> Vec<i32> {
        let own = std::process::id();
        let children = fs::read_to_string(format!("/proc/{own}/task/{own}/children"));
        let children = children.unwrap_or_default();
        children.split_whitespace().filter_map(|pid| pid.parse().ok()).collect()
    }

    /// Children of this process in another session than its own, and whether each is a zombie: it starts none itself.
    fn adopted() -> Vec<(i32, bool)> {
        let mut session = None;
        let children = children().into_iter();
        children
            .filter_map(|pid| {
                let [state, of, _] = process_stat(&pid.to_string())?;
                let own =
                    session.get_or_insert_with(|| process_stat("self").map(|[_, own, _]| own));
                (Some(&of) != own.as_ref()).then_some((pid, state == "Z"))
            })
            .collect()
    }
}

#[cfg(target_os = "linux")]
pub(crate) use linux::{adopt, end_all, end_of_attempt};

#[cfg(not(target_os = "linux"))]
pub(crate) fn end_all() {}

/// A process that outlives a killed driver, and ends the driver's runs once their time is over. Best effort.
#[derive(Debug)]
pub(crate) struct Watchdog {
    #[cfg(target_os = "linux")]
    child: Option<std::process::Child>,
}

/// Waits until its input ends, which it does with the driver, then for $1 seconds, and ends what the driver $3 had started.
#[cfg(target_os = "linux")]
const SCRIPT: &str = r#"
trap '' HUP INT TERM
cat >/dev/null
sleep "$1"
for process in /proc/[0-9]*; do
    if tr '\0' '\n' <"$process/environ" | grep -qxF "$2=$3"; then
        kill -KILL "${process#/proc/}"
    fi
done 2>/dev/null
"#;

impl Watchdog {
    /// Starts it for the runs of a driver.
    pub(crate) fn of_runs(spec: &CampaignSpec) -> Self {
        let longest_s = spec.commands.iter().map(|command| command.call.timeout_s);
        Self::start(longest_s.fold(0.0, f64::max))
    }

    /// Starts it for runs of at most `longest_s` seconds.
    fn start(longest_s: f64) -> Self {
        #[cfg(target_os = "linux")]
        {
            use std::os::unix::process::CommandExt as _;
            use std::process::Stdio;

            let child = machine::process_name(std::process::id()).and_then(|driver| {
                Command::new("sh")
                    .args(["-c", SCRIPT, "watchdog"])
                    .args([&longest_s.ceil().to_string(), DRIVER, &driver])
                    .stdin(Stdio::piped())
                    .stdout(Stdio::null())
                    .stderr(Stdio::null())
                    .process_group(0)
                    .spawn()
                    .ok()
            });
            Self { child }
        }
        #[cfg(not(target_os = "linux"))]
        {
            let _ = longest_s;
            Self {}
        }
    }
}

#[cfg(target_os = "linux")]
impl Drop for Watchdog {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            use rustix::process::{Pid, Signal, kill_process_group};
            // With what it waits by: sleep, cat.
            let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
            let _ = child.wait();
        }
    }
}
