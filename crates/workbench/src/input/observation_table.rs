//! A table of observations: times and contact ratios, as CSV.
//!
//! A header line names the columns; the order is free:
//!
//! | column | | unit | range |
//! |---|---|---|---|
//! | `time_s` | required | s after first contact | >= 0, each later than the one before |
//! | `contact_ratio` | required | a/R, neck radius over particle radius | 0 to 2 |
//! | `sigma` | optional | standard deviation of `contact_ratio` | > 0; used by `--noise fixed:table` |
//!
//! How it is written is free as in any [data table](crate::input::data_table): separators, comments (`#`), line ends, a byte
//! order mark. At least one row, at most a million.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{InputError, Mistake, nearest};
use crate::input::data_table::DataTable;
use crate::input::text_file;

/// Largest believable contact ratio: two equal spheres that have merged have 1.26.
pub const LARGEST_CONTACT_RATIO: f64 = 2.0;

const COLUMNS: [&str; 3] = ["time_s", "contact_ratio", "sigma"];

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
}

impl ObservationTable {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::parse(&path.display().to_string(), &text_file::read(path)?)
    }

    /// Reads text; `name` is what errors call it.
    pub fn parse(name: &str, text: &str) -> Result<Self, InputError> {
        let table = DataTable::parse(name, text, SHORTEST)?;
        if let Some(unknown) = table.columns().iter().find(|name| !COLUMNS.contains(&name.as_str()))
        {
            return Err(unknown_column(&table, unknown));
        }
        for column in ["time_s", "contact_ratio"] {
            table.place(column).map_err(|error| {
                error.help("the columns are time_s, contact_ratio and, if you have it, sigma")
            })?;
        }
        let with_sigma = table.columns().iter().any(|name| name == "sigma");
        let time_s = times(&table)?;
        Ok(Self {
            lines: (0..time_s.len()).map(|row| table.line_of(row)).collect(),
            time_s,
            contact_ratio: contact_ratios(&table)?,
            sigma: with_sigma.then(|| sigmas(&table)).transpose()?,
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
    let table = DataTable::parse(name, text, SHORTEST)?;
    if table.columns() == ["time_s"] {
        times(&table)
    } else {
        ObservationTable::parse(name, text).map(|table| table.time_s)
    }
}

fn unknown_column(table: &DataTable<'_>, column: &str) -> InputError {
    let error = InputError::new(table.name, Mistake::UnknownField)
        .at_line(table.names_line())
        .in_column(column)
        .found("unknown column");
    let lower = column.to_lowercase();
    let absent = |wanted: &str| !table.columns().iter().any(|name| name == wanted);
    if absent("time_s") && (lower.contains("time") || lower == "t" || lower.starts_with("t [")) {
        error.help("give times in seconds, in a column called time_s")
    } else if absent("contact_ratio")
        && (lower == "a/r" || lower.contains("ratio") || lower.contains("neck"))
    {
        error.help("give neck radius over particle radius, in a column called contact_ratio")
    } else if let Some(near) = nearest(column, COLUMNS.into_iter().filter(|c| absent(c))) {
        error.help(format_args!("did you mean {near}?"))
    } else {
        error
            .help("the columns are time_s, contact_ratio and, if you have it, sigma; remove others")
    }
}

/// The times: not negative, each later than the one before.
fn times(table: &DataTable<'_>) -> Result<Vec<f64>, InputError> {
    let times = numbers(table, "time_s")?;
    for (row, &time) in times.iter().enumerate() {
        let mistake = |mistake| table.mistake_in(row, "time_s", mistake);
        if time < 0.0 {
            return Err(mistake(Mistake::Negative)
                .expected("a number >= 0")
                .help("times count from first contact; remove or shift what comes before it"));
        }
        if row == 0 || time > times[row - 1] {
            continue;
        }
        let (previous, line) = (times[row - 1], table.line_of(row - 1));
        return Err(if time == previous {
            mistake(Mistake::Duplicate)
                .found(format_args!("{time}, the same as in line {line}"))
                .expected("a later time")
                .help("average repeated measurements, or put each pair into a table of its own")
        } else {
            mistake(Mistake::Unsorted)
                .expected(format_args!("a time after the {previous} of line {line}"))
                .help("sort the rows by time")
        });
    }
    Ok(times)
}

/// A column that cannot be negative.
fn numbers(table: &DataTable<'_>, column: &str) -> Result<Vec<f64>, InputError> {
    table.column(column).map_err(|error| match error.mistake {
        Mistake::WrongType | Mistake::NotFinite => error.expected("a number >= 0"),
        _ => error,
    })
}

/// The contact ratios: 0 to [`LARGEST_CONTACT_RATIO`].
fn contact_ratios(table: &DataTable<'_>) -> Result<Vec<f64>, InputError> {
    let ratios = numbers(table, "contact_ratio")?;
    let wrong = |ratio: &f64| !(0.0..=LARGEST_CONTACT_RATIO).contains(ratio);
    let Some(row) = ratios.iter().position(wrong) else { return Ok(ratios) };
    let mistake = |mistake| table.mistake_in(row, "contact_ratio", mistake);
    if ratios[row] < 0.0 {
        return Err(mistake(Mistake::Negative)
            .expected("a number >= 0")
            .help("a neck cannot be negative; set it to 0 or remove the row"));
    }
    let error =
        mistake(Mistake::OutOfRange).expected("a/R between 0 and 2 (merged spheres have 1.26)");
    Err(if (10.0..=100.0 * LARGEST_CONTACT_RATIO).contains(&ratios[row]) {
        error.help("in percent? divide by 100; in micrometres? divide by the particle radius")
    } else {
        error.help("contact_ratio is neck radius over particle radius, not over diameter")
    })
}

/// The standard deviations: above zero.
fn sigmas(table: &DataTable<'_>) -> Result<Vec<f64>, InputError> {
    let sigmas = table.column("sigma")?;
    let Some(row) = sigmas.iter().position(|&sigma| sigma <= 0.0) else { return Ok(sigmas) };
    let mistake = if sigmas[row] < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
    Err(table
        .mistake_in(row, "sigma", mistake)
        .expected("a number > 0")
        .help("sigma is the standard deviation of contact_ratio; no measurement is exact"))
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
            ("time_s\n0\n", Mistake::MissingColumn, Some(1), "contact_ratio"),
            ("time_ms,contact_ratio\n0,0\n", Mistake::UnknownField, Some(1), "called time_s"),
            ("time_s,a/R\n0,0\n", Mistake::UnknownField, Some(1), "called contact_ratio"),
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
            ("time_s;contact_ratio\n0,5;0,41\n", Mistake::WrongType, Some(2), "a point: 0.5"),
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
            };
            prop_assert_eq!(ObservationTable::parse("t.csv", &table.to_csv()), Ok(table));
        }
    }
}
