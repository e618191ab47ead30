//! Time saved by omitting the parts that a scene does not need, and where valgrind is installed the number of
//! instructions, which does not depend on what else the machine does.

use std::path::Path;
use std::time::Duration;

use dem_core::bed::{Bed, Drive, Growing, Material as BedMaterial, Start, Surroundings};
use dem_core::{Kinetics, SolverKind, SolverSettings, contact_ratios};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;
use workbench::number::significant;

use crate::args::OnlyArgs;
use crate::decided;
use crate::instructions::Counted;
use crate::pair::Pair;
use crate::report::{self, Report, Table};
use crate::timing::{Clock, Method, Timing, interleaved};

/// A way to run the pair of PS at the paper's parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scene {
    /// One relative coordinate, by verlet with 0.02 t_c, up to the last observation or coalescence.
    Pair,
    /// The same steps of the same physics by the engine for beds: both particles, three dimensions.
    PairIn3d,
    /// One relative coordinate, run on after full coalescence.
    BeyondCoalescence,
    /// One relative coordinate, run on to full coalescence though the measurement ends halfway there.
    BeyondLast,
    /// Up to that halfway observation.
    ToLast,
    /// Force balance instead of motion, to 1e-6.
    QuasiStatic,
    /// The exact solution.
    ClosedForm,
}

impl Scene {
    const ALL: [Self; 7] = [
        Self::Pair,
        Self::PairIn3d,
        Self::BeyondCoalescence,
        Self::BeyondLast,
        Self::ToLast,
        Self::QuasiStatic,
        Self::ClosedForm,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Pair => "pair",
            Self::PairIn3d => "pair-in-3d",
            Self::BeyondCoalescence => "beyond-coalescence",
            Self::BeyondLast => "beyond-last",
            Self::ToLast => "to-last",
            Self::QuasiStatic => "quasi-static",
            Self::ClosedForm => "closed-form",
        }
    }

    fn settings(self) -> SolverSettings {
        match self {
            Self::QuasiStatic => SolverSettings::of(SolverKind::QuasiStatic),
            Self::ClosedForm => SolverSettings::default(),
            Self::BeyondCoalescence => SolverSettings {
                stop_when_coalesced: false,
                ..SolverSettings::of(SolverKind::Verlet)
            },
            _ => SolverSettings::of(SolverKind::Verlet),
        }
    }
}

/// Runs a scene once; the number of steps.
fn simulate(pair: &Pair, scene: Scene) -> Result<u64, RunError> {
    if scene == Scene::PairIn3d {
        return in_3d(pair);
    }
    let halfway = pair.times_s.partition_point(|&time| time <= 0.05);
    let run_on = [0.05, 0.11];
    let times_s = match scene {
        Scene::ToLast => &pair.times_s[..halfway],
        Scene::BeyondLast => &run_on[..],
        _ => &pair.times_s[..],
    };
    let mut out = vec![0.0; times_s.len()];
    let kinetics = Kinetics::ThreeStage;
    contact_ratios(&pair.scene, kinetics, &pair.sintering, &scene.settings(), times_s, &mut out)
        .map(|report| report.steps)
        .map_err(RunError::new)
}

fn in_3d(pair: &Pair) -> Result<u64, RunError> {
    let steps = simulate(pair, Scene::Pair)?;
    let radius_m = pair.scene.radius_m();
    let distance_m = (2.0 - pair.scene.x0()) * radius_m;
    let start = Start {
        // Off any axis, so that all three dimensions are there.
        position_m: vec![[0.0; 3], [0.6 * distance_m, 0.48 * distance_m, 0.64 * distance_m]],
        radius_m: vec![radius_m; 2],
        ..Start::default()
    };
    let material = BedMaterial::new(pair.spec).map_err(RunError::new)?;
    let mut bed = Bed::new(material, Surroundings::NOTHING, &start).map_err(RunError::new)?;
    let growing = Growing {
        kinetics: Kinetics::ThreeStage,
        sintering: pair.sintering,
        calibrated_radius_m: radius_m,
    };
    bed.begin(&Drive { growing: Some(growing), ..Drive::default() }).map_err(RunError::new)?;
    bed.advance(steps).map_err(RunError::new)?;
    std::hint::black_box(bed.time_s());
    Ok(steps)
}

