//! Tables in lines: cells between separators or blanks, below a line with the names of the columns.

use std::borrow::Cow;

use super::error::{TableError, short};

/// The parts of a table in lines.
#[derive(Debug, Clone)]
pub(super) struct Lines<'t> {
    pub(super) names: Vec<String>,
    pub(super) names_line: usize,
    pub(super) split: Split,
    /// Each row with its line, from 1; all have as many cells as there are names.
    pub(super) rows: Vec<(usize, &'t str)>,
}

impl<'t> Lines<'t> {
    /// Reads a text whose cells are separated by blanks, or by the character that [`Split::of`] finds.
    ///
    /// The names are in the first line that is not a comment. Where that line holds only numbers, they are in the last
    /// comment above it that has as many words.
    pub(super) fn read(text: &'t str, blanks: bool) -> Result<Self, TableError> {
        let mut comments = Vec::new();
        let mut rows = Vec::new();
        for (line, row) in content(text) {
            match row.strip_prefix('#') {
                None => rows.push((line, row)),
                Some(comment) if rows.is_empty() => comments.push((line, comment)),
                Some(_) => {}
            }
        }
        let &(first_line, first) = rows.first().ok_or(TableError::Empty)?;
        let split = if blanks {
            Split::Blanks
        } else {
            Split::of(first, rows.get(1).map(|row| row.1), text.contains('"'))
        };
        let mut names: Vec<String> = split.cells(first).map(Cow::into_owned).collect();
        let mut names_line = first_line;
        if names.iter().all(|cell| number(cell).is_some()) {
            let found = comments
                .iter()
                .rev()
                .find_map(|&(line, comment)| Some((line, split.names_in(comment, names.len())?)));
            (names_line, names) = found.ok_or(TableError::NoNames { line: first_line })?;
        } else {
            rows.remove(0);
        }
        if rows.is_empty() {
            return Err(TableError::NoRows { line: names_line });
        }
        let expected = names.len();
        for &(line, row) in &rows {
            let found = split.count(row);
            if found != expected {
                let decimal_commas = split.is_comma() && found == 2 * expected;
                return Err(TableError::Ragged { line, found, expected, decimal_commas });
            }
        }
        Ok(Self { names, names_line, split, rows })
    }

    /// The numbers of the columns at these places; nothing where there is no such column.
    pub(super) fn columns(&self, places: &[usize]) -> Result<Vec<Vec<f64>>, TableError> {
        let mut columns = vec![Vec::new(); places.len()];
        let mut order: Vec<usize> =
            (0..places.len()).filter(|&i| places[i] < self.names.len()).collect();
        order.sort_by_key(|&i| places[i]);
        for &i in &order {
            columns[i].reserve_exact(self.rows.len());
        }
        for &(line, row) in &self.rows {
            let mut cells = self.split.cells(row).enumerate();
            let mut cell = None;
            for &i in &order {
                let place = places[i];
                if cell.as_ref().is_none_or(|(at, _)| *at != place) {
                    cell = cells.find(|(at, _)| *at == place);
                }
                let text = cell.as_ref().map_or("", |(_, text)| text);
                columns[i].push(self.split.number(text, line, &self.names[place])?);
            }
        }
        Ok(columns)
    }
}

/// Lines with something in them, without the blanks around it. A lone CR (old spreadsheets) ends a line too.
pub(super) fn content(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines =
        text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'));
    (1..).zip(lines.map(str::trim)).filter(|(_, line)| !line.is_empty())
}

/// Separators in the order in which they are tried: with semicolons, commas may be decimal commas.
pub(super) const SEPARATORS: [u8; 3] = [b';', b',', b'\t'];

/// How the cells of a line are separated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Split {
    Blanks,
    At {
        separator: u8,
        /// Whether there are quotes anywhere in the text.
        quotes: bool,
    },
}

impl Split {
    /// The first separator that splits the first line and the second one into equally many cells, at least two;
    /// otherwise the first that is in the first line.
    fn of(first: &str, second: Option<&str>, quotes: bool) -> Self {
        let all = SEPARATORS.map(|separator| Self::At { separator, quotes });
        let there = || all.into_iter().filter(|split| split.count(first) > 1);
        let fits = |split: &Self| second.is_some_and(|row| split.count(row) == split.count(first));
        there()
            .find(fits)
            .or_else(|| there().next())
            .unwrap_or(Self::At { separator: b',', quotes })
    }

