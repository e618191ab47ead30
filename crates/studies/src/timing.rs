//! Time of one job, and of several methods in turn; memory of the process.

use std::time::{Duration, Instant};

use crate::quantile::quantile;

/// Kind of time that is measured. Other programs on the machine disturb processor time less than wall time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Clock {
    /// Wall time.
    Wall,
    /// Processor time of this thread.
    Thread,
    /// Processor time of all threads of this process.
    Process,
}

impl Clock {
    /// Time that a job takes \[s\], and what the job returns.
    pub(crate) fn measure<T>(self, job: impl FnOnce() -> T) -> (f64, T) {
        let start = Instant::now();
        let before_s = self.processor_s();
        let result = job();
        let wall_s = start.elapsed().as_secs_f64();
        let spent_s =
            self.processor_s().zip(before_s).map(|(after_s, before_s)| after_s - before_s);
        (spent_s.unwrap_or(wall_s), result)
    }

    /// Processor time so far \[s\]; none for wall time, which then stands in for it.
    #[cfg(unix)]
    fn processor_s(self) -> Option<f64> {
        use rustix::time::{ClockId, clock_gettime};
        let time = clock_gettime(match self {
            Self::Wall => return None,
            Self::Thread => ClockId::ThreadCPUTime,
            Self::Process => ClockId::ProcessCPUTime,
        });
        Some(time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64)
    }

    #[cfg(not(unix))]
    fn processor_s(self) -> Option<f64> {
        None
    }
}

/// Time of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Timing {
    /// Median over the rounds \[s\].
    pub(crate) median_s: f64,
    /// Lower quartile \[s\].
    pub(crate) lower_s: f64,
    /// Upper quartile \[s\].
    pub(crate) upper_s: f64,
}

impl Timing {
    /// Median and quartiles of one time or more.
    pub(crate) fn of(mut times_s: Vec<f64>) -> Self {
        times_s.sort_by(f64::total_cmp);
        let at = |share| quantile(&times_s, share);
        Self { median_s: at(0.5), lower_s: at(0.25), upper_s: at(0.75) }
    }
}

/// A method to be timed.
pub(crate) type Method<'a> = Box<dyn FnMut() + 'a>;

/// A fast method is repeated for this long within a round.
const ROUND: Duration = Duration::from_millis(3);

/// Times methods in turn, round by round, so that what disturbs the machine disturbs all of them.
///
/// A slow method runs at most for `longest` in total, and at least three times.
pub(crate) fn interleaved(
    clock: Clock,
    methods: &mut [Method<'_>],
    rounds: usize,
    longest: Duration,
) -> Vec<Timing> {
    let repeats: Vec<(u32, usize)> = methods
        .iter_mut()
        .map(|method| {
            let mut count = 1;
            loop {
                let took = seconds(clock, method, count);
                if took >= 0.5 * ROUND.as_secs_f64() || count >= 1 << 20 {
                    let fits = (longest.as_secs_f64() / took.max(1e-9)) as usize;
                    return (count, rounds.min(fits).max(3));
                }
                count *= 2;
            }
        })
        .collect();
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); methods.len()];
    for round in 0..rounds {
        for (place, method) in methods.iter_mut().enumerate() {
            let (count, most) = repeats[place];
            if round < most {
                times[place].push(seconds(clock, method, count) / f64::from(count));
            }
        }
    }
    times.into_iter().map(Timing::of).collect()
}

fn seconds(clock: Clock, method: &mut Method<'_>, count: u32) -> f64 {
    clock.measure(|| (0..count).for_each(|_| method())).0
}

/// Highest memory of this process so far \[MiB\].
pub(crate) fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timing_is_the_median_and_the_quartiles_of_the_rounds() {
        let timing = Timing::of(vec![5.0, 1.0, 3.0, 2.0, 4.0]);
        assert_eq!((timing.median_s, timing.lower_s, timing.upper_s), (3.0, 2.0, 4.0));
        assert_eq!(Timing::of(vec![1.0, 2.0]).median_s, 1.5);
    }

    #[test]
    fn every_method_runs_and_a_slow_one_stops_in_time() {
        let (mut fast, mut slow) = (0u64, 0u64);
        {
            let mut methods: Vec<Method<'_>> = vec![
                Box::new(|| fast += 1),
                Box::new(|| {
                    slow += 1;
                    std::thread::sleep(Duration::from_millis(4));
                }),
            ];
            let timings = interleaved(Clock::Wall, &mut methods, 50, Duration::from_millis(20));
            assert!(timings[0].median_s < timings[1].median_s);
        }
        assert!(fast > 1000 && (4..=8).contains(&slow), "{fast} {slow}");
    }
}
