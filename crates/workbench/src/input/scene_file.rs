//! Scene files of the commands `scene` and `densify`: TOML or JSON, checked before anything runs.

use std::path::Path;

use dem_core::bed::{
    AdhesionTable, BedError, Mode, Outline, SceneFile, Side, SinteringTable, WhenNecksMeet,
};
use serde_json::Value;

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::text_file;
use crate::number::significant;

/// A scene that was read and checked, all but its packing, which is not made yet.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneInput {
    /// The file, as the user named it.
    pub place: String,
    /// Its contents.
    pub file: SceneFile,
    /// Its particles in numbers.
    pub outline: Outline,
}

/// Reads and checks a scene.
pub fn read(path: &Path) -> Result<SceneInput, InputError> {
    let place = path.display().to_string();
    let text = text_file::read(path)?;
    parse(place, &text, path.extension().is_some_and(|extension| extension == "json"))
}

/// As [`read`], from text.
pub fn parse(place: String, text: &str, json: bool) -> Result<SceneInput, InputError> {
    let example = "experiments/scenes has worked examples";
    if text.trim().is_empty() {
        return Err(InputError::new(&place, Mistake::Empty)
            .found("an empty file")
            .expected("a scene")
            .help(example));
    }
    let file = if json {
        serde_json::from_str(text).map_err(|error| {
            InputError::new(&place, Mistake::Syntax)
                .at_line(error.line().max(1))
                .found(error)
                .help(example)
        })?
    } else {
        SceneFile::parse(text, &place).map_err(|error| refused(&place, &error).help(example))?
    };
    let outline = file.outline().map_err(|error| refused(&place, &error))?;
    Ok(SceneInput { place, file, outline })
}

impl SceneInput {
    /// The scene as JSON without what does not change its numbers: the same for files that differ in comments, in
    /// the order of fields or in the work they allow.
    pub fn identity(&self) -> Result<Value, RunError> {
        let mut file = self.file.clone();
        file.description.clear();
        let mut value = serde_json::to_value(&file).map_err(RunError::new)?;
        for phase in value["phases"].as_array_mut().into_iter().flatten() {
            if let Some(fields) = phase.as_object_mut() {
                fields.remove("max_work");
            }
        }
        Ok(value)
    }

    /// The scene's name as that of a folder.
    pub fn folder_name(&self) -> String {
        let plain: String = self
            .file
            .name
            .chars()
            .map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' })
            .collect();
        let plain = plain.trim_matches(['.', '-']);
        if plain.is_empty() { "scene".to_owned() } else { plain.to_owned() }
    }

    /// The scene in words, a line for each part.
    pub fn describe(&self) -> Vec<String> {
        let (file, outline) = (&self.file, &self.outline);
        let mut lines = vec![format!(
            "particles     {}, mean radius {} um",
            outline.particles,
            significant(1e6 * outline.mean_radius_m, 4)
        )];
        let material = &file.material;
        lines.push(format!(
            "material      E {} GPa, gamma {} mN/m, rho {} kg/m3, phi {}, K1 {} N/m",
            significant(1e-9 * material.youngs_modulus_pa, 3),
            significant(1e3 * material.surface_tension_n_per_m, 4),
            significant(material.density_kg_per_m3, 4),
            significant(material.final_contact_ratio, 4),
            significant(material.k1_n_per_m, 3)
        ));
        lines.extend(file.sintering.iter().flat_map(sintering_in_words));
        let mut around = Vec::new();
        if let Some(region) = &file.region {
            around.push(format!(
                "box {}{}",
                region.sides.map(Side::name).join(", "),
                if region.free { ", free to shrink" } else { "" }
            ));
        }
        match &file.adhesion {
            Some(AdhesionTable { force_n: Some(force), .. }) => {
                around.push(format!("adhesion {} N", significant(*force, 3)));
            }
            Some(AdhesionTable { bond_number: Some(number), .. }) => {
                around.push(format!("adhesion of {} weights", significant(*number, 3)));
            }
            _ => {}
        }
        if let Some(gravity) = &file.gravity {
            around.push(format!("gravity {:?} m/s2", gravity.acceleration_m_per_s2));
        }
        if file.drag.is_some() {
            around.push("drag".to_owned());
        }
        if let Some(friction) = &file.friction {
            around.push(format!("friction {}", significant(friction.coefficient, 3)));
        }
        if !around.is_empty() {
            lines.push(format!("around        {}", around.join(", ")));
        }
        for (phase, k1) in file.phases.iter().zip(&outline.phase_k1_n_per_m) {
            lines.push(format!(
                "phase         {}: {} s, {}, {}, K1 {} N/m, {} observations",
                phase.name,
                significant(phase.duration_s, 4),
                if phase.heated { "heated" } else { "not heated" },
                match phase.mode {
                    Mode::Dynamic if phase.mass_scaling > 1.0 =>
                        format!("dynamic with masses times {}", significant(phase.mass_scaling, 4)),
                    Mode::Dynamic => "dynamic".to_owned(),
                    Mode::QuasiStatic => "quasi-static".to_owned(),
                },
                significant(*k1, 3),
                phase.outputs + 1
            ));
        }
        lines
    }
}

/// The growth of contacts in words.
fn sintering_in_words(table: &SinteringTable) -> [String; 2] {
    let necks = if table.neck_viscosity > 0.0 {
        let times = significant(table.neck_viscosity, 3);
        format!(", shear and rolling resisted {times} times as by a Newtonian neck")
    } else {
        String::new()
    };
    [
        format!(
            "sintering     {}: C1 {} 1/(Pa s), tau_s {} s at R = {} um, delta_c {} m",
            table.kinetics,
            significant(table.c1, 4),
            significant(table.tau_s, 4),
            significant(1e6 * table.calibrated_radius_m, 4),
            significant(table.delta_c, 4)
        ),
        format!(
            "              approach {}{necks}; where necks meet: {}",
            table.approach,
            match table.when_necks_meet {
                WhenNecksMeet::Closure => "open and closed pores",
                WhenNecksMeet::Stop => "the end",
            }
        ),
    ]
}

/// A bed that cannot be made as the file says.
pub fn refused(place: &str, error: &BedError) -> InputError {
    match error {
        BedError::File { place: at, message } => {
            let base = InputError::new(place, Mistake::Syntax).found(message);
            let line = at.strip_prefix(place).and_then(|rest| rest.strip_prefix(':')?.parse().ok());
            match line {
                Some(line) => base.at_line(line),
                None => base,
            }
        }
        BedError::Field { field, value, remedy } => {
            InputError::new(place, Mistake::OutOfRange).in_field(field).found(value).help(remedy)
        }
        other => {
            let mut input = InputError::new(place, Mistake::OutOfRange);
            // Not shortened: the remedy is at the end, and nothing in it is the user's text.
            input.found = Some(other.to_string().into());
            input
        }
    }
}

/// A run that ended early, with what is `kept` of it: a mistake of the scene, or a failed run.
pub fn failed(place: &str, error: &BedError, kept: Option<&str>) -> Failure {
    match error {
        BedError::NoBalance { .. } | BedError::NoRest { .. } => {
            let run = RunError::new(format_args!("{place}: {error}"))
                .help("lower the tolerance of the phase, or use mode = \"dynamic\"");
            kept.map_or(run.clone(), |kept| run.help(kept)).into()
        }
        BedError::Checkpoint(_) => RunError::new(format_args!("{place}: {error}")).into(),
        other => refused(place, other).help_if(kept).into(),
    }
}
