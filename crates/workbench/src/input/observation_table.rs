//! A table of observations: times and contact ratios.
//!
//! The documented form is a CSV whose header names the columns; their order is free:
//!
//! | column | | unit | range |
//! |---|---|---|---|
//! | `time_s` | required | s after first contact | 0, or 1e-15 to 1e15, each later than the one before |
//! | `contact_ratio` | required | a/R, neck radius over particle radius | 0 to 2 |
//! | `sigma` | optional | standard deviation of `contact_ratio` | > 0; used by `--noise fixed:table` |
//!
//! Tables of spreadsheets, with other names, units and quantities, are read as [`crate::input::spreadsheet`] says, and
//! [`ObservationTable::how`] tells how. At least one row, at most a million.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{InputError, Mistake};
use crate::input::columns::{Columns, Quantity};
use crate::input::spreadsheet::{Asked, Column, Sheet};
use crate::input::text_file;
use crate::number::significant;

/// Largest believable contact ratio: two equal spheres that have merged have 1.26.
pub const LARGEST_CONTACT_RATIO: f64 = 2.0;

/// Times that are computed with \[s\], beside 0: the model's numbers stay within those of double precision.
pub const TIMES_S: std::ops::RangeInclusive<f64> = 1e-15..=1e15;

/// The shortest table.
const SHORTEST: &str = "time_s,contact_ratio\n0.5,0.41";

/// Observations in time order. All columns have the same length, at least 1.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationTable {
    /// Time after first contact \[s\], not negative, strictly increasing.
    pub time_s: Vec<f64>,
    /// Contact ratio a/R, 0 to 2.
    pub contact_ratio: Vec<f64>,
    /// Standard deviation of each contact ratio, above 0, where the table states it.
    pub sigma: Option<Vec<f64>>,
    /// Line of each observation in the file, from 1.
    pub lines: Vec<usize>,
    /// How the table was read, in one line; none for one in the documented form.
    pub how: Option<String>,
}

impl ObservationTable {
    /// Reads a file, whose columns are those of [`Columns`]. Lengths are divided by the particle radius \[m\].
    pub fn read(path: &Path, columns: &Columns, radius_m: Option<f64>) -> Result<Self, InputError> {
        let (text, encoding) = text_file::read_table(path)?;
        let mut table = Self::parse_as(&path.display().to_string(), &text, columns, radius_m)?;
        if let Some(encoding) = encoding {
            let how = table.how.take().map_or_else(String::new, |how| format!("{how}; "));
            table.how = Some(format!("{how}text in {encoding}"));
        }
        Ok(table)
    }

