//! The values of the draws that are exported.

use std::collections::{BTreeMap, HashMap};

use campaign::Contents;
use rayon::prelude::*;
use smc_calib::{Simulations, predicted_outputs};

use super::observed::Observed;
use super::replay::{Replay, Simulated};
use crate::plan::run_number;
use crate::report::SampleColumns;

/// Largest normal score of the end of a prior, which is infinite.
const FARTHEST: f64 = 7.0;

/// The parameters that every run of a program was placed at.
pub(super) fn placed(contents: Option<&Contents>) -> HashMap<u64, &[f64]> {
    let tasks = contents.into_iter().flat_map(|contents| &contents.tasks);
    tasks.map(|task| (task.number, task.parameters.as_slice())).collect()
}

/// Simulated values of samples.
pub(super) struct Curves<'a> {
    pub(super) replay: Replay<'a>,
    pub(super) placed: HashMap<u64, &'a [f64]>,
}

impl Curves<'_> {
    /// Those of a sample; none where it failed, or they are not known.
    pub(super) fn of(&self, sample: usize, theta: &[f64]) -> Option<Vec<f64>> {
        self.fate(sample, theta).flatten()
    }

    /// Those of a sample, or that it failed; none where a run of it is not stored, or was placed elsewhere since the record was written.
    fn fate(&self, sample: usize, theta: &[f64]) -> Option<Option<Vec<f64>>> {
        let plan = self.replay.plan;
        let elsewhere = plan.commands().any(|(experiment, ..)| {
            self.placed.get(&run_number(plan, sample, experiment)) != Some(&theta)
        });
        match (elsewhere, self.replay.sample(sample, theta)) {
            (false, Simulated::Values(values)) => Some(Some(values)),
            (false, Simulated::Failed(_)) => Some(None),
            _ => None,
        }
    }

    /// Values of draws of these samples; none where those of one are not known.
    pub(super) fn simulated(
        &self,
        samples: &[usize],
        placed: &[Vec<f64>],
    ) -> Option<Vec<Vec<f64>>> {
        let distinct: BTreeMap<usize, &[f64]> =
            samples.iter().zip(placed).map(|(sample, theta)| (*sample, &theta[..])).collect();
        let found: Option<HashMap<usize, Vec<f64>>> = distinct
            .into_par_iter()
            .map(|(sample, theta)| Some((sample, self.of(sample, theta)?)))
            .collect();
        found.map(|found| samples.iter().map(|sample| found[sample].clone()).collect())
    }

    /// Values of draws of a process through the runs of a program, which was run at none of them; none where too few runs are stored.
    pub(super) fn predicted(
        &self,
        observed: &[Observed<'_>],
        of_all: &SampleColumns,
        thetas: &[Vec<f64>],
    ) -> Option<Vec<Vec<f64>>> {
        let parameters = &self.replay.plan.parameters;
        let (n, width) = (of_all.weights.len(), self.replay.plan.observations());
        let z = |theta: &[f64]| -> Vec<f64> {
            let each = parameters.iter().zip(theta);
            each.map(|(one, theta)| one.prior.to_z(*theta).clamp(-FARTHEST, FARTHEST)).collect()
        };
        let ln_joint = |outputs: &[f64]| -> f64 {
            observed.iter().map(|of| of.likelihood.ln_joint(&outputs[of.places.clone()])).sum()
        };
        let (mut outputs, mut ln_likelihood) = (Vec::new(), Vec::new());
        let (mut scores, mut weights) = (Vec::new(), Vec::new());
        for sample in 0..n {
            let theta: Vec<f64> = of_all.parameters.iter().map(|column| column[sample]).collect();
            // A run that is not stored has no part.
            let Some(fate) = self.fate(sample, &theta) else { continue };
            scores.extend(z(&theta));
            weights.push(of_all.weights[sample]);
            match fate {
                Some(values) => {
                    ln_likelihood.push(ln_joint(&values));
                    outputs.extend(values);
                }
                None => {
                    ln_likelihood.push(f64::NEG_INFINITY);
                    outputs.resize(outputs.len() + width, 0.0);
                }
            }
        }
        let of = Simulations {
            parameters: parameters.len(),
            z: &scores,
            outputs: &outputs,
            ln_likelihood: &ln_likelihood,
            weights: &weights,
            ln_joint: &ln_joint,
        };
        let at: Vec<f64> = thetas.iter().flat_map(|theta| z(theta)).collect();
        let rows = predicted_outputs(&of, &at)?;
        Some(rows.chunks_exact(width).map(<[f64]>::to_vec).collect())
    }
}
