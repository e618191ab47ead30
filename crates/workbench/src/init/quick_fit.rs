//! A quick look at a table: the best Frenkel curve, and whether the data level off below full coalescence.

use dem_core::{
    Kinetics, PairScene, PairSpec, Powder, Sintering, SolverKind, SolverSettings, contact_ratios,
};

use crate::error::RunError;
use crate::input::experiment::full_coalescence;
use crate::input::observation_table::ObservationTable;
use crate::pair::frenkel_fit::{Best, least_squares};

/// Rows that are looked at, evenly spread over a longer table.
const MOST_ROWS: usize = 500;

/// Steps between the final contact ratios that are tried.
const STEP: f64 = 0.01;

/// Rows that must lie on a plateau.
const PLATEAU_ROWS: usize = 3;

/// The Frenkel curve that comes closest to a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct QuickFit {
    /// Its sintering time \[s\].
    pub(super) tau_s: f64,
    /// The final contact ratio: that of full coalescence, or that of the plateau.
    pub(super) final_contact_ratio: f64,
    /// Rows on a plateau below full coalescence, among those that were looked at.
    pub(super) plateau_rows: Option<usize>,
    /// Root mean square of its residuals.
    pub(super) rms: f64,
}

/// Fits the Frenkel curve by least squares in tau_s, and takes a lower final contact ratio where the Bayesian information
/// criterion asks for that parameter by more than 6 (strong evidence) and at least three rows lie on the plateau.
///
/// None without an observation after first contact. Exact, and the same for the same table.
pub(super) fn quick_fit(
    powder: Powder,
    table: &ObservationTable,
) -> Result<Option<QuickFit>, RunError> {
    let every = table.len().div_ceil(MOST_ROWS).max(1);
    let some = |values: &[f64]| -> Vec<f64> { values.iter().step_by(every).copied().collect() };
    let (times_s, observed) = (some(&table.time_s), some(&table.contact_ratio));
    let last_s = times_s.last().copied().unwrap_or_default();
    if last_s <= 0.0 {
        return Ok(None);
    }
    let n = observed.len() as f64;
    let fit = |phi: f64| best(powder, phi, &times_s, &observed);
    let full = fit(full_coalescence())?;
    let whole = QuickFit {
        tau_s: full.tau_s,
        final_contact_ratio: full_coalescence(),
        plateau_rows: None,
        rms: (full.sum_of_squares / n).sqrt(),
    };
    let largest = observed.iter().copied().fold(0.0, f64::max);
    let (first, end) = ((0.5 * largest).max(0.1), (1.1 * largest).min(full_coalescence() - STEP));
    let tried = (0..).map(|k| STEP * ((first / STEP).ceil() + f64::from(k)));
    let mut lower: Option<(f64, Best)> = None;
    for phi in tried.take_while(|phi| *phi <= end) {
        // The smallest have no scene.
        let Ok(best) = fit(phi) else { continue };
        if lower.is_none_or(|(_, least)| best.sum_of_squares < least.sum_of_squares) {
            lower = Some((phi, best));
        }
    }
    let Some((phi, best)) = lower else { return Ok(Some(whole)) };
    let start = scene(powder, phi)?.start_contact_ratio();
    let arrival_s = (phi * phi - start * start) * best.tau_s;
    let rows = times_s.iter().filter(|time| **time >= arrival_s).count();
    let gain = n * (full.sum_of_squares / best.sum_of_squares.max(f64::MIN_POSITIVE)).ln();
    Ok(Some(if gain - n.ln() > 6.0 && rows >= PLATEAU_ROWS {
        QuickFit {
            tau_s: best.tau_s,
            // The steps are hundredths.
            final_contact_ratio: (phi / STEP).round() / 100.0,
            plateau_rows: Some(rows),
            rms: (best.sum_of_squares / n).sqrt(),
        }
    } else {
        whole
    }))
}

