//! `posterior.json`: the one file to inspect.
//!
//! It holds the whole plan, what was found, and whether to trust it; the samples themselves are beside it in
//! `samples.csv` and `draws.csv`. It has no times of day, thread counts, executors or durations, so that the same plan
//! gives the same bytes (durations are in `timings.json`). A JSON schema describes it:
//! `crates/workbench/schema/posterior.schema.json`.

mod doubt;
mod lengths;
mod neck_growth;
mod population;
mod read;
mod sensitivity;

use serde::{Deserialize, Serialize};
use smc_calib::{
    BandPoint, Counters, EffectiveSampleSize, Evidence, Failing, Failure, MapPoint,
    ParameterSummary, PathPoint, PredictiveCheck, Residuals, ShapeSummary, SigmaSummary,
    StageRecord, StopReason, Trust, Verdict,
};

pub use doubt::{Doubt, Excluded};
pub use neck_growth::{
    Curves, Derived, Fit, KneeSummary, NeckGrowthRecord, OtherKinetics, PaperComparison,
    PrintedParameter, ProductSummary,
};
pub use population::{Marginal, MemberRecord, NextPair, PopulationRecord};
pub(crate) use read::is_reported;
pub use read::{FILE_NAME, SCHEMA_VERSION, locate, parse, read, read_calibration};
pub use sensitivity::{Method, Sensitivity, SensitivityOf};

use crate::error::{InputError, Mistake};
use crate::plan::{ObservablePlan, PairPlan, Plan, SimulatorPlan};

/// A calibration that was done.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Everything that decided the result.
    pub plan: Plan,
    /// False for tuned weights (`ess-target`), which are no posterior.
    pub is_posterior: bool,
    /// One summary per parameter: in the prior's coordinate (log10 or linear) and in SI.
    pub parameters: Vec<ParameterSummary>,
    /// Whether `draws.csv`, and what follows from parameters, are of draws of the Gaussian process through the samples, which know more
    /// than few weights do.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub drawn_by_process: bool,
    /// Correlation in the priors' coordinates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Correlation in SI, row by row.
    pub correlation_si: Vec<Vec<f64>>,
    /// Log evidence.
    pub log_evidence: Evidence,
    /// Effective sample size.
    pub ess: EffectiveSampleSize,
    /// Pareto shape, the largest over weights and parameters.
    pub khat: f64,
    /// Whether to trust the result, and why.
    pub trust: Trust,
    /// The maximum a posteriori, with its simulated values.
    pub map: MapPoint,
    /// Results of each experiment, in the order of the plan.
    pub experiments: Vec<ExperimentRecord>,
    /// Recursive Bayes: what was known after each observation, on through the observables.
    pub path: Vec<PathPoint>,
    /// Record of each stage.
    pub stages: Vec<StageRecord>,
    /// Failed simulations by cause.
    pub failures: Vec<Failure>,
    /// Whether failing depends on the parameters, where, and what that means; none where nothing failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failing: Option<Failing>,
    /// Why the run ended.
    pub stop: StopReason,
    /// The result under correlated errors, where the residuals are alike and the noise model has them independent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensitivity: Option<Sensitivity>,
    /// The population, where the result is that of several runs; its parameters are those of the next member.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<PopulationRecord>,
    /// Reasons to be careful in plain words: warnings on the input, doubts of its clock and priors, and the concerns of
    /// `trust`.
    pub advice: Vec<String>,
    /// Work done.
    pub counters: Counters,
}

/// Results of one experiment.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRecord {
    /// Name of the experiment.
    pub name: String,
    /// Results of each observable, in the order of the plan.
    pub observables: Vec<ObservableRecord>,
    /// Results that only a pair of particles has; none for a program's experiment.
    pub neck_growth: Option<NeckGrowthRecord>,
}

/// One observable under the posterior.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservableRecord {
    /// Name of the observable.
    pub name: String,
    /// Name in tables and files, with the experiment where there are several.
    pub label: String,
    /// Noise standard deviation, in the unit of the values; none where the table states it row by row.
    pub sigma: Option<SigmaSummary>,
    /// What else the noise has: correlation length and white share, or the outliers; none for independent normal noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_shape: Option<ShapeSummary>,
    /// How far the MAP is from the measurements, in their unit.
    pub map_error: FitError,
    /// How far the posterior mean is from the measurements.
    pub mean_error: FitError,
    /// Simulated values at the MAP.
    pub map: Vec<f64>,
    /// Observed minus MAP, and whether these are independent.
    pub residuals: Residuals,
    /// Posterior predictive bands at the observations; index and control are those of this observable.
    pub predictive: Vec<BandPoint>,
    /// Whether data made by the posterior are as far from their curves, where several observables were calibrated together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<PredictiveCheck>,
}

