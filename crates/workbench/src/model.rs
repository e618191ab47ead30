//! The pair simulator as the sampler sees it: from a parameter vector to contact ratios at the
//! observation times.

use dem_core::{
    Kinetics, PairScene, PairSpec, Powder, Sintering, SolveError, SolverKind, SolverSettings,
    contact_ratios, verlet_batch,
};
use rayon::prelude::*;
use smc_calib::{SimError, Simulator};

use crate::error::InputError;
use crate::plan::Plan;
use crate::prior_file::ParameterName;

/// The neck growth model of a plan, at given times.
#[derive(Debug, Clone)]
pub struct NeckGrowth {
    names: Vec<ParameterName>,
    powder: Powder,
    scene: PairScene,
    kinetics: Kinetics,
    solver: SolverSettings,
    times_s: Vec<f64>,
}

impl NeckGrowth {
    /// The model of a plan at the plan's observation times.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a plan that names what this version does not know.
    pub fn of(plan: &Plan) -> Result<Self, InputError> {
        Ok(Self {
            names: plan.parameter_names()?,
            powder: plan.powder(),
            scene: plan.scene()?,
            kinetics: plan.kinetics()?,
            solver: plan.solver_settings()?,
            times_s: plan.experiment.time_s.clone(),
        })
    }

    /// A model of its parts. `names` says what each place of a parameter vector is.
    #[must_use]
    pub fn new(
        names: Vec<ParameterName>,
        powder: Powder,
        scene: PairScene,
        kinetics: Kinetics,
        solver: SolverSettings,
        times_s: Vec<f64>,
    ) -> Self {
        Self { names, powder, scene, kinetics, solver, times_s }
    }

    /// The same model at other times \[s\], sorted and not negative.
    #[must_use]
    pub fn at_times(&self, times_s: Vec<f64>) -> Self {
        Self { times_s, ..self.clone() }
    }

    /// The same model with other kinetics. Parameters that these do not use are ignored.
    #[must_use]
    pub fn with_kinetics(&self, kinetics: Kinetics) -> Self {
        Self { kinetics, ..self.clone() }
    }

    /// The observation times \[s\].
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// The parameters, in order.
    #[must_use]
    pub fn names(&self) -> &[ParameterName] {
        &self.names
    }

    /// Parameter vector -> sintering parameters; those that the kinetics do not use stand at 1.
    #[must_use]
    pub fn sintering(&self, theta: &[f64]) -> Sintering {
        let mut sintering = Sintering { c1: 1.0, tau_s: 1.0, delta_c: 1.0 };
        for (name, &value) in self.names.iter().zip(theta) {
            match name {
                ParameterName::C1 => sintering.c1 = value,
                ParameterName::TauS => sintering.tau_s = value,
                ParameterName::DeltaC => sintering.delta_c = value,
                ParameterName::Phi => {}
            }
        }
        sintering
    }

    /// The scene at a parameter vector: the plan's, unless phi is calibrated.
    ///
    /// # Errors
    ///
    /// A recoverable [`SimError`] for a phi without a scene.
    pub fn scene(&self, theta: &[f64]) -> Result<PairScene, SimError> {
        match self.names.iter().position(|&name| name == ParameterName::Phi) {
            None => Ok(self.scene.clone()),
            Some(place) => PairSpec::new(self.powder, theta[place])
                .build()
                .map_err(|_| SimError::recoverable("phi is out of the model's range")),
        }
    }

    /// The curve of given sintering parameters at the plan's phi.
    ///
    /// # Errors
    ///
    /// [`SimError`] as [`Simulator::simulate`].
    pub fn curve(&self, sintering: &Sintering, out: &mut [f64]) -> Result<(), SimError> {
        self.run(&self.scene, sintering, out)
    }

    fn run(
        &self,
        scene: &PairScene,
        sintering: &Sintering,
        out: &mut [f64],
    ) -> Result<(), SimError> {
        contact_ratios(scene, self.kinetics, sintering, &self.solver, &self.times_s, out)
            .map(|_| ())
            .map_err(|error| failure(&error))
    }

    /// Curves of many parameter vectors, row by row, in parallel; those of the Verlet solver side by side in the lanes of
    /// the processor's vectors, with the same bits as [`Simulator::simulate`]. `go_on` is asked before every
    /// curve; after `false` it is not simulated and fails as [`INTERRUPTED`].
    pub fn curves(
        &self,
        thetas: &[f64],
        outputs: &mut [f64],
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Vec<Result<(), SimError>> {
        let (d, m) = (self.parameters(), self.observables());
        let (count, threads) = (thetas.len() / d, rayon::current_num_threads());
        // With another phi for every curve there is no one scene.
        let lanes =
            self.solver.kind == SolverKind::Verlet && !self.names.contains(&ParameterName::Phi);
        // Many curves to a lane, so that no lane waits long for the last one.
        let rows = if lanes {
            (count / (2 * threads)).clamp(8, 64)
        } else {
            (count / (8 * threads)).clamp(1, 16)
        };
        thetas
            .par_chunks(rows * d)
            .zip(outputs.par_chunks_mut(rows * m))
            .flat_map_iter(|(thetas, outputs)| {
                let each = thetas.chunks_exact(d);
                if lanes {
                    if !each.clone().all(|_| go_on()) {
                        return vec![Err(SimError::fatal(INTERRUPTED)); each.len()];
                    }
                    return self.verlet_curves(thetas, outputs);
                }
                each.zip(outputs.chunks_exact_mut(m))
                    .map(|(theta, out)| Watched { model: self, go_on }.simulate(theta, out))
                    .collect()
            })
            .collect()
    }

    fn verlet_curves(&self, thetas: &[f64], outputs: &mut [f64]) -> Vec<Result<(), SimError>> {
        let sinterings: Vec<Sintering> =
            thetas.chunks_exact(self.parameters()).map(|theta| self.sintering(theta)).collect();
        let (scene, times_s) = (&self.scene, &self.times_s);
        verlet_batch(scene, self.kinetics, &sinterings, &self.solver, times_s, outputs)
            .unwrap_or_else(|error| vec![Err(error); sinterings.len()])
            .into_iter()
            .map(|result| result.map(|_| ()).map_err(|error| failure(&error)))
            .collect()
    }
}

/// The cause of a simulation that was not made because the run is to end.
pub const INTERRUPTED: &str = "interrupted";

/// A curve's failure as the sampler sees it.
fn failure(error: &SolveError) -> SimError {
    if error.is_recoverable() {
        SimError::recoverable(cause(error))
    } else {
        SimError::fatal(error.to_string())
    }
}

/// A cause in words that are the same for the same kind of failure, so that failures can be counted.
fn cause(error: &SolveError) -> String {
    match error {
        SolveError::Field { field, .. } => format!("{field} is out of the model's range"),
        SolveError::Derived { quantity, .. } => {
            format!("{quantity} does not fit into a number")
        }
        SolveError::WorkLimit { solver, max_work, .. } => {
            format!("the {solver} solver needs more than {max_work} steps")
        }
        other => other.to_string(),
    }
}

impl Simulator for NeckGrowth {
    fn parameters(&self) -> usize {
        self.names.len()
    }

