//! `scene.json`: the record of a scene that has run, and its summary.

use std::path::Path;

use dem_core::bed::{EndRates, Law, Mode, NECKS_MEET, Phase, Run, Sample, Series, WhenNecksMeet};
use dem_core::heat::Heat;
use serde::Serialize;
use serde_json::Value;

use crate::careful::Careful;
use crate::input::scene_file::SceneInput;
use crate::number::significant;
use crate::pair::heat::{GrowthSeen, HeatPlan};

/// Version of the layout of `scene.json`.
pub const SCHEMA_VERSION: u32 = 2;
/// Inertial number below which inertia is not felt.
const INERTIA_FELT: f64 = 1e-3;
/// Overlap by adhesion alone, fa/(K1 R), below which K1 hardly decides how a bed settles (study `bed-settling`).
const SOFT: f64 = 2e-3;
/// Relative difference of the rates before and after the hand-over that is mentioned.
const RATES_DIFFER: f64 = 0.2;

/// Everything that decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScenePlan {
    /// Name of the scene.
    pub name: String,
    /// The scene itself, but for its heat.
    pub scene: Value,
    /// The heat of the bed; none at the temperature of its parameters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heat: Option<HeatPlan>,
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
    /// Loading stiffness K1 that it was run with \[N/m\].
    pub k1_n_per_m: f64,
    /// Lengths of the box as the phase before left them \[m\]; none without a box.
    pub box_before_m: Option<[f64; 3]>,
    /// Lengths of the box at its first observation, with contacts of its stiffness \[m\].
    pub box_m: Option<[f64; 3]>,
    /// The bed at its first observation.
    pub begin: State,
    /// The bed at its end.
    pub end: State,
}

/// Rates of the relative density where the pairs end, per tau_s of a particle of the mean volume.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RatesRecord {
    /// By the contacts, over the next 0.02 tau_s.
    pub by_pairs_per_tau_s: f64,
    /// By the law of open or closed pores that follows.
    pub by_closed_law_per_tau_s: f64,
}

impl From<&EndRates> for RatesRecord {
    fn from(rates: &EndRates) -> Self {
        Self { by_pairs_per_tau_s: rates.by_pairs, by_closed_law_per_tau_s: rates.by_closed_law }
    }
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
    /// How much of the growth of its heat the run has seen; none without heat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub growth: Option<GrowthSeen>,
    /// The phases.
    pub phases: Vec<PhaseRecord>,
    /// The bed at the start.
    pub start: Option<State>,
    /// The bed at the end.
    pub end: Option<State>,
    /// Where the pairs end: necks meet on more than one particle in twenty, or the pores close.
    pub pairs_end: Option<State>,
    /// The rates there before and after, where a closed law follows.
    pub pairs_end_rates: Option<RatesRecord>,
    /// Load on a particle at the bottom over its adhesive force.
    pub load_over_adhesion: Option<f64>,
    /// Work of the run.
    pub work: WorkRecord,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

impl SceneRecord {
    /// The record of a run that has ended.
    pub(super) fn new(input: &SceneInput, plan: ScenePlan, run: &Run, heat: Option<&Heat>) -> Self {
        let series = run.series();
        let heated_from_s = heated_from_s(series, &input.file.phases);
        let heated_s = series.samples.last().map(|end| end.time_s - heated_from_s.unwrap_or(0.0));
        let phases = (0..input.file.phases.len())
            .filter_map(|index| PhaseRecord::of(input, series, index))
            .collect();
        let (work, report) = (run.bed().work(), &series.quasi_static);
        Self {
            schema_version: SCHEMA_VERSION,
            plan,
            particles: run.bed().particles().len(),
            observations: series.samples.len(),
            heated_from_s,
            growth: heat
                .zip(heated_s)
                .map(|(heat, end_s)| GrowthSeen::of(heat, &input.heated_s(end_s))),
            phases,
            start: series.samples.first().map(State::from),
            end: series.samples.last().map(State::from),
            pairs_end: series.hand_over.as_ref().map(State::from),
            pairs_end_rates: series.end_rates.as_ref().map(RatesRecord::from),
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
            advice: advice(input, run),
        }
    }