/// How far a curve is from the measurements.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitError {
    /// Root mean square of observed minus curve, in a/R.
    pub rmse: f64,
    /// Largest absolute difference, in a/R.
    pub max: f64,
}

impl FitError {
    /// Of a curve at the observation times.
    pub fn of(observed: &[f64], curve: &[f64]) -> Self {
        let residuals = observed.iter().zip(curve).map(|(o, c)| o - c);
        let sum: f64 = residuals.clone().map(|r| r * r).sum();
        let max = residuals.map(f64::abs).fold(0.0, f64::max);
        Self { rmse: (sum / observed.len() as f64).sqrt(), max }
    }
}

/// The one pair of particles of a run: what was planned, measured and found.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'r> {
    /// The planned pair.
    pub plan: &'r PairPlan,
    /// Its measurements.
    pub measured: &'r ObservablePlan,
    /// Its contact ratio under the posterior.
    pub found: &'r ObservableRecord,
    /// Results that only a pair has.
    pub neck_growth: &'r NeckGrowthRecord,
}

impl Record {
    /// Every observable: what was measured, and what was found.
    pub fn observables(&self) -> impl Iterator<Item = (&ObservablePlan, &ObservableRecord)> {
        let found = self.experiments.iter().flat_map(|experiment| &experiment.observables);
        self.plan.observables().map(|(_, plan)| plan).zip(found)
    }

    /// Whether intervals can be taken as they are: by the diagnostics of the sampler and the fit, and without a doubt of the
    /// clock or of a prior.
    pub fn trusted(&self) -> bool {
        let of_pairs = self.experiments.iter().filter_map(|one| one.neck_growth.as_ref());
        self.trust.trusted() && of_pairs.flat_map(|neck| &neck.doubts).next().is_none()
    }

    /// Whether standard errors say how far chance may move the result.
    pub fn errors_known(&self) -> bool {
        self.trust.verdict != Verdict::Untrusted && self.trust.evidence_error_known
    }

    /// The pair of one of the built-in experiments of a run.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a name that no built-in experiment of the run has.
    pub fn pair_named(&self, name: &str) -> Result<Pair<'_>, InputError> {
        self.pairs().find(|(own, _)| *own == name).map(|(_, pair)| pair).ok_or_else(|| {
            let names = self.pair_names();
            InputError::new("--of", Mistake::UnknownName)
                .found(format_args!("\"{name}\""))
                .expected(match names.len() {
                    0 => "a run of pairs of particles with the built-in simulator".to_owned(),
                    _ => format!("one of {}", names.join(", ")),
                })
                .did_you_mean(name, names)
        })
    }

    /// Names of the built-in experiments of a run.
    pub fn pair_names(&self) -> Vec<&str> {
        self.pairs().map(|(name, _)| name).collect()
    }

    fn pairs(&self) -> impl Iterator<Item = (&str, Pair<'_>)> {
        let planned = self.plan.experiments.iter().zip(&self.experiments);
        planned.filter_map(|(plan, found)| {
            let SimulatorPlan::Builtin(pair) = &plan.simulator else { return None };
            let (measured, own) = (plan.observables.first()?, found.observables.first()?);
            let neck_growth = found.neck_growth.as_ref()?;
            Some((plan.name.as_str(), Pair { plan: pair, measured, found: own, neck_growth }))
        })
    }

    /// The pair of a run with one built-in experiment.
    ///
    /// # Errors
    ///
    /// [`InputError`] that says what the run has instead.
    pub fn pair(&self) -> Result<Pair<'_>, InputError> {
        let (plan, measured) = self.plan.pair()?;
        let own = self.experiments.first().and_then(|experiment| {
            Some((experiment.observables.first()?, experiment.neck_growth.as_ref()?))
        });
        let Some((found, neck_growth)) = own else {
            return Err(InputError::new(&self.plan.name, Mistake::Damaged)
                .found("a record without the results of its pair")
                .help("run the calibration again"));
        };
        Ok(Pair { plan, measured, found, neck_growth })
    }
}
