//! An earlier posterior as the first proposal: the answer stays that of the new model and its own prior.

use crate::conjugate::exact;
use crate::support::{line, line_problem, prior};
use smc_calib::{
    CalibrateError, FirstProposal, FixedSigma, Noise, Parameter, Posterior, PriorSpec, Settings,
    calibrate, normal,
};

const SIGMA: f64 = 0.05;

/// Equally weighted draws of independent normals, evenly spread by the golden ratio and the root of two.
fn draws(centre: [f64; 2], sd: [f64; 2]) -> [Vec<f64>; 2] {
    let at = |j: usize, step: f64| {
        let u = move |i: i32| ((f64::from(i) + 0.5) * step).fract();
        (0..2000).map(|i| centre[j] + sd[j] * normal::quantile(u(i))).collect()
    };
    [at(0, 0.618_033_988_749_895), at(1, 0.414_213_562_373_095)]
}

/// The problem of a line, its first proposal so many posterior standard deviations off, and that many times as wide.
fn fitted(settings: &Settings, off: f64, width: f64) -> FirstProposal {
    let exact = exact(SIGMA);
    let simulator = line();
    let problem = line_problem(&simulator, known());
    let sd = [0, 1].map(|j| exact.covariance[(j, j)].sqrt());
    let centre = [0, 1].map(|j| exact.mean[j] + off * sd[j]);
    let [a, b] = draws(centre, sd.map(|sd| width * sd));
    let weights = vec![1.0; a.len()];
    FirstProposal::fitted(&problem.parameters, &[Some(&a), Some(&b)], &weights, settings).unwrap()
}

fn known() -> Noise {
    Noise::Fixed { sigma: FixedSigma::Absolute(SIGMA) }
}

fn run(settings: &Settings) -> Posterior {
    let simulator = line();
    calibrate(&line_problem(&simulator, known()), settings, &mut ()).unwrap()
}

/// Errors of means (posterior sds), of sds (relative) and of the log evidence over seeds: root mean squares, and the mean
/// error over its standard error.
fn errors(settings: &Settings, seeds: u64, off: f64, width: f64) -> ([f64; 3], [f64; 2]) {
    let exact = exact(SIGMA);
    let (mut squares, mut bias, mut spread) = ([0.0; 3], [0.0; 2], [0.0; 2]);
    for seed in 0..seeds {
        let mut own = Settings { seed, ..settings.clone() };
        own.first_proposal = Some(fitted(&own, off, width).mixture);
        let found = run(&own);
        let sd = exact.covariance[(1, 1)].sqrt();
        let slope = &found.parameters[1].in_coordinate;
        let now = [
            (slope.mean - exact.mean[1]) / sd,
            slope.sd / sd - 1.0,
            found.log_evidence.value - exact.log_evidence,
        ];
        for (square, now) in squares.iter_mut().zip(now) {
            *square += now * now / seeds as f64;
        }
        for (k, now) in [now[0], now[2]].into_iter().enumerate() {
            bias[k] += now / seeds as f64;
            spread[k] += now * now / seeds as f64;
        }
    }
    let n = seeds as f64;
    let z = [0, 1].map(|k| bias[k] / ((spread[k] - bias[k] * bias[k]) / (n - 1.0)).sqrt());
    (squares.map(f64::sqrt), z)
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_answer_does_not_depend_on_whether_the_earlier_posterior_is_right() {
    let settings = Settings { samples: 4096, map_simulations: 0, ..Settings::default() };
    // Right, three sds off, thirty sds off and a third as wide, forty times as wide.
    for (off, width) in [(0.0, 1.0), (3.0, 1.0), (30.0, 0.3), (0.0, 40.0)] {
        let (rms, z) = errors(&settings, 12, off, width);
        assert!(rms[0] < 0.02 && rms[1] < 0.02 && rms[2] < 0.01, "{off} {width}: {rms:?}");
        assert!(z.iter().all(|z| z.abs() < 4.0), "{off} {width}: biased by {z:?}");
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn sixty_runs_find_the_posterior_from_a_right_and_from_a_wrong_one() {
    for (off, width) in [(0.0, 1.0), (3.0, 1.0), (30.0, 0.3)] {
        let (rms, _) = errors(&Settings::for_budget(60), 8, off, width);
        assert!(rms[0] < 0.1 && rms[1] < 0.1 && rms[2] < 0.1, "{off} {width}: {rms:?}");
    }
}

#[test]
fn weights_are_those_of_the_mixture_that_the_samples_were_drawn_from() {
    let mut settings = Settings { samples: 64, iterations: 1, ..Settings::default() };
    settings.first_proposal = Some(fitted(&settings, 1.0, 1.0).mixture);
    let found = run(&settings);
    // The second moment of the first stage's draws is that of the mixture, not that of the prior.
    let first: Vec<_> = found.samples.iter().filter(|sample| sample.stage == 0).collect();
    let near = first.iter().filter(|s| (s.theta[1] - 1.2).abs() < 0.5).count() as f64;
    let share = near / first.len() as f64;
    assert!((share - 0.8).abs() < 0.1, "{share} of the first draws are near the earlier posterior");
    assert_eq!(found.stages[0].proposal.prior_share, FirstProposal::PRIOR_SHARE);
}

#[test]
fn one_and_three_threads_give_the_same_bits_from_an_earlier_posterior() {
    let at = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut settings = Settings::for_budget(100);
            settings.first_proposal = Some(fitted(&settings, 2.0, 1.0).mixture);
            format!("{:?}", run(&settings))
        })
    };
    assert!(at(1) == at(3));
}

