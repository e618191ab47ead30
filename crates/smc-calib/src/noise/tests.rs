//! Noise models against dense linear algebra and direct sums.

use super::correlated::Correlated;
use super::robust;
use super::*;
use crate::Observations;
use nalgebra::{DMatrix, DVector};
use statrs::function::gamma::ln_gamma;

const NU0: f64 = 4.0;
const S0: f64 = 0.05;

/// Times with a row at 0 and two equal ones, values, and a curve that misses them.
fn data(m: usize) -> (Observations, Vec<f64>) {
    let mut control: Vec<f64> = (0..m).map(|k| 0.3 * (k as f64).powf(1.7)).collect();
    if m > 6 {
        control[5] = control[4];
    }
    let wave = |k: usize| (0.37 * k as f64).sin() * 0.04 + 0.01 * ((7 * k) % 5) as f64;
    let values = (0..m).map(|k| 0.5 + wave(k)).collect();
    let outputs = (0..m).map(|k| 0.5 + 0.02 * (0.21 * k as f64).cos()).collect();
    (Observations::new(control, values).expect("observations"), outputs)
}

fn residuals(observations: &Observations, outputs: &[f64]) -> Vec<f64> {
    observations.values().iter().zip(outputs).map(|(v, o)| v - o).collect()
}

/// Correlation of the process between two places; places without a logarithm are far from all others.
fn process(scale: DistanceScale, a: f64, b: f64, length: f64) -> f64 {
    let place = |s: f64| if scale == DistanceScale::Log { s.ln() } else { s };
    if a == b { 1.0 } else { (-(place(a) - place(b)).abs() / length).exp() }
}

fn covariance(control: &[f64], scale: DistanceScale, length: f64, white: f64) -> DMatrix<f64> {
    DMatrix::from_fn(control.len(), control.len(), |i, j| {
        let own = if i == j { white } else { 0.0 };
        own + (1.0 - white) * process(scale, control[i], control[j], length)
    })
}

/// Log density of a multivariate Student t of covariance structure K.
fn student(k: &DMatrix<f64>, r: &[f64]) -> f64 {
    let m = r.len() as f64;
    let factor = k.clone().cholesky().expect("definite");
    let r = DVector::from_row_slice(r);
    let squares = r.dot(&factor.solve(&r));
    let ln_det = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    let sum0 = NU0 * S0 * S0;
    ln_gamma(0.5 * (NU0 + m))
        - ln_gamma(0.5 * NU0)
        - 0.5 * m * (std::f64::consts::PI * sum0).ln()
        - 0.5 * ln_det
        - 0.5 * (NU0 + m) * (squares / sum0).ln_1p()
}

fn correlated(scale: DistanceScale, nodes: [usize; 2]) -> Noise {
    Noise::Correlated { nu0: NU0, s0: S0, scale: Some(scale), nodes: Some(nodes) }
}

fn model(scale: DistanceScale, nodes: [usize; 2], observations: &Observations) -> Correlated {
    Correlated::new([NU0, NU0 * S0 * S0], Some(scale), Some(nodes), observations)
        .expect("a model")
        .expect("three different places")
}

fn ln_sum(terms: &[f64]) -> f64 {
    let top = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    top + terms.iter().map(|t| (t - top).exp()).sum::<f64>().ln()
}

