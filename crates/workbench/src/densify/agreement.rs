//! Whether a scene and a posterior go together.

use std::path::Path;

use dem_core::Kinetics;
use dem_core::bed::SinteringTable;

use super::curve::Target;
use crate::careful::Careful;
use crate::error::{InputError, Mistake};
use crate::input::scene_file::SceneInput;
use crate::pair::draws::PairDraws;
use crate::pair::parameter::ParameterName;

/// The target wished for, or a relative density of 0.9, where the bed can have it.
pub(super) fn target(wished: Option<Target>, input: &SceneInput) -> Result<Target, InputError> {
    let target = wished.unwrap_or(Target::RelativeDensity(0.9));
    match target {
        Target::RelativeDensity(_) if input.file.region.is_none() => Err(no_volume(input)),
        target => Ok(target),
    }
}

/// Refuses a relative density as the target of a bed without a volume.
pub(super) fn no_volume(input: &SceneInput) -> InputError {
    InputError::new(&input.place, Mistake::MissingField)
        .in_field("box")
        .found("a bed that is open on its sides")
        .expected("a bed with a volume, for its relative density")
        .help(
            "give --contact-ratio A/R instead of --target, or box.sides that are periodic or walls",
        )
}

/// The scene's sintering parameters, whose kinetics must be the posterior's.
pub(super) fn sintering<'a>(
    posterior: &Path,
    kinetics: Kinetics,
    input: &'a SceneInput,
) -> Result<&'a SinteringTable, InputError> {
    let Some(table) = &input.file.sintering else {
        return Err(InputError::new(&input.place, Mistake::MissingField)
            .in_field("sintering")
            .found("missing")
            .expected("the kinetics of the bed")
            .help(format_args!("write [sintering] with kinetics = \"{kinetics}\"")));
    };
    if table.kinetics == kinetics.name() {
        return Ok(table);
    }
    Err(InputError::new(&input.place, Mistake::Conflict)
        .in_field("sintering.kinetics")
        .found(format_args!("\"{}\"", table.kinetics))
        .expected(format_args!("\"{kinetics}\", the kinetics of {}", posterior.display()))
        .help(format_args!(
            "calibrate again with --kinetics {}, or write the posterior's kinetics in the scene",
            table.kinetics
        )))
}

/// Refuses a scene in which nothing sinters.
pub(super) fn heated(input: &SceneInput) -> Result<(), InputError> {
    if input.file.phases.iter().any(|phase| phase.heated) {
        return Ok(());
    }
    Err(InputError::new(&input.place, Mistake::MissingField)
        .in_field("phases")
        .found("no phase with heated = true")
        .expected("a phase in which contacts grow")
        .help("write heated = true in the phase that sinters the bed"))
}

/// Reasons to be careful with beds of another powder than the calibrated one.
pub(super) fn advice(calibrated: &PairDraws, input: &SceneInput) -> Vec<String> {
    let mut advice = calibrated.advice.clone();
    let (powder, material) = (&calibrated.pair.powder, &input.file.material);
    for (what, unit, scene, calibrated) in [
        ("Young's modulus", "Pa", material.youngs_modulus_pa, powder.youngs_modulus_pa),
        (
            "surface tension",
            "N/m",
            material.surface_tension_n_per_m,
            powder.surface_tension_n_per_m,
        ),
    ] {
        if (scene / calibrated - 1.0).abs() > 0.01 {
            let (what, unit) = (what.to_owned(), unit.to_owned());
            advice.push(Careful::OtherPowder { what, unit, scene, calibrated }.to_string());
        }
    }
    let (phi, fitted) = (material.final_contact_ratio, calibrated.pair.final_contact_ratio);
    if calibrated.value(ParameterName::Phi, 0).is_none() && (phi / fitted - 1.0).abs() > 1e-3 {
        let other = Careful::OtherFinalContactRatio { scene: phi, calibrated: fitted };
        advice.push(other.to_string());
    }
    advice
}
