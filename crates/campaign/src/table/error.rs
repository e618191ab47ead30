//! Errors of a table.

use thiserror::Error;

/// Why a text is not a table, or a column of it cannot be read. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TableError {
    /// There is nothing in it but comments and blank lines.
    #[error("an empty table")]
    Empty,
    /// The first row holds numbers, and no comment above it has as many names.
    #[error("line {line}: numbers instead of the names of the columns")]
    NoNames {
        /// Line of the first row.
        line: usize,
    },
    /// There are names and no row below them.
    #[error("line {line}: names of columns without a row below them")]
    NoRows {
        /// Line of the names.
        line: usize,
    },
    /// A row has more or fewer cells than there are columns.
    #[error("line {line}: {found} cells, expected {expected} as there are names{}",
        if *.decimal_commas { "; write decimals with a point: 0.5, not 0,5" } else { "" })]
    Ragged {
        /// Line of the row.
        line: usize,
        /// Number of its cells.
        found: usize,
        /// Number of columns.
        expected: usize,
        /// Whether it looks like decimal commas: cells end at commas, and there are twice as many as columns.
        decimal_commas: bool,
    },
    /// Two columns have the same name.
    #[error("{}column {column} is there twice", at(*line))]
    DuplicateName {
        /// Line of the names; none in JSON.
        line: Option<usize>,
        /// The name.
        column: String,
    },
    /// A column has no name.
    #[error("{}column {number} has no name", at(*line))]
    EmptyName {
        /// Line of the names; none in JSON.
        line: Option<usize>,
        /// Number of the column, from 1.
        number: usize,
    },
    /// No column has the name.
    #[error("{}no column {column}; it has {}", at(*line), names.join(", "))]
    MissingColumn {
        /// Line of the names; none in JSON.
        line: Option<usize>,
        /// The name.
        column: String,
        /// The names that are there.
        names: Vec<String>,
    },
    /// A cell does not hold a number.
    #[error("line {line}, column {column}: {} is not a number{}", seen(found),
        with_point.as_ref().map_or_else(String::new, |n| format!("; write decimals with a point: {n}")))]
    NotANumber {
        /// Line of the cell.
        line: usize,
        /// Name of its column.
        column: String,
        /// Its text, at most 80 characters; empty where the cell is.
        found: String,
        /// The number with a decimal point, where it was written with a comma.
        with_point: Option<String>,
    },
    /// The JSON is not an object of arrays or an array of objects, or a value is not a number.
    #[error("{problem}")]
    Json {
        /// The problem, with the place and the value.
        problem: String,
    },
}

impl TableError {
    /// Line of the mistake, where it has one.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        match self {
            Self::NoNames { line }
            | Self::NoRows { line }
            | Self::Ragged { line, .. }
            | Self::NotANumber { line, .. } => Some(*line),
            Self::DuplicateName { line, .. }
            | Self::EmptyName { line, .. }
            | Self::MissingColumn { line, .. } => *line,
            Self::Empty | Self::Json { .. } => None,
        }
    }

    /// Column of the mistake, where it has one.
    #[must_use]
    pub fn column(&self) -> Option<&str> {
        match self {
            Self::DuplicateName { column, .. }
            | Self::MissingColumn { column, .. }
            | Self::NotANumber { column, .. } => Some(column),
            _ => None,
        }
    }
}

fn at(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!("line {line}: "))
}

fn seen(found: &str) -> String {
    if found.is_empty() { "nothing".into() } else { format!("{found:?}") }
}

/// The start of a text, on one line, for a message.
pub(super) fn short(text: &str) -> String {
    text.chars().take(80).map(|c| if c.is_control() { ' ' } else { c }).collect()
}
