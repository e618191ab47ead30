//! The stages of a run: their records, as plain data, and who watches them.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

/// Record of one stage.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageRecord {
    /// Stage, from 0 (the prior).
    pub stage: usize,
    /// Whether this is the final, frozen proposal.
    pub last: bool,
    /// Simulations of this stage.
    pub simulations: usize,
    /// Simulations so far.
    pub total: usize,
    /// Failed simulations of this stage.
    pub failed: usize,
    /// Failed simulations so far.
    pub failed_total: usize,
    /// Power of the likelihood that this stage's proposal was fitted to; 0 for the prior.
    pub beta: f64,
    /// Effective sample size of all samples so far, at full likelihood.
    pub ess: f64,
    /// Log evidence so far.
    pub log_evidence: f64,
    /// Its standard error.
    pub log_evidence_se: f64,
    /// Pareto shape of the weights so far.
    pub khat: f64,
    /// Means of the parameters so far, in the priors' coordinates.
    pub means: Vec<f64>,
    /// Standard deviations of the parameters so far, in the priors' coordinates.
    pub sds: Vec<f64>,
    /// The proposal that this stage drew from, in normal scores.
    pub proposal: MixtureRecord,
}

/// A mixture of Student-t components in normal scores, beside a share of the prior.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MixtureRecord {
    /// Share of the prior (1 in the first stage).
    pub prior_share: f64,
    /// Components.
    pub components: Vec<ComponentRecord>,
}

/// One component of a proposal.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentRecord {
    /// Share of the draws.
    pub weight: f64,
    /// Centre, in normal scores.
    pub mean: Vec<f64>,
    /// Scale matrix, in normal scores, row by row.
    pub scale: Vec<Vec<f64>>,
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
}

/// Watches a run, and may end it.
pub trait Observer {
    /// Called after every stage; `Break` ends the run with the samples so far.
    fn stage(&mut self, record: &StageRecord) -> ControlFlow<()>;

    /// Called after the last stage, before each step of the way from its samples to the posterior: `done` of `of` steps are
    /// done, the next one is `what`. With fast simulators they take longer than the stages.
    fn finishing(&mut self, _done: usize, _of: usize, _what: &'static str) {}
}

/// Watches nothing.
impl Observer for () {
    fn stage(&mut self, _: &StageRecord) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Tells an observer the steps from the last stage to the posterior.
pub(crate) struct Finishing<'a>(pub(crate) &'a mut dyn Observer);

impl Finishing<'_> {
    /// All steps.
    const STEPS: usize = 8;
    /// Those of the integrals, which come first.
    const OF_INTEGRALS: usize = 4;

    /// Before one of the two halves of one of so many folds.
    pub(crate) fn of_integrals(&mut self, half: usize, folds: usize, what: &'static str) {
        self.step(half * Self::OF_INTEGRALS / (2 * folds), what);
    }

    /// Before a step behind those of the integrals.
    pub(crate) fn after_integrals(&mut self, number: usize, what: &'static str) {
        self.step(Self::OF_INTEGRALS + number, what);
    }

    fn step(&mut self, done: usize, what: &'static str) {
        self.0.finishing(done, Self::STEPS, what);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        FixedSigma, FnSimulator, Noise, Observations, Parameter, Prior, PriorSpec, Problem,
        Settings, calibrate,
    };

    /// Stages and steps in the order in which they were told.
    #[derive(Default)]
    struct Told {
        stages: usize,
        steps: Vec<(usize, usize, &'static str)>,
    }

    impl Observer for Told {
        fn stage(&mut self, _: &StageRecord) -> ControlFlow<()> {
            assert!(self.steps.is_empty(), "a stage after the first step");
            self.stages += 1;
            ControlFlow::Continue(())
        }

        fn finishing(&mut self, done: usize, of: usize, what: &'static str) {
            self.steps.push((done, of, what));
        }
    }

    #[test]
    fn every_step_after_the_last_stage_is_told_in_its_order() {
        let simulator = FnSimulator::new(2, 1, |theta: &[f64], out: &mut [f64]| {
            out[0] = theta[0] + 0.1 * theta[1];
            Ok(())
        });
        let prior = Prior::new(PriorSpec::Normal { mean: 0.0, sd: 1.0 }).expect("a prior");
        let problem = Problem {
            simulator: &simulator,
            parameters: ["x", "y"].map(|name| Parameter::new(name, "1", prior.clone())).to_vec(),
            observations: Observations::new(vec![0.0], vec![1.0]).expect("one"),
            noise: Noise::Fixed { sigma: FixedSigma::Absolute(0.5) },
        };
        // Local quadratics in two halves, and a Gaussian process held against each of many sub-nets.
        for settings in [Settings::default(), Settings::for_budget(256)] {
            let mut told = Told::default();
            let posterior = calibrate(&problem, &settings, &mut told).expect("a posterior");
            assert_eq!(told.stages, posterior.stages.len());
            let done: Vec<usize> = told.steps.iter().map(|(done, ..)| *done).collect();
            assert!(done.is_sorted() && done.len() >= 8, "{done:?}");
            assert!((0..8).all(|step| done.contains(&step)), "{done:?}");
            assert!(told.steps.iter().all(|(_, of, _)| *of == 8));
        }
    }
}
