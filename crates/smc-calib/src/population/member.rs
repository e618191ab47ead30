//! A member of a population, and how likely a population makes what was measured of it.

use super::hyperprior::Population;
use crate::cholesky::{cholesky, packed_inverse, rows_of, solve};
use crate::cloud::{Cloud, Gaussian};
use crate::mixture::distance2;
use crate::normal::{self, LN_SQRT_2PI};
use crate::stream::{Purpose, stream};
use crate::{CalibrateError, Weighted};
use rand::seq::SliceRandom as _;

/// Effective samples below which the average over a member's own samples is not taken alone.
pub const FEW_EFFECTIVE: f64 = 100.0;
/// Effective samples for which the fitted density is corrected by a factor of up to two, and so on for more; by two for fewer. In
/// the far tail, where there is no sample near, a correction by the outermost one would be one by nothing.
const PER_FACTOR: f64 = 10.0;
/// Most components of the fitted density.
const MOST_COMPONENTS: usize = 8;
/// Samples whose share of the likelihood is below this are left out.
const LEAST_SHARE: f64 = 1e-20;

/// The posterior of one member under its own prior, as its calibration gave it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MemberSamples {
    /// Name.
    pub name: String,
    /// Coordinates of the samples, row by row.
    pub coordinates: Vec<f64>,
    /// Log density of the prior in these coordinates, at each sample.
    pub ln_prior: Vec<f64>,
    /// Log likelihood of each sample; minus infinity where there is none.
    pub ln_likelihood: Vec<f64>,
    /// Weight of each sample in the posterior.
    pub weights: Vec<f64>,
    /// Log evidence.
    pub log_evidence: f64,
    /// Ends of the prior's support in each coordinate: beyond them nothing is known of the likelihood.
    pub support: Vec<[f64; 2]>,
}

/// A checked member.
///
/// The likelihood of a population from a member is `Z E[N(x | population) / prior(x)]`, the mean over its posterior, Z its
/// evidence: unbiased up to Monte Carlo error. Where the population is narrow beside the posterior only a few samples count;
/// then a Gaussian mixture fitted to the member's likelihood is convolved with the population in closed form, and corrected by
/// the ratio of the likelihood to the fit, averaged over the samples that count. Beyond the prior's support the likelihood is
/// taken as zero.
#[derive(Clone, Debug)]
pub struct Member {
    /// Name.
    pub name: String,
    d: usize,
    coordinates: Vec<f64>,
    /// Log of weight over prior density.
    ln_share: Vec<f64>,
    /// Log of the volume that a sample stands for, times the fitted density there.
    ln_fitted: Vec<f64>,
    components: Vec<Gaussian>,
    /// Log of the sum of weight over prior density.
    ln_mass: f64,
    log_evidence: f64,
    support: Vec<[f64; 2]>,
}

/// Likelihood of a population from one member.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemberLikelihood {
    /// Its logarithm.
    pub ln: f64,
    /// Effective number of the member's own samples behind it.
    pub effective: f64,
    /// Whether it is that of the fitted density, corrected, because these are too few.
    pub fitted: bool,
}

