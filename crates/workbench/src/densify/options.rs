//! What a densification is made of.

use std::path::PathBuf;

use super::curve::Target;

/// Options of a densification.
#[derive(Debug, Clone, PartialEq)]
pub struct DensifyOptions {
    /// A `posterior.json`, or the folder it is in; `draws.csv` must be beside it.
    pub posterior: PathBuf,
    /// A scene with a heated phase and the kinetics of the posterior.
    pub scene: PathBuf,
    /// Number of draws.
    pub draws: usize,
    /// The target; a relative density of 0.9 by default.
    pub target: Option<Target>,
    /// Seed of the choice of draws.
    pub seed: u64,
    /// The experiment of a posterior of several.
    pub of: Option<String>,
    /// A file with another heat than that of the scene or the calibration.
    pub heat: Option<PathBuf>,
    /// Another energy of its pulse.
    pub pulse_energy: Option<f64>,
    /// Folder of the results; `results/SCENE-POSTERIOR` by default.
    pub out: Option<PathBuf>,
}
