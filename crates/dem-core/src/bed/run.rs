//! Running a scene through its phases.

use std::ops::ControlFlow;

use super::engine::{Bed, Drive};
use super::error::{BedError, field};
use super::material::{Growing, Material};
use super::measure::Sample;
use super::phase::{Mode, Phase};
use super::quasi_static::{QuasiStaticReport, QuasiStaticSettings};
use super::region::Side;
use super::scene::Scene;
use super::vec3::norm;

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
        let begun = self.series.phase.iter().any(|&phase| self.scene.phases[phase].heated);
        if begun {
            let remedy = "parameters can be changed before the first heated phase only";
            return Err(field("sintering", "another", remedy));
        }
        self.scene.growing = Some(growing);
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
        let sample = self.bed.sample();
        phase.check_inertia(&sample)?;
        self.series.samples.push(sample);
        self.series.phase.push(self.phase);
        let total: usize = self.scene.phases.iter().map(|phase| phase.outputs + 1).sum();
        let share = self.series.samples.len() as f64 / total as f64;
        let progress = Progress { phase: self.phase, share, sample };
        self.output += 1;
        if self.output > phase.outputs {
            self.phase += 1;
            self.output = 0;
        }
        Ok(Some(progress))
    }

    fn begin(&mut self, phase: &Phase) -> Result<(), BedError> {
        let mut spec = *self.scene.bed.material().spec();
        spec.k1 = phase.k1_n_per_m.unwrap_or(spec.k1);
        self.bed.set_material(Material::new(spec)?);
        if phase.heated {
            self.scene.check_load(&self.bed)?;
        }
        let drive = Drive {
            growing: self.scene.growing.filter(|_| phase.heated),
            step_over_collision_time: phase.step_over_collision_time,
            mass_scaling: phase.mass_scaling,
        };
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

    fn go(&mut self, phase: &Phase) -> Result<(), BedError> {
        match phase.mode {
            Mode::Dynamic => {
                if self.bed.work().steps + self.steps > phase.max_work {
                    let (max_work, time_s) = (phase.max_work, self.bed.time_s());
                    return Err(BedError::WorkLimit { max_work, time_s });
                }
                self.bed.advance(self.steps)
            }
            Mode::QuasiStatic => self.bed.advance_quasi_static(
                self.series.phase_start_s[self.phase] + self.output as f64 * phase.every_s(),
                &phase.quasi_static(self.scene.free_box),
                &mut self.series.quasi_static,
            ),
        }
    }
}

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
    fn check_load(&self, bed: &Bed) -> Result<(), BedError> {
        let Some(load_over_adhesion) = bed.load_over_adhesion() else { return Ok(()) };
        let allowed = self.allowed_load_over_adhesion;
        if load_over_adhesion <= allowed {
            return Ok(());
        }
        let k1 = bed.material().k1_n_per_m();
        let needed_k1 = k1 * load_over_adhesion / allowed;
        Err(BedError::TooSoftForGravity { k1, load_over_adhesion, allowed, needed_k1 })
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
    /// Load on a particle at the bottom over its adhesive force; `None` without gravity.
    #[must_use]
    pub fn load_over_adhesion(&self) -> Option<f64> {
        let g = norm(self.around.gravity_m_per_s2);
        if g == 0.0 {
            return None;
        }
        let p = &self.particles;
        let n = p.len() as f64;
        let radius = p.radius_m.iter().sum::<f64>() / n;
        let mass: f64 = p.inertia.iter().sum::<f64>() / self.drive.mass_scaling;
        let mut layer = 1.0;
        for axis in 0..3 {
            if self.around.gravity_m_per_s2[axis] == 0.0 {
                let across = if self.around.region.sides[axis] == Side::Open {
                    let along = p.position_m.iter().map(|position| position[axis]);
                    let low = along.clone().fold(f64::INFINITY, f64::min);
                    along.fold(f64::NEG_INFINITY, f64::max) - low + 2.0 * radius
                } else {
                    self.around.region.size_m[axis]
                };
                layer *= (across / (2.0 * radius)).max(1.0);
            }
        }
        let adhesion = self.law.law.adhesion * self.material.k1_n_per_m() * radius;
        Some(mass * g / layer.min(n) / adhesion)
    }
}
