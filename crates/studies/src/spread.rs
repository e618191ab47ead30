//! Spread of errors over many seeds.

use crate::cases::Errors;
use crate::quantile::{quantile, rms};

/// Spread of errors over the seeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    /// Median over the seeds of the worst parameter's absolute error.
    pub(crate) median: f64,
    /// Lower end of the 90 % band over the seeds.
    pub(crate) lower: f64,
    /// Upper end of the 90 % band.
    pub(crate) upper: f64,
    /// Root mean square over the seeds, of the worst parameter.
    pub(crate) rms: f64,
}

impl Spread {
    /// Of one row of signed errors per seed, one column per parameter.
    pub(crate) fn of(rows: &[&[f64]]) -> Self {
        let mut worst: Vec<f64> =
            rows.iter().map(|row| row.iter().map(|e| e.abs()).fold(0.0, f64::max)).collect();
        worst.sort_by(f64::total_cmp);
        let columns = rows.first().map_or(0, |row| row.len());
        let rms = (0..columns).map(|j| rms(rows.iter().map(|row| row[j]))).fold(0.0, f64::max);
        let at = |p| quantile(&worst, p);
        Self { median: at(0.5), lower: at(0.05), upper: at(0.95), rms }
    }
}

/// Spreads of the errors of mean, sd and log evidence.
pub(crate) struct Spreads {
    /// In this order; that of the log evidence where the method has one.
    pub(crate) of: [Option<Spread>; 3],
}

impl Spreads {
    pub(crate) fn new(errors: &[Errors]) -> Self {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_that_of_the_worst_parameter_of_each_seed() {
        let rows: [&[f64]; 3] = [&[0.0, -3.0], &[1.0, 0.0], &[2.0, 0.0]];
        let spread = Spread::of(&rows);
        assert_eq!(spread.median, 2.0);
        assert!((spread.rms - 3f64.sqrt()).abs() < 1e-15);
        assert!((spread.lower - 1.1).abs() < 1e-12 && (spread.upper - 2.9).abs() < 1e-12);
    }
}
