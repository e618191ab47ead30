//! The fields of a TOML or JSON file: each mistake with its line and field.

use std::cell::RefCell;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{InputError, Mistake, nearest};
use crate::input::json_document;

/// Expected type of a field of another type.
const TEXT: &str = "text in quotes";

/// Text as a TOML string.
pub(crate) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// A parsed file, and the way to say where in it something is wrong.
pub(crate) struct Document<'i> {
    name: &'i str,
    text: &'i str,
    root: Spanned<DeTable<'i>>,
}

impl<'i> Document<'i> {
    /// Parses TOML.
    pub(crate) fn parse(name: &'i str, text: &'i str) -> Result<Self, InputError> {
        let root = DeTable::parse(text).map_err(|error| {
            let input = InputError::new(name, Mistake::Syntax)
                .found(format_args!("not TOML: {}", error.message().replace('\n', ", ")))
                .help("a field is written: name = 1.5e-6 or name = \"text\"");
            match error.span() {
                Some(span) => input.at_line(line_of(text, span.start)),
                None => input,
            }
        })?;
        Ok(Self { name, text, root })
    }

    /// Parses JSON: an object, strictly.
    pub(crate) fn parse_json(name: &'i str, text: &'i str) -> Result<Self, InputError> {
        let root = json_document::parse(name, text)
            .map_err(|refused| refused.error.at_line(line_of(text, refused.offset)))?;
        Ok(Self { name, text, root })
    }

    /// Names of the fields at the top, in the file's order.
    pub(crate) fn keys(&self) -> Vec<&str> {
        let mut keys: Vec<_> = self.root.get_ref().keys().collect();
        keys.sort_by_key(|key| key.span().start);
        keys.into_iter().map(|key| key.get_ref().as_ref()).collect()
    }

    /// The fields at the top.
    pub(crate) fn top(&self) -> Fields<'_> {
        Fields {
            name: self.name,
            text: self.text,
            path: String::new(),
            line: None,
            table: self.root.get_ref(),
            known: RefCell::new(Vec::new()),
        }
    }
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&byte| byte == b'\n').count()
}

/// A value with its line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct At<T> {
    pub(crate) value: T,
    pub(crate) line: usize,
}

/// The fields of one table of a [`Document`].
///
/// Remembers what was asked for, so that [`finish`](Self::finish) can refuse the rest.
pub(crate) struct Fields<'d> {
    name: &'d str,
    text: &'d str,
    path: String,
    line: Option<usize>,
    table: &'d DeTable<'d>,
    known: RefCell<Vec<&'static str>>,
}

impl InputError {
    /// The error of a file that is not there, with the field that names it.
    pub(crate) fn named_in(self, fields: &Fields<'_>, field: &str, line: usize) -> Self {
        if self.mistake == Mistake::MissingFile {
            self.help(format_args!("{}, line {line}, names it in {field}", fields.name))
        } else {
            self
        }
    }
}

