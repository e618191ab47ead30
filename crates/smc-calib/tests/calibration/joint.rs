//! Several groups of observations that share parameters, against exact answers.

use crate::support::{line_data, line_problem, prior};
use smc_calib::quadrature::{QuadratureSettings, quadrature_joint};
use smc_calib::{
    CalibrateError, Concern, FixedSigma, FnSimulator, Group, JointProblem, Noise, NoiseError,
    Observations, Parameter, Posterior, PriorSpec, Settings, SimError, Simulator, calibrate,
    calibrate_joint, leave_one_out_of, predictive_band_of_group,
};

const LN_2PI: f64 = 1.837_877_066_409_345_5;

fn normal_parameter(name: &str, sd: f64) -> Parameter {
    Parameter::new(name, "1", prior(PriorSpec::Normal { mean: 0.0, sd }))
}

fn settings(samples: usize) -> Settings {
    Settings { samples, seed: 3, ..Settings::default() }
}

fn run(problem: &JointProblem<'_>, samples: usize) -> Posterior {
    calibrate_joint(problem, &settings(samples), &mut ()).unwrap()
}

/// Rows of a design matrix, times (a, b): five of one group, four of another with values a thousand times larger.
const DESIGN: [[f64; 2]; 9] = [
    [1.0, 0.0],
    [1.0, 0.5],
    [1.0, 1.0],
    [1.0, 1.5],
    [1.0, 2.0],
    [2000.0, -1000.0],
    [1000.0, 300.0],
    [-500.0, 1500.0],
    [700.0, 700.0],
];
const MEASURED: [f64; 9] = [0.42, 0.85, 1.68, 2.1, 2.49, -610.0, 700.0, 1590.0, 1120.0];
const SIGMA: f64 = 0.15;
const SHARE: f64 = 0.08;

fn linear() -> impl Simulator {
    FnSimulator::new(2, 9, |theta: &[f64], out: &mut [f64]| {
        for (o, row) in out.iter_mut().zip(DESIGN) {
            *o = row[0] * theta[0] + row[1] * theta[1];
        }
        Ok::<(), SimError>(())
    })
}

fn linear_problem(simulator: &dyn Simulator) -> JointProblem<'_> {
    JointProblem {
        simulator,
        parameters: vec![normal_parameter("a", 1.0), normal_parameter("b", 2.0)],
        groups: vec![
            Group::new(
                "near",
                Observations::new(vec![0.0, 0.5, 1.0, 1.5, 2.0], MEASURED[..5].to_vec()).unwrap(),
                Noise::Fixed { sigma: FixedSigma::Absolute(SIGMA) },
            ),
            // A control axis of its own, which starts before the other one ends.
            Group::new(
                "far",
                Observations::new(vec![0.1, 0.2, 30.0, 40.0], MEASURED[5..].to_vec()).unwrap(),
                Noise::Fixed { sigma: FixedSigma::Relative(SHARE) },
            ),
        ],
    }
}

/// Mean, covariance and log evidence of the first `m` rows.
fn conjugate(m: usize) -> ([f64; 2], [f64; 3], f64) {
    conjugate_of(&(0..m).collect::<Vec<_>>())
}

/// The same of some rows.
fn conjugate_of(rows: &[usize]) -> ([f64; 2], [f64; 3], f64) {
    let sigma = |i: usize| if i < 5 { SIGMA } else { SHARE * MEASURED[i].abs() };
    let (mut p, mut q) = ([1.0, 0.0, 0.25], [0.0; 2]);
    for &i in rows {
        let w = sigma(i).powi(-2);
        let x = DESIGN[i];
        p[0] += w * x[0] * x[0];
        p[1] += w * x[0] * x[1];
        p[2] += w * x[1] * x[1];
        q[0] += w * x[0] * MEASURED[i];
        q[1] += w * x[1] * MEASURED[i];
    }
    let det = p[0] * p[2] - p[1] * p[1];
    let cov = [p[2] / det, -p[1] / det, p[0] / det];
    let mean = [cov[0] * q[0] + cov[1] * q[1], cov[1] * q[0] + cov[2] * q[1]];
    // Z = prior x likelihood / posterior at any point, here the mean.
    let ln_prior = -0.5 * (mean[0].powi(2) + 0.25 * mean[1].powi(2)) - LN_2PI - 2f64.ln();
    let ln_likelihood: f64 = rows
        .iter()
        .map(|&i| {
            let r = MEASURED[i] - DESIGN[i][0] * mean[0] - DESIGN[i][1] * mean[1];
            -0.5 * (r / sigma(i)).powi(2) - sigma(i).ln() - 0.5 * LN_2PI
        })
        .sum();
    (mean, cov, ln_prior + ln_likelihood - 0.5 * det.ln() + LN_2PI)
}

