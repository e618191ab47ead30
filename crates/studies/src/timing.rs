//! Time of several methods, interleaved.

use std::time::{Duration, Instant};

use super::cpu_time::{self, Of};

/// Time of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Timing {
    /// Median over the rounds \[s\].
    pub(super) median_s: f64,
    /// Lower quartile \[s\].
    pub(super) lower_s: f64,
    /// Upper quartile \[s\].
    pub(super) upper_s: f64,
}

/// A method to be timed.
pub(super) type Method<'a> = Box<dyn FnMut() + 'a>;

/// A round of a fast method repeats it for so long.
const ROUND: Duration = Duration::from_millis(3);

/// What the clock counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Clock {
    /// Wall time.
    Wall,
    /// Processor time of this thread.
    Thread,
}

/// Times methods in turn, round by round, so that what disturbs the machine disturbs all of them.
///
/// A method that is faster than a round is repeated within it; a slow one is run at most for
/// `longest` in total, and at least three times.
pub(super) fn interleaved(
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
    times.iter_mut().map(|times| quartiles(times)).collect()
}

fn seconds(clock: Clock, method: &mut Method<'_>, count: u32) -> f64 {
    let mut repeat = || (0..count).for_each(|_| method());
    match clock {
        Clock::Wall => {
            let start = Instant::now();
            repeat();
            start.elapsed().as_secs_f64()
        }
        Clock::Thread => cpu_time::measured(Of::Thread, repeat).0,
    }
}

/// Of one time or more, which it sorts.
pub(super) fn quartiles(times: &mut [f64]) -> Timing {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let place = share * (times.len() - 1) as f64;
        let (below, above) = (times[place.floor() as usize], times[place.ceil() as usize]);
        below + (above - below) * place.fract()
    };
    Timing { median_s: at(0.5), lower_s: at(0.25), upper_s: at(0.75) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn median_and_quartiles_are_not_those_of_the_rounds() {
        let timing = quartiles(&mut [5.0, 1.0, 3.0, 2.0, 4.0]);
        assert_eq!((timing.median_s, timing.lower_s, timing.upper_s), (3.0, 2.0, 4.0));
        assert_eq!(quartiles(&mut [1.0, 2.0]).median_s, 1.5);
    }

    #[test]
    fn methods_do_not_all_run_or_a_slow_one_runs_on() {
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
