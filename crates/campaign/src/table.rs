//! Tables that simulators write: CSV, columns separated by blanks, JSON.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use serde_json::Value;

use crate::outcome::FailureKind;
use crate::spec::Format;

/// Largest table that is read \[bytes\].
const LARGEST_BYTES: u64 = 512 << 20;

/// Why a table gives no values: the cause, and what was seen.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Refusal {
    pub(crate) kind: FailureKind,
    pub(crate) detail: String,
}

/// Columns of a table with names, the numbers as they stand there (nan and inf too).
#[derive(Debug)]
pub(crate) struct Table {
    file: String,
    names: Vec<String>,
    columns: Vec<Vec<Cell>>,
}

#[derive(Debug, Clone)]
struct Cell {
    /// The number, or the text that is none.
    value: Result<f64, String>,
    /// Line, or place in an array, from 1.
    place: usize,
}

impl Table {
    /// Reads `file` in `folder`.
    pub(crate) fn read(folder: &Path, file: &str, format: Format) -> Result<Self, Refusal> {
        let text = read_text(folder, file)?;
        let (names, columns) = match format {
            Format::Csv => separated(&text, Split::by_character),
            Format::Whitespace => separated(&text, |_| Split::Blanks),
            Format::Json => json(&text),
        }
        .map_err(|detail| malformed(file, detail))?;
        Ok(Self { file: file.to_owned(), names, columns })
    }

    /// The numbers of a column.
    pub(crate) fn column(&self, name: &str) -> Result<Vec<f64>, Refusal> {
        let mut places = self.names.iter().enumerate().filter(|(_, known)| *known == name);
        let Some((place, _)) = places.next() else {
            let kind =
                FailureKind::MissingColumn { file: self.file.clone(), column: name.to_owned() };
            let detail = format!("it has {}", self.names.join(", "));
            return Err(Refusal { kind, detail });
        };
        if places.next().is_some() {
            return Err(malformed(&self.file, format!("column {name} is there twice")));
        }
        let numbers = self.columns[place].iter().map(|cell| {
            cell.value.as_ref().copied().map_err(|text| {
                let detail = format!("row {}, column {name}: {text}", cell.place);
                malformed(&self.file, detail)
            })
        });
        numbers.collect()
    }
}

pub(crate) fn malformed(file: &str, detail: impl Into<String>) -> Refusal {
    let kind = FailureKind::MalformedOutput { file: file.to_owned() };
    Refusal { kind, detail: detail.into() }
}

fn read_text(folder: &Path, file: &str) -> Result<String, Refusal> {
    let path = folder.join(file);
    let mut bytes = Vec::new();
    // A pipe or a device would never end.
    let plain = path.metadata().and_then(|metadata| {
        if metadata.is_file() { Ok(()) } else { Err(io::Error::other("it is not a plain file")) }
    });
    let read = plain
        .and_then(|()| File::open(&path))
        .and_then(|file| file.take(LARGEST_BYTES + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 > LARGEST_BYTES => {
            Err(malformed(file, format!("it is larger than {} MiB", LARGEST_BYTES >> 20)))
        }
        // Only the names could be in another encoding, and they would not be found.
        Ok(_) => Ok(match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
        }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let kind = FailureKind::MissingOutput { file: file.to_owned() };
            Err(Refusal { kind, detail: String::new() })
        }
        Err(error) => Err(malformed(file, error.to_string())),
    }
}

type Columns = (Vec<String>, Vec<Vec<Cell>>);

/// How the cells of a line are separated.
#[derive(Debug, Clone, Copy)]
enum Split {
    Blanks,
    At(u8),
}

impl Split {
    /// By the first of comma, semicolon and tabulator that the line has.
    fn by_character(line: &str) -> Self {
        let found = [b',', b';', b'\t'].into_iter().find(|byte| line.as_bytes().contains(byte));
        Self::At(found.unwrap_or(b','))
    }

    fn cells(self, line: &str) -> Vec<String> {
        match self {
            Self::Blanks => line.split_whitespace().map(str::to_owned).collect(),
            Self::At(separator) => {
                let mut reader = csv::ReaderBuilder::new()
                    .has_headers(false)
                    .delimiter(separator)
                    .trim(csv::Trim::All)
                    .from_reader(line.as_bytes());
                let record = reader.records().next().and_then(Result::ok).unwrap_or_default();
                record.iter().map(str::to_owned).collect()
            }
        }
    }
}