#[test]
fn the_correlated_likelihood_is_that_of_dense_linear_algebra_after_every_observation() {
    for scale in [DistanceScale::Log, DistanceScale::Linear] {
        for (m, nodes) in [
            (3, [1, 1]),
            (7, [3, 2]),
            (8, [4, 4]),
            (9, [6, 4]),
            (10, [7, 4]),
            (6, [8, 5]),
            (44, [5, 3]),
        ] {
            let (observations, outputs) = data(m.max(4));
            let r = residuals(&observations, &outputs);
            let likelihood =
                Likelihood::new(&correlated(scale, nodes), &observations).expect("a model");
            let model = model(scale, nodes, &observations);
            let prior = |axis: usize| model.prior(axis);
            let exact = |rows: usize| {
                let terms: Vec<f64> = model
                    .nodes()
                    .iter()
                    .map(|n| {
                        let k =
                            covariance(&observations.control()[..rows], scale, n.length, n.white);
                        let weight = prior(0)[n.place[0]] * prior(1)[n.place[1]];
                        weight.ln() + student(&k, &r[..rows])
                    })
                    .collect();
                ln_sum(&terms)
            };
            let mut path = vec![0.0; r.len()];
            likelihood.ln_cumulative(&outputs, &mut path);
            for (k, ln) in path.iter().enumerate() {
                let exact = exact(k + 1);
                assert!((ln - exact).abs() < 1e-10 * exact.abs().max(1.0), "{m} {k}: {ln} {exact}");
            }
            let joint = likelihood.ln_joint(&outputs);
            assert!((joint - path[r.len() - 1]).abs() < 1e-11 * joint.abs().max(1.0));
            let mut sum = 0.0;
            likelihood.recursion(&outputs, |_, ln| sum += ln);
            assert!((joint - sum).abs() < 1e-10 * joint.abs().max(1.0));
        }
    }
}

#[test]
fn without_correlation_the_likelihood_is_the_independent_one() {
    // A range of 1e9 lengths: no two observations are alike.
    let control: Vec<f64> = (0..20).map(f64::from).collect();
    let (near, outputs) = data(20);
    let observations = Observations::new(control, near.values().to_vec()).expect("observations");
    let model = model(DistanceScale::Linear, [2, 2], &observations);
    let r = residuals(&observations, &outputs);
    let squares: f64 = r.iter().map(|r| r * r).sum();
    let whitened = model.whitened(&r, 1e-9, 0.3);
    let found: f64 = whitened.iter().map(|r| r * r).sum();
    assert!((found / squares - 1.0).abs() < 1e-12);
}

#[test]
fn residuals_given_all_others_are_those_of_the_inverse_covariance() {
    for scale in [DistanceScale::Log, DistanceScale::Linear] {
        let (observations, outputs) = data(12);
        let r = residuals(&observations, &outputs);
        let model = model(scale, [2, 2], &observations);
        for (length, white) in [(0.7, 0.2), (3.0, 0.01), (0.05, 0.9)] {
            let k = covariance(observations.control(), scale, length, white);
            let inverse = k.try_inverse().expect("definite");
            let qr = &inverse * DVector::from_row_slice(&r);
            for (i, (mean, variance)) in
                model.given_others(&r, length, white).into_iter().enumerate()
            {
                let exact = (r[i] - qr[i] / inverse[(i, i)], 1.0 / inverse[(i, i)]);
                assert!((mean - exact.0).abs() < 1e-9, "{i}: {mean} {}", exact.0);
                assert!((variance / exact.1 - 1.0).abs() < 1e-9, "{i}: {variance} {}", exact.1);
            }
        }
    }
}

#[test]
fn errors_of_new_observations_are_those_of_the_conditional_normal() {
    for scale in [DistanceScale::Log, DistanceScale::Linear] {
        let (observations, outputs) = data(9);
        let r = residuals(&observations, &outputs);
        let model = model(scale, [2, 2], &observations);
        let control = observations.control();
        let new = [0.0, 0.1, control[3], 5.0, control[8], 40.0, 1e6];
        for (length, white) in [(0.7, 0.2), (3.0, 0.01)] {
            let k = covariance(control, scale, length, white).cholesky().expect("definite");
            let solved = k.solve(&DVector::from_row_slice(&r));
            let found = model.smoothed(&r, length, white, &new);
            for (s, (mean, variance)) in new.iter().zip(found) {
                let with = DVector::from_fn(control.len(), |i, _| {
                    (1.0 - white) * process(scale, *s, control[i], length)
                });
                let exact = (with.dot(&solved), 1.0 - with.dot(&k.solve(&with)));
                assert!((mean - exact.0).abs() < 1e-10, "{s}: {mean} {}", exact.0);
                assert!((variance - exact.1).abs() < 1e-10, "{s}: {variance} {}", exact.1);
            }
        }
    }
}

