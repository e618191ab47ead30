//! Running a scene through its phases.

use std::ops::ControlFlow;

use super::closure::{EndRates, LEAST_CLOSING, Law, WhenNecksMeet};
use super::engine::{Bed, Drive};
use super::error::{BedError, field};
use super::material::{Growing, Material};
use super::measure::Sample;
use super::phase::{Mode, Phase};
use super::quasi_static::{QuasiStaticReport, QuasiStaticSettings};
use super::region::Side;
use super::scene::Scene;
use super::stiffness::PhaseEntry;
use super::vec3::norm;
use crate::densification::{closure_density, closure_rate};

/// Observations of a run of a scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Observations, in time.
    pub samples: Vec<Sample>,
    /// Phase of each observation.
    pub phase: Vec<usize>,
    /// Start of each phase \[s\].
    pub phase_start_s: Vec<f64>,
    /// Work and error of the quasi-static phases.
    pub quasi_static: QuasiStaticReport,
    /// The bed where its pairs ended: the necks met, or the pores closed.
    pub hand_over: Option<Sample>,
    /// Rates of the density there by the two laws, where a closed law follows.
    pub end_rates: Option<EndRates>,
    /// What each phase began with.
    pub entries: Vec<PhaseEntry>,
    /// Whether the run was stopped by its observer.
    pub stopped: bool,
}

/// Progress of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// The phase.
    pub phase: usize,
    /// Share of all observations made.
    pub share: f64,
    /// The present observation.
    pub sample: Sample,
}

/// A run of a scene, observation by observation: it can be stored between two of them and taken up
/// again with the same bits.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    pub(crate) scene: Scene,
    pub(crate) bed: Bed,
    pub(crate) series: Series,
    /// The phase of the next observation, and its number in it, from 0.
    pub(crate) phase: usize,
    pub(crate) output: usize,
    /// Steps between two observations of a dynamic phase.
    pub(crate) steps: u64,
    /// Heated time since the hand-over, in tau_s.
    pub(crate) closure_time: f64,
}

impl Run {
    /// The bed as of the last observation.
    #[must_use]
    pub fn bed(&self) -> &Bed {
        &self.bed
    }

    /// Observations so far.
    #[must_use]
    pub fn series(&self) -> &Series {
        &self.series
    }

    /// The phase that the next observation belongs to; `None` at the end.
    #[must_use]
    pub fn next_phase(&self) -> Option<&Phase> {
        self.scene.phases.get(self.phase)
    }

    /// Sets other kinetics or parameters for the phases to come: a draw of a posterior, after the
    /// phases that all draws share.
    ///
    /// # Errors
    ///
    /// [`BedError::Field`] once a heated phase has begun.
    pub fn set_growing(&mut self, growing: Growing) -> Result<(), BedError> {
        self.check_cold("sintering")?;
        self.scene.growing = Some(growing);
        Ok(())
    }

    pub(super) fn check_cold(&self, name: &str) -> Result<(), BedError> {
        let begun = self.series.phase.iter().any(|&phase| self.scene.phases[phase].heated);
        if begun {
            let remedy = "parameters can be changed before the first heated phase only";
            return Err(field(name, "another", remedy));
        }
        Ok(())
    }

    /// Advances to the next observation; `None` at the end of the last phase.
    ///
    /// # Errors
    ///
    /// [`BedError`]. The state is then in between: go on from an earlier checkpoint.
    pub fn advance(&mut self) -> Result<Option<Progress>, BedError> {
        let Some(phase) = self.scene.phases.get(self.phase).cloned() else { return Ok(None) };
        if self.output == 0 {
            self.begin(&phase)?;
        } else {
            self.go(&phase)?;
        }
        let sample = self.sample(&phase);
        if sample.law == Law::Pairs {
            phase.check_inertia(&sample)?;
            self.check_density(&sample)?;
        }
        self.series.samples.push(sample);
        self.series.phase.push(self.phase);
        let total: usize = self.scene.phases.iter().map(|phase| phase.outputs + 1).sum();
        let share = self.series.samples.len() as f64 / total as f64;
        let progress = Progress { phase: self.phase, share, sample };
        self.output += 1;
        if self.has_stopped() {
            self.phase = self.scene.phases.len();
            self.output = 0;
        } else if self.output > phase.outputs {
            self.phase += 1;
            self.output = 0;
        }
        Ok(Some(progress))
    }

