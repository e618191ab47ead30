//! Proposals: a mixture of Student-t components beside a share of the prior.

use crate::cholesky::packed_inverse;
use crate::normal;
use crate::{ComponentRecord, MixtureRecord};
use statrs::function::gamma::ln_gamma;
use std::f64::consts::PI;

/// One multivariate Student-t component.
#[derive(Clone, Debug)]
pub(crate) struct Component {
    pub weight: f64,
    pub mean: Vec<f64>,
    /// Lower Cholesky factor of the scale matrix, row by row.
    pub factor: Vec<f64>,
    /// Inverse of the factor, lower triangle packed row by row.
    pub inverse: Vec<f64>,
    /// Density at the centre.
    pub peak: f64,
}

/// A proposal: `prior_share` of the standard normal and the rest Student-t components.
#[derive(Clone, Debug)]
pub(crate) struct Proposal {
    pub dimension: usize,
    pub prior_share: f64,
    pub degrees_of_freedom: f64,
    pub components: Vec<Component>,
}

/// Squared Mahalanobis distance from the packed inverse factor.
#[inline(always)]
pub(crate) fn distance2(inverse: &[f64], mean: &[f64], z: &[f64]) -> f64 {
    let mut sum = 0.0;
    let mut row = 0;
    for i in 0..z.len() {
        let mut u = 0.0;
        for j in 0..=i {
            u += inverse[row + j] * (z[j] - mean[j]);
        }
        row += i + 1;
        sum += u * u;
    }
    sum
}

impl Component {
    /// A component with the given lower Cholesky factor of its scale matrix.
    pub(crate) fn new(weight: f64, mean: Vec<f64>, factor: Vec<f64>, nu: f64) -> Self {
        let d = mean.len();
        let half = 0.5 * d as f64;
        let ln_det: f64 = (0..d).map(|i| factor[i * d + i].ln()).sum();
        let ln_peak =
            ln_gamma(0.5 * nu + half) - ln_gamma(0.5 * nu) - half * (nu * PI).ln() - ln_det;
        let inverse = packed_inverse(&factor, d);
        Self { weight, mean, factor, inverse, peak: ln_peak.exp() }
    }

    /// Squared Mahalanobis distance in the scale matrix.
    pub(crate) fn distance2(&self, z: &[f64]) -> f64 {
        distance2(&self.inverse, &self.mean, z)
    }

    /// Student-t density (unweighted) from the squared distance.
    #[inline(always)]
    pub(crate) fn density(&self, distance2: f64, nu: f64) -> f64 {
        // (1 + m/nu)^(-(nu+d)/2), without logarithms where twice the exponent is a whole number.
        let base = 1.0 / (1.0 + distance2 / nu);
        let twice = nu + self.mean.len() as f64;
        let power = if twice.fract() == 0.0 && twice < 1e3 {
            let twice = twice as i32;
            let whole = base.powi(twice / 2);
            if twice % 2 == 0 { whole } else { whole * base.sqrt() }
        } else {
            base.powf(0.5 * twice)
        };
        self.peak * power
    }
}

/// ln(e^a + e^b), where a or b is above minus infinity.
pub(crate) fn ln_sum(a: f64, b: f64) -> f64 {
    let top = a.max(b);
    top + ((a - top).exp() + (b - top).exp()).ln()
}

impl Proposal {
    /// The prior itself.
    pub(crate) fn prior(dimension: usize) -> Self {
        Self { dimension, prior_share: 1.0, degrees_of_freedom: 1.0, components: Vec::new() }
    }

    /// The mixture that the samples of several stages together are drawn from.
    pub(crate) fn of_stages(stages: &[(usize, Proposal)]) -> Option<Self> {
        // A stage that was drawn from the prior alone has no degrees of freedom to speak of.
        let with_components =
            stages.iter().map(|stage| &stage.1).find(|q| !q.components.is_empty());
        let like = with_components.or(stages.last().map(|stage| &stage.1))?;
        let total: usize = stages.iter().map(|(n, _)| n).sum();
        let mut all = Self { prior_share: 0.0, components: Vec::new(), ..like.clone() };
        for (n, proposal) in stages {
            let share = *n as f64 / total as f64;
            all.prior_share += share * proposal.prior_share;
            let components = proposal.components.iter().cloned();
            all.components.extend(components.map(|c| Component { weight: c.weight * share, ..c }));
        }
        Some(all)
    }