#[test]
fn posterior_probabilities_of_the_nodes_sum_to_one_and_know_their_sums_of_squares() {
    let (observations, outputs) = data(30);
    let r = residuals(&observations, &outputs);
    let model = model(DistanceScale::Log, [5, 4], &observations);
    let found = model.posterior(observations.values(), &outputs);
    assert!((found.iter().map(|(p, _)| p).sum::<f64>() - 1.0).abs() < 1e-12);
    for (node, (_, sum)) in model.nodes().iter().zip(found) {
        let whitened = model.whitened(&r, node.length, node.white);
        let exact: f64 = whitened.iter().map(|r| r * r).sum();
        assert!((sum / exact - 1.0).abs() < 1e-9, "{sum} {exact}");
    }
}

#[test]
fn fewer_than_three_different_places_have_independent_errors() {
    for control in [vec![1.0, 1.0, 2.0], vec![0.0, 1.0, 2.0], vec![1.0]] {
        let values = vec![0.5; control.len()];
        let observations = Observations::new(control, values.clone()).expect("observations");
        let of = |noise: &Noise| {
            Likelihood::new(noise, &observations).expect("a model").ln_joint(&values)
        };
        let independent = of(&Noise::Inferred { nu0: NU0, s0: S0 });
        assert_eq!(of(&correlated(DistanceScale::Log, [4, 4])), independent);
    }
}

#[test]
fn the_scale_is_logarithmic_for_curves_that_begin_near_zero() {
    for (control, scale) in [
        (vec![0.0, 1.0, 100.0], DistanceScale::Log),
        (vec![1.0, 5.0, 10.1], DistanceScale::Log),
        (vec![1.0, 5.0, 10.0], DistanceScale::Linear),
        (vec![-1.0, 0.01, 10.0], DistanceScale::Linear),
        (vec![0.0, 0.0], DistanceScale::Linear),
    ] {
        assert_eq!(DistanceScale::of(&control), scale, "{control:?}");
    }
}

#[test]
fn distances_that_cannot_be_measured_are_refused() {
    let observations =
        Observations::new(vec![-1.0, 0.5, 1.0, 2.0], vec![0.0; 4]).expect("observations");
    let refused = |noise: &Noise| Likelihood::new(noise, &observations).err();
    assert_eq!(
        refused(&correlated(DistanceScale::Log, [4, 4])),
        Some(NoiseError::LogOfNegative { index: 0, control: -1.0 })
    );
    assert_eq!(
        refused(&correlated(DistanceScale::Linear, [0, 4])),
        Some(NoiseError::Nodes { field: "lengths", nodes: 0 })
    );
    assert_eq!(
        refused(&correlated(DistanceScale::Linear, [4, 65])),
        Some(NoiseError::Nodes { field: "shares", nodes: 65 })
    );
    for noise in [Noise::Robust { nu0: 0.0, s0: 1.0 }, Noise::Robust { nu0: 1.0, s0: -1.0 }] {
        assert!(matches!(refused(&noise), Some(NoiseError::NotPositive { .. })));
    }
}

/// ln of the integral of prior times density over sigma, by a fine rule.
fn robust_by_force(r: &[f64]) -> f64 {
    let (a, b) = (0.5 * NU0, 0.5 * NU0 * S0 * S0);
    let step = 0.01;
    let mut terms = Vec::new();
    for j in 0..1200 {
        let u = (S0 * 1e-2_f64).ln() + step * f64::from(j);
        let prior = 2f64.ln() + a * b.ln() - ln_gamma(a) - 2.0 * a * u - b * (-2.0 * u).exp();
        let ln: f64 = r.iter().map(|r| robust::ln_density(*r, u.exp())).sum();
        terms.push(step.ln() + prior + ln);
    }
    ln_sum(&terms)
}