    /// Reads text whose header says everything; `name` is what errors call it.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        Self::parse_as(name, text, &Columns::default(), None)
    }

    /// As [`read`](Self::read), from text.
    pub fn parse_as(
        name: &str,
        text: &str,
        columns: &Columns,
        radius_m: Option<f64>,
    ) -> Result<Self, InputError> {
        let sheet =
            Sheet::read(name, text, Asked { columns, with_value: true, example: SHORTEST })?;
        let Some((value, quantity)) = &sheet.value else {
            return Err(InputError::new(name, Mistake::MissingColumn).found("no contact ratios"));
        };
        let length = matches!(quantity, Quantity::NeckRadius | Quantity::NeckDiameter);
        if length && radius_m.is_none() {
            return Err(InputError::new(name, Mistake::MissingField)
                .in_column(&value.name)
                .found(format_args!(
                    "a {}, and no particle radius to divide it by",
                    quantity.name()
                ))
                .help(format_args!(
                    "calibrate init {name} --radius-m 30e-6 writes an experiment file with a radius"
                ))
                .help("or name the powder: --material ps|pa12|peek"));
        }
        let radius = radius_m.unwrap_or(1.0);
        let ratios = |column: &Column<'_>| -> Vec<f64> {
            column.si.iter().map(|value| quantity.contact_ratio(*value, radius)).collect()
        };
        let contact_ratio = ratios(value);
        let sigma = sheet.sigma.as_ref().map(ratios);
        let checker = Checker { name, lines: &sheet.lines };
        let mut wrong = checker.times(&sheet.time);
        wrong.extend(checker.contact_ratios(value, *quantity, &contact_ratio, radius_m));
        if let (Some(column), Some(sigma)) = (&sheet.sigma, &sigma) {
            wrong.extend(checker.sigmas(column, sigma));
        }
        wrong.sort_by_key(|error| error.line);
        if let Some(wrong) = InputError::all(wrong) {
            return Err(wrong);
        }
        let over = |radius: f64| {
            format!(
                "; divided by {}R = {} um",
                if *quantity == Quantity::NeckDiameter { "2" } else { "" },
                significant(1e6 * radius, 4)
            )
        };
        let divided = radius_m.filter(|_| length).map_or_else(String::new, over);
        Ok(Self {
            how: sheet.how.map(|how| format!("{how}{divided}")),
            time_s: sheet.time.si,
            contact_ratio,
            sigma,
            lines: sheet.lines,
        })
    }

    /// Number of observations.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are no observations, as in a window between two of them.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// First and last time \[s\].
    pub fn span_s(&self) -> [f64; 2] {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(&first), Some(&last)) => [first, last],
            _ => [0.0, 0.0],
        }
    }

    /// The observations with `start <= time <= end`; there may be none.
    pub fn within(&self, [start, end]: [f64; 2]) -> Self {
        let keep: Vec<bool> = self.time_s.iter().map(|&t| start <= t && t <= end).collect();
        let rows = || keep.iter().enumerate().filter(|(_, keep)| **keep).map(|(row, _)| row);
        let kept = |values: &Vec<f64>| rows().map(|row| values[row]).collect();
        Self {
            time_s: kept(&self.time_s),
            contact_ratio: kept(&self.contact_ratio),
            sigma: self.sigma.as_ref().map(kept),
            lines: rows().map(|row| self.lines[row]).collect(),
            how: self.how.clone(),
        }
    }

    /// The table as CSV that [`parse`](Self::parse) reads to the same numbers.
    pub fn to_csv(&self) -> String {
        let mut csv = String::from("time_s,contact_ratio");
        csv.push_str(if self.sigma.is_some() { ",sigma\n" } else { "\n" });
        for row in 0..self.len() {
            // Writing to a String cannot fail.
            let _ = write!(csv, "{},{}", self.time_s[row], self.contact_ratio[row]);
            if let Some(sigma) = &self.sigma {
                let _ = write!(csv, ",{}", sigma[row]);
            }
            csv.push('\n');
        }
        csv
    }
}

/// A list of times \[s\] for curves: a table with the one column `time_s`, or an observation table, whose times are taken.
pub fn parse_times(name: &str, text: &str) -> Result<Vec<f64>, InputError> {
    let asked = Asked { columns: &Columns::default(), with_value: false, example: SHORTEST };
    let sheet = Sheet::read(name, text, asked)?;
    let checker = Checker { name, lines: &sheet.lines };
    match InputError::all(checker.times(&sheet.time)) {
        Some(wrong) => Err(wrong),
        None => Ok(sheet.time.si),
    }
}

/// Checks the numbers of a table.
struct Checker<'a> {
    name: &'a str,
    lines: &'a [usize],
}

