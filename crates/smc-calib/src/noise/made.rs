//! Errors drawn from the prior of a noise model, for data that are made; and where their shape lies in a posterior.

use super::correlated::Correlated;
use super::draws::OUTLIERS;
use super::likelihood::{Kind, Likelihood};
use super::robust::{OUTLIER_SHARE, OUTLIER_WIDTH};
use super::rule::{length, share};
use super::{DistanceScale, FixedSigma, Noise, NoiseDraw, NoiseShape};
use crate::Observations;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Gamma, StandardNormal};

/// Nodes over length and share with which a truth is ranked: cells much narrower than posteriors are.
const FINE: [usize; 2] = [48, 48];

impl Noise {
    /// Draws the noise from its prior, and one error for each observation at `control`. None for noise without a prior of
    /// its size: tuned, relative to the values or given point by point.
    pub fn draw_errors(
        &self,
        control: &[f64],
        rng: &mut impl Rng,
    ) -> Option<(NoiseDraw, Vec<f64>)> {
        let independent = |sigma: f64, rng: &mut dyn FnMut() -> f64| -> Vec<f64> {
            control.iter().map(|_| sigma * rng()).collect()
        };
        match self {
            Self::Fixed { sigma: FixedSigma::Absolute(sigma) } => {
                let errors = independent(*sigma, &mut || rng.sample(StandardNormal));
                Some((NoiseDraw { sigma: *sigma, shape: None }, errors))
            }
            Self::Inferred { nu0, s0 } => {
                let sigma = drawn_sigma(*nu0, *s0, rng)?;
                let errors = independent(sigma, &mut || rng.sample(StandardNormal));
                Some((NoiseDraw { sigma, shape: None }, errors))
            }
            Self::Robust { nu0, s0 } => {
                let sigma = drawn_sigma(*nu0, *s0, rng)?;
                let errors = independent(sigma, &mut || {
                    let outlier = rng.random::<f64>() < OUTLIER_SHARE;
                    let score: f64 = rng.sample(StandardNormal);
                    if outlier { OUTLIER_WIDTH * score } else { score }
                });
                Some((NoiseDraw { sigma, shape: Some(OUTLIERS) }, errors))
            }
            Self::Correlated { nu0, s0, scale, .. } => {
                let scale = scale.unwrap_or_else(|| DistanceScale::of(control));
                let Some(range) = scale.range(control) else {
                    return Self::Inferred { nu0: *nu0, s0: *s0 }.draw_errors(control, rng);
                };
                let sigma = drawn_sigma(*nu0, *s0, rng)?;
                let (length, white_share) = (length(range, rng.random()), share(rng.random()));
                let errors = correlated(scale, control, [length, white_share], rng);
                let shape = Some(NoiseShape::Correlated { length, white_share });
                let errors = errors.into_iter().map(|e| sigma * e).collect();
                Some((NoiseDraw { sigma, shape }, errors))
            }
            _ => None,
        }
    }
}

/// sigma with `sigma^2 ~ Inverse-Gamma(nu0/2, nu0 s0^2/2)`.
fn drawn_sigma(nu0: f64, s0: f64, rng: &mut impl Rng) -> Option<f64> {
    let gamma = Gamma::new(0.5 * nu0, 1.0).ok()?.sample(rng);
    Some((0.5 * nu0 * s0 * s0 / gamma).sqrt())
}

/// The process step by step, exactly, and white noise on it, both of variance 1 and weighted by their shares.
fn correlated(
    scale: DistanceScale,
    control: &[f64],
    [length, white]: [f64; 2],
    rng: &mut impl Rng,
) -> Vec<f64> {
    let mut state = 0.0;
    (0..control.len())
        .map(|k| {
            let alike = match k {
                0 => 0.0,
                _ => scale.correlation(control[k - 1], control[k], length),
            };
            let fresh: f64 = rng.sample(StandardNormal);
            state = alike * state + (1.0 - alike * alike).sqrt() * fresh;
            let own: f64 = rng.sample(StandardNormal);
            (1.0 - white).sqrt() * state + white.sqrt() * own
        })
        .collect()
}