    fn begin(&mut self, phase: &Phase) -> Result<(), BedError> {
        let box_before_m = self.bed.around.region.size_m;
        let entry = PhaseEntry {
            k1_n_per_m: self.bed.material().k1_n_per_m(),
            box_before_m,
            box_m: box_before_m,
            keeps_overlaps: false,
        };
        if self.closed_from().is_some() {
            let now_s = self.series.samples.last().map_or(0.0, |sample| sample.time_s);
            self.series.phase_start_s.push(now_s);
            self.series.entries.push(entry);
            return Ok(());
        }
        let material = *self.scene.bed.material();
        let is_hot_balance = phase.heated && phase.mode == Mode::QuasiStatic;
        let k1_n_per_m = material.k1_of(phase);
        let material = material.with_k1(k1_n_per_m)?;
        let mut keeps_overlaps = false;
        if is_hot_balance && material.has_stated_adhesion() && self.bed.is_elastic() {
            // The stated force does not go by K1.
            self.scene.check_load(&self.bed)?;
            keeps_overlaps = !self.harden(material, phase)?;
        } else {
            self.bed.change_stiffness(material);
        }
        let box_m = self.bed.around.region.size_m;
        self.series.entries.push(PhaseEntry { k1_n_per_m, box_m, keeps_overlaps, ..entry });
        if phase.heated {
            self.scene.check_load(&self.bed)?;
        }
        let drive = Drive {
            growing: self.scene.growing.filter(|_| phase.heated),
            step_over_collision_time: phase.step_over_collision_time,
            mass_scaling: phase.mass_scaling,
        };
        self.bed.heat = self.heat_clock();
        self.bed.begin(&drive)?;
        self.series.quasi_static.balanced_at_s = None;
        self.series.quasi_static.next_step_s = None;
        self.series.phase_start_s.push(self.bed.time_s());
        if phase.mode == Mode::Dynamic {
            // Observations fall on steps.
            let every_s = phase.every_s();
            self.steps = (every_s / self.bed.step_s()).ceil() as u64;
            self.bed.begin_with_step(every_s / self.steps as f64)
        } else {
            // A quasi-static phase starts in balance.
            self.go(phase)
        }
    }

    /// Takes on another stiffness from balance to balance, in steps that the balance can follow. Where it follows no step the contacts keep the
    /// overlaps they have; returns whether they do not.
    fn harden(&mut self, material: Material, phase: &Phase) -> Result<bool, BedError> {
        let settings = phase.quasi_static(self.scene.free_box);
        let wanted = material.k1_n_per_m();
        let mut step = STIFFER;
        while self.bed.material().k1_n_per_m() != wanted && step > LEAST_STIFFER {
            let times = wanted / self.bed.material().k1_n_per_m();
            let is_last = times.max(1.0 / times) <= step;
            let next = if times > 1.0 { step } else { 1.0 / step };
            let k1 = self.bed.material().k1_n_per_m() * next;
            let before = self.bed.clone();
            self.bed.harden(if is_last { material } else { material.with_k1(k1)? })?;
            let (now_s, report) = (self.bed.time_s(), &mut self.series.quasi_static);
            report.balanced_at_s = None;
            match self.bed.advance_quasi_static(now_s, &settings, report) {
                Ok(()) => {}
                Err(BedError::NoBalance { .. } | BedError::NoRest { .. }) => {
                    self.bed = before;
                    step = step.sqrt();
                }
                Err(error) => return Err(error),
            }
        }
        let followed = self.bed.material().k1_n_per_m() == wanted;
        self.bed.change_stiffness(material);
        Ok(followed)
    }

    /// To the present observation.
    fn go(&mut self, phase: &Phase) -> Result<(), BedError> {
        let from_s = match (self.closed_from(), self.series.samples.last()) {
            (Some(_), Some(last)) => last.time_s,
            _ => {
                self.go_by_pairs(phase)?;
                self.bed.time_s()
            }
        };
        if self.closed_from().is_some()
            && phase.heated
            && let Some(growing) = &self.scene.growing
        {
            let left_s = self.observed_s(phase) - from_s;
            let growing_s = self.bed.growth_within_s(from_s, left_s);
            self.closure_time += growing_s / self.bed.closure_tau_s(growing);
        }
        Ok(())
    }

    fn go_by_pairs(&mut self, phase: &Phase) -> Result<(), BedError> {
        let may_end = phase.heated && self.series.hand_over.is_none();
        let left = self.steps_by_pairs(phase, may_end, self.steps)?;
        if !(may_end && self.bed.pairs_have_ended()) {
            return Ok(());
        }
        let end = self.bed.sample();
        self.check_density(&end)?;
        self.series.hand_over = Some(end);
        if self.closed_from().is_some() {
            self.series.end_rates = self.end_rates(phase, &end);
        }
        self.bed.closed = true;
        if self.closed_from().is_none() && !self.has_stopped() {
            self.steps_by_pairs(phase, false, left)?;
        }
        Ok(())
    }

