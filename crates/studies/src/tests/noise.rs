//! Posteriors under correlated and robust noise against numbers from another program.
//!
//! The numbers are of a quadrature in NumPy, with filters of its own: over C1, tau_s and delta_c by cells that are halved
//! where there is mass, over correlation length and white share by 40 x 32 Gauss-Legendre nodes; log evidence to 1e-3,
//! standard deviations to 5e-4 of themselves (1e-3 for PA12). Twenty seeds each, in minutes:
//!
//! ```text
//! cargo test --release -p studies tests::noise -- --ignored --nocapture
//! ```

use smc_calib::{
    Noise, Observations, Posterior, Problem, Settings, ShapeSummary, Simulator as _, calibrate,
};
use workbench::input::material::Material;
use workbench::pair::model::NeckGrowth;
use workbench::plan::{PairOptions, Plan, sampler_for};

/// Posterior of a material: log evidence, then log10 means and standard deviations of C1, tau_s and delta_c.
struct Exact {
    material: Material,
    log_evidence: f64,
    mean: [f64; 3],
    sd: [f64; 3],
}

const CORRELATED: [Exact; 3] = [
    Exact {
        material: Material::Ps,
        log_evidence: 122.4146,
        mean: [-3.53546, -1.28541, -6.68355],
        sd: [0.16111, 0.03863, 0.21217],
    },
    Exact {
        material: Material::Pa12,
        log_evidence: 76.2267,
        mean: [-3.4420, 0.5741, -7.1320],
        sd: [0.8193, 0.0346, 0.4954],
    },
    Exact {
        material: Material::Peek,
        log_evidence: 46.1665,
        mean: [-6.0758, 1.3606, -6.2867],
        sd: [0.1233, 0.0334, 0.1230],
    },
];

fn plan(material: Material, noise: &Noise) -> Plan {
    let options =
        PairOptions { material: Some(material), noise: noise.clone(), ..PairOptions::default() };
    options.plan().unwrap().plan
}

fn posterior(plan: &Plan, observations: Observations, samples: usize, seed: u64) -> Posterior {
    let (_, measured) = plan.pair().unwrap();
    let problem = Problem {
        simulator: &NeckGrowth::of(plan).unwrap(),
        parameters: plan.parameters.clone(),
        observations,
        noise: measured.noise.clone(),
    };
    let settings = Settings { seed, map_simulations: 0, ..sampler_for(samples) };
    calibrate(&problem, &settings, &mut ()).unwrap()
}

fn measured(plan: &Plan) -> Observations {
    plan.pair().unwrap().1.observations().unwrap()
}

/// Errors of log evidence, means (in standard deviations) and standard deviations (relative).
fn errors(exact: &Exact, found: &Posterior) -> [f64; 7] {
    let mut errors = [0.0; 7];
    errors[0] = found.log_evidence.value - exact.log_evidence;
    for (j, parameter) in found.parameters.iter().enumerate() {
        errors[1 + j] = (parameter.in_coordinate.mean - exact.mean[j]) / exact.sd[j];
        errors[4 + j] = parameter.in_coordinate.sd / exact.sd[j] - 1.0;
    }
    errors
}

/// What 16 384 simulations reach, root mean square over seeds: log evidence, means, standard deviations.
const REACH: [f64; 7] = [0.02, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01];

#[test]
fn correlated_posteriors_of_the_three_materials_are_those_of_another_programs_quadrature() {
    for exact in &CORRELATED {
        let plan = plan(exact.material, &Noise::correlated());
        let found = posterior(&plan, measured(&plan), 16_384, 1);
        let errors = errors(exact, &found);
        for (error, reach) in errors.iter().zip(REACH) {
            assert!(error.abs() < 3.0 * reach, "{:?}: {errors:?}", exact.material);
        }
    }
}

/// Relative error of the sd from as many draws of the exact posterior as there are samples: `sqrt((kurtosis - 1)/(4 n))`.
fn error_of_exact_draws(found: &Posterior, j: usize) -> f64 {
    let parameter = &found.parameters[j];
    let prior = &parameter.parameter.prior;
    let (mean, sd) = (parameter.in_coordinate.mean, parameter.in_coordinate.sd);
    let fourth = |s: &smc_calib::Sample| ((prior.to_coordinate(s.theta[j]) - mean) / sd).powi(4);
    let kurtosis: f64 = found.samples.iter().map(|s| s.weight * fourth(s)).sum();
    ((kurtosis - 1.0) / (4.0 * found.samples.len() as f64)).sqrt()
}

