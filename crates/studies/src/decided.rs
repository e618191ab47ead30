//! How much of a calibration's simulated time comes after a sample's weight is decided.
//!
//! The likelihood of a whole curve is at most what it would be if every observation still to come were met exactly:
//! with sigma integrated out `ln p(y | theta) <= c - (nu0 + m)/2 ln(1 + S_k/(nu0 s0^2))`, `S_k` the squared residuals
//! so far, which only grow. Where that bound puts the weights of all such samples together below the rounding of the
//! largest weight, what is left of the curve cannot change the posterior.

use smc_calib::{Likelihood, Posterior};

use workbench::error::{Failure, RunError};
use workbench::input::material::Material;
use workbench::number::significant;

use crate::pair::Calibration;
use crate::report::Table;

/// Shares of the simulated time after the decision.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Decided {
    /// In the final stage, over the time of all stages: no proposal depends on it.
    final_stage: f64,
    /// In the stages before, over the time of all stages, by the weights of the result.
    before: f64,
}

/// A table with a row for each material.
pub(crate) fn table() -> Result<Table, Failure> {
    let mut table = Table::new(&[
        "material",
        "simulated time behind the decision, final stage",
        "the stages before",
    ]);
    for material in Material::ALL {
        let share = of(material)?;
        let percent = |share: f64| format!("{} %", significant(100.0 * share, 2));
        table.push(vec![
            material.title().to_owned(),
            percent(share.final_stage),
            percent(share.before),
        ]);
    }
    Ok(table)
}

fn of(material: Material) -> Result<Decided, Failure> {
    let curve = Calibration::of(material)?;
    let posterior = curve
        .posterior(16_384, 1)
        .map_err(|error| RunError::new(format!("{material}: {error}")))?;
    let last_stage = posterior.stages.len().saturating_sub(1);
    let limit = limit(&posterior);
    let (measured, times_s) = (curve.observations.values(), curve.observations.control());
    let (mut total, mut after) = (0.0, [0.0; 2]);
    for sample in &posterior.samples {
        let (Some(ln_l), Some(ln_w)) = (sample.log_likelihood, sample.log_weight) else { continue };
        let Some(outputs) = curve.at(&sample.z, <[f64]>::to_vec) else { continue };
        let end_s = end_of_growth(&outputs, times_s);
        let k = decided_at(&curve.likelihood, &outputs, measured, limit - (ln_w - ln_l));
        total += end_s;
        after[usize::from(sample.stage < last_stage)] +=
            k.map_or(0.0, |k| (end_s - times_s[k]).max(0.0));
    }
    Ok(Decided { final_stage: after[0] / total, before: after[1] / total })
}

/// Log weight below which all samples together are lost in the rounding of the largest.
fn limit(posterior: &Posterior) -> f64 {
    let largest = posterior
        .samples
        .iter()
        .filter_map(|sample| sample.log_weight)
        .fold(f64::NEG_INFINITY, f64::max);
    largest + (f64::EPSILON / posterior.samples.len() as f64).ln()
}

/// Time of the first observation at full coalescence, where a simulation ends; else the last.
fn end_of_growth(outputs: &[f64], times_s: &[f64]) -> f64 {
    let end = outputs[outputs.len() - 1];
    times_s[outputs.partition_point(|value| *value < end)]
}

/// First observation after which the log likelihood cannot reach `least`.
fn decided_at(
    likelihood: &Likelihood,
    outputs: &[f64],
    measured: &[f64],
    least: f64,
) -> Option<usize> {
    let mut best = measured.to_vec();
    (0..outputs.len()).find(|&k| {
        best[k] = outputs[k];
        likelihood.ln_joint(&best) < least
    })
}

#[cfg(test)]
mod tests {
    use smc_calib::{Noise, Observations};

    use super::*;

    #[test]
    fn a_weight_is_decided_where_its_bound_falls_below_the_limit() {
        let measured = vec![0.1, 0.2, 0.3, 0.4];
        let observations =
            Observations::new(vec![1.0, 2.0, 3.0, 4.0], measured.clone()).expect("four");
        let likelihood =
            Likelihood::new(&Noise::Inferred { nu0: 4.0, s0: 0.05 }, &observations).expect("noise");
        let outputs = [0.1, 0.3, 0.5, 0.4];
        let whole = likelihood.ln_joint(&outputs);
        // The last residual is zero: the bound after the third observation is the likelihood itself.
        let decided = |least| decided_at(&likelihood, &outputs, &measured, least);
        assert_eq!(decided(whole), None);
        assert_eq!(decided(whole + 1e-9), Some(2));
        let after_two = likelihood.ln_joint(&[0.1, 0.3, 0.3, 0.4]);
        assert_eq!(decided(after_two + 1e-9), Some(1));
        assert_eq!(decided(likelihood.ln_joint(&measured) + 1e-9), Some(0));
        assert_eq!(end_of_growth(&[0.1, 0.5, 0.5], &[1.0, 2.0, 3.0]), 2.0);
        assert_eq!(end_of_growth(&[0.1, 0.5, 0.6], &[1.0, 2.0, 3.0]), 3.0);
    }
}
