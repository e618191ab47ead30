//! `compare.json`: the comparison as data.

use serde::Serialize;
use smc_calib::trust::limits::INFORMED_BITS;
use smc_calib::{LeaveOneOut, Noise, Verdict};

use super::strength::Strength;
use crate::error::InputError;
use crate::plan::Plan;
use crate::record::{Doubt, FitError, Record};

/// Version of the layout of `compare.json`.
pub(crate) const SCHEMA_VERSION: u32 = 2;

/// Range of the final contact ratio where it is calibrated: from no flattening at all to a little beyond full
/// coalescence, the same for every material and kinetics.
pub(crate) const PHI_RANGE: [f64; 2] = [1.0, 1.35];

/// `compare.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of the layout.
    pub schema_version: u32,
    /// Everything that decides the result.
    pub plan: ReportPlan,
    /// One entry per material or experiment.
    pub comparisons: Vec<Comparison>,
}

/// Everything that decides the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReportPlan {
    /// Simulations per calibration.
    pub samples: usize,
    /// Seed.
    pub seed: u64,
    /// Whether phi was calibrated.
    pub phi: bool,
    /// The noise models, by name.
    pub noises: Vec<String>,
    /// The experiments, each with its first plan (the others differ in kinetics, parameters and noise).
    pub experiments: Vec<Plan>,
}

/// The kinetics on one experiment, under each noise model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Name of the run.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Number of observations.
    pub observations: usize,
    /// The final contact ratio where it was not calibrated.
    pub final_contact_ratio: f64,
    /// Reason for this value.
    pub final_contact_ratio_reason: Option<String>,
    /// The noise models, in the order of the entries.
    pub noises: Vec<NoiseEvidence>,
    /// One entry per noise model and kinetics, noise by noise.
    pub entries: Vec<Entry>,
    /// Conclusion in plain words.
    pub verdict: Vec<String>,
    /// Reasons to be careful.
    pub warnings: Vec<String>,
}

/// A noise model, with all kinetics together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseEvidence {
    /// Its name.
    pub name: String,
    /// The model itself.
    pub noise: Noise,
    /// Log of its evidence, averaged over the kinetics.
    pub log_evidence: f64,
    /// Probability of this noise, each model of the table being as likely beforehand.
    pub probability: f64,
    /// The kinetics of largest evidence under it.
    pub best: String,
}

/// One kinetics under one noise model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Entry {
    /// Name of the kinetics.
    pub kinetics: String,
    /// Name of the noise model.
    pub noise: String,
    /// Log evidence.
    pub log_evidence: f64,
    /// Its standard error.
    pub log_evidence_se: f64,
    /// Probability of this model, each of the table being as likely beforehand.
    pub probability: f64,
    /// Log evidence minus that of the best kinetics under the same noise.
    pub log_bayes_factor: f64,
    /// The strength of that evidence.
    pub strength: Strength,
    /// Errors of the MAP curve.
    pub error: FitError,
    /// Leave-one-out predictive density.
    pub leave_one_out: LeaveOneOut,
    /// Observations whose predictive density was computed by calibrating again without them.
    pub refitted: Vec<usize>,
    /// Difference of that density to the largest one under the same noise.
    pub leave_one_out_difference: f64,
    /// Standard deviation of that difference over data sets.
    pub leave_one_out_difference_spread: f64,
    /// The parameters, with the information gained on each.
    pub informed: Vec<Informed>,
    /// Number of parameters, or of combinations where only these matter, that the data inform.
    pub informed_parameters: usize,
    /// Lag-1 autocorrelation of the MAP curve's residuals, whitened where the noise is correlated.
    pub residual_lag1: f64,
    /// Whether these may be independent, as the likelihood assumes.
    pub residuals_independent: bool,
    /// Effective sample size.
    pub ess: f64,
    /// Pareto shape of the importance weights.
    pub khat: f64,
    /// What the sampler's diagnostics say.
    pub sampling: Verdict,
    /// What of the clock and the priors is to be suspected.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

/// Information gained on a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Informed {
    /// The parameter, or `c1 * delta_c^2`.
    pub name: String,
    /// Divergence of its posterior from its prior \[bits\].
    pub bits: f64,
    /// Posterior median.
    pub median: f64,
    /// 95 % interval.
    pub eti95: [f64; 2],
    /// Whether it counts as a parameter of its own: not C1 and delta_c where only their product matters.
    pub counts: bool,
}

