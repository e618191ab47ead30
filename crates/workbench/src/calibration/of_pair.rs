//! One pair of a plan under its posterior.

use dem_core::Sintering;
use smc_calib::{Parameter, Posterior, Problem, Settings, SimError, Weighted, calibrate};

use crate::error::{Failure, InputError, RunError};
use crate::pair::derived::weighted;
use crate::pair::model::NeckGrowth;
use crate::plan::{ObservablePlan, PairPlan, Plan};

/// One pair of a plan, its model and its posterior.
pub(super) struct OfPair<'a> {
    pub(super) plan: &'a Plan,
    pub(super) pair: &'a PairPlan,
    pub(super) measured: &'a ObservablePlan,
    /// Place of the observable among those of the plan.
    pub(super) group: usize,
    pub(super) model: NeckGrowth,
    pub(super) posterior: &'a Posterior,
}

impl<'a> OfPair<'a> {
    pub(super) fn new(
        plan: &'a Plan,
        pair: &'a PairPlan,
        (group, measured): (usize, &'a ObservablePlan),
        posterior: &'a Posterior,
    ) -> Result<Self, Failure> {
        let model = NeckGrowth::new(pair, &plan.parameters, measured.control.clone())?;
        Ok(Self { plan, pair, measured, group, model, posterior })
    }

    /// The paper's parameters, where the powder is one of the paper's: they hold for one temperature, and not with a heat.
    pub(super) fn paper(&self) -> Option<Sintering> {
        let material = self.pair.material.filter(|_| self.pair.heat.is_none());
        material.map(|material| material.table3_sintering_at(self.pair.powder.radius_m))
    }

    /// Time of first contact in the clock of the table \[s\], that of the MAP where it is calibrated.
    pub(super) fn start_s(&self) -> f64 {
        self.model.start_s(&self.posterior.map.theta)
    }

    /// The model for curves of other parameters than the calibrated ones, with first contact and heat as the MAP has them.
    pub(super) fn reference(&self) -> NeckGrowth {
        self.model.started_at(self.start_s()).heated_as(&self.posterior.map.theta)
    }

    /// Values with the weights of their samples.
    pub(super) fn weighted(&self, value: impl Fn(&[f64]) -> f64) -> Weighted {
        weighted(self.posterior, |theta| Some(value(theta)))
    }
}

/// Calibrates a pair on what was measured of it, with parameters of its own; none where that gives no posterior.
pub(super) fn calibrated_alone(
    pair: &PairPlan,
    parameters: &[Parameter],
    measured: &ObservablePlan,
    settings: &Settings,
) -> Result<Option<Posterior>, InputError> {
    let problem = Problem {
        simulator: &NeckGrowth::new(pair, parameters, measured.control.clone())?,
        parameters: parameters.to_vec(),
        observations: measured.observations()?,
        noise: measured.noise.clone(),
    };
    Ok(calibrate(&problem, settings, &mut ()).ok())
}

/// A curve of the report that cannot be computed.
pub(super) fn simulation_failure(error: &SimError) -> Failure {
    RunError::new(format_args!("a curve of the report could not be computed: {error}")).into()
}