impl<'d> Fields<'d> {
    /// Name of a field with the tables it is in.
    pub(crate) fn path_of(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    /// An error in a field of this table.
    pub(crate) fn error(&self, key: &str, line: usize, mistake: Mistake) -> InputError {
        InputError::new(self.name, mistake).at_line(line).in_field(self.path_of(key))
    }

    /// An error of the table as a whole.
    pub(crate) fn table_error(&self, mistake: Mistake) -> InputError {
        let mut error = InputError::new(self.name, mistake);
        if !self.path.is_empty() {
            error = error.in_field(&self.path);
        }
        error.line = self.line;
        error
    }

    /// The error for a field that is not there.
    pub(crate) fn missing(&self, key: &str) -> InputError {
        let mut error =
            InputError::new(self.name, Mistake::MissingField).in_field(self.path_of(key));
        error.line = self.line;
        error.found("missing")
    }

    fn get(&self, key: &'static str) -> Option<At<&'d DeValue<'d>>> {
        self.known.borrow_mut().push(key);
        let value = self.table.get(key)?;
        Some(At { value: value.get_ref(), line: line_of(self.text, value.span().start) })
    }

    fn wrong_type(&self, key: &str, at: At<&DeValue<'_>>, expected: &str) -> InputError {
        let seen = match at.value {
            DeValue::String(text) => format!("\"{text}\""),
            DeValue::Boolean(value) => value.to_string(),
            other => format!("a {}", other.type_str()),
        };
        self.error(key, at.line, Mistake::WrongType).found(seen).expected(expected)
    }

    fn as_number(&self, key: &str, at: At<&DeValue<'_>>) -> Result<At<f64>, InputError> {
        let text = match at.value {
            DeValue::Float(float) => float.as_str(),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
            _ => {
                let error = self.wrong_type(key, at, "a number");
                return Err(match at.value {
                    DeValue::String(_) => error.help("write it without quotes and without a unit"),
                    _ => error,
                });
            }
        };
        let value: f64 =
            text.replace('_', "").parse().map_err(|_| self.wrong_type(key, at, "a number"))?;
        if value.is_finite() {
            Ok(At { value, line: at.line })
        } else {
            Err(self
                .error(key, at.line, Mistake::NotFinite)
                .found(text)
                .expected("a finite number"))
        }
    }

    /// A finite number, if it is there.
    pub(crate) fn number(&self, key: &'static str) -> Result<Option<At<f64>>, InputError> {
        self.get(key).map(|at| self.as_number(key, at)).transpose()
    }

    /// A number above zero, if it is there.
    pub(crate) fn positive(
        &self,
        key: &'static str,
        unit: &str,
    ) -> Result<Option<At<f64>>, InputError> {
        match self.number(key)? {
            Some(At { value, line }) if value <= 0.0 => {
                let mistake = if value < 0.0 { Mistake::Negative } else { Mistake::OutOfRange };
                Err(self
                    .error(key, line, mistake)
                    .found(value)
                    .expected(format_args!("a number > 0 [{unit}]")))
            }
            number => Ok(number),
        }
    }

    /// Two numbers in brackets, if they are there.
    pub(crate) fn pair(&self, key: &'static str) -> Result<Option<At<[f64; 2]>>, InputError> {
        let Some(at) = self.get(key) else { return Ok(None) };
        let expected = "two numbers, as in [0.0, 1.5]";
        let Some(array) = at.value.as_array() else {
            return Err(self.wrong_type(key, at, expected));
        };
        let mut numbers = Vec::new();
        for item in array.iter().take(3) {
            let item = At { value: item.get_ref(), line: at.line };
            numbers.push(self.as_number(key, item)?.value);
        }
        match numbers[..] {
            [low, high] => Ok(Some(At { value: [low, high], line: at.line })),
            _ => Err(self
                .error(key, at.line, Mistake::WrongType)
                .found(format_args!("{} values", array.len()))
                .expected(expected)),
        }
    }

    /// Text that is not blank, if it is there.
    pub(crate) fn text(&self, key: &'static str) -> Result<Option<At<&'d str>>, InputError> {
        let Some(at) = self.get(key) else { return Ok(None) };
        match at.value.as_str() {
            Some(text) if text.trim().is_empty() => Err(self
                .error(key, at.line, Mistake::Empty)
                .found("\"\"")
                .expected("some text")
                .help("leave the field out if there is nothing to say")),
            Some(text) => Ok(Some(At { value: text, line: at.line })),
            None => Err(self.wrong_type(key, at, TEXT)),
        }
    }

    /// A table in this one, if it is there.
    pub(crate) fn table(&self, key: &'static str) -> Result<Option<Fields<'d>>, InputError> {
        self.get(key).map(|at| self.as_table(key, at)).transpose()
    }

    fn as_table(&self, key: &str, at: At<&'d DeValue<'d>>) -> Result<Fields<'d>, InputError> {
        let path = self.path_of(key);
        let Some(table) = at.value.as_table() else {
            return Err(self.wrong_type(key, at, &format!("a table [{path}]")));
        };
        let (line, known) = (Some(at.line), RefCell::new(Vec::new()));
        Ok(Fields { name: self.name, text: self.text, path, line, table, known })
    }

    /// All fields but those in `taken`, read by serde.
    pub(crate) fn rest<T: serde::de::DeserializeOwned>(
        &self,
        taken: &[&str],
    ) -> Result<T, InputError> {
        let mut table = self.table.clone();
        for key in taken {
            table.remove(*key);
        }
        T::deserialize(toml::de::Deserializer::from(Spanned::new(0..0, table))).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let at = |span: std::ops::Range<usize>| span.contains(&start);
            let entry = self.table.iter().find(|(key, value)| at(key.span()) || at(value.span()));
            let message = error.message().replace('`', "");
            let (found, expected) = match message.split_once(", expected ") {
                Some((found, expected)) => (found.to_owned(), Some(expected.to_owned())),
                None => (message, None),
            };
            let unknown = found.starts_with("unknown field");
            let mistake = if unknown { Mistake::UnknownField } else { Mistake::WrongType };
            let mut input = match entry {
                Some((key, _)) => {
                    self.error(key.get_ref(), line_of(self.text, key.span().start), mistake)
                }
                None => {
                    let deeper = error.span().filter(|span| !span.is_empty());
                    let line = deeper.map(|span| line_of(self.text, span.start));
                    let error = self.table_error(mistake);
                    InputError { line: line.or(error.line), ..error }
                }
            };
            if let (true, Some((key, _)), Some(choices)) = (unknown, entry, &expected) {
                let choices = choices.trim_start_matches("one of ").split(", ");
                input = input.help_if(
                    nearest(key.get_ref(), choices)
                        .map(|near| format!("did you mean {}?", self.path_of(near))),
                );
            }
            input = input.found(found);
            match expected {
                Some(expected) if matches!(expected.as_str(), "u32" | "u64" | "usize") => {
                    input.expected("a whole number, not negative")
                }
                Some(expected) => input.expected(expected),
                None => input,
            }
        })
    }

