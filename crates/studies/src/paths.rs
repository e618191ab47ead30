//! Time and instructions of the hot paths: what the simulator and the sampler spend their time in.

use std::hint::black_box;
use std::time::Duration;

use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios,
    verlet_batch,
};
use smc_calib::{Likelihood, Problem, Settings, bench_support, calibrate};

use super::instructions::{self, Counted};
use super::report::{self, Header, Table};
use super::timing::{Clock, Method, interleaved};
use crate::args::PathsArgs;
use workbench::args::RunArgs;
use workbench::error::{Failure, RunError};
use workbench::material::Material;
use workbench::model::NeckGrowth;
use workbench::number::significant;
use workbench::output;
use workbench::plan::{Plan, Planned};
use workbench::run;

/// Points of the benchmarks of the sampler.
const POINTS: usize = 10_000;
/// Curves of a batch.
const BATCH: usize = 32;

/// One hot path: what is done, how often a call does it, and the call.
struct Path<'a> {
    name: &'static str,
    unit: &'static str,
    count: f64,
    call: Method<'a>,
}

/// What the paths work on: polystyrene at the paper's parameters.
struct Setting {
    plan: Plan,
    model: NeckGrowth,
    likelihood: Likelihood,
    scene: PairScene,
    sintering: Sintering,
    times_s: Vec<f64>,
    bench: bench_support::Bench,
}

impl Setting {
    fn new() -> Result<Self, Failure> {
        let args = RunArgs { material: Some(Material::Ps), ..RunArgs::default() };
        let plan = Planned::from_args(&args)?.plan;
        let experiment = &plan.experiment;
        let powder = Material::Ps.powder();
        let pair = PairSpec::new(powder, experiment.final_contact_ratio);
        Ok(Self {
            model: NeckGrowth::of(&plan)?,
            likelihood: Likelihood::new(&plan.noise, &plan.observations()?)
                .map_err(RunError::new)?,
            scene: pair.build().map_err(RunError::new)?,
            sintering: Material::Ps.table3_sintering(),
            times_s: experiment.time_s.clone(),
            bench: bench_support::Bench::new(POINTS),
            plan,
        })
    }

    /// A curve at the times of the measurement.
    fn curve(&self, kinetics: Kinetics, sintering: &Sintering, settings: &SolverSettings) -> u64 {
        let mut out = vec![0.0; self.times_s.len()];
        contact_ratios(&self.scene, kinetics, sintering, settings, &self.times_s, &mut out)
            .map_or(0, |report| report.steps)
    }

    /// Steps of verlet, in a run that is nothing but steps.
    fn steps(&self, kinetics: Kinetics) -> u64 {
        let settings = SolverSettings {
            step_over_collision_time: 0.001,
            ..SolverSettings::of(SolverKind::Verlet)
        };
        let slow = Sintering { tau_s: 10.0 * self.sintering.tau_s, ..self.sintering };
        let mut out = [0.0];
        contact_ratios(&self.scene, kinetics, &slow, &settings, &[0.1], &mut out)
            .map_or(0, |report| report.steps)
    }

    /// The same of many curves at once.
    fn steps_of_a_batch(&self, kinetics: Kinetics) -> u64 {
        let settings = SolverSettings {
            step_over_collision_time: 0.001,
            ..SolverSettings::of(SolverKind::Verlet)
        };
        let sinterings: Vec<Sintering> = (0..BATCH)
            .map(|i| Sintering {
                tau_s: self.sintering.tau_s * (4.0 + 0.1 * i as f64),
                ..self.sintering
            })
            .collect();
        let times_s: Vec<f64> = self.times_s.iter().map(|time| 0.5 * time).collect();
        let mut out = vec![0.0; BATCH * times_s.len()];
        verlet_batch(&self.scene, kinetics, &sinterings, &settings, &times_s, &mut out)
            .map_or(0, |runs| runs.iter().map(|run| run.as_ref().map_or(0, |r| r.steps)).sum())
    }

    fn calibration(&self, samples: usize) -> bool {
        let Ok(observations) = self.plan.observations() else { return false };
        let problem = Problem {
            simulator: &self.model,
            parameters: self.plan.parameters.clone(),
            observations,
            noise: self.plan.noise.clone(),
        };
        let settings = Settings { samples, ..self.plan.sampler.clone() };
        calibrate(&problem, &settings, &mut ()).is_ok()
    }

