//! Problems with known answers: the posterior's moments and the evidence in closed form or by one-dimensional
//! integration that is exact to rounding.
//!
//! Each is a log likelihood over normal scores, to be sampled by [`crate::sample_density`]; the prior is the
//! standard normal in every coordinate, so `evidence = integral of likelihood times prior`.

use crate::normal::{self, LN_SQRT_2PI, ln_prior};
use crate::{SimError, Target};
use std::f64::consts::PI;

/// A log likelihood over normal scores.
type LnLikelihood = Box<dyn Fn(&[f64]) -> f64 + Sync + Send>;

/// A problem and its known answer.
pub struct Reference {
    /// Name.
    pub name: &'static str,
    /// Where the answer comes from.
    pub derivation: &'static str,
    /// Posterior means.
    pub mean: Vec<f64>,
    /// Posterior standard deviations.
    pub sd: Vec<f64>,
    /// Log evidence.
    pub log_evidence: f64,
    dimension: usize,
    ln_likelihood: LnLikelihood,
}

impl Target for Reference {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        Ok((self.ln_likelihood)(z))
    }
}

/// A Gaussian likelihood in any dimension: every coordinate measured as `y` with noise `sigma`.
///
/// Conjugate: precision `1 + 1/sigma^2`, mean `y/(1 + sigma^2)`, evidence `N(y; 0, 1 + sigma^2)` per coordinate
/// (A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 2.5).
pub fn gaussian(dimension: usize, y: f64, sigma: f64) -> Reference {
    let total = 1.0 + sigma * sigma;
    Reference {
        name: "gaussian",
        derivation: "conjugate normal model",
        mean: vec![y / total; dimension],
        sd: vec![sigma / total.sqrt(); dimension],
        log_evidence: dimension as f64 * (-0.5 * y * y / total - 0.5 * total.ln() - LN_SQRT_2PI),
        dimension,
        ln_likelihood: Box::new(move |z| {
            z.iter().map(|z| normal::ln_density((y - z) / sigma) - sigma.ln()).sum()
        }),
    }
}

/// A banana in two dimensions: `x ~ N(0, s^2)`, `y | x ~ N(b (x^2 - s^2), t^2)`.
///
/// The posterior density is that one exactly (the likelihood divides the prior out), so means are zero, the
/// variances `s^2` and `t^2 + 2 b^2 s^4`, the evidence `exp(-3)`
/// (H. Haario, E. Saksman, J. Tamminen, Comput. Stat. 14 (1999) 375, with the mean taken out).
pub fn banana() -> Reference {
    let (s, b, t) = (0.5, 1.2, 0.12);
    Reference {
        name: "banana",
        derivation: "moments of a polynomial of normals",
        mean: vec![0.0, 0.0],
        sd: vec![s, f64::sqrt(t * t + 2.0 * b * b * s * s * s * s)],
        log_evidence: -3.0,
        dimension: 2,
        ln_likelihood: Box::new(move |z| {
            let ln_x = normal::ln_density(z[0] / s) - s.ln();
            let bend = b * (z[0] * z[0] - s * s);
            let ln_y = normal::ln_density((z[1] - bend) / t) - t.ln();
            ln_x + ln_y - ln_prior(z) - 3.0
        }),
    }
}

/// Two modes in two dimensions: normals of sd 0.2 at (-1.2, -0.8) with probability 0.4 and at (1, 1) with 0.6.
///
/// Mixture moments; evidence `exp(-3)`.
pub fn two_modes() -> Reference {
    let (p, s) = (0.4, 0.2);
    let (a, b) = ([-1.2, -0.8], [1.0, 1.0]);
    let mean: Vec<f64> = (0..2).map(|j| p * a[j] + (1.0 - p) * b[j]).collect();
    let sd =
        (0..2).map(|j| f64::sqrt(s * s + p * (1.0 - p) * (a[j] - b[j]) * (a[j] - b[j]))).collect();
    Reference {
        name: "two modes",
        derivation: "moments of a mixture of two normals",
        mean,
        sd,
        log_evidence: -3.0,
        dimension: 2,
        ln_likelihood: Box::new(move |z| {
            let part = |m: &[f64; 2]| -> f64 {
                (0..2).map(|j| normal::ln_density((z[j] - m[j]) / s) - f64::ln(s)).sum()
            };
            let (x, y) = (p.ln() + part(&a), (1.0 - p).ln() + part(&b));
            let top = x.max(y);
            top + ((x - top).exp() + (y - top).exp()).ln() - ln_prior(z) - 3.0
        }),
    }
}

