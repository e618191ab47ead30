//! A process and everything that it starts, with a time limit.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

use crate::executor::Stop;
#[cfg(target_os = "linux")]
use crate::strays;

/// Time after which processes that were asked to end are killed.
pub(crate) const GRACE: Duration = Duration::from_secs(2);

/// Time between two looks at the stop flag.
pub(crate) const GLANCE: Duration = Duration::from_millis(50);

/// How a process ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ended {
    /// The process ended by itself, with this code.
    Exit(i32),
    /// A signal that this program did not send ended it.
    Signal(i32),
    /// It took too long and was ended.
    TimedOut,
    /// It was asked to end.
    Stopped,
}

/// A process in a group of its own, with everything that it starts.
#[derive(Debug)]
pub(crate) struct Family {
    child: Child,
    waiter: Waiter,
    /// What its members carry as [their attempt](crate::strays::ATTEMPT): the working directory.
    folder: Option<PathBuf>,
}

impl Family {
    pub(crate) fn start(command: &mut Command) -> io::Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;
            command.process_group(0);
        }
        #[cfg(target_os = "linux")]
        strays::adopt();
        let child = command.spawn()?;
        let waiter = Waiter::new(&child);
        Ok(Self { child, waiter, folder: command.get_current_dir().map(Path::to_owned) })
    }

    /// The process that was started.
    pub(crate) fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// Waits for at most `patience`; whether the process has ended by itself.
    pub(crate) fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        let begun = Instant::now();
        loop {
            let left = patience.saturating_sub(begun.elapsed());
            if self.waiter.wait(&mut self.child, left)? {
                return Ok(true);
            }
            if begun.elapsed() >= patience {
                return Ok(false);
            }
        }
    }

    /// How a process that [has ended](Self::wait) did; what is left of its group is killed.
    pub(crate) fn ended(&mut self) -> io::Result<Ended> {
        // The group's number is not given away before the child is waited for.
        signal(&mut self.child, Strength::Kill);
        Ok(ended(self.child.wait()?))
    }

    /// Asks the whole group to end, and kills what is left of it after the grace.
    pub(crate) fn end(&mut self) -> io::Result<()> {
        end(&mut self.child, &self.waiter)
    }

    /// Kills the group, where the process cannot be waited for.
    pub(crate) fn kill(&mut self) {
        signal(&mut self.child, Strength::Kill);
    }

    /// Ends, on Linux, what has left the group and carries the working directory as its attempt. To be called once the
    /// group was ended.
    pub(crate) fn end_strays(&self) {
        #[cfg(target_os = "linux")]
        if let Some(attempt) = &self.folder {
            strays::end_of_attempt(rustix::process::Pid::from_child(&self.child), attempt);
        }
    }
}

/// Starts `command` in a process group of its own and waits for it; `glance` is called every [`GLANCE`] meanwhile. Whatever
/// is left of the group afterwards is killed; so is, on Linux, what has left the group and carries the command's working
/// directory as [its attempt](crate::strays::ATTEMPT).
pub(crate) fn run(
    command: &mut Command,
    limit: Duration,
    stop: &Stop,
    glance: &mut dyn FnMut(),
) -> io::Result<Ended> {
    let started = Instant::now();
    let mut family = Family::start(command)?;
    // What cannot be waited for must not go on either.
    let ended =
        watch_over(&mut family, started, limit, stop, glance).inspect_err(|_| family.kill());
    family.end_strays();
    ended
}

fn watch_over(
    family: &mut Family,
    started: Instant,
    limit: Duration,
    stop: &Stop,
    glance: &mut dyn FnMut(),
) -> io::Result<Ended> {
    loop {
        let elapsed = started.elapsed();
        let patience = limit.saturating_sub(elapsed).min(GLANCE);
        if family.wait(patience)? {
            return family.ended();
        }
        let why = if stop.asked() {
            Ended::Stopped
        } else if started.elapsed() >= limit {
            Ended::TimedOut
        } else {
            glance();
            continue;
        };
        family.end()?;
        return Ok(why);
    }
}

#[derive(Debug, Clone, Copy)]
enum Strength {
    Ask,
    Kill,
}

