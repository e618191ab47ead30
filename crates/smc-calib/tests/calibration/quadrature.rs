//! Quadrature against closed forms where the density ends at an edge inside the box.

use smc_calib::quadrature::{Quadrature, QuadratureSettings, integrate};
use smc_calib::{SimError, Target, normal};

/// A Gaussian likelihood, every coordinate measured as `Y` with noise `sigma`, that can be simulated only where
/// `normal . z <= bound` for all of some half spaces.
struct Cut {
    d: usize,
    sigma: f64,
    half_spaces: Vec<(Vec<f64>, f64)>,
}

const Y: f64 = 0.3;

impl Target for Cut {
    fn dimension(&self) -> usize {
        self.d
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let outside = |(normal, bound): &(Vec<f64>, f64)| {
            z.iter().zip(normal).map(|(z, n)| z * n).sum::<f64>() > *bound
        };
        if self.half_spaces.iter().any(outside) {
            return Err(SimError::recoverable("beyond the edge"));
        }
        Ok(z.iter().map(|z| normal::ln_density((Y - z) / self.sigma) - self.sigma.ln()).sum())
    }
}

/// Mean and sd of the posterior without the cut, per coordinate, and its log evidence.
fn uncut(d: usize, sigma: f64) -> (f64, f64, f64) {
    let total = 1.0 + sigma * sigma;
    let ln_evidence = normal::ln_density(Y / total.sqrt()) - 0.5 * total.ln();
    (Y / total, sigma / total.sqrt(), d as f64 * ln_evidence)
}

/// Of a standard normal below beta: minus its mean, and its variance (N. L. Johnson, S. Kotz, N. Balakrishnan, Continuous
/// Univariate Distributions 1, section 10.1).
fn truncated(beta: f64) -> (f64, f64) {
    let lambda = normal::ln_density(beta).exp() / normal::cdf(beta);
    (lambda, 1.0 - beta * lambda - lambda * lambda)
}

/// Holds a quadrature to exact means, sds and log evidence, and to its own estimate of its error.
fn hold(q: &Quadrature, mean: &[f64], sd: &[f64], log_evidence: f64, tolerance: f64, what: &str) {
    let mut worst = (q.log_evidence - log_evidence).abs();
    for j in 0..mean.len() {
        worst = worst.max((q.mean[j] - mean[j]).abs() / sd[j]).max((q.sd[j] / sd[j] - 1.0).abs());
    }
    assert!(worst < tolerance, "{what}: off by {worst:e}, said {:e}", q.error);
    // Bisection leaves the edge uncertain by a 256th of a cell.
    assert!(worst < 2.0 * q.error + 3e-5, "{what}: off by {worst:e}, said {:e}", q.error);
}

fn half_space(direction: &[f64], sigma: f64, beta: f64, tolerance: f64) {
    let d = direction.len();
    let (m, s, ln_evidence) = uncut(d, sigma);
    let bound = direction.iter().map(|a| a * m).sum::<f64>() + beta * s;
    let cut = Cut { d, sigma, half_spaces: vec![(direction.to_vec(), bound)] };
    let settings = QuadratureSettings { tolerance, ..QuadratureSettings::default() };
    let q = integrate(&cut, &|_, z| z, &settings).expect("mass on this side");
    let (lambda, variance) = truncated(beta);
    let mean: Vec<f64> = direction.iter().map(|a| m - a * s * lambda).collect();
    let sd: Vec<f64> =
        direction.iter().map(|a| s * (1.0 - a * a * (1.0 - variance)).sqrt()).collect();
    let what = format!("{direction:?}, sigma {sigma}, beta {beta}");
    hold(&q, &mean, &sd, ln_evidence + normal::cdf(beta).ln(), tolerance, &what);
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_gaussian_cut_where_simulations_fail_has_the_moments_of_a_truncated_normal() {
    // Along an axis every line of cells ends at the same place; obliquely at all of them.
    for direction in [vec![1.0], vec![1.0, 0.0], vec![0.0, -1.0], vec![0.6, 0.8]] {
        for sigma in [1.0, 0.03] {
            for beta in [-3.0, -1.0, 0.0, 1.0, 3.0] {
                half_space(&direction, sigma, beta, 1e-3);
            }
        }
    }
    for direction in [vec![1.0, 0.0, 0.0], vec![0.48, 0.6, 0.64]] {
        for (sigma, beta) in [(1.0, 0.0), (0.03, -1.0)] {
            half_space(&direction, sigma, beta, 1e-2);
        }
    }
}

#[test]
fn two_edges_that_meet_count_once_each() {
    let (sigma, betas) = (0.1, [-0.5, 0.7]);
    let (m, s, ln_evidence) = uncut(2, sigma);
    let half_spaces = vec![(vec![1.0, 0.0], m + betas[0] * s), (vec![0.0, 1.0], m + betas[1] * s)];
    let q = integrate(&Cut { d: 2, sigma, half_spaces }, &|_, z| z, &QuadratureSettings::default())
        .expect("mass on this side");
    let [a, b] = betas.map(truncated);
    hold(
        &q,
        &[m - s * a.0, m - s * b.0],
        &[s * a.1.sqrt(), s * b.1.sqrt()],
        ln_evidence + betas.iter().map(|beta| normal::cdf(*beta).ln()).sum::<f64>(),
        1e-3,
        "corner",
    );
}

/// A bent ridge in three dimensions: `x ~ N(0, s^2)`, `y | x ~ N(b (x^2 - s^2), t^2)`, `w | x ~ N(c x^3, t^2)`; the prior
/// is divided out, so that this is the posterior and its evidence is 1.
struct Bent {
    t: f64,
}

const BENT: (f64, f64, f64) = (0.5, 1.2, 1.5);

impl Target for Bent {
    fn dimension(&self) -> usize {
        3
    }

    fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
        let (s, b, c) = BENT;
        let x = z[0];
        let ln = |off: f64, sd: f64| normal::ln_density(off / sd) - sd.ln();
        let ridge = ln(z[1] - b * (x * x - s * s), self.t) + ln(z[2] - c * x.powi(3), self.t);
        Ok(ln(x, s) + ridge - z.iter().map(|z| normal::ln_density(*z)).sum::<f64>())
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_thin_ends_of_a_bent_ridge_are_inside_the_box() {
    // A first grid sees only a few cells of a ridge thinner than they are.
    let (s, b, c) = BENT;
    for t in [0.4, 0.2, 0.1] {
        let q = integrate(&Bent { t }, &|_, z| z, &QuadratureSettings::default()).expect("mass");
        let sd = [
            s,
            (t * t + 2.0 * b * b * s.powi(4)).sqrt(),
            (t * t + 15.0 * c * c * s.powi(6)).sqrt(),
        ];
        let worst = (0..3)
            .map(|j| (q.mean[j] / sd[j]).abs().max((q.sd[j] / sd[j] - 1.0).abs()))
            .fold(q.log_evidence.abs(), f64::max);
        assert!(worst < 2.0 * q.error + 1e-4, "{t}: off by {worst:e}, said {:e}", q.error);
        // Thinner than that, 192 points per dimension are too few, and the stated error says so.
        assert!(t < 0.2 || worst < 1e-3, "{t}: off by {worst:e}");
    }
}
