//! The sampler against problems with known moments and evidence.

use smc_calib::reference::{Reference, all, gaussian};
use smc_calib::{DensitySummary, Settings, sample_density};

fn runs(reference: &Reference, samples: usize, seeds: u64) -> Vec<DensitySummary> {
    (0..seeds)
        .map(|seed| {
            sample_density(reference, &Settings { samples, seed, ..Settings::default() }).unwrap()
        })
        .collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt()
}

#[test]
fn moments_and_evidence_of_every_reference_are_found() {
    for reference in all() {
        let runs = runs(&reference, 4096, 10);
        let evidence = rms(runs.iter().map(|r| r.log_evidence.value - reference.log_evidence));
        assert!(evidence < 0.02, "{}: log evidence {evidence}", reference.name);
        for j in 0..reference.mean.len() {
            let mean = rms(runs.iter().map(|r| (r.mean[j] - reference.mean[j]) / reference.sd[j]));
            let sd = rms(runs.iter().map(|r| r.sd[j] / reference.sd[j] - 1.0));
            assert!(mean < 0.03, "{}: mean {j} off by {mean} sd", reference.name);
            assert!(sd < 0.03, "{}: sd {j} off by {sd}", reference.name);
        }
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn error_bars_are_honest() {
    // z-scores of means and evidence over seeds and references; 15 degrees of freedom inflate them by 1.074.
    let mut scores = Vec::new();
    for reference in all().iter().take(4) {
        for r in runs(reference, 2048, 25) {
            scores.extend(
                (0..reference.mean.len()).map(|j| (r.mean[j] - reference.mean[j]) / r.mean_se[j]),
            );
            scores.push((r.log_evidence.value - reference.log_evidence) / r.log_evidence.se);
        }
    }
    let spread = rms(scores.iter().copied()) / (15f64 / 13.0).sqrt();
    assert!((0.8..1.25).contains(&spread), "z-scores have sd {spread}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_frozen_evidence_is_unbiased() {
    let reference = &all()[1];
    let ratios: Vec<f64> = runs(reference, 1024, 60)
        .iter()
        .map(|r| (r.log_evidence.frozen_value - reference.log_evidence).exp())
        .collect();
    let n = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / n;
    let sd = (ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    assert!(
        (mean - 1.0).abs() < 3.5 * sd / n.sqrt(),
        "mean of Z-hat/Z is {mean} +- {}",
        sd / n.sqrt()
    );
}

#[test]
#[ignore = "long: run by .ci/run"]
fn the_evidence_is_unbiased_and_much_closer_than_that_of_plain_weights() {
    let reference = &all()[1];
    let runs = runs(reference, 4096, 40);
    let ratio = |r: &DensitySummary| (r.log_evidence.value - reference.log_evidence).exp();
    let n = runs.len() as f64;
    let mean = runs.iter().map(ratio).sum::<f64>() / n;
    let se = rms(runs.iter().map(|r| ratio(r) - mean)) / (n - 1.0).sqrt();
    assert!((mean - 1.0).abs() < 3.5 * se, "mean of Z-hat/Z is {mean} +- {se}");
    let error =
        |of: fn(&DensitySummary) -> f64| rms(runs.iter().map(|r| of(r) - reference.log_evidence));
    let (best, frozen, pooled) = (
        error(|r| r.log_evidence.value),
        error(|r| r.log_evidence.frozen_value),
        error(|r| r.log_evidence.pooled_value),
    );
    assert!(best < 0.6 * frozen && best < 0.6 * pooled, "{best} {frozen} {pooled}");
}

#[test]
#[ignore = "long: run by .ci/run"]
fn tails_of_the_banana_are_reached_and_the_surrogate_is_of_use_to_every_run() {
    let reference = &all()[1];
    let runs = runs(reference, 4096, 40);
    // A run without it reports the evidence of the plain weights.
    for (seed, r) in runs.iter().enumerate() {
        assert_ne!(r.log_evidence.value, r.log_evidence.frozen_value, "seed {seed}");
    }
    for j in 0..2 {
        let sd = rms(runs.iter().map(|r| r.sd[j] / reference.sd[j] - 1.0));
        let z = rms(runs.iter().map(|r| (r.sd[j] - reference.sd[j]) / r.sd_se[j]));
        assert!(sd < 0.015, "sd {j} off by {sd}");
        assert!(z / (15f64 / 13.0).sqrt() < 1.6, "z-scores of sd {j} have sd {z}");
    }
}

#[test]
fn any_dimension_from_one_to_ten_works() {
    for d in [1, 2, 5, 10] {
        let reference = gaussian(d, 0.5, 0.3);
        let r = &runs(&reference, 16_384, 1)[0];
        assert!(
            (r.log_evidence.value - reference.log_evidence).abs() < 0.1,
            "{d}: {:?}",
            r.log_evidence
        );
        for j in 0..d {
            assert!(
                (r.mean[j] - reference.mean[j]).abs() < 0.1 * reference.sd[j],
                "{d}: {:?}",
                r.mean
            );
            assert!((r.sd[j] / reference.sd[j] - 1.0).abs() < 0.1, "{d}: {:?}", r.sd);
        }
    }
}

#[test]
fn a_needle_of_a_millionth_of_the_prior_is_found() {
    let reference = gaussian(2, 0.7, 1e-6);
    let r = &runs(&reference, 16_384, 1)[0];
    assert!((r.log_evidence.value - reference.log_evidence).abs() < 0.05, "{r:?}");
    assert!((r.mean[0] - reference.mean[0]).abs() < 0.05 * reference.sd[0]);
    assert!(r.khat < 0.7 && r.ess > 4000.0, "{r:?}");
}

#[test]
fn the_map_is_the_higher_of_two_peaks_though_most_of_the_posterior_lies_at_the_other() {
    use smc_calib::{
        FixedSigma, FnSimulator, Noise, Observations, Parameter, PriorSpec, Problem, calibrate,
    };
    // A wide valley that misses the data by 0.02 at 0.2, a narrow one that meets them at 0.9.
    let simulator = FnSimulator::new(1, 2, |x: &[f64], out: &mut [f64]| {
        out.fill((0.02 + 0.3 * (x[0] - 0.2).abs()).min(5.0 * (x[0] - 0.9).abs()));
        Ok(())
    });
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![Parameter::new(
            "x",
            "1",
            crate::support::prior(PriorSpec::Uniform { lower: 0.0, upper: 1.0 }),
        )],
        observations: Observations::new(vec![0.0, 1.0], vec![0.0, 0.0]).unwrap(),
        noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.03) },
    };
    for seed in 0..8 {
        let settings = Settings { samples: 1024, seed, ..Settings::default() };
        let p = calibrate(&problem, &settings, &mut ()).unwrap();
        assert!(p.parameters[0].in_coordinate.median < 0.4, "{:?}", p.parameters[0]);
        assert!((p.map.theta[0] - 0.9).abs() < 1e-4, "seed {seed}: {:?}", p.map);
        assert!(p.counters.map_simulations <= 420);
    }
}

#[test]
#[ignore = "long: run by .ci/run"]
fn in_ten_dimensions_the_evidence_is_that_of_all_samples_where_the_last_stage_misses_it() {
    let reference = gaussian(10, 0.8, 0.1);
    let found = runs(&reference, 4096, 4);
    let error = |value: f64| value - reference.log_evidence;
    let missed = found.iter().filter(|p| error(p.log_evidence.frozen_value).abs() > 0.5).count();
    let rms = rms(found.iter().map(|p| error(p.log_evidence.value)));
    assert!(missed > 0 && rms < 0.15, "{missed} {rms}");
}
