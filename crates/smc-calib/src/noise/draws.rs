//! What is drawn of the noise for each draw of the parameters, and what is known of it in the end.

use super::DistanceScale;
use super::correlated::Correlated;
use super::likelihood::{Kind, Likelihood};
use super::robust::{self, OUTLIER_SHARE, OUTLIER_WIDTH};
use super::rule::quantile_of_nodes;
use crate::normal::LN_SQRT_2PI;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, Gamma};
use serde::{Deserialize, Serialize};
use statrs::function::gamma::ln_gamma;

/// The noise of one draw of the posterior.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseDraw {
    /// Standard deviation.
    pub sigma: f64,
    /// What else the model has; none for independent errors without outliers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<NoiseShape>,
}

/// What a noise model has beside its standard deviation.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum NoiseShape {
    /// Of correlated errors.
    Correlated {
        /// Correlation length: in ln t on the logarithmic scale, else in the unit of the control variable.
        length: f64,
        /// Share of the variance that is independent.
        white_share: f64,
    },
    /// Of errors with outliers.
    Robust {
        /// Share of outliers.
        outlier_share: f64,
        /// Standard deviation of an outlier over that of the other errors.
        outlier_width: f64,
    },
}

/// What the model of errors with outliers expects.
pub(super) const OUTLIERS: NoiseShape =
    NoiseShape::Robust { outlier_share: OUTLIER_SHARE, outlier_width: OUTLIER_WIDTH };

/// Posterior of the noise standard deviation.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SigmaSummary {
    /// Mean (exact mixture of conditional inverse gammas).
    pub mean: f64,
    /// Standard deviation (likewise).
    pub sd: f64,
    /// Median of the draws.
    pub median: f64,
    /// Equal-tailed 50 % interval of the draws.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval of the draws.
    pub eti90: [f64; 2],
    /// Equal-tailed 95 % interval of the draws.
    pub eti95: [f64; 2],
    /// Whether it is known, not inferred.
    pub fixed: bool,
}

/// Posterior of what a noise model has beside its standard deviation.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ShapeSummary {
    /// Of correlated errors.
    Correlated {
        /// What distances are measured in.
        scale: DistanceScale,
        /// Range of the observations on that scale.
        range: f64,
        /// Correlation length, in the unit of the scale.
        length: NoiseQuantity,
        /// Share of the variance that is independent.
        white_share: NoiseQuantity,
    },
    /// Of errors with outliers.
    Robust {
        /// Share of outliers that the model expects.
        outlier_share: f64,
        /// Standard deviation of an outlier over that of the other errors.
        outlier_width: f64,
        /// Probability of each observation to be an outlier.
        outliers: Vec<f64>,
    },
}

/// One number of a noise model under the posterior.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseQuantity {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
}

impl NoiseDraw {
    /// Factor on the standard deviation of a new error, at `u` evenly distributed over (0, 1): that of an outlier or 1.
    pub fn widening(&self, u: f64) -> f64 {
        match self.shape {
            Some(NoiseShape::Robust { outlier_share, outlier_width }) if u < outlier_share => {
                outlier_width
            }
            _ => 1.0,
        }
    }
}

/// Noise drawn with some draws of the parameters.
#[derive(Clone, Debug, Default)]
pub(crate) struct NoiseDraws {
    pub draws: Vec<NoiseDraw>,
    /// Mean of sigma and of sigma^2 over the draws, each given its curve alone.
    pub moments: [f64; 2],
    pub shape: Option<ShapeSummary>,
}

/// Adds up what the curves of the draws say, each as often as it was drawn.
struct Tally {
    count: f64,
    moments: [f64; 2],
    /// Probability of each correlation length and white share.
    places: [Vec<f64>; 2],
    outliers: Vec<f64>,
}

impl Likelihood {
    /// Whether the noise has more than its standard deviation: drawing it takes the whole curve.
    pub(crate) fn has_shape(&self) -> bool {
        matches!(self.kind, Kind::Correlated(_) | Kind::Robust(_))
    }

