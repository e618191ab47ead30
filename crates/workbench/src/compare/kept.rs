//! `models-NAME.json`: draws of the models of a comparison that have a share in the average over all of them.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};
use smc_calib::{Noise, NoiseShape, Parameter};

use super::noises;
use crate::calibration::Calibration;
use crate::error::{InputError, Mistake, RunError};
use crate::output::{WriteFile, checksums};
use crate::pair::draws::PairDraws;
use crate::plan::PairPlan;

/// Version of the layout of `models-NAME.json`.
pub(crate) const MODELS_VERSION: u32 = 2;

/// Models of less probability than this are not kept: their share in any average is smaller than its other errors.
const LEAST_PROBABILITY: f64 = 1e-4;

/// The models of one experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptModels {
    /// Version of the layout.
    pub schema_version: u32,
    /// Name of the material or experiment.
    pub name: String,
    /// Its heading.
    pub title: String,
    /// Models that were left out, each of which has too small a probability to matter.
    pub left_out: usize,
    /// Probability of these together.
    pub left_out_probability: f64,
    /// The models, the most probable first.
    pub models: Vec<KeptModel>,
}

/// One model: kinetics and noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptModel {
    /// Its name where finished runs were compared, which need not differ in their kinetics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explanation: Option<String>,
    /// Name of its noise.
    pub noise: String,
    /// Log evidence.
    pub log_evidence: f64,
    /// Standard error of the log evidence.
    pub log_evidence_se: f64,
    /// Whether the intervals of its posterior can be taken as they are.
    pub trusted: bool,
    /// Reasons to be careful with it.
    pub advice: Vec<String>,
    /// The pair, with its kinetics.
    pub pair: PairPlan,
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Equally weighted draws of the posterior \[SI\], a column for each parameter.
    pub columns: Vec<Vec<f64>>,
    /// Noise standard deviation of each draw; none where it is given row by row.
    pub sigma: Option<Vec<f64>>,
    /// Share of outliers, and how much wider they scatter; none for noise without.
    pub outliers: Option<[f64; 2]>,
}

/// Name of the file of an experiment.
pub(crate) fn file_name(name: &str) -> String {
    format!("models-{name}.json")
}

impl KeptModel {
    pub(super) fn of(calibration: &Calibration, noise: &str) -> Result<Self, InputError> {
        let Calibration { record, posterior } = calibration;
        let draws = &posterior.draws;
        let thetas = || draws.iter().map(|draw| posterior.theta(draw));
        let outliers = match draws.first().and_then(|draw| draw.shape) {
            Some(NoiseShape::Robust { outlier_share, outlier_width }) => {
                Some([outlier_share, outlier_width])
            }
            _ => None,
        };
        Ok(Self {
            explanation: None,
            noise: noise.to_owned(),
            log_evidence: record.log_evidence.value,
            log_evidence_se: record.log_evidence.se,
            trusted: record.trusted(),
            advice: record.advice.clone(),
            pair: record.pair()?.plan.clone(),
            parameters: record.plan.parameters.clone(),
            columns: (0..record.parameters.len())
                .map(|place| thetas().map(|theta| theta[place]).collect())
                .collect(),
            sigma: draws.iter().map(|draw| draw.sigma).collect(),
            outliers,
        })
    }

    /// Of the draws of a finished run.
    pub(super) fn of_draws(draws: PairDraws, noise: &Noise, explanation: String) -> Self {
        let trusted = draws.record.trusted();
        let PairDraws { record, pair, columns, sigma, outliers, advice, .. } = draws;
        Self {
            explanation: Some(explanation),
            noise: noises::name(noise),
            log_evidence: record.log_evidence.value,
            log_evidence_se: record.log_evidence.se,
            trusted,
            advice,
            pair,
            parameters: record.plan.parameters,
            columns,
            sigma,
            outliers,
        }
    }
}

impl KeptModels {
    /// Those of all models, in the order of the entries, that matter.
    pub(super) fn new(
        (name, title): (&str, &str),
        probabilities: impl Iterator<Item = f64>,
        models: Vec<KeptModel>,
    ) -> Self {
        let (mut kept, left_out): (Vec<_>, Vec<_>) =
            probabilities.zip(models).partition(|(share, _)| *share >= LEAST_PROBABILITY);
        kept.sort_by(|a, b| b.0.total_cmp(&a.0));
        Self {
            schema_version: MODELS_VERSION,
            name: name.to_owned(),
            title: title.to_owned(),
            left_out: left_out.len(),
            left_out_probability: left_out.iter().map(|(share, _)| share).sum(),
            models: kept.into_iter().map(|(_, model)| model).collect(),
        }
    }
}

/// Reads the models of an experiment from the folder of a comparison; `name` may be left out where it holds one.
///
/// # Errors
///
/// [`InputError`] that names the folder, what it holds and what to do.
pub(crate) fn read_models(folder: &Path, name: Option<&str>) -> Result<KeptModels, InputError> {
    let place = folder.display().to_string();
    let mut names: Vec<String> = fs::read_dir(folder)
        .map(|entries| entries.flatten().filter_map(|entry| named(&entry.file_name())).collect())
        .unwrap_or_default();
    names.sort();
    let make = "make it: calibrate compare --material pa12 --out results/compare";
    let name = match (name, &names[..]) {
        (_, []) => {
            return Err(InputError::new(place, Mistake::MissingFile)
                .found("no models of a comparison (models-NAME.json)")
                .expected("the folder of a comparison")
                .help(make));
        }
        (Some(name), names) if names.iter().any(|one| one == name) => name.to_owned(),
        (Some(name), names) => {
            return Err(InputError::new("--of", Mistake::OutOfRange)
                .found(format_args!("{name}, which {place} does not compare"))
                .expected(format_args!("one of {}", names.join(", "))));
        }
        (None, [one]) => one.clone(),
        (None, names) => {
            return Err(InputError::new("--of", Mistake::MissingField)
                .found(format_args!("a comparison of {}", names.join(", ")))
                .expected(format_args!("--of NAME, as in --of {}", names[0])));
        }
    };
    checksums::read_as(&folder.join(file_name(&name)), |file, text| {
        let again = |error: InputError| error.help("run the comparison again");
        let kept: KeptModels = serde_json::from_str(text).map_err(|error| {
            again(
                InputError::new(file, Mistake::Syntax)
                    .found(error)
                    .expected("models of a comparison"),
            )
        })?;
        if kept.schema_version != MODELS_VERSION {
            return Err(again(
                InputError::new(file, Mistake::OutOfRange)
                    .in_field("schema_version")
                    .found(kept.schema_version)
                    .expected(MODELS_VERSION),
            ));
        }
        Ok(kept)
    })
}

/// The experiment whose models a file holds.
fn named(file: &OsStr) -> Option<String> {
    Some(file.to_str()?.strip_prefix("models-")?.strip_suffix(".json")?.to_owned())
}

/// Writes a file for each experiment, with their sums.
pub(super) fn write(all: &[KeptModels], write: &WriteFile<'_>) -> Result<String, RunError> {
    let texts: Vec<(String, String)> = all
        .iter()
        .map(|kept| {
            let text = serde_json::to_string(kept).map_err(RunError::new)?;
            Ok((file_name(&kept.name), text + "\n"))
        })
        .collect::<Result<_, RunError>>()?;
    let files: Vec<(&str, String)> =
        texts.iter().map(|(name, text)| (name.as_str(), text.clone())).collect();
    checksums::write_all(&files, write)
}
