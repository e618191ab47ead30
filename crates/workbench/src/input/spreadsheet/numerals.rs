//! Numbers as spreadsheets write them: decimal points or commas, and thousands in groups.

use campaign::table::number;

use crate::input::columns::DecimalMark;

/// White space that separates thousands: blank, no-break blank, figure space, thin space, narrow no-break space.
const BLANKS: [char; 5] = [' ', '\u{a0}', '\u{2007}', '\u{2009}', '\u{202f}'];

/// The number in a cell, if its decimals come after this mark. Thousands may be in groups of three, separated by blanks,
/// apostrophes, or the mark that is not the decimal one; a minus sign may be U+2212. NaN and infinities are numbers here.
pub(super) fn read(cell: &str, decimal: DecimalMark) -> Option<f64> {
    let cell = cell.trim();
    let has = |c: char| cell.contains(c);
    if decimal == DecimalMark::Point
        && !has(',')
        && !has('\'')
        && !cell.contains(|c: char| !c.is_ascii() || c == ' ')
    {
        return number(cell);
    }
    let plain = cell.replace('\u{2212}', "-");
    let unsigned = plain.trim_start_matches(['+', '-']);
    let sign = &plain[..plain.len() - unsigned.len()];
    let end = unsigned.find(['e', 'E', 'd', 'D']).unwrap_or(unsigned.len());
    let (mantissa, exponent) = unsigned.split_at(end);
    let (mark, group) = match decimal {
        DecimalMark::Point => ('.', ','),
        DecimalMark::Comma => (',', '.'),
    };
    let (whole, decimals) = match mantissa.split_once(mark) {
        Some((whole, decimals)) => (whole, Some(decimals)),
        None => (mantissa, None),
    };
    let whole = without_groups(whole, group)?;
    // Words (nan, inf) have no mark.
    if decimals.is_some_and(|decimals| !digits(decimals) || !digits(&whole)) || sign.len() > 1 {
        return None;
    }
    let point = if decimals.is_some() { "." } else { "" };
    number(&format!("{sign}{whole}{point}{}{exponent}", decimals.unwrap_or_default()))
}

/// Whether the thousands of a number are in groups.
pub(super) fn is_grouped(cell: &str, decimal: DecimalMark) -> bool {
    let mark = if decimal == DecimalMark::Point { ',' } else { '.' };
    cell.trim().contains(|c| c == mark || separates(c))
}

fn digits(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

fn separates(c: char) -> bool {
    matches!(c, '\'' | '\u{2019}') || BLANKS.contains(&c)
}

/// Digits without what separates thousands; none where the groups are not of three digits.
fn without_groups(whole: &str, mark: char) -> Option<String> {
    let Some(separator) = whole.chars().find(|c| *c == mark || separates(*c)) else {
        return Some(whole.to_owned());
    };
    let mut groups = whole.split(separator);
    let first = groups.next()?;
    let leads = (1..=3).contains(&first.len()) && digits(first) && !first.starts_with('0');
    let follow = groups.all(|group| group.len() == 3 && digits(group));
    (leads && follow).then(|| whole.replace(separator, ""))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_number_is_read_in_every_usual_way_and_in_no_other() {
        use DecimalMark::{Comma, Point};
        for (cell, point, comma) in [
            ("0.5", Some(0.5), None),
            ("0,5", None, Some(0.5)),
            ("1,234", Some(1234.0), Some(1.234)),
            ("1.234", Some(1.234), Some(1234.0)),
            ("0,410", None, Some(0.41)),
            ("1.234,5", None, Some(1234.5)),
            ("1,234.5", Some(1234.5), None),
            ("1 234", Some(1234.0), Some(1234.0)),
            ("1\u{a0}234,5", None, Some(1234.5)),
            ("12\u{202f}345\u{202f}678", Some(12_345_678.0), Some(12_345_678.0)),
            ("1'234.5", Some(1234.5), None),
            ("1\u{2019}234", Some(1234.0), Some(1234.0)),
            ("12 34", None, None),
            ("1 2345", None, None),
            ("1,23,456", None, None),
            ("1 234,567", None, Some(1234.567)),
            ("1,5E-03", None, Some(1.5e-3)),
            ("1.5e-3", Some(1.5e-3), None),
            ("\u{2212}2,5", None, Some(-2.5)),
            ("--2", None, None),
            ("", None, None),
            ("abc", None, None),
            ("0,5 s", None, None),
            (",5", None, Some(0.5)),
            ("5,", None, Some(5.0)),
        ] {
            assert_eq!(read(cell, Point), point, "{cell:?} with points");
            assert_eq!(read(cell, Comma), comma, "{cell:?} with commas");
        }
        assert!(read("nan", Comma).is_some_and(f64::is_nan));
    }

    proptest! {
        #[test]
        fn numbers_survive_both_marks_to_the_last_bit(value in proptest::num::f64::NORMAL) {
            for text in [format!("{value}"), format!("{value:e}")] {
                let with_comma = text.replace('.', ",");
                // Whole groups of three digits behind a mark are read as thousands too: only decimals are told here.
                prop_assert_eq!(read(&text, DecimalMark::Point), Some(value));
                prop_assert_eq!(read(&with_comma, DecimalMark::Comma), Some(value));
            }
        }

        #[test]
        fn thousands_in_groups_are_the_same_number(value in 0u32.., group in "[ '\u{a0}\u{2009}\u{202f}\u{2019}]") {
            let digits = value.to_string();
            let mut grouped = String::new();
            for (k, digit) in digits.chars().enumerate() {
                if k > 0 && (digits.len() - k).is_multiple_of(3) {
                    grouped.push_str(&group);
                }
                grouped.push(digit);
            }
            let expected = Some(f64::from(value));
            prop_assert_eq!(read(&grouped, DecimalMark::Point), expected);
            prop_assert_eq!(read(&grouped, DecimalMark::Comma), expected);
        }

        #[test]
        fn no_text_panics(text in ".{0,30}", near in "[0-9., '+\u{2212}\u{a0}eE-]{0,20}") {
            for text in [text, near] {
                for decimal in [DecimalMark::Point, DecimalMark::Comma] {
                    let _ = read(&text, decimal);
                }
            }
        }
    }
}