impl Checker<'_> {
    fn mistake(&self, column: &Column<'_>, row: usize, mistake: Mistake) -> InputError {
        InputError::new(self.name, mistake)
            .at_line(self.lines[row])
            .in_column(&column.name)
            .found(&column.cells[row])
    }

    /// The times: not negative, each later than the one before.
    fn times(&self, column: &Column<'_>) -> Vec<InputError> {
        let mut wrong = Vec::new();
        for (row, &time) in column.si.iter().enumerate() {
            let mistake = |mistake| self.mistake(column, row, mistake);
            if time < 0.0 {
                wrong.push(
                    mistake(Mistake::Negative).expected("a number >= 0").help(
                        "times count from first contact; remove or shift what comes before it",
                    ),
                );
            } else if time != 0.0 && !TIMES_S.contains(&time) {
                wrong.push(
                    mistake(Mistake::OutOfRange)
                        .expected("0, or a time between 1e-15 and 1e15 s")
                        .help("a slip of the exponent?"),
                );
            }
            if row == 0 || time > column.si[row - 1] {
                continue;
            }
            let (found, previous, line) =
                (&column.cells[row], &column.cells[row - 1], self.lines[row - 1]);
            wrong.push(if time == column.si[row - 1] {
                mistake(Mistake::Duplicate)
                    .found(format_args!("{found}, the same as in line {line}"))
                    .expected("a later time")
                    .help("average repeated measurements, or put each pair into a table of its own")
            } else {
                mistake(Mistake::Unsorted)
                    .expected(format_args!("a time after the {previous} of line {line}"))
                    .help("sort the rows by time")
            });
        }
        wrong
    }

    /// The contact ratios: 0 to [`LARGEST_CONTACT_RATIO`].
    fn contact_ratios(
        &self,
        column: &Column<'_>,
        quantity: Quantity,
        ratios: &[f64],
        radius_m: Option<f64>,
    ) -> Vec<InputError> {
        let mut wrong = Vec::new();
        let mut hint = Some(meant(quantity, ratios, radius_m));
        for (row, &ratio) in ratios.iter().enumerate() {
            if ratio < 0.0 {
                wrong.push(
                    self.mistake(column, row, Mistake::Negative)
                        .expected("a number >= 0")
                        .help("a neck cannot be negative; set it to 0 or remove the row"),
                );
            } else if ratio > LARGEST_CONTACT_RATIO {
                let mut error = self
                    .mistake(column, row, Mistake::OutOfRange)
                    .expected("a/R between 0 and 2 (merged spheres have 1.26)");
                // Once for the column.
                error.help.extend(hint.take().unwrap_or_default());
                wrong.push(error);
            }
        }
        wrong
    }

    /// The standard deviations: above zero.
    fn sigmas(&self, column: &Column<'_>, sigmas: &[f64]) -> Vec<InputError> {
        let wrong = sigmas.iter().enumerate().filter(|(_, sigma)| **sigma <= 0.0);
        wrong
            .map(|(row, &sigma)| {
                let mistake = if sigma < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
                self.mistake(column, row, mistake).expected("a number > 0").help(
                    "sigma is the standard deviation of contact_ratio; no measurement is exact",
                )
            })
            .collect()
    }
}

