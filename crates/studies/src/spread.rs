//! Many runs that differ by their seed, and what their errors come to.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::cases::Errors;
use workbench::error::RunError;

/// Runs `job` for seeds 1, 2, .., each on one thread, as many at once as there are cores; in the order of seeds.
pub(super) fn over_seeds<T: Send>(
    seeds: u64,
    job: &(dyn Fn(u64) -> Result<T, RunError> + Sync),
) -> Result<Vec<T>, RunError> {
    let next = AtomicU64::new(1);
    let done = Mutex::new(Vec::new());
    let work = || {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let Ok(one) = one else { return };
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

/// What many errors come to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    /// Median over the seeds of the worst parameter's absolute error.
    pub(super) median: f64,
    /// The 90 % band over the seeds.
    pub(super) lower: f64,
    /// Its upper end.
    pub(super) upper: f64,
    /// Root mean square over the seeds, of the worst parameter.
    pub(super) rms: f64,
}

impl Spread {
    /// Of one row of signed errors per seed, one column per parameter.
    pub(super) fn of(rows: &[&[f64]]) -> Self {
        let mut worst: Vec<f64> =
            rows.iter().map(|row| row.iter().map(|e| e.abs()).fold(0.0, f64::max)).collect();
        worst.sort_by(f64::total_cmp);
        let columns = rows.first().map_or(0, |row| row.len());
        let rms = (0..columns)
            .map(|j| {
                (rows.iter().map(|row| row[j] * row[j]).sum::<f64>() / rows.len() as f64).sqrt()
            })
            .fold(0.0, f64::max);
        let at = |p| quantile(&worst, p);
        Self { median: at(0.5), lower: at(0.05), upper: at(0.95), rms }
    }
}

/// Mean, sd and log evidence.
pub(super) struct Spreads {
    /// Of the means, the sds, and (where the method has it) the log evidence.
    pub(super) of: [Option<Spread>; 3],
}

impl Spreads {
    pub(super) fn new(errors: &[Errors]) -> Self {
        let means: Vec<&[f64]> = errors.iter().map(|e| e.mean.as_slice()).collect();
        let sds: Vec<&[f64]> = errors.iter().map(|e| e.sd.as_slice()).collect();
        let evidences: Vec<&[f64]> = errors.iter().map(|e| e.log_evidence.as_slice()).collect();
        let known = evidences.iter().all(|e| !e.is_empty());
        Self {
            of: [
                Some(Spread::of(&means)),
                Some(Spread::of(&sds)),
                known.then(|| Spread::of(&evidences)),
            ],
        }
    }
}

/// Quantile of sorted values, linear in between where both neighbours are finite.
pub(super) fn quantile(sorted: &[f64], p: f64) -> f64 {
    if sorted.is_empty() {
        return f64::NAN;
    }
    let place = p * (sorted.len() - 1) as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    if below == above { below } else { below + (above - below) * place.fract() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seeds_are_lost_or_out_of_order() {
        let squares = over_seeds(50, &|seed| Ok(seed * seed)).expect("threads");
        assert_eq!(squares, (1..=50).map(|seed| seed * seed).collect::<Vec<u64>>());
    }

    #[test]
    fn the_worst_parameter_is_mixed_with_the_others() {
        let rows: [&[f64]; 3] = [&[0.0, -3.0], &[1.0, 0.0], &[2.0, 0.0]];
        let spread = Spread::of(&rows);
        assert_eq!(spread.median, 2.0);
        assert!((spread.rms - 3f64.sqrt()).abs() < 1e-15);
        assert!((spread.lower - 1.1).abs() < 1e-12 && (spread.upper - 2.9).abs() < 1e-12);
    }
}
