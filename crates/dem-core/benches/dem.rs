//! Speed of the contact law and of the solvers, on one core.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use dem_core::printed::from_printed;
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios, paper,
    verlet_batch,
};

/// As many times as the PS measurement has, over the same span.
fn ps_times() -> Vec<f64> {
    (0..44).map(|i| 0.2 * f64::from(i) / 43.0).collect()
}

fn ps() -> (PairScene, Sintering) {
    let scene = PairSpec::new(paper::PS, 1.08).build().expect("the paper's powder");
    (scene, from_printed(&paper::PS_TABLE3, paper::PS.radius_m))
}

fn contact_law(c: &mut Criterion) {
    let (scene, _) = ps();
    let law = *scene.law();
    c.bench_function("contact law, elastic branch", |b| {
        b.iter(|| law.respond(black_box(0.51), black_box(0.5)))
    });
}

fn closed_form(c: &mut Criterion) {
    let (scene, s) = ps();
    let settings = SolverSettings::default();
    let times = ps_times();
    let mut out = vec![0.0; times.len()];
    let mut group = c.benchmark_group("closed form, 44 PS times");
    for kinetics in Kinetics::ALL {
        group.bench_function(kinetics.name(), |b| {
            b.iter(|| {
                contact_ratios(&scene, kinetics, black_box(&s), &settings, &times, &mut out)
                    .expect("valid")
                    .error_estimate
            })
        });
    }
    // A knee later than the last time, so that every point needs a root.
    let slow = Sintering { c1: 1e-2 * s.c1, ..s };
    group.bench_function("three-stage, all before the knee", |b| {
        b.iter(|| {
            contact_ratios(
                &scene,
                Kinetics::ThreeStage,
                black_box(&slow),
                &settings,
                &times,
                &mut out,
            )
            .expect("valid")
            .error_estimate
        })
    });
}

fn quasi_static(c: &mut Criterion) {
    let (scene, s) = ps();
    let settings = SolverSettings::of(SolverKind::QuasiStatic);
    let times = ps_times();
    let mut out = vec![0.0; times.len()];
    let mut group = c.benchmark_group("quasi-static to 1e-6, 44 PS times");
    for kinetics in Kinetics::ALL {
        group.bench_function(kinetics.name(), |b| {
            b.iter(|| {
                contact_ratios(&scene, kinetics, black_box(&s), &settings, &times, &mut out)
                    .expect("valid")
                    .steps
            })
        });
    }
}

/// Observations so late, and steps so short, that steps make up the run.
fn long_run() -> (Vec<f64>, SolverSettings) {
    let settings = SolverSettings {
        step_over_collision_time: 0.001,
        ..SolverSettings::of(SolverKind::Verlet)
    };
    (vec![0.1], settings)
}

fn verlet(c: &mut Criterion) {
    let (scene, s) = ps();
    let (times, settings) = long_run();
    let s = Sintering { tau_s: 10.0 * s.tau_s, ..s };
    let mut out = [0.0];
    let mut group = c.benchmark_group("verlet, steps of a single curve");
    for kinetics in Kinetics::ALL {
        let report = contact_ratios(&scene, kinetics, &s, &settings, &times, &mut out);
        group.throughput(Throughput::Elements(report.expect("valid").steps));
        group.bench_function(kinetics.name(), |b| {
            b.iter(|| {
                contact_ratios(&scene, kinetics, black_box(&s), &settings, &times, &mut out)
                    .expect("valid")
                    .steps
            })
        });
    }
    group.finish();

    let default = SolverSettings::of(SolverKind::Verlet);
    let times = ps_times();
    let mut out = vec![0.0; times.len()];
    let (scene, s) = ps();
    c.bench_function("verlet, the PS curve at 44 times with 0.02 t_c", |b| {
        b.iter(|| {
            contact_ratios(&scene, Kinetics::ThreeStage, black_box(&s), &default, &times, &mut out)
                .expect("valid")
                .steps
        })
    });
}

fn batch(c: &mut Criterion) {
    let (scene, s) = ps();
    let (_, settings) = long_run();
    let times: Vec<f64> = ps_times().iter().map(|t| 0.5 * t).collect();
    let sinterings: Vec<Sintering> =
        (0..32).map(|i| Sintering { tau_s: s.tau_s * (4.0 + 0.1 * f64::from(i)), ..s }).collect();
    let mut group = c.benchmark_group("verlet, steps of a batch of 32 curves");
    for kinetics in Kinetics::ALL {
        let run = || {
            let mut out = vec![0.0; sinterings.len() * times.len()];
            verlet_batch(&scene, kinetics, &sinterings, &settings, &times, &mut out).expect("valid")
        };
        let steps = run().iter().map(|result| result.as_ref().map_or(0, |r| r.steps)).sum();
        group.throughput(Throughput::Elements(steps));
        group.bench_function(kinetics.name(), |b| {
            b.iter_batched(|| (), |()| run(), BatchSize::LargeInput)
        });
    }
}

criterion_group!(benches, contact_law, closed_form, quasi_static, verlet, batch);
criterion_main!(benches);
