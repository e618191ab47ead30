//! What the columns of a table are: names, units, the measured quantity, the decimal mark.
//!
//! A table says most of it in its header ([`crate::input::spreadsheet`]); what it leaves open is said in the table
//! `[columns]` of an experiment file, or by options. All fields are optional:
//!
//! | field | option | meaning |
//! |---|---|---|
//! | `time` | `--time-column` | name of the column of times |
//! | `value` | `--value-column` | name of the column of necks |
//! | `sigma` | `--sigma-column` | name of the column of standard deviations, of the quantity and unit of the necks |
//! | `time_unit` | `--time-unit` | `s`, `ms`, `us`, `min` or `h` |
//! | `value_unit` | `--value-unit` | of a length `m`, `cm`, `mm`, `um` or `nm`; of a ratio `1` or `%` |
//! | `quantity` | `--quantity` | `contact-ratio` (a/R), `neck-radius` (a), `neck-diameter` (2a) or `contact-over-diameter` (a/(2R)) |
//! | `decimal` | `--decimal` | `point` or `comma` |
//!
//! Lengths are divided by the particle radius of the experiment: `measured_radius_m` where it is given, else R.

use std::fmt;

use crate::error::{InputError, Mistake};
use crate::input::toml_fields::{Fields, quoted};

/// What a unit measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A time.
    Time,
    /// A length.
    Length,
    /// A pure number.
    Ratio,
}

/// A unit of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// How it is written in files and messages.
    pub symbol: &'static str,
    /// What it measures.
    pub dimension: Dimension,
    /// Its size in SI.
    pub si: f64,
}

const fn unit(symbol: &'static str, dimension: Dimension, si: f64) -> Unit {
    Unit { symbol, dimension, si }
}

/// All units, each with other ways to write it; those of one letter are told apart by case.
const UNITS: [(Unit, &[&str]); 12] = [
    (
        unit("s", Dimension::Time, 1.0),
        &["sec", "secs", "second", "seconds", "sek", "sekunde", "sekunden"],
    ),
    (unit("ms", Dimension::Time, 1e-3), &["msec", "millisecond", "milliseconds"]),
    (unit("us", Dimension::Time, 1e-6), &["\u{b5}s", "\u{3bc}s", "microsecond", "microseconds"]),
    (unit("min", Dimension::Time, 60.0), &["mins", "minute", "minutes", "minuten"]),
    (
        unit("h", Dimension::Time, 3600.0),
        &["hr", "hrs", "hour", "hours", "std", "stunde", "stunden"],
    ),
    (unit("m", Dimension::Length, 1.0), &["metre", "metres", "meter", "meters"]),
    (unit("cm", Dimension::Length, 1e-2), &["centimetre", "centimeter"]),
    (
        unit("mm", Dimension::Length, 1e-3),
        &["millimetre", "millimeter", "millimetres", "millimeters"],
    ),
    (
        unit("um", Dimension::Length, 1e-6),
        &[
            "\u{b5}m",
            "\u{3bc}m",
            "micron",
            "microns",
            "micrometre",
            "micrometres",
            "micrometer",
            "micrometers",
            "mikrometer",
        ],
    ),
    (unit("nm", Dimension::Length, 1e-9), &["nanometre", "nanometer", "nanometres", "nanometers"]),
    (unit("1", Dimension::Ratio, 1.0), &["-", "\u{2013}", "\u{2014}"]),
    (unit("%", Dimension::Ratio, 0.01), &["percent", "prozent"]),
];

impl Unit {
    /// The unit of a pure number.
    pub const ONE: Self = unit("1", Dimension::Ratio, 1.0);

    /// A unit as people write it; a micro sign may be U+00B5, U+03BC or `u`.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let lower = text.to_lowercase();
        let is = |(unit, others): &&(Self, &[&str])| {
            unit.symbol == text
                || others.contains(&text)
                || (text.len() > 2 && (others.contains(&&*lower) || unit.symbol == lower))
        };
        UNITS.iter().find(is).map(|(unit, _)| *unit)
    }

    /// As [`parse`](Self::parse), for a unit of one of these dimensions.
    ///
    /// # Errors
    ///
    /// What was expected.
    pub fn parse_of(text: &str, dimensions: &[Dimension]) -> Result<Self, String> {
        let fits = |unit: &Self| dimensions.contains(&unit.dimension);
        Self::parse(text).filter(fits).ok_or_else(|| {
            let all = UNITS.iter().map(|(unit, _)| *unit).filter(fits);
            let symbols: Vec<&str> = all.map(|unit| unit.symbol).collect();
            format!("one of the units {}", symbols.join(", "))
        })
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.symbol == "1" { "pure number" } else { self.symbol })
    }
}

/// What was measured of a neck. The model has the contact ratio a/R: neck radius over particle radius.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// a/R, which is the neck's diameter over the particle's too.
    ContactRatio,
    /// The neck radius a.
    NeckRadius,
    /// The neck diameter 2a.
    NeckDiameter,
    /// Neck radius over particle diameter, a/(2R).
    ContactOverDiameter,
}

impl Quantity {
    /// All of them by the names that a user types.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("contact-ratio", Self::ContactRatio),
        ("neck-radius", Self::NeckRadius),
        ("neck-diameter", Self::NeckDiameter),
        ("contact-over-diameter", Self::ContactOverDiameter),
    ];

    /// The name that a user types.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize].0
    }

    /// What its unit measures.
    pub fn dimension(self) -> Dimension {
        match self {
            Self::NeckRadius | Self::NeckDiameter => Dimension::Length,
            Self::ContactRatio | Self::ContactOverDiameter => Dimension::Ratio,
        }
    }

    /// The contact ratio a/R of a value in SI, with the particle radius R \[m\].
    pub fn contact_ratio(self, value: f64, radius_m: f64) -> f64 {
        match self {
            Self::ContactRatio => value,
            Self::NeckRadius => value / radius_m,
            Self::NeckDiameter => value / (2.0 * radius_m),
            Self::ContactOverDiameter => 2.0 * value,
        }
    }
}

