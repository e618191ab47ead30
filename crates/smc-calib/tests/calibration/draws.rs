//! Draws of small budgets, which a Gaussian process makes: they are those of the posterior, and of the summary.

use crate::conjugate::exact;
use crate::support::{line, line_problem, prior};
use smc_calib::sbc::{self, Band, Study, quantities};
use smc_calib::{
    CalibrateError, Coordinate, FixedSigma, FnSimulator, Noise, Observations, Parameter, Posterior,
    PriorSpec, Problem, Settings, SimError, Simulations, Simulator, Weighted, calibrate,
    predicted_outputs, predictive_band,
};
use std::sync::atomic::{AtomicUsize, Ordering};

fn run(problem: &Problem<'_>, settings: Settings) -> Posterior {
    calibrate(problem, &settings, &mut ()).unwrap()
}

/// What follows from the parameters of every draw.
fn of_draws(p: &Posterior, value: impl Fn(&[f64]) -> f64) -> Weighted {
    Weighted::equal(p.draws.iter().map(|draw| value(p.theta(draw))).collect())
}

#[test]
fn draws_after_fifty_simulations_of_a_line_are_those_of_its_normal_posterior() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let known = exact(0.05);
    let p = run(&problem, Settings::for_budget(50));
    assert!(p.is_drawn() && p.ess.importance < 40.0);
    // a + t b has a normal posterior too, which is wider than the data say where a and b depend on one another wrongly.
    for t in [0.0, 0.55, 2.0] {
        let mean = known.mean[0] + t * known.mean[1];
        let c = &known.covariance;
        let sd = (c[(0, 0)] + 2.0 * t * c[(0, 1)] + t * t * c[(1, 1)]).sqrt();
        let drawn = of_draws(&p, |theta| theta[0] + t * theta[1]);
        for (quantile, score) in [(0.025, -1.959_964), (0.5, 0.0), (0.975, 1.959_964)] {
            let off = (drawn.quantile(quantile) - mean) / sd - score;
            assert!(off.abs() < 0.1, "{t}, {quantile}: {off}");
        }
        let (of_mean, of_sd) = drawn.moments();
        assert!((of_mean - mean).abs() < 0.05 * sd && (of_sd / sd - 1.0).abs() < 0.05, "{t}");
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn draws_have_the_intervals_and_moments_of_the_summary_and_stay_in_the_range_of_the_prior() {
    // Posteriors in the middle of a prior, over decades, and at its end.
    let simulator = FnSimulator::new(3, 6, |x: &[f64], out: &mut [f64]| {
        for (i, o) in out.iter_mut().enumerate() {
            let t = i as f64 / 5.0;
            *o = x[0] * t + x[1].log10() * (1.0 - t) + x[2] * t * t;
        }
        Ok::<(), SimError>(())
    });
    let times: Vec<f64> = (0..6).map(f64::from).collect();
    let values = vec![0.48, 0.63, 0.57, 0.62, 0.64, 0.61];
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![
            Parameter::new("a", "1", prior(PriorSpec::Normal { mean: 0.5, sd: 1.0 })),
            Parameter::new("b", "1", prior(PriorSpec::LogUniform { lower: 0.1, upper: 1e3 })),
            Parameter::new("c", "1", prior(PriorSpec::Uniform { lower: 0.0, upper: 2.0 })),
        ],
        observations: Observations::new(times, values).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.05) },
    };
    for seed in 1..=2 {
        let p = run(&problem, Settings { seed, ..Settings::for_budget(100) });
        assert!(p.is_drawn());
        for (j, summary) in p.parameters.iter().enumerate() {
            let (lower, upper) = summary.parameter.prior.support();
            let own = summary.in_si;
            let drawn = of_draws(&p, |theta| theta[j]);
            let coordinate = of_draws(&p, |theta| summary.coordinate.of(theta[j]));
            for (share, of) in [(0.5, own.eti50), (0.9, own.eti90), (0.95, own.eti95)] {
                let [from, to] = drawn.interval(share);
                let off = [from - of.lower, to - of.upper].map(|off| off.abs() / own.sd);
                // Draws are held to shares between levels that are a quarter of a normal score apart, and free between two of them.
                assert!(off[0] < 0.1 && off[1] < 0.1, "{j}, {share}: {off:?}");
            }
            let (mean, sd) = drawn.moments();
            if summary.coordinate == Coordinate::Linear {
                // The integrals are the better number.
                let of = summary.in_coordinate;
                assert_eq!([own.mean, own.sd], [of.mean, of.sd]);
            } else {
                assert!((mean / own.mean - 1.0).abs() < 1e-9 && (sd / own.sd - 1.0).abs() < 1e-9);
            }
            let (mean, sd) = coordinate.moments();
            let own = summary.in_coordinate;
            assert!((mean - own.mean).abs() < 0.05 * own.sd, "{j}: {mean} {own:?}");
            assert!((sd / own.sd - 1.0).abs() < 0.05, "{j}: {sd} {own:?}");
            let inside = |theta: &[f64]| (lower..=upper).contains(&theta[j]);
            assert!(p.draws.iter().all(|draw| inside(p.theta(draw))), "{j}");
        }
        let of = |i: usize, j: usize| {
            let each = of_draws(&p, |x| p.parameters[j].coordinate.of(x[j]));
            let both = |x: &[f64]| [i, j].map(|k| p.parameters[k].coordinate.of(x[k]));
            let ((a, sa), (b, sb)) = (of_draws(&p, |x| both(x)[0]).moments(), each.moments());
            of_draws(&p, |x| (both(x)[0] - a) * (both(x)[1] - b)).moments().0 / (sa * sb)
        };
        for i in 0..3 {
            for j in 0..i {
                let off = of(i, j) - p.correlation[i][j];
                assert!(off.abs() < 0.08, "{i} {j}: {off}");
            }
        }
    }
}

