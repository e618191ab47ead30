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
//! Columns are separated by commas, semicolons, tabs or spaces (the header decides), decimals by a
//! point. Blank lines and lines that start with `#` are comments; line ends may be LF or CRLF, a byte order mark is
//! skipped. At least one row, at most a million.

use std::fmt::Write as _;
use std::path::Path;

use crate::error::{InputError, Mistake, nearest};
use crate::text_file;

/// Most rows that are read.
pub const MOST_ROWS: usize = 1_000_000;

/// Largest believable contact ratio: two equal spheres that have merged have 1.26.
pub const LARGEST_CONTACT_RATIO: f64 = 2.0;

const COLUMNS: [&str; 3] = ["time_s", "contact_ratio", "sigma"];

/// Observations in time order. All columns have the same length, at least 1.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationTable {
    /// Time after first contact \[s\], not negative, strictly increasing.
    pub time_s: Vec<f64>,
    /// Contact ratio a/R, 0 to 2.
    pub contact_ratio: Vec<f64>,
    /// Standard deviation of each contact ratio, above 0, where the table states it.
    pub sigma: Option<Vec<f64>>,
}

impl ObservationTable {
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
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = rows(text);
        let Some((header_line, header)) = lines.next() else {
            return Err(InputError::new(name, Mistake::Empty)
                .found("an empty table")
                .expected("a header and at least one row")
                .help(
                    "the shortest table is\n          time_s,contact_ratio\n          0.5,0.41",
                ));
        };
        let separator = Separator::of(header);
        let columns = Columns::from_header(name, header_line, &separator.split(header))?;

        let mut table = Self {
            time_s: Vec::new(),
            contact_ratio: Vec::new(),
            sigma: columns.sigma.map(|_| Vec::new()),
        };
        let mut last_line = header_line;
        for (line, row) in lines {
            let fields = separator.split(row);
            let cell = |name_of: &'static str, value| Cell {
                source: name,
                line,
                column: name_of,
                text: value,
                separator,
            };
            if fields.len() != columns.count {
                let error = InputError::new(name, Mistake::Syntax)
                    .at_line(line)
                    .found(format_args!("{} values", fields.len()))
                    .expected(format_args!("{} as in the header", columns.count));
                return Err(
                    if separator == Separator::Comma && fields.len() == 2 * columns.count {
                        error.help("decimal commas? write 0.5, not 0,5")
                    } else {
                        error.help("give every row a value for every column")
                    },
                );
            }
            if table.time_s.len() == MOST_ROWS {
                return Err(InputError::new(name, Mistake::TooLarge)
                    .at_line(line)
                    .found(format_args!("more than {MOST_ROWS} rows"))
                    .help("keep every n-th row"));
            }
            let time = cell("time_s", fields[columns.time_s]).not_negative()?;
            if let Some(&previous) = table.time_s.last() {
                cell("time_s", fields[columns.time_s]).after(time, previous, last_line)?;
            }
            let ratio = cell("contact_ratio", fields[columns.contact_ratio]).contact_ratio()?;
            if let (Some(column), Some(sigma)) = (columns.sigma, &mut table.sigma) {
                sigma.push(cell("sigma", fields[column]).positive()?);
            }
            table.time_s.push(time);
            table.contact_ratio.push(ratio);
            last_line = line;
        }
        if table.time_s.is_empty() {
            return Err(InputError::new(name, Mistake::Empty)
                .at_line(header_line)
                .found("a header without rows")
                .expected("at least one observation"));
        }
        Ok(table)
    }

    /// Number of observations.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Never true of a table that was read.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// First and last time \[s\].
    #[must_use]
    pub fn span_s(&self) -> [f64; 2] {
        match (self.time_s.first(), self.time_s.last()) {
            (Some(&first), Some(&last)) => [first, last],
            _ => [0.0, 0.0],
        }
    }

    /// The observations with `start <= time <= end`; may be none.
    #[must_use]
    pub fn within(&self, [start, end]: [f64; 2]) -> Self {
        let keep: Vec<bool> = self.time_s.iter().map(|&t| start <= t && t <= end).collect();
        let kept = |values: &Vec<f64>| {
            values.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
        };
        Self {
            time_s: kept(&self.time_s),
            contact_ratio: kept(&self.contact_ratio),
            sigma: self.sigma.as_ref().map(kept),
        }
    }

    /// The table as CSV that [`parse`](Self::parse) reads to the same numbers.
    #[must_use]
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

