//! `scene.json`: the record of a scene that has run, and its summary.

use std::path::Path;

use dem_core::bed::{Law, Mode, NECKS_MEET, Phase, Run, Sample, Series, WhenNecksMeet};
use serde::Serialize;
use serde_json::Value;

use crate::careful::Careful;
use crate::input::scene_file::SceneInput;
use crate::number::significant;

/// Version of the layout of `scene.json`.
pub const SCHEMA_VERSION: u32 = 2;
/// Inertial number below which inertia is not felt.
const INERTIA_FELT: f64 = 1e-3;

/// Everything that decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScenePlan {
    /// Name of the scene.
    pub name: String,
    /// The scene itself.
    pub scene: Value,
    /// Whether a VTK file is written at every observation.
    pub vtk: bool,
    /// Version of this program.
    pub version: String,
}

/// A bed in a few numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct State {
    /// Time \[s\].
    pub time_s: f64,
    /// Relative density, mass over density and bed volume; none where the bed has no volume.
    pub relative_density: Option<f64>,
    /// Contacts per particle.
    pub coordination: f64,
    /// Mean contact ratio a/R.
    pub mean_contact_ratio: f64,
    /// Contact ratios below which 10, 50 and 90 % of the contacts lie.
    pub contact_ratio_deciles: [f64; 3],
    /// Mean over the contacts of the force that drives the growth, over fa.
    pub mean_driving: f64,
    /// Largest magnitude of that force, over fa.
    pub largest_driving: f64,
    /// Inertial number.
    pub inertial_number: f64,
    /// Share of the particles on which two necks meet.
    pub necks_meet: f64,
    /// The law of densification: of the contacts, of open or of closed pores. Under the closed laws all but time and
    /// density is as it was where the pairs ended.
    pub law: Law,
}

impl From<&Sample> for State {
    fn from(sample: &Sample) -> Self {
        Self {
            time_s: sample.time_s,
            relative_density: Some(sample.relative_density).filter(|density| density.is_finite()),
            coordination: sample.coordination,
            mean_contact_ratio: sample.mean_contact_ratio,
            contact_ratio_deciles: sample.contact_ratio_deciles,
            mean_driving: sample.mean_driving,
            largest_driving: sample.largest_driving,
            inertial_number: sample.inertial_number,
            necks_meet: sample.necks_meet,
            law: sample.law,
        }
    }
}

/// A phase as it went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseRecord {
    /// Name.
    pub name: String,
    /// `dynamic` or `quasi-static`.
    pub mode: &'static str,
    /// Whether contacts grew.
    pub heated: bool,
    /// When it began \[s\].
    pub start_s: f64,
    /// The bed at its end.
    pub end: State,
}

/// Work of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorkRecord {
    /// Steps with inertia.
    pub steps: u64,
    /// Neighbour lists that were built.
    pub neighbour_lists: u64,
    /// Quasi-static steps that were accepted.
    pub quasi_static_steps: u64,
    /// Quasi-static steps that were rejected.
    pub quasi_static_rejected: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Iterations of the conjugate gradients.
    pub conjugate_gradient_iterations: u64,
    /// Sum of the errors of a/R of all quasi-static steps.
    pub quasi_static_error: f64,
}

/// `scene.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneRecord {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Everything that decides the result.
    pub plan: ScenePlan,
    /// Number of particles.
    pub particles: usize,
    /// Number of observations.
    pub observations: usize,
    /// When the first heated phase began \[s\].
    pub heated_from_s: Option<f64>,
    /// The phases.
    pub phases: Vec<PhaseRecord>,
    /// The bed at the start.
    pub start: Option<State>,
    /// The bed at the end.
    pub end: Option<State>,
    /// Where the pairs end: necks meet on more than one particle in twenty, or the pores close.
    pub pairs_end: Option<State>,
    /// Load on a particle at the bottom over its adhesive force.
    pub load_over_adhesion: Option<f64>,
    /// Work of the run.
    pub work: WorkRecord,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

impl SceneRecord {
    /// The record of a run that has ended.
    pub(super) fn new(input: &SceneInput, plan: ScenePlan, run: &Run) -> Self {
        let series = run.series();
        let phases = input
            .file
            .phases
            .iter()
            .enumerate()
            .filter_map(|(index, phase)| {
                let end = series.phase.iter().rposition(|&of| of == index)?;
                Some(PhaseRecord {
                    name: phase.name.clone(),
                    mode: match phase.mode {
                        Mode::Dynamic => "dynamic",
                        Mode::QuasiStatic => "quasi-static",
                    },
                    heated: phase.heated,
                    start_s: *series.phase_start_s.get(index)?,
                    end: State::from(&series.samples[end]),
                })
            })
            .collect();
        let (work, report) = (run.bed().work(), &series.quasi_static);
        Self {
            schema_version: SCHEMA_VERSION,
            plan,
            particles: run.bed().particles().len(),
            observations: series.samples.len(),
            heated_from_s: heated_from_s(series, &input.file.phases),
            phases,
            start: series.samples.first().map(State::from),
            end: series.samples.last().map(State::from),
            pairs_end: series.hand_over.as_ref().map(State::from),
            load_over_adhesion: run.bed().load_over_adhesion(),
            work: WorkRecord {
                steps: work.steps,
                neighbour_lists: work.rebuilds,
                quasi_static_steps: report.steps,
                quasi_static_rejected: report.rejected,
                newton_iterations: report.newton,
                conjugate_gradient_iterations: report.conjugate_gradients,
                quasi_static_error: report.error_estimate,
            },
            advice: advice(input, series),
        }
    }

