//! `posterior.json`: the one file to inspect.
//!
//! It holds the whole plan, what was found, and whether to trust it; the samples themselves are beside it in
//! `samples.csv` and `draws.csv`. It does not hold times of day, thread counts or durations, so that the same
//! plan gives the same bytes (durations are in `timings.json`). A JSON schema describes it:
//! `crates/workbench/schema/posterior.schema.json`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use smc_calib::{
    BandPoint, Counters, EffectiveSampleSize, Evidence, Failure, MapPoint, ParameterSummary,
    PathPoint, Residuals, SigmaSummary, StageRecord, StopReason, Warning,
};

use crate::checksums;
use crate::error::{InputError, Mistake};
use crate::external::REPORT;
use crate::plan::Plan;

/// Version of the layout of `posterior.json`; a reader refuses others.
pub const SCHEMA_VERSION: u32 = 1;

/// Name of the file in a run's folder.
pub const FILE_NAME: &str = "posterior.json";

/// A calibration that was done.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosteriorFile {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Everything that decided the result.
    pub plan: Plan,
    /// False for tuned weights (`ess-target`), which are no posterior.
    pub is_posterior: bool,
    /// One summary per parameter: in the prior's coordinate (log10 or linear) and in SI.
    pub parameters: Vec<ParameterSummary>,
    /// The same parameters in the form printed in Table 3, for kinetics with all three.
    pub printed: Vec<PrintedParameter>,
    /// The paper's parameters for this material and where they fall in the posterior.
    pub paper: Option<PaperComparison>,
    /// The one combination of c1 and delta_c that the data inform, for kinetics that do not separate them.
    pub product: Option<ProductSummary>,
    /// Correlation in the priors' coordinates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Correlation in SI, row by row.
    pub correlation_si: Vec<Vec<f64>>,
    /// The noise standard deviation, in a/R.
    pub sigma: Option<SigmaSummary>,
    /// Log evidence.
    pub log_evidence: Evidence,
    /// Effective sample size.
    pub ess: EffectiveSampleSize,
    /// Pareto shape, the largest over weights and parameters; trustworthy below 0.7.
    pub khat: f64,
    /// The maximum a posteriori, its curve at the observation times.
    pub map: MapPoint,
    /// Observed minus MAP curve, and whether these are independent.
    pub residuals: Residuals,
    /// How well four curves fit the measurements.
    pub fit: Fit,
    /// Where stage 2 gives way to stage 3, for kinetics with a knee.
    pub knee: Option<KneeSummary>,
    /// Posterior predictive bands at the observation times.
    pub predictive: Vec<BandPoint>,
    /// The same on a fine grid, with the curves of the fit plot.
    pub curves: Curves,
    /// Recursive Bayes: what was known after each observation.
    pub path: Vec<PathPoint>,
    /// What each stage did.
    pub stages: Vec<StageRecord>,
    /// Failed simulations by cause.
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

/// A parameter in the form printed in Table 3.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrintedParameter {
    /// `c1`, `tau_s` or `delta_c`.
    pub name: String,
    /// The unit that Table 3 prints.
    pub unit: String,
    /// Maximum a posteriori, through the map.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Mean and standard deviation of log10.
    pub mean_log10: f64,
    /// Standard deviation of log10.
    pub sd_log10: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// What the paper prints.
    pub paper: Option<f64>,
    /// Posterior probability of a smaller value, in percent.
    pub paper_percentile: Option<f64>,
}

/// The product c1 delta_c^2, all that the `regime-map` kinetics see of the two.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProductSummary {
    /// `c1 * delta_c^2`.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// At the MAP.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// Mean of log10.
    pub mean_log10: f64,
    /// Standard deviation of log10.
    pub sd_log10: f64,
    /// Divergence of its posterior from its prior \[bits\].
    pub information_gain_bits: f64,
    /// With the paper's parameters.
    pub paper: Option<f64>,
    /// Posterior probability of a smaller value, in percent.
    pub paper_percentile: Option<f64>,
}

/// The paper's parameters.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperComparison {
    /// As printed: c1, tau_s, delta_c.
    pub printed: [f64; 3],
    /// In SI, through the map: c1, tau_s, delta_c.
    pub si: [f64; 3],
    /// Posterior probability of a smaller SI value, in percent, per calibrated parameter; none for one that
    /// the paper does not have.
    pub percentile_si: Vec<Option<f64>>,
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
    #[must_use]
    pub fn of(observed: &[f64], curve: &[f64]) -> Self {
        let residuals = observed.iter().zip(curve).map(|(o, c)| o - c);
        let sum: f64 = residuals.clone().map(|r| r * r).sum();
        let max = residuals.map(f64::abs).fold(0.0, f64::max);
        Self { rmse: (sum / observed.len() as f64).sqrt(), max }
    }
}

/// How well four curves fit.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// The MAP curve.
    pub map: FitError,
    /// The posterior mean curve.
    pub posterior_mean: FitError,
    /// The paper's parameters, through the map of Table 3.
    pub paper: Option<FitError>,
    /// The best Frenkel curve (least squares in tau_s); none without an observation after t = 0.
    pub frenkel: Option<FitError>,
    /// Its tau_s \[s\].
    pub frenkel_tau_s: Option<f64>,
}