    /// The names in a comment above rows of `count` cells, which may be separated in another way than the rows.
    fn names_in(self, comment: &str, count: usize) -> Option<Vec<String>> {
        let comment = comment.trim_start_matches('#').trim();
        let at = SEPARATORS.map(|separator| Self::At { separator, quotes: true });
        let others = [Self::Blanks].into_iter().chain(at);
        let split = [self].into_iter().chain(others).find(|split| split.count(comment) == count)?;
        Some(split.cells(comment).map(Cow::into_owned).collect())
    }

    /// Number of cells in a line.
    fn count(self, line: &str) -> usize {
        match self {
            Self::At { separator, quotes: false } => {
                // Sums of bytes over short pieces are several times faster than a count.
                let pieces = line.as_bytes().chunks(usize::from(u8::MAX));
                let in_piece = |piece: &[u8]| -> u8 {
                    piece.iter().map(|&byte| u8::from(byte == separator)).sum()
                };
                pieces.map(|piece| usize::from(in_piece(piece))).sum::<usize>() + 1
            }
            _ => self.cells(line).count(),
        }
    }

    /// The number in a cell of a column.
    pub(super) fn number(self, cell: &str, line: usize, column: &str) -> Result<f64, TableError> {
        number(cell).ok_or_else(|| {
            let point = cell.replace(',', ".");
            let comma = !self.is_comma() && number(&point).is_some();
            TableError::NotANumber {
                line,
                column: column.to_owned(),
                found: short(cell),
                with_point: comma.then_some(point),
            }
        })
    }

    /// Whether cells end at commas.
    fn is_comma(self) -> bool {
        matches!(self, Self::At { separator: b',', .. })
    }

    /// The cells of a line, without blanks and quotes around them.
    pub(super) fn cells(self, line: &str) -> Cells<'_> {
        Cells { rest: Some(line), split: self }
    }
}

/// The cells of a line.
#[derive(Debug, Clone)]
pub(super) struct Cells<'t> {
    rest: Option<&'t str>,
    split: Split,
}

impl<'t> Cells<'t> {
    /// Takes the next cell as it is written, with the blanks and quotes around it.
    fn take(&mut self, end: Option<usize>) -> Option<&'t str> {
        let rest = self.rest?;
        // A separator, or ASCII white space, is one byte; any other white space begins the next cell and is trimmed.
        self.rest = end.map(|end| {
            let width = rest[end..].chars().next().map_or(0, char::len_utf8);
            &rest[end + width..]
        });
        Some(&rest[..end.unwrap_or(rest.len())])
    }
}

impl<'t> Iterator for Cells<'t> {
    type Item = Cow<'t, str>;

    fn next(&mut self) -> Option<Cow<'t, str>> {
        let rest = self.rest?;
        match self.split {
            Split::Blanks => {
                let rest = rest.trim_start();
                if rest.is_empty() {
                    self.rest = None;
                    return None;
                }
                self.rest = Some(rest);
                let end = rest.find(char::is_whitespace);
                self.take(end).map(unquoted)
            }
            Split::At { separator, quotes: false } => {
                let end = rest.find(char::from(separator));
                self.take(end).map(|cell| cell.trim().into())
            }
            Split::At { separator, quotes: true } => {
                let separator = char::from(separator);
                let quoted = quoted_length(rest, separator).unwrap_or(0);
                let end = rest[quoted..].find(separator).map(|end| quoted + end);
                self.take(end).map(unquoted)
            }
        }
    }
}

/// Length of the quoted text that a cell begins with, up to and with its closing quote. A quote in it is written twice.
fn quoted_length(text: &str, separator: char) -> Option<usize> {
    let blank = |c: char| c.is_whitespace() && c != separator;
    let inner = text.trim_start_matches(blank).strip_prefix('"')?;
    let begin = text.len() - inner.len();
    let mut quotes = inner.match_indices('"').map(|(place, _)| place);
    while let Some(place) = quotes.next() {
        if inner[place + 1..].starts_with('"') {
            quotes.next();
        } else {
            return Some(begin + place + 1);
        }
    }
    None
}

/// A cell without the blanks and quotes around it.
fn unquoted(cell: &str) -> Cow<'_, str> {
    let cell = cell.trim();
    match cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')) {
        Some(inner) if inner.contains("\"\"") => inner.trim().replace("\"\"", "\"").into(),
        Some(inner) => inner.trim().into(),
        None => cell.into(),
    }
}

/// A number as C, Python and Fortran (1.0D-3) write it; nan and inf are numbers here.
#[must_use]
pub fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    text.parse().ok().or_else(|| {
        let plain = text.len() < 64 && text.bytes().next().is_some_and(|b| b != b'd' && b != b'D');
        if plain { text.replace(['d', 'D'], "e").parse().ok() } else { None }
    })
}
