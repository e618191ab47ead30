//! How numbers are written on axes and above panels.

/// A step of 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    digit: i32,
    exponent: i32,
}

impl Step {
    /// The least step that is not smaller than a size.
    pub(super) fn at_least(size: f64) -> Step {
        let size = size.max(1e-305);
        let exponent = size.log10().floor() as i32 - 1;
        let mut step = Step { digit: 1, exponent };
        // The tolerance keeps 0.2 from becoming 0.5 by rounding.
        while step.value() < size * (1.0 - 1e-9) {
            step = step.next();
        }
        step
    }

    fn value(self) -> f64 {
        times_ten_to(f64::from(self.digit), self.exponent)
    }

    pub(super) fn next(self) -> Step {
        match self.digit {
            1 => Step { digit: 2, ..self },
            2 => Step { digit: 5, ..self },
            _ => Step { digit: 1, exponent: self.exponent + 1 },
        }
    }
}

/// How the numbers of a linear axis are written: the offset taken off, the power of ten taken out, the decimals left.
pub(super) struct Numbers {
    step: Step,
    offset: f64,
    offset_text: String,
    power: i32,
    /// The unit, with an SI prefix if that stands for the power.
    unit: String,
    power_in_unit: bool,
    decimals: usize,
}

impl Numbers {
    /// Whole numbers, with nothing taken off or out.
    pub(super) fn plain(unit: &str) -> Numbers {
        Numbers {
            step: Step { digit: 1, exponent: 0 },
            offset: 0.0,
            offset_text: String::new(),
            power: 0,
            unit: unit.to_owned(),
            power_in_unit: false,
            decimals: 0,
        }
    }

    pub(super) fn new(low: f64, high: f64, step: Step, unit: &str) -> Numbers {
        let largest = low.abs().max(high.abs());
        let mut numbers = Numbers { step, ..Numbers::plain(unit) };
        if largest > step.value() * 1e5 {
            // Labels would be long and alike: take off what they share.
            let unit_step = 10_f64.powi((high - low).log10().ceil() as i32);
            numbers.offset = (low / unit_step).floor() * unit_step;
            numbers.offset_text = offset_text(numbers.offset, unit_step.log10().round() as i32);
        }
        let reach = (low - numbers.offset).abs().max((high - numbers.offset).abs());
        let exponent = (reach.max(1e-305).log10() + 1e-9).floor() as i32;
        if !(-2..=4).contains(&exponent) || (exponent < 0 && unit == "s") {
            let engineering = exponent.div_euclid(3) * 3;
            match prefix(unit, engineering).filter(|_| numbers.offset == 0.0) {
                Some(prefix) => {
                    numbers.unit = format!("{prefix}{unit}");
                    numbers.power = engineering;
                    numbers.power_in_unit = true;
                }
                None => numbers.power = exponent,
            }
        }
        numbers.decimals = (numbers.power - step.exponent).max(0) as usize;
        numbers
    }

    /// Multiples of the step within a range, at most 100, with their labels.
    pub(super) fn labels(&self, low: f64, high: f64) -> Vec<(f64, String)> {
        let step = self.step.value();
        // A tick at the very end stays although its place is rounded.
        let slack = |steps: f64| 1e-9 + 4.0 * f64::EPSILON * steps.abs();
        let (first, last) = (low / step, high / step);
        let (first, last) = ((first - slack(first)).ceil(), (last + slack(last)).floor());
        let count = ((last - first).max(-1.0) as usize + 1).min(100);
        let place = |i: usize| {
            let value = (first + i as f64) * step;
            // In units of the step the difference is a whole number, free of rounding.
            let steps = (first + i as f64) - (self.offset / step).round();
            let digits = steps * f64::from(self.step.digit);
            let shown = times_ten_to(digits, self.step.exponent - self.power);
            (value.clamp(low, high), signed(&format!("{shown:.*}", self.decimals)))
        };
        (0..count).map(place).collect()
    }

    /// A value with no more decimals than it needs.
    pub(super) fn shortest(&self, value: f64) -> String {
        signed(trimmed(&format!("{:.12}", value / 10_f64.powi(self.power))))
    }

