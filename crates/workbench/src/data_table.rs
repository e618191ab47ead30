//! A table of numbers with named columns: measurements of any kind, as CSV, separated by blanks, or as GrainLearning
//! writes them.
//!
//! The header is the first line that is no comment. Where that line holds numbers only, the header is the first line
//! of the file behind its `#`, as in GrainLearning's observation files:
//!
//! ```text
//! # u f
//! 0.0 0.00
//! 0.1 4.98
//! ```
//!
//! Separators, comments and line ends are those of the [observation table](crate::observation_table). A column is read
//! when it is asked for: others may hold text.

use std::path::Path;

use crate::error::{InputError, Mistake, nearest};
use crate::observation_table::{MOST_ROWS, Separator, rows};
use crate::text_file;

/// A table whose header has been read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DataTable {
    /// The file, as errors call it.
    pub name: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    header_line: usize,
    rows: Vec<(usize, Vec<String>)>,
}

impl DataTable {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`InputError`] with line, value and remedy.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &text_file::read(path)?)
    }

    /// Reads text; `name` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`InputError`] with line, value and remedy.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = rows(text).peekable();
        let Some(&(first_line, first)) = lines.peek() else {
            return Err(InputError::new(name, Mistake::Empty)
                .found("an empty table")
                .expected("a header and at least one row"));
        };
        let (header_line, header) = match grain_learning_header(text, first) {
            Some(header) => (1, header),
            None => {
                lines.next();
                (first_line, first)
            }
        };
        let separator = Separator::of(header);
        let columns: Vec<String> = separator.split(header).into_iter().map(str::to_owned).collect();
        if columns.iter().all(|column| column.parse::<f64>().is_ok()) {
            return Err(InputError::new(name, Mistake::MissingColumn)
                .at_line(header_line)
                .found("numbers")
                .expected("a header with the names of the columns")
                .help("put a line with the names above the first row, as in \"time_s,force_n\" or \"# u f\""));
        }
        for (place, column) in columns.iter().enumerate() {
            if columns[..place].contains(column) {
                return Err(InputError::new(name, Mistake::Duplicate)
                    .at_line(header_line)
                    .in_column(column)
                    .found("the column twice")
                    .help("rename one of them"));
            }
        }
        let separator = if header_line == first_line { separator } else { Separator::of(first) };
        let mut table = Self { name: name.to_owned(), columns, header_line, rows: Vec::new() };
        for (line, row) in lines {
            let fields: Vec<String> = separator.split(row).into_iter().map(str::to_owned).collect();
            if fields.len() != table.columns.len() {
                return Err(InputError::new(name, Mistake::Syntax)
                    .at_line(line)
                    .found(format_args!("{} values", fields.len()))
                    .expected(format_args!("{} as in the header", table.columns.len()))
                    .help("give every row a value for every column"));
            }
            if table.rows.len() == MOST_ROWS {
                return Err(InputError::new(name, Mistake::TooLarge)
                    .at_line(line)
                    .found(format_args!("more than {MOST_ROWS} rows"))
                    .help("keep every n-th row"));
            }
            table.rows.push((line, fields));
        }
        if table.rows.is_empty() {
            return Err(InputError::new(name, Mistake::Empty)
                .at_line(header_line)
                .found("a header without rows")
                .expected("at least one observation"));
        }
        Ok(table)
    }

    /// Number of rows, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Never true of a table that was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Line of a row, from 1.
    #[must_use]
    pub fn line_of(&self, row: usize) -> usize {
        self.rows.get(row).map_or(self.header_line, |(line, _)| *line)
    }

    /// A column of finite numbers.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a column that is not there, or a value that is no finite number.
    pub fn column(&self, column: &str) -> Result<Vec<f64>, InputError> {
        let Some(place) = self.columns.iter().position(|name| name == column) else {
            return Err(InputError::new(&self.name, Mistake::MissingColumn)
                .at_line(self.header_line)
                .in_column(column)
                .found("missing")
                .expected(format_args!("one of {}", self.columns.join(", ")))
                .help_if(
                    nearest(column, self.columns.iter().map(String::as_str))
                        .map(|near| format!("did you mean {near}?")),
                ));
        };
        self.rows
            .iter()
            .map(|(line, fields)| {
                let text = &fields[place];
                let refused = |mistake| {
                    InputError::new(&self.name, mistake)
                        .at_line(*line)
                        .in_column(column)
                        .found(format_args!("\"{text}\""))
                        .expected("a finite number")
                };
                match text.parse::<f64>() {
                    Ok(value) if value.is_finite() => Ok(value),
                    Ok(_) => {
                        Err(refused(Mistake::NotFinite)
                            .help("remove the row if nothing was measured"))
                    }
                    Err(_) => Err(refused(Mistake::WrongType)),
                }
            })
            .collect()
    }
}

/// The first line of the file behind its `#`, where the first row is numbers already.
fn grain_learning_header<'t>(text: &'t str, first_row: &str) -> Option<&'t str> {
    let fields = Separator::of(first_row).split(first_row);
    if !fields.iter().all(|field| field.parse::<f64>().is_ok()) {
        return None;
    }
    let header = text.lines().next()?.trim().strip_prefix('#')?.trim();
    (Separator::of(header).split(header).len() == fields.len()).then_some(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_dialect_reads_to_the_same_columns() {
        for text in [
            "u,f\n0,0\n0.1,4.98\n",
            "# a remark\nu;f\n0;0\n0.1;4.98\n",
            "u f\n0 0\n\n  0.1   4.98  \n",
            "# u f\n0.0e+00 0.0\n1.0e-01 4.98\n",
            "#\tu\tf\n0\t0\n0.1\t4.98\n",
            "#u f\n# made by hand\n0 0\n0.1 4.98\n",
            "# u,f\n0,0\n0.1,4.98\n",
        ] {
            let table = DataTable::parse("t", text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(table.columns, ["u", "f"], "{text}");
            assert_eq!(table.column("u").expect("u"), [0.0, 0.1], "{text}");
            assert_eq!(table.column("f").expect("f"), [0.0, 4.98], "{text}");
        }
    }

    #[test]
    fn each_mistake_names_its_line_and_column() {
        let error = DataTable::parse("t", "1 2\n3 4\n").expect_err("no header");
        assert_eq!((error.mistake, error.line), (Mistake::MissingColumn, Some(1)));
        let error = DataTable::parse("t", "# u\n1 2\n3 4\n").expect_err("short header");
        assert_eq!(error.mistake, Mistake::MissingColumn);
        let error = DataTable::parse("t", "u f\n1 2\n3\n").expect_err("short row");
        assert_eq!((error.mistake, error.line), (Mistake::Syntax, Some(3)));
        let error = DataTable::parse("t", "u u\n1 2\n").expect_err("twice");
        assert_eq!(error.mistake, Mistake::Duplicate);
        assert_eq!(DataTable::parse("t", "u f\n").expect_err("none").mistake, Mistake::Empty);
        assert_eq!(DataTable::parse("t", " \n").expect_err("none").mistake, Mistake::Empty);
        let table = DataTable::parse("t", "force,note\n1,a\nnan,b\n").expect("a table");
        let error = table.column("force").expect_err("NaN");
        assert_eq!((error.mistake, error.line), (Mistake::NotFinite, Some(3)));
        assert_eq!(table.column("note").expect_err("text").mistake, Mistake::WrongType);
        let error = table.column("forse").expect_err("misspelt");
        assert!(error.to_string().contains("did you mean force?"), "{error}");
    }
}