#[test]
fn two_groups_with_known_noise_give_the_conjugate_posterior_and_evidence() {
    let simulator = linear();
    let problem = linear_problem(&simulator);
    let p = run(&problem, 8192);
    let (mean, cov, ln_z) = conjugate(9);
    let sd = [cov[0].sqrt(), cov[2].sqrt()];
    for j in 0..2 {
        let x = p.parameters[j].in_coordinate;
        assert!((x.mean - mean[j]).abs() < 0.02 * sd[j], "{j}: {x:?} {}", mean[j]);
        assert!((x.sd / sd[j] - 1.0).abs() < 0.02, "{j}: {x:?} {}", sd[j]);
    }
    assert!((p.correlation[0][1] - cov[1] / (sd[0] * sd[1])).abs() < 0.02, "{:?}", p.correlation);
    assert!((p.log_evidence.value - ln_z).abs() < 0.01, "{:?} {ln_z}", p.log_evidence);
    // The MAP of a normal posterior is its mean; the likelihood is the sum of the groups'.
    assert!((p.map.theta[0] - mean[0]).abs() < 1e-3 * sd[0], "{:?}", p.map);
    let parts: f64 = p.groups.iter().map(|g| g.log_likelihood).sum();
    assert!((parts - p.map.log_likelihood).abs() < 1e-9 * parts.abs());
    // The path runs through the first group, then through the second.
    assert_eq!(p.path.len(), 9);
    assert_eq!(p.path[5].control, 0.1);
    // Early posteriors are wide: where few samples lie in them, the path's effective size says so.
    let seen = p.path.iter().enumerate().filter(|(_, point)| point.ess > 1000.0);
    assert!(seen.clone().count() >= 4 && seen.clone().any(|(k, _)| k < 8));
    for (k, point) in seen {
        let (mean, cov, ln_z) = conjugate(k + 1);
        let x = &point.parameters[0];
        let sd = cov[0].sqrt();
        assert!((x.mean - mean[0]).abs() < 0.1 * sd && (x.sd / sd - 1.0).abs() < 0.1, "{k}: {x:?}");
        assert!((point.log_evidence - ln_z).abs() < 0.1, "{k}: {} {ln_z}", point.log_evidence);
    }
    assert!((p.path[8].log_evidence - p.log_evidence.value).abs() < 1e-9);
}