#[test]
fn an_extended_run_begins_with_the_bits_of_the_run_it_extends() {
    let mut short = Settings::for_budget(60);
    short.first_proposal = Some(fitted(&short, 2.0, 1.0).mixture);
    let (before, after) = (run(&short), run(&short.extended(100).unwrap()));
    for (a, b) in before.samples.iter().zip(&after.samples) {
        assert_eq!((&a.z, a.log_likelihood), (&b.z, b.log_likelihood));
    }
    assert_eq!(after.samples.len(), 100);
}

#[test]
fn a_parameter_that_the_earlier_run_had_not_gets_its_prior() {
    let simulator = line();
    let parameters = line_problem(&simulator, known()).parameters;
    let [a, _] = draws([0.3, 0.0], [0.02, 1.0]);
    let weights = vec![1.0; a.len()];
    let settings = Settings::default();
    let of = |columns: [Option<&[f64]>; 2]| {
        FirstProposal::fitted(&parameters, &columns, &weights, &settings)
    };
    let found = of([Some(&a), None]).unwrap().mixture;
    let total: f64 = found.components.iter().map(|c| c.weight).sum();
    assert!((total + found.prior_share - 1.0).abs() < 1e-12);
    for c in &found.components {
        assert_eq!((c.mean[1], c.scale[1][1], c.scale[0][1]), (0.0, 1.0, 0.0));
    }
    // Mean 0.3 and sd 0.02 under N(0, 1), widened.
    let mean: f64 = found.components.iter().map(|c| c.weight * c.mean[0]).sum::<f64>() / total;
    assert!((mean - 0.3).abs() < 1e-3, "{mean}");
    let second = |c: &smc_calib::ComponentRecord| {
        c.scale[0][0] + FirstProposal::WIDENING * (c.mean[0] - mean).powi(2)
    };
    let variance: f64 = found.components.iter().map(|c| c.weight * second(c)).sum::<f64>() / total;
    assert!(
        ((variance / FirstProposal::WIDENING).sqrt() / 0.02 - 1.0).abs() < 0.02,
        "{}",
        variance.sqrt()
    );
}

#[test]
fn what_lies_outside_the_new_priors_is_left_out_and_counted() {
    let narrow = prior(PriorSpec::Uniform { lower: 0.3, upper: 2.0 });
    let parameters = vec![Parameter::new("a", "1", narrow)];
    let [a, _] = draws([0.3, 0.0], [0.02, 1.0]);
    let weights = vec![1.0; a.len()];
    let of = |column: &[f64]| {
        FirstProposal::fitted(&parameters, &[Some(column)], &weights, &Settings::default())
    };
    assert!((of(&a).unwrap().outside_priors - 0.5).abs() < 0.01);
    let below: Vec<f64> = a.iter().map(|x| x - 1.0).collect();
    let error = of(&below).expect_err("nothing is inside").to_string();
    assert!(error.contains("100.000 % of the earlier posterior lie outside"), "{error}");
}

#[test]
fn mixtures_and_samples_that_fit_nothing_are_refused() {
    let settings = Settings { samples: 256, ..Settings::default() };
    let simulator = line();
    let problem = line_problem(&simulator, known());
    let good = fitted(&settings, 0.0, 1.0).mixture;
    let bad = |change: &dyn Fn(&mut smc_calib::MixtureRecord)| {
        let mut mixture = good.clone();
        change(&mut mixture);
        let settings = Settings { first_proposal: Some(mixture), ..settings.clone() };
        let refused = calibrate(&problem, &settings, &mut ()).expect_err("refused");
        assert!(matches!(refused, CalibrateError::FirstProposal { .. }), "{refused}");
    };
    bad(&|m| m.prior_share = 0.5);
    bad(&|m| {
        m.prior_share = 0.0;
        m.components.iter_mut().for_each(|c| c.weight /= 1.0 - FirstProposal::PRIOR_SHARE);
    });
    bad(&|m| m.components[0].mean.push(0.0));
    bad(&|m| m.components[0].mean[0] = f64::NAN);
    bad(&|m| m.components[0].scale[0][0] = -1.0);
    bad(&|m| m.components[0].degrees_of_freedom = 3.0);
    let of = |columns: &[Option<&[f64]>], weights: &[f64]| {
        FirstProposal::fitted(&problem.parameters, columns, weights, &settings)
            .expect_err("refused")
    };
    let x = [0.1, 0.2, 0.3];
    assert!(of(&[None, None], &[1.0; 3]).to_string().contains("none of the parameters"));
    for weights in [&[1.0; 2][..], &[0.0; 3], &[f64::NAN; 3], &[-1.0; 3]] {
        assert!(of(&[Some(&x), None], weights).to_string().contains("do not fit together"));
    }
    // Three samples, of which one has all weight, have no shape.
    assert!(of(&[Some(&x), None], &[1.0, 0.0, 0.0]).to_string().contains("too few samples"));
    let tuned = line_problem(&simulator, Noise::EssTarget { share: 0.2 });
    let settings = Settings { first_proposal: Some(good), ..settings.clone() };
    assert!(calibrate(&tuned, &settings, &mut ()).is_err());
}