impl Member {
    /// Checks the samples of a member and fits its likelihood.
    ///
    /// # Errors
    /// [`CalibrateError::Member`] for columns of different lengths, numbers that are not finite, or no weight.
    pub fn new(samples: &MemberSamples, seed: u64) -> Result<Self, CalibrateError> {
        let refused = |problem: &str| CalibrateError::Member {
            member: samples.name.clone(),
            problem: problem.to_owned(),
        };
        let (d, n) = (samples.support.len(), samples.weights.len());
        let lengths = [samples.ln_prior.len(), samples.ln_likelihood.len()];
        if d == 0 || n == 0 || samples.coordinates.len() != n * d || lengths != [n, n] {
            return Err(refused("its columns are empty or of different lengths"));
        }
        let total: f64 = samples.weights.iter().sum();
        if !(total > 0.0 && total.is_finite() && samples.log_evidence.is_finite()) {
            return Err(refused("its weights or its evidence are not numbers above zero"));
        }
        let alive = |i: &usize| samples.weights[*i] > 0.0;
        let share = |i: usize| (samples.weights[i] / total).ln() - samples.ln_prior[i];
        let most = (0..n).filter(alive).map(share).fold(f64::NEG_INFINITY, f64::max);
        let mut kept: Vec<usize> =
            (0..n).filter(|i| alive(i) && share(*i) > most + LEAST_SHARE.ln()).collect();
        // A fit takes every so many of them, which of a net in its order all lie in one corner.
        kept.shuffle(&mut stream(seed, Purpose::MixtureResample, 1, 0));
        let coordinates = rows_of(&samples.coordinates, d, &kept);
        let ln_share: Vec<f64> = kept.iter().map(|i| share(*i)).collect();
        let ln_l = kept.iter().map(|i| samples.ln_likelihood[*i]);
        let ln_volume: Vec<f64> = ln_share
            .iter()
            .zip(ln_l)
            .map(|(share, ln)| samples.log_evidence + share - ln)
            .collect();
        let all = coordinates.iter().chain(&ln_share).chain(&ln_volume);
        if !all.copied().all(f64::is_finite) {
            return Err(refused("a sample with weight has a number that is not finite"));
        }
        let shares: Vec<f64> = ln_share.iter().map(|share| (share - most).exp()).collect();
        let ln_mass = most + shares.iter().sum::<f64>().ln();
        let components = Cloud::new(d, &coordinates, &shares, seed, 0)
            .map_or_else(Vec::new, |cloud| cloud.fit(MOST_COMPONENTS, seed, 0).components);
        let fitted = |row: &[f64]| ln_sum(components.iter().map(|c| ln_gaussian(c, row)));
        let ln_fitted = coordinates
            .chunks_exact(d)
            .zip(&ln_volume)
            .map(|(row, volume)| volume + fitted(row))
            .collect();
        let (name, support) = (samples.name.clone(), samples.support.clone());
        let log_evidence = samples.log_evidence;
        Ok(Self {
            name,
            d,
            coordinates,
            ln_share,
            ln_fitted,
            components,
            ln_mass,
            log_evidence,
            support,
        })
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.d
    }

    /// Log likelihood of a population from this member.
    pub fn ln_likelihood(&self, population: &Population) -> MemberLikelihood {
        let inverse = packed_inverse(&population.factor, self.d);
        let rows = self.coordinates.chunks_exact(self.d);
        let halves: Vec<f64> =
            rows.map(|row| 0.5 * distance2(&inverse, &population.mean, row)).collect();
        let (ln_sum_own, effective) = self.sum(&self.ln_share, &halves);
        let ln_peak = ln_peak(&population.factor, self.d);
        if effective >= FEW_EFFECTIVE || self.components.is_empty() {
            let ln = self.log_evidence + ln_sum_own + ln_peak;
            return MemberLikelihood { ln, effective, fitted: false };
        }
        // The likelihood of a sample is exact: even one sample near the population says how far the fit is off there.
        let (ln_sum_fitted, counting) = self.sum(&self.ln_fitted, &halves);
        let most = std::f64::consts::LN_2 * (counting / PER_FACTOR).max(1.0);
        let correction = (ln_sum_own - self.ln_mass - ln_sum_fitted).clamp(-most, most);
        let ln = self.log_evidence + self.ln_mass + self.ln_convolved(population) + correction;
        MemberLikelihood { ln, effective, fitted: true }
    }

