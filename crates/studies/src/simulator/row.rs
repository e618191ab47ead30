//! The table's rows, the figures' series, and what a part of the study finds.

use dem_core::SolverKind;
use figures::{Band, Role, WorkPrecisionFigure, WorkPrecisionSeries};
use workbench::input::material::Material;

use super::method::Method;
use crate::timing::Timing;

pub(super) const COLUMNS: [&str; 14] = [
    "material",
    "parameters",
    "solver",
    "control",
    "stops when coalesced",
    "time per curve [s]",
    "lower quartile [s]",
    "upper quartile [s]",
    "steps",
    "error against quasi-static limit, median",
    "worst",
    "error against equations of motion, median",
    "worst",
    "note",
];

/// Rows, finding and figure of a part of the study.
pub(super) struct Found {
    pub(super) rows: Vec<Vec<String>>,
    pub(super) finding: String,
    pub(super) figure: WorkPrecisionFigure,
}

/// Error over parameter vectors: the median and, of several vectors, the worst.
#[derive(Debug, Clone, Copy)]
pub(super) struct Error {
    pub(super) median: f64,
    pub(super) worst: Option<f64>,
}

/// A method's row.
pub(super) struct Row<'a> {
    pub(super) material: Material,
    pub(super) parameters: &'a str,
    pub(super) method: &'a Method,
    pub(super) timing: Timing,
    pub(super) steps: u64,
    /// Error against the quasi-static limit.
    pub(super) balance: Error,
    /// Error against the equations of motion, of a solver that follows them.
    pub(super) motion: Option<Error>,
    pub(super) note: String,
}

impl Row<'_> {
    pub(super) fn cells(&self) -> Vec<String> {
        let time = |seconds: f64| format!("{seconds:.3e}");
        let error =
            |error: Option<f64>| error.map_or_else(String::new, |error| format!("{error:.2e}"));
        let settings = &self.method.settings;
        vec![
            self.material.to_string(),
            self.parameters.to_owned(),
            settings.kind.to_string(),
            self.method.control.clone(),
            if settings.stop_when_coalesced { "yes" } else { "no" }.to_owned(),
            time(self.timing.median_s),
            time(self.timing.lower_s),
            time(self.timing.upper_s),
            self.steps.to_string(),
            error(Some(self.balance.median)),
            error(self.balance.worst),
            error(self.motion.map(|error| error.median)),
            error(self.motion.and_then(|error| error.worst)),
            self.note.clone(),
        ]
    }
}

/// The row of a method that refuses to run.
pub(super) fn refused(
    material: Material,
    method: &Method,
    why: impl std::fmt::Display,
) -> Vec<String> {
    let mut row = vec![String::new(); COLUMNS.len()];
    row[0] = material.to_string();
    row[1] = "paper".to_owned();
    row[2] = method.settings.kind.to_string();
    row[3].clone_from(&method.control);
    row[13] = format!("refused: {why}");
    row
}

/// A line of the figure: the points of a solver.
pub(super) struct Line {
    pub(super) cost: Vec<f64>,
    pub(super) error: Vec<f64>,
    pub(super) band: Band,
}

/// The figure of four lines: closed form, quasi-static, Verlet against the quasi-static limit and against the motion.
///
/// `line` gives the points of a solver, with the error against the equations of motion if asked.
pub(super) fn figure(
    title: String,
    verlet: &str,
    line: impl Fn(SolverKind, bool) -> Line,
) -> WorkPrecisionFigure {
    let series = [
        ("closed form", Role::Series(0), SolverKind::ClosedForm, false),
        ("quasi-static, tolerance 1e-2 … 1e-12", Role::Series(1), SolverKind::QuasiStatic, false),
        (verlet, Role::Series(3), SolverKind::Verlet, false),
        ("verlet against the equations of motion", Role::Series(2), SolverKind::Verlet, true),
    ];
    let series = series.map(|(name, role, kind, of_motion)| {
        let Line { cost, error, band } = line(kind, of_motion);
        WorkPrecisionSeries { name: name.to_owned(), role, cost, error, band }
    });
    WorkPrecisionFigure {
        title,
        cost_name: "time per curve".to_owned(),
        cost_unit: "s".to_owned(),
        error_name: "largest error of a/R".to_owned(),
        error_unit: String::new(),
        series: series.into(),
        guide_slope: None,
    }
}