/// Omitted parts, the conditions for omitting them, and the scenes with and without each.
const LEFT_OUT: [(&str, &str, Scene, Scene); 5] = [
    (
        "three dimensions, the motion of both particles, neighbour lists",
        "in a pair scene: one relative coordinate is the same physics",
        Scene::PairIn3d,
        Scene::Pair,
    ),
    (
        "the time after full coalescence",
        "plastic overlap at its end and the pair at rest",
        Scene::BeyondCoalescence,
        Scene::Pair,
    ),
    (
        "the time after the last observation",
        "a measurement that ends at 0.05 s, the pair coalesces at 0.09 s",
        Scene::BeyondLast,
        Scene::ToLast,
    ),
    (
        "motion",
        "where the quasi-static limit is what is calibrated; to 1e-6",
        Scene::Pair,
        Scene::QuasiStatic,
    ),
    ("integration", "kinetics with an exact solution", Scene::QuasiStatic, Scene::ClosedForm),
];

const TEXT: &str = "\
PS at the paper's parameters and observation times, one curve on one core; verlet with 0.02 t_c. Times are medians over
interleaved rounds; instructions are counted by valgrind's callgrind, as the difference between many runs and few.
";

const DECIDED: &str = "\
## The rest of a curve whose weight is decided

The squared residuals so far bound the likelihood of the whole curve from above: they only grow. Where that bound puts a
weight below 2^-52/N of the largest, the rest of the curve cannot change the posterior. It is not left out. Its share of the
simulated time of a calibration (16 384 simulations, seed 1) is in the first column for the final stage. Before that,
tempering takes likelihoods to powers far below 1 and needs them all; the second column is what the final weights
alone would allow.
";

pub(crate) fn run(args: &OnlyArgs, out: &Path) -> Result<(), Failure> {
    let pair = Pair::of(Material::Ps)?;
    if let Some([scene, times]) = args.only.as_deref() {
        return only(&pair, scene, times);
    }
    let report = Report::begin(out, "savings")?;
    let mut methods: Vec<Method<'_>> = Scene::ALL
        .iter()
        .map(|&scene| {
            let pair = &pair;
            Box::new(move || {
                std::hint::black_box(simulate(pair, scene).is_ok());
            }) as Method<'_>
        })
        .collect();
    let timings = interleaved(Clock::Wall, &mut methods, 31, Duration::from_secs(2));
    let table = table(&pair, &timings)?;
    report.table(&table)?;
    let text = format!("{TEXT}\n{}\n{DECIDED}\n{}", table.markdown(), decided::table()?.markdown());
    Ok(report.page("What a scene does not need", &text)?)
}

fn table(pair: &Pair, timings: &[Timing]) -> Result<Table, RunError> {
    let mut table = Table::new(&[
        "left out",
        "when",
        "steps with",
        "steps without",
        "time with",
        "time without",
        "saves (time)",
        "instructions with",
        "instructions without",
        "saves (instructions)",
    ]);
    let time = |scene: Scene| timings[scene as usize].median_s;
    let missing = || "–".to_owned();
    for (left_out, when, with, without) in LEFT_OUT {
        let counts = [with, without].map(instructions);
        let count = |count: Option<f64>| count.map_or_else(missing, |count| significant(count, 4));
        let ratio = |with: f64, without: f64| format!("{}×", significant(with / without, 3));
        table.push(vec![
            left_out.to_owned(),
            when.to_owned(),
            simulate(pair, with)?.to_string(),
            simulate(pair, without)?.to_string(),
            report::seconds(time(with)),
            report::seconds(time(without)),
            ratio(time(with), time(without)),
            count(counts[0]),
            count(counts[1]),
            counts[0].zip(counts[1]).map_or_else(missing, |(with, without)| ratio(with, without)),
        ]);
    }
    Ok(table)
}

fn only(pair: &Pair, scene: &str, times: &str) -> Result<(), Failure> {
    let scene = Scene::ALL.into_iter().find(|known| known.name() == scene);
    let (Some(scene), Ok(times)) = (scene, times.parse::<u32>()) else {
        return Err(RunError::new("--only takes the name of a scene and a number").into());
    };
    for _ in 0..times {
        std::hint::black_box(simulate(pair, scene)?);
    }
    Ok(())
}

/// Instructions of one run, where callgrind is installed.
fn instructions(scene: Scene) -> Option<f64> {
    let times = if scene == Scene::ClosedForm { 1000 } else { 10 };
    Counted { study: "savings", part: scene.name() }.instructions(times)
}