/// A derived quantity under the posterior.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Derived {
    /// At the MAP.
    pub map: f64,
    /// Posterior median.
    pub median: f64,
    /// Equal-tailed 95 % interval.
    pub eti95: [f64; 2],
    /// With the paper's parameters.
    pub paper: Option<f64>,
}

/// The knee between zipping and stretching.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KneeSummary {
    /// Posterior probability that there is one between the starting and the final contact. The rest is
    /// conditional on it.
    pub probability: f64,
    /// Contact ratio a_ve/R.
    pub contact_ratio: Derived,
    /// When it is reached \[s\].
    pub time_s: Derived,
}

/// Curves on a fine grid of times, all of the same length.
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Curves {
    /// Times \[s\].
    pub time_s: Vec<f64>,
    /// Posterior mean of the curve.
    pub mean: Vec<f64>,
    /// 50 % band of the curve: lower, upper.
    pub curve50: [Vec<f64>; 2],
    /// 90 % band of the curve.
    pub curve90: [Vec<f64>; 2],
    /// 90 % band of a new measurement; none where the noise is stated row by row.
    pub noisy90: Option<[Vec<f64>; 2]>,
    /// MAP curve.
    pub map: Vec<f64>,
    /// The paper's curve.
    pub paper: Option<Vec<f64>>,
    /// The best Frenkel curve; none without an observation after t = 0.
    pub frenkel: Option<Vec<f64>>,
}

/// The file that a path means: itself, the one in the folder it names, or the one in the report of a plan's run.
#[must_use]
pub fn locate(path: &Path) -> PathBuf {
    if !path.is_dir() {
        return path.to_owned();
    }
    let own = path.join(FILE_NAME);
    let reported = path.join(REPORT).join(FILE_NAME);
    if reported.is_file() && !own.is_file() { reported } else { own }
}

/// Reads a `posterior.json`, or the one in a folder.
///
/// # Errors
///
/// [`InputError`] that names file, line and remedy for a file that is missing, cut off, not a posterior, or of
/// another version.
pub fn read(path: &Path) -> Result<PosteriorFile, InputError> {
    let path = locate(path);
    checksums::read_as(&path, parse)
}

/// As [`read`], from text; `name` is what errors call it.
///
/// # Errors
///
/// As [`read`].
pub fn parse(name: &str, text: &str) -> Result<PosteriorFile, InputError> {
    #[derive(Deserialize)]
    struct Version {
        schema_version: u32,
        kind: Option<String>,
    }
    if text.trim().is_empty() {
        return Err(InputError::new(name, Mistake::Empty)
            .found("an empty file")
            .expected("a posterior.json")
            .help("run the calibration again: calibrate --material ps"));
    }
    let version: Version =
        serde_json::from_str(text).map_err(|error| bad_json(name, text, &error))?;
    if let Some(kind) = version.kind {
        return Err(InputError::new(name, Mistake::Conflict)
            .in_field("kind")
            .found(format_args!("\"{kind}\": the posterior of a plan"))
            .expected(
                "the posterior of one pair, as calibrate --material and --experiment write it",
            )
            .help("calibrate inspect and calibrate plot read both kinds"));
    }
    if version.schema_version != SCHEMA_VERSION {
        return Err(InputError::new(name, Mistake::OutOfRange)
            .in_field("schema_version")
            .found(version.schema_version)
            .expected(SCHEMA_VERSION)
            .help("it was written by another version of calibrate; run the calibration again"));
    }
    serde_json::from_str(text).map_err(|error| bad_json(name, text, &error))
}

fn cut_off(base: InputError) -> InputError {
    base.found("the end of the file")
        .expected("the rest of a posterior.json")
        .help("the file is cut off; run the calibration again or copy the file again")
}

pub(crate) fn bad_json(name: &str, text: &str, error: &serde_json::Error) -> InputError {
    let base = InputError::new(name, Mistake::Syntax).at_line(error.line().max(1));
    // A file that is cut off can end in the middle of a number or a name.
    let at_its_end = !text.ends_with('\n') && error.line() >= text.lines().count();
    match error.classify() {
        serde_json::error::Category::Eof => cut_off(base),
        serde_json::error::Category::Syntax if at_its_end => cut_off(base),
        serde_json::error::Category::Syntax => base
            .found(format_args!("something that is not JSON ({error})"))
            .expected("a posterior.json")
            .help("run the calibration again, or copy the file again"),
        _ => base
            .found(format_args!("JSON that is no posterior ({error})"))
            .expected("a posterior.json written by this program")
            .help("name the posterior.json of a run, or its folder"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The committed schema is what the types say; `UPDATE_SCHEMA=1 cargo test -p calibrate schema` writes it anew.
    #[test]
    fn the_committed_schema_is_that_of_the_types() {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("schema").join("posterior.schema.json");
        let schema = schemars::schema_for!(PosteriorFile);
        let mut text = serde_json::to_string_pretty(&schema).expect("a schema is JSON");
        text.push('\n');
        if std::env::var_os("UPDATE_SCHEMA").is_some() {
            std::fs::create_dir_all(path.parent().expect("has a parent")).expect("a folder");
            std::fs::write(&path, &text).expect("the schema");
        }
        let committed = std::fs::read_to_string(&path).expect("the committed schema");
        assert!(committed == text, "run UPDATE_SCHEMA=1 cargo test -p calibrate schema");
    }
}
