//! A material's pair of particles, as it is simulated and as `calibrate --material` calibrates it.
//!
//! The one file of the studies that knows the workbench's plan and its model of neck growth.

use dem_core::{
    Kinetics, PairScene, PairSpec, Sintering, SolveError, SolverKind, SolverSettings,
    contact_ratios,
};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt as _, SeedableRng as _};
use smc_calib::{
    CalibrateError, Likelihood, Noise, Observations, Parameter, Posterior, Problem, Settings,
    Simulator as _, calibrate,
};

use workbench::error::{Failure, RunError};
use workbench::input::experiment::Experiment;
use workbench::input::material::Material;
use workbench::pair::model::NeckGrowth;
use workbench::plan::{PairOptions, sampler_for};

/// A pair of a material, with the times of its measurement and the paper's sintering parameters.
pub(crate) struct Pair {
    pub(crate) material: Material,
    pub(crate) spec: PairSpec,
    pub(crate) scene: PairScene,
    pub(crate) times_s: Vec<f64>,
    /// Table 3, read in SI.
    pub(crate) sintering: Sintering,
}

impl Pair {
    /// The pair that the material is calibrated on.
    pub(crate) fn of(material: Material) -> Result<Self, Failure> {
        let experiment = Experiment::of_material(material)?;
        let spec = PairSpec::new(experiment.powder, experiment.final_contact_ratio);
        Ok(Self {
            material,
            spec,
            scene: spec.build().map_err(RunError::new)?,
            times_s: experiment.observations(None)?.time_s,
            sintering: material.table3_sintering(),
        })
    }

    /// Contact ratios at the times of the measurement under the three-stage law; the number of steps.
    pub(crate) fn curve(
        &self,
        sintering: &Sintering,
        settings: &SolverSettings,
        out: &mut [f64],
    ) -> Result<u64, SolveError> {
        let kinetics = Kinetics::ThreeStage;
        contact_ratios(&self.scene, kinetics, sintering, settings, &self.times_s, out)
            .map(|report| report.steps)
    }
}

/// A calibration of a material with its default data, priors, noise and model.
pub(crate) struct Calibration {
    pub(crate) model: NeckGrowth,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) observations: Observations,
    noise: Noise,
    pub(crate) likelihood: Likelihood,
}

impl Calibration {
    pub(crate) fn of(material: Material) -> Result<Self, Failure> {
        Self::under(material, &Noise::default())
    }

    /// With another noise model.
    pub(crate) fn under(material: Material, noise: &Noise) -> Result<Self, Failure> {
        Self::planned(&PairOptions {
            material: Some(material),
            noise: noise.clone(),
            ..PairOptions::default()
        })
    }

    /// With a solver of one's own choice.
    pub(crate) fn solved(material: Material, solver: SolverKind) -> Result<Self, Failure> {
        Self::planned(&PairOptions {
            material: Some(material),
            solver: Some(solver),
            ..PairOptions::default()
        })
    }

    fn planned(options: &PairOptions) -> Result<Self, Failure> {
        let plan = options.plan()?.plan;
        let (_, observable) = plan.pair()?;
        let (observations, noise) = (observable.observations()?, observable.noise.clone());
        Ok(Self {
            model: NeckGrowth::of(&plan)?,
            likelihood: Likelihood::new(&noise, &observations).map_err(RunError::new)?,
            parameters: plan.parameters,
            observations,
            noise,
        })
    }

    /// The same on `count` made-up observations, evenly over `(0, end_s]`: the curve of `sintering` with a scatter.
    pub(crate) fn made_up(
        self,
        count: usize,
        end_s: f64,
        sintering: &Sintering,
        scatter: f64,
    ) -> Result<Self, RunError> {
        let times_s: Vec<f64> = (1..=count).map(|k| end_s * k as f64 / count as f64).collect();
        let model = self.model.at_times(times_s.clone());
        let mut curve = vec![0.0; count];
        model.curve(sintering, &mut curve).map_err(RunError::new)?;
        // Scatter without random numbers: multiples of the golden ratio fill the unit interval evenly.
        for (k, value) in curve.iter_mut().enumerate() {
            let u = ((k as f64 + 0.5) * 0.618_033_988_749_894_9).fract();
            *value += scatter * smc_calib::normal::quantile(u);
        }
        self.on(model, times_s, curve)
    }

    /// The same on the first `count` observations alone.
    pub(crate) fn first(self, count: usize) -> Result<Self, RunError> {
        let times_s = self.observations.control()[..count].to_vec();
        let values = self.observations.values()[..count].to_vec();
        let model = self.model.at_times(times_s.clone());
        self.on(model, times_s, values)
    }

    /// The same with some observations, from 0, moved.
    pub(crate) fn moved(self, rows: &[usize], by: f64) -> Result<Self, RunError> {
        let mut values = self.observations.values().to_vec();
        rows.iter().for_each(|row| values[*row] += by);
        let (model, times_s) = (self.model.clone(), self.observations.control().to_vec());
        self.on(model, times_s, values)
    }

    fn on(self, model: NeckGrowth, times_s: Vec<f64>, values: Vec<f64>) -> Result<Self, RunError> {
        let observations = Observations::new(times_s, values).map_err(RunError::new)?;
        let likelihood = Likelihood::new(&self.noise, &observations).map_err(RunError::new)?;
        Ok(Self { model, observations, likelihood, ..self })
    }

    pub(crate) fn problem(&self) -> Problem<'_> {
        Problem {
            simulator: &self.model,
            parameters: self.parameters.clone(),
            observations: self.observations.clone(),
            noise: self.noise.clone(),
        }
    }

    /// The posterior of `calibrate --samples N --seed SEED`.
    pub(crate) fn posterior(&self, samples: usize, seed: u64) -> Result<Posterior, CalibrateError> {
        self.sampled(&settings(samples, seed))
    }

    /// The posterior with other settings.
    pub(crate) fn sampled(&self, settings: &Settings) -> Result<Posterior, CalibrateError> {
        calibrate(&self.problem(), settings, &mut ())
    }

    /// A value of the curve at normal scores; none where it cannot be simulated.
    pub(crate) fn at<T>(&self, z: &[f64], value: impl FnOnce(&[f64]) -> T) -> Option<T> {
        let theta: Vec<f64> =
            self.parameters.iter().zip(z).map(|(p, z)| p.prior.from_z(*z)).collect();
        let mut curve = vec![0.0; self.observations.len()];
        self.model.simulate(&theta, &mut curve).ok()?;
        curve.iter().all(|v| v.is_finite()).then(|| value(&curve))
    }

    /// Draws from the priors, the same every time.
    pub(crate) fn draws(&self, count: usize) -> Vec<Sintering> {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut draw = || {
            let theta: Vec<f64> =
                self.parameters.iter().map(|p| p.prior.quantile(random.random())).collect();
            self.model.sintering(&theta)
        };
        (0..count).map(|_| draw()).collect()
    }
}

/// Verlet with a step over the collision time.
pub(crate) fn verlet(step_over_collision_time: f64) -> SolverSettings {
    SolverSettings { step_over_collision_time, ..SolverSettings::of(SolverKind::Verlet) }
}

/// The sampler's settings of `calibrate --samples N --seed SEED`.
pub(crate) fn settings(samples: usize, seed: u64) -> Settings {
    Settings { seed, ..sampler_for(samples) }
}
