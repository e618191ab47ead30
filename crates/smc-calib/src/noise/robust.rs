//! Independent errors with outliers: a contaminated normal.
//!
//! `p(r) = (1 - eps) N(r; 0, sigma^2) + eps N(r; 0, (k sigma)^2)` (J. W. Tukey, in Contributions to Probability and
//! Statistics (1960), 448), with eps and k given. sigma, with the same prior as for errors without outliers, is integrated
//! out by the trapezoidal rule in its logarithm, whose error falls faster than any power of the spacing where the density
//! is smooth.
//!
//! eps = 0.005 and k = 10 were chosen by measurement on PS with three of 44 rows moved by +0.3: rows 10, 20, 30 (from 0)
//! move no parameter by more than 0.03 of its standard deviation, rows 2, 15, 30 by 0.17; an outlier costs only
//! ln(1/eps). A larger eps makes intervals of clean data wider, an inferred one does both worse. Outliers within the first
//! rise, where a few rows carry all that is known, cannot be recognised by any eps.

use super::NoiseError;
use super::rule::ln_sum_exp;
use crate::Observations;
use crate::lanes::{LANES, Lane, exp_of_nonpositive, ln_of_positive, wide};
use crate::normal::{self, LN_SQRT_2PI};
use statrs::function::gamma::ln_gamma;

/// Standard deviation of an outlier over that of the other errors.
pub(crate) const OUTLIER_WIDTH: f64 = 10.0;
/// Share of outliers.
pub(crate) const OUTLIER_SHARE: f64 = 0.005;
/// Largest spacing of the nodes of ln sigma; with more than ten observations it is the standard deviation that ln sigma has
/// after them, 1/sqrt(2 (nu0 + m)). The log likelihood is then off by less than 1e-5.
const SPACING: f64 = 0.2;
/// Log density below the largest at which a block of nodes is left out.
const DEPTH: f64 = 45.0;
/// Most nodes of sigma: more are needed only for a prior of sigma far narrower than the distance to the scatter of the data.
const MAX_NODES: usize = 200_000;
/// Observations between two scalings of the products of densities: each factor is at least 5e-4.
const SCALED: usize = 32;

/// The likelihood of a curve under errors with outliers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Robust {
    rows: usize,
    /// Spacing of the nodes of ln sigma.
    step: f64,
    /// sigma, eight at a time.
    sigma: Vec<Lane>,
    /// ln sigma.
    ln_sigma: Vec<Lane>,
    /// 1/(2 sigma^2).
    half_precision: Vec<Lane>,
    /// 1/sigma.
    inverse: Vec<Lane>,
    /// The smallest of 1/(2 sigma^2).
    least_half_precision: f64,
    /// Prior weight; 0 for lanes without a node.
    weights: Vec<Lane>,
    /// Its logarithm.
    ln_prior: Vec<Lane>,
}

impl Robust {
    /// The model for some observations: `sigma^2 ~ Inverse-Gamma(nu0/2, nu0 s0^2/2)`, cut off where neither prior nor
    /// data can have it: far above both s0 and the observed values.
    pub(crate) fn new(nu0: f64, s0: f64, observations: &Observations) -> Result<Self, NoiseError> {
        let rows = observations.len();
        let of_ln_sigma = 1.0 / (2.0 * (nu0 + rows as f64)).sqrt();
        let step = of_ln_sigma.min(SPACING);
        let squares: f64 = observations.values().iter().map(|v| v * v).sum();
        // sigma^2 is at least about nu0 s0^2/(nu0 + m), of a curve without residuals, and hardly above what the values
        // themselves would give as residuals.
        let mean = |sum: f64| (sum / (nu0 + rows as f64)).sqrt().ln();
        let lowest = mean(nu0 * s0 * s0) - 6.0 * of_ln_sigma;
        let highest = mean(nu0 * s0 * s0 + squares) + 10.0 * of_ln_sigma;
        let count = ((highest - lowest) / step).ceil().max(1.0) as usize + 1;
        if count > MAX_NODES {
            return Err(NoiseError::TooManySigmas { nu0, s0, rows });
        }
        let (a, b) = (0.5 * nu0, 0.5 * nu0 * s0 * s0);
        let lanes = |value: &dyn Fn(f64) -> f64, none: f64| -> Vec<Lane> {
            let at = |j: usize| if j < count { value(lowest + step * j as f64) } else { none };
            (0..count.div_ceil(LANES))
                .map(|block| std::array::from_fn(|lane| at(block * LANES + lane)))
                .collect()
        };
        // Density of ln sigma: 2 b^a/Gamma(a) sigma^(-2a) exp(-b/sigma^2).
        let constant = step.ln() + 2f64.ln() + a * b.ln() - ln_gamma(a);
        let ln_prior = |u: f64| constant - 2.0 * a * u - b * (-2.0 * u).exp();
        Ok(Self {
            rows,
            step,
            sigma: lanes(&f64::exp, 1.0),
            ln_sigma: lanes(&|u| u, 0.0),
            half_precision: lanes(&|u| 0.5 * (-2.0 * u).exp(), 0.5),
            inverse: lanes(&|u| (-u).exp(), 0.0),
            least_half_precision: 0.5 * (-2.0 * (lowest + step * (count - 1) as f64)).exp(),
            weights: lanes(&|u| ln_prior(u).exp(), 0.0),
            ln_prior: lanes(&ln_prior, f64::NEG_INFINITY),
        })
    }