/// What stands before the decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DecimalMark {
    /// 0.5
    Point,
    /// 0,5
    Comma,
}

impl DecimalMark {
    /// Both by the names that a user types.
    pub const NAMES: [(&'static str, Self); 2] = [("point", Self::Point), ("comma", Self::Comma)];
}

/// What is said of the columns of a table beside its header.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    /// Name of the column of times.
    pub time: Option<String>,
    /// Name of the column of necks.
    pub value: Option<String>,
    /// Name of the column of standard deviations.
    pub sigma: Option<String>,
    /// Unit of the times.
    pub time_unit: Option<Unit>,
    /// Unit of the necks.
    pub value_unit: Option<Unit>,
    /// What was measured of the neck.
    pub quantity: Option<Quantity>,
    /// The decimal mark.
    pub decimal: Option<DecimalMark>,
}

impl Columns {
    /// The same, with what `others` say where this says nothing.
    pub fn or(self, others: &Self) -> Self {
        Self {
            time: self.time.or_else(|| others.time.clone()),
            value: self.value.or_else(|| others.value.clone()),
            sigma: self.sigma.or_else(|| others.sigma.clone()),
            time_unit: self.time_unit.or(others.time_unit),
            value_unit: self.value_unit.or(others.value_unit),
            quantity: self.quantity.or(others.quantity),
            decimal: self.decimal.or(others.decimal),
        }
    }

    /// The table `[columns]`, which [`Experiment::read`](crate::input::experiment::Experiment::read) reads to the same; empty
    /// where nothing is said.
    pub fn toml(&self) -> String {
        let choice = |unit: Option<Unit>| unit.map(|unit| unit.symbol.to_owned());
        let decimal = DecimalMark::NAMES.into_iter().find(|(_, mark)| Some(*mark) == self.decimal);
        let fields = [
            ("time", self.time.clone()),
            ("value", self.value.clone()),
            ("sigma", self.sigma.clone()),
            ("time_unit", choice(self.time_unit)),
            ("value_unit", choice(self.value_unit)),
            ("quantity", self.quantity.map(|quantity| quantity.name().to_owned())),
            ("decimal", decimal.map(|(name, _)| name.to_owned())),
        ];
        let said = fields.into_iter().filter_map(|(key, value)| Some((key, value?)));
        let lines: Vec<String> =
            said.map(|(key, value)| format!("{key} = {}\n", quoted(&value))).collect();
        if lines.is_empty() { String::new() } else { format!("[columns]\n{}", lines.concat()) }
    }

    /// Reads the table `[columns]`.
    pub(crate) fn of(fields: &Fields<'_>) -> Result<Self, InputError> {
        let text = |key| Ok::<_, InputError>(fields.text(key)?.map(|at| at.value.to_owned()));
        let unit = |key, dimensions: &[Dimension]| {
            let Some(at) = fields.text(key)? else { return Ok(None) };
            Unit::parse_of(at.value, dimensions).map(Some).map_err(|expected| {
                fields
                    .error(key, at.line, Mistake::UnknownName)
                    .found(format_args!("\"{}\"", at.value))
                    .expected(expected)
            })
        };
        let columns = Self {
            time: text("time")?,
            value: text("value")?,
            sigma: text("sigma")?,
            time_unit: unit("time_unit", &[Dimension::Time])?,
            value_unit: unit("value_unit", &[Dimension::Length, Dimension::Ratio])?,
            quantity: fields.choice("quantity", &Quantity::NAMES)?.map(|at| at.value),
            decimal: fields.choice("decimal", &DecimalMark::NAMES)?.map(|at| at.value),
        };
        fields.finish()?;
        Ok(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_people_write_them() {
        for (text, symbol, si) in [
            ("min", "min", 60.0),
            ("Minuten", "min", 60.0),
            ("s", "s", 1.0),
            ("\u{b5}m", "um", 1e-6),
            ("\u{3bc}m", "um", 1e-6),
            ("um", "um", 1e-6),
            ("Micron", "um", 1e-6),
            ("mm", "mm", 1e-3),
            ("-", "1", 1.0),
            ("%", "%", 0.01),
        ] {
            let unit = Unit::parse(text).expect(text);
            assert_eq!((unit.symbol, unit.si), (symbol, si), "{text}");
        }
        for text in ["", "\u{b0}C", "S", "M", "H", "bar", "\u{b5}m\u{b2}", "R"] {
            assert_eq!(Unit::parse(text), None, "{text}");
        }
    }

    #[test]
    fn every_quantity_gives_the_contact_ratio_of_the_same_neck() {
        // A neck of 15 um on particles of 20 um: a/R = 0.75.
        for (quantity, value) in [
            (Quantity::ContactRatio, 0.75),
            (Quantity::NeckRadius, 15e-6),
            (Quantity::NeckDiameter, 30e-6),
            (Quantity::ContactOverDiameter, 0.375),
        ] {
            assert!((quantity.contact_ratio(value, 20e-6) - 0.75).abs() < 1e-15, "{quantity:?}");
            assert_eq!(Quantity::NAMES[quantity as usize], (quantity.name(), quantity));
        }
    }
}
