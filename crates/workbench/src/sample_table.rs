//! GrainLearning's sample tables, which YADE's batch runner reads: one parameter set per row.
//!
//! ```text
//! !OMP_NUM_THREADS description key k mu
//!  8 spheres_Iter0_Sample0         0     5.0000000000e-01     3.3333333333e+00
//! ```
//!
//! Columns are separated by blanks. Columns that begin with `!` are settings of the batch runner, `description` and
//! `key` name the set; all others are parameters (a `!` behind a name is not part of it). `#` begins a comment, `=`
//! stands for the value in the row above, empty lines are skipped.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{InputError, Mistake, nearest};
use crate::text_file;

/// Parameter sets by name of the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleTable {
    /// Names of the parameters, in the table's order.
    pub parameters: Vec<String>,
    /// One set per row, in that order.
    pub rows: Vec<Vec<f64>>,
    /// The file, as errors call it.
    pub name: String,
    lines: Vec<usize>,
}

impl SampleTable {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`InputError`] with line, column, value and remedy.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &text_file::read(path)?)
    }

    /// Reads text; `name` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`InputError`] with line, column, value and remedy.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let mut lines = (1..)
            .zip(text.lines())
            .map(|(line, row)| (line, row.split('#').next().unwrap_or_default()))
            .map(|(line, row)| (line, row.split_whitespace().collect::<Vec<_>>()))
            .filter(|(_, fields)| !fields.is_empty());
        let Some((header_line, header)) = lines.next() else {
            return Err(InputError::new(name, Mistake::Empty)
                .found("an empty file")
                .expected("a sample table: !OMP_NUM_THREADS description key and the parameters"));
        };
        let is_parameter =
            |title: &str| !title.starts_with('!') && title != "description" && title != "key";
        let places: Vec<usize> =
            (0..header.len()).filter(|&place| is_parameter(header[place])).collect();
        let parameters: Vec<String> =
            places.iter().map(|&place| header[place].trim_end_matches('!').to_owned()).collect();
        if parameters.is_empty() || parameters.iter().any(|title| title.parse::<f64>().is_ok()) {
            return Err(InputError::new(name, Mistake::MissingColumn)
                .at_line(header_line)
                .found(header.join(" "))
                .expected("a header that names the parameters")
                .help("the first line reads: !OMP_NUM_THREADS description key NAME NAME ..."));
        }
        for (place, title) in parameters.iter().enumerate() {
            if parameters[..place].contains(title) {
                return Err(InputError::new(name, Mistake::Duplicate)
                    .at_line(header_line)
                    .in_column(title)
                    .found("the column twice"));
            }
        }
        let mut table =
            Self { parameters, rows: Vec::new(), name: name.to_owned(), lines: Vec::new() };
        for (line, fields) in lines {
            if fields.len() != header.len() {
                return Err(InputError::new(name, Mistake::Syntax)
                    .at_line(line)
                    .found(format_args!("{} values", fields.len()))
                    .expected(format_args!("{} as in the header", header.len()))
                    .help("values are separated by blanks; none may hold one"));
            }
            let mut row = Vec::with_capacity(places.len());
            for (column, &place) in places.iter().enumerate() {
                let text = fields[place];
                let value = match (text, table.rows.last()) {
                    ("=", Some(above)) => Some(above[column]),
                    _ => text.parse::<f64>().ok().filter(|value| value.is_finite()),
                };
                row.push(value.ok_or_else(|| {
                    InputError::new(name, Mistake::WrongType)
                        .at_line(line)
                        .in_column(&table.parameters[column])
                        .found(format_args!("\"{text}\""))
                        .expected("a finite number")
                })?);
            }
            table.rows.push(row);
            table.lines.push(line);
        }
        if table.rows.is_empty() {
            return Err(InputError::new(name, Mistake::Empty)
                .at_line(header_line)
                .found("a header without rows")
                .expected("at least one parameter set"));
        }
        Ok(table)
    }

    /// The rows with their columns in the order of `names`; every name must be there, and no other.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a parameter too many or too few.
    pub fn in_order(&self, names: &[String]) -> Result<Vec<Vec<f64>>, InputError> {
        let missing = |column: &str, choices: &[String], found: &str, expected: String| {
            InputError::new(&self.name, Mistake::MissingColumn)
                .in_column(column)
                .found(found)
                .expected(expected)
                .help_if(
                    nearest(column, choices.iter().map(String::as_str))
                        .map(|near| format!("did you mean {near}?")),
                )
        };
        let places = names
            .iter()
            .map(|name| {
                self.parameters.iter().position(|title| title == name).ok_or_else(|| {
                    missing(
                        name,
                        &self.parameters,
                        "missing",
                        "a column for every parameter of the plan".to_owned(),
                    )
                })
            })
            .collect::<Result<Vec<_>, _>>()?;
        if let Some(extra) = self.parameters.iter().find(|title| !names.contains(title)) {
            return Err(missing(
                extra,
                names,
                "a parameter that the plan does not have",
                format!("only {}", names.join(", ")),
            ));
        }
        Ok(self.rows.iter().map(|row| places.iter().map(|&place| row[place]).collect()).collect())
    }

    /// Line of a row, from 1.
    #[must_use]
    pub fn line_of(&self, row: usize) -> usize {
        self.lines.get(row).copied().unwrap_or(1)
    }
}

