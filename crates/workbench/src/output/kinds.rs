//! Kinds of run, told by the name of their record.

use std::path::Path;

/// The record of a calibration.
pub const CALIBRATION: &str = "posterior.json";
/// The record of a comparison of kinetics.
pub const COMPARISON: &str = "compare.json";
/// The record of a regenerated Table 3.
pub const TABLE3: &str = "table3.json";
/// The record of a scene that ran.
pub const SCENE: &str = "scene.json";
/// The record of a densification.
pub const DENSIFICATION: &str = "densify.json";
/// The record of two runs side by side.
pub const DIFFERENCE: &str = "diff.json";

/// All records, each with its kind in words.
pub const ALL: [(&str, &str); 6] = [
    (CALIBRATION, "calibration"),
    (COMPARISON, "comparison"),
    (TABLE3, "table 3"),
    (SCENE, "scene"),
    (DENSIFICATION, "densification"),
    (DIFFERENCE, "difference"),
];

/// Record and kind of the run in a folder, or of the record that a path names; none where there is none.
pub fn of(path: &Path) -> Option<(&'static str, &'static str)> {
    ALL.into_iter().find(|(record, _)| match path.is_dir() {
        true => path.join(record).is_file(),
        false => path.file_name() == Some(record.as_ref()) && path.is_file(),
    })
}
