//! A table of numbers with named columns, as people and runs write them.
//!
//! [`campaign::table`] reads it; here its errors get the file's name and what to do. Cells are separated by commas,
//! semicolons, tabs or blanks, decimals have a point. The names are in the first line that is not a comment (`#`), or,
//! where that line holds only numbers, in a comment above it, as in GrainLearning's observation files:
//!
//! ```text
//! # u f
//! 0.0 0.00
//! 0.1 4.98
//! ```

use campaign::table::{Format, Row, Table, TableError};

use crate::error::{InputError, Mistake};

/// Largest number of rows in a user's table.
pub const MOST_ROWS: usize = 1_000_000;

/// A table, and what errors call it. Cells are read when they are asked for, so that other columns may hold text.
#[derive(Debug, Clone)]
pub struct DataTable<'t> {
    /// The file, as errors call it.
    pub name: &'t str,
    table: Table<'t>,
}

impl<'t> DataTable<'t> {
    /// Reads a user's table: every column has a name of its own, and there are 1 to [`MOST_ROWS`] rows. `name` is what
    /// errors call it, and `example` is a table of two lines for their help.
    pub fn parse(name: &'t str, text: &'t str, example: &str) -> Result<Self, InputError> {
        let read = Self::of_format(name, text, Format::guess(text));
        let table = read.map_err(|error| match error.mistake {
            Mistake::Empty => {
                let indented = example.replace('\n', "\n          ");
                error.help(format_args!("the shortest table is\n          {indented}"))
            }
            Mistake::MissingColumn => {
                let names = example.lines().next().unwrap_or_default();
                error.help(format_args!("put the line \"{names}\" above the first row"))
            }
            _ => error,
        })?;
        table.table.check_names().map_err(|error| table.refused(&error))?;
        match table.table.line(MOST_ROWS) {
            Some(line) => Err(InputError::new(name, Mistake::TooLarge)
                .at_line(line)
                .found(format_args!("more than {MOST_ROWS} rows"))
                .help("keep every n-th row")),
            None => Ok(table),
        }
    }

    /// Reads a table of a known format and any length, whose names are not checked.
    pub fn of_format(name: &'t str, text: &'t str, format: Format) -> Result<Self, InputError> {
        let table = Table::parse(text, format).map_err(|error| refused(name, &error))?;
        Ok(Self { name, table })
    }

    /// Names of the columns, in order.
    pub fn columns(&self) -> &[String] {
        self.table.names()
    }

    /// Line of the names, from 1.
    pub fn names_line(&self) -> usize {
        self.table.names_line().unwrap_or(1)
    }

    /// Line of a row, from 1.
    pub fn line_of(&self, row: usize) -> usize {
        self.table.line(row).unwrap_or_else(|| self.names_line())
    }

    /// The rows, in order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.table.rows()
    }

    /// Place of the column with this name, from 0.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a column that is not there, with the nearest one that is.
    pub fn place(&self, column: &str) -> Result<usize, InputError> {
        self.table.place(column).map_err(|error| self.refused(&error))
    }

    /// The finite numbers of the column with this name.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a column that is not there, or a cell that does not hold a finite number.
    pub fn column(&self, column: &str) -> Result<Vec<f64>, InputError> {
        Ok(self.columns_at(&[self.place(column)?])?.pop().unwrap_or_default())
    }

    /// The finite numbers of the columns at these places, from 0; nothing where there is no such column.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a cell that does not hold a finite number.
    pub fn columns_at(&self, places: &[usize]) -> Result<Vec<Vec<f64>>, InputError> {
        let columns = self.table.columns_at(places).map_err(|error| self.refused(&error))?;
        for (&place, column) in places.iter().zip(&columns) {
            if let Some(row) = column.iter().position(|value| !value.is_finite()) {
                return Err(self.not_finite(row, &self.columns()[place]));
            }
        }
        Ok(columns)
    }

    /// A mistake in a cell, with the cell's text as what was found.
    pub fn mistake_in(&self, row: usize, column: &str, mistake: Mistake) -> InputError {
        let text = self.table.place(column).ok().and_then(|place| {
            let row = self.rows().nth(row)?;
            row.cells.get(place).map(|cell| cell.to_string())
        });
        InputError::new(self.name, mistake)
            .at_line(self.line_of(row))
            .in_column(column)
            .found(text.unwrap_or_default())
    }

    /// The mistake of a cell that holds NaN or an infinity.
    pub(crate) fn not_finite(&self, row: usize, column: &str) -> InputError {
        self.mistake_in(row, column, Mistake::NotFinite)
            .expected("a finite number")
            .help("remove the row if nothing was measured")
    }

    /// A mistake found by the reader of tables, with the name of the file and a remedy.
    pub(crate) fn refused(&self, error: &TableError) -> InputError {
        refused(self.name, error)
    }
}