#[test]
fn the_robust_likelihood_is_the_integral_over_sigma() {
    for m in [1, 2, 5, 31, 32, 33, 44, 100] {
        let (observations, mut outputs) = data(m);
        if m > 20 {
            outputs[10] += 0.3;
        }
        let r = residuals(&observations, &outputs);
        let noise = Noise::Robust { nu0: NU0, s0: S0 };
        let likelihood = Likelihood::new(&noise, &observations).expect("a model");
        let mut path = vec![0.0; m];
        likelihood.ln_cumulative(&outputs, &mut path);
        let joint = likelihood.ln_joint(&outputs);
        let exact = robust_by_force(&r);
        assert!((joint - exact).abs() < 1e-5, "{m}: {joint} {exact}");
        assert!((joint - path[m - 1]).abs() < 1e-9 * joint.abs().max(1.0), "{joint} {path:?}");
        for k in (0..m).step_by(9) {
            let exact = robust_by_force(&r[..=k]);
            assert!((path[k] - exact).abs() < 1e-5, "{m}, {k}: {} {exact}", path[k]);
        }
    }
}

#[test]
fn densities_outlier_probabilities_and_scores_of_single_residuals_agree() {
    let sigma = 0.2;
    let (share, width) = (robust::OUTLIER_SHARE, robust::OUTLIER_WIDTH);
    for r in [-3.0, -0.5, 0.0, 0.1, 0.7, 20.0] {
        let normal = |sigma: f64| (crate::normal::ln_density(r / sigma)).exp() / sigma;
        let (own, wide) = ((1.0 - share) * normal(sigma), share * normal(width * sigma));
        let ln = robust::ln_density(r, sigma);
        assert!((ln - (own + wide).ln()).abs() < 1e-9 * ln.abs().max(1.0), "{r}");
        assert!((robust::outlier(r, sigma) - wide / (own + wide)).abs() < 1e-12, "{r}");
    }
    assert_eq!(robust::outlier(1e200, sigma), 1.0);
    assert!((robust::score(0.0, sigma)).abs() < 1e-12);
    assert!(robust::score(-1.0, sigma) > -4.0, "a long tail makes scores smaller");
}

#[test]
fn curves_far_from_the_data_have_a_finite_or_zero_likelihood() {
    let (observations, _) = data(44);
    for noise in [Noise::correlated(), Noise::robust()] {
        let likelihood = Likelihood::new(&noise, &observations).expect("a model");
        for size in [1e3, 1e100, 1e200, 1e308] {
            let ln = likelihood.ln_joint(&[size; 44]);
            assert!(ln < -100.0 && !ln.is_nan(), "{noise:?} {size}: {ln}");
        }
        let exact = likelihood.ln_joint(observations.values());
        assert!(exact.is_finite() && exact > 0.0);
    }
}

#[test]
fn a_prior_far_below_the_residuals_leaves_numbers_for_any_number_of_nodes() {
    for (m, nodes) in [(44, [10, 15]), (88, [12, 21]), (88, [12, 20])] {
        let (observations, outputs) = data(m);
        for s0 in [1e-2, 1e-5, 1e-8] {
            let noise = Noise::Correlated { nu0: NU0, s0, scale: None, nodes: Some(nodes) };
            let likelihood = Likelihood::new(&noise, &observations).expect("a model");
            let mut path = vec![0.0; m];
            likelihood.ln_cumulative(&outputs, &mut path);
            let joint = likelihood.ln_joint(&outputs);
            assert!(path.iter().all(|ln| ln.is_finite()), "{m} {nodes:?} {s0}: {path:?}");
            assert!((path[m - 1] - joint).abs() < 1e-9 * joint.abs(), "{} {joint}", path[m - 1]);
        }
    }
}