/// A list of times \[s\], for curves: a table with the one column `time_s` (others are ignored when
/// they are those of an observation table).
///
/// # Errors
///
/// [`InputError`] with line, column, value and remedy.
pub fn parse_times(name: &str, text: &str) -> Result<Vec<f64>, InputError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = rows(text);
    match lines.next() {
        Some((_, header)) if unquoted(header) == "time_s" => {}
        _ => return ObservationTable::parse(name, text).map(|table| table.time_s),
    }
    let mut times: Vec<f64> = Vec::new();
    let mut last_line = 0;
    for (line, row) in lines {
        let cell = Cell {
            source: name,
            line,
            column: "time_s",
            text: unquoted(row),
            separator: Separator::Comma,
        };
        let time = cell.not_negative()?;
        if let Some(&previous) = times.last() {
            cell.after(time, previous, last_line)?;
        }
        if times.len() == MOST_ROWS {
            return Err(InputError::new(name, Mistake::TooLarge)
                .at_line(line)
                .found(format_args!("more than {MOST_ROWS} times")));
        }
        times.push(time);
        last_line = line;
    }
    if times.is_empty() {
        return Err(InputError::new(name, Mistake::Empty)
            .found("a header without rows")
            .expected("at least one time"));
    }
    Ok(times)
}

/// Lines with something in them, numbered from 1.
pub(crate) fn rows(text: &str) -> impl Iterator<Item = (usize, &str)> {
    // A lone CR (old spreadsheets) ends a line as well.
    let lines = text.split('\n').flat_map(|line| {
        let line = line.strip_suffix('\r').unwrap_or(line);
        line.split('\r')
    });
    (1..).zip(lines.map(str::trim)).filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|field| field.strip_suffix('"')).unwrap_or(field).trim()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Separator {
    Comma,
    Semicolon,
    Tab,
    Spaces,
}

impl Separator {
    pub(crate) fn of(header: &str) -> Self {
        if header.contains(';') {
            Self::Semicolon
        } else if header.contains(',') {
            Self::Comma
        } else if header.contains('\t') {
            Self::Tab
        } else {
            Self::Spaces
        }
    }

    pub(crate) fn split(self, row: &str) -> Vec<&str> {
        match self {
            Self::Comma => row.split(',').map(unquoted).collect(),
            Self::Semicolon => row.split(';').map(unquoted).collect(),
            Self::Tab => row.split('\t').map(unquoted).collect(),
            Self::Spaces => row.split_whitespace().map(unquoted).collect(),
        }
    }
}

/// Where in a row each column is.
struct Columns {
    count: usize,
    time_s: usize,
    contact_ratio: usize,
    sigma: Option<usize>,
}

impl Columns {
    fn from_header(name: &str, line: usize, header: &[&str]) -> Result<Self, InputError> {
        if header.iter().all(|field| field.parse::<f64>().is_ok()) {
            return Err(InputError::new(name, Mistake::MissingColumn)
                .at_line(line)
                .found("numbers")
                .expected("a header with the names of the columns")
                .help("put the line \"time_s,contact_ratio\" above the first row"));
        }
        for (place, field) in header.iter().enumerate() {
            if header[..place].contains(field) {
                return Err(InputError::new(name, Mistake::Duplicate)
                    .at_line(line)
                    .in_column(field)
                    .found("the column twice")
                    .help("remove one of them"));
            }
        }
        let place = |column: &str| header.iter().position(|field| *field == column);
        if let Some(unknown) = header.iter().find(|field| !COLUMNS.contains(field)) {
            return Err(unknown_column(name, line, unknown, header));
        }
        let missing = |column: &str| {
            InputError::new(name, Mistake::MissingColumn)
                .at_line(line)
                .in_column(column)
                .found("missing")
                .help("the columns are time_s, contact_ratio and, if you have it, sigma")
        };
        Ok(Self {
            count: header.len(),
            time_s: place("time_s").ok_or_else(|| missing("time_s"))?,
            contact_ratio: place("contact_ratio").ok_or_else(|| missing("contact_ratio"))?,
            sigma: place("sigma"),
        })
    }
}

