//! Run time against error of the two ways to sinter a bed within reason: mass scaling and the quasi-static mode, both
//! against the run with the true masses.
//!
//! `bed_accuracy [FOLDER] [END_S] [SEED]` (results/bed, 0.5 s, packing 1) settles a bed of 100 PA12 particles under gravity and heats it in all
//! ways from the same state; it writes `accuracy.csv` and `accuracy.md`.
#![allow(clippy::print_stdout, reason = "this is what it is for")]

use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

use dem_core::bed::{
    Bed, BedError, Drive, Growing, Material, QuasiStaticReport, QuasiStaticSettings, Region,
    Sample, Side, Start, Surroundings, inertia_error, random_packing,
};
use dem_core::{Kinetics, PairSpec, Sintering, paper};

const COUNT: usize = 100;
/// A bottom particle carries 0.03 fa.
const K1_N_PER_M: f64 = 6.0;
const OBSERVATIONS: u32 = 20;
/// One more observation early, where growth is fastest: after this share of the time between two.
const EARLY: f64 = 0.2;

/// A run in one way.
struct Run {
    way: &'static str,
    setting: f64,
    seconds: f64,
    steps: u64,
    claimed: f64,
    samples: Vec<Sample>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let folder = arguments.get(1).map_or("results/bed", String::as_str);
    let end_s: f64 = arguments.get(2).map_or(Ok(0.5), |text| text.parse())?;
    let seed: u64 = arguments.get(3).map_or(Ok(1), |text| text.parse())?;
    let settled = settled(seed)?;
    let mut runs = Vec::new();
    for mass_scaling in [1.0, 10.0, 1e2, 1e3, 1e4, 1e5] {
        runs.push(scaled(&settled, mass_scaling, end_s)?);
        print(&runs);
    }
    for tolerance in [1e-2, 3e-3, 1e-3, 3e-4, 1e-4] {
        runs.push(quasi_static(&settled, tolerance, end_s)?);
        print(&runs);
    }
    write(Path::new(folder), &runs, end_s)
}

/// A bed that has settled and rests, in contacts that have not grown.
fn settled(seed: u64) -> Result<Bed, Box<dyn Error>> {
    let radius_m = paper::PA12.radius_m;
    let side = 10.0 * radius_m;
    let sides = [Side::Periodic, Side::Periodic, Side::LowerWall];
    let solid = COUNT as f64 * 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
    let region = Region { size_m: [side, side, solid / (0.55 * side * side)], sides };
    let position_m = random_packing(&region, &[radius_m; COUNT], seed)?;
    let start = Start { position_m, radius_m: vec![radius_m; COUNT], ..Start::default() };
    let around = Surroundings {
        region,
        gravity_m_per_s2: [0.0, 0.0, -9.81],
        drag_viscosity_pa_s: 2e-4,
        ..Surroundings::NOTHING
    };
    let mut spec = PairSpec::new(paper::PA12, 2f64.cbrt());
    spec.k1 = K1_N_PER_M;
    let mut bed = Bed::new(Material::new(spec)?, around, &start)?;
    bed.begin(&Drive::default())?;
    bed.advance((0.05 / bed.step_s()) as u64)?;
    let now_s = bed.time_s();
    let settings = QuasiStaticSettings::default();
    bed.advance_quasi_static(now_s, &settings, &mut QuasiStaticReport::default())?;
    Ok(bed)
}

fn drive(mass_scaling: f64) -> Drive {
    let growing = Growing {
        kinetics: Kinetics::ThreeStage,
        sintering: Sintering { c1: 1.177e-5, tau_s: 3.81, delta_c: 9.55e-8 },
        calibrated_radius_m: paper::PA12.radius_m,
    };
    Drive { growing: Some(growing), mass_scaling, ..Drive::default() }
}

fn scaled(settled: &Bed, mass_scaling: f64, end_s: f64) -> Result<Run, BedError> {
    let mut bed = settled.clone();
    bed.begin(&drive(mass_scaling))?;
    let every_s = end_s / f64::from(OBSERVATIONS);
    let each = (every_s / bed.step_s()).round() as u64;
    let (before, before_steps) = (cpu_seconds(), bed.work().steps);
    let early = (EARLY * each as f64) as u64;
    bed.advance(early)?;
    let mut samples = vec![bed.sample()];
    let mut chance = bed.chance_of_mean_contact_ratio();
    for output in 0..OBSERVATIONS {
        bed.advance(if output == 0 { each - early } else { each })?;
        samples.push(bed.sample());
        chance = chance.max(bed.chance_of_mean_contact_ratio());
    }
    Ok(Run {
        way: if mass_scaling == 1.0 { "true masses" } else { "mass scaling" },
        setting: mass_scaling,
        seconds: cpu_seconds() - before,
        steps: bed.work().steps - before_steps,
        claimed: inertia_error(&samples) + 2.0 * chance,
        samples,
    })
}

