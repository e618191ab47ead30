//! What is assumed of a population before its members are seen, as a map from normal scores.

use crate::normal::{self, Tails};
use crate::sobol::MAX_DIMENSIONS;
use crate::{CalibrateError, Coordinate, Prior, PriorError, PriorSpec};
use serde::{Deserialize, Serialize};
use statrs::function::beta::inv_beta_reg;

/// Tail areas below this are not told apart where a partial correlation is found from them.
const LEAST_TAIL: f64 = 1e-12;

/// What is assumed of the mean, the spread and the correlation of a population of parameter vectors, each in the coordinate of its
/// parameter.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hyperprior {
    /// The mean of each parameter is uniform over this range.
    pub mean: Vec<[f64; 2]>,
    /// The standard deviation of each parameter between members is half-normal: the absolute value of a normal with this
    /// standard deviation.
    pub spread: Vec<f64>,
    /// The correlation matrix has density `det(R)^(eta - 1)` (LKJ) with this eta; parameters are independent of each other
    /// where there is none.
    pub correlation: Option<f64>,
}

/// A population: a multivariate normal in the coordinates of the parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Population {
    /// Mean of each parameter.
    pub mean: Vec<f64>,
    /// Standard deviation of each parameter between members.
    pub spread: Vec<f64>,
    /// Correlations below the diagonal, row by row.
    pub correlation: Vec<f64>,
    /// Lower Cholesky factor of the covariance, row by row.
    pub factor: Vec<f64>,
}

impl Population {
    /// A member of it, from independent standard normal numbers.
    pub fn member(&self, normals: &[f64]) -> Vec<f64> {
        let d = self.mean.len();
        let of = |i: usize| (0..=i).map(|j| self.factor[i * d + j] * normals[j]).sum::<f64>();
        (0..d).map(|i| self.mean[i] + of(i)).collect()
    }
}

impl Hyperprior {
    /// Number of parameters of a member.
    pub fn parameters(&self) -> usize {
        self.mean.len()
    }

    /// Number of numbers that make a population: means, spreads, correlations.
    pub fn dimension(&self) -> usize {
        let d = self.parameters();
        2 * d + if self.correlation.is_some() { d * (d - 1) / 2 } else { 0 }
    }

    /// Refuses ranges out of order, scales that are not positive, and more parameters than can be sampled.
    pub(crate) fn check(&self) -> Result<(), CalibrateError> {
        let refuse =
            |setting, value: f64, range| Err(CalibrateError::Setting { setting, value, range });
        let d = self.parameters();
        if d == 0 || self.spread.len() != d {
            return refuse("number of parameters", d as f64, "at least 1, each with a spread");
        }
        let ordered = |[lower, upper]: &[f64; 2]| lower < upper && (upper - lower).is_finite();
        if let Some([lower, _]) = self.mean.iter().find(|range| !ordered(range)) {
            return refuse("lower end of a population mean", *lower, "below its upper end");
        }
        if let Some(scale) = self.spread.iter().find(|s| !(**s > 0.0 && s.is_finite())) {
            return refuse("scale of a spread", *scale, "above 0 and finite");
        }
        match self.correlation {
            Some(eta) if !(eta > 0.0 && eta <= 1000.0) => {
                return refuse("eta of the correlations", eta, "above 0, at most 1000");
            }
            _ => {}
        }
        if self.dimension() + 2 > MAX_DIMENSIONS {
            let range = "at most 19; leave the correlations out";
            return refuse(
                "number of means, spreads and correlations",
                self.dimension() as f64,
                range,
            );
        }
        Ok(())
    }

