//! Rows and cells of a table, for a given separator.

use std::borrow::Cow;

use campaign::table::cells;

use super::numerals;
use crate::error::{InputError, Mistake};
use crate::input::columns::{DecimalMark, Dimension, Unit};
use crate::input::data_table::MOST_ROWS;

/// Separators of cells, white space last: it is in names and thousands too.
const SEPARATORS: [char; 3] = [';', '\t', ','];

/// The lines of a table with something in them.
pub(super) struct Lines<'t> {
    name: &'t str,
    comments: Vec<&'t str>,
    /// Each with its line, from 1; the first is the header, which may run over several lines within quotes.
    rows: Vec<(usize, &'t str)>,
    /// The separator that the file states (`sep=;`, which Excel understands).
    stated: Option<char>,
}

impl<'t> Lines<'t> {
    /// Finds the lines: not empty, not a comment (`#`), not of separators alone.
    pub(super) fn of(name: &'t str, text: &'t str, example: &str) -> Result<Self, InputError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let (mut comments, mut rows, mut stated) = (Vec::new(), Vec::new(), None);
        // The end of a header in quotes that goes over several lines.
        let mut header_end = 0;
        for (line, row) in numbered(text) {
            let begin = row.as_ptr() as usize - text.as_ptr() as usize;
            let content = row.trim();
            let nothing = |c: char| SEPARATORS.contains(&c) || c == '"' || c.is_whitespace();
            if begin < header_end || content.chars().all(nothing) {
                continue;
            }
            if content.starts_with('#') || content.starts_with("\"#") {
                if rows.is_empty() {
                    comments.push(content.trim_matches('"').trim_start_matches('#').trim());
                }
            } else if let (true, Some(separator)) =
                (rows.is_empty() && stated.is_none(), stated_by(content))
            {
                stated = Some(separator);
            } else if rows.is_empty() {
                header_end = begin + header_length(&text[begin..]).unwrap_or(row.len());
                rows.push((line, &text[begin..header_end]));
            } else {
                rows.push((line, row));
            }
        }
        let empty = || InputError::new(name, Mistake::Empty);
        let &(line, _) = rows.first().ok_or_else(|| {
            empty()
                .found("an empty table")
                .expected("the names of the columns and at least one row")
                .help(format_args!(
                    "the shortest table is\n          {}",
                    example.replace('\n', "\n          ")
                ))
        })?;
        match rows.get(MOST_ROWS + 1) {
            Some((line, _)) => Err(InputError::new(name, Mistake::TooLarge)
                .at_line(*line)
                .found(format_args!("more than {MOST_ROWS} rows"))
                .help("keep every n-th row")),
            None if rows.len() == 1 && comments.is_empty() => Err(empty()
                .at_line(line)
                .found("a header without rows")
                .expected("at least one row")),
            None => Ok(Self { name, comments, rows, stated }),
        }
    }

    /// The separators that are there, or white space where there is none.
    pub(super) fn separators(&self) -> Vec<char> {
        if let Some(stated) = self.stated {
            return vec![stated];
        }
        let header = self.rows[0].1;
        let there: Vec<char> = SEPARATORS
            .into_iter()
            .filter(|separator| cells(header, *separator).count() > 1)
            .collect();
        if there.is_empty() { vec![' '] } else { there }
    }

    /// The table with this separator.
    ///
    /// # Errors
    ///
    /// Every row that does not have the columns of the header.
    pub(super) fn grid(&self, separator: char) -> Result<Grid<'t>, Vec<InputError>> {
        let (line, header) = self.rows[0];
        let first: Vec<String> = cells(header, separator).map(|cell| one_line(&cell)).collect();
        let mut grid =
            Grid { name: self.name, separator, names: first, names_line: line, rows: Vec::new() };
        if grid.names.iter().all(|cell| is_number(cell)) {
            let count = grid.names.len();
            let named = |comment: &&&str| names_in(comment, separator, count).is_some();
            let found = self.comments.iter().rev().find(named);
            grid.names =
                found.and_then(|comment| names_in(comment, separator, count)).ok_or_else(|| {
                    vec![
                        InputError::new(self.name, Mistake::MissingColumn)
                            .at_line(line)
                            .found("numbers")
                            .expected("a header with the names of the columns")
                            .help("put the line \"time_s,contact_ratio\" above the first row"),
                    ]
                })?;
            grid.rows.clone_from(&self.rows);
        } else {
            grid.rows.extend_from_slice(&self.rows[1..]);
        }
        while grid.names.last().is_some_and(String::is_empty) {
            grid.names.pop();
        }
        grid.take_units();
        if grid.rows.is_empty() {
            let empty = InputError::new(self.name, Mistake::Empty).at_line(line);
            return Err(vec![empty.found("a header without rows").expected("at least one row")]);
        }
        let wrong: Vec<InputError> = grid.rows.iter().filter_map(|row| grid.misfit(*row)).collect();
        if wrong.is_empty() { Ok(grid) } else { Err(wrong) }
    }
}