    /// The summary as text. `seconds` is how long the run took, `out` the folder of the results.
    pub fn text(&self, seconds: f64, out: &Path) -> String {
        let mut lines = vec![format!(
            "{}: {} particles, {} observations, in {} s",
            self.plan.name,
            self.particles,
            self.observations,
            significant(seconds, 2)
        )];
        if let Some(start) = &self.start {
            lines.push(format!("  start         {}", in_words(start)));
        }
        for phase in &self.phases {
            lines.push(format!("  {:<13} {}", phase.name, in_words(&phase.end)));
            if phase.heated {
                lines.push(format!(
                    "                driven by {} fa on average, {} at most, at t = {} s",
                    significant(phase.end.mean_driving, 3),
                    significant(phase.end.largest_driving, 3),
                    significant(phase.end.time_s, 3)
                ));
            }
        }
        if let Some(load) = self.load_over_adhesion {
            lines.push(format!(
                "  load          {} fa on a particle at the bottom",
                significant(load, 2)
            ));
        }
        let work = &self.work;
        let mut took = Vec::new();
        if work.steps > 0 {
            took.push(format!("{} steps", work.steps));
        }
        if work.quasi_static_steps > 0 {
            took.push(format!(
                "{} quasi-static steps (a/R within about {})",
                work.quasi_static_steps,
                significant(work.quasi_static_error, 1)
            ));
        }
        lines.push(format!("  work          {}", took.join(", ")));
        for line in &self.advice {
            lines.push(format!("  careful: {line}"));
        }
        lines.push(format!("  results in {}", out.display()));
        lines.push(String::new());
        lines.join("\n")
    }
}

/// When the first heated phase began.
pub(super) fn heated_from_s(series: &Series, phases: &[Phase]) -> Option<f64> {
    let first = phases.iter().position(|phase| phase.heated)?;
    series.phase_start_s.get(first).copied()
}

fn advice(input: &SceneInput, series: &Series) -> Vec<String> {
    let mut advice = Vec::new();
    let phases = &input.file.phases;
    // The first observation of a phase is of the contacts as they were placed.
    let inertial = series
        .samples
        .iter()
        .zip(&series.phase)
        .skip(1)
        .filter(|(sample, phase)| {
            let phase = &phases[**phase];
            phase.heated && phase.mode == Mode::Dynamic && sample.law == Law::Pairs
        })
        .map(|(sample, _)| sample.inertial_number)
        .fold(0.0, f64::max);
    if inertial > INERTIA_FELT {
        let felt = Careful::InertiaFelt { inertial_number: inertial, limit: INERTIA_FELT };
        advice.push(felt.to_string());
    }
    if let Some(end) = &series.hand_over {
        let (time_s, contact_ratio) = (end.time_s, end.mean_contact_ratio);
        let stops = input.file.sintering.as_ref().map(|table| table.when_necks_meet);
        let closed = series.samples.iter().any(|sample| sample.law != Law::Pairs);
        let then = match stops {
            Some(WhenNecksMeet::Stop) => "the run ended there",
            _ if closed => {
                "the density goes on by the laws of open and closed pores, and the contacts stay as they were"
            }
            _ => "the pairs go on without new contacts, and what follows is a trend",
        };
        let then = then.to_owned();
        let meet = Careful::NecksMeet { time_s, contact_ratio, limit: NECKS_MEET, then };
        advice.push(meet.to_string());
    }
    advice
}

fn in_words(state: &State) -> String {
    let density = state.relative_density.map_or_else(String::new, |density| {
        let by = match state.law {
            Law::Pairs => "",
            Law::Cell => " (open pores)",
            Law::Pores => " (closed pores)",
        };
        format!("density {}{by}, ", significant(density, 4))
    });
    format!(
        "{density}coordination {}, a/R {} ({} .. {})",
        significant(state.coordination, 3),
        significant(state.mean_contact_ratio, 3),
        significant(state.contact_ratio_deciles[0], 3),
        significant(state.contact_ratio_deciles[2], 3),
    )
}
