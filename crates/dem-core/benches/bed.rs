//! Steps of many particles, by the features of the scene. Throughput is in particle steps.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dem_core::bed::{Bed, Drive, Growing, Material, Region, Side, Start, Surroundings};
use dem_core::{Kinetics, PairSpec, Sintering, paper};

/// A periodic simple cubic lattice in its adhesive contact, six contacts per particle.
fn lattice(side: usize, sinters: bool) -> Bed {
    let radius_m = paper::PA12.radius_m;
    let spacing = (2.0 - 1e-3) * radius_m;
    let mut start = Start::default();
    for i in 0..side * side * side {
        let at = [i / (side * side), i / side % side, i % side];
        start.position_m.push(at.map(|at| at as f64 * spacing));
        start.radius_m.push(radius_m);
    }
    let region = Region::new([side as f64 * spacing; 3], Side::Periodic);
    let material =
        Material::new(PairSpec::new(paper::PA12, 2f64.cbrt())).expect("the paper's material");
    let surroundings = Surroundings { region, ..Surroundings::NOTHING };
    let mut bed = Bed::new(material, surroundings, &start).expect("a lattice does not overlap");
    let growing = Growing {
        kinetics: Kinetics::ThreeStage,
        sintering: Sintering { c1: 1.177e-5, tau_s: 3.81, delta_c: 9.55e-8, lambda: 0.0 },
        calibrated_radius_m: radius_m,
    };
    bed.begin(&Drive { growing: sinters.then_some(growing), ..Drive::default() })
        .expect("a stable step");
    bed
}

fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bed");
    group.sample_size(10);
    for (name, sinters) in [("normal", false), ("sintering", true)] {
        for side in [10, 22, 46] {
            let mut bed = lattice(side, sinters);
            let particles = bed.particles().len();
            let each = (1_000_000 / particles).max(10) as u64;
            group.throughput(Throughput::Elements(particles as u64 * each));
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .expect("a thread pool");
                group.bench_function(format!("{name}/{particles}/{threads} threads"), |bencher| {
                    bencher.iter(|| {
                        pool.install(|| bed.advance(black_box(each))).expect("stays stable");
                    });
                });
            }
        }
    }
    group.finish();
}

criterion_group!(benches, steps);
criterion_main!(benches);