#[test]
fn robust_errors_know_sigma_though_the_prior_is_far_below_it() {
    let (observations, outputs) = data(44);
    let sigma = |s0: f64| {
        let model = robust::Robust::new(NU0, s0, &observations).expect("a model");
        let posterior = model.posterior(observations.values(), &outputs);
        posterior.iter().map(|(sigma, p)| sigma * p).sum::<f64>()
    };
    let (near, far) = (sigma(1e-4), sigma(1e-9));
    assert!((near / far - 1.0).abs() < 1e-3, "{near} {far}");
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn more_than_512_observations_can_have_correlated_and_robust_errors() {
    use crate::{FnSimulator, Parameter, Prior, PriorSpec, Problem, Settings, calibrate};
    let control: Vec<f64> = (1..=520).map(|k| f64::from(k) * 1e-3).collect();
    let values = control.iter().map(|t| 0.5 + 0.01 * (300.0 * t).sin()).collect();
    let observations = Observations::new(control, values).expect("observations");
    let level = FnSimulator::new(1, 520, |theta: &[f64], out: &mut [f64]| {
        out.fill(theta[0]);
        Ok(())
    });
    let prior = Prior::new(PriorSpec::Normal { mean: 0.5, sd: 0.05 }).expect("a prior");
    let correlated = Noise::Correlated { nu0: NU0, s0: S0, scale: None, nodes: Some([2, 2]) };
    for noise in [correlated, Noise::Robust { nu0: NU0, s0: S0 }] {
        let problem = Problem {
            simulator: &level,
            parameters: vec![Parameter::new("level", "1", prior.clone())],
            observations: observations.clone(),
            noise,
        };
        let settings = Settings { draws: 16, map_simulations: 0, ..Settings::for_budget(64) };
        let posterior = calibrate(&problem, &settings, &mut ()).expect("a posterior");
        assert!((posterior.parameters[0].in_si.mean - 0.5).abs() < 0.01);
        assert_eq!(posterior.path.len(), 520);
    }
}

#[test]
fn pointwise_densities_are_those_of_the_drawn_noise_and_need_a_draw_of_their_model() {
    let values = vec![0.3, 0.1, 0.6, 0.2];
    let observations = Observations::new(vec![1.0, 2.0, 3.0, 4.0], values.clone()).expect("data");
    let outputs = [0.2, 0.2, 0.5, 0.4];
    let of = |noise: Noise| Likelihood::new(&noise, &observations).expect("a model");
    let sigma = 0.13;
    let draw = |shape| NoiseDraw { sigma, shape };
    // Known noise: their sum is the joint density, with a draw or without.
    let fixed = of(Noise::Fixed { sigma: FixedSigma::Absolute(sigma) });
    let known = fixed.ln_pointwise(None, &outputs).expect("known");
    assert!((known.iter().sum::<f64>() - fixed.ln_joint(&outputs)).abs() < 1e-12);
    let inferred = of(Noise::default());
    let drawn = inferred.ln_pointwise(Some(&draw(None)), &outputs).expect("drawn");
    // Errors that are all white are independent.
    let white = NoiseShape::Correlated { length: 0.1, white_share: 1.0 };
    let correlated = of(Noise::correlated());
    let alone = correlated.ln_pointwise(Some(&draw(Some(white))), &outputs).expect("drawn");
    for ((known, drawn), alone) in known.iter().zip(&drawn).zip(&alone) {
        assert!(
            (known - drawn).abs() < 1e-12 && (known - alone).abs() < 1e-9,
            "{known} {drawn} {alone}"
        );
    }
    // Two observations of correlation rho: y_1 given y_2 is normal of mean rho r_2 and variance 1 - rho^2.
    let two = Observations::new(vec![0.0, 1.0, 1e9], vec![0.3, 0.1, 0.0]).expect("data");
    let noise =
        Noise::Correlated { nu0: 4.0, s0: 0.05, scale: Some(DistanceScale::Linear), nodes: None };
    let model = Likelihood::new(&noise, &two).expect("a model");
    let shape = Some(NoiseShape::Correlated { length: 2.0, white_share: 0.25 });
    let found = model.ln_pointwise(Some(&draw(shape)), &[0.0; 3]).expect("drawn");
    let rho = 0.75 * (-0.5f64).exp();
    let sd = sigma * (1.0 - rho * rho).sqrt();
    let wanted = crate::normal::ln_density((0.3 - rho * 0.1) / sd) - sd.ln();
    assert!((found[0] - wanted).abs() < 1e-9, "{} for {wanted}", found[0]);
    assert_eq!(inferred.ln_pointwise(None, &outputs), None);
    assert_eq!(correlated.ln_pointwise(Some(&draw(None)), &outputs), None);
    assert_eq!(of(Noise::EssTarget { share: 0.2 }).ln_pointwise(Some(&draw(None)), &outputs), None);
}