    /// Factor that takes sigma at a node to a place within the spacing, evenly in ln sigma for `u` evenly over (0, 1).
    pub(crate) fn within(&self, u: f64) -> f64 {
        (self.step * (u - 0.5)).exp()
    }

    /// Log likelihood of the curve.
    pub(crate) fn ln_joint(&self, values: &[f64], outputs: &[f64]) -> f64 {
        let squares = squares(values, outputs);
        wide(
            #[inline(always)]
            || {
                let bounds: Vec<f64> =
                    (0..self.sigma.len()).map(|b| self.bound(b, &squares)).collect();
                let best = (0..bounds.len())
                    .max_by(|a, b| bounds[*a].total_cmp(&bounds[*b]).then(b.cmp(a)))
                    .unwrap_or_default();
                let first = self.terms(best, &squares);
                let floor = first.iter().copied().fold(f64::NEG_INFINITY, f64::max) - DEPTH;
                let mut terms = vec![first];
                for b in (0..bounds.len()).filter(|b| *b != best && bounds[*b] > floor) {
                    terms.push(self.terms(b, &squares));
                }
                ln_sum_exp(&terms) - self.rows as f64 * LN_SQRT_2PI
            },
        )
    }

    /// No log density of a block is above this: of the two parts of each error's density the larger one.
    #[inline(always)]
    fn bound(&self, block: usize, squares: &[f64]) -> f64 {
        let half = &self.half_precision[block];
        let mut sums = [0.0; LANES];
        for square in squares {
            for (sum, half) in sums.iter_mut().zip(half) {
                let x = square * half;
                *sum -= x.min(x / (OUTLIER_WIDTH * OUTLIER_WIDTH) + OUTLIER_WIDTH.ln());
            }
        }
        let mut best = f64::NEG_INFINITY;
        for i in 0..LANES {
            let prior = self.ln_prior[block][i] - self.rows as f64 * self.ln_sigma[block][i];
            best = best.max(prior + sums[i]);
        }
        best
    }

    /// Log of prior weight times density at the nodes of sigma in a block.
    #[inline(always)]
    fn terms(&self, block: usize, squares: &[f64]) -> Lane {
        let mut state = State::new();
        for (k, square) in squares.iter().enumerate() {
            state.advance(*square, &self.half_precision[block]);
            if (k + 1) % SCALED == 0 {
                state.scale();
            }
        }
        let rows = self.rows as f64;
        let mut terms = [0.0; LANES];
        for i in 0..LANES {
            terms[i] = self.ln_prior[block][i] - rows * self.ln_sigma[block][i]
                + state.ln[i]
                + ln_of_positive(state.product[i]);
        }
        terms
    }

    /// Log likelihood of the first 1, 2, .. observations.
    pub(crate) fn ln_cumulative(&self, values: &[f64], outputs: &[f64], cumulative: &mut [f64]) {
        let squares = squares(values, outputs);
        wide(
            #[inline(always)]
            || {
                if !self.ln_of_products(&squares, cumulative) {
                    self.ln_of_logs(&squares, cumulative);
                }
            },
        );
    }

    /// By products of densities that are kept relative to their sum; false where one of them leaves the range of numbers,
    /// as for a curve far from the data.
    #[inline(always)]
    fn ln_of_products(&self, squares: &[f64], cumulative: &mut [f64]) -> bool {
        const FAR: f64 = 1.0 / (OUTLIER_WIDTH * OUTLIER_WIDTH);
        let mut products = self.weights.clone();
        let (mut ln, mut scale) = (0.0, 1.0);
        for (k, square) in squares.iter().enumerate() {
            // The part that all values of sigma have is taken out.
            let taken = square * self.least_half_precision * FAR;
            let own = (1.0 - OUTLIER_SHARE) * (-taken * (1.0 / FAR - 1.0)).exp();
            let mut total = [0.0; LANES];
            for (block, product) in products.iter_mut().enumerate() {
                let (half, inverse) = (&self.half_precision[block], &self.inverse[block]);
                for i in 0..LANES {
                    // exp(-x/k^2), and from it exp(-x) as its 100th power.
                    let far = exp_of_nonpositive(taken - square * half[i] * FAR);
                    let f4 = (far * far) * (far * far);
                    let f16 = (f4 * f4) * (f4 * f4);
                    let f32 = f16 * f16;
                    let near = (f32 * f32) * f32 * f4;
                    let density = own * near + far * (OUTLIER_SHARE / OUTLIER_WIDTH);
                    product[i] *= density * (inverse[i] * scale);
                    total[i] += product[i];
                }
            }
            let sum: f64 = total.iter().sum();
            if !(1e-250..1e250).contains(&sum) {
                return false;
            }
            ln += sum.ln() - taken;
            scale = 1.0 / sum;
            cumulative[k] = ln - (k + 1) as f64 * LN_SQRT_2PI;
        }
        true
    }