    /// Draws the noise for curves that were drawn one after the other, with a random stream for each; none for models
    /// without a shape. `curve(k)` is the curve of draw k where it is another one than that of the draw before. A node of the
    /// quadrature stands for a part of the prior: with `spread` what is drawn lies anywhere there, as a user wants to see it;
    /// without it is the node, as likelihoods are computed.
    pub(crate) fn draw_shapes<'c, R: Rng>(
        &self,
        (count, spread): (usize, bool),
        curve: impl Fn(usize) -> Option<&'c [f64]>,
        stream: impl Fn(usize) -> R,
    ) -> Option<NoiseDraws> {
        let values = self.values();
        let mut tally = Tally::new(values.len());
        let mut draws = Vec::with_capacity(count);
        match &self.kind {
            Kind::Correlated(model) => {
                let mut known = Vec::new();
                for k in 0..count {
                    if let Some(outputs) = curve(k) {
                        known = model.posterior(values, outputs);
                    }
                    draws.push(tally.correlated((model, spread), &known, &mut stream(k))?);
                }
            }
            Kind::Robust(model) => {
                let mut known = Vec::new();
                let mut residuals = Vec::new();
                for k in 0..count {
                    if let Some(outputs) = curve(k) {
                        known = model.posterior(values, outputs);
                        residuals = self.residuals(outputs);
                    }
                    let mut rng = stream(k);
                    let mut draw = tally.robust(&known, &residuals, &mut rng)?;
                    if spread {
                        draw.sigma *= model.within(rng.random());
                    }
                    draws.push(draw);
                }
            }
            _ => return None,
        }
        let moments = tally.moments.map(|sum| sum / tally.count);
        let shape = self.shape(tally);
        Some(NoiseDraws { draws, moments, shape })
    }

    fn shape(&self, tally: Tally) -> Option<ShapeSummary> {
        let [first, second] = &tally.places;
        match &self.kind {
            Kind::Correlated(model) => {
                let quantity = |axis, p: &[f64]| {
                    NoiseQuantity::of(&model.prior(axis), p, |u| model.quantity(axis, u))
                };
                Some(ShapeSummary::Correlated {
                    scale: model.scale(),
                    range: model.range(),
                    length: quantity(0, first),
                    white_share: quantity(1, second),
                })
            }
            Kind::Robust(_) => Some(ShapeSummary::Robust {
                outlier_share: OUTLIER_SHARE,
                outlier_width: OUTLIER_WIDTH,
                outliers: tally.outliers.iter().map(|sum| sum / tally.count).collect(),
            }),
            _ => None,
        }
    }
}

impl Tally {
    fn new(observations: usize) -> Self {
        let outliers = vec![0.0; observations];
        Self { count: 0.0, moments: [0.0; 2], places: [Vec::new(), Vec::new()], outliers }
    }

    fn add(&mut self, axis: usize, place: usize, p: f64) {
        let sums = &mut self.places[axis];
        if sums.len() <= place {
            sums.resize(place + 1, 0.0);
        }
        sums[place] += p;
    }

    /// sigma^2 given a node is inverse gamma: `E sigma = sqrt(b) Gamma(a - 1/2)/Gamma(a)`, `E sigma^2 = b/(a - 1)`.
    fn correlated(
        &mut self,
        (model, spread): (&Correlated, bool),
        known: &[(f64, f64)],
        rng: &mut impl Rng,
    ) -> Option<NoiseDraw> {
        let (a, sum0) = model.shape_and_sum();
        let first = (ln_gamma(a - 0.5) - ln_gamma(a)).exp();
        self.count += 1.0;
        for (node, (p, sum)) in model.nodes().iter().zip(known) {
            let b = 0.5 * (sum0 + sum);
            self.moments[0] += p * b.sqrt() * first;
            self.moments[1] += if a > 1.0 { p * b / (a - 1.0) } else { f64::MAX };
            self.add(0, node.place[0], *p);
            self.add(1, node.place[1], *p);
        }
        let at = chosen(known.iter().map(|(p, _)| *p), rng.random());
        let (node, (_, sum)) = (model.nodes().get(at)?, known.get(at)?);
        let gamma: f64 = Gamma::new(a, 1.0).ok()?.sample(rng);
        let [length, white_share] = if spread {
            [0, 1].map(|axis| model.within(axis, node.place[axis], rng.random()))
        } else {
            [node.length, node.white]
        };
        let shape = NoiseShape::Correlated { length, white_share };
        Some(NoiseDraw { sigma: (0.5 * (sum0 + sum) / gamma).sqrt(), shape: Some(shape) })
    }

    fn robust(
        &mut self,
        known: &[(f64, f64)],
        residuals: &[f64],
        rng: &mut impl Rng,
    ) -> Option<NoiseDraw> {
        self.count += 1.0;
        for (sigma, p) in known {
            self.moments[0] += p * sigma;
            self.moments[1] += p * sigma * sigma;
        }
        let (sigma, _) = *known.get(chosen(known.iter().map(|(_, p)| *p), rng.random()))?;
        for (sum, residual) in self.outliers.iter_mut().zip(residuals) {
            *sum += robust::outlier(*residual, sigma);
        }
        Some(NoiseDraw { sigma, shape: Some(OUTLIERS) })
    }
}

