//! What a scene does not need, and what leaving it out saves: time, and where valgrind is installed the number of
//! instructions, which does not depend on what else the machine does.

use std::time::Duration;

use dem_core::bed::{Bed, Drive, Growing, Material as BedMaterial, Start, Surroundings};
use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolverKind, SolverSettings, contact_ratios,
};

use super::decided;
use super::instructions::{self, Counted};
use super::report::{self, Header, Table};
use super::timing::{Clock, Method, interleaved};
use crate::args::SavingsArgs;
use workbench::error::{Failure, RunError};
use workbench::experiment::Experiment;
use workbench::material::Material;
use workbench::number::significant;
use workbench::output;

/// What is run.
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

/// PS as it is measured, at the paper's parameters.
struct Setting {
    pair: PairSpec,
    scene: PairScene,
    sintering: Sintering,
    times_s: Vec<f64>,
}

impl Setting {
    fn new() -> Result<Self, Failure> {
        let experiment = Experiment::of_material(Material::Ps)?;
        let pair = PairSpec::new(experiment.powder, experiment.final_contact_ratio);
        let scene = pair.build().map_err(RunError::new)?;
        let times_s = experiment.observations(None)?.time_s;
        Ok(Self { pair, scene, sintering: Material::Ps.table3_sintering(), times_s })
    }

    /// Runs a scene once; the number of steps.
    fn run(&self, scene: Scene) -> Result<u64, RunError> {
        if scene == Scene::PairIn3d {
            return self.in_3d();
        }
        let halfway = self.times_s.partition_point(|&time| time <= 0.05);
        let run_on = [0.05, 0.11];
        let times_s = match scene {
            Scene::ToLast => &self.times_s[..halfway],
            Scene::BeyondLast => &run_on[..],
            _ => &self.times_s[..],
        };
        let mut out = vec![0.0; times_s.len()];
        contact_ratios(
            &self.scene,
            Kinetics::ThreeStage,
            &self.sintering,
            &scene.settings(),
            times_s,
            &mut out,
        )
        .map(|report| report.steps)
        .map_err(RunError::new)
    }

    fn in_3d(&self) -> Result<u64, RunError> {
        let steps = self.run(Scene::Pair)?;
        let radius_m = self.scene.radius_m();
        let distance_m = (2.0 - self.scene.x0()) * radius_m;
        let start = Start {
            // Off any axis, so that all three dimensions are there.
            position_m: vec![[0.0; 3], [0.6 * distance_m, 0.48 * distance_m, 0.64 * distance_m]],
            radius_m: vec![radius_m; 2],
            ..Start::default()
        };
        let material = BedMaterial::new(self.pair).map_err(RunError::new)?;
        let mut bed = Bed::new(material, Surroundings::NOTHING, &start).map_err(RunError::new)?;
        let growing = Growing {
            kinetics: Kinetics::ThreeStage,
            sintering: self.sintering,
            calibrated_radius_m: radius_m,
        };
        bed.begin(&Drive { growing: Some(growing), ..Drive::default() }).map_err(RunError::new)?;
        bed.advance(steps).map_err(RunError::new)?;
        std::hint::black_box(bed.time_s());
        Ok(steps)
    }
}

pub(super) fn run(args: &SavingsArgs) -> Result<(), Failure> {
    let setting = Setting::new()?;
    if let Some([scene, times]) = args.only.as_deref() {
        return only(&setting, scene, times);
    }
    report::folder(&args.out)?;
    let header = Header::now("cargo run --release -- bench savings");
    let mut methods: Vec<Method<'_>> = Scene::ALL
        .iter()
        .map(|&scene| {
            let setting = &setting;
            Box::new(move || {
                std::hint::black_box(setting.run(scene).is_ok());
            }) as Method<'_>
        })
        .collect();
    let timings = interleaved(Clock::Wall, &mut methods, 31, Duration::from_secs(2));
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
    for (left_out, when, with, without) in [
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
    ] {
        let (steps_with, steps_without) = (setting.run(with)?, setting.run(without)?);
        let counts = [with, without].map(instructions);
        let count =
            |count: Option<f64>| count.map_or("–".to_owned(), |count| significant(count, 4));
        table.push(vec![
            left_out.to_owned(),
            when.to_owned(),
            steps_with.to_string(),
            steps_without.to_string(),
            report::seconds(time(with)),
            report::seconds(time(without)),
            format!("{}×", significant(time(with) / time(without), 3)),
            count(counts[0]),
            count(counts[1]),
            match counts {
                [Some(with), Some(without)] => format!("{}×", significant(with / without, 3)),
                _ => "–".to_owned(),
            },
        ]);
    }
    output::write_file(&args.out.join("savings.csv"), table.csv(&header).as_bytes())?;
    let text = format!(
        "# What a scene does not need\n\n{}\nPS at the paper's parameters and observation times, one curve on one core; verlet with 0.02 t_c. \
         Times are medians over interleaved rounds; instructions are counted by valgrind's callgrind, as the difference \
         between many runs and few.\n\n{}\n## The rest of a curve whose weight is decided\n\n\
         The squared residuals so far bound the likelihood of the whole curve from above: they only grow. Where that bound puts a weight \
         below 2^-52/N of the largest, the rest of the curve cannot change the posterior. It is not left out: of the simulated time of a \
         calibration (16 384 simulations, seed 1) it is as much as the first column says in the final stage. Before that, tempering takes \
         likelihoods to powers far below 1 and needs them all; the second column says what the final weights alone would allow.\n\n{}",
        header.lines("- "),
        table.markdown(),
        decided::table()?.markdown()
    );
    output::write_file(&args.out.join("savings.md"), text.as_bytes())?;
    Ok(())
}

fn only(setting: &Setting, scene: &str, times: &str) -> Result<(), Failure> {
    let scene = Scene::ALL.into_iter().find(|known| known.name() == scene);
    let (Some(scene), Ok(times)) = (scene, times.parse::<u32>()) else {
        return Err(RunError::new("--only takes the name of a scene and a number").into());
    };
    for _ in 0..times {
        std::hint::black_box(setting.run(scene)?);
    }
    Ok(())
}

/// Instructions of one run, where callgrind is there to count them.
fn instructions(scene: Scene) -> Option<f64> {
    let times = if scene == Scene::ClosedForm { 1000 } else { 10 };
    instructions::of(&Counted { study: "savings", what: scene.name() }, times)
}