fn unknown_column(name: &str, line: usize, column: &str, header: &[&str]) -> InputError {
    let error = InputError::new(name, Mistake::UnknownField)
        .at_line(line)
        .in_column(column)
        .found("unknown column");
    let lower = column.to_lowercase();
    let absent = |wanted: &str| !header.contains(&wanted);
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

/// One value of the table and its place.
struct Cell<'a> {
    source: &'a str,
    line: usize,
    column: &'a str,
    text: &'a str,
    separator: Separator,
}

impl Cell<'_> {
    fn error(&self, mistake: Mistake) -> InputError {
        InputError::new(self.source, mistake).at_line(self.line).in_column(self.column)
    }

    fn number(&self, expected: &str) -> Result<f64, InputError> {
        let Ok(value) = self.text.parse::<f64>() else {
            if self.text.is_empty() {
                return Err(self
                    .error(Mistake::WrongType)
                    .found("nothing")
                    .expected(expected)
                    .help("remove the row if nothing was measured"));
            }
            let error = self
                .error(Mistake::WrongType)
                .found(format_args!("\"{}\"", self.text))
                .expected(expected);
            let point = self.text.replace(',', ".");
            return Err(if self.separator != Separator::Comma && point.parse::<f64>().is_ok() {
                error.help(format_args!("write decimals with a point: {point}"))
            } else {
                error.help("give the bare number, without unit; start comments with # on a line of their own")
            });
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self
                .error(Mistake::NotFinite)
                .found(self.text)
                .expected(expected)
                .help("remove the row if nothing was measured"))
        }
    }

    fn not_negative(&self) -> Result<f64, InputError> {
        let expected = "a number >= 0";
        let value = self.number(expected)?;
        if value < 0.0 {
            let error = self.error(Mistake::Negative).found(self.text).expected(expected);
            return Err(if self.column == "time_s" {
                error.help("times count from first contact; remove or shift what comes before it")
            } else {
                error.help("a neck cannot be negative; set it to 0 or remove the row")
            });
        }
        Ok(value)
    }

    fn positive(&self) -> Result<f64, InputError> {
        let expected = "a number > 0";
        let value = self.number(expected)?;
        if value > 0.0 {
            return Ok(value);
        }
        let mistake = if value < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
        Err(self
            .error(mistake)
            .found(self.text)
            .expected(expected)
            .help("sigma is the standard deviation of contact_ratio; no measurement is exact"))
    }

    fn after(&self, time: f64, previous: f64, previous_line: usize) -> Result<(), InputError> {
        if time > previous {
            Ok(())
        } else if time == previous {
            Err(self
                .error(Mistake::Duplicate)
                .found(format_args!("{time}, the same as in line {previous_line}"))
                .expected("a later time")
                .help("average repeated measurements, or put each pair into a table of its own"))
        } else {
            Err(self
                .error(Mistake::Unsorted)
                .found(time)
                .expected(format_args!("a time after the {previous} of line {previous_line}"))
                .help("sort the rows by time"))
        }
    }

    fn contact_ratio(&self) -> Result<f64, InputError> {
        let value = self.not_negative()?;
        if value <= LARGEST_CONTACT_RATIO {
            return Ok(value);
        }
        let error = self
            .error(Mistake::OutOfRange)
            .found(self.text)
            .expected("a/R between 0 and 2 (merged spheres have 1.26)");
        Err(if (10.0..=100.0 * LARGEST_CONTACT_RATIO).contains(&value) {
            error.help("in percent? divide by 100; in micrometres? divide by the particle radius")
        } else {
            error.help("contact_ratio is neck radius over particle radius, not over diameter")
        })
    }
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
            assert_eq!(ObservationTable::parse("t.csv", text).as_ref(), Ok(&expected), "{text:?}");
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
        };
        let kept = table.within([1.0, 2.0]);
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
                time_s,
                contact_ratio: rows.iter().map(|row| row.1).collect(),
                sigma: with_sigma.then(|| rows.iter().map(|row| row.2).collect()),
            };
            prop_assert_eq!(ObservationTable::parse("t.csv", &table.to_csv()), Ok(table));
        }
    }
}
