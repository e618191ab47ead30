//! Tables in JSON.

use serde_json::Value;

use super::error::{TableError, short};

/// The parts of a table in JSON.
#[derive(Debug, Clone)]
pub(super) struct Json {
    pub(super) names: Vec<String>,
    /// The columns, which may have different lengths; each value is a number, or words on what it is.
    pub(super) columns: Vec<Vec<Result<f64, String>>>,
}

impl Json {
    /// Reads an object of arrays or numbers, or an array of objects.
    pub(super) fn read(text: &str) -> Result<Self, TableError> {
        json(text).map_err(|problem| TableError::Json { problem })
    }

    /// The numbers of a column.
    pub(super) fn column(&self, place: usize) -> Result<Vec<f64>, TableError> {
        let cells = self.columns.get(place).map_or(&[][..], Vec::as_slice).iter().enumerate();
        let numbers = cells.map(|(i, cell)| {
            cell.clone().map_err(|problem| TableError::Json {
                problem: format!("row {}, column {}: {problem}", i + 1, self.names[place]),
            })
        });
        numbers.collect()
    }
}

/// A value in JSON, with null for NaN and infinities: Python writes them, and JSON does not have them.
pub(crate) fn parse(text: &str) -> Result<Value, String> {
    serde_json::from_str(text)
        .or_else(|error| serde_json::from_str(&without_nan(text)).map_err(|_| error.to_string()))
}

fn json(text: &str) -> Result<Json, String> {
    match parse(text)? {
        Value::Object(object) => {
            let mut names = Vec::new();
            let mut columns = Vec::new();
            for (name, value) in object {
                let values = match value {
                    Value::Array(values) => values,
                    value => vec![value],
                };
                columns.push(values.iter().map(cell).collect());
                names.push(name);
            }
            Ok(Json { names, columns })
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
                    column.push(cell(value));
                }
            }
            Ok(Json { names, columns })
        }
        _ => Err("it is neither an object nor an array".into()),
    }
}

/// The number in a value.
fn cell(value: &Value) -> Result<f64, String> {
    match value {
        Value::Null => Ok(f64::NAN),
        Value::Number(number) => number.as_f64().ok_or_else(|| format!("{number} is too large")),
        other => Err(format!("{:?} is not a number", short(&other.to_string()))),
    }
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