    /// The summary as text, where the run has just ended with how long it took \[s\] and the folder of the results.
    pub fn text(&self, ended: Option<(f64, &Path)>) -> String {
        let took = ended.map_or_else(String::new, |(s, _)| format!(", in {} s", significant(s, 2)));
        let mut lines = vec![format!(
            "{}: {} particles, {} observations{took}",
            self.plan.name, self.particles, self.observations
        )];
        if let Some(start) = &self.start {
            lines.push(format!("  start         {}", in_words(start)));
        }
        for phase in &self.phases {
            lines.push(format!("  {:<13} {}", phase.name, in_words(&phase.end)));
            lines.push(format!("                {}", phase.stiffness_in_words()));
            if phase.heated {
                lines.push(format!(
                    "                driven by {} fa on average, {} at most, at t = {} s",
                    significant(phase.end.mean_driving, 3),
                    significant(phase.end.largest_driving, 3),
                    significant(phase.end.time_s, 3)
                ));
            }
        }
        lines.extend(self.heat_in_words().map(|heat| format!("  heat          {heat}")));
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
        lines.extend(ended.map(|(_, out)| format!("  results in {}", out.display())));
        lines.push(String::new());
        lines.join("\n")
    }
}

impl SceneRecord {
    /// The heat and how much of it the run has seen.
    pub(super) fn heat_in_words(&self) -> Option<String> {
        let (heat, growth) = (self.plan.heat.as_ref()?, self.growth.as_ref()?);
        let seen = significant(growth.reduced_time_s, 3);
        let grown = match growth.in_all_s {
            Some(all) if !growth.is_frozen() => {
                format!(
                    "{seen} of {} s of reduced time: its heat ends later than the heated phases",
                    significant(all, 3)
                )
            }
            Some(_) => format!("{seen} s of reduced time, and nothing moves any more"),
            None => format!("{seen} s of reduced time"),
        };
        Some(format!("{}; it has grown for {grown}", heat.in_words()))
    }
}

/// When the first heated phase began.
pub(super) fn heated_from_s(series: &Series, phases: &[Phase]) -> Option<f64> {
    let first = phases.iter().position(|phase| phase.heated)?;
    series.phase_start_s.get(first).copied()
}

impl PhaseRecord {
    fn of(input: &SceneInput, series: &Series, index: usize) -> Option<Self> {
        let phase = &input.file.phases[index];
        let first = series.phase.iter().position(|&of| of == index)?;
        let last = series.phase.iter().rposition(|&of| of == index)?;
        let entry = series.entries.get(index)?;
        let has_box = input.file.region.is_some();
        Some(Self {
            name: phase.name.clone(),
            mode: match phase.mode {
                Mode::Dynamic => "dynamic",
                Mode::QuasiStatic => "quasi-static",
            },
            heated: phase.heated,
            start_s: *series.phase_start_s.get(index)?,
            k1_n_per_m: entry.k1_n_per_m,
            box_before_m: has_box.then_some(entry.box_before_m),
            box_m: has_box.then_some(entry.box_m),
            begin: State::from(&series.samples[first]),
            end: State::from(&series.samples[last]),
        })
    }

    /// Its stiffness, and what contacts that became harder have done to the box.
    fn stiffness_in_words(&self) -> String {
        let k1 = format!("with K1 = {} N/m", significant(self.k1_n_per_m, 3));
        let (Some(before), Some(after)) = (self.box_before_m, self.box_m) else { return k1 };
        if before == after {
            return k1;
        }
        let um = |size: [f64; 3]| size.map(|length| significant(1e6 * length, 4)).join(" x ");
        let density =
            self.begin.relative_density.map_or_else(|| "?".to_owned(), |d| significant(d, 4));
        format!(
            "{k1}, balanced with which the bed begins at a density of {density}, its box of {} um stretched to {} um",
            um(before),
            um(after)
        )
    }
}

/// What the stiffness of the phases has done.
fn advice_on_stiffness(input: &SceneInput, run: &Run, advice: &mut Vec<String>) {
    let phases = || input.file.phases.iter().zip(&run.series().entries);
    for (phase, entry) in phases().filter(|(_, entry)| entry.keeps_overlaps) {
        let (phase, k1_n_per_m) = (phase.name.clone(), entry.k1_n_per_m);
        advice.push(Careful::KeepsOverlaps { phase, k1_n_per_m }.to_string());
    }
    if input.file.adhesion.is_none() {
        return;
    }
    let radius_m = input.outline.mean_radius_m;
    let over_radius = run.bed().material().adhesion_n(radius_m) / radius_m;
    let soft = phases().find(|(phase, entry)| {
        phase.mode == Mode::Dynamic && over_radius > SOFT * entry.k1_n_per_m
    });
    if let Some((phase, entry)) = soft {
        let soft = Careful::SoftSettling {
            phase: phase.name.clone(),
            k1_n_per_m: entry.k1_n_per_m,
            load: over_radius / entry.k1_n_per_m,
            limit: SOFT,
            needed_n_per_m: over_radius / SOFT,
        };
        advice.push(soft.to_string());
    }
}

/// What follows the end of the pairs by a closed law.
fn closed_in_words(rates: Option<&EndRates>) -> String {
    let then = "the density goes on by the laws of open and closed pores, and the contacts stay as they were";
    let Some(EndRates { by_pairs, by_closed_law }) = rates else { return then.to_owned() };
    if (by_closed_law - by_pairs).abs() <= RATES_DIFFER * by_pairs.abs() {
        return then.to_owned();
    }
    format!(
        "{then}; it densified at {} per tau_s by its pairs and goes on at {} by the closed law, which is that of a bed that shrinks alike in all directions and whose necks resist nothing",
        significant(*by_pairs, 2),
        significant(*by_closed_law, 2)
    )
}

fn advice(input: &SceneInput, run: &Run) -> Vec<String> {
    let series = run.series();
    let mut advice = Vec::new();
    advice_on_stiffness(input, run, &mut advice);
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
            Some(WhenNecksMeet::Stop) => "the run ended there".to_owned(),
            _ if closed => closed_in_words(series.end_rates.as_ref()),
            _ => "the pairs go on without new contacts, and what follows is a trend".to_owned(),
        };
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