/// Asks the whole group to end, and kills what is left of it after the grace.
fn end(child: &mut Child, waiter: &Waiter) -> io::Result<()> {
    let asked = Instant::now();
    signal(child, Strength::Ask);
    while asked.elapsed() < GRACE {
        if waiter.wait(child, Duration::from_millis(20))? {
            break;
        }
    }
    // Once its leader is waited for, the group is there exactly as long as it has other members.
    let left = || GRACE.saturating_sub(asked.elapsed());
    if waiter.wait(child, Duration::ZERO)? {
        child.wait()?;
        while others_are_left(child) && !left().is_zero() {
            std::thread::sleep(Duration::from_millis(10).min(left()));
        }
        if others_are_left(child) {
            signal(child, Strength::Kill);
        }
    } else {
        signal(child, Strength::Kill);
        child.wait()?;
    }
    Ok(())
}

fn ended(status: ExitStatus) -> Ended {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt as _;
        if let Some(signal) = status.signal() {
            return Ended::Signal(signal);
        }
    }
    Ended::Exit(status.code().unwrap_or(-1))
}

#[cfg(unix)]
fn signal(child: &mut Child, strength: Strength) {
    use rustix::process::{Signal, kill_process_group};
    let signal = match strength {
        Strength::Ask => Signal::TERM,
        Strength::Kill => Signal::KILL,
    };
    // Gone already is as good.
    let _ = kill_process_group(rustix::process::Pid::from_child(child), signal);
}

/// Whether the group has members, now that its leader is waited for.
#[cfg(unix)]
fn others_are_left(child: &Child) -> bool {
    let group = rustix::process::Pid::from_child(child);
    rustix::process::test_kill_process_group(group).is_ok() && !only_zombies(group)
}

/// Orphans that ended count as members until somebody waits for them, which in a container may be nobody.
#[cfg(target_os = "linux")]
fn only_zombies(group: rustix::process::Pid) -> bool {
    let Ok(processes) = std::fs::read_dir("/proc") else { return false };
    let wanted = group.as_raw_nonzero().to_string();
    !processes.flatten().any(|process| {
        let stat = std::fs::read_to_string(process.path().join("stat")).unwrap_or_default();
        // "PID (NAME) STATE PARENT GROUP ...", where the name may hold anything.
        let mut fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
        let (state, of_group) = (fields.next(), fields.nth(1));
        of_group == Some(&wanted) && !matches!(state, Some("Z" | "X"))
    })
}

#[cfg(all(unix, not(target_os = "linux")))]
fn only_zombies(_group: rustix::process::Pid) -> bool {
    false
}

/// Without groups only the process itself can be ended, and not asked first.
#[cfg(not(unix))]
fn signal(child: &mut Child, _strength: Strength) {
    let _ = child.kill();
}

#[cfg(not(unix))]
fn others_are_left(_child: &Child) -> bool {
    false
}

/// Waits for the end of a process without taking its status, so that its number stays its own.
#[derive(Debug)]
struct Waiter {
    #[cfg(target_os = "linux")]
    pidfd: Option<std::os::fd::OwnedFd>,
}

impl Waiter {
    fn new(child: &Child) -> Self {
        #[cfg(target_os = "linux")]
        {
            use rustix::process::{Pid, PidfdFlags, pidfd_open};
            Self { pidfd: pidfd_open(Pid::from_child(child), PidfdFlags::empty()).ok() }
        }
        #[cfg(not(target_os = "linux"))]
        {
            let _ = child;
            Self {}
        }
    }

    /// Waits for at most `patience`; whether the process has ended.
    fn wait(&self, child: &mut Child, patience: Duration) -> io::Result<bool> {
        #[cfg(target_os = "linux")]
        if let Some(pidfd) = &self.pidfd {
            use rustix::event::{PollFd, PollFlags, Timespec, poll};
            let timeout = Timespec {
                tv_sec: 0,
                tv_nsec: i64::from(patience.min(GLANCE).subsec_nanos()) as _,
            };
            let mut descriptors = [PollFd::new(pidfd, PollFlags::IN)];
            return match poll(&mut descriptors, Some(&timeout)) {
                Ok(ready) => Ok(ready > 0),
                Err(rustix::io::Errno::INTR) => Ok(false),
                Err(error) => Err(error.into()),
            };
        }
        // Elsewhere: looked after in pauses that grow.
        let begun = Instant::now();
        let mut pause = Duration::from_micros(200);
        loop {
            if has_ended(child)? {
                return Ok(true);
            }
            let left = patience.saturating_sub(begun.elapsed());
            if left.is_zero() {
                return Ok(false);
            }
            std::thread::sleep(pause.min(left));
            pause *= 2;
        }
    }
}

#[cfg(unix)]
fn has_ended(child: &Child) -> io::Result<bool> {
    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    Ok(waitid(WaitId::Pid(Pid::from_child(child)), options)?.is_some())
}