/// What contact ratios above 2 probably are, with the conversion of the largest.
fn meant(quantity: Quantity, ratios: &[f64], radius_m: Option<f64>) -> Vec<String> {
    let largest = ratios.iter().copied().fold(0.0, f64::max);
    let shown = significant(largest, 3);
    let mut meant = Vec::new();
    match quantity {
        Quantity::ContactRatio => {
            if let Some(radius) = radius_m
                && (0.05..=LARGEST_CONTACT_RATIO).contains(&(largest * 1e-6 / radius))
            {
                meant.push(format!(
                    "a neck in micrometres? a = {shown} um over R = {} um is a/R = {}: say quantity = \"neck-radius\" and value_unit = \
                     \"um\" in [columns] of the experiment file, or --quantity neck-radius --value-unit um",
                    significant(1e6 * radius, 3),
                    significant(largest * 1e-6 / radius, 3)
                ));
            } else if radius_m.is_none() && largest <= 1000.0 {
                meant.push(
                    "a neck in micrometres? it is divided by the particle radius with --quantity neck-radius --value-unit um"
                        .to_owned(),
                );
            }
            if (10.0..=100.0 * LARGEST_CONTACT_RATIO).contains(&largest) {
                meant.push(format!(
                    "in percent? {shown} % is a/R = {}: say value_unit = \"%\" in [columns] of the experiment file, or --value-unit %",
                    significant(largest / 100.0, 3)
                ));
            }
            meant.push(
                "contact_ratio is neck radius over particle radius, not over diameter".to_owned(),
            );
        }
        Quantity::ContactOverDiameter => meant.push("a/(2R) is at most 1: is it a/R?".to_owned()),
        Quantity::NeckRadius | Quantity::NeckDiameter => {
            let radius = significant(1e6 * radius_m.unwrap_or_default(), 3);
            meant.push(format!(
                "the neck over R = {radius} um is a/R = {shown} at most: check its unit, the particle radius, and whether it is a \
                 radius or a diameter"
            ));
        }
    }
    meant
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn mistake(text: &str) -> (Mistake, Option<usize>, String) {
        let error = ObservationTable::parse("t.csv", text).expect_err("a mistake");
        (error.mistake, error.line, error.to_string())
    }

    #[test]
    fn each_separator_line_end_and_byte_order_mark_reads_to_the_same_numbers() {
        let expected = ObservationTable {
            time_s: vec![0.0, 0.5],
            contact_ratio: vec![0.1, 0.41],
            sigma: None,
            lines: Vec::new(),
            how: None,
        };
        for text in [
            "time_s,contact_ratio\n0,0.1\n0.5,0.41\n",
            "\u{feff}time_s,contact_ratio\r\n0,0.1\r\n0.5,0.41\r\n",
            "# c\n\n time_s ; contact_ratio \n0;0.1\n# c\n5e-1; 0.41",
            "time_s\tcontact_ratio\n0\t0.1\n0.5\t0.41\n",
            "time_s   contact_ratio\n0 0.1\n  0.5    0.41\n",
            "contact_ratio,time_s\r0.1,0\r0.41,0.5\r",
            "\"time_s\",\"contact_ratio\"\n\"0\",\"0.1\"\n0.5,0.41\n",
        ] {
            let found = ObservationTable::parse("t.csv", text).expect(text);
            assert_eq!(ObservationTable { lines: Vec::new(), ..found }, expected, "{text:?}");
        }
    }

    #[test]
    fn each_mistake_has_its_own_kind_and_line() {
        let head = "time_s,contact_ratio\n";
        for (text, kind, line, says) in [
            ("", Mistake::Empty, None, "empty table"),
            ("# only a comment\n", Mistake::Empty, None, "empty table"),
            (head, Mistake::Empty, Some(1), "header without rows"),
            ("0,0.1\n1,0.2\n", Mistake::MissingColumn, Some(1), "above the first row"),
            ("time,a/R\n0,0\n", Mistake::UnknownField, Some(1), "called time_s"),
            ("time_s\n0\n", Mistake::MissingColumn, Some(1), "contact_ratio"),
            ("time_s,force\n0,0\n", Mistake::MissingColumn, Some(1), "called contact_ratio"),
            ("time_s,neck\n0,0\n", Mistake::UnknownField, Some(1), "what was measured"),
            ("time_s,neck radius\n0,0\n", Mistake::UnknownField, Some(1), "neck radius [um]"),
            ("time_s,neck radius [um]\n0,0\n", Mistake::MissingField, None, "--radius-m"),
            ("time_s,contact_ratio,sigmma\n0,0,1\n", Mistake::UnknownField, Some(1), "mean sigma?"),
            ("time_s,time_s\n0,0\n", Mistake::Duplicate, Some(1), "twice"),
            (&format!("{head}0,0\n2,0.1\n1,0.2\n"), Mistake::Unsorted, Some(4), "2 of line 3"),
            (&format!("{head}1,0\n1,0.1\n"), Mistake::Duplicate, Some(3), "same as in line 2"),
            (&format!("{head}0,nan\n"), Mistake::NotFinite, Some(2), "nan"),
            (&format!("{head}inf,0.1\n"), Mistake::NotFinite, Some(2), "inf"),
            (&format!("{head}0,1e999\n"), Mistake::NotFinite, Some(2), "1e999"),
            (&format!("{head}-1,0.1\n"), Mistake::Negative, Some(2), "first contact"),
            (&format!("{head}0,-0.1\n"), Mistake::Negative, Some(2), "neck"),
            (&format!("{head}0,abc\n"), Mistake::WrongType, Some(2), "\"abc\""),
            (&format!("{head}0,\n"), Mistake::WrongType, Some(2), "nothing"),
            (&format!("{head}0\n"), Mistake::Syntax, Some(2), "1 values, expected 2"),
            (&format!("{head}0,5,0,41\n"), Mistake::Syntax, Some(2), "decimal commas"),
            ("time_s;contact_ratio\n0.5;0,41\n", Mistake::WrongType, Some(2), "write all alike"),
            ("time_s;contact_ratio\n1,234;1,100\n", Mistake::Conflict, Some(2), "one way only"),
            (&format!("{head}1e-320,0.1\n"), Mistake::OutOfRange, Some(2), "1e-15"),
            (&format!("{head}1e308,0.1\n"), Mistake::OutOfRange, Some(2), "1e15"),
            (&format!("{head}0,41.0\n"), Mistake::OutOfRange, Some(2), "percent"),
            (&format!("{head}0,2.1\n"), Mistake::OutOfRange, Some(2), "not over diameter"),
            ("time_s,contact_ratio,sigma\n0,0,0\n", Mistake::OutOfRange, Some(2), "exact"),
            ("time_s,contact_ratio,sigma\n0,0,-1\n", Mistake::Negative, Some(2), "sigma"),
        ] {
            let (seen, at, message) = mistake(text);
            assert_eq!((seen, at), (kind, line), "{text:?}: {message}");
            assert!(message.contains(says), "{text:?}: {message}");
        }
    }

    #[test]
    fn a_window_keeps_both_its_ends() {
        let table = ObservationTable {
            time_s: vec![0.0, 1.0, 2.0, 3.0],
            contact_ratio: vec![0.1, 0.2, 0.3, 0.4],
            sigma: Some(vec![0.01, 0.02, 0.03, 0.04]),
            lines: vec![2, 3, 5, 6],
            how: None,
        };
        let kept = table.within([1.0, 2.0]);
        assert_eq!(kept.lines, [3, 5]);
        assert_eq!(kept.time_s, [1.0, 2.0]);
        assert_eq!(kept.contact_ratio, [0.2, 0.3]);
        assert_eq!(kept.sigma, Some(vec![0.02, 0.03]));
        assert!(table.within([5.0, 6.0]).is_empty());
    }

    #[test]
    fn times_come_from_a_column_of_times_or_from_observations() {
        assert_eq!(parse_times("t", "time_s\n0\n1e-3\n"), Ok(vec![0.0, 1e-3]));
        assert_eq!(parse_times("t", "time_s,contact_ratio\n0,0\n2,0.1\n"), Ok(vec![0.0, 2.0]));
        let unsorted = parse_times("t", "time_s\n1\n0\n").expect_err("unsorted");
        assert_eq!((unsorted.mistake, unsorted.line), (Mistake::Unsorted, Some(3)));
        assert_eq!(parse_times("t", "time_s\n").expect_err("empty").mistake, Mistake::Empty);
    }

    proptest! {
        #[test]
        fn arbitrary_text_never_panics(text in ".*", name in ".{0,8}") {
            let _ = ObservationTable::parse(&name, &text);
            let _ = parse_times(&name, &text);
        }

        #[test]
        fn text_that_is_nearly_a_table_never_panics(
            text in "(\u{feff}|#)?(time_s|contact_ratio|sigma|[,;\t \r\n\"0-9.eE+-]|nan|inf|µ){0,60}",
        ) {
            let _ = ObservationTable::parse("t.csv", &text);
            let _ = parse_times("t.csv", &text);
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            if let Ok(text) = text_file::decode("t.csv", bytes) {
                let _ = ObservationTable::parse("t.csv", &text);
            }
        }

        #[test]
        fn a_table_survives_writing_and_reading_to_the_last_bit(
            rows in proptest::collection::vec((1e-9f64..1e3, 0.0f64..=2.0, 1e-12f64..1.0), 1..50),
            with_sigma in any::<bool>(),
        ) {
            let mut time = 0.0;
            let time_s: Vec<f64> = rows.iter().map(|row| { time += row.0; time }).collect();
            prop_assume!(time_s.is_sorted_by(|a, b| a < b));
            let table = ObservationTable {
                lines: (2..rows.len() + 2).collect(),
                time_s,
                contact_ratio: rows.iter().map(|row| row.1).collect(),
                sigma: with_sigma.then(|| rows.iter().map(|row| row.2).collect()),
                how: None,
            };
            prop_assert_eq!(ObservationTable::parse("t.csv", &table.to_csv()), Ok(table));
        }
    }
}