    /// The rates by the contacts, which are followed a little further for it, and by the closed law; `None` where they cannot be followed.
    fn end_rates(&self, phase: &Phase, end: &Sample) -> Option<EndRates> {
        // At the reference temperature, where tau_s is what it is.
        let mut bed = Bed { heat: None, ..self.bed.clone() };
        let tau_s = bed.closure_tau_s(self.scene.growing.as_ref()?);
        let ahead_s = RATE_OVER_TAU * tau_s;
        if phase.mode == Mode::QuasiStatic {
            let settings = phase.quasi_static(self.scene.free_box);
            let mut report = self.series.quasi_static;
            bed.advance_quasi_static(bed.time_s() + ahead_s, &settings, &mut report).ok()?;
        } else {
            bed.advance(((ahead_s / bed.step_s()) as u64).max(1)).ok()?;
        }
        let took = (bed.time_s() - end.time_s) / tau_s;
        Some(EndRates {
            by_pairs: (bed.relative_density()? - end.relative_density) / took,
            by_closed_law: closure_rate(end.relative_density),
        })
    }

    /// Follows the pairs to the present observation, or to where they end; returns the steps that were left out.
    fn steps_by_pairs(
        &mut self,
        phase: &Phase,
        may_end: bool,
        mut left: u64,
    ) -> Result<u64, BedError> {
        if phase.mode == Mode::QuasiStatic {
            let settings = QuasiStaticSettings {
                ends_where_necks_meet: may_end,
                ..phase.quasi_static(self.scene.free_box)
            };
            let until_s = self.observed_s(phase);
            self.bed.advance_quasi_static(until_s, &settings, &mut self.series.quasi_static)?;
            return Ok(0);
        }
        if self.bed.work().steps + left > phase.max_work {
            let (max_work, time_s) = (phase.max_work, self.bed.time_s());
            return Err(BedError::WorkLimit { max_work, time_s });
        }
        let looks = self.scene.growing.filter(|_| may_end);
        while left > 0 {
            let at_once = looks.map_or(left, |growing| {
                let look_s = LOOK_EVERY_TAU * self.bed.closure_tau_s(&growing);
                // Faster growth is looked at more often, slower growth not more rarely.
                let growing_s = self.bed.step_pace().growing_s.max(self.bed.step_s());
                ((look_s / growing_s) as u64).max(1)
            });
            let steps = at_once.min(left);
            self.bed.advance(steps)?;
            left -= steps;
            if may_end && self.bed.pairs_have_ended() {
                break;
            }
        }
        Ok(left)
    }

    /// Time of the present observation, where steps end on it \[s\].
    fn observed_s(&self, phase: &Phase) -> f64 {
        self.series.phase_start_s[self.phase] + self.output as f64 * phase.every_s()
    }

    /// The bed at the hand-over, where its density goes on by the closed laws.
    fn closed_from(&self) -> Option<&Sample> {
        let closes = self.scene.when_necks_meet == WhenNecksMeet::Closure
            && self.bed.can_shrink(self.scene.free_box);
        let hand_over = self.series.hand_over.as_ref();
        hand_over.filter(|end| closes && end.relative_density >= LEAST_CLOSING)
    }

    /// Whether the run has ended where its pairs have.
    fn has_stopped(&self) -> bool {
        self.series.hand_over.is_some() && self.scene.when_necks_meet == WhenNecksMeet::Stop
    }

    fn sample(&self, phase: &Phase) -> Sample {
        let Some(from) = self.closed_from() else { return self.bed.sample() };
        let relative_density = closure_density(from.relative_density, self.closure_time);
        let time_s = self.observed_s(phase);
        Sample { time_s, relative_density, law: Law::at(relative_density), ..*from }
    }

    /// Refuses contacts so soft that their overlaps leave no room for the matter of the particles.
    fn check_density(&self, sample: &Sample) -> Result<(), BedError> {
        if sample.relative_density > 1.0 {
            let (time_s, relative_density) = (sample.time_s, sample.relative_density);
            let k1 = self.bed.material().k1_n_per_m();
            return Err(BedError::Overfull { time_s, relative_density, k1 });
        }
        Ok(())
    }
}

/// Largest change of K1 from one balance to the next, and the least that is tried.
const STIFFER: f64 = 3.0;
const LEAST_STIFFER: f64 = 1.05;

/// Part of tau_s over which the rate by the contacts is taken where they end.
const RATE_OVER_TAU: f64 = 0.02;

/// A dynamic phase looks whether necks meet after such a part of tau_s.
const LOOK_EVERY_TAU: f64 = 0.002;

