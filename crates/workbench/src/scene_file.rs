//! Scene files of the commands `scene` and `densify`: TOML or JSON, checked before anything runs.

use std::path::Path;

use dem_core::bed::{BedError, Outline, SceneFile};
use serde_json::Value;

use crate::error::{Failure, InputError, Mistake, RunError};
use crate::text_file;

/// A scene that was read and holds together as far as can be seen without making its packing.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneInput {
    /// The file, as the user named it.
    pub place: String,
    /// What it says.
    pub file: SceneFile,
    /// The same in numbers.
    pub outline: Outline,
}

/// Reads and checks a scene.
///
/// # Errors
///
/// [`InputError`] with file, line, field, value and remedy.
pub fn read(path: &Path) -> Result<SceneInput, InputError> {
    let place = path.display().to_string();
    let text = text_file::read(path)?;
    parse(place, &text, path.extension().is_some_and(|extension| extension == "json"))
}

/// As [`read`], from text.
///
/// # Errors
///
/// As [`read`].
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
    ///
    /// # Errors
    ///
    /// [`RunError`] for a scene that JSON cannot hold.
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
    #[must_use]
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
}

/// A bed that cannot be made as the file says.
#[must_use]
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

/// A run that ended early: the scene's mistake, or one that the scene cannot be blamed for.
#[must_use]
pub fn failed(place: &str, error: &BedError, kept: Option<&str>) -> Failure {
    match error {
        BedError::NoBalance { .. } => {
            let run = RunError::new(format_args!("{place}: {error}"))
                .help("lower the tolerance of the phase, or use mode = \"dynamic\"");
            kept.map_or(run.clone(), |kept| run.help(kept)).into()
        }
        BedError::Checkpoint(_) => RunError::new(format_args!("{place}: {error}")).into(),
        other => refused(place, other).help_if(kept).into(),
    }
}
