//! The density of a curve with sigma integrated out: a multivariate Student t.

use statrs::function::gamma::ln_gamma;

/// Log constants of the Student t of the first 1, 2, .. observations; one more observation has
/// Gamma((nu+1)/2)/Gamma(nu/2)/sqrt(pi nu0 s0^2).
pub(super) fn student_constants(nu0: f64, sum0: f64, rows: usize) -> Vec<f64> {
    let ln_scale = 0.5 * (std::f64::consts::PI * sum0).ln();
    let base = ln_gamma(0.5 * nu0);
    (1..=rows).map(|k| ln_gamma(0.5 * (nu0 + k as f64)) - base - k as f64 * ln_scale).collect()
}