/// Parameter sets as GrainLearning writes them, with all digits, so that they read back to the same numbers.
#[must_use]
pub fn write<'a>(
    title: &str,
    parameters: &[String],
    rows: impl ExactSizeIterator<Item = &'a [f64]>,
) -> String {
    let title: String =
        title.chars().map(|c| if c.is_whitespace() || c == '#' { '_' } else { c }).collect();
    let mut text = format!("!OMP_NUM_THREADS description key {}\n", parameters.join(" "));
    let width = rows.len().saturating_sub(1).to_string().len();
    for (key, row) in rows.enumerate() {
        // Writing to a String cannot fail.
        let _ = write!(text, " 1 {title}_Sample{key:0width$} {key:9}");
        for value in row {
            let _ = write!(text, " {value:24e}");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn grain_learnings_own_table_and_the_batch_runners_shorthand_are_read() {
        let text = "!OMP_NUM_THREADS description key a b \n\
                    \x208 Iter1-Sample00         0     5.0000000000e-01     3.3333333333e+00 \n\
                    # a remark\n\n\
                    \x208 Iter1-Sample01         1     =  6.5 # the same a\n";
        let table = SampleTable::parse("t", text).expect("a table");
        assert_eq!(table.parameters, ["a", "b"]);
        assert_eq!(table.rows, [[0.5, 3.333_333_333_3], [0.5, 6.5]]);
        assert_eq!(table.line_of(1), 5);
        let names = ["b".to_owned(), "a".to_owned()];
        assert_eq!(table.in_order(&names).expect("both")[1], [6.5, 0.5]);
        let plain = SampleTable::parse("t", "a! b\n1 2\n").expect("no settings needed");
        assert_eq!(plain.parameters, ["a", "b"]);
    }

    #[test]
    fn each_mistake_names_its_line_and_column() {
        let table = SampleTable::parse("t", "!OMP_NUM_THREADS key young nu\n1 0 2 3\n");
        let table = table.expect("a table");
        let error = table.in_order(&["yuong".to_owned(), "nu".to_owned()]).expect_err("missing");
        assert!(error.to_string().contains("did you mean young?"), "{error}");
        let error = table.in_order(&["nu".to_owned()]).expect_err("too many");
        assert!(error.to_string().contains("young"), "{error}");
        for (text, mistake, line) in [
            ("", Mistake::Empty, None),
            ("a b\n", Mistake::Empty, Some(1)),
            ("1 2\n3 4\n", Mistake::MissingColumn, Some(1)),
            ("a a\n1 2\n", Mistake::Duplicate, Some(1)),
            ("a b\n1\n", Mistake::Syntax, Some(2)),
            ("a b\n1 nan\n", Mistake::WrongType, Some(2)),
            ("a b\n= 1\n", Mistake::WrongType, Some(2)),
        ] {
            let error = SampleTable::parse("t", text).expect_err(text);
            assert_eq!((error.mistake, error.line), (mistake, line), "{text}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back_to_the_same_bits(
            rows in proptest::collection::vec(
                proptest::collection::vec(proptest::num::f64::NORMAL | proptest::num::f64::ZERO, 2),
                1..20,
            )
        ) {
            let names = ["k".to_owned(), "mu".to_owned()];
            let text = write("my run #1", &names, rows.iter().map(Vec::as_slice));
            let back = SampleTable::parse("t", &text).expect("our own table");
            prop_assert_eq!(&back.parameters, &names);
            prop_assert_eq!(back.rows, rows);
        }
    }
}
