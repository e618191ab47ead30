//! This machine: its clock, its name, its processes.

use std::time::{SystemTime, UNIX_EPOCH};

/// Seconds since 1970.
pub(crate) fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}

/// Name of this machine.
pub(crate) fn host() -> String {
    #[cfg(unix)]
    {
        rustix::system::uname().nodename().to_string_lossy().into_owned()
    }
    #[cfg(not(unix))]
    {
        std::env::var("COMPUTERNAME").unwrap_or_default()
    }
}

/// A text that changes whenever the machine is started; empty where the system has none.
pub(crate) fn boot() -> String {
    let id = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    id.trim().to_owned()
}

/// A process as its number and the time of its start, so that a later one of the same number is told from it: `812:90311`.
/// None where there is no such process, or the system does not say.
pub(crate) fn process_name(pid: u32) -> Option<String> {
    let [state, _, started] = process_stat(&pid.to_string())?;
    (state != "Z").then(|| format!("{pid}:{started}"))
}

/// State, session and time of the start of a process, by its number or as `self`; none where the system does not say.
pub(crate) fn process_stat(process: &str) -> Option<[String; 3]> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // "PID (NAME) STATE PARENT GROUP SESSION ...", where the name may hold anything; the state is field 3.
    let mut fields = stat.rsplit(')').next()?.split_whitespace().map(str::to_owned);
    let (state, session) = (fields.next()?, fields.nth(2)?);
    Some([state, session, fields.nth(15)?])
}

/// The entries of a process's environment; empty where the system does not show them.
#[cfg(target_os = "linux")]
pub(crate) fn environment(pid: i32) -> Vec<Vec<u8>> {
    let entries = std::fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
    entries.split(|&byte| byte == 0).map(<[u8]>::to_vec).collect()
}

/// Whether there is a process of this number on this machine.
#[cfg(unix)]
pub(crate) fn process_exists(pid: u32) -> bool {
    let pid = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw);
    pid.is_some_and(|pid| {
        // A process that may not be signalled is there.
        rustix::process::test_kill_process(pid) != Err(rustix::io::Errno::SRCH)
    })
}

#[cfg(not(unix))]
pub(crate) fn process_exists(_pid: u32) -> bool {
    true
}