/// A table: named columns, and rows whose cells are split when they are asked for.
pub(super) struct Grid<'t> {
    pub(super) name: &'t str,
    pub(super) separator: char,
    /// Names of the columns; none after the last that has one.
    pub(super) names: Vec<String>,
    pub(super) names_line: usize,
    /// Each row with its line, from 1.
    pub(super) rows: Vec<(usize, &'t str)>,
}

impl<'t> Grid<'t> {
    /// The cells of a row: as many as there are columns, those that are not written empty.
    pub(super) fn cells(&self, row: &'t str) -> impl Iterator<Item = Cow<'t, str>> {
        cells(row, self.separator)
            .chain(std::iter::repeat_with(|| Cow::Borrowed("")))
            .take(self.names.len())
    }

    /// The cells of the columns at these places, in this order.
    pub(super) fn columns(&self, places: &[usize]) -> Vec<Vec<Cow<'t, str>>> {
        let mut columns: Vec<Vec<_>> =
            places.iter().map(|_| Vec::with_capacity(self.rows.len())).collect();
        for (_, row) in &self.rows {
            for (at, cell) in self.cells(row).enumerate() {
                for (column, _) in columns.iter_mut().zip(places).filter(|(_, place)| **place == at)
                {
                    column.push(cell.clone());
                }
            }
        }
        columns
    }

    /// Puts a row of units below the names into these: `[min]`, `um`, and no number.
    fn take_units(&mut self) {
        let Some(&(_, first)) = self.rows.first() else { return };
        let units: Vec<String> = self.cells(first).map(|cell| one_line(&cell)).collect();
        let bare = |cell: &str| cell.trim_matches(['[', ']', '(', ')']).to_owned();
        let known = |cell: &String| {
            Unit::parse(&bare(cell)).is_some_and(|unit| unit.dimension != Dimension::Ratio)
        };
        let short = |cell: &String| cell.chars().count() <= 10 && !is_number(cell);
        if !units.iter().any(known) || !units.iter().all(short) {
            return;
        }
        for (name, unit) in self.names.iter_mut().zip(&units).filter(|(_, unit)| !unit.is_empty()) {
            *name = format!("{name} [{}]", bare(unit));
        }
        self.rows.remove(0);
    }

    /// The mistake of a row that has other columns than the header. Cells that are left out at the end of a row are empty
    /// where a spreadsheet may have left them out, and not where a comma could be a decimal one.
    fn misfit(&self, (line, row): (usize, &str)) -> Option<InputError> {
        let expected = self.names.len();
        let (mut count, mut filled) = (0, 0);
        for cell in cells(row, self.separator) {
            count += 1;
            if !cell.is_empty() {
                filled = count;
            }
        }
        let strict = matches!(self.separator, ',' | ' ');
        if filled <= expected && (count >= expected || !strict) {
            return None;
        }
        let found = if filled > expected { filled } else { count };
        let error = InputError::new(self.name, Mistake::Syntax)
            .at_line(line)
            .found(format_args!("{found} values"))
            .expected(format_args!("{expected} as in the header"));
        Some(error.help(match self.separator {
            ',' if found == 2 * expected => {
                "decimal commas between commas cannot be told apart: separate the columns by semicolons, or write 0.5, not 0,5"
            }
            ' ' => "give every row a value for every column; names with blanks in them need quotes, or semicolons between the columns",
            _ => "give every row a value for every column",
        }))
    }
}

/// The lines of a text, from 1. A lone CR (old spreadsheets) ends a line too.
fn numbered(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines =
        text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'));
    (1..).zip(lines)
}

/// The separator that a line `sep=;` states.
fn stated_by(line: &str) -> Option<char> {
    let stated = line.trim_matches('"').strip_prefix("sep=")?;
    SEPARATORS.into_iter().find(|separator| stated.chars().eq([*separator]))
}

/// Length of a header whose quotes are closed within ten lines.
fn header_length(text: &str) -> Option<usize> {
    let mut open = false;
    let mut lines = 1;
    for (at, c) in text.char_indices() {
        match c {
            '"' => open = !open,
            '\n' | '\r' if !open => return Some(at),
            '\n' => lines += 1,
            _ => {}
        }
        if lines > 10 {
            return None;
        }
    }
    (!open).then_some(text.len())
}

/// A name on one line, with one blank between its words.
pub(super) fn one_line(name: &str) -> String {
    name.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Whether a cell holds a number, with a decimal point or comma.
pub(super) fn is_number(cell: &str) -> bool {
    [DecimalMark::Point, DecimalMark::Comma]
        .into_iter()
        .any(|mark| numerals::read(cell, mark).is_some())
}

/// The names in a comment above rows of so many cells, which may be separated in another way than the rows.
fn names_in(comment: &str, separator: char, count: usize) -> Option<Vec<String>> {
    let mut all = [separator, ' '].into_iter().chain(SEPARATORS);
    let fits = all.find(|separator| cells(comment, *separator).count() == count)?;
    Some(cells(comment, fits).map(|cell| one_line(&cell)).collect())
}