/// A table in lines. The names are in the first line that is no comment, or, where that line has only numbers, in the
/// last comment above it.
fn separated(text: &str, split: impl FnOnce(&str) -> Split) -> Result<Columns, String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let mut comment = None;
    let (first_place, first) = loop {
        match lines.next() {
            None => return Err("it has no rows".into()),
            Some((_, line)) if line.trim_start().starts_with('#') => comment = Some(line),
            Some(line) => break line,
        }
    };
    let split = split(first);
    let cells = split.cells(first);
    let numbers = cells.iter().all(|cell| number(cell).is_some());
    let (names, first_row) = match (numbers, comment) {
        (false, _) => (cells, None),
        (true, Some(comment)) => {
            let names = comment.trim_start().trim_start_matches('#').trim();
            // A comment may separate its names by blanks above a comma-separated table.
            let named = split.cells(names);
            let named = if named.len() == cells.len() { named } else { Split::Blanks.cells(names) };
            (named, Some((first_place, first)))
        }
        (true, None) => return Err("it has no line with the names of the columns".into()),
    };
    let mut columns: Vec<Vec<Cell>> = vec![Vec::new(); names.len()];
    for (i, line) in first_row.into_iter().chain(lines) {
        if line.trim_start().starts_with('#') {
            continue;
        }
        let place = i + 1;
        let cells = split.cells(line);
        if cells.len() != names.len() {
            return Err(format!("line {place}: {} cells, {} names", cells.len(), names.len()));
        }
        for (column, cell) in columns.iter_mut().zip(cells) {
            let value = number(&cell).ok_or_else(|| format!("{:?} is no number", short(&cell)));
            column.push(Cell { value, place });
        }
    }
    Ok((names, columns))
}

/// A number as C, Python and Fortran (1.0D-3) write it.
fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    text.parse().ok().or_else(|| {
        let plain = text.len() < 64 && text.bytes().next().is_some_and(|b| b != b'd' && b != b'D');
        if plain { text.replace(['d', 'D'], "e").parse().ok() } else { None }
    })
}

