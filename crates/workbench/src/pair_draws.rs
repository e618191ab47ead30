//! The posterior draws of a saved calibration of one pair, for commands that compute further with them.

use std::path::Path;

use dem_core::{Kinetics, PairScene, PairSpec, Powder, SceneError, Sintering};

use crate::error::{Failure, RunError};
use crate::posterior_file;
use crate::prior_file::ParameterName;
use crate::run::read_draws;
use crate::summary;

/// Equally weighted draws of a posterior, and the pair that it was calibrated on.
#[derive(Debug, Clone, PartialEq)]
pub struct PairDraws {
    /// Name of the calibration.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Its whole plan as JSON.
    pub plan: String,
    /// How the neck grows.
    pub kinetics: Kinetics,
    /// The powder of the calibrated pair.
    pub powder: Powder,
    /// Final contact ratio phi; where phi is calibrated, what it would have been.
    pub final_contact_ratio: f64,
    /// The calibrated parameters.
    pub names: Vec<ParameterName>,
    /// Their values \[SI\], a column for each.
    pub columns: Vec<Vec<f64>>,
    /// Whether the posterior's own diagnostics let it be trusted.
    pub trusted: bool,
    /// Reasons to be careful.
    pub advice: Vec<String>,
}

impl PairDraws {
    /// Reads `posterior.json` and the `draws.csv` beside it; `path` is the file or its folder.
    ///
    /// # Errors
    ///
    /// [`Failure::Input`] for files that are missing, damaged or not of one pair.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let path = posterior_file::locate(path);
        let file = posterior_file::read(&path)?;
        let columns =
            read_draws(&file, path.parent().unwrap_or(Path::new("."))).map_err(|error| {
                error.help("draws.csv is written beside posterior.json: name the folder of a run")
            })?;
        let plan = &file.plan;
        let mut advice = file.advice.clone();
        if !file.is_posterior {
            advice.insert(0, "the draws are not of a posterior: the noise was tuned".to_owned());
        }
        Ok(Self {
            name: plan.name.clone(),
            title: plan.title.clone(),
            plan: serde_json::to_string(plan).map_err(RunError::new)?,
            kinetics: plan.kinetics()?,
            powder: plan.powder(),
            final_contact_ratio: plan.experiment.final_contact_ratio,
            names: plan.parameter_names()?,
            columns,
            trusted: summary::trusted(&file),
            advice,
        })
    }

    /// Number of draws.
    #[must_use]
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, Vec::len)
    }

    /// Whether there are no draws.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The parameters of a draw \[SI\], in order.
    #[must_use]
    pub fn parameters(&self, row: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[row]).collect()
    }

    /// A parameter of a draw, if it was calibrated.
    #[must_use]
    pub fn value(&self, name: ParameterName, row: usize) -> Option<f64> {
        self.names.iter().position(|known| *known == name).map(|place| self.columns[place][row])
    }

    /// The sintering parameters of a draw at the calibrated radius; `unused` gives those that were not calibrated.
    #[must_use]
    pub fn sintering(&self, row: usize, unused: Sintering) -> Sintering {
        let of = |name, unused| self.value(name, row).unwrap_or(unused);
        Sintering {
            c1: of(ParameterName::C1, unused.c1),
            tau_s: of(ParameterName::TauS, unused.tau_s),
            delta_c: of(ParameterName::DeltaC, unused.delta_c),
        }
    }

    /// The pair of a draw, of another radius.
    ///
    /// # Errors
    ///
    /// [`dem_core::SceneError`] for a radius that the model cannot take.
    pub fn pair(&self, row: usize, radius_m: f64) -> Result<PairScene, SceneError> {
        let phi = self.value(ParameterName::Phi, row).unwrap_or(self.final_contact_ratio);
        PairSpec::new(Powder { radius_m, ..self.powder }, phi).build()
    }
}
