//! Observations that importance weights cannot leave out, left out by calibrating again.

use smc_calib::trust::khat_holds;
use smc_calib::{LeaveOneOut, Observations, Posterior, Problem, Settings, calibrate};

use crate::error::{Failure, RunError};
use crate::pair::model::NeckGrowth;
use crate::plan::Plan;
use crate::watch::Watch;

/// Most observations of one kinetics that are calibrated again.
const MOST: usize = 16;

/// Replaces predictive densities of k-hat above the limit by Z(all)/Z(all but one), and returns which these were.
///
/// `p(y_i | all others) = p(all) / p(all others)`: two evidences, the second from a calibration of its own.
pub(super) fn where_unreliable(
    plan: &Plan,
    model: &NeckGrowth,
    posterior: &Posterior,
    left_out: &mut LeaveOneOut,
    watch: &dyn Watch,
) -> Result<Vec<usize>, Failure> {
    let (_, measured) = plan.pair()?;
    // Without its first or last row a curve has another range, and correlated noise with it another prior of its length.
    let last = left_out.points.len() - 1;
    let ends = |i: usize| measured.noise.is_correlated() && (i == 0 || i == last);
    let mut unreliable: Vec<usize> = (0..left_out.points.len())
        .filter(|i| !khat_holds(left_out.points[*i].khat) && !ends(*i))
        .collect();
    // The worst ones, where there are too many.
    unreliable.sort_by(|a, b| left_out.points[*b].khat.total_cmp(&left_out.points[*a].khat));
    unreliable.truncate(MOST);
    unreliable.sort_unstable();
    if measured.control.len() < 2 {
        return Ok(Vec::new());
    }
    for (done, &i) in unreliable.iter().enumerate() {
        if watch.stop().asked() {
            return Err(Failure::Interrupted);
        }
        watch.now(&format!("left-out observation {} of {}", done + 1, unreliable.len()));
        let without = |values: &[f64]| -> Vec<f64> {
            let kept = values.iter().enumerate().filter(|(k, _)| *k != i);
            kept.map(|(_, value)| *value).collect()
        };
        let times = without(&measured.control);
        let simulator = model.at_times(times.clone());
        let mut observations =
            Observations::new(times, without(&measured.values)).map_err(RunError::new)?;
        if let Some(sigma) = &measured.sigma {
            observations = observations.with_sigma(without(sigma)).map_err(RunError::new)?;
        }
        let problem = Problem {
            simulator: &simulator,
            parameters: plan.parameters.clone(),
            observations,
            noise: measured.noise.clone(),
        };
        let settings = Settings { ess_target: None, path: false, ..plan.sampler.clone() };
        let again = calibrate(&problem, &settings, &mut ()).map_err(RunError::new)?;
        let density = posterior.log_evidence.value - again.log_evidence.value;
        let point = &mut left_out.points[i];
        left_out.effective_parameters += point.ln_density - density;
        left_out.se = left_out.se.hypot(again.log_evidence.se);
        point.ln_density = density;
    }
    let m = left_out.points.len() as f64;
    left_out.ln_density = left_out.points.iter().map(|point| point.ln_density).sum();
    let mean = left_out.ln_density / m;
    let squares: f64 = left_out.points.iter().map(|point| (point.ln_density - mean).powi(2)).sum();
    left_out.spread = (m * squares / (m - 1.0).max(1.0)).sqrt();
    Ok(unreliable)
}
