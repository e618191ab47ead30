//! Time and instructions of the hot paths: what the simulator and the sampler spend their time in.

use std::hint::black_box;
use std::time::Duration;

use dem_core::{Kinetics, Sintering, SolverKind, SolverSettings, contact_ratios, verlet_batch};
use smc_calib::{Settings, reference, sample_density};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;
use workbench::number::significant;

use crate::args::OnlyArgs;
use crate::instructions::Counted;
use crate::pair::{Calibration, Pair, verlet};
use crate::report::{self, Report, Table};
use crate::seeds::threads;
use crate::timing::{Clock, Method, interleaved};

/// Curves of a batch.
const BATCH: usize = 32;
const SIMULATION: &str = "simulation";

/// A hot path: what is done, how often a call does it, and the call.
struct Path<'a> {
    name: &'static str,
    unit: &'static str,
    count: f64,
    call: Method<'a>,
}

impl<'a> Path<'a> {
    fn new<T>(
        name: &'static str,
        unit: &'static str,
        count: f64,
        mut call: impl FnMut() -> T + 'a,
    ) -> Self {
        let call = Box::new(move || {
            black_box(call());
        });
        Self { name, unit, count, call }
    }
}

/// Polystyrene at the paper's parameters, on which the paths work.
struct Setting {
    pair: Pair,
    calibration: Calibration,
}

impl Setting {
    fn new() -> Result<Self, Failure> {
        Ok(Self { pair: Pair::of(Material::Ps)?, calibration: Calibration::of(Material::Ps)? })
    }

    /// A curve at the times of the measurement; the number of steps.
    fn curve(&self, kinetics: Kinetics, sintering: &Sintering, settings: &SolverSettings) -> u64 {
        let Pair { scene, times_s, .. } = &self.pair;
        let mut out = vec![0.0; times_s.len()];
        contact_ratios(scene, kinetics, sintering, settings, times_s, &mut out)
            .map_or(0, |report| report.steps)
    }

    /// Steps of verlet, in a run that is nothing but steps.
    fn steps(&self) -> u64 {
        let Pair { scene, sintering, .. } = &self.pair;
        let slow = Sintering { tau_s: 10.0 * sintering.tau_s, ..*sintering };
        let mut out = [0.0];
        contact_ratios(scene, Kinetics::ThreeStage, &slow, &verlet(0.001), &[0.1], &mut out)
            .map_or(0, |report| report.steps)
    }

    /// The same of many curves at once.
    fn steps_of_a_batch(&self) -> u64 {
        let Pair { scene, sintering, times_s, .. } = &self.pair;
        let slower =
            |i: usize| Sintering { tau_s: sintering.tau_s * (4.0 + 0.1 * i as f64), ..*sintering };
        let sinterings: Vec<Sintering> = (0..BATCH).map(slower).collect();
        let times_s: Vec<f64> = times_s.iter().map(|time| 0.5 * time).collect();
        let mut out = vec![0.0; BATCH * times_s.len()];
        let kinetics = Kinetics::ThreeStage;
        verlet_batch(scene, kinetics, &sinterings, &verlet(0.001), &times_s, &mut out)
            .map_or(0, |runs| runs.iter().map(|run| run.as_ref().map_or(0, |r| r.steps)).sum())
    }