    /// The line of a field that is there.
    pub(crate) fn line_of(&self, key: &str) -> Option<usize> {
        self.table
            .iter()
            .find(|(name, _)| name.get_ref().as_ref() == key)
            .map(|(name, _)| line_of(self.text, name.span().start))
    }

    /// Name of the file.
    pub(crate) fn file_name(&self) -> &str {
        self.name
    }

    /// The line that the table begins on.
    pub(crate) fn line(&self) -> Option<usize> {
        self.line
    }

    /// The fields with the names that the user chose, in the file's order, each at the line of its name.
    fn entries(&self) -> Vec<(&'d str, At<&'d DeValue<'d>>)> {
        let mut entries: Vec<_> = self.table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let entry = |(key, value): (&'d Spanned<_>, &'d Spanned<_>)| {
            let line = line_of(self.text, key.span().start);
            (AsRef::<str>::as_ref(key.get_ref()), At { value: value.get_ref(), line })
        };
        entries.into_iter().map(entry).collect()
    }

    /// Every field as a table of its own, with the name that the user chose, in the file's order.
    pub(crate) fn named_tables(&self) -> Result<Vec<(At<&'d str>, Fields<'d>)>, InputError> {
        let named = |(name, at): (&'d str, At<_>)| {
            Ok((At { value: name, line: at.line }, self.as_table(name, at)?))
        };
        self.entries().into_iter().map(named).collect()
    }

