//! Order of Verlet where the solution is smooth: stretching alone, up to 0.9 a/R, without knee or singular start.

use crate::stiff_reference::{Equations, Problem};
use dem_core::{Kinetics, contact_ratios};
use workbench::error::{Failure, RunError};
use workbench::input::material::Material;

use super::method::{MOST_STEPS, difference};
use crate::pair::{Pair, verlet};

const STEPS: [f64; 4] = [0.1, 0.05, 0.025, 0.0125];

/// The finding, in a sentence.
pub(super) fn study() -> Result<String, Failure> {
    let pair = Pair::of(Material::Pa12)?;
    let (scene, sintering) = (&pair.scene, &pair.sintering);
    let times_s: Vec<f64> =
        (1..=20).map(|i| 0.02 * sintering.tau_s * f64::from(i) / 20.0).collect();
    let (equations, kinetics) = (Equations::Motion, Kinetics::Frenkel);
    let smooth = Problem { equations, scene, kinetics, sintering, times_s: &times_s };
    let truth = smooth.settled(1e-9, MOST_STEPS).map_err(RunError::new)?;
    let mut errors = Vec::new();
    for step in STEPS {
        let mut out = vec![0.0; times_s.len()];
        contact_ratios(scene, kinetics, sintering, &verlet(step), &times_s, &mut out)
            .map_err(RunError::new)?;
        errors.push(difference(&out, &truth.contact_ratio));
    }
    let slope = (errors[0] / errors[3]).log2() / 3.0;
    let shown: Vec<String> = errors.iter().map(|error| format!("{error:.2e}")).collect();
    Ok(format!(
        "- verlet where the solution is smooth (PA12, Frenkel's law from rest, steps {STEPS:?} t_c): errors {} against \
         the equations of motion, **order {slope:.2}**. At the knee the rate bends within a step: first order once.\n",
        shown.join(", ")
    ))
}
