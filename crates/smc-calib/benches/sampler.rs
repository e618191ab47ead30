//! Hot paths of the calibration.
#![allow(missing_docs, clippy::unwrap_used)]

use criterion::{Criterion, criterion_group, criterion_main};
use smc_calib::reference::gaussian;
use smc_calib::{
    FnSimulator, Likelihood, Noise, Observations, Parameter, Prior, PriorSpec, Problem, Settings,
    SimError, calibrate, sample_density,
};
use std::hint::black_box;

fn observations(m: usize) -> Observations {
    let control: Vec<f64> = (0..m).map(|i| i as f64 / m as f64).collect();
    let values = control.iter().map(|t| 1.0 - (-3.0 * t).exp()).collect();
    Observations::new(control, values).unwrap()
}

fn likelihood(c: &mut Criterion) {
    for (name, noise) in [
        ("independent", Noise::default()),
        ("correlated", Noise::correlated()),
        ("robust", Noise::robust()),
    ] {
        let l = Likelihood::new(&noise, &observations(44)).unwrap();
        let outputs: Vec<f64> = l.values().iter().map(|v| v + 0.01).collect();
        c.bench_function(&format!("likelihood recursion, 44 observations, {name}"), |b| {
            b.iter(|| {
                let mut sum = 0.0;
                l.recursion(black_box(&outputs), |_, ln| sum += ln);
                sum
            });
        });
        c.bench_function(&format!("likelihood path, 44 observations, {name}"), |b| {
            let mut path = vec![0.0; 44];
            b.iter(|| l.ln_cumulative(black_box(&outputs), black_box(&mut path)));
        });
        c.bench_function(&format!("joint likelihood, 44 observations, {name}"), |b| {
            b.iter(|| l.ln_joint(black_box(&outputs)))
        });
    }
}

/// The sampler alone: the likelihood costs nothing.
fn sampler(c: &mut Criterion) {
    let target = gaussian(3, 0.8, 0.1);
    let settings = Settings { samples: 16_384, ..Settings::default() };
    let mut group = c.benchmark_group("16 384 samples of a Gaussian in 3 dimensions");
    group.sample_size(10);
    for (name, settings) in [
        ("all", settings.clone()),
        // A short final stage has no surrogate as control variate.
        ("no surrogate", Settings { final_share: 0.1, ..settings.clone() }),
        (
            "no surrogate, one component",
            Settings { final_share: 0.1, max_components: 1, patches: 0, ..settings },
        ),
    ] {
        group.bench_function(name, |b| b.iter(|| sample_density(&target, &settings).unwrap()));
    }
    group.finish();
}

fn whole(c: &mut Criterion) {
    let simulator = FnSimulator::new(3, 44, |theta: &[f64], out: &mut [f64]| {
        for (i, o) in out.iter_mut().enumerate() {
            let t = i as f64 / 44.0;
            *o = theta[0] * (1.0 - (-theta[1] * t).exp()) + theta[2] * t;
        }
        Ok::<(), SimError>(())
    });
    let prior = |lower, upper| Prior::new(PriorSpec::LogUniform { lower, upper }).unwrap();
    let problem = Problem {
        simulator: &simulator,
        parameters: vec![
            Parameter::new("a", "1", prior(0.1, 10.0)),
            Parameter::new("b", "1/s", prior(0.1, 30.0)),
            Parameter::new("c", "1/s", prior(0.001, 1.0)),
        ],
        observations: observations(44),
        noise: Noise::default(),
    };
    let mut group = c.benchmark_group("whole calibration, 44 observations");
    group.sample_size(10);
    for samples in [4096, 16_384] {
        let settings = Settings { samples, ..Settings::default() };
        group.bench_function(format!("{samples} simulations"), |b| {
            b.iter(|| calibrate(&problem, &settings, &mut ()).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, likelihood, sampler, whole);
criterion_main!(benches);