fn quasi_static(settled: &Bed, tolerance: f64, end_s: f64) -> Result<Run, BedError> {
    let mut bed = settled.clone();
    bed.begin(&drive(1.0))?;
    let start_s = bed.time_s();
    let settings = QuasiStaticSettings { tolerance, ..QuasiStaticSettings::default() };
    let before = cpu_seconds();
    let mut report = QuasiStaticReport::default();
    let mut samples = Vec::new();
    let mut chance: f64 = 0.0;
    for output in 0..=OBSERVATIONS {
        let output = if output == 0 { EARLY } else { f64::from(output) };
        let until_s = start_s + end_s * output / f64::from(OBSERVATIONS);
        bed.advance_quasi_static(until_s, &settings, &mut report)?;
        samples.push(bed.sample());
        chance = chance.max(bed.chance_of_mean_contact_ratio());
    }
    Ok(Run {
        way: "quasi-static",
        setting: tolerance,
        seconds: cpu_seconds() - before,
        steps: report.steps,
        claimed: report.error_estimate + 2.0 * chance,
        samples,
    })
}

/// Largest differences of the mean contact ratio and of the relative density.
fn found(run: &Run, reference: &Run) -> [f64; 2] {
    run.samples.iter().zip(&reference.samples).fold([0.0, 0.0], |[a, b], (one, other)| {
        [
            f64::max(a, (one.mean_contact_ratio - other.mean_contact_ratio).abs()),
            f64::max(b, (one.relative_density - other.relative_density).abs()),
        ]
    })
}

fn largest_inertial_number(run: &Run) -> f64 {
    run.samples.iter().map(|sample| sample.inertial_number).fold(0.0, f64::max)
}

fn print(runs: &[Run]) {
    if let Some(run) = runs.last() {
        let [ratio, density] = found(run, &runs[0]);
        println!(
            "{} {:e}: {:.2} s, {} steps, I {:.1e}, error of a/R {ratio:.1e} (claimed {:.1e}), of the density {density:.1e}",
            run.way,
            run.setting,
            run.seconds,
            run.steps,
            largest_inertial_number(run),
            run.claimed,
        );
    }
}

fn write(folder: &Path, runs: &[Run], end_s: f64) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let mut csv = String::from(
        "way,setting,seconds,steps,largest_inertial_number,claimed_error,contact_ratio_error,density_error\n",
    );
    let mut table = format!(
        "# Run time against error\n\n\
         {COUNT} PA12 particles, settled under gravity with K1 = {K1_N_PER_M} N/m, heated for {end_s} s with Table 3's \
         parameters (three stages; the knee of a pair is at 0.31 s). Errors are the largest differences, over \
         {OBSERVATIONS} observations, from the run with the true masses; time is that of one core.\n\n\
         The claimed error is about the mean contact ratio: `inertia_error` of the observations \
         where inertia is followed, `QuasiStaticReport::error_estimate` in the quasi-static mode, and to either twice \
         `Bed::chance_of_mean_contact_ratio`: two runs of so few particles that differ by next to nothing part ways where \
         contacts are made in another order. With 1.2 and 1.5 times the true masses, whose inertia is \
         nothing, a/R is off by 1.2e-3 and 3.0e-3.\n\n\
         | way | setting | core seconds | faster by | steps | inertial number | claimed | a/R | density |\n\
         |---|---|---|---|---|---|---|---|---|\n"
    );
    for run in runs {
        let [ratio, density] = found(run, &runs[0]);
        let number = largest_inertial_number(run);
        let (way, setting, steps, claimed) = (run.way, run.setting, run.steps, run.claimed);
        let seconds = run.seconds;
        writeln!(
            csv,
            "{way},{setting:e},{seconds:.3},{steps},{number:e},{claimed:e},{ratio:e},{density:e}"
        )?;
        let faster = runs[0].seconds / seconds;
        writeln!(
            table,
            "| {way} | {setting:e} | {seconds:.2} | {faster:.0} | {steps} | {number:.1e} | {claimed:.1e} | {ratio:.1e} | {density:.1e} |"
        )?;
    }
    let last = runs[0].samples.last();
    if let Some(last) = last {
        writeln!(
            table,
            "\nAt the end, with the true masses: a/R {:.4}, relative density {:.4}, coordination {:.2}, driving factor \
             {:.3} on average, {:.2} at most.\n\n\
             Made by `cargo run --release -p dem-core --example bed_accuracy`.",
            last.mean_contact_ratio,
            last.relative_density,
            last.coordination,
            last.mean_driving,
            last.largest_driving,
        )?;
    }
    std::fs::write(folder.join("accuracy.csv"), csv)?;
    std::fs::write(folder.join("accuracy.md"), table)?;
    Ok(())
}

/// Time that this process has run, where Linux says so; other programs do not count.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let nanoseconds = threads.flatten().filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    });
    1e-9 * nanoseconds.sum::<f64>()
}
