//! Cost of a step of a bed: `bed_cost SCENE PARTICLES STEPS THREADS`.
//!
//! Prints particle steps per second, contacts per particle and bytes per particle. Under
//! `valgrind --tool=callgrind`, two runs of different numbers of steps give the instructions per
//! particle step; `benches/instructions.sh` makes the table.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::error::Error;
use std::time::Instant;

use dem_core::bed::{
    Bed, Drive, Friction, Growing, Material, Region, Side, Start, Surroundings, jammed_packing,
};
use dem_core::{Kinetics, PairSpec, Sintering, SolverKind, SolverSettings, paper, simulate};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, particles, steps, threads] = &arguments[..] else {
        return Err("bed_cost SCENE PARTICLES STEPS THREADS".into());
    };
    let (particles, steps): (usize, u64) = (particles.parse()?, steps.parse()?);
    rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?).build_global()?;
    if scene == "pair-solver" {
        return pair_solver(steps);
    }
    let mut bed = bed(scene, particles)?;
    bed.advance(20)?;
    let (before, cpu) = (Instant::now(), cpu_seconds());
    bed.advance(steps)?;
    let (seconds, cpu) = (before.elapsed().as_secs_f64(), cpu_seconds() - cpu);
    let n = bed.particles().len();
    println!(
        "{scene} N {n} threads {threads}: {:.3e} particle steps/s, {:.3e} per second of a core, {:.2} contacts, {} bytes per particle, {:?}",
        n as f64 * steps as f64 / seconds,
        n as f64 * steps as f64 / cpu,
        bed.sample().coordination,
        bed.memory_bytes() / n,
        bed.work(),
    );
    Ok(())
}

/// The same pair through the solver for pairs.
fn pair_solver(steps: u64) -> Result<(), Box<dyn Error>> {
    let scene = PairSpec::new(paper::PA12, 2f64.cbrt()).build()?;
    let settings = SolverSettings::of(SolverKind::Verlet);
    let end_s = steps as f64 * settings.step_over_collision_time * scene.collision_time_s();
    let sintering = Sintering { c1: 2.4e-5, tau_s: 3.81, delta_c: 9.5e-8 };
    let curve = simulate(&scene, Kinetics::ThreeStage, &sintering, &settings, &[end_s])?;
    println!("pair-solver: {:?}", curve.contact_ratio);
    Ok(())
}

/// Time that all threads of this process have run, where Linux says so; other programs do not count.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let nanoseconds = threads.flatten().filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    });
    1e-9 * nanoseconds.sum::<f64>()
}

fn bed(scene: &str, particles: usize) -> Result<Bed, Box<dyn Error>> {
    let has = |feature: &str| scene.split('+').any(|part| part == feature);
    let radius_m = paper::PA12.radius_m;
    let mut spec = PairSpec::new(paper::PA12, 2f64.cbrt());
    let mut start = Start::default();
    let mut region = Region::OPEN;
    if particles == 2 {
        start.position_m = vec![[0.0; 3], [(2.0 - 1e-3) * radius_m, 0.0, 0.0]];
        start.radius_m = vec![radius_m; 2];
    } else if has("chain") {
        let place = |i: usize| [i as f64 * (2.0 - 1e-3) * radius_m, 0.0, 0.0];
        start.position_m = (0..particles).map(place).collect();
        start.radius_m = vec![radius_m; particles];
    } else {
        let side = if has("walls") { Side::Walls } else { Side::Periodic };
        // Large periodic packings are copies of one of 2000 at most.
        let copies = (1..).find(|k| particles <= 2000 * k * k * k).unwrap_or(1);
        let count = particles / (copies * copies * copies);
        let size = (count as f64 * 7.5).cbrt() * radius_m;
        // Two radii that differ by a hair cost what any do.
        let unequal = if has("unequal") { 1.0001 } else { 1.0 };
        let radii: Vec<f64> =
            (0..count).map(|i| radius_m * if i % 2 == 0 { 1.0 } else { unequal }).collect();
        let packed = jammed_packing(&Region::new([size; 3], side), &radii, 3e-4, 1)?;
        region = packed.0;
        let shifts = (0..copies)
            .flat_map(|x| (0..copies).flat_map(move |y| (0..copies).map(move |z| [x, y, z])));
        for shift in shifts {
            for (position, &radius) in packed.1.iter().zip(&radii) {
                let at = |axis: usize| position[axis] + shift[axis] as f64 * region.size_m[axis];
                start.position_m.push([at(0), at(1), at(2)]);
                start.radius_m.push(radius);
            }
        }
        region.size_m = region.size_m.map(|size| size * copies as f64);
        if has("open") {
            region.sides = [Side::Open; 3];
        }
    }
    if has("stiff") {
        spec.k1 *= 100.0;
    }
    let friction = Friction {
        coefficient: 0.3,
        tangential_stiffness_over_k1: 2.0 / 7.0,
        tangential_damping_over_normal: 0.5,
    };
    let surroundings = Surroundings {
        region,
        gravity_m_per_s2: if has("gravity") { [0.0, 0.0, -1e-3] } else { [0.0; 3] },
        drag_viscosity_pa_s: if has("drag") { 1e-3 } else { 0.0 },
        friction: has("friction").then_some(friction),
    };
    let mut bed = Bed::new(Material::new(spec)?, surroundings, &start)?;
    let growing = Growing {
        kinetics: Kinetics::ThreeStage,
        sintering: Sintering { c1: 2.4e-5, tau_s: 3.81, delta_c: 9.5e-8 },
        calibrated_radius_m: radius_m,
    };
    bed.begin(&Drive { growing: has("sintering").then_some(growing), ..Drive::default() })?;
    Ok(bed)
}
