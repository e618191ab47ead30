//! Residuals of the fitted curve: whether they are independent, and how large they are.

use crate::joint::Group;
use crate::noise::{Likelihood, Noise};
use crate::posterior::Residuals;
use crate::trust::independent;

/// Lag-1 autocorrelation and the runs test (A. Wald, J. Wolfowitz, Ann. Math. Stat. 11 (1940) 147).
///
/// Independent residuals have a lag-1 correlation of sd 1/sqrt(m) and a number of runs of equal sign whose
/// z-score is standard normal; [`independent`] judges the two.
pub(crate) fn residuals(observed: &[f64], simulated: &[f64]) -> Residuals {
    let values: Vec<f64> = observed.iter().zip(simulated).map(|(y, o)| y - o).collect();
    let (lag1, runs_z) = tests(&values);
    let independent = independent(lag1, runs_z, values.len() as f64);
    Residuals { values, whitened: Vec::new(), lag1, runs_z, independent, misfit: None }
}

/// Lag-1 correlation of residuals about zero.
pub(crate) fn lag1(values: &[f64]) -> f64 {
    let squares: f64 = values.iter().map(|r| r * r).sum();
    let lagged: f64 = values.windows(2).map(|w| w[0] * w[1]).sum();
    if squares > 0.0 { lagged / squares } else { 0.0 }
}

/// Lag-1 correlation, and the score of the runs test.
fn tests(values: &[f64]) -> (f64, f64) {
    let lag1 = lag1(values);
    let signs: Vec<bool> = values.iter().filter(|r| **r != 0.0).map(|r| *r > 0.0).collect();
    let up = signs.iter().filter(|s| **s).count() as f64;
    let down = signs.len() as f64 - up;
    let runs = 1.0 + signs.windows(2).filter(|w| w[0] != w[1]).count() as f64;
    let n = up + down;
    let variance =
        if n > 1.0 { 2.0 * up * down * (2.0 * up * down - n) / (n * n * (n - 1.0)) } else { 0.0 };
    let runs_z =
        if variance > 0.0 { (runs - 1.0 - 2.0 * up * down / n) / variance.sqrt() } else { 0.0 };
    (lag1, runs_z)
}

/// Residuals of a curve of one group, and how large they are beside the noise that was expected.
pub(crate) fn residuals_of(group: &Group, likelihood: &Likelihood, outputs: &[f64]) -> Residuals {
    let mut found = residuals(group.observations.values(), outputs);
    if let Some(whitened) = likelihood.whitened(outputs) {
        (found.lag1, found.runs_z) = tests(&whitened);
        found.independent = independent(found.lag1, found.runs_z, whitened.len() as f64);
        found.whitened = whitened;
    }
    let expected = |i: usize| match group.noise {
        Noise::Inferred { s0, .. } | Noise::Correlated { s0, .. } | Noise::Robust { s0, .. } => {
            Some(s0)
        }
        _ => likelihood.fixed_sigma(i),
    };
    let squares = found.values.iter().enumerate().map(|(i, r)| Some((r / expected(i)?).powi(2)));
    let sum: Option<f64> = squares.sum();
    found.misfit = sum.map(|sum| (sum / found.values.len() as f64).sqrt());
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alternating_and_drifting_residuals_are_found_dependent() {
        let zero = vec![0.0; 40];
        let alternating: Vec<f64> = (0..40).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let drifting: Vec<f64> = (0..40).map(|i| f64::from(i) - 19.5).collect();
        let a = residuals(&alternating, &zero);
        let d = residuals(&drifting, &zero);
        assert!(!a.independent && a.lag1 < -0.9 && a.runs_z > 5.0);
        assert!(!d.independent && d.lag1 > 0.8 && d.runs_z < -5.0);
    }

    #[test]
    fn a_correlation_that_only_thousands_of_observations_show_is_not_worth_a_warning() {
        // Alternating halves shifted by a little: lag-1 correlation near 0.04, certain at 20 000 observations.
        let many: Vec<f64> = (0..20_000)
            .map(|i| {
                f64::from((i * 7919 % 10_007) - 5003) / 5003.0
                    + if i < 10_000 { 0.12 } else { -0.12 }
            })
            .collect();
        let r = residuals(&many, &vec![0.0; many.len()]);
        assert!(r.lag1 * 20_000f64.sqrt() > 2.3 && r.lag1 < 0.1, "{}", r.lag1);
        assert!(r.independent);
    }

    #[test]
    fn the_runs_score_is_the_textbook_one() {
        // ++--+ : 3 up, 2 down, 3 runs; mean 1 + 12/5 = 3.4, variance 12*(12-5)/(25*4) = 0.84.
        let r = residuals(&[1.0, 1.0, -1.0, -1.0, 1.0], &[0.0; 5]);
        approx::assert_relative_eq!(r.runs_z, (3.0 - 3.4) / 0.84f64.sqrt(), max_relative = 1e-12);
    }
}