impl Comparison {
    /// From the entries of all kinetics; verdict and warnings are not filled in.
    pub(super) fn new(
        plan: &Plan,
        noises: Vec<(String, Noise)>,
        mut entries: Vec<Entry>,
    ) -> Result<Self, InputError> {
        let (pair, measured) = plan.pair()?;
        let noises = probabilities(noises, &mut entries);
        Ok(Self {
            name: plan.name.clone(),
            title: plan.title.clone(),
            observations: measured.control.len(),
            final_contact_ratio: pair.final_contact_ratio,
            final_contact_ratio_reason: pair.final_contact_ratio_reason.clone(),
            noises,
            entries,
            verdict: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// Whether phi was calibrated.
    pub fn with_phi(&self) -> bool {
        self.entries.iter().all(|e| e.informed.iter().any(|informed| informed.name == "phi"))
    }

    /// The entry with the largest evidence.
    pub fn best(&self) -> Option<&Entry> {
        self.entries.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
    }

    /// The kinetics under one noise model.
    pub fn under<'a>(&'a self, noise: &'a str) -> impl Iterator<Item = &'a Entry> {
        self.entries.iter().filter(move |entry| entry.noise == noise)
    }

    /// The best kinetics under one noise model.
    pub fn best_under(&self, noise: &str) -> Option<&Entry> {
        let under = self.entries.iter().filter(|entry| entry.noise == noise);
        under.max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
    }

    /// Kinetics in the order of the table.
    pub fn kinetics(&self) -> Vec<&str> {
        let first = self.noises.first().map_or("", |noise| noise.name.as_str());
        self.entries
            .iter()
            .filter(|entry| entry.noise == first)
            .map(|entry| entry.kinetics.as_str())
            .collect()
    }

    /// One cell of the table.
    pub fn cell(&self, kinetics: &str, noise: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.kinetics == kinetics && entry.noise == noise)
    }
}

/// Fills in the probability of every entry, and gives those of the noise models.
fn probabilities(noises: Vec<(String, Noise)>, entries: &mut [Entry]) -> Vec<NoiseEvidence> {
    let logs: Vec<f64> = entries.iter().map(|entry| entry.log_evidence).collect();
    for (entry, probability) in entries.iter_mut().zip(weights(&logs)) {
        entry.probability = probability;
    }
    let of = |(name, noise): (String, Noise)| {
        let own: Vec<&Entry> = entries.iter().filter(|entry| entry.noise == name).collect();
        let best = own.iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence));
        let top = best.map_or(f64::NEG_INFINITY, |best| best.log_evidence);
        let sum: f64 = own.iter().map(|entry| (entry.log_evidence - top).exp()).sum();
        NoiseEvidence {
            log_evidence: top + (sum / own.len().max(1) as f64).ln(),
            probability: own.iter().map(|entry| entry.probability).sum(),
            best: best.map_or_else(String::new, |best| best.kinetics.clone()),
            name,
            noise,
        }
    };
    noises.into_iter().map(of).collect()
}

/// Probabilities of models that are equally likely beforehand, from their log evidences.
pub(crate) fn weights(log_evidences: &[f64]) -> Vec<f64> {
    let top = log_evidences.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = log_evidences.iter().map(|log| (log - top).exp()).sum();
    log_evidences.iter().map(|log| (log - top).exp() / sum).collect()
}

impl Entry {
    pub(super) fn new(
        record: &Record,
        noise: &str,
        leave_one_out: LeaveOneOut,
        refitted: Vec<usize>,
    ) -> Result<Self, InputError> {
        let pair = record.pair()?;
        let (informed, counted) = informed(record);
        Ok(Self {
            kinetics: pair.plan.kinetics.name().to_owned(),
            noise: noise.to_owned(),
            probability: 0.0,
            log_evidence: record.log_evidence.value,
            log_evidence_se: record.log_evidence.se,
            log_bayes_factor: 0.0,
            strength: Strength::None,
            error: pair.found.map_error,
            leave_one_out_difference: 0.0,
            leave_one_out_difference_spread: 0.0,
            leave_one_out,
            refitted,
            informed_parameters: counted,
            informed,
            residual_lag1: pair.found.residuals.lag1,
            residuals_independent: pair.found.residuals.independent,
            ess: record.ess.importance,
            khat: record.khat,
            sampling: record.trust.verdict,
            doubts: pair.neck_growth.doubts.clone(),
        })
    }
}

/// The parameters of a result with the information gained on each, and the number of those that the data inform.
pub(super) fn informed(record: &Record) -> (Vec<Informed>, usize) {
    let mut informed: Vec<Informed> = record
        .parameters
        .iter()
        .map(|summary| Informed {
            name: summary.parameter.name.clone(),
            bits: summary.information_gain_bits,
            median: summary.in_si.median,
            eti95: [summary.in_si.eti95.lower, summary.in_si.eti95.upper],
            counts: true,
        })
        .collect();
    let pair = record.pair().ok();
    if let Some(product) = pair.and_then(|pair| pair.neck_growth.product.as_ref()) {
        for one in &mut informed {
            one.counts = one.name != "c1" && one.name != "delta_c";
        }
        informed.push(Informed {
            name: product.name.clone(),
            bits: product.information_gain_bits,
            median: product.median,
            eti95: product.eti95,
            counts: true,
        });
    }
    let counted = informed.iter().filter(|one| one.counts && one.bits >= INFORMED_BITS).count();
    (informed, counted)
}

/// Fills in the differences to the best among entries under one noise; `densities` are the log predictive densities of each observation, per entry.
pub(super) fn rank(entries: &mut [Entry], densities: &[Vec<f64>]) {
    let best = |value: &dyn Fn(&Entry) -> f64| {
        entries.iter().enumerate().max_by(|a, b| value(a.1).total_cmp(&value(b.1))).map(|(k, _)| k)
    };
    let (Some(by_evidence), Some(by_prediction)) =
        (best(&|entry| entry.log_evidence), best(&|entry| entry.leave_one_out.ln_density))
    else {
        return;
    };
    let top = entries[by_evidence].log_evidence;
    for (entry, density) in entries.iter_mut().zip(densities) {
        entry.log_bayes_factor = entry.log_evidence - top;
        entry.strength = Strength::of(-entry.log_bayes_factor);
        let differences: Vec<f64> =
            density.iter().zip(&densities[by_prediction]).map(|(a, b)| a - b).collect();
        let m = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / m;
        let squares: f64 = differences.iter().map(|d| (d - mean).powi(2)).sum();
        entry.leave_one_out_difference = m * mean;
        entry.leave_one_out_difference_spread = (m * squares / (m - 1.0).max(1.0)).sqrt();
    }
}
