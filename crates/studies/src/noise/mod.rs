//! What correlated and robust noise are worth: coverage, prediction, outliers and cost, beside independent errors.

mod ahead;
mod cost;
mod coverage;
mod models;
mod outliers;

use std::path::Path;

use workbench::error::Failure;

use crate::args::{NoiseArgs, NoisePart};

pub(crate) fn run(args: &NoiseArgs, out: &Path) -> Result<(), Failure> {
    let out = out.join("noise");
    let parts = args.only.map_or_else(|| NoisePart::ALL.to_vec(), |part| vec![part]);
    for part in parts {
        match part {
            NoisePart::Coverage => coverage::run(args, &out)?,
            NoisePart::Prediction => ahead::run(args, &out)?,
            NoisePart::Outliers => outliers::run(args, &out)?,
            NoisePart::Cost => cost::run(&out)?,
        }
    }
    Ok(())
}
