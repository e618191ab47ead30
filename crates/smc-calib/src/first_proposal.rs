//! An earlier posterior as the first proposal of a run.

use crate::cholesky::cholesky;
use crate::cloud::Cloud;
use crate::mixture::{Component, Proposal};
use crate::{CalibrateError, ComponentRecord, MixtureRecord, Parameter, Settings};
use serde::{Deserialize, Serialize};

/// Most components of the mixture.
const MOST_COMPONENTS: usize = 8;
/// Largest normal score that counts as inside a prior: no prior has a share worth the name beyond it.
const FARTHEST: f64 = 9.0;
/// How far shares may be from a sum of one.
const ROUNDING: f64 = 1e-9;

/// An earlier posterior, of a cheaper model or a coarser mesh, as a mixture that the first samples are drawn from:
/// [`Settings::first_proposal`].
///
/// It decides where the first samples are, and nothing else. Weights are the likelihood times the prior over the density that
/// all samples together were drawn from, so that the answer is that of the new model and its own prior. That density is nowhere
/// below [`PRIOR_SHARE`](Self::PRIOR_SHARE) of the prior in the first stage and [`Settings::defensive_share`] in the others:
/// an earlier posterior that is wrong costs simulations, not the answer.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FirstProposal {
    /// The mixture, in normal scores of the new priors.
    pub mixture: MixtureRecord,
    /// Share of the earlier posterior that lies outside the new priors and was left out.
    pub outside_priors: f64,
}

impl FirstProposal {
    /// Share of the first stage that is drawn from the prior.
    pub const PRIOR_SHARE: f64 = 0.25;
    /// Factor on the covariances of the earlier posterior. With 4 results at 60 simulations are a little worse, also from an earlier
    /// posterior that is some standard deviations off (`results/benchmarks/proposal/report.md`).
    pub const WIDENING: f64 = 2.0;

    /// Fits it to weighted samples of an earlier posterior.
    ///
    /// `columns` has the values \[SI\] of each parameter at the earlier samples; none for a parameter that the earlier run did
    /// not have, which gets the centre and the width of its prior. Samples outside the support of a prior, or more than 9 normal
    /// scores out, are left out.
    ///
    /// # Errors
    /// [`CalibrateError::FirstProposal`] where the two runs have no parameter in common, where numbers do not fit together, and
    /// where fewer effective samples than the shared parameters and two more are inside the priors.
    pub fn fitted(
        parameters: &[Parameter],
        columns: &[Option<&[f64]>],
        weights: &[f64],
        settings: &Settings,
    ) -> Result<Self, CalibrateError> {
        let shared: Vec<(usize, &[f64])> = columns
            .iter()
            .enumerate()
            .filter_map(|(place, column)| Some((place, (*column)?)))
            .collect();
        if shared.is_empty() {
            return Err(refused("the earlier posterior has none of the parameters"));
        }
        let fit = columns.len() == parameters.len()
            && shared.iter().all(|(_, column)| column.len() == weights.len())
            && weights.iter().all(|w| w.is_finite() && *w >= 0.0);
        let total: f64 = weights.iter().sum();
        if !fit || total <= 0.0 {
            return Err(refused(
                "columns and weights of the earlier posterior do not fit together",
            ));
        }
        let k = shared.len();
        let (mut z, mut inside) = (Vec::with_capacity(weights.len() * k), Vec::new());
        for (row, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let scores =
                shared.iter().map(|(place, column)| score(&parameters[*place], column[row]));
            if let Some(scores) = scores.collect::<Option<Vec<f64>>>() {
                z.extend(scores);
                inside.push(*weight);
            }
        }
        let outside_priors = (1.0 - inside.iter().sum::<f64>() / total).max(0.0);
        let cloud = Cloud::new(k, &z, &inside, settings.seed, 0);
        let Some(cloud) = cloud.filter(|cloud| cloud.ess >= (k + 2) as f64) else {
            return Err(refused(format!(
                "{:.3} % of the earlier posterior lie outside the priors, and the rest is too few samples for a shape",
                100.0 * outside_priors
            )));
        };
        let fit = cloud.fit(MOST_COMPONENTS, settings.seed, 0);
        let d = parameters.len();
        let components = fit.components.iter().map(|g| {
            let (mut mean, mut factor) = (vec![0.0; d], vec![0.0; d * d]);
            (0..d).for_each(|j| factor[j * d + j] = 1.0);
            for (a, (i, _)) in shared.iter().enumerate() {
                mean[*i] = g.mean[a];
                for (b, (j, _)) in shared.iter().enumerate().take(a + 1) {
                    factor[i * d + j] = g.factor[a * k + b] * Self::WIDENING.sqrt();
                }
            }
            let weight = g.weight * (1.0 - Self::PRIOR_SHARE);
            Component::new(weight, mean, factor, settings.degrees_of_freedom)
        });
        let proposal = Proposal {
            dimension: d,
            prior_share: Self::PRIOR_SHARE,
            degrees_of_freedom: settings.degrees_of_freedom,
            components: components.collect(),
        };
        Ok(Self { mixture: proposal.record(), outside_priors })
    }
}

fn refused(problem: impl Into<String>) -> CalibrateError {
    CalibrateError::FirstProposal { problem: problem.into() }
}

/// Normal score of a value; none where the prior does not allow it.
fn score(parameter: &Parameter, value: f64) -> Option<f64> {
    let (lower, upper) = parameter.prior.support();
    let z = parameter.prior.to_z(value);
    ((lower..=upper).contains(&value) && z.abs() <= FARTHEST).then_some(z)
}

impl Settings {
    /// The proposal of the first stage, in `d` parameters: the prior, unless an earlier posterior is given.
    pub(crate) fn opening(&self, d: usize) -> Result<Proposal, CalibrateError> {
        let Some(given) = &self.first_proposal else { return Ok(Proposal::prior(d)) };
        let nu = self.degrees_of_freedom;
        let component = |c: &ComponentRecord| -> Option<Component> {
            let scale: Vec<f64> = c.scale.iter().flatten().copied().collect();
            let fits = c.mean.len() == d && scale.len() == d * d && c.degrees_of_freedom == nu;
            let numbers = c.weight >= 0.0 && c.mean.iter().all(|m| m.is_finite());
            let factor = if fits && numbers { cholesky(&scale, d)? } else { return None };
            Some(Component::new(c.weight, c.mean.clone(), factor, nu))
        };
        let components: Option<Vec<Component>> = given.components.iter().map(component).collect();
        let Some(components) = components else {
            return Err(refused(format!(
                "a component of the mixture has not the mean, the positive definite scale matrix and the {nu} degrees of freedom \
                 of {d} parameters"
            )));
        };
        let total = given.prior_share + components.iter().map(|c| c.weight).sum::<f64>();
        if !(given.prior_share > 0.0 && (total - 1.0).abs() <= ROUNDING) {
            return Err(refused(format!(
                "its shares sum to {total}, the prior's being {}; they must sum to 1, and the prior's be above 0",
                given.prior_share
            )));
        }
        let prior_share = given.prior_share;
        Ok(Proposal { dimension: d, prior_share, degrees_of_freedom: nu, components })
    }
}
