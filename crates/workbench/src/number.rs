//! Numbers and their units as a person reads them.

/// The unit to print after a number; empty for pure numbers.
pub fn shown_unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// `digits` significant digits: plain from 0.001 up to 10 000, else with a power of ten (`2.14e-4`).
pub fn significant(value: f64, digits: usize) -> String {
    let digits = digits.max(1);
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    // The exponent after rounding: 9.996 at three digits is 10.0, not 9.100.
    let scientific = format!("{value:.*e}", digits - 1);
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok())
        .unwrap_or_default();
    if (-3..4).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        scientific
    }
}

/// Significant digits that tell the ends of an interval apart, at least three and at most twelve: `999.95` and `1000.01`,
/// not `1000` and `1000`. Ends that are the same have three.
pub fn digits_of([lower, upper]: [f64; 2]) -> usize {
    if lower == upper {
        return 3;
    }
    let largest = lower.abs().max(upper.abs());
    // An infinite or undefined difference is clamped, or counts as 0.
    let apart = largest.log10().floor() - (upper - lower).abs().log10().floor() + 1.0;
    (apart as i64).clamp(3, 12) as usize
}

/// A number with as many decimals as show the first two digits of its standard error (`86.3368` with an error of
/// 0.0012), and at least `least`.
pub fn with_error(value: f64, error: f64, least: usize) -> String {
    let decimals = if error > 0.0 && error.is_finite() {
        (1.0 - error.log10().floor()).clamp(0.0, 9.0) as usize
    } else {
        least
    };
    format!("{value:.*}", decimals.max(least))
}

/// A probability: three digits, and near 0 and 1 no more than is worth reading (`< 0.001`).
pub fn probability(value: f64) -> String {
    match value {
        v if v < 1e-3 => "< 0.001".to_owned(),
        v if v > 0.999 => "> 0.999".to_owned(),
        v => format!("{v:.3}"),
    }
}

/// A percentile in words: `1st percentile`, `22nd percentile`, `below the 1st percentile`.
pub fn percentile(value: f64) -> String {
    if value < 0.5 {
        return "below the 1st percentile".to_owned();
    }
    if value >= 99.5 {
        return "above the 99th percentile".to_owned();
    }
    let whole = value.round() as u32;
    let suffix = match (whole % 10, whole % 100) {
        (_, 11..=13) => "th",
        (1, _) => "st",
        (2, _) => "nd",
        (3, _) => "rd",
        _ => "th",
    };
    format!("{whole}{suffix} percentile")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_a_person_writes_them() {
        assert_eq!(significant(0.070_912, 3), "0.0709");
        assert_eq!(significant(2.1447e-4, 3), "2.14e-4");
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(9_999.6, 3), "1.00e4");
        assert_eq!(significant(1234.0, 3), "1234");
        assert_eq!(significant(-3.809_52, 3), "-3.81");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(f64::INFINITY, 3), "inf");
    }

    #[test]
    fn the_ends_of_an_interval_are_told_apart() {
        assert_eq!(digits_of([0.0628, 0.0798]), 3);
        assert_eq!(digits_of([20.7, 27.6]), 3);
        assert_eq!(digits_of([999.95, 1000.01]), 6);
        assert_eq!(digits_of([-3.0, 5.0]), 3);
        assert_eq!(digits_of([1.0, 1.0]), 3);
        assert_eq!(significant(0.02, digits_of([0.02, 0.02])), "0.0200");
        assert_eq!(digits_of([1.0, 1.0 + 1e-15]), 12);
        assert_eq!(digits_of([0.0, 0.0]), 3);
    }

    #[test]
    fn percentiles_are_ordinals() {
        let read = [1.2, 2.0, 13.4, 22.0, 97.8].map(percentile);
        let expected = ["1st", "2nd", "13th", "22nd", "98th"];
        assert_eq!(read, expected.map(|ordinal| format!("{ordinal} percentile")));
        assert_eq!(percentile(0.04), "below the 1st percentile");
        assert_eq!(percentile(99.97), "above the 99th percentile");
    }

    #[test]
    fn errors_decide_the_decimals() {
        assert_eq!(with_error(86.336_84, 0.0012, 2), "86.3368");
        assert_eq!(with_error(86.336_84, 0.0, 2), "86.34");
        assert_eq!(with_error(86.336_84, 30.0, 1), "86.3");
    }
}