#[test]
fn each_group_has_its_own_noise_in_bands_residuals_and_warnings() {
    let simulator = linear();
    let mut problem = linear_problem(&simulator);
    let p = run(&problem, 4096);
    assert!(p.sigma.is_none() && p.draws.iter().all(|d| d.sigma.is_none()));
    assert_eq!((p.groups[0].places(), p.groups[1].places()), (0..5, 5..9));
    let near = p.groups[0].sigma.unwrap();
    assert!(near.fixed && near.mean == SIGMA && p.groups[0].sigma_draws.len() == p.draws.len());
    assert!(p.groups[1].sigma.is_none() && p.groups[1].sigma_draws.is_empty());
    for (i, point) in p.predictive.iter().enumerate() {
        let cov = conjugate(9).1;
        let x = DESIGN[i];
        let curve = cov[0] * x[0] * x[0] + 2.0 * cov[1] * x[0] * x[1] + cov[2] * x[1] * x[1];
        let sigma = if i < 5 { SIGMA } else { SHARE * MEASURED[i].abs() };
        for (band, variance) in [(point.curve90, curve), (point.noisy90, curve + sigma * sigma)] {
            let width = (band[1] - band[0]) / (2.0 * 1.644_854 * variance.sqrt());
            assert!((width - 1.0).abs() < 0.08, "{i}: {width}");
        }
        assert_eq!((point.index, p.path[i].index), (i, i));
    }
    let (first, all) = (&p.groups[0].residuals.values, &p.residuals.values);
    assert_eq!(first[..], all[..5]);
    assert_eq!(all.len(), 9);
    // Curves on another grid carry the noise of the group that they belong to.
    let curve = FnSimulator::new(2, 1, |theta: &[f64], out: &mut [f64]| {
        out[0] = theta[0] + 0.5 * theta[1];
        Ok(())
    });
    let band = predictive_band_of_group(&p, "near", &curve, &[0.5], 4096).unwrap();
    let ratio = (band[0].noisy90[1] - band[0].noisy90[0])
        / (p.predictive[1].noisy90[1] - p.predictive[1].noisy90[0]);
    assert!((ratio - 1.0).abs() < 0.08, "{ratio}");
    let error = predictive_band_of_group(&p, "elsewhere", &curve, &[0.5], 10).unwrap_err();
    assert!(error.cause().contains("near, far"), "{error}");
    // A group that the model cannot meet is named.
    problem.groups[0].noise = Noise::Fixed { sigma: FixedSigma::Absolute(0.001) };
    let p = run(&problem, 4096);
    let concerns = p.trust().concerns;
    let poor: Vec<&Option<String>> = concerns
        .iter()
        .filter_map(|w| if let Concern::PoorFit { group, .. } = w { Some(group) } else { None })
        .collect();
    assert!(poor.contains(&&Some("near".to_owned())), "{:?}", p.trust().concerns);
    assert!(p.trust().concerns.iter().any(|w| w.to_string().contains("data of near by")));
    let text = serde_json::to_string(&p).unwrap();
    assert_eq!(serde_json::from_str::<Posterior>(&text).unwrap(), p);
}

/// Integrals over ln sigma of one group's likelihood at its expected value `at`, alone and times sigma and sigma^2.
fn integrals_over_sigma(values: &[f64], (nu0, s0): (f64, f64), at: f64) -> [f64; 3] {
    let (a, b) = (0.5 * nu0, 0.5 * nu0 * s0 * s0);
    let h = 0.01;
    let mut sums = [0.0; 3];
    for k in -600..600 {
        let sigma = s0 * (h * f64::from(k)).exp();
        let v = sigma * sigma;
        let squares: f64 = values.iter().map(|y| (y - at).powi(2)).sum();
        // Inverse gamma in v, times dv/dln sigma = 2 v.
        let ln = a * b.ln() - statrs::function::gamma::ln_gamma(a) - (a + 1.0) * v.ln() - b / v
            + (2.0 * v).ln()
            - 0.5 * squares / v
            - values.len() as f64 * (sigma.ln() + 0.5 * LN_2PI);
        for (power, sum) in sums.iter_mut().enumerate() {
            *sum += h * ln.exp() * sigma.powi(power as i32);
        }
    }
    sums
}

