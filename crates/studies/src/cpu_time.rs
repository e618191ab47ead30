//! Processor time, which other programs on the machine do not disturb as they do wall time.

/// What the clock counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Of {
    /// This thread alone.
    Thread,
    /// All threads of this process.
    Process,
}

/// Processor time used by a job \[s\], and what the job returns.
#[cfg(unix)]
pub(super) fn measured<T>(of: Of, job: impl FnOnce() -> T) -> (f64, T) {
    use rustix::time::{ClockId, clock_gettime};
    let now = || {
        let time = clock_gettime(match of {
            Of::Thread => ClockId::ThreadCPUTime,
            Of::Process => ClockId::ProcessCPUTime,
        });
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    let start = now();
    let result = job();
    (now() - start, result)
}

/// Wall time, where there is no such clock.
#[cfg(not(unix))]
pub(super) fn measured<T>(_: Of, job: impl FnOnce() -> T) -> (f64, T) {
    let start = std::time::Instant::now();
    let result = job();
    (start.elapsed().as_secs_f64(), result)
}