impl Likelihood {
    /// The same noise with so many nodes that a correlation length and a white share can be ranked; none for models that
    /// have neither.
    pub(crate) fn ranking(&self, observations: &Observations) -> Option<Self> {
        let Kind::Correlated(model) = &self.kind else { return None };
        let (a, sum0) = model.shape_and_sum();
        let nu0 = 2.0 * a - observations.len() as f64;
        let fine = Correlated::new([nu0, sum0], Some(model.scale()), Some(FINE), observations);
        let kind = Kind::Correlated(fine.ok()??);
        Some(Self { values: self.values.clone(), kind })
    }

    /// Probabilities of a correlation length below that of `truth`, and of a smaller white share, given the curve.
    pub(crate) fn below(&self, truth: &NoiseShape, outputs: &[f64]) -> Option<[f64; 2]> {
        let (Kind::Correlated(model), NoiseShape::Correlated { length, white_share }) =
            (&self.kind, truth)
        else {
            return None;
        };
        let known = model.posterior(self.values(), outputs);
        Some([0, 1].map(|axis| {
            let at = if axis == 0 { *length } else { *white_share };
            let prior = model.prior(axis);
            let mut p = vec![0.0; prior.len()];
            for (node, (q, _)) in model.nodes().iter().zip(&known) {
                p[node.place[axis]] += q;
            }
            // The prior's distribution function: length is log-uniform, share the cube of a uniform number.
            let [first, last] = [0.0, 1.0].map(|u| model.quantity(0, u));
            let u = if axis == 0 { (at / first).ln() / (last / first).ln() } else { at.cbrt() };
            // Every node stands for the interval that its prior weight takes.
            let (mut below, mut edge) = (0.0, 0.0);
            for (prior, p) in prior.iter().zip(&p) {
                below += p * ((u - edge) / prior).clamp(0.0, 1.0);
                edge += prior;
            }
            below
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, stream};

    #[test]
    fn drawn_errors_have_the_covariance_of_the_model() {
        // Two places a tenth of a length apart, one far away, one at t = 0 that is far from all on the logarithmic scale.
        let control = [0.0, 1.0, 0.1f64.exp(), 1e6];
        let [length, white] = [1.0, 0.25];
        let mut rng = stream(5, Purpose::Truth, 0, 0);
        let count = 200_000;
        let mut sums = [[0.0; 4]; 4];
        for _ in 0..count {
            let e = correlated(DistanceScale::Log, &control, [length, white], &mut rng);
            for i in 0..4 {
                (0..4).for_each(|j| sums[i][j] += e[i] * e[j] / f64::from(count));
            }
        }
        for i in 0..4 {
            for j in 0..4 {
                let alike = match (i, j) {
                    _ if i == j => 1.0,
                    (1, 2) | (2, 1) => 0.75 * (-0.1f64).exp(),
                    _ => 0.0,
                };
                assert!((sums[i][j] - alike).abs() < 0.01, "{i} {j}: {}", sums[i][j]);
            }
        }
    }

    #[test]
    fn a_truth_is_ranked_by_its_prior_where_the_rule_has_one_node() {
        let control = vec![1.0, 2.0, 3.0];
        let observations = Observations::new(control, vec![0.1, 0.1, 0.1]).expect("observations");
        let noise = Noise::Correlated {
            nu0: 4.0,
            s0: 0.05,
            scale: Some(DistanceScale::Linear),
            nodes: Some([1, 1]),
        };
        let likelihood = Likelihood::new(&noise, &observations).expect("a model");
        let truth = NoiseShape::Correlated { length: 2.0 * 0.01f64.powf(0.25), white_share: 0.125 };
        // One cell over the whole prior.
        let [length, share] = likelihood.below(&truth, &[0.0; 3]).expect("ranks");
        assert!((length - 0.75).abs() < 1e-12 && (share - 0.5).abs() < 1e-12, "{length} {share}");
        let fine = likelihood.ranking(&observations).expect("a model");
        let [length, share] = fine.below(&truth, &[0.1, 0.1, 0.1]).expect("ranks");
        assert!(length > 0.0 && length < 1.0 && share > 0.0 && share < 1.0);
    }
}
