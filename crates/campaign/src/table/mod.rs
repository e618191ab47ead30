//! Tables with named columns, as simulators and people write them: CSV, columns separated by blanks, JSON.
//!
//! A line that begins with `#` is a comment; a byte order mark is skipped; lines end with LF, CRLF or CR. Cells may stand
//! in quotes. A cell is read as a number when it is asked for, so that other columns may hold text.
//!
//! ```
//! use campaign::table::{Format, Table};
//!
//! let table = Table::parse("t,force\n0,0\n0.5,4.98\n", Format::Csv)?;
//! assert_eq!(table.names(), ["t", "force"]);
//! assert_eq!(table.column("force")?, [0.0, 4.98]);
//! # Ok::<(), campaign::table::TableError>(())
//! ```

mod error;
mod json;
mod lines;
#[cfg(test)]
mod tests;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

pub use error::TableError;
use json::Json;
pub(crate) use json::parse as parse_json;
pub use lines::number;
use lines::{Lines, SEPARATORS, Split};

/// How a table is written.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// Cells separated by commas, semicolons or tabs. Names are in the first line that is not a comment (`#`), or, where
    /// that line holds only numbers, in the last comment above it with as many words.
    Csv,
    /// Cells separated by blanks; names as in CSV.
    Whitespace,
    /// An object of arrays (or numbers), `{"t": [0, 1], "x": [2, 3]}`, or an array of objects.
    Json,
}

impl Format {
    /// Whether a table in lines looks like CSV or like columns separated by blanks: CSV where the first line that is not
    /// a comment has a comma, semicolon or tab.
    #[must_use]
    pub fn guess(text: &str) -> Self {
        let first = lines::content(text).map(|(_, line)| line).find(|line| !line.starts_with('#'));
        let separated = first.is_some_and(|line| line.bytes().any(|b| SEPARATORS.contains(&b)));
        if separated { Self::Csv } else { Self::Whitespace }
    }
}

/// The cells of one line, without the blanks and quotes around them. A separator within quotes belongs to its cell; the
/// separator `' '` is any run of white space. Separators are ASCII characters: any other splits nothing.
///
/// ```
/// let cells: Vec<_> = campaign::table::cells("0,5;\"a;b\";", ';').collect();
/// assert_eq!(cells, ["0,5", "a;b", ""]);
/// ```
pub fn cells(line: &str, separator: char) -> impl Iterator<Item = Cow<'_, str>> {
    let split = match u8::try_from(separator) {
        Ok(b' ') => Split::Blanks,
        Ok(separator) if separator.is_ascii() => Split::At { separator, quotes: true },
        _ => Split::At { separator: 0, quotes: true },
    };
    split.cells(line)
}

/// A table whose rows are known and whose cells are read when they are asked for. It has at least one row, except in
/// JSON.
#[derive(Debug, Clone)]
pub struct Table<'t> {
    body: Body<'t>,
}

#[derive(Debug, Clone)]
enum Body<'t> {
    Lines(Lines<'t>),
    Json(Json),
}

/// A row of a table in lines.
#[derive(Debug, Clone)]
pub struct Row<'t> {
    /// Line of the row, from 1.
    pub line: usize,
    /// Texts of the cells, one for each column, without the blanks and quotes around them.
    pub cells: Vec<Cow<'t, str>>,
    names: &'t [String],
    split: Split,
}

impl<'t> Table<'t> {
    /// Finds the names and the rows.
    ///
    /// # Errors
    ///
    /// [`TableError`] for a text that is not a table: no names, no rows, or a row with more or fewer cells than there
    /// are names. Names are not checked, see [`check_names`](Self::check_names).
    pub fn parse(text: &'t str, format: Format) -> Result<Self, TableError> {
        let body = match format {
            Format::Csv => Body::Lines(Lines::read(text, false)?),
            Format::Whitespace => Body::Lines(Lines::read(text, true)?),
            Format::Json => Body::Json(Json::read(text)?),
        };
        Ok(Self { body })
    }

    /// Names of the columns, in order.
    #[must_use]
    pub fn names(&self) -> &[String] {
        match &self.body {
            Body::Lines(lines) => &lines.names,
            Body::Json(json) => &json.names,
        }
    }

