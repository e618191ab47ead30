//! Quantities that follow from the parameters, under the posterior, with Monte Carlo errors.

use serde::Serialize;
use smc_calib::{Point, Posterior, Weighted};

/// Median and 95 % interval of a quantity, and how far the next seed may be from them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Posterior probability that the quantity exists (a knee, a time at which a height is reached); the rest is
    /// conditional on it.
    pub probability: f64,
    /// Median.
    pub median: f64,
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// Monte Carlo standard errors of the lower end, the median and the upper end. Where a Gaussian process drew the points, those of as
    /// many independent draws as its errors of the parameters are worth.
    pub se: [f64; 3],
}

/// What follows from the parameters of each point of the posterior, with the point; without those of which it does not exist.
pub(crate) fn of_points<T>(
    posterior: &Posterior,
    of: impl Fn(&[f64]) -> Option<T>,
) -> impl Iterator<Item = (T, Point<'_>)> {
    posterior.points().filter_map(move |point| Some((of(point.theta)?, point)))
}

/// A quantity of each point that has it, with its weight.
pub(crate) fn weighted(posterior: &Posterior, value: impl Fn(&[f64]) -> Option<f64>) -> Weighted {
    Weighted::new(of_points(posterior, value).map(|(value, point)| (value, point.weight)))
}

