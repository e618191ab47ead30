//! An earlier posterior that a run begins from.

use serde::{Deserialize, Serialize};
use smc_calib::FirstProposal;

use crate::number::significant;

/// An earlier posterior, of a cheaper model or a coarser mesh, that the first samples are drawn from. It has all that the run
/// needs of it, so that the other result may be moved or changed afterwards.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EarlierPosterior {
    /// Folder or file of the result, as it was named.
    pub from: String,
    /// Name of that run.
    pub run: String,
    /// Its seed.
    pub seed: u64,
    /// Number of its simulations.
    pub simulations: usize,
    /// SHA-256 of its `posterior.json`.
    pub sha256: String,
    /// Parameters of this run that it has too, in the same unit.
    pub parameters: Vec<String>,
    /// Parameters of this run that it has not: they begin from their priors.
    pub from_prior: Vec<String>,
    /// Its parameters that this run has not, or has in another unit.
    pub left_out: Vec<String>,
    /// The mixture, and the share of the earlier posterior that is outside the priors of this run.
    pub first: FirstProposal,
}

impl EarlierPosterior {
    /// The result in words: `results/ps (run ps, 16384 simulations, seed 1, posterior.json 1234abcd...)`.
    pub(crate) fn result(&self) -> String {
        let Self { from, run, simulations, seed, sha256, .. } = self;
        let short = sha256.get(..12).unwrap_or(sha256);
        format!(
            "{from} (run {run}, {simulations} simulations, seed {seed}, posterior.json {short}...)"
        )
    }

    /// What is taken of it, and what is not.
    pub(crate) fn taken(&self) -> String {
        let mut text = self.parameters.join(", ");
        if !self.from_prior.is_empty() {
            text.push_str(&format!("; {} from the prior", self.from_prior.join(", ")));
        }
        if !self.left_out.is_empty() {
            text.push_str(&format!("; {} left out", self.left_out.join(", ")));
        }
        if self.first.outside_priors > 0.0 {
            let share = significant(100.0 * self.first.outside_priors, 2);
            text.push_str(&format!("; {share} % of it outside the priors, left out"));
        }
        text
    }
}