#[test]
fn two_groups_with_unknown_noise_give_the_posterior_that_integrating_both_sigmas_gives() {
    // One shared mean, measured directly and as its square times a hundred, with unlike noise and noise priors.
    let direct = [0.93, 1.08, 0.99, 1.22, 0.85, 1.11];
    let squared = [98.0, 127.0, 110.0, 121.0];
    let priors = [(4.0, 0.1), (3.0, 20.0)];
    let simulator = FnSimulator::new(1, 10, |theta: &[f64], out: &mut [f64]| {
        out[..6].fill(theta[0]);
        out[6..].fill(100.0 * theta[0] * theta[0]);
        Ok::<(), SimError>(())
    });
    let group = |name: &str, values: &[f64], (nu0, s0)| {
        let control = (0..values.len()).map(|i| i as f64).collect();
        let observations = Observations::new(control, values.to_vec()).unwrap();
        Group::new(name, observations, Noise::Inferred { nu0, s0 })
    };
    let problem = JointProblem {
        simulator: &simulator,
        parameters: vec![normal_parameter("mu", 1.0)],
        groups: vec![group("direct", &direct, priors[0]), group("squared", &squared, priors[1])],
    };
    // Z, mu, mu^2, and each group's sigma and sigma^2.
    let mut sums = [0.0; 7];
    let step = 0.002;
    for k in 0..2000 {
        let mu = -2.0 + step * (f64::from(k) + 0.5);
        let g = [
            integrals_over_sigma(&direct, priors[0], mu),
            integrals_over_sigma(&squared, priors[1], 100.0 * mu * mu),
        ];
        let density = step * (-0.5 * mu * mu - 0.5 * LN_2PI).exp();
        let z = density * g[0][0] * g[1][0];
        let rows = [
            z,
            z * mu,
            z * mu * mu,
            density * g[0][1] * g[1][0],
            density * g[0][2] * g[1][0],
            density * g[0][0] * g[1][1],
            density * g[0][0] * g[1][2],
        ];
        for (sum, row) in sums.iter_mut().zip(rows) {
            *sum += row;
        }
    }
    let [z, m1, m2, a1, a2, b1, b2] = sums;
    let moments = |first: f64, second: f64| (first / z, (second / z - (first / z).powi(2)).sqrt());
    let p = run(&problem, 8192);
    let x = p.parameters[0].in_coordinate;
    let (mean, sd) = moments(m1, m2);
    assert!(
        (x.mean - mean).abs() < 0.01 * sd && (x.sd / sd - 1.0).abs() < 0.01,
        "{x:?} {mean} {sd}"
    );
    assert!((p.log_evidence.value - z.ln()).abs() < 0.005, "{:?} {}", p.log_evidence, z.ln());
    for (group, (first, second)) in p.groups.iter().zip([(a1, a2), (b1, b2)]) {
        let (mean, sd) = moments(first, second);
        let s = group.sigma.unwrap();
        assert!((s.mean / mean - 1.0).abs() < 0.005, "{}: {s:?} {mean}", group.name);
        assert!((s.sd / sd - 1.0).abs() < 0.02, "{}: {s:?} {sd}", group.name);
        let n = group.sigma_draws.len() as f64;
        let drawn = group.sigma_draws.iter().sum::<f64>() / n;
        assert!((drawn - mean).abs() < 5.0 * sd / n.sqrt(), "{}: {drawn} {mean}", group.name);
    }
    // The library's own quadrature is that of the same problem.
    let q = quadrature_joint(&problem, &QuadratureSettings::default()).unwrap();
    assert!((q.log_evidence - z.ln()).abs() < 1e-4 && (q.mean[0] - mean).abs() < 1e-4, "{q:?}");
}

#[test]
fn leaving_out_an_observation_of_either_group_gives_its_conjugate_predictive_density() {
    let simulator = linear();
    let problem = linear_problem(&simulator);
    let p = run(&problem, 8192);
    // Curves from a table, as a driver has them that stored its runs.
    let table: Vec<Vec<f64>> = p
        .samples
        .iter()
        .map(|s| DESIGN.iter().map(|x| x[0] * s.theta[0] + x[1] * s.theta[1]).collect())
        .collect();
    let stored = |sample: usize, out: &mut [f64]| {
        out.copy_from_slice(&table[sample]);
        Ok(())
    };
    let loo = leave_one_out_of(&problem, &p, stored).unwrap().unwrap();
    let all = conjugate(9).2;
    let mut compared = 0;
    for point in loo.points.iter().filter(|point| point.khat < 0.7) {
        // ln p(y_i | all others) = ln Z(all) - ln Z(all but i).
        let others: Vec<usize> = (0..9).filter(|i| *i != point.index).collect();
        let exact = all - conjugate_of(&others).2;
        assert!((point.ln_density - exact).abs() < 0.02, "{point:?} {exact}");
        compared += 1;
    }
    // One measurement of the second group decides much: only the tails of the proposals reach what leaving it out takes.
    assert!(compared == 9 && loo.points.len() == 9, "{loo:?}");
    assert!((1.0..3.0).contains(&loo.effective_parameters), "{loo:?}");
    assert_eq!(loo.points[5].control, 0.1);
}