impl Scene {
    /// A run from the start.
    #[must_use]
    pub fn start(&self) -> Run {
        Run {
            bed: self.bed.clone(),
            scene: self.clone(),
            series: Series::default(),
            phase: 0,
            output: 0,
            steps: 0,
            closure_time: 0.0,
        }
    }

    /// Runs all phases. `observe` sees every observation, and may stop the run.
    ///
    /// # Errors
    ///
    /// [`BedError`]; the observer has seen the observations before it.
    pub fn run(
        &self,
        mut observe: impl FnMut(&Progress, &Bed) -> ControlFlow<()>,
    ) -> Result<Series, BedError> {
        let mut run = self.start();
        while let Some(progress) = run.advance()? {
            if observe(&progress, &run.bed).is_break() {
                run.series.stopped = true;
                break;
            }
        }
        Ok(run.series)
    }

    /// Refuses to heat a bed whose weight, and not adhesion, would drive the growth.
    ///
    /// The load on a particle at the bottom is the weight of the particles above it: the total weight over
    /// the number of particles in the lowest layer, taken as the base over `4 R^2`.
    pub(super) fn check_load(&self, bed: &Bed) -> Result<(), BedError> {
        let Some(load_over_adhesion) = bed.load_over_adhesion() else { return Ok(()) };
        let allowed = self.allowed_load_over_adhesion;
        if load_over_adhesion <= allowed {
            return Ok(());
        }
        let radii = &bed.particles().radius_m;
        let mean_radius = radii.iter().sum::<f64>() / radii.len() as f64;
        let needed_n = bed.material().adhesion_n(mean_radius) * load_over_adhesion / allowed;
        Err(BedError::WeightDrives { load_over_adhesion, allowed, needed_n })
    }
}

impl Phase {
    /// Time between two observations.
    fn every_s(&self) -> f64 {
        self.duration_s / self.outputs as f64
    }

    fn quasi_static(&self, free_box: bool) -> QuasiStaticSettings {
        QuasiStaticSettings {
            tolerance: self.tolerance,
            free_box,
            max_work: self.max_work,
            ..QuasiStaticSettings::default()
        }
    }

    fn check_inertia(&self, sample: &Sample) -> Result<(), BedError> {
        let (time_s, inertial_number) = (sample.time_s, sample.inertial_number);
        match self.inertial_number_limit.filter(|_| self.heated && self.mode == Mode::Dynamic) {
            Some(limit) if inertial_number > limit => {
                Err(BedError::Inertia { time_s, inertial_number, limit })
            }
            _ => Ok(()),
        }
    }
}

impl Bed {
    /// Whether the load at the bottom is what it is wherever the particles are: gravity goes along axes whose layers have sides.
    pub(super) fn load_stays(&self) -> bool {
        let gravity = self.around.gravity_m_per_s2;
        let bounded = |axis: usize| {
            matches!(self.around.region.sides[axis % 3], Side::Periodic | Side::Walls)
                && gravity[axis % 3] == 0.0
        };
        (0..3).all(|axis| gravity[axis] == 0.0 || (bounded(axis + 1) && bounded(axis + 2)))
    }

    /// Load on a particle at the bottom over its adhesive force; `None` without gravity.
    ///
    /// Of gravity along several axes each side carries its component: the largest of these loads.
    #[must_use]
    pub fn load_over_adhesion(&self) -> Option<f64> {
        let gravity = self.around.gravity_m_per_s2;
        if norm(gravity) == 0.0 {
            return None;
        }
        let p = &self.particles;
        let n = p.len() as f64;
        let radius = p.radius_m.iter().sum::<f64>() / n;
        let mass: f64 = p.inertia.iter().sum::<f64>() / self.drive.mass_scaling;
        let region = &self.around.region;
        let across = [0, 1, 2].map(|axis| {
            let ends =
                matches!(region.sides[axis], Side::Open | Side::LowerWall) || gravity[axis] != 0.0;
            let length = if ends && region.sides[axis] != Side::Periodic {
                let along = p.position_m.iter().map(|position| position[axis]);
                let low = along.clone().fold(f64::INFINITY, f64::min);
                along.fold(f64::NEG_INFINITY, f64::max) - low + 2.0 * radius
            } else {
                region.size_m[axis]
            };
            (length / (2.0 * radius)).max(1.0)
        });
        let load = |axis: usize| {
            let layer = across[(axis + 1) % 3] * across[(axis + 2) % 3];
            mass * gravity[axis].abs() / layer.min(n)
        };
        let largest = load(0).max(load(1)).max(load(2));
        Some(largest / self.material.adhesion_n(radius))
    }
}
