//! Processes that a killed driver has left on this machine.

/// Ends every process that carries `mark` and whose driver is gone, and returns their number. Works only where the system
/// shows the environment of processes (Linux); elsewhere they end by themselves, and their results are not read.
#[cfg(target_os = "linux")]
pub(crate) fn end(mark: &str) -> usize {
    use rustix::process::{Signal, kill_process};
    use std::time::{Duration, Instant};

    let found = carriers(mark);
    for pid in &found {
        let _ = kill_process(*pid, Signal::TERM);
    }
    let start = Instant::now();
    let mut left = found.len();
    while left > 0 {
        let carriers = carriers(mark);
        left = carriers.len();
        if left > 0 && start.elapsed() > Duration::from_secs(2) {
            for pid in carriers {
                let _ = kill_process(pid, Signal::KILL);
            }
            break;
        }
        std::thread::sleep(Duration::from_millis(if left > 0 { 10 } else { 0 }));
    }
    found.len()
}

#[cfg(target_os = "linux")]
fn carriers(mark: &str) -> Vec<rustix::process::Pid> {
    use crate::strays::{DRIVER, MARK};

    let entry = format!("{MARK}={mark}");
    let Ok(processes) = std::fs::read_dir("/proc") else { return Vec::new() };
    let pids = processes.flatten().filter_map(|process| {
        let pid: i32 = process.file_name().to_str()?.parse().ok()?;
        let entries = crate::machine::environment(pid);
        let carries = entries.iter().any(|e| e == entry.as_bytes());
        let driver = entries.iter().find_map(|entry| {
            std::str::from_utf8(entry).ok()?.strip_prefix(DRIVER)?.strip_prefix('=')
        });
        if !carries || driver.is_some_and(is_alive) {
            return None;
        }
        let other = u32::try_from(pid).ok()? != std::process::id();
        if other { rustix::process::Pid::from_raw(pid) } else { None }
    });
    pids.collect()
}

/// Whether the process of this name ([`crate::machine::process_name`]) is there.
#[cfg(target_os = "linux")]
fn is_alive(name: &str) -> bool {
    let pid = name.split(':').next().and_then(|pid| pid.parse().ok());
    pid.and_then(crate::machine::process_name).is_some_and(|now| now == name)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn end(_mark: &str) -> usize {
    0
}