    fn paths(&mut self) -> Vec<Path<'_>> {
        let (closed, quasi_static, verlet) = (
            SolverSettings::default(),
            SolverSettings::of(SolverKind::QuasiStatic),
            SolverSettings::of(SolverKind::Verlet),
        );
        // A knee later than the last time, so that every point needs a root.
        let slow = Sintering { c1: 1e-2 * self.sintering.c1, ..self.sintering };
        let (single, batch) = (
            self.steps(Kinetics::ThreeStage) as f64,
            self.steps_of_a_batch(Kinetics::ThreeStage) as f64,
        );
        let quasi_static_steps =
            self.curve(Kinetics::ThreeStage, &self.sintering, &quasi_static) as f64;
        let outputs: Vec<f64> = self.likelihood.values().iter().map(|v| v + 0.01).collect();
        let (points, fitted, cloud) =
            (POINTS as f64, bench_support::FITTED as f64, bench_support::CLOUD as f64);
        // The one loop that changes what it works on has a copy of its own.
        let mut em = bench_support::Bench::new(POINTS);
        let this = &*self;
        let curve = move |kinetics, sintering: Sintering, settings: SolverSettings| -> Method<'_> {
            Box::new(move || {
                black_box(this.curve(kinetics, black_box(&sintering), &settings));
            })
        };
        let path = |name, unit, count, call| Path { name, unit, count, call };
        use Kinetics::{Pokluda, ThreeStage};
        vec![
            path(
                "contact law, elastic branch",
                "call",
                1.0,
                Box::new(|| {
                    black_box(this.scene.law().respond(black_box(0.51), black_box(0.5)));
                }),
            ),
            path(
                "verlet, a single curve",
                "step",
                single,
                Box::new(|| {
                    black_box(this.steps(ThreeStage));
                }),
            ),
            path(
                "verlet, a batch of 32 curves",
                "step of a curve",
                batch,
                Box::new(|| {
                    black_box(this.steps_of_a_batch(ThreeStage));
                }),
            ),
            path(
                "verlet with 0.02 t_c, the curve of PS",
                "curve",
                1.0,
                curve(ThreeStage, this.sintering, verlet),
            ),
            path(
                "quasi-static to 1e-6, the curve of PS",
                "step",
                quasi_static_steps,
                curve(ThreeStage, this.sintering, quasi_static),
            ),
            path(
                "closed form, three-stage",
                "curve",
                1.0,
                curve(ThreeStage, this.sintering, closed),
            ),
            path(
                "closed form, all times before the knee",
                "curve",
                1.0,
                curve(ThreeStage, slow, closed),
            ),
            path("closed form, Pokluda", "curve", 1.0, curve(Pokluda, this.sintering, closed)),
            path(
                "likelihood recursion",
                "observation",
                outputs.len() as f64,
                Box::new({
                    let outputs = outputs.clone();
                    move || {
                        let mut sum = 0.0;
                        this.likelihood.recursion(black_box(&outputs), |_, ln| sum += ln);
                        black_box(sum);
                    }
                }),
            ),
            path(
                "joint likelihood",
                "observation",
                outputs.len() as f64,
                Box::new(move || {
                    black_box(this.likelihood.ln_joint(black_box(&outputs)));
                }),
            ),
            path(
                "drawing from the proposal, 3 dimensions",
                "point",
                points,
                Box::new(|| {
                    black_box(this.bench.draw());
                }),
            ),
            path(
                "mixture density, 5 components, 3 dimensions",
                "point and component",
                5.0 * points,
                Box::new(|| {
                    black_box(this.bench.density());
                }),
            ),
            path(
                "EM step, 5 components, 3 dimensions",
                "point and component",
                5.0 * cloud,
                Box::new(move || {
                    black_box(em.em_step());
                }),
            ),
            path(
                "fit of the surrogate to 4096 samples",
                "sample",
                fitted,
                Box::new(|| {
                    black_box(this.bench.fit_surrogate());
                }),
            ),
            path(
                "value of the surrogate",
                "point",
                points,
                Box::new(|| {
                    black_box(this.bench.surrogate());
                }),
            ),
            path(
                "calibration of PS, 4096 simulations",
                "simulation",
                4096.0,
                Box::new(|| {
                    black_box(this.calibration(4096));
                }),
            ),
            path(
                "calibration of PS, 16 384 simulations",
                "simulation",
                16_384.0,
                Box::new(|| {
                    black_box(this.calibration(16_384));
                }),
            ),
        ]
    }
}

pub(super) fn run(args: &PathsArgs) -> Result<(), Failure> {
    run::pool(Some(1))?.install(|| study(args))
}

fn study(args: &PathsArgs) -> Result<(), Failure> {
    let mut setting = Setting::new()?;
    let mut paths = setting.paths();
    if let Some([place, times]) = args.only.as_deref() {
        let (Ok(place), Ok(times)) = (place.parse::<usize>(), times.parse::<u32>()) else {
            return Err(RunError::new("--only takes two numbers").into());
        };
        let Some(path) = paths.get_mut(place) else { return Ok(()) };
        (0..times).for_each(|_| (path.call)());
        return Ok(());
    }
    report::folder(&args.out)?;
    let header = Header::now("cargo run --release -- bench paths");
    let (rows, mut calls): (Vec<_>, Vec<_>) =
        paths.into_iter().map(|path| ((path.name, path.unit, path.count), path.call)).unzip();
    let timings = interleaved(Clock::Thread, &mut calls, 31, Duration::from_secs(4));
    let mut table =
        Table::new(&["hot path", "processor time", "fastest quarter", "instructions", "of each"]);
    for (place, ((name, unit, count), timing)) in rows.into_iter().zip(&timings).enumerate() {
        let name_of = place.to_string();
        let counted = instructions::of(
            &Counted { study: "paths", what: &name_of },
            // Enough of a short call that what surrounds it does not count.
            if timing.median_s < 1e-4 { 1000 } else { 2 },
        );
        table.push(vec![
            name.to_owned(),
            report::seconds(timing.median_s / count),
            report::seconds(timing.lower_s / count),
            counted.map_or_else(|| "–".to_owned(), |n| significant(n / count, 4)),
            unit.to_owned(),
        ]);
    }
    output::write_file(&args.out.join("paths.csv"), table.csv(&header).as_bytes())?;
    let text = format!(
        "# Hot paths\n\n{}\nOne thread. Processor times are medians over interleaved rounds, and their lower quartiles: what else the \
         machine does only adds to them. Instructions are counted by valgrind's callgrind, as the difference between many \
         calls and few; they depend on the program alone.\n\n{}",
        header.lines("- "),
        table.markdown()
    );
    output::write_file(&args.out.join("paths.md"), text.as_bytes())?;
    Ok(())
}