fn refused(name: &str, error: &TableError) -> InputError {
    let input = |mistake| {
        let mut input = InputError::new(name, mistake);
        input.line = error.line();
        match error.column() {
            Some(column) => input.in_column(column),
            None => input,
        }
    };
    match error {
        TableError::Empty => input(Mistake::Empty)
            .found("an empty table")
            .expected("the names of the columns and at least one row"),
        TableError::NoRows { .. } => {
            input(Mistake::Empty).found("a header without rows").expected("at least one row")
        }
        TableError::NoNames { .. } => input(Mistake::MissingColumn)
            .found("numbers")
            .expected("a header with the names of the columns"),
        TableError::Ragged { found, expected, decimal_commas, .. } => input(Mistake::Syntax)
            .found(format_args!("{found} values"))
            .expected(format_args!("{expected} as in the header"))
            .help(if *decimal_commas {
                "decimal commas? write 0.5, not 0,5"
            } else {
                "give every row a value for every column"
            }),
        TableError::DuplicateName { .. } => {
            input(Mistake::Duplicate).found("the column twice").help("rename or remove one of them")
        }
        TableError::EmptyName { number, .. } => input(Mistake::Syntax)
            .found(format_args!("column {number} without a name"))
            .help("give it a name or remove it"),
        TableError::MissingColumn { column, names, .. } => input(Mistake::MissingColumn)
            .found("missing")
            .did_you_mean(column, names.iter().map(String::as_str))
            .help(format_args!("the table has {}", names.join(", "))),
        TableError::NotANumber { found, with_point, .. } => {
            let input = input(Mistake::WrongType).expected("a finite number");
            match with_point {
                _ if found.is_empty() => {
                    input.found("nothing").help("remove the row if nothing was measured")
                }
                Some(number) => input
                    .found(format_args!("\"{found}\""))
                    .help(format_args!("write decimals with a point: {number}")),
                None => input.found(format_args!("\"{found}\"")).help(
                    "give the bare number, without unit; start comments with # on a line of their own",
                ),
            }
        }
        other => input(Mistake::Syntax).found(other),
    }
}

/// Text as a cell of a CSV table, in quotes where it needs them.
pub fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<DataTable<'_>, InputError> {
        DataTable::parse("t", text, "u,f\n0.1,4.98")
    }

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
            let table = parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(table.columns(), ["u", "f"], "{text}");
            assert_eq!(table.column("u").expect("u"), [0.0, 0.1], "{text}");
            assert_eq!(table.column("f").expect("f"), [0.0, 4.98], "{text}");
        }
    }

    #[test]
    fn each_mistake_names_its_line_and_column() {
        let error = parse("1 2\n3 4\n").expect_err("no header");
        assert_eq!((error.mistake, error.line), (Mistake::MissingColumn, Some(1)));
        let error = parse("# u\n1 2\n3 4\n").expect_err("short header");
        assert_eq!(error.mistake, Mistake::MissingColumn);
        let error = parse("u f\n1 2\n3\n").expect_err("short row");
        assert_eq!((error.mistake, error.line), (Mistake::Syntax, Some(3)));
        let error = parse("u u\n1 2\n").expect_err("twice");
        assert_eq!(error.mistake, Mistake::Duplicate);
        assert_eq!(parse("u f\n").expect_err("none").mistake, Mistake::Empty);
        assert_eq!(parse(" \n").expect_err("none").mistake, Mistake::Empty);
        let table = parse("force,note\n1,a\nnan,b\n").expect("a table");
        let error = table.column("force").expect_err("NaN");
        assert_eq!((error.mistake, error.line), (Mistake::NotFinite, Some(3)));
        assert_eq!(table.column("note").expect_err("text").mistake, Mistake::WrongType);
        let error = table.column("forse").expect_err("misspelt");
        assert!(error.to_string().contains("did you mean force?"), "{error}");
    }
}
