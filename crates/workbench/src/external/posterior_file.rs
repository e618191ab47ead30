//! `posterior.json` of a plan: the one file to inspect. Its `kind` is `"plan"`; that of a material has none.
//!
//! The samples themselves are beside it in `samples.csv` and `draws.csv`. It holds no times of day, no executor and no
//! durations, so that the same plan gives the same bytes wherever it is run. A JSON schema describes it:
//! `crates/workbench/schema/plan-posterior.schema.json`.

use std::path::Path;

use serde::{Deserialize, Serialize};
use smc_calib::{
    BandPoint, Counters, EffectiveSampleSize, Evidence, Failure, MapPoint, ParameterSummary,
    PathPoint, Residuals, SigmaSummary, StageRecord, StopReason, Warning,
};

use super::plan::{ExternalPlan, ObservablePlan};
use crate::checksums;
use crate::error::{InputError, Mistake};
use crate::posterior_file::{self, FitError};

/// Version of the layout; a reader refuses others.
pub const SCHEMA_VERSION: u32 = 1;

/// What a file of this kind says of itself.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The posterior of a plan.
    Plan,
}

/// A calibration by a plan that was done.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanPosterior {
    /// What the file is.
    pub kind: Kind,
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Everything that decided the result.
    pub plan: ExternalPlan,
    /// Always true: tuned weights are not offered here.
    pub is_posterior: bool,
    /// One summary per parameter: in the prior's coordinate (log10 or linear) and in SI.
    pub parameters: Vec<ParameterSummary>,
    /// Correlation in the priors' coordinates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Correlation in SI, row by row.
    pub correlation_si: Vec<Vec<f64>>,
    /// Log evidence.
    pub log_evidence: Evidence,
    /// Effective sample size.
    pub ess: EffectiveSampleSize,
    /// Pareto shape, the largest over weights and parameters; trustworthy below 0.7.
    pub khat: f64,
    /// The maximum a posteriori among the samples, with its simulated values.
    pub map: MapPoint,
    /// What was found of each observable, in the order of the plan.
    pub observables: Vec<ObservableReport>,
    /// Recursive Bayes: what was known after each observation, on through the observables.
    pub path: Vec<PathPoint>,
    /// What each stage did.
    pub stages: Vec<StageRecord>,
    /// Failed samples by cause.
    pub failures: Vec<Failure>,
    /// Why the run ended.
    pub stop: StopReason,
    /// Reasons to be careful, as data.
    pub warnings: Vec<Warning>,
    /// The same in plain words, with those on the input.
    pub advice: Vec<String>,
    /// Work done.
    pub counters: Counters,
}

/// One observable under the posterior.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObservableReport {
    /// Its experiment.
    pub experiment: String,
    /// Its name.
    pub name: String,
    /// What it is called in tables and file names.
    pub label: String,
    /// The noise standard deviation, in the unit of the values; none where the table states it row by row.
    pub sigma: Option<SigmaSummary>,
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
}

impl PlanPosterior {
    /// Every observable: what was measured, and what was found.
    pub fn observables(&self) -> impl Iterator<Item = (&ObservablePlan, &ObservableReport)> {
        self.plan.observables().map(|(_, plan)| plan).zip(&self.observables)
    }
}

/// A posterior of either kind.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyPosterior {
    /// Of a material or a pair of particles.
    Pair(Box<posterior_file::PosteriorFile>),
    /// Of a plan.
    Plan(Box<PlanPosterior>),
}

/// Reads a `posterior.json` of either kind, the one in a folder, or the one in a run's folder.
///
/// # Errors
///
/// [`InputError`] that names file, line and remedy.
pub fn read_any(path: &Path) -> Result<AnyPosterior, InputError> {
    let file = posterior_file::locate(path);
    if path.is_dir() && !file.is_file() && path.join(super::store::RESOLVED).is_file() {
        return Err(InputError::new(path.display().to_string(), Mistake::MissingFile)
            .found("a run that has no posterior yet")
            .help(format_args!("how far it is: calibrate status {}", path.display()))
            .help(format_args!("to go on with it: calibrate --resume {}", path.display())));
    }
    checksums::read_as(&file, |name, text| {
        if is_of_a_plan(text) {
            parse(name, text).map(|file| AnyPosterior::Plan(Box::new(file)))
        } else {
            posterior_file::parse(name, text).map(|file| AnyPosterior::Pair(Box::new(file)))
        }
    })
}

fn is_of_a_plan(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Any {
        kind: Option<Kind>,
    }
    // A file that is cut off says so by its first lines.
    let cut_off = text.trim_start().trim_start_matches('{').trim_start().starts_with("\"kind\"");
    serde_json::from_str::<Any>(text).is_ok_and(|any| any.kind.is_some()) || cut_off
}

/// Reads text; `name` is what errors call it.
///
/// # Errors
///
/// [`InputError`] that names file, line and remedy.
pub fn parse(name: &str, text: &str) -> Result<PlanPosterior, InputError> {
    let file: PlanPosterior =
        serde_json::from_str(text).map_err(|error| posterior_file::bad_json(name, text, &error))?;
    if file.schema_version != SCHEMA_VERSION {
        return Err(InputError::new(name, Mistake::OutOfRange)
            .in_field("schema_version")
            .found(file.schema_version)
            .expected(SCHEMA_VERSION)
            .help(
                "it was written by another version of calibrate; resume the run to write it again",
            ));
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The committed schema is what the types say; `UPDATE_SCHEMA=1 cargo test -p calibrate schema` writes it anew.
    #[test]
    fn the_committed_schema_of_plans_is_that_of_the_types() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("schema").join("plan-posterior.schema.json");
        let schema = schemars::schema_for!(PlanPosterior);
        let mut text = serde_json::to_string_pretty(&schema).expect("a schema is JSON");
        text.push('\n');
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::write(&path, &text).expect("the schema");
        }
        let committed = std::fs::read_to_string(&path).expect("the committed schema");
        assert!(committed == text, "run UPDATE_SCHEMA=1 cargo test -p calibrate schema");
    }
}
