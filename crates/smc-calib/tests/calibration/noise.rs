//! The recursion over observations against the joint likelihood.

use proptest::prelude::*;
use smc_calib::{FixedSigma, Likelihood, Noise, Observations};

fn likelihood(noise: &Noise, values: &[f64]) -> Likelihood {
    let control = (0..values.len()).map(|i| i as f64).collect();
    Likelihood::new(noise, &Observations::new(control, values.to_vec()).unwrap()).unwrap()
}

proptest! {
    #[test]
    fn the_product_of_predictive_factors_is_the_joint_likelihood(
        pairs in prop::collection::vec((-3.0f64..3.0, -3.0f64..3.0), 1..120),
        nu0 in 0.5f64..30.0,
        s0 in 1e-3f64..1.0,
    ) {
        let (values, outputs): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        for noise in [Noise::Inferred { nu0, s0 }, Noise::Fixed { sigma: FixedSigma::Absolute(s0) }] {
            let l = likelihood(&noise, &values);
            let joint = l.ln_joint(&outputs);
            let mut product = 0.0;
            let mut cumulative = vec![0.0; values.len()];
            l.ln_cumulative(&outputs, &mut cumulative);
            let size = joint.abs().max(values.len() as f64);
            l.recursion(&outputs, |k, ln| {
                product += ln;
                assert!((cumulative[k] - product).abs() < 1e-11 * size.max(product.abs()), "{k}");
            });
            prop_assert!((product - joint).abs() < 1e-11 * size, "{product} {joint}");
        }
    }
}

#[test]
fn one_observation_is_a_student_t() {
    // nu0 = 4, s0 = 0.05, residual 0.1: t = 2, density 3/8 (1 + t^2/4)^(-5/2) / s0.
    let l = likelihood(&Noise::default(), &[1.0]);
    let expected = (0.375 * 2f64.powf(-2.5) / 0.05).ln();
    assert!((l.ln_joint(&[0.9]) - expected).abs() < 1e-13);
}

#[test]
fn integrating_sigma_numerically_gives_the_inferred_likelihood() {
    let (y, o) = ([0.2, 0.5, 0.9], [0.25, 0.42, 0.93]);
    let l = likelihood(&Noise::default(), &y);
    let s: f64 = y.iter().zip(&o).map(|(y, o): (&f64, &f64)| (y - o) * (y - o)).sum();
    // v = sigma^2 ~ IG(2, 2 * 0.05^2); density b^2 v^-3 exp(-b/v); integrate over ln v.
    let b: f64 = 2.0 * 0.05 * 0.05;
    let h = 1e-3;
    let sum: f64 = (-20_000..10_000)
        .map(|i| {
            let v = (f64::from(i) * h).exp();
            let prior = b * b * v.powi(-3) * (-b / v).exp();
            prior * (2.0 * std::f64::consts::PI * v).powf(-1.5) * (-0.5 * s / v).exp() * v * h
        })
        .sum();
    assert!((l.ln_joint(&o) - sum.ln()).abs() < 1e-9);
}