/// A heavy tail in two dimensions: the posterior is a Student t with 10 degrees of freedom, scale 0.25, at
/// (0.5, -0.3).
///
/// Variance `scale^2 nu/(nu - 2)`; evidence `exp(-3)`.
pub fn heavy_tail() -> Reference {
    let (nu, s, m) = (10.0, 0.25, [0.5, -0.3]);
    // Gamma(nu/2 + 1)/Gamma(nu/2) = nu/2.
    let ln_peak: f64 = f64::ln(nu / 2.0) - f64::ln(nu * PI) - 2.0 * f64::ln(s);
    let sd = s * f64::sqrt(nu / (nu - 2.0));
    Reference {
        name: "heavy tail",
        derivation: "multivariate Student t",
        mean: m.to_vec(),
        sd: vec![sd; 2],
        log_evidence: -3.0,
        dimension: 2,
        ln_likelihood: Box::new(move |z| {
            let r2 = ((z[0] - m[0]) / s).powi(2) + ((z[1] - m[1]) / s).powi(2);
            ln_peak - 0.5 * (nu + 2.0) * (r2 / nu).ln_1p() - ln_prior(z) - 3.0
        }),
    }
}

/// Two parameters on a ridge of correlation 0.95 that a bound cuts: `x` a half normal above zero, `y | x`
/// normal.
///
/// `x = |N(0, s^2)|`: mean `s sqrt(2/pi)`, variance `s^2 (1 - 2/pi)`; `y = r x + t N(0, 1)`; evidence `exp(-3)`.
pub fn bounded_ridge() -> Reference {
    let (s, r) = (0.6, 0.9);
    let var_x = s * s * (1.0 - 2.0 / PI);
    // So that the correlation is 0.95: r^2 var_x / (r^2 var_x + t^2) = 0.95^2.
    let t = f64::sqrt(r * r * var_x * (1.0 / (0.95 * 0.95) - 1.0));
    let mean_x = s * f64::sqrt(2.0 / PI);
    Reference {
        name: "bounded ridge",
        derivation: "half normal and its linear regression",
        mean: vec![mean_x, r * mean_x],
        sd: vec![var_x.sqrt(), f64::sqrt(r * r * var_x + t * t)],
        log_evidence: -3.0,
        dimension: 2,
        ln_likelihood: Box::new(move |z| {
            if z[0] < 0.0 {
                return f64::NEG_INFINITY;
            }
            let ln_x = std::f64::consts::LN_2 + normal::ln_density(z[0] / s) - s.ln();
            ln_x + normal::ln_density((z[1] - r * z[0]) / t) - t.ln() - ln_prior(z) - 3.0
        }),
    }
}

/// All reference problems, the Gaussian in three dimensions.
pub fn all() -> Vec<Reference> {
    vec![gaussian(3, 0.8, 0.1), banana(), two_modes(), heavy_tail(), bounded_ridge()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quadrature::{QuadratureSettings, integrate};

    #[test]
    fn stated_moments_and_evidence_are_those_of_brute_force_integration() {
        for reference in all() {
            let settings = QuadratureSettings { tolerance: 1e-5, max_points: 192 };
            let q = integrate(&reference, &|_, z| z, &settings).expect("integrable");
            // The ridge has a jump, which a regular grid resolves to half a cell only.
            let tolerance = if reference.name == "bounded ridge" { 4e-3 } else { 1e-4 };
            assert!(
                (q.log_evidence - reference.log_evidence).abs() < tolerance,
                "{}: {q:?}",
                reference.name
            );
            for j in 0..reference.mean.len() {
                assert!(
                    (q.mean[j] - reference.mean[j]).abs() < tolerance * reference.sd[j],
                    "{}: {q:?}",
                    reference.name
                );
                assert!(
                    (q.sd[j] / reference.sd[j] - 1.0).abs() < tolerance,
                    "{}: {q:?}",
                    reference.name
                );
            }
        }
    }
}