#[test]
fn noise_and_bands_by_few_simulations_are_those_by_many() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::default());
    let many = run(&problem, Settings { samples: 16_384, ..Settings::default() });
    let few = run(&problem, Settings::for_budget(60));
    assert!(few.is_drawn() && !many.is_drawn());
    let [a, b] = [&few, &many].map(|p| p.sigma.unwrap());
    let off = |a: f64, b: f64| (a / b - 1.0).abs();
    assert!(off(a.mean, b.mean) < 0.02 && off(a.sd, b.sd) < 0.1, "{a:?} {b:?}");
    assert!(off(a.median, b.median) < 0.03 && off(a.eti95[1], b.eti95[1]) < 0.06, "{a:?} {b:?}");
    let grid = predictive_band(&few, &simulator, problem.observations.control(), 2048).unwrap();
    for ((few, many), grid) in few.predictive.iter().zip(&many.predictive).zip(&grid) {
        let sd = (many.curve95[1] - many.curve95[0]) / 3.92;
        assert!((few.mean - many.mean).abs() < 0.1 * sd, "{few:?} {many:?}");
        for end in 0..2 {
            assert!((few.curve95[end] - many.curve95[end]).abs() < 0.3 * sd, "{few:?} {many:?}");
            assert!((few.noisy90[end] - many.noisy90[end]).abs() < 0.01, "{few:?} {many:?}");
            // Predicted outputs are those that the simulator has there.
            assert!((few.curve90[end] - grid.curve90[end]).abs() < 0.1 * sd, "{few:?} {grid:?}");
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn a_process_makes_as_many_draws_as_are_asked_for_but_neither_few_nor_too_many() {
    let simulator = line();
    let problem = line_problem(&simulator, Noise::Fixed { sigma: FixedSigma::Absolute(0.05) });
    let of = |problem: &Problem<'_>, draws: usize| {
        run(problem, Settings { draws, ..Settings::for_budget(32) })
    };
    for (draws, drawn) in [
        (0, false),
        (1, false),
        (499, false),
        (500, true),
        (501, true),
        (4097, true),
        (65_536, true),
        (65_537, false),
    ] {
        let p = of(&problem, draws);
        assert_eq!((p.draws.len(), p.is_drawn()), (draws, drawn), "{draws}");
        assert!((p.points().map(|point| point.weight).sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(p.points().all(|point| point.replicate.is_none() == drawn));
        // The nearest sample of each is one that was simulated.
        assert!(p.draws.iter().all(|d| p.samples[d.sample].log_likelihood.is_some()));
    }
    // Ten million outputs.
    let long = FnSimulator::new(2, 200, |theta: &[f64], out: &mut [f64]| {
        (0..200).for_each(|i| out[i] = theta[0] + theta[1] * i as f64 / 200.0);
        Ok::<(), SimError>(())
    });
    let times: Vec<f64> = (0..200).map(f64::from).collect();
    let values = times.iter().map(|t| 0.3 + 1.2 * t / 200.0).collect();
    let observations = Observations::new(times, values).unwrap();
    let many = Problem { simulator: &long, observations, ..problem.clone() };
    assert!(!of(&many, 50_000).is_drawn() && of(&many, 4096).is_drawn());
}

/// Mean square of the residuals of the draws over the noise, and the largest one.
fn squares(p: &Posterior, problem: &Problem<'_>, sigma: f64) -> [f64; 2] {
    let values = problem.observations.values();
    let mut out = vec![0.0; values.len()];
    let each = p.draws.iter().map(|draw| {
        problem.simulator.simulate(p.theta(draw), &mut out).unwrap();
        out.iter().zip(values).map(|(o, y)| ((o - y) / sigma).powi(2)).sum::<f64>()
    });
    let each: Vec<f64> = each.collect();
    [each.iter().sum::<f64>() / each.len() as f64, each.iter().copied().fold(0.0, f64::max)]
}

#[test]
#[ignore = "long: run by .ci/run"]
fn draws_stay_in_both_of_two_modes_and_on_a_narrow_ridge() {
    let parameter =
        |name: &str| Parameter::new(name, "1", prior(PriorSpec::Normal { mean: 0.0, sd: 2.0 }));
    let problem = |simulator, values: Vec<f64>, sigma: f64| {
        let times = (0..values.len()).map(|i| i as f64).collect();
        Problem {
            simulator,
            parameters: vec![parameter("a"), parameter("b")],
            observations: Observations::new(times, values).unwrap(),
            noise: Noise::Fixed { sigma: FixedSigma::Absolute(sigma) },
        }
    };
    // a^2 = 4 within 0.2, twenty standard deviations of a mode apart.
    let square = FnSimulator::new(2, 2, |x: &[f64], out: &mut [f64]| {
        out.copy_from_slice(&[x[0] * x[0], x[1]]);
        Ok::<(), SimError>(())
    });
    let modes = problem(&square, vec![4.0, 0.5], 0.2);
    let p = run(&modes, Settings::for_budget(100));
    if p.is_drawn() {
        let [mean, most] = squares(&p, &modes, 0.2);
        assert!((1.5..3.0).contains(&mean) && most < 40.0, "{mean} {most}");
    }
    // a + b within 0.05, a - b within 0.5: a correlation of -0.98.
    let narrow = FnSimulator::new(2, 2, |x: &[f64], out: &mut [f64]| {
        out.copy_from_slice(&[x[0] + x[1], 0.1 * (x[0] - x[1])]);
        Ok::<(), SimError>(())
    });
    let ridge = problem(&narrow, vec![1.0, 0.05], 0.05);
    let p = run(&ridge, Settings::for_budget(100));
    assert!(p.is_drawn() && p.correlation[1][0] < -0.97, "{:?}", p.correlation);
    // Two observations of two parameters, of which the prior decides little.
    let [mean, most] = squares(&p, &ridge, 0.05);
    assert!((1.8..2.2).contains(&mean) && most < 40.0, "{mean} {most}");
}

#[test]
fn outputs_between_simulations_are_predicted_and_incomplete_rows_are_none() {
    // A plane curve of two parameters; the last of 40 simulations failed.
    let (n, d) = (40, 2);
    let curve = |z: &[f64]| [z[0].sin() + z[1], (0.5 * z[0]).exp(), z[0] * z[1]];
    let of = |k: usize| [1.5 * (1.7 * k as f64 + 0.3).sin(), 1.5 * (2.9 * k as f64).sin()];
    let z: Vec<f64> = (0..n).flat_map(of).collect();
    let outputs: Vec<f64> = z.chunks_exact(d).flat_map(curve).collect();
    let ln_joint = |of: &[f64]| of.iter().map(|v| -0.5 * v * v).sum::<f64>();
    let mut ln_likelihood: Vec<f64> = outputs.chunks_exact(3).map(ln_joint).collect();
    ln_likelihood[n - 1] = f64::NEG_INFINITY;
    let weights = vec![1.0; n];
    let whole = Simulations {
        parameters: d,
        z: &z,
        outputs: &outputs,
        ln_likelihood: &ln_likelihood,
        weights: &weights,
        ln_joint: &ln_joint,
    };
    let at = [0.2, -0.4, 0.9, 0.8, -1.0, 0.1];
    let found = predicted_outputs(&whole, &at).unwrap();
    for (found, exact) in found.chunks_exact(3).zip(at.chunks_exact(d).map(curve)) {
        for (found, exact) in found.iter().zip(exact) {
            assert!((found - exact).abs() < 0.05, "{found} {exact}");
        }
    }
    assert_eq!(predicted_outputs(&whole, &[]), Some(Vec::new()));
    for broken in [
        Simulations { parameters: 0, ..whole },
        Simulations { parameters: 3, ..whole },
        Simulations { z: &z[1..], ..whole },
        Simulations { outputs: &outputs[1..], ..whole },
        Simulations { ln_likelihood: &ln_likelihood[1..], ..whole },
        Simulations { weights: &[], ..whole },
        Simulations { ln_likelihood: &vec![f64::NEG_INFINITY; n], ..whole },
    ] {
        assert_eq!(predicted_outputs(&broken, &at), None);
    }
    assert_eq!(predicted_outputs(&whole, &at[1..]), None);
}

/// Made data of a line, each set calibrated by forty simulations.
fn forty_each(simulator: &dyn Simulator, noise: Noise, data_sets: usize) -> Study<'_> {
    let normal = || prior(PriorSpec::Normal { mean: 0.0, sd: 1.0 });
    Study {
        simulator,
        parameters: vec![Parameter::new("a", "1", normal()), Parameter::new("b", "1", normal())],
        control: (0..8).map(f64::from).collect(),
        noise,
        origin: None,
        settings: Settings { seed: 70, ..Settings::for_budget(40) },
        data_sets,
    }
}

/// A line by its values at the ends, which can be run so often.
fn ending_after(runs: usize) -> impl Simulator {
    let left = AtomicUsize::new(runs);
    FnSimulator::new(2, 8, move |x: &[f64], out: &mut [f64]| {
        if left
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1))
            .is_err()
        {
            return Err(SimError::fatal("no licence left"));
        }
        for (i, o) in out.iter_mut().enumerate() {
            let t = i as f64 / 7.0;
            *o = x[0] * (1.0 - t) + x[1] * t;
        }
        Ok(())
    })
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn draws_of_a_process_through_forty_simulations_of_made_data_have_even_ranks() {
    let line = ending_after(usize::MAX);
    let study = forty_each(&line, Noise::Inferred { nu0: 4.0, s0: 0.3 }, 100);
    let names = quantities(&study.parameters, &study.noise);
    let outcomes = sbc::run(&study).unwrap();
    let band = Band::new(outcomes.len(), 0.95);
    for (q, name) in names.iter().enumerate() {
        let ranks: Vec<f64> = outcomes.iter().map(|o| o.ranks[q]).collect();
        let p = band.p_value(&ranks);
        assert!(p > 1e-3, "{name}: p = {p}");
    }
}

#[test]
#[ignore = "longer: run by .ci/long"]
fn a_simulator_that_ends_while_ranks_are_made_ends_them() {
    // One run makes the truth, 40 the samples, 128 rank the draws.
    let inferred = Noise::Inferred { nu0: 4.0, s0: 0.3 };
    let correlated = Noise::Correlated { nu0: 4.0, s0: 0.3, scale: None, nodes: Some([3, 3]) };
    let ended = [(&inferred, 41), (&inferred, 41 + 127), (&correlated, 41 + 127)];
    for (noise, runs) in ended {
        match sbc::run(&forty_each(&ending_after(runs), noise.clone(), 1)) {
            Err(CalibrateError::Fatal { cause, simulations }) => {
                assert_eq!((cause.as_str(), simulations), ("no licence left", runs - 1));
            }
            other => panic!("{runs}: {other:?}"),
        }
    }
    assert!(sbc::run(&forty_each(&ending_after(41 + 128), correlated, 1)).is_ok());
}
