//! A line with normal priors and known noise has an exact posterior.

use crate::support::{line, line_data, line_problem};
use nalgebra::{DMatrix, DVector};
use smc_calib::quadrature::{QuadratureSettings, quadrature};
use smc_calib::{FixedSigma, Noise, Settings, calibrate, predictive_band};

pub(crate) struct Exact {
    pub(crate) mean: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    pub(crate) log_evidence: f64,
}

/// Posterior `N(C X'y/s^2, C)`, `C = (X'X/s^2 + P^-1)^-1`; evidence `N(y; 0, X P X' + s^2 I)`.
pub(crate) fn exact(sigma: f64) -> Exact {
    let data = line_data();
    let m = data.len();
    let x = DMatrix::from_fn(m, 2, |i, j| if j == 0 { 1.0 } else { data.control()[i] });
    let y = DVector::from_column_slice(data.values());
    let p = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 4.0]));
    let precision = x.transpose() * &x / (sigma * sigma) + p.clone().try_inverse().unwrap();
    let covariance = precision.try_inverse().unwrap();
    let mean = &covariance * x.transpose() * &y / (sigma * sigma);
    let marginal = &x * p * x.transpose() + DMatrix::identity(m, m) * sigma * sigma;
    let chol = marginal.cholesky().unwrap();
    let ln_det: f64 = chol.l().diagonal().iter().map(|v| 2.0 * v.ln()).sum();
    let quad = y.dot(&chol.solve(&y));
    let log_evidence = -0.5 * (quad + ln_det + m as f64 * (2.0 * std::f64::consts::PI).ln());
    Exact { mean, covariance, log_evidence }
}

#[test]
fn posterior_of_a_line_is_the_conjugate_one() {
    let sigma = 0.05;
    let exact = exact(sigma);
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(sigma) });
    let seeds = 8u32;
    let (mut errors, mut evidence) = ([0.0f64; 4], 0.0);
    for seed in 0..seeds {
        let settings = Settings { samples: 4096, seed: u64::from(seed), ..Settings::default() };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        for j in 0..2 {
            let sd = exact.covariance[(j, j)].sqrt();
            let got = &p.parameters[j].in_coordinate;
            errors[j] += ((got.mean - exact.mean[j]) / sd).powi(2) / f64::from(seeds);
            errors[2 + j] += (got.sd / sd - 1.0).powi(2) / f64::from(seeds);
            // Normal marginals: every interval and the MAP are known.
            assert!((got.eti95.upper - exact.mean[j] - 1.96 * sd).abs() < 0.15 * sd, "{got:?}");
            assert!((got.median - exact.mean[j]).abs() < 0.08 * sd);
            assert!(
                (got.hdi50.upper - got.hdi50.lower - 2.0 * 0.6745 * sd).abs() < 0.12 * sd,
                "{got:?}"
            );
            assert!((p.parameters[j].map - exact.mean[j]).abs() < 0.01 * sd);
        }
        let r =
            exact.covariance[(0, 1)] / (exact.covariance[(0, 0)] * exact.covariance[(1, 1)]).sqrt();
        assert!((p.correlation[0][1] - r).abs() < 0.03);
        evidence += (p.log_evidence.value - exact.log_evidence).powi(2) / f64::from(seeds);
        assert!(p.log_evidence.agree && p.khat < 0.7, "{:?} {}", p.log_evidence, p.khat);
    }
    assert!(errors[0].sqrt() < 0.02 && errors[1].sqrt() < 0.02, "means {errors:?}");
    assert!(errors[2].sqrt() < 0.02 && errors[3].sqrt() < 0.02, "sds {errors:?}");
    assert!(evidence.sqrt() < 0.01, "evidence {}", evidence.sqrt());
}

#[test]
fn quadrature_of_a_line_is_the_conjugate_answer() {
    let exact = exact(0.05);
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let q = quadrature(&problem, &QuadratureSettings::default()).unwrap();
    assert!((q.log_evidence - exact.log_evidence).abs() < 1e-6);
    for j in 0..2 {
        let sd = exact.covariance[(j, j)].sqrt();
        assert!((q.mean[j] - exact.mean[j]).abs() < 1e-6 * sd);
        assert!((q.sd[j] / sd - 1.0).abs() < 1e-6);
        assert!((q.quantiles[j][3] - exact.mean[j]).abs() < 0.01 * sd);
    }
}

#[test]
fn predictive_band_is_the_normal_one_and_widens_by_the_noise() {
    let exact = exact(0.05);
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let p =
        calibrate(&problem, &Settings { samples: 4096, ..Settings::default() }, &mut ()).unwrap();
    let band = predictive_band(&p, &simulator, line_data().control(), 4096).unwrap();
    for (b, at) in band.iter().zip(&p.predictive) {
        let x = DVector::from_vec(vec![1.0, b.control]);
        let mean = x.dot(&exact.mean);
        let sd = (x.transpose() * &exact.covariance * &x)[(0, 0)].sqrt();
        let noisy = sd.hypot(0.05);
        assert!((b.mean - mean).abs() < 0.05 * sd && (at.mean - mean).abs() < 0.05 * sd);
        assert!(((b.curve90[1] - b.curve90[0]) / (2.0 * 1.645 * sd) - 1.0).abs() < 0.06);
        assert!(((b.noisy90[1] - b.noisy90[0]) / (2.0 * 1.645 * noisy) - 1.0).abs() < 0.06);
    }
}

#[test]
fn the_band_is_of_moved_samples_where_samples_were_moved() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let settings = Settings { samples: 512, ..Settings::default() };
    let mut p = calibrate(&problem, &settings, &mut ()).unwrap();
    let control = line_data().control().to_vec();
    let before = predictive_band(&p, &simulator, &control, 512).unwrap();
    p.samples.iter_mut().for_each(|s| s.moved = vec![s.theta[0] + 0.25, s.theta[1] - 0.5]);
    let after = predictive_band(&p, &simulator, &control, 512).unwrap();
    for (before, after) in before.iter().zip(&after) {
        let by = 0.25 - 0.5 * after.control;
        assert!((after.mean - before.mean - by).abs() < 1e-12, "{before:?} {after:?}");
        assert!((after.noisy90[1] - before.noisy90[1] - by).abs() < 1e-12);
    }
}

#[test]
fn the_path_ends_at_the_posterior_and_its_evidence() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    let p =
        calibrate(&problem, &Settings { samples: 4096, ..Settings::default() }, &mut ()).unwrap();
    let last = p.path.last().unwrap();
    assert_eq!(p.path.len(), 12);
    assert!((last.log_evidence - p.log_evidence.value).abs() < 1e-9);
    assert!((last.ess / p.ess.importance - 1.0).abs() < 1e-9);
    for (a, b) in last.parameters.iter().zip(&p.parameters) {
        assert!((a.mean - b.in_coordinate.mean).abs() < 1e-9);
        assert!((a.sd / b.in_coordinate.sd - 1.0).abs() < 1e-9);
    }
    // After one observation the slope is still its prior.
    assert!((p.path[0].parameters[1].sd - 2.0).abs() < 0.5, "{:?}", p.path[0]);
}
