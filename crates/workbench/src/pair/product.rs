//! The product C1 delta_c^2, the only combination of the two on which the `regime-map` kinetics depend.

use smc_calib::normal::{self, Tails};
use smc_calib::{Posterior, Prior};

use crate::pair::derived::weighted;
use crate::pair::parameter::ParameterName;
use crate::plan::{PairPlan, Plan};
use crate::record::ProductSummary;
use smc_calib::Weighted;

/// Points over which the prior of the product is integrated.
const PRIOR_POINTS: usize = 512;

/// Posterior of the product, for kinetics that use C1 and delta_c and do not separate them.
pub(crate) fn summary(
    plan: &Plan,
    pair: &PairPlan,
    posterior: &Posterior,
) -> Option<ProductSummary> {
    let kinetics = pair.kinetics;
    if !kinetics.uses_c1_delta_c() || kinetics.separates_c1_from_delta_c() {
        return None;
    }
    let place = |model| plan.parameters.iter().position(|p| p.name == pair.calibrated(model));
    let (c1, delta_c) = (place(ParameterName::C1)?, place(ParameterName::DeltaC)?);
    let of = |theta: &[f64]| theta[c1] * theta[delta_c] * theta[delta_c];
    let log10 = weighted(posterior, |theta| Some(of(theta).log10()));
    let prior = ProductPrior::new(&plan.parameters[c1].prior, &plan.parameters[delta_c].prior);
    let scores = weighted(posterior, |theta| Some(prior.score(of(theta))));
    let (mean_log10, sd_log10) = log10.moments();
    let paper = pair.material.map(|material| {
        let si = material.table3_sintering();
        si.c1 * si.delta_c * si.delta_c
    });
    Some(ProductSummary {
        name: "c1 * delta_c^2".to_owned(),
        unit: "m2/(Pa s)".to_owned(),
        map: of(&posterior.map.theta),
        median: 10f64.powf(log10.quantile(0.5)),
        eti95: log10.interval(0.95).map(|end| 10f64.powf(end)),
        mean_log10,
        sd_log10,
        information_gain_bits: information_gain_bits(&scores),
        paper,
        paper_percentile: paper.map(|value| 100.0 * log10.share_below(value.log10())),
    })
}

/// The prior of the product, from those of its factors.
struct ProductPrior<'a> {
    c1: Vec<f64>,
    delta_c: &'a Prior,
}

impl<'a> ProductPrior<'a> {
    fn new(c1: &Prior, delta_c: &'a Prior) -> Self {
        let n = PRIOR_POINTS as f64;
        Self { c1: (0..PRIOR_POINTS).map(|k| c1.quantile((k as f64 + 0.5) / n)).collect(), delta_c }
    }

    /// Normal score of a product: the tails of delta_c given C1, averaged over C1.
    fn score(&self, product: f64) -> f64 {
        let mut mean = Tails { below: 0.0, above: 0.0 };
        for c1 in &self.c1 {
            let tails = self.delta_c.tails((product / c1).sqrt());
            mean.below += tails.below / self.c1.len() as f64;
            mean.above += tails.above / self.c1.len() as f64;
        }
        normal::quantile_of(mean)
    }
}

/// Divergence from the prior of a marginal given in normal scores, over 64 bins of equal posterior mass and two open
/// ones of 0.05 % at the ends.
fn information_gain_bits(scores: &Weighted) -> f64 {
    const BINS: usize = 64;
    const END: f64 = 5e-4;
    let inner = (1.0 - 2.0 * END) / BINS as f64;
    let mut bins = vec![END];
    bins.extend([inner; BINS]);
    bins.push(END);
    let mut edges = vec![f64::NEG_INFINITY];
    edges.extend((0..=BINS).map(|k| scores.quantile(END + k as f64 * inner)));
    edges.push(f64::INFINITY);
    let gain: f64 = edges
        .windows(2)
        .zip(bins)
        .map(|(edge, mass)| {
            // On the side on which the areas are small.
            let prior = if edge[0] > 0.0 {
                normal::cdf(-edge[0]) - normal::cdf(-edge[1])
            } else {
                normal::cdf(edge[1]) - normal::cdf(edge[0])
            };
            mass * (mass / prior.max(1e-300)).log2()
        })
        .sum();
    gain.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use smc_calib::PriorSpec;

    #[test]
    fn half_of_the_prior_left_is_one_bit_and_the_whole_prior_none() {
        let points = 20_000;
        let scores = |from: f64, to: f64| {
            Weighted::new((0..points).map(|k| {
                let p = from + (to - from) * (k as f64 + 0.5) / points as f64;
                (normal::quantile(p), 1.0)
            }))
        };
        assert!(information_gain_bits(&scores(0.0, 1.0)) < 1e-3);
        assert!((information_gain_bits(&scores(0.5, 1.0)) - 1.0).abs() < 0.02);
        assert!((information_gain_bits(&scores(0.25, 0.5)) - 2.0).abs() < 0.03);
    }

    #[test]
    fn the_prior_of_the_product_of_two_log_uniforms_is_their_convolution() {
        // ln c1 on (0, 1), ln delta_c on (0, 1): u = ln c1 + 2 ln delta_c has P(u < 1/2) = (1/2)^2/4,
        // P(u < 3/2) = 1/2 and P(u < 5/2) = 1 - 1/16.
        let e = std::f64::consts::E;
        let unit = Prior::new(PriorSpec::LogUniform { lower: 1.0, upper: e }).expect("a prior");
        let prior = ProductPrior::new(&unit, &unit);
        for (u, p) in [(0.5f64, 0.0625), (1.5, 0.5), (2.5, 0.9375)] {
            let found = normal::cdf(prior.score(u.exp()));
            assert!((found - p).abs() < 2e-5, "u = {u}: {found}, not {p}");
        }
    }
}