    /// Every field as text, under the name that the user chose, in the file's order.
    pub(crate) fn named_texts(&self) -> Result<Vec<(At<&'d str>, &'d str)>, InputError> {
        let named = |(name, at): (&'d str, At<&'d DeValue<'d>>)| {
            let text = at.value.as_str().ok_or_else(|| self.wrong_type(name, at, TEXT))?;
            Ok((At { value: name, line: at.line }, text))
        };
        self.entries().into_iter().map(named).collect()
    }

    /// A whole number from `least` to `most`, if it is there.
    pub(crate) fn whole(
        &self,
        key: &'static str,
        least: u64,
        most: u64,
    ) -> Result<Option<At<u64>>, InputError> {
        let Some(at) = self.number(key)? else { return Ok(None) };
        // Beyond 2^53 a double is no longer exact: read the digits themselves.
        let exact = self
            .table
            .get(key)
            .and_then(|value| value.get_ref().as_integer())
            .and_then(|integer| integer.as_str().replace('_', "").parse::<u64>().ok());
        let whole = exact.or_else(|| {
            let fits = at.value >= 0.0 && at.value <= 9e15 && at.value.fract() == 0.0;
            fits.then_some(at.value as u64)
        });
        match whole {
            Some(value) if (least..=most).contains(&value) => Ok(Some(At { value, line: at.line })),
            _ => Err(self.error(key, at.line, Mistake::OutOfRange).found(at.value).expected(
                if most == u64::MAX {
                    format!("a whole number, at least {least}")
                } else {
                    format!("a whole number from {least} to {most}")
                },
            )),
        }
    }

    /// A list of texts in brackets, if it is there.
    pub(crate) fn texts(&self, key: &'static str) -> Result<Option<At<Vec<&'d str>>>, InputError> {
        let Some(at) = self.get(key) else { return Ok(None) };
        let expected = "a list of texts, as in [\"sh\", \"simulate.sh\"]";
        let Some(array) = at.value.as_array() else {
            return Err(self.wrong_type(key, at, expected));
        };
        let text = |item: &'d Spanned<DeValue<'d>>| {
            let line = line_of(self.text, item.span().start);
            let at = At { value: item.get_ref(), line };
            at.value.as_str().ok_or_else(|| self.wrong_type(key, at, TEXT))
        };
        let texts = array.iter().map(text).collect::<Result<Vec<_>, _>>()?;
        Ok(Some(At { value: texts, line: at.line }))
    }

    /// One of a closed list of names, if it is there.
    pub(crate) fn choice<T: Copy>(
        &self,
        key: &'static str,
        choices: &[(&'static str, T)],
    ) -> Result<Option<At<T>>, InputError> {
        let Some(At { value, line }) = self.text(key)? else { return Ok(None) };
        match choices.iter().find(|(name, _)| *name == value) {
            Some((_, choice)) => Ok(Some(At { value: *choice, line })),
            None => {
                let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
                Err(self
                    .error(key, line, Mistake::UnknownName)
                    .found(format_args!("\"{value}\""))
                    .expected(format_args!("one of {}", names.join(", ")))
                    .help_if(
                        nearest(value, names.iter().copied())
                            .map(|near| format!("did you mean \"{near}\"?")),
                    ))
            }
        }
    }

    /// Refuses a field that was never asked for.
    pub(crate) fn finish(&self) -> Result<(), InputError> {
        let known = self.known.borrow();
        let unknown = self
            .table
            .iter()
            .filter(|(key, _)| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|(key, _)| key.span().start);
        let Some((key, _)) = unknown else { return Ok(()) };
        let name = key.get_ref().as_ref();
        let near = nearest(name, known.iter().copied());
        let mut choices = known.clone();
        choices.sort_unstable();
        choices.dedup();
        Err(self
            .error(name, line_of(self.text, key.span().start), Mistake::UnknownField)
            .found("unknown field")
            .help(match near {
                Some(near) => format!("did you mean {}?", self.path_of(near)),
                None => format!("known here: {}", choices.join(", ")),
            }))
    }
}
