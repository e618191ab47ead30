//! The pair simulator as the sampler sees it: from a parameter vector to contact ratios at the
//! observation times.

use dem_core::{
    Kinetics, PairScene, PairSpec, Powder, Sintering, SolveError, SolverSettings, contact_ratios,
};
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
        match contact_ratios(scene, self.kinetics, sintering, &self.solver, &self.times_s, out) {
            Ok(_) => Ok(()),
            Err(error) if error.is_recoverable() => Err(SimError::recoverable(cause(&error))),
            Err(error) => Err(SimError::fatal(error.to_string())),
        }
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem_core::SolverKind;

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
