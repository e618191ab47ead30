//! A built-in material, calibrated for the table.

use dem_core::Kinetics;

use crate::calibration::Calibration;
use crate::error::Failure;
use crate::input::material::Material;
use crate::plan::PairOptions;
use crate::watch::Watch;

/// A calibrated material.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The material.
    pub material: Material,
    /// Its posterior.
    pub calibration: Calibration,
}

impl Calibrated {
    /// Calibrates a material on its own measurements with its own priors, `samples` simulations and a seed.
    pub fn new(
        material: Material,
        kinetics: Kinetics,
        samples: usize,
        seed: u64,
        watch: &dyn Watch,
    ) -> Result<Self, Failure> {
        let options = PairOptions {
            material: Some(material),
            kinetics,
            samples,
            seed,
            ..PairOptions::default()
        };
        Ok(Self { material, calibration: Calibration::run(&options.plan()?, watch)? })
    }
}
