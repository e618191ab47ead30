//! JSON read into the same tree as TOML, so that a plan may be written in either and every mistake has its line and
//! field.

use std::borrow::Cow;
use std::ops::Range;

use jsonc_parser::ast::{ObjectPropName, Value};
use jsonc_parser::common::Ranged as _;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use crate::error::{InputError, Mistake};

/// A mistake in JSON and its place in the text.
pub(crate) struct Refused {
    pub(crate) offset: usize,
    pub(crate) error: Box<InputError>,
}

/// Parses a JSON object, strictly: no comments, no trailing commas.
pub(crate) fn parse<'i>(name: &str, text: &'i str) -> Result<Spanned<DeTable<'i>>, Refused> {
    let strict = ParseOptions {
        allow_comments: false,
        allow_loose_object_property_names: false,
        allow_trailing_commas: false,
        allow_missing_commas: false,
        allow_single_quoted_strings: false,
        allow_hexadecimal_numbers: false,
        allow_unary_plus_numbers: false,
        allow_bare_decimal_point_numbers: false,
        allow_non_finite_numbers: false,
        allow_extended_string_escapes: false,
    };
    let syntax = |offset, found: String| Refused {
        offset,
        error: InputError::new(name, Mistake::Syntax)
            .found(format_args!("not JSON: {found}"))
            .into(),
    };
    let parsed = parse_to_ast(text, &CollectOptions::default(), &strict)
        .map_err(|error| syntax(error.range().start, error.kind().to_string()))?;
    let Some(value) = parsed.value else {
        return Err(syntax(0, "nothing in it".to_owned()));
    };
    let range = span(&value);
    match convert(name, value)? {
        (DeValue::Table(table), _) => Ok(Spanned::new(range, table)),
        (other, range) => Err(Refused {
            offset: range.start,
            error: InputError::new(name, Mistake::WrongType)
                .found(format_args!("a {}", other.type_str()))
                .expected("an object { ... }")
                .into(),
        }),
    }
}

fn span(value: &Value<'_>) -> Range<usize> {
    let range = value.range();
    range.start..range.end
}

fn convert<'i>(name: &str, value: Value<'i>) -> Result<(DeValue<'i>, Range<usize>), Refused> {
    let range = span(&value);
    let refuse = |offset, mistake, found: String| Refused {
        offset,
        error: InputError::new(name, mistake).found(found).into(),
    };
    let converted = match value {
        Value::StringLit(text) => DeValue::String(text.value),
        Value::BooleanLit(literal) => DeValue::Boolean(literal.value),
        Value::NumberLit(number) => DeValue::parse(number.value)
            .map_err(|_| {
                refuse(range.start, Mistake::WrongType, format!("the number {}", number.value))
            })?
            .into_inner(),
        Value::NullKeyword(_) => {
            let mut refused = refuse(range.start, Mistake::WrongType, "null".to_owned());
            *refused.error = refused.error.help("leave the field out if there is nothing to say");
            return Err(refused);
        }
        Value::Array(array) => {
            let mut items = DeArray::new();
            for element in array.elements {
                let (item, range) = convert(name, element)?;
                items.push(Spanned::new(range, item));
            }
            DeValue::Array(items)
        }
        Value::Object(object) => {
            let mut table = DeTable::new();
            for property in object.properties {
                let place = property.name.range();
                let key: Cow<'i, str> = match property.name {
                    ObjectPropName::String(text) => text.value,
                    ObjectPropName::Word(word) => Cow::Borrowed(word.value),
                };
                if table.contains_key(key.as_ref()) {
                    return Err(refuse(
                        place.start,
                        Mistake::Duplicate,
                        format!("the field \"{key}\" twice"),
                    ));
                }
                let (value, range) = convert(name, property.value)?;
                table.insert(Spanned::new(place.start..place.end, key), Spanned::new(range, value));
            }
            DeValue::Table(table)
        }
    };
    Ok((converted, range))
}