    /// A proposal as plain data.
    pub(crate) fn record(&self) -> MixtureRecord {
        let d = self.dimension;
        MixtureRecord {
            prior_share: self.prior_share,
            components: self
                .components
                .iter()
                .map(|c| ComponentRecord {
                    weight: c.weight,
                    mean: c.mean.clone(),
                    scale: (0..d)
                        .map(|i| {
                            (0..d)
                                .map(|j| {
                                    (0..=i.min(j))
                                        .map(|k| c.factor[i * d + k] * c.factor[j * d + k])
                                        .sum()
                                })
                                .collect()
                        })
                        .collect(),
                    degrees_of_freedom: self.degrees_of_freedom,
                })
                .collect(),
        }
    }

    /// Density of the Student-t part at z: components times their shares, the prior's share left out.
    #[inline]
    pub(crate) fn student_density(&self, z: &[f64]) -> f64 {
        // Constant trip counts let the compiler unroll the common dimensions.
        match z.len() {
            1 => self.student_density_of::<1>(z),
            2 => self.student_density_of::<2>(z),
            3 => self.student_density_of::<3>(z),
            4 => self.student_density_of::<4>(z),
            _ => self
                .components
                .iter()
                .map(|c| c.weight * c.density(c.distance2(z), self.degrees_of_freedom))
                .sum(),
        }
    }

    #[inline]
    fn student_density_of<const D: usize>(&self, z: &[f64]) -> f64 {
        let mut fixed = [0.0; D];
        fixed.copy_from_slice(&z[..D]);
        let mut sum = 0.0;
        for c in &self.components {
            let m2 = distance2(&c.inverse, &c.mean[..D], &fixed);
            sum += c.weight * c.density(m2, self.degrees_of_freedom);
        }
        sum
    }

    /// Log of the density at z over that of the prior there.
    pub(crate) fn ln_over_prior(&self, z: &[f64], ln_prior: f64) -> f64 {
        ln_sum(self.prior_share.ln(), self.student_density(z).ln() - ln_prior)
    }

    /// Number of uniform numbers a draw takes: component, normals, chi-square.
    pub(crate) fn uniforms(&self) -> usize {
        self.dimension + 2
    }

    /// The draw that belongs to a point of the unit cube.
    pub(crate) fn draw(&self, u: &[f64], z: &mut [f64]) {
        let d = self.dimension;
        let mut target = u[0] - self.prior_share;
        if self.components.is_empty() || target < 0.0 {
            for (z, u) in z.iter_mut().zip(&u[1..]) {
                *z = normal::quantile(*u);
            }
            return;
        }
        let mut chosen = &self.components[self.components.len() - 1];
        for c in &self.components {
            if target < c.weight {
                chosen = c;
                break;
            }
            target -= c.weight;
        }
        let nu = self.degrees_of_freedom;
        let stretch = (nu / chi_square_quantile(u[d + 1], nu)).sqrt();
        for i in 0..d {
            z[i] = normal::quantile(u[1 + i]) * stretch;
        }
        for i in (0..d).rev() {
            let row = &chosen.factor[i * d..i * d + i + 1];
            let sum: f64 = row.iter().zip(z.iter()).map(|(l, n)| l * n).sum();
            z[i] = sum + chosen.mean[i];
        }
    }
}