    /// The population at normal scores.
    pub fn population(&self, z: &[f64]) -> Population {
        let d = self.parameters();
        let of = |j: usize| self.coordinate(j, z[j]);
        let (mean, spread): (Vec<f64>, Vec<f64>) =
            ((0..d).map(of).collect(), (d..2 * d).map(of).collect());
        // Rows of the factor of the correlation matrix, from canonical partial correlations: Lewandowski, Kurowicka and Joe,
        // J. Multivar. Anal. 100 (2009) 1989.
        let mut factor = vec![0.0; d * d];
        let mut next = 2 * d;
        for i in 0..d {
            let mut rest = 1.0;
            for j in 0..i {
                let partial = match self.correlation {
                    Some(_) => of(next),
                    None => 0.0,
                };
                next += 1;
                let entry: f64 = partial * f64::sqrt(rest);
                rest -= entry * entry;
                factor[i * d + j] = entry;
            }
            factor[i * d + i] = rest.max(f64::EPSILON).sqrt();
        }
        let correlation = (0..d)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| (0..=j).map(|k| factor[i * d + k] * factor[j * d + k]).sum())
            .collect();
        for i in 0..d {
            factor[i * d..(i + 1) * d].iter_mut().for_each(|entry| *entry *= spread[i]);
        }
        Population { mean, spread, correlation, factor }
    }

    /// Number `j` of the means, spreads and partial correlations, at its normal score.
    pub(crate) fn coordinate(&self, j: usize, z: f64) -> f64 {
        let d = self.parameters();
        let tails = normal::tails(z);
        if j < d {
            let [lower, upper] = self.mean[j];
            return if tails.below <= tails.above {
                lower + (upper - lower) * tails.below
            } else {
                upper - (upper - lower) * tails.above
            };
        }
        if j < 2 * d {
            let half = Tails { below: 0.5 + 0.5 * tails.below, above: 0.5 * tails.above };
            // Near zero the quantile is that area over the density at zero, which keeps its digits.
            let near = tails.below * (0.5 * std::f64::consts::PI).sqrt();
            let score = if tails.below < 1e-8 { near } else { normal::quantile_of(half) };
            return self.spread[j - d] * score;
        }
        // Row by row below the diagonal: the column is the number of parameters that are held fixed.
        let (mut row, mut first) = (1, 2 * d);
        while j >= first + row {
            first += row;
            row += 1;
        }
        let held = (j - first) as f64;
        let b = self.correlation.unwrap_or(1.0) + 0.5 * (d as f64 - 2.0 - held);
        let share = inv_beta_reg(b, b, tails.below.min(tails.above).max(LEAST_TAIL));
        (1.0 - 2.0 * share) * z.signum()
    }

    /// The prior of the next member's parameter `j` by its first two moments: a normal in the coordinate.
    ///
    /// # Errors
    /// A range whose middle the coordinate cannot have.
    pub fn of_next(&self, j: usize, coordinate: Coordinate) -> Result<Prior, PriorError> {
        let [lower, upper] = self.mean[j];
        let (centre, width) = (0.5 * (lower + upper), upper - lower);
        let sd = (width * width / 12.0 + self.spread[j] * self.spread[j]).sqrt();
        Prior::new(match coordinate {
            Coordinate::Linear => PriorSpec::Normal { mean: centre, sd },
            Coordinate::Log10 => {
                PriorSpec::LogNormal { median: coordinate.theta(centre), sd_log10: sd }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::function::erf::erf;

    fn of(d: usize, eta: f64) -> Hyperprior {
        Hyperprior { mean: vec![[-1.0, 3.0]; d], spread: vec![0.3; d], correlation: Some(eta) }
    }

    #[test]
    fn spreads_have_the_distribution_function_of_a_half_normal() {
        let prior = of(1, 2.0);
        for z in [-9.0, -6.0, -3.0, -1.0, 0.0, 0.7, 2.0, 5.0] {
            let spread = prior.coordinate(1, z);
            let closed = erf(spread / (0.3 * 2f64.sqrt()));
            let below = normal::cdf(z);
            assert!((closed / below - 1.0).abs() < 1e-6, "{z}: {spread} {closed} {below}");
        }
    }

    #[test]
    fn correlations_of_two_parameters_have_the_distribution_function_of_the_lkj_density() {
        // eta = 2: the density is 3/4 (1 - r^2).
        let prior = of(2, 2.0);
        for z in [-6.0, -2.0, -0.5, 0.0, 0.3, 1.5, 4.0] {
            let r = prior.population(&[0.0, 0.0, 0.0, 0.0, z]).correlation[0];
            let closed = (2.0 + 3.0 * r - r.powi(3)) / 4.0;
            assert!((closed - normal::cdf(z)).abs() < 1e-9, "{z}: {r} {closed}");
        }
    }

    fn determinant(c: &[f64]) -> f64 {
        let (a, b, c) = (c[0], c[1], c[2]);
        1.0 - a * a - b * b - c * c + 2.0 * a * b * c
    }

    #[test]
    fn three_correlations_have_a_joint_density_that_goes_with_a_power_of_the_determinant() {
        for eta in [1.0, 2.0, 3.5] {
            let prior = of(3, eta);
            let at = |z: [f64; 3]| {
                let all = [vec![0.0; 6], z.to_vec()].concat();
                prior.population(&all).correlation
            };
            // Density of the correlations: that of the scores over the determinant of the Jacobian.
            let ln_density_over_power = |z: [f64; 3]| {
                let h = 1e-5;
                let column = |k: usize| {
                    let (mut up, mut down) = (z, z);
                    up[k] += h;
                    down[k] -= h;
                    let (up, down) = (at(up), at(down));
                    [0, 1, 2].map(|i| (up[i] - down[i]) / (2.0 * h))
                };
                let [a, b, c] = [column(0), column(1), column(2)];
                let jacobian = a[0] * (b[1] * c[2] - b[2] * c[1])
                    - b[0] * (a[1] * c[2] - a[2] * c[1])
                    + c[0] * (a[1] * b[2] - a[2] * b[1]);
                let scores: f64 = normal::ln_prior(&z);
                scores - jacobian.abs().ln() - (eta - 1.0) * determinant(&at(z)).ln()
            };
            let first = ln_density_over_power([0.2, -0.4, 0.6]);
            for z in [[1.1, 0.3, -0.8], [-1.5, 0.9, 0.1], [0.0, 0.0, 2.0]] {
                let other = ln_density_over_power(z);
                assert!((other - first).abs() < 1e-4, "eta {eta}: {first} {other}");
            }
        }
    }

    #[test]
    fn the_factor_is_that_of_the_spreads_and_correlations_and_means_keep_to_their_ranges() {
        let prior = of(3, 2.0);
        let z = [-9.0, 0.5, 9.0, 0.3, -0.2, 1.0, 0.8, -1.2, 0.4];
        let found = prior.population(&z);
        assert!(found.mean.iter().all(|m| (-1.0..=3.0).contains(m)), "{found:?}");
        let covariance = |i: usize, j: usize| {
            (0..3).map(|k| found.factor[i * 3 + k] * found.factor[j * 3 + k]).sum::<f64>()
        };
        for (k, (i, j)) in [(1, 0), (2, 0), (2, 1)].into_iter().enumerate() {
            let r = covariance(i, j) / (found.spread[i] * found.spread[j]);
            assert!((r - found.correlation[k]).abs() < 1e-12);
        }
        assert!((0..3).all(|i| (covariance(i, i).sqrt() / found.spread[i] - 1.0).abs() < 1e-12));
        let alone = Hyperprior { correlation: None, ..prior };
        assert_eq!((alone.dimension(), alone.population(&z[..6]).correlation), (6, vec![0.0; 3]));
    }
}