/// The quantity `value` under a posterior, with its weighted points; none where no point has it.
pub(crate) fn estimate(
    posterior: &Posterior,
    value: impl Fn(&[f64]) -> Option<f64>,
) -> Option<(Estimate, Weighted)> {
    let finite = |theta: &[f64]| value(theta).filter(|value| value.is_finite());
    let values: Vec<(f64, Point<'_>)> = of_points(posterior, finite).collect();
    if values.is_empty() {
        return None;
    }
    let marginal = Weighted::new(values.iter().map(|(value, point)| (*value, point.weight)));
    let all: f64 = posterior.points().map(|point| point.weight).sum();
    let known = posterior.ess.by_errors.unwrap_or(posterior.ess.importance);
    let worth = 1.0 / (1.0 / known + 1.0 / posterior.draws.len().max(1) as f64);
    let [lower, median, upper] = [0.025, 0.5, 0.975].map(|p| {
        let quantile = marginal.quantile(p);
        (quantile, quantile_error((&values, worth), &marginal, p, quantile))
    });
    let estimate = Estimate {
        probability: (marginal.total() / all).min(1.0),
        median: median.0,
        eti95: [lower.0, upper.0],
        se: [lower.1, median.1, upper.1],
    };
    Some((estimate, marginal))
}

/// Standard error of a quantile: that of the share below it, carried over by the marginal itself. The share's is the spread over the
/// independent sub-nets; of draws of a process, that of so many independent draws as these are worth.
fn quantile_error(
    (values, worth): (&[(f64, Point<'_>)], f64),
    marginal: &Weighted,
    p: f64,
    quantile: f64,
) -> f64 {
    let replicates = values.iter().filter_map(|(_, point)| point.replicate);
    let shift = match replicates.max() {
        None => (p * (1.0 - p) / worth).sqrt(),
        Some(0) => return f64::MAX,
        Some(last) => {
            let mut parts = vec![0.0; last + 1];
            for (value, point) in values {
                let below = if *value < quantile { 1.0 } else { 0.0 };
                let replicate = point.replicate.unwrap_or_default();
                parts[replicate] += point.weight * (below - p) / marginal.total();
            }
            let r = parts.len() as f64;
            let mean = parts.iter().sum::<f64>() / r;
            let squares = parts.iter().map(|part| (part - mean).powi(2)).sum::<f64>();
            (r / (r - 1.0) * squares).sqrt()
        }
    };
    let [below, above] = [p - shift, p + shift].map(|p| marginal.quantile(p.clamp(0.0, 1.0)));
    0.5 * (above - below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::Calibration;
    use crate::input::material::Material;
    use crate::plan::{PairOptions, Planned};
    use crate::watch::Unwatched;

    fn posterior(seed: u64) -> Posterior {
        let frenkel = PairOptions { kinetics: dem_core::Kinetics::Frenkel, ..options(8192, seed) };
        calibrated(&frenkel)
    }

    fn options(samples: usize, seed: u64) -> PairOptions {
        PairOptions { material: Some(Material::Pa12), samples, seed, ..PairOptions::default() }
    }

    fn calibrated(options: &PairOptions) -> Posterior {
        of_plan(&options.plan().expect("a plan"))
    }

    fn of_plan(planned: &Planned) -> Posterior {
        Calibration::run(planned, &Unwatched::default()).expect("a posterior").posterior
    }

    #[test]
    fn a_parameter_as_a_derived_quantity_has_the_samplers_own_median_interval_and_error() {
        let posterior = posterior(5);
        let (found, _) = estimate(&posterior, |theta| Some(theta[0])).expect("an estimate");
        let own = &posterior.parameters[0].in_si;
        assert!((found.median / own.median - 1.0).abs() < 1e-3, "{found:?} {own:?}");
        assert!((found.eti95[0] / own.eti95.lower - 1.0).abs() < 1e-3);
        assert!((found.eti95[1] / own.eti95.upper - 1.0).abs() < 1e-3);
        assert!((found.probability - 1.0).abs() < 1e-12, "{}", found.probability);
        let ratio = found.se[1] / own.median_se;
        assert!((0.3..3.0).contains(&ratio), "error {} against {}", found.se[1], own.median_se);
    }

    #[test]
    fn what_follows_from_the_parameters_of_few_simulations_has_their_medians_and_intervals() {
        let peek = PairOptions { material: Some(Material::Peek), ..options(100, 1) };
        let mut planned = peek.plan().expect("a plan");
        // Of 4096 draws the ends of intervals are known to 0.04 sds.
        planned.plan.sampler.draws = 32_768;
        let posterior = of_plan(&planned);
        assert!(posterior.is_drawn());
        for (j, parameter) in posterior.parameters.iter().enumerate() {
            let (found, marginal) =
                estimate(&posterior, |theta| Some(theta[j].log10())).expect("an estimate");
            let own = &parameter.in_coordinate;
            for (of, own) in [
                (found.median, own.median),
                (found.eti95[0], own.eti95.lower),
                (found.eti95[1], own.eti95.upper),
            ] {
                let sd = parameter.in_coordinate.sd;
                assert!((of - own).abs() < 0.06 * sd, "{of} {own}");
            }
            let (mean, sd) = marginal.moments();
            assert!((mean - own.mean).abs() < 0.05 * own.sd, "{mean} {own:?}");
            assert!((sd / own.sd - 1.0).abs() < 0.1, "{sd} {own:?}");
        }
    }

    #[test]
    #[ignore = "long: run by .ci/run"]
    fn errors_are_as_large_as_the_scatter_over_seeds() {
        let runs: Vec<Estimate> = (0..20)
            .map(|seed| estimate(&posterior(seed), |theta| Some(theta[0].ln())).expect("there").0)
            .collect();
        let mean = runs.iter().map(|run| run.median).sum::<f64>() / 20.0;
        let scatter =
            (runs.iter().map(|run| (run.median - mean).powi(2)).sum::<f64>() / 19.0).sqrt();
        let stated = runs.iter().map(|run| run.se[1]).sum::<f64>() / 20.0;
        assert!((0.4..2.5).contains(&(stated / scatter)), "stated {stated}, scatter {scatter}");
    }

    #[test]
    fn a_quantity_that_half_of_the_samples_have_is_conditional_on_its_existence() {
        let posterior = posterior(5);
        let middle = posterior.parameters[0].in_si.median;
        let (found, _) =
            estimate(&posterior, |theta| (theta[0] > middle).then_some(theta[0])).expect("half");
        assert!((found.probability - 0.5).abs() < 0.02, "{found:?}");
        assert!(found.eti95[0] >= middle);
        assert!(estimate(&posterior, |_| None).is_none());
    }
}