    fn observables(&self) -> usize {
        self.times_s.len()
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        let sintering = self.sintering(theta);
        if self.names.contains(&ParameterName::Phi) {
            self.run(&self.scene(theta)?, &sintering, out)
        } else {
            self.run(&self.scene, &sintering, out)
        }
    }

    fn simulate_batch(
        &self,
        _: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        self.curves(thetas, outputs, &|| true)
    }
}

/// A model that asks before every simulation whether to go on.
pub struct Watched<'a> {
    /// The model.
    pub model: &'a NeckGrowth,
    /// `false` ends the run as [`INTERRUPTED`].
    pub go_on: &'a (dyn Fn() -> bool + Sync),
}

impl Simulator for Watched<'_> {
    fn parameters(&self) -> usize {
        self.model.parameters()
    }

    fn observables(&self) -> usize {
        self.model.observables()
    }

    fn simulate(&self, theta: &[f64], out: &mut [f64]) -> Result<(), SimError> {
        if (self.go_on)() {
            self.model.simulate(theta, out)
        } else {
            Err(SimError::fatal(INTERRUPTED))
        }
    }

    fn simulate_batch(
        &self,
        _: usize,
        thetas: &[f64],
        outputs: &mut [f64],
    ) -> Vec<Result<(), SimError>> {
        self.model.curves(thetas, outputs, self.go_on)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_by_lanes_are_those_one_by_one_to_the_bit_and_so_are_failures() {
        let powder = dem_core::paper::PS;
        let model = NeckGrowth {
            names: vec![ParameterName::C1, ParameterName::TauS, ParameterName::DeltaC],
            powder,
            scene: PairSpec::new(powder, 1.08).build().expect("a scene"),
            kinetics: Kinetics::ThreeStage,
            solver: SolverSettings { max_work: 10_000, ..SolverSettings::of(SolverKind::Verlet) },
            times_s: vec![0.0, 0.01, 0.03, 0.08, 0.5],
        };
        let (rows, m) = (197, model.observables());
        let thetas: Vec<f64> = (0..rows)
            .flat_map(|i| {
                let u = |step: f64| (i as f64 * step).fract();
                [10f64.powf(-6.0 + 5.0 * u(0.618)), 10f64.powf(-2.0 + 2.0 * u(0.755)), 2e-7]
            })
            .chain([f64::NAN, 0.07, 2e-7])
            .collect();
        let mut together = vec![0.0; thetas.len() / 3 * m];
        let found = model.simulate_batch(0, &thetas, &mut together);
        let mut failed = 0;
        for ((theta, row), result) in
            thetas.chunks_exact(3).zip(together.chunks_exact(m)).zip(&found)
        {
            let mut alone = vec![0.0; m];
            assert_eq!(*result, model.simulate(theta, &mut alone), "{theta:?}");
            match result {
                Ok(()) => assert_eq!(row, alone, "{theta:?}"),
                Err(_) => failed += 1,
            }
        }
        let stopped = model.curves(&thetas, &mut together, &|| false);
        assert!(stopped.iter().all(|result| *result == Err(SimError::fatal(INTERRUPTED))));
        assert!(failed > 1 && failed < rows, "{failed} of {rows} failed");
    }

    #[test]
    fn phi_as_a_fourth_parameter_moves_the_plateau_and_nothing_before_it() {
        let model = NeckGrowth {
            names: vec![ParameterName::TauS, ParameterName::Phi],
            powder: dem_core::paper::PS,
            scene: PairSpec::new(dem_core::paper::PS, 1.2).build().expect("a scene"),
            kinetics: Kinetics::Frenkel,
            solver: SolverSettings::of(SolverKind::ClosedForm),
            times_s: vec![0.01, 10.0],
        };
        let mut low = [0.0; 2];
        let mut high = [0.0; 2];
        model.simulate(&[0.07, 1.05], &mut low).expect("a curve");
        model.simulate(&[0.07, 1.25], &mut high).expect("a curve");
        assert_eq!(low[0], high[0]);
        assert!((low[1] - 1.05).abs() < 1e-12 && (high[1] - 1.25).abs() < 1e-12);
    }
}