    /// By logarithms.
    fn ln_of_logs(&self, squares: &[f64], cumulative: &mut [f64]) {
        let mut states = vec![State::new(); self.sigma.len()];
        let mut terms = vec![[0.0; LANES]; self.sigma.len()];
        for (k, square) in squares.iter().enumerate() {
            let rows = (k + 1) as f64;
            for (block, (state, terms)) in states.iter_mut().zip(&mut terms).enumerate() {
                state.advance(*square, &self.half_precision[block]);
                state.scale();
                for i in 0..LANES {
                    terms[i] =
                        self.ln_prior[block][i] - rows * self.ln_sigma[block][i] + state.ln[i];
                }
            }
            cumulative[k] = ln_sum_exp(&terms) - rows * LN_SQRT_2PI;
        }
    }

    /// Every sigma with its posterior probability given the curve.
    pub(crate) fn posterior(&self, values: &[f64], outputs: &[f64]) -> Vec<(f64, f64)> {
        let squares = squares(values, outputs);
        let terms: Vec<Lane> = wide(
            #[inline(always)]
            || (0..self.sigma.len()).map(|b| self.terms(b, &squares)).collect(),
        );
        let total = ln_sum_exp(&terms);
        let sigmas = self.sigma.iter().flatten();
        sigmas.zip(terms.iter().flatten()).map(|(s, term)| (*s, (term - total).exp())).collect()
    }
}

/// Squared residuals, finite.
fn squares(values: &[f64], outputs: &[f64]) -> Vec<f64> {
    values.iter().zip(outputs).map(|(v, o)| ((v - o) * (v - o)).min(f64::MAX)).collect()
}

/// Density of a residual, logarithm.
pub(crate) fn ln_density(residual: f64, sigma: f64) -> f64 {
    let x = 0.5 * (residual / sigma).powi(2);
    let own = (1.0 - OUTLIER_SHARE).ln() - x;
    let wide = (OUTLIER_SHARE / OUTLIER_WIDTH).ln() - x / (OUTLIER_WIDTH * OUTLIER_WIDTH);
    let top = own.max(wide);
    top + ((own - top).exp() + (wide - top).exp()).ln() - sigma.ln() - LN_SQRT_2PI
}

/// Probability that a residual is an outlier's.
pub(crate) fn outlier(residual: f64, sigma: f64) -> f64 {
    let x = 0.5 * (residual / sigma).powi(2);
    let before = OUTLIER_SHARE / (1.0 - OUTLIER_SHARE) / OUTLIER_WIDTH;
    let odds = before * (x * (1.0 - 1.0 / (OUTLIER_WIDTH * OUTLIER_WIDTH))).exp();
    if odds.is_infinite() { 1.0 } else { odds / (1.0 + odds) }
}

/// The normal score of a residual: standard normal where the model holds.
pub(crate) fn score(residual: f64, sigma: f64) -> f64 {
    let z = -(residual / sigma).abs();
    let below =
        (1.0 - OUTLIER_SHARE) * normal::cdf(z) + OUTLIER_SHARE * normal::cdf(z / OUTLIER_WIDTH);
    -normal::quantile(below.max(1e-300)) * residual.signum()
}

/// Products of densities at eight values of sigma.
#[derive(Clone, Copy)]
struct State {
    /// Over `exp(ln)`.
    product: Lane,
    ln: Lane,
}

impl State {
    #[inline(always)]
    fn new() -> Self {
        Self { product: [1.0; LANES], ln: [0.0; LANES] }
    }

    /// Takes up one residual: `exp(-x/k^2) ((1 - eps) exp(-x (1 - 1/k^2)) + eps/k)`, x = r^2/(2 sigma^2), over sigma.
    #[inline(always)]
    fn advance(&mut self, square: f64, half: &Lane) {
        let far = 1.0 / (OUTLIER_WIDTH * OUTLIER_WIDTH);
        for i in 0..LANES {
            let x = (square * half[i]).min(f64::MAX);
            let near = exp_of_nonpositive(-x * (1.0 - far));
            self.ln[i] -= x * far;
            self.product[i] *= (1.0 - OUTLIER_SHARE) * near + OUTLIER_SHARE / OUTLIER_WIDTH;
        }
    }

    /// Takes the size of the products out, so that they do not underflow.
    #[inline(always)]
    fn scale(&mut self) {
        for i in 0..LANES {
            self.ln[i] += ln_of_positive(self.product[i]);
            self.product[i] = 1.0;
        }
    }
}