    /// The unit with its SI prefix, and the power of ten that this stands for.
    pub(super) fn prefixed_unit(&self) -> (String, i32) {
        (self.unit.clone(), if self.power_in_unit { self.power } else { 0 })
    }

    /// The offset to write behind the name of the axis, and the unit with the power, in brackets.
    pub(super) fn taken_out(&self) -> (String, String) {
        let mut unit = String::new();
        if self.power != 0 && !self.power_in_unit {
            unit = power_of_ten(i64::from(self.power));
        }
        if !self.unit.is_empty() {
            if !unit.is_empty() {
                unit.push(' ');
            }
            unit.push_str(&self.unit);
        }
        let offset = match self.offset_text.strip_prefix('−') {
            _ if self.offset_text.is_empty() => String::new(),
            Some(size) => format!(" + {size}"),
            None => format!(" − {}", self.offset_text),
        };
        (offset, if unit.is_empty() { unit } else { format!(" ({unit})") })
    }
}

/// Digits times a power of ten, rounded once.
fn times_ten_to(digits: f64, exponent: i32) -> f64 {
    if exponent < 0 { digits / 10_f64.powi(-exponent) } else { digits * 10_f64.powi(exponent) }
}

/// SI prefix for a power of a thousand, where the unit is one that takes it.
fn prefix(unit: &str, power: i32) -> Option<&'static str> {
    let prefixes: &[(i32, &str)] = match unit {
        "s" => &[(-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m")],
        "m" => &[(-12, "p"), (-9, "n"), (-6, "µ"), (-3, "m"), (3, "k")],
        "Pa" | "N" | "N/m" | "J" | "W" | "Hz" => {
            &[(-9, "n"), (-6, "µ"), (-3, "m"), (3, "k"), (6, "M"), (9, "G")]
        }
        _ => &[],
    };
    prefixes.iter().find(|(p, _)| *p == power).map(|(_, prefix)| *prefix)
}

pub(super) fn power_of_ten(k: i64) -> String {
    format!("10^{{{}}}", signed(&k.to_string()))
}

/// With a true minus sign, and without one for zero.
fn signed(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text.to_owned(),
    }
}

/// Without zeros at the end of the decimals.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// A shared offset with as many digits as it has, in powers of ten where it is large or small.
fn offset_text(offset: f64, last_digit: i32) -> String {
    if offset == 0.0 {
        return String::new();
    }
    let exponent = offset.abs().log10().floor() as i32;
    if (-3..7).contains(&exponent) && last_digit > -12 {
        return signed(trimmed(&format!("{:.*}", (-last_digit).max(0) as usize, offset)));
    }
    let decimals = (exponent - last_digit).clamp(0, 16) as usize;
    let mantissa = format!("{:.*}", decimals, offset / 10_f64.powi(exponent));
    format!("{}×{}", signed(trimmed(&mantissa)), power_of_ten(i64::from(exponent)))
}

/// The value of a coordinate (log10 of the value where `log10`) to so many digits, or to one less and a power of ten
/// where it is large or small.
pub(crate) fn written(coordinate: f64, log10: bool, digits: usize) -> String {
    let (mut mantissa, mut exponent) = if log10 {
        (10_f64.powf(coordinate - coordinate.floor()), coordinate.floor())
    } else {
        let exponent = coordinate.abs().max(1e-300).log10().floor();
        (coordinate / 10_f64.powf(exponent), exponent)
    };
    // What rounds up to ten is one of the next power.
    let scale = 10_f64.powi(digits as i32 - 1);
    if (mantissa * scale).round().abs() >= 10.0 * scale {
        mantissa /= 10.0;
        exponent += 1.0;
    }
    if mantissa == 0.0 {
        return "0".to_owned();
    }
    let text = if (-2.0..3.0).contains(&exponent) {
        let decimals = (digits as f64 - 1.0 - exponent) as usize;
        format!("{:.*}", decimals, mantissa * 10_f64.powf(exponent))
    } else {
        format!("{mantissa:.*}×10^{{{exponent}}}", digits.saturating_sub(2))
    };
    text.replace('-', "−")
}