fn short(text: &str) -> String {
    text.chars().take(40).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// An object of arrays or numbers, or an array of objects.
fn json(text: &str) -> Result<Columns, String> {
    let parsed = serde_json::from_str(text).or_else(|error| {
        // Python writes NaN and Infinity, which JSON does not have.
        serde_json::from_str(&without_nan(text)).map_err(|_| error.to_string())
    });
    match parsed? {
        Value::Object(object) => {
            let mut names = Vec::new();
            let mut columns = Vec::new();
            for (name, value) in object {
                let values = match value {
                    Value::Array(values) => values,
                    value => vec![value],
                };
                let cells = values.iter().enumerate().map(|(i, value)| json_cell(value, i));
                columns.push(cells.collect());
                names.push(name);
            }
            Ok((names, columns))
        }
        Value::Array(rows) => {
            let Some(Value::Object(first)) = rows.first() else {
                return Err("it is not an array of objects".into());
            };
            let names: Vec<String> = first.keys().cloned().collect();
            let mut columns = vec![Vec::with_capacity(rows.len()); names.len()];
            for (i, row) in rows.iter().enumerate() {
                for (name, column) in names.iter().zip(&mut columns) {
                    let value = row.get(name);
                    let value = value.ok_or_else(|| format!("row {} has no {name}", i + 1))?;
                    column.push(json_cell(value, i));
                }
            }
            Ok((names, columns))
        }
        _ => Err("it is neither an object nor an array".into()),
    }
}

fn json_cell(value: &Value, i: usize) -> Cell {
    let value = match value {
        Value::Null => Ok(f64::NAN),
        Value::Number(number) => number.as_f64().ok_or_else(|| format!("{number} is too large")),
        other => Err(format!("{:?} is no number", short(&other.to_string()))),
    };
    Cell { value, place: i + 1 }
}

/// The same JSON with null for NaN, Infinity and -Infinity, outside of strings.
fn without_nan(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    let mut quoted = false;
    while let Some(character) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"].into_iter().find(|word| rest.starts_with(word));
        let length = match (quoted, word) {
            (false, Some(word)) => {
                plain.push_str("null");
                word.len()
            }
            (true, _) if character == '\\' => {
                let escaped = rest.chars().take(2).map(char::len_utf8).sum();
                plain.push_str(&rest[..escaped]);
                escaped
            }
            _ => {
                quoted ^= character == '"';
                plain.push(character);
                character.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, format: Format) -> Result<Table, Refusal> {
        let dir = tempfile::tempdir().expect("a directory");
        std::fs::write(dir.path().join("out"), text).expect("written");
        Table::read(dir.path(), "out", format)
    }

    fn column(text: &str, format: Format, name: &str) -> Result<Vec<f64>, Refusal> {
        read(text, format)?.column(name)
    }

    #[test]
    fn every_usual_way_to_write_a_table_is_read() {
        let cases = [
            ("t,x\n0,1\n1,2.5\n", Format::Csv),
            ("\u{feff}\"t\";\"x\"\r\n0;1\r\n1;2.5\r\n", Format::Csv),
            ("# a comment\n# t,x\n0,1\n\n# another\n1,2.5", Format::Csv),
            ("# t x\n0,1\n1,2.5", Format::Csv),
            ("t\tx\n0\t1\n1\t2.5\n", Format::Csv),
            ("# Time-averaged data\n# t x\n0 1\n1 2.5\n", Format::Whitespace),
            ("t   x\n 0 1\n 1.0D0  0.25d+01\n", Format::Whitespace),
            ("#t\tx\n0\t1\n1\t2.5\n", Format::Whitespace),
            ("{\"t\": [0, 1], \"x\": [1, 2.5], \"note\": \"text\"}", Format::Json),
            ("[{\"t\": 0, \"x\": 1}, {\"x\": 2.5, \"t\": 1}]", Format::Json),
        ];
        for (text, format) in cases {
            assert_eq!(column(text, format, "t").expect(text), [0.0, 1.0], "{text:?}");
            assert_eq!(column(text, format, "x").expect(text), [1.0, 2.5], "{text:?}");
        }
        assert_eq!(column("{\"x\": 3}", Format::Json, "x").expect("one number"), [3.0]);
    }

    #[test]
    fn numbers_that_are_none_are_told_from_text_that_is_no_number() {
        for (text, format) in [
            ("x\nnan\n", Format::Csv),
            ("# x\n-NaN\n", Format::Whitespace),
            ("{\"x\": [NaN], \"NaN \\\" Infinity\": 1}", Format::Json),
            ("{\"x\": null}", Format::Json),
        ] {
            assert!(column(text, format, "x").expect(text)[0].is_nan(), "{text:?}");
        }
        let text = column("t,x\n0,1\n1,broken\n", Format::Csv, "x").expect_err("text");
        assert!(text.detail.contains("row 3") && text.detail.contains("broken"), "{text:?}");
        // A text in a column that nobody asked for does not matter.
        assert_eq!(column("t,x\n0,a\n", Format::Csv, "t").expect("a number"), [0.0]);
    }

    #[test]
    fn each_kind_of_broken_table_has_its_own_cause() {
        let missing = Table::read(Path::new("/nonexistent"), "out", Format::Csv);
        let kind = missing.expect_err("missing").kind;
        assert_eq!(kind, FailureKind::MissingOutput { file: "out".into() });
        let malformed = FailureKind::MalformedOutput { file: "out".into() };
        for (text, format) in [
            ("", Format::Csv),
            ("# t x\n", Format::Whitespace),
            ("1,2\n", Format::Csv),
            ("t,x\n1,2\n1", Format::Csv),
            ("t t\n1 2\n", Format::Whitespace),
            ("{\"t\": [1, 2", Format::Json),
            ("[1, 2]", Format::Json),
            ("3", Format::Json),
            ("{\"t\": \"1\"}", Format::Json),
            ("[{\"t\": 1}, {}]", Format::Json),
        ] {
            assert_eq!(column(text, format, "t").expect_err(text).kind, malformed, "{text:?}");
        }
        let column = column("a,b\n1,2\n", Format::Csv, "t").expect_err("no such column");
        let expected = FailureKind::MissingColumn { file: "out".into(), column: "t".into() };
        assert_eq!((column.kind, &*column.detail), (expected, "it has a, b"));
        let folder = tempfile::tempdir().expect("a directory");
        std::fs::create_dir(folder.path().join("out")).expect("made");
        let error = Table::read(folder.path(), "out", Format::Csv).expect_err("a directory");
        assert_eq!(error.kind, malformed);
    }
}
