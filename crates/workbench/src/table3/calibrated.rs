//! A built-in material, calibrated for the table.

use dem_core::Kinetics;

use crate::args::RunArgs;
use crate::calibration::Calibration;
use crate::error::Failure;
use crate::material::Material;
use crate::plan::Planned;
use crate::watch::Watch;

/// A calibrated material.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The material.
    pub material: Material,
    /// The plan.
    pub planned: Planned,
    /// The posterior.
    pub calibration: Calibration,
}

impl Calibrated {
    /// Calibrates a material on its own measurements with its own priors, `samples` simulations and a seed.
    ///
    /// # Errors
    ///
    /// As [`Calibration::run`].
    pub fn new(
        material: Material,
        kinetics: Kinetics,
        samples: usize,
        seed: u64,
        watch: &dyn Watch,
    ) -> Result<Self, Failure> {
        let args = RunArgs { kinetics, samples, seed, ..RunArgs::default() };
        let planned = Planned::from_args(&RunArgs { material: Some(material), ..args })?;
        let calibration = Calibration::run(&planned, &mut (), &|| !watch.stop().asked())?;
        Ok(Self { material, planned, calibration })
    }
}