#[cfg(not(unix))]
fn has_ended(child: &mut Child) -> io::Result<bool> {
    Ok(child.try_wait()?.is_some())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn run(command: &mut Command, limit: Duration, stop: &Stop) -> io::Result<Ended> {
        super::run(command, limit, stop, &mut || ())
    }

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]).stdin(std::process::Stdio::null());
        command
    }

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn codes_and_signals_are_told_apart() {
        let run = |script: &str| run(&mut shell(script), LONG, &Stop::new()).expect("started");
        assert_eq!(run("exit 0"), Ended::Exit(0));
        assert_eq!(run("exit 7"), Ended::Exit(7));
        assert_eq!(run("kill -SEGV $$"), Ended::Signal(11));
        assert_eq!(run("kill -KILL $$"), Ended::Signal(9));
    }

    /// A script that starts a grandchild which writes its number to a file and sleeps.
    fn family(folder: &std::path::Path, rest: &str) -> String {
        let file = folder.join("grandchild");
        format!("sleep 300 & echo $! > {}; {rest}", file.display())
    }

    fn grandchild_is_gone(folder: &std::path::Path) -> bool {
        let text = std::fs::read_to_string(folder.join("grandchild")).expect("it was started");
        let pid = rustix::process::Pid::from_raw(text.trim().parse().expect("a number"));
        let pid = pid.expect("a process");
        // Orphans are zombies until somebody waits for them.
        for _ in 0..100 {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", pid.as_raw_nonzero()));
            if rustix::process::test_kill_process(pid).is_err()
                || stat.is_ok_and(|stat| stat.contains(") Z "))
            {
                return true;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        false
    }

    #[test]
    fn a_timeout_ends_grandchildren_too_at_once_where_they_obey() {
        let folder = tempfile::tempdir().expect("a directory");
        let start = Instant::now();
        let limit = Duration::from_millis(300);
        let ended = run(&mut shell(&family(folder.path(), "wait")), limit, &Stop::new());
        assert_eq!(ended.expect("started"), Ended::TimedOut);
        assert!(start.elapsed() >= limit && start.elapsed() < GRACE, "{:?}", start.elapsed());
        assert!(grandchild_is_gone(folder.path()));
    }

    #[test]
    fn what_does_not_obey_is_killed_after_the_grace() {
        let folder = tempfile::tempdir().expect("a directory");
        let script =
            format!("trap '' TERM; {}", family(folder.path(), "while :; do sleep 1; done"));
        let start = Instant::now();
        let ended = run(&mut shell(&script), Duration::from_millis(200), &Stop::new());
        assert_eq!(ended.expect("started"), Ended::TimedOut);
        assert!(start.elapsed() >= GRACE && start.elapsed() < 3 * GRACE, "{:?}", start.elapsed());
        assert!(grandchild_is_gone(folder.path()));
    }

    #[test]
    fn a_leader_that_obeys_does_not_hide_a_child_that_does_not() {
        let folder = tempfile::tempdir().expect("a directory");
        let file = folder.path().join("grandchild");
        let stubborn = "trap \"\" TERM; while :; do sleep 1; done";
        let script = format!("sh -c '{stubborn}' & echo $! > {}; wait", file.display());
        let ended = run(&mut shell(&script), Duration::from_millis(300), &Stop::new());
        assert_eq!(ended.expect("started"), Ended::TimedOut);
        assert!(grandchild_is_gone(folder.path()));
    }

    #[test]
    fn what_a_finished_run_left_behind_is_killed() {
        let folder = tempfile::tempdir().expect("a directory");
        let ended = run(&mut shell(&family(folder.path(), "exit 3")), LONG, &Stop::new());
        assert_eq!(ended.expect("started"), Ended::Exit(3));
        assert!(grandchild_is_gone(folder.path()));
    }

    #[test]
    fn stop_ends_it_quickly() {
        let folder = tempfile::tempdir().expect("a directory");
        let stop = Stop::new();
        let start = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(300));
                stop.cancel();
            });
            let ended = run(&mut shell(&family(folder.path(), "wait")), LONG, &stop);
            assert_eq!(ended.expect("started"), Ended::Stopped);
        });
        assert!(start.elapsed() < GRACE, "{:?}", start.elapsed());
        assert!(grandchild_is_gone(folder.path()));
    }

    #[test]
    fn a_program_that_is_not_there_is_an_error_not_an_end() {
        let error = run(&mut Command::new("/no/such/program"), LONG, &Stop::new());
        assert_eq!(error.expect_err("not there").kind(), io::ErrorKind::NotFound);
    }
}