/// The best Frenkel curve up to a final contact ratio.
fn best(powder: Powder, phi: f64, times_s: &[f64], observed: &[f64]) -> Result<Best, RunError> {
    let last_s = times_s.last().copied().unwrap_or_default();
    let scene = scene(powder, phi)?;
    least_squares(last_s, observed, |sintering, out| curve(&scene, sintering, times_s, out))
}

/// A pair of the powder that grows up to a final contact ratio.
pub(super) fn scene(powder: Powder, phi: f64) -> Result<PairScene, RunError> {
    PairSpec::new(powder, phi).build().map_err(RunError::new)
}

/// The Frenkel curve of a pair.
pub(super) fn curve(
    scene: &PairScene,
    sintering: &Sintering,
    times_s: &[f64],
    out: &mut [f64],
) -> Result<(), RunError> {
    let exact = SolverSettings::of(SolverKind::ClosedForm);
    contact_ratios(scene, Kinetics::Frenkel, sintering, &exact, times_s, out)
        .map(drop)
        .map_err(RunError::new)
}

#[cfg(test)]
mod tests {
    use dem_core::paper;

    use super::*;

    fn table(phi: f64, tau_s: f64, last_s: f64, rows: usize) -> ObservationTable {
        let time_s: Vec<f64> = (1..=rows).map(|k| last_s * k as f64 / rows as f64).collect();
        let mut contact_ratio = vec![0.0; rows];
        let sintering = Sintering { c1: 1.0, tau_s, delta_c: 1.0, lambda: 0.0 };
        let scene = scene(paper::PA12, phi).expect("a pair");
        curve(&scene, &sintering, &time_s, &mut contact_ratio).expect("a curve");
        // A scatter of 0.01 that repeats itself.
        for (k, ratio) in contact_ratio.iter_mut().enumerate() {
            *ratio += 0.01 * [1.0, -1.0, 0.5, -0.5, -1.0, 1.0][k % 6];
        }
        let lines = (0..rows).collect();
        ObservationTable { time_s, contact_ratio, sigma: None, lines, how: None }
    }

    #[test]
    fn frenkel_data_give_back_their_sintering_time_and_their_plateau() {
        for (phi, tau_s) in [(1.0, 3.0), (0.8, 40.0)] {
            let found = quick_fit(paper::PA12, &table(phi, tau_s, 3.0 * tau_s, 60));
            let found = found.expect("a fit").expect("times after zero");
            assert!((found.tau_s / tau_s - 1.0).abs() < 0.03, "{found:?}");
            assert!((found.final_contact_ratio - phi).abs() < 0.011, "{found:?}");
            assert!(found.plateau_rows.is_some_and(|rows| rows > 30), "{found:?}");
            assert!((found.rms - 0.0087).abs() < 0.002, "{found:?}");
        }
    }

    #[test]
    fn data_that_still_grow_or_coalesce_fully_have_no_plateau_of_their_own() {
        for (last_s, tau_s) in [(0.5, 1.0), (4.0, 1.0), (0.02, 1.0)] {
            let found = quick_fit(paper::PA12, &table(full_coalescence(), tau_s, last_s, 40));
            let found = found.expect("a fit").expect("times after zero");
            assert_eq!(found.plateau_rows, None, "{found:?}");
            assert_eq!(found.final_contact_ratio, full_coalescence());
            assert!((found.tau_s / tau_s - 1.0).abs() < 0.1, "{found:?}");
        }
        let mut nothing = table(1.0, 1.0, 1.0, 1);
        nothing.time_s = vec![0.0];
        assert_eq!(quick_fit(paper::PA12, &nothing).expect("no fit"), None);
    }

    #[test]
    fn long_tables_are_thinned_and_give_the_same() {
        let long =
            quick_fit(paper::PA12, &table(1.0, 5.0, 20.0, 5000)).expect("a fit").expect("one");
        assert!(
            (long.tau_s / 5.0 - 1.0).abs() < 0.01 && long.final_contact_ratio == 1.0,
            "{long:?}"
        );
    }
}
