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

use campaign::table::{Format, TableError};

use crate::error::{InputError, Mistake};
use crate::input::data_table::DataTable;
use crate::input::text_file;

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
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &text_file::read(path)?)
    }

    /// Reads text; `name` is what errors call it.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        const HEADER: &str = "the first line reads: !OMP_NUM_THREADS description key NAME NAME ...";
        let without_comments: String = text
            .lines()
            .flat_map(|line| [line.split('#').next().unwrap_or_default(), "\n"])
            .collect();
        let table =
            DataTable::of_format(name, &without_comments, Format::Whitespace).map_err(|error| {
                match error.mistake {
                    Mistake::Empty | Mistake::MissingColumn => error.help(HEADER),
                    _ => error,
                }
            })?;
        let is_parameter =
            |title: &str| !title.starts_with('!') && title != "description" && title != "key";
        let (places, parameters): (Vec<usize>, Vec<String>) = (0..)
            .zip(table.columns())
            .filter(|(_, title)| is_parameter(title))
            .map(|(place, title)| (place, title.trim_end_matches('!').to_owned()))
            .unzip();
        if parameters.is_empty() || parameters.iter().any(|title| title.parse::<f64>().is_ok()) {
            return Err(InputError::new(name, Mistake::MissingColumn)
                .at_line(table.names_line())
                .found(table.columns().join(" "))
                .expected("a header that names the parameters")
                .help(HEADER));
        }
        for (place, title) in parameters.iter().enumerate() {
            if parameters[..place].contains(title) {
                let (line, column) = (Some(table.names_line()), title.clone());
                return Err(table.refused(&TableError::DuplicateName { line, column }));
            }
        }
        let mut sets: Vec<Vec<f64>> = Vec::new();
        let mut lines = Vec::new();
        for row in table.rows() {
            let mut set = Vec::with_capacity(places.len());
            for (column, &place) in places.iter().enumerate() {
                let value = match sets.last() {
                    Some(above) if row.cells[place] == "=" => above[column],
                    _ => row.number(place).map_err(|error| table.refused(&error))?,
                };
                if !value.is_finite() {
                    return Err(table.not_finite(sets.len(), &table.columns()[place]));
                }
                set.push(value);
            }
            sets.push(set);
            lines.push(row.line);
        }
        Ok(Self { parameters, rows: sets, name: name.to_owned(), lines })
    }

    /// The rows with their columns in the order of `names`; every name must be there, and no other.
    ///
    /// # Errors
    ///
    /// [`InputError`] for a parameter too many or too few.
    pub fn in_order(&self, names: &[String]) -> Result<Vec<Vec<f64>>, InputError> {
        let mistake = |column: &str, choices: &[String]| {
            InputError::new(&self.name, Mistake::MissingColumn)
                .in_column(column)
                .did_you_mean(column, choices.iter().map(String::as_str))
        };
        let place = |name: &String| {
            self.parameters.iter().position(|title| title == name).ok_or_else(|| {
                mistake(name, &self.parameters)
                    .found("missing")
                    .expected("a column for every parameter of the plan")
            })
        };
        let places = names.iter().map(place).collect::<Result<Vec<_>, _>>()?;
        if let Some(extra) = self.parameters.iter().find(|title| !names.contains(title)) {
            return Err(mistake(extra, names)
                .found("a parameter that the plan does not have")
                .expected(format_args!("only {}", names.join(", "))));
        }
        Ok(self.rows.iter().map(|row| places.iter().map(|&place| row[place]).collect()).collect())
    }

    /// Line of a row, from 1.
    pub fn line_of(&self, row: usize) -> usize {
        self.lines.get(row).copied().unwrap_or(1)
    }
}

/// Parameter sets as GrainLearning writes them, with all digits, so that they read back to the same numbers.
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
            ("a b\n1 nan\n", Mistake::NotFinite, Some(2)),
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