    fn paths(&self) -> Vec<Path<'_>> {
        let mut paths = self.of_the_simulator();
        paths.extend(self.of_the_likelihood());
        paths.extend(self.of_the_sampler());
        paths
    }

    fn of_the_simulator(&self) -> Vec<Path<'_>> {
        use Kinetics::{Pokluda, ThreeStage};
        let (closed, quasi_static, coarse) = (
            SolverSettings::default(),
            SolverSettings::of(SolverKind::QuasiStatic),
            SolverSettings::of(SolverKind::Verlet),
        );
        let sintering = self.pair.sintering;
        // A knee later than the last time, so that every point needs a root.
        let slow = Sintering { c1: 1e-2 * sintering.c1, ..sintering };
        let (single, batch) = (self.steps() as f64, self.steps_of_a_batch() as f64);
        let quasi_static_steps = self.curve(ThreeStage, &sintering, &quasi_static) as f64;
        let curve = move |kinetics, sintering: Sintering, settings: SolverSettings| {
            move || self.curve(kinetics, black_box(&sintering), &settings)
        };
        let law = self.pair.scene.law();
        vec![
            Path::new("contact law, elastic branch", "call", 1.0, move || {
                law.respond(black_box(0.51), black_box(0.5))
            }),
            Path::new("verlet, a single curve", "step", single, || self.steps()),
            Path::new("verlet, a batch of 32 curves", "step of a curve", batch, || {
                self.steps_of_a_batch()
            }),
            Path::new(
                "verlet with 0.02 t_c, the curve of PS",
                "curve",
                1.0,
                curve(ThreeStage, sintering, coarse),
            ),
            Path::new(
                "quasi-static to 1e-6, the curve of PS",
                "step",
                quasi_static_steps,
                curve(ThreeStage, sintering, quasi_static),
            ),
            Path::new(
                "closed form, three-stage",
                "curve",
                1.0,
                curve(ThreeStage, sintering, closed),
            ),
            Path::new(
                "closed form, all times before the knee",
                "curve",
                1.0,
                curve(ThreeStage, slow, closed),
            ),
            Path::new("closed form, Pokluda", "curve", 1.0, curve(Pokluda, sintering, closed)),
        ]
    }

    fn of_the_likelihood(&self) -> Vec<Path<'_>> {
        let likelihood = &self.calibration.likelihood;
        let outputs: Vec<f64> = likelihood.values().iter().map(|v| v + 0.01).collect();
        let (count, same) = (outputs.len() as f64, outputs.clone());
        vec![
            Path::new("likelihood recursion", "observation", count, move || {
                let mut sum = 0.0;
                likelihood.recursion(black_box(&outputs), |_, ln| sum += ln);
                sum
            }),
            Path::new("joint likelihood", "observation", count, move || {
                likelihood.ln_joint(black_box(&same))
            }),
        ]
    }

    fn of_the_sampler(&self) -> Vec<Path<'_>> {
        let all = Settings { samples: 16_384, ..Settings::default() };
        // A short final stage has no surrogate as control variate.
        let no_surrogate = Settings { final_share: 0.1, ..all.clone() };
        let one_component = Settings { max_components: 1, patches: 0, ..no_surrogate.clone() };
        let gaussian = |settings| {
            let target = reference::gaussian(3, 0.8, 0.1);
            move || sample_density(&target, &settings).is_ok()
        };
        let calibrated = |samples: usize| move || self.calibration.posterior(samples, 1).is_ok();
        let (few, many) = (4096.0, 16_384.0);
        vec![
            Path::new("sampler on a Gaussian in 3 dimensions", SIMULATION, many, gaussian(all)),
            Path::new("the same without surrogate", SIMULATION, many, gaussian(no_surrogate)),
            Path::new(
                "the same without surrogate, one component",
                SIMULATION,
                many,
                gaussian(one_component),
            ),
            Path::new("calibration of PS, 4096 simulations", SIMULATION, few, calibrated(4096)),
            Path::new(
                "calibration of PS, 16 384 simulations",
                SIMULATION,
                many,
                calibrated(16_384),
            ),
        ]
    }
}

const TEXT: &str = "\
One thread. Processor times are medians over interleaved rounds, and their lower quartiles: other load on the machine
only adds to them. Instructions are counted by valgrind's callgrind, as the difference between many calls and few; they
depend on the program alone.
";

pub(crate) fn run(args: &OnlyArgs, out: &std::path::Path) -> Result<(), Failure> {
    threads(1)?.install(|| study(args, out))
}

fn study(args: &OnlyArgs, out: &std::path::Path) -> Result<(), Failure> {
    let setting = Setting::new()?;
    let mut paths = setting.paths();
    if let Some([place, times]) = args.only.as_deref() {
        let (Ok(place), Ok(times)) = (place.parse::<usize>(), times.parse::<u32>()) else {
            return Err(RunError::new("--only takes two numbers").into());
        };
        let Some(path) = paths.get_mut(place) else { return Ok(()) };
        (0..times).for_each(|_| (path.call)());
        return Ok(());
    }
    let report = Report::begin(out, "paths")?;
    let (rows, mut calls): (Vec<_>, Vec<_>) =
        paths.into_iter().map(|path| ((path.name, path.unit, path.count), path.call)).unzip();
    let timings = interleaved(Clock::Thread, &mut calls, 31, Duration::from_secs(4));
    let mut table =
        Table::new(&["hot path", "processor time", "fastest quarter", "instructions", "of each"]);
    for (place, ((name, unit, count), timing)) in rows.into_iter().zip(&timings).enumerate() {
        // Enough of a short call that the start of the program does not count.
        let times = if timing.median_s < 1e-4 { 1000 } else { 2 };
        let counted = Counted { study: "paths", part: &place.to_string() }.instructions(times);
        table.push(vec![
            name.to_owned(),
            report::seconds(timing.median_s / count),
            report::seconds(timing.lower_s / count),
            counted.map_or_else(|| "–".to_owned(), |n| significant(n / count, 4)),
            unit.to_owned(),
        ]);
    }
    report.table(&table)?;
    Ok(report.page("Hot paths", &format!("{TEXT}\n{}", table.markdown()))?)
}