/// The place at which the running sum of some probabilities, which sum to 1, passes `u`; the likeliest where rounding
/// leaves none.
fn chosen(probabilities: impl Iterator<Item = f64>, u: f64) -> usize {
    let (mut sum, mut best) = (0.0, (0, 0.0));
    for (place, p) in probabilities.enumerate() {
        sum += p;
        if u < sum {
            return place;
        }
        if p > best.1 {
            best = (place, p);
        }
    }
    best.0
}

impl NoiseQuantity {
    /// Of the posterior probabilities of the nodes of a rule; `at` takes the prior's distribution function to the quantity.
    fn of(prior: &[f64], p: &[f64], at: impl Fn(f64) -> f64) -> Self {
        let quantile = |probability| quantile_of_nodes(prior, p, probability, &at);
        // Equal steps of probability.
        let steps = 200;
        let places = (0..steps).map(|k| quantile((f64::from(k) + 0.5) / f64::from(steps)));
        Self {
            mean: places.sum::<f64>() / f64::from(steps),
            median: quantile(0.5),
            eti50: [quantile(0.25), quantile(0.75)],
            eti95: [quantile(0.025), quantile(0.975)],
        }
    }
}

impl Likelihood {
    /// Mean and standard deviation of the errors of new observations at `control` under a drawn noise, in the experiment
    /// whose curve at the observations is `outputs`. Correlated errors are known near the observations; others have mean 0,
    /// and the standard deviation of errors that are no outliers.
    pub fn errors_at(&self, draw: &NoiseDraw, outputs: &[f64], control: &[f64]) -> Vec<[f64; 2]> {
        match (&self.kind, draw.shape) {
            (Kind::Correlated(model), Some(NoiseShape::Correlated { length, white_share })) => {
                model
                    .smoothed(&self.residuals(outputs), length, white_share, control)
                    .into_iter()
                    .map(|(mean, variance)| [mean, draw.sigma * variance.sqrt()])
                    .collect()
            }
            _ => vec![[0.0, draw.sigma]; control.len()],
        }
    }

    /// Residuals of a curve as the model sees them: independent and of one size where it holds. Correlated errors whitened
    /// at their likeliest correlation length and white share, errors with outliers as normal scores; none for other models.
    pub(crate) fn whitened(&self, outputs: &[f64]) -> Option<Vec<f64>> {
        match &self.kind {
            Kind::Correlated(model) => {
                let known = model.posterior(self.values(), outputs);
                let at = (0..known.len()).max_by(|a, b| known[*a].0.total_cmp(&known[*b].0))?;
                let node = model.nodes()[at];
                let (a, sum0) = model.shape_and_sum();
                let sigma = (0.5 * (sum0 + known[at].1) / a).sqrt();
                let whitened = model.whitened(&self.residuals(outputs), node.length, node.white);
                Some(whitened.iter().map(|r| r / sigma).collect())
            }
            Kind::Robust(model) => {
                let known = model.posterior(self.values(), outputs);
                let (sigma, _) = known.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
                Some(self.residuals(outputs).iter().map(|r| robust::score(*r, *sigma)).collect())
            }
            _ => None,
        }
    }

    /// `ln p(y_i | theta, noise)` of every observation, and where errors are correlated `ln p(y_i | all other observations,
    /// theta, noise)`: what the prediction of each observation by the others is made of. `draw` is the noise drawn with theta;
    /// noise that is known needs none. None for tuned noise, and for a draw that is missing or of another model.
    pub fn ln_pointwise(&self, draw: Option<&NoiseDraw>, outputs: &[f64]) -> Option<Vec<f64>> {
        let residuals = self.residuals(outputs);
        let normal = |r: f64, sigma: f64| {
            let r = r / sigma;
            -0.5 * r * r - sigma.ln() - LN_SQRT_2PI
        };
        match &self.kind {
            Kind::Inferred { .. } => {
                let sigma = draw?.sigma;
                Some(residuals.iter().map(|r| normal(*r, sigma)).collect())
            }
            Kind::Fixed { inverse_sigma, .. } => {
                let each = residuals.iter().zip(inverse_sigma);
                Some(each.map(|(r, inverse)| normal(*r, 1.0 / inverse)).collect())
            }
            Kind::Tuned => None,
            Kind::Correlated(model) => {
                let NoiseShape::Correlated { length, white_share } = draw?.shape? else {
                    return None;
                };
                let given = model.given_others(&residuals, length, white_share);
                let sigma = draw?.sigma;
                let ln = |((mean, variance), r): ((f64, f64), &f64)| {
                    let sd = sigma * variance.sqrt();
                    crate::normal::ln_density((r - mean) / sd) - sd.ln()
                };
                Some(given.into_iter().zip(&residuals).map(ln).collect())
            }
            Kind::Robust(_) => {
                let sigma = draw?.sigma;
                Some(residuals.iter().map(|r| robust::ln_density(*r, sigma)).collect())
            }
        }
    }
}