    /// Log of the sum of `exp(ln - half)` over the samples, and their effective number.
    fn sum(&self, ln: &[f64], halves: &[f64]) -> (f64, f64) {
        let terms = || ln.iter().zip(halves).map(|(ln, half)| ln - half);
        let most = terms().fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut squares) = (0.0, 0.0);
        for term in terms() {
            // Below this a term changes no digit.
            if term - most > -50.0 {
                let value = (term - most).exp();
                sum += value;
                squares += value * value;
            }
        }
        (most + sum.ln(), sum * sum / squares)
    }

    /// Log of the fitted density convolved with a population, within the prior's support.
    fn ln_convolved(&self, population: &Population) -> f64 {
        let d = self.d;
        let square = |factor: &[f64], i: usize, j: usize| {
            (0..=i.min(j)).map(|k| factor[i * d + k] * factor[j * d + k]).sum::<f64>()
        };
        ln_sum(self.components.iter().map(|c| {
            let sum: Vec<f64> = (0..d * d)
                .map(|at| {
                    let (i, j) = (at / d, at % d);
                    square(&c.factor, i, j) + square(&population.factor, i, j)
                })
                .collect();
            let Some(factor) = cholesky(&sum, d) else { return f64::NEG_INFINITY };
            let whole = Gaussian { weight: c.weight, mean: c.mean.clone(), factor };
            let apart: Vec<f64> = population.mean.iter().zip(&c.mean).map(|(p, m)| p - m).collect();
            let pulled = solve(&whole.factor, &apart);
            let mut ln = ln_gaussian(&whole, &population.mean);
            for i in 0..d {
                // Mean and variance of the member's coordinate in this component under this population.
                let row: Vec<f64> = (0..d).map(|j| square(&c.factor, i, j)).collect();
                let mean = c.mean[i] + row.iter().zip(&pulled).map(|(c, p)| c * p).sum::<f64>();
                let taken: f64 =
                    row.iter().zip(solve(&whole.factor, &row)).map(|(c, s)| c * s).sum();
                let sd = (row[i] - taken).max(1e-12 * row[i]).sqrt();
                ln += within(self.support[i], mean, sd).max(f64::MIN_POSITIVE).ln();
            }
            ln
        }))
    }

    /// Share of a population beyond the support of this member's prior, parameter by parameter.
    pub fn outside(&self, population: &Population) -> Vec<f64> {
        let each = self.support.iter().zip(population.mean.iter().zip(&population.spread));
        each.map(|(support, (mean, sd))| (1.0 - within(*support, *mean, *sd)).max(0.0)).collect()
    }

    /// Weights of the samples where the member is known to be one of these populations, each as likely; and where it is by
    /// itself.
    fn weights(&self, populations: &[Population]) -> [Vec<f64>; 2] {
        let mut shrunk = vec![0.0; self.ln_share.len()];
        for population in populations {
            let inverse = packed_inverse(&population.factor, self.d);
            let rows = self.coordinates.chunks_exact(self.d);
            let terms: Vec<f64> = rows
                .zip(&self.ln_share)
                .map(|(row, ln)| ln - 0.5 * distance2(&inverse, &population.mean, row))
                .collect();
            let most = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let terms: Vec<f64> = terms.into_iter().map(|term| (term - most).exp()).collect();
            let total: f64 = terms.iter().sum();
            shrunk.iter_mut().zip(&terms).for_each(|(sum, term)| *sum += term / total);
        }
        let most = self.ln_share.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        [self.ln_share.iter().map(|ln| (ln - most).exp()).collect(), shrunk]
    }

    /// The member's parameters by its likelihood alone, and as a member of these populations.
    pub(crate) fn shrunk(&self, populations: &[Population]) -> [Vec<Weighted>; 2] {
        self.weights(populations).map(|weights| {
            let of = |j: usize| {
                let column = self.coordinates.iter().skip(j).step_by(self.d).copied();
                Weighted::new(column.zip(weights.iter().copied()))
            };
            (0..self.d).map(of).collect()
        })
    }
}

/// Share of a normal between two bounds.
fn within([lower, upper]: [f64; 2], mean: f64, sd: f64) -> f64 {
    let (below, above) = ((lower - mean) / sd, (upper - mean) / sd);
    // Differences are taken on the side on which the areas are small.
    if below > 0.0 {
        normal::cdf(-below) - normal::cdf(-above)
    } else {
        normal::cdf(above) - normal::cdf(below)
    }
}

/// Log density of a normal with this factor at its centre.
fn ln_peak(factor: &[f64], d: usize) -> f64 {
    -(0..d).map(|i| factor[i * d + i].ln() + LN_SQRT_2PI).sum::<f64>()
}

/// Log of weight times density of a component.
fn ln_gaussian(c: &Gaussian, at: &[f64]) -> f64 {
    let d = at.len();
    let inverse = packed_inverse(&c.factor, d);
    c.weight.ln() + ln_peak(&c.factor, d) - 0.5 * distance2(&inverse, &c.mean, at)
}

/// Log of a sum of exponentials.
fn ln_sum(terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let most = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + terms.map(|term| (term - most).exp()).sum::<f64>().ln()
}