/// Three thousandths of PEEK's posterior lie far out, at a C1 five hundred times as large, and make up half of the variance of
/// ln C1 (kurtosis 200): there the sd is held against half the error of as many exact draws, 5.6 %, instead of 1 %.
#[test]
#[ignore = "minutes"]
fn over_twenty_seeds_correlated_posteriors_are_as_close_as_promised() {
    let mut missed = Vec::new();
    for nodes in [None, Some([20, 16])] {
        for exact in &CORRELATED {
            let noise = Noise::Correlated { nu0: 4.0, s0: 0.05, scale: None, nodes };
            let plan = plan(exact.material, &noise);
            let seeds = if nodes.is_none() { 20 } else { 5 };
            let mut reach = REACH;
            let all: Vec<[f64; 7]> = (1..=seeds)
                .map(|seed| {
                    let found = posterior(&plan, measured(&plan), 16_384, seed);
                    for j in 0..3 {
                        let share = 0.5 / f64::from(seeds as u32);
                        reach[4 + j] += share * error_of_exact_draws(&found, j);
                    }
                    errors(exact, &found)
                })
                .collect();
            for j in 4..7 {
                reach[j] = (reach[j] - REACH[j]).max(REACH[j]);
            }
            let rms =
                |j: usize| (all.iter().map(|e| e[j] * e[j]).sum::<f64>() / all.len() as f64).sqrt();
            let rms: Vec<f64> = (0..7).map(rms).collect();
            let mean = |j: usize| all.iter().map(|e| e[j]).sum::<f64>() / all.len() as f64;
            eprintln!(
                "{:?} {nodes:?}, {seeds} seeds: rms {rms:.4?}, reach {reach:.4?}",
                exact.material
            );
            eprintln!("  mean {:.4?}", (0..7).map(mean).collect::<Vec<f64>>());
            if rms.iter().zip(reach).any(|(error, reach)| *error > reach) {
                missed.push(format!("{:?} {nodes:?}: {rms:.4?}", exact.material));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
}

/// PS with some rows (from 0) moved.
fn moved(plan: &Plan, rows: [usize; 3], by: f64) -> Observations {
    let data = measured(plan);
    let mut values = data.values().to_vec();
    rows.iter().for_each(|row| values[*row] += by);
    Observations::new(data.control().to_vec(), values).unwrap()
}

#[test]
fn three_outliers_move_no_parameter_of_robust_noise_by_half_a_standard_deviation_and_are_named() {
    let plan = plan(Material::Ps, &Noise::robust());
    let clean = posterior(&plan, measured(&plan), 8192, 1);
    for rows in [[10, 20, 30], [2, 15, 30]] {
        let found = posterior(&plan, moved(&plan, rows, 0.3), 8192, 1);
        for (before, after) in clean.parameters.iter().zip(&found.parameters) {
            let (before, after) = (before.in_coordinate, after.in_coordinate);
            let shift = (after.mean - before.mean) / before.sd;
            eprintln!("{rows:?}: shift {shift:.3}, sd {:.4} -> {:.4}", before.sd, after.sd);
            assert!(shift.abs() < 0.5, "{rows:?}: {shift}");
        }
        let Some(ShapeSummary::Robust { outliers, .. }) = &found.noise_shape else {
            panic!("robust noise names its outliers");
        };
        let named: Vec<usize> = (0..outliers.len()).filter(|i| outliers[*i] > 0.5).collect();
        assert_eq!(named, rows, "{outliers:?}");
    }
}

#[test]
fn the_same_outliers_more_than_triple_the_sd_of_c1_under_independent_normal_errors() {
    let plan = plan(Material::Ps, &Noise::default());
    let clean = posterior(&plan, measured(&plan), 8192, 1);
    let found = posterior(&plan, moved(&plan, [2, 15, 30], 0.3), 8192, 1);
    let (before, after) = (clean.parameters[0].in_coordinate, found.parameters[0].in_coordinate);
    assert!(after.sd > 3.0 * before.sd, "{} {}", before.sd, after.sd);
}

#[test]
fn new_errors_of_correlated_noise_are_known_near_the_observations_only() {
    let plan = plan(Material::Ps, &Noise::correlated());
    let data = measured(&plan);
    let found = posterior(&plan, data.clone(), 4096, 1);
    let likelihood = smc_calib::Likelihood::new(&found.noise, &data).unwrap();
    let draw = &found.draws[found.draws.len() / 2];
    let mut curve = vec![0.0; data.len()];
    NeckGrowth::of(&plan).unwrap().simulate(found.theta(draw), &mut curve).unwrap();
    let noise = draw.noise().unwrap();
    let (near, far) = (data.control()[20] * 1.001, data.control()[data.len() - 1] * 1e6);
    let errors = likelihood.errors_at(&noise, &curve, &[near, far]);
    let residual = data.values()[20] - curve[20];
    assert!((errors[0][0] - residual).abs() < 3.0 * errors[0][1].max(0.1 * noise.sigma));
    assert!(errors[0][1] < 0.5 * noise.sigma && errors[1][1] > 0.99 * noise.sigma, "{errors:?}");
}