/// Quantile of the chi-square distribution: Wilson and Hilferty's start, then Newton in the logarithm of x.
pub(crate) fn chi_square_quantile(p: f64, nu: f64) -> f64 {
    let a = 0.5 * nu;
    let k = 2.0 / (9.0 * nu);
    let start = nu * (1.0 - k + normal::quantile(p) * k.sqrt()).powi(3);
    // For small p the distribution function is (x/2)^a / Gamma(a+1).
    let small = 2.0 * ((p.ln() + ln_gamma(a + 1.0)) / a).exp();
    let mut x = if start > 0.1 * small && start > 0.02 * nu { start } else { small };
    let ln_gamma_a = ln_gamma(a);
    let upper_tail = p > 0.5;
    for _ in 0..20 {
        let ln_density = (a - 1.0) * (0.5 * x).ln() - 0.5 * x - ln_gamma_a - std::f64::consts::LN_2;
        // f = ln of the smaller tail: close to linear in ln x.
        let (value, target, sign) = if upper_tail {
            (gamma_upper(a, 0.5 * x), 1.0 - p, -1.0)
        } else {
            (1.0 - gamma_upper(a, 0.5 * x), p, 1.0)
        };
        let value = if !upper_tail && value < 0.1 {
            statrs::function::gamma::gamma_lr(a, 0.5 * x)
        } else {
            value
        };
        if value <= 0.0 {
            break;
        }
        let slope = sign * ln_density.exp() / value * x;
        let step = ((target / value).ln() / slope).clamp(-1.0, 1.0);
        x *= step.exp();
        if step.abs() < 1e-13 {
            break;
        }
    }
    x
}

/// Regularised upper incomplete gamma function; a finite sum for whole a.
fn gamma_upper(a: f64, x: f64) -> f64 {
    if a.fract() == 0.0 && a <= 30.0 {
        let (mut term, mut sum) = (1.0, 1.0);
        for k in 1..a as u32 {
            term *= x / f64::from(k);
            sum += term;
        }
        (-x).exp() * sum
    } else {
        statrs::function::gamma::gamma_ur(a, x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_quantile_matches_tables() {
        // Abramowitz and Stegun, Table 26.8, and mpmath for the far ends.
        for (p, nu, x) in [
            (0.95, 10.0, 18.307_038_053_275_146),
            (0.005, 10.0, 2.155_856_481_304_463_4),
            (0.5, 3.0, 2.365_973_884_375_337_6),
            (0.05, 1.0, 3.932_140_000_019_522e-3),
        ] {
            approx::assert_relative_eq!(chi_square_quantile(p, nu), x, max_relative = 1e-10);
        }
        for p in [1e-12, 1e-6, 0.01, 0.3, 0.7, 0.999, 1.0 - 1e-9] {
            for nu in [2.0, 10.0, 12.0, 7.5] {
                let x = chi_square_quantile(p, nu);
                let back = statrs::function::gamma::gamma_lr(0.5 * nu, 0.5 * x);
                assert!((back / p - 1.0).abs() < 1e-8, "p {p} nu {nu}: {back}");
            }
        }
    }

    #[test]
    fn student_density_integrates_to_one() {
        let c = Component::new(1.0, vec![0.3], vec![0.7], 10.0);
        let h = 0.01;
        let sum: f64 =
            (-20_000..20_000).map(|i| c.density(c.distance2(&[f64::from(i) * h]), 10.0) * h).sum();
        assert!((sum - 1.0).abs() < 1e-10, "{sum}");
    }

    #[test]
    fn draws_have_the_mean_and_covariance_of_the_component() {
        let factor = vec![1.0, 0.0, 0.8, 0.6];
        let p = Proposal {
            dimension: 2,
            prior_share: 0.0,
            degrees_of_freedom: 10.0,
            components: vec![Component::new(1.0, vec![1.0, -2.0], factor, 10.0)],
        };
        let n = 1 << 14;
        let net = crate::sobol::scrambled_net(
            4,
            n,
            &mut crate::stream::stream(5, crate::stream::Purpose::Scramble, 0, 0),
        );
        let (mut mean, mut cov) = ([0.0; 2], [0.0; 3]);
        for u in net.chunks_exact(4) {
            let mut z = [0.0; 2];
            p.draw(u, &mut z);
            let (x, y) = (z[0] - 1.0, z[1] + 2.0);
            mean[0] += x / n as f64;
            mean[1] += y / n as f64;
            cov[0] += x * x / n as f64;
            cov[1] += x * y / n as f64;
            cov[2] += y * y / n as f64;
        }
        assert!(mean[0].abs() < 1e-3 && mean[1].abs() < 1e-3, "{mean:?}");
        for (got, want) in cov.iter().zip([1.25, 1.0, 1.25]) {
            assert!((got - want).abs() < 0.01, "{cov:?}");
        }
    }
}