#[test]
fn one_group_is_a_plain_problem_to_the_bit() {
    let simulator = crate::support::line();
    for noise in [Noise::default(), Noise::EssTarget { share: 0.2 }] {
        let plain = line_problem(&simulator, noise.clone());
        let joint = JointProblem {
            simulator: &simulator,
            parameters: plain.parameters.clone(),
            groups: vec![Group::new("only", line_data(), noise)],
        };
        let a = calibrate(&plain, &settings(1000), &mut ()).unwrap();
        let b = calibrate_joint(&joint, &settings(1000), &mut ()).unwrap();
        assert!(a.groups.is_empty() && a == b);
        let text = serde_json::to_string(&b).unwrap();
        assert!(!text.contains("\"groups\"") && !text.contains("\"group\""));
    }
}

#[test]
fn long_groups_are_thinned_and_keep_their_own_sigma() {
    let (m, n) = (700, 400);
    let wave = |i: usize, size: f64| size * (7.0 * i as f64).sin();
    let simulator = FnSimulator::new(1, m + n, move |theta: &[f64], out: &mut [f64]| {
        out[..m].fill(theta[0]);
        out[m..].fill(10.0 * theta[0]);
        Ok::<(), SimError>(())
    });
    let group = |name: &str, count: usize, level: f64, size: f64, s0: f64| {
        let control = (0..count).map(|i| i as f64).collect();
        let values = (0..count).map(|i| level + wave(i, size)).collect();
        Group::new(
            name,
            Observations::new(control, values).unwrap(),
            Noise::Inferred { nu0: 4.0, s0 },
        )
    };
    let problem = JointProblem {
        simulator: &simulator,
        parameters: vec![normal_parameter("mu", 1.0)],
        groups: vec![group("fine", m, 0.4, 0.2, 0.1), group("coarse", n, 4.0, 3.0, 1.0)],
    };
    let p = run(&problem, 4096);
    assert!(p.trust().concerns.iter().any(|w| matches!(w, Concern::PathThinned { .. })));
    let q = quadrature_joint(&problem, &QuadratureSettings::default()).unwrap();
    assert!((p.log_evidence.value - q.log_evidence).abs() < 0.02, "{:?} {q:?}", p.log_evidence);
    assert!(p.path.iter().any(|x| x.index == m - 1) && p.path.iter().any(|x| x.index == m + n - 1));
    for (group, size) in p.groups.iter().zip([0.2, 3.0]) {
        let s = group.sigma.unwrap();
        let rms = size / 2f64.sqrt();
        assert!((s.mean / rms - 1.0).abs() < 0.01, "{}: {s:?} {rms}", group.name);
        let sd = rms / (2.0 * group.observations as f64).sqrt();
        assert!((s.sd / sd - 1.0).abs() < 0.05, "{}: {s:?} {sd}", group.name);
    }
    let parts: f64 = p.groups.iter().map(|g| g.log_likelihood).sum();
    assert!((parts - p.map.log_likelihood).abs() < 1e-6);
}

#[test]
fn noise_that_does_not_fit_names_its_group() {
    let simulator = linear();
    let refused = |at: usize, noise: Noise| {
        let mut problem = linear_problem(&simulator);
        problem.groups[at].noise = noise;
        match calibrate_joint(&problem, &settings(100), &mut ()) {
            Err(CalibrateError::Noise(error)) => error,
            other => panic!("{other:?}"),
        }
    };
    let tuned = refused(1, Noise::EssTarget { share: 0.2 });
    assert!(matches!(&tuned, NoiseError::TunedGroup { group } if group == "far"), "{tuned}");
    let negative = refused(0, Noise::Inferred { nu0: -1.0, s0: 0.1 });
    assert_eq!(negative.to_string(), "group near: noise nu0 is -1; it must be positive and finite");
    let mut none = linear_problem(&simulator);
    none.groups.clear();
    let error = calibrate_joint(&none, &settings(100), &mut ());
    assert!(matches!(error, Err(CalibrateError::Observables { observations: 0, .. })));
}
