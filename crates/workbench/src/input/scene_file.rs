//! Scene files of the commands `scene` and `densify`: TOML or JSON, checked before anything runs.

use std::path::{Path, PathBuf};

use dem_core::bed::{
    AdhesionTable, BedError, Mode, Outline, SceneFile, Side, SinteringTable, WhenNecksMeet,
};
use dem_core::heat::Heat;
use serde_json::Value;

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::input::heat::{HeatFields, field_of};
use crate::input::text_file;
use crate::input::toml_fields::Document;
use crate::number::significant;
use crate::pair::heat::HeatPlan;

/// A scene that was read and checked, all but its packing, which is not made yet.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneInput {
    /// The file, as the user named it.
    pub place: String,
    /// Its contents.
    pub file: SceneFile,
    /// Its particles in numbers.
    pub outline: Outline,
    /// Its table `[heat]`, which says how the temperature of the bed goes; none at the temperature of its parameters.
    pub heat: Option<HeatFields>,
}

/// Reads and checks a scene.
pub fn read(path: &Path) -> Result<SceneInput, InputError> {
    let text = text_file::read(path)?;
    let json = path.extension().is_some_and(|extension| extension == "json");
    parse(path, &text, json)
}

/// As [`read`], from the text of the file.
pub fn parse(path: &Path, text: &str, json: bool) -> Result<SceneInput, InputError> {
    let place = path.display().to_string();
    let example = "experiments/scenes has worked examples";
    if text.trim().is_empty() {
        return Err(InputError::new(&place, Mistake::Empty)
            .found("an empty file")
            .expected("a scene")
            .help(example));
    }
    let (file, heat) = match with_heat(path, text, json)? {
        Some((file, heat)) => (file, Some(heat)),
        None if json => {
            let file = serde_json::from_str(text).map_err(|error| {
                InputError::new(&place, Mistake::Syntax)
                    .at_line(error.line().max(1))
                    .found(error)
                    .help(example)
            })?;
            (file, None)
        }
        None => {
            let file = SceneFile::parse(text, &place);
            (file.map_err(|error| refused(&place, &error).help(example))?, None)
        }
    };
    let outline = file.outline().map_err(|error| refused(&place, &error))?;
    if let Some(heat) = &heat {
        heat.plan()?;
        if !file.phases.iter().any(|phase| phase.heated) {
            return Err(InputError::new(&place, Mistake::Conflict)
                .in_field("heat")
                .found("a heat, and no phase with heated = true")
                .expected("a phase in which contacts grow")
                .help("write heated = true in a phase, or leave [heat] out"));
        }
    }
    Ok(SceneInput { place, file, outline, heat })
}

fn has_heat(json: &str) -> bool {
    let object: serde_json::Map<_, _> = serde_json::from_str(json).unwrap_or_default();
    object.contains_key("heat")
}

/// A scene with a table `[heat]`; none for a file without one, or one that does not parse.
fn with_heat(
    path: &Path,
    text: &str,
    json: bool,
) -> Result<Option<(SceneFile, HeatFields)>, InputError> {
    let place = path.display().to_string();
    let document = match json {
        true => Document::parse_json(&place, text),
        false => Document::parse(&place, text),
    };
    let document = match document {
        Ok(document) => document,
        Err(error) if json && has_heat(text) => return Err(error),
        // As a file without it, which names the mistake.
        Err(_) => return Ok(None),
    };
    let top = document.top();
    let Some(heat) = top.table("heat")? else { return Ok(None) };
    let heat = HeatFields::read(text_file::folder_of(path), &heat)?;
    Ok(Some((top.rest(&["heat"])?, heat)))
}

impl SceneInput {
    /// The heated phases of a bed that runs to `end_s`, each from one time to another since the first of them began \[s\].
    pub fn heated_s(&self, end_s: f64) -> Vec<[f64; 2]> {
        let mut begin_s = 0.0;
        let phases = self.file.phases.iter().skip_while(|phase| !phase.heated);
        let spans = phases.map(|phase| {
            let from_s = begin_s;
            begin_s += phase.duration_s;
            (phase.heated, [from_s, begin_s.min(end_s)])
        });
        spans.filter(|(heated, [from, to])| *heated && from < to).map(|(_, span)| span).collect()
    }

    /// The heat of the bed, which is that of particles of the mean radius: all of its numbers are stated.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a number that is not stated, or out of range.
    pub fn stated_heat(&self) -> Result<Option<(HeatPlan, Heat)>, InputError> {
        let Some(fields) = &self.heat else { return Ok(None) };
        let plan = fields.plan()?;
        let heat = fields.stated(&plan, self.outline.mean_radius_m)?;
        Ok(Some((plan, heat)))
    }

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
        let heat = self.heat.as_ref().and_then(|fields| fields.plan().ok());
        lines.extend(heat.map(|heat| heat_in_words(&heat, outline.mean_radius_m)));
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

/// The file of a table of temperatures, with its role in a run.
pub(crate) fn table_of(heat: Option<&HeatPlan>) -> Option<(&'static str, PathBuf)> {
    Some(("temperatures", heat?.table_file()?.into()))
}

/// The heat of a bed of particles of a mean radius in words.
pub fn heat_in_words(heat: &HeatPlan, radius_m: f64) -> String {
    let open = heat.leaves_unstated(heat.unrounded(radius_m)).into_iter().filter_map(field_of);
    let open: Vec<&str> = open.collect();
    let unstated = match open[..] {
        [] => String::new(),
        _ => format!("; {} from a posterior (densify)", open.join(", ")),
    };
    format!("heat          {}{unstated}", heat.in_words())
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