    /// Line of the names, from 1; none in JSON.
    #[must_use]
    pub fn names_line(&self) -> Option<usize> {
        match &self.body {
            Body::Lines(lines) => Some(lines.names_line),
            Body::Json(_) => None,
        }
    }

    /// Number of rows; in JSON, whose columns may have different lengths, of the longest column.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.body {
            Body::Lines(lines) => lines.rows.len(),
            Body::Json(json) => json.columns.iter().map(Vec::len).max().unwrap_or(0),
        }
    }

    /// Whether there are no rows, which only JSON allows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Line of a row, from 1; none in JSON, or where there is no such row.
    #[must_use]
    pub fn line(&self, row: usize) -> Option<usize> {
        match &self.body {
            Body::Lines(lines) => lines.rows.get(row).map(|row| row.0),
            Body::Json(_) => None,
        }
    }

    /// Checks that every column has a name, and no two the same.
    ///
    /// # Errors
    ///
    /// [`TableError::EmptyName`] or [`TableError::DuplicateName`] for the first column where that is not so.
    pub fn check_names(&self) -> Result<(), TableError> {
        let line = self.names_line();
        for (place, name) in self.names().iter().enumerate() {
            if name.is_empty() {
                return Err(TableError::EmptyName { line, number: place + 1 });
            }
            if self.names()[..place].contains(name) {
                return Err(TableError::DuplicateName { line, column: name.clone() });
            }
        }
        Ok(())
    }

    /// Place of the column with this name, from 0.
    ///
    /// # Errors
    ///
    /// [`TableError::MissingColumn`], or [`TableError::DuplicateName`] where two columns have the name.
    pub fn place(&self, name: &str) -> Result<usize, TableError> {
        let (line, column) = (self.names_line(), name.to_owned());
        let mut places = (0..self.names().len()).filter(|&place| self.names()[place] == name);
        match (places.next(), places.next()) {
            (Some(place), None) => Ok(place),
            (Some(_), Some(_)) => Err(TableError::DuplicateName { line, column }),
            (None, _) => {
                Err(TableError::MissingColumn { line, column, names: self.names().to_vec() })
            }
        }
    }

    /// The numbers of the column with this name. NaN and infinities are passed on as they stand there.
    ///
    /// # Errors
    ///
    /// Same as [`place`](Self::place) and [`column_at`](Self::column_at).
    pub fn column(&self, name: &str) -> Result<Vec<f64>, TableError> {
        self.column_at(self.place(name)?)
    }

    /// The numbers of the column at a place, from 0; nothing where there is no such column.
    ///
    /// # Errors
    ///
    /// [`TableError::NotANumber`], or [`TableError::Json`] in JSON, for the first cell that does not hold a number.
    pub fn column_at(&self, place: usize) -> Result<Vec<f64>, TableError> {
        Ok(self.columns_at(&[place])?.pop().unwrap_or_default())
    }

    /// The numbers of several columns at once, as [`column_at`](Self::column_at) gives them.
    ///
    /// # Errors
    ///
    /// Same as [`column_at`](Self::column_at), for the first row with such a cell.
    pub fn columns_at(&self, places: &[usize]) -> Result<Vec<Vec<f64>>, TableError> {
        match &self.body {
            Body::Lines(lines) => lines.columns(places),
            Body::Json(json) => places.iter().map(|&place| json.column(place)).collect(),
        }
    }

    /// The rows of a table in lines, in order; none in JSON.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let lines = match &self.body {
            Body::Lines(lines) => Some(lines),
            Body::Json(_) => None,
        };
        lines.into_iter().flat_map(|lines| {
            let (names, split) = (lines.names.as_slice(), lines.split);
            lines.rows.iter().map(move |&(line, row)| {
                let mut cells = Vec::with_capacity(names.len());
                cells.extend(split.cells(row));
                Row { line, cells, names, split }
            })
        })
    }
}

impl Row<'_> {
    /// The number in the cell at a place, from 0. NaN and infinities are passed on as they stand there.
    ///
    /// # Errors
    ///
    /// [`TableError::NotANumber`], also where there is no such cell.
    pub fn number(&self, place: usize) -> Result<f64, TableError> {
        let cell = self.cells.get(place).map_or("", |cell| cell);
        let name = self.names.get(place).map_or("", String::as_str);
        self.split.number(cell, self.line, name)
    }
}
