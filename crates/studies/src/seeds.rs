//! Many runs that differ by their seed, on all cores.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use workbench::error::RunError;

/// A pool of that many threads.
pub(crate) fn threads(count: usize) -> Result<rayon::ThreadPool, RunError> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build()
        .map_err(|error| RunError::new(format_args!("{count} threads cannot be started: {error}")))
}

/// Runs `job` for seeds 1, 2, .., each on one thread, as many at once as there are cores; in the order of seeds.
pub(crate) fn over_seeds<T: Send>(
    seeds: u64,
    job: &(dyn Fn(u64) -> Result<T, RunError> + Sync),
) -> Result<Vec<T>, RunError> {
    let next = AtomicU64::new(1);
    let done = Mutex::new(Vec::new());
    let work = || {
        let Ok(one) = threads(1) else { return };
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > seeds {
                return;
            }
            let result = one.install(|| job(seed));
            if let Ok(mut done) = done.lock() {
                done.push((seed, result));
            }
        }
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        (0..workers).for_each(|_| {
            scope.spawn(work);
        });
    });
    let mut done = done.into_inner().unwrap_or_default();
    if done.len() as u64 != seeds {
        return Err(RunError::new("no thread could be started"));
    }
    done.sort_by_key(|(seed, _)| *seed);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_seed_runs_once_and_results_are_in_the_order_of_seeds() {
        let squares = over_seeds(50, &|seed| Ok(seed * seed)).expect("threads");
        assert_eq!(squares, (1..=50).map(|seed| seed * seed).collect::<Vec<u64>>());
    }
}
