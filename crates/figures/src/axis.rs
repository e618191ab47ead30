//! Axes: the range of the data, ticks at round values, and labels a person reads.

use super::text;

/// Size of tick labels in points.
pub(super) const TICK_SIZE: f32 = 7.0;
/// Least free space between neighbouring tick labels, in points.
const GAP: f32 = 4.0;
/// Values beyond this are not drawn: their range would overflow.
const LARGEST: f64 = 1e300;
/// Sizes below this are as good as zero.
const SMALLEST: f64 = 1e-290;
/// The relative width of a range is at least this, so that ticks differ in double precision.
const LEAST_SPAN: f64 = 1e-12;

/// How values become positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    /// Positions are log10 of the values; values <= 0 are not drawn.
    Log,
    /// Values are log10 of the quantity that the labels name.
    Exponent,
    /// Linear, with ticks at whole numbers only.
    Count,
}

/// One axis: quantity, scale and range in coordinates (log10 of the value where `Log`).
#[derive(Debug, Clone)]
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) scale: Scale,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// Ticks as (coordinate, label), short ticks without label, and the title with unit, prefix or power.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Ticks {
    pub(super) labelled: Vec<(f64, String)>,
    pub(super) minor: Vec<f64>,
    /// Name of the quantity, with what was taken off the labels.
    pub(super) name: String,
    /// Unit, prefix and power in brackets, or nothing.
    pub(super) unit: String,
}

/// Which way an axis runs decides what the labels collide with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Direction {
    /// Labels side by side; they may reach this far beyond the ends.
    Across { overhang: f32 },
    /// Labels above each other.
    Up,
}

impl Axis {
    /// An axis that holds all values, with a margin as a share of the range.
    pub(super) fn holding(
        name: &str,
        unit: &str,
        scale: Scale,
        values: impl IntoIterator<Item = f64>,
        margin: f64,
    ) -> Axis {
        let mut axis = Axis {
            name: name.to_owned(),
            unit: unit.to_owned(),
            scale,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        };
        for value in values {
            if let Some(c) = axis.coordinate(value) {
                axis.low = axis.low.min(c);
                axis.high = axis.high.max(c);
            }
        }
        if axis.low > axis.high {
            (axis.low, axis.high) = (0.0, 1.0);
        }
        let size = axis.low.abs().max(axis.high.abs());
        let span = axis.high - axis.low;
        let least = match scale {
            Scale::Linear => size * LEAST_SPAN,
            Scale::Log | Scale::Exponent => size.max(1.0) * LEAST_SPAN,
            Scale::Count => 1.0,
        };
        let pad = if span > least.max(SMALLEST) {
            span * margin
        } else {
            match scale {
                Scale::Linear if size > SMALLEST => size * 0.05,
                Scale::Linear => 0.5,
                Scale::Log | Scale::Exponent => (size * 1e-3).max(0.3),
                Scale::Count => (size * 1e-3).max(0.6),
            }
        };
        axis.low -= pad;
        axis.high += pad;
        axis
    }

    /// The same axis, starting at a value where that is below all others.
    pub(super) fn starting_at(mut self, value: f64) -> Axis {
        if let Some(c) = self.coordinate(value).filter(|&c| c < self.high) {
            self.low = c;
        }
        self
    }

    /// Position of a value along the axis in coordinates, if it has one.
    pub(super) fn coordinate(&self, value: f64) -> Option<f64> {
        match self.scale {
            Scale::Linear | Scale::Exponent | Scale::Count => {
                Some(value).filter(|v| v.abs() <= LARGEST)
            }
            Scale::Log => (value > 0.0 && value.is_finite()).then(|| value.log10()),
        }
    }

    /// As [`Axis::coordinate`], but what lies far outside the range is moved nearer, to where rounding does no harm.
    pub(super) fn near(&self, value: f64) -> Option<f64> {
        let far = 1e9 * (self.high - self.low);
        self.coordinate(value).map(|c| c.clamp(self.low - far, self.high + far))
    }

    /// Whether a coordinate lies on the axis, but for rounding.
    pub(super) fn holds(&self, coordinate: f64) -> bool {
        let slack = 1e-3 * (self.high - self.low);
        (self.low - slack..=self.high + slack).contains(&coordinate)
    }

    /// The nearest coordinate on the axis.
    pub(super) fn within(&self, coordinate: f64) -> f64 {
        coordinate.clamp(self.low, self.high)
    }

    /// The densest round ticks whose labels do not touch on an axis of the given length in points.
    pub(super) fn ticks(&self, length: f32, direction: Direction) -> Ticks {
        let most = match direction {
            Direction::Across { .. } => (length / 26.0).clamp(2.0, 8.0),
            Direction::Up => (length / 15.0).clamp(2.0, 7.0),
        } as usize;
        match self.scale {
            Scale::Linear => self.linear(length, direction, most, 0.0),
            Scale::Count => self.linear(length, direction, most, 1.0),
            Scale::Log | Scale::Exponent => self.logarithmic(length, direction, most),
        }
    }

    fn linear(&self, length: f32, direction: Direction, most: usize, least_step: f64) -> Ticks {
        let range = self.high - self.low;
        let mut step = Step::at_least((range / (most as f64 * 3.0)).max(least_step));
        // Best: not crowded and at least two labels; then two labels; then any.
        let mut candidates: Vec<(u8, Ticks)> = Vec::new();
        for _ in 0..10 {
            let numbers = Numbers::new(self.low, self.high, step, &self.unit);
            let mut labelled = numbers.labels(self.low, self.high);
            self.drop_overhanging(&mut labelled, length, direction);
            let (crowded, count) = (labelled.len() > most + 1, labelled.len());
            if count == 0 || self.apart(&labelled, length, direction) {
                let rank = match count {
                    0 => 3,
                    1 => 2,
                    _ => u8::from(crowded),
                };
                candidates.push((rank, numbers.ticks(&self.name, labelled)));
                if rank == 0 {
                    break;
                }
            }
            step = step.next();
        }
        let best = candidates.into_iter().min_by_key(|(rank, _)| *rank).map(|(_, ticks)| ticks);
        best.unwrap_or_else(|| {
            Numbers::new(self.low, self.high, step, &self.unit).ticks(&self.name, Vec::new())
        })
    }

    fn logarithmic(&self, length: f32, direction: Direction, most: usize) -> Ticks {
        if self.low.abs().max(self.high.abs()) > 1000.0 {
            return self.of_logarithm().ticks(length, direction);
        }
        let (first, last) = ((self.low - 1e-9).ceil() as i64, (self.high + 1e-9).floor() as i64);
        if last > first
            && let Some(ticks) = self.decades(first, last, length, direction)
        {
            return ticks;
        }
        // Less than a decade or two: round values within it.
        let (low, high) = (10_f64.powf(self.low), 10_f64.powf(self.high));
        if low < 1e-290 || high > 1e290 {
            return self.of_logarithm().ticks(length, direction);
        }
        let numbers = Numbers::new(low, high, Step::at_least(low), &self.unit);
        let mut best: Option<Ticks> = None;
        if high / low > 3.0 {
            for mantissas in [&[1, 2, 3, 5][..], &[1, 2, 5][..], &[1, 3][..], &[2, 5][..], &[1][..]]
            {
                let mut labelled: Vec<(f64, String)> = Vec::new();
                for k in first - 1..=last {
                    for &m in mantissas {
                        let value = f64::from(m) * 10_f64.powi(k as i32);
                        let c = value.log10();
                        if (self.low..=self.high).contains(&c) {
                            labelled.push((c, numbers.label_shortest(value)));
                        }
                    }
                }
                self.drop_overhanging(&mut labelled, length, direction);
                if labelled.len() >= 2 && self.apart(&labelled, length, direction) {
                    best = Some(numbers.ticks(&self.name, labelled));
                    break;
                }
            }
        }
        let mut ticks = best.unwrap_or_else(|| {
            let linear = Axis { scale: Scale::Linear, low, high, ..self.clone() };
            let mut most = most;
            loop {
                let mut ticks = linear.linear(length, direction, most, 0.0);
                for (c, _) in &mut ticks.labelled {
                    *c = c.log10();
                }
                if most <= 1 || self.apart(&ticks.labelled, length, direction) {
                    while !self.apart(&ticks.labelled, length, direction) {
                        ticks.labelled.pop();
                    }
                    self.drop_overhanging(&mut ticks.labelled, length, direction);
                    return ticks;
                }
                most -= 1;
            }
        });
        if high / low > 2.0 {
            ticks.minor = self.within_decades(first, last);
        }
        ticks
    }

    /// The axis of the logarithm itself, for what no power of ten in double precision reaches.
    fn of_logarithm(&self) -> Axis {
        let name = format!("log_{{10}} {}", self.name);
        Axis { scale: Scale::Linear, name, unit: String::new(), ..self.clone() }
    }

    /// Powers of ten at a stride that leaves room, two of them if any stride gives two.
    fn decades(&self, first: i64, last: i64, length: f32, direction: Direction) -> Option<Ticks> {
        let room = match direction {
            Direction::Across { .. } => length / 24.0,
            Direction::Up => length / 12.0,
        };
        let strides = [1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100, 200, 300];
        for least in [2, 1] {
            for (stride, phase) in strides.iter().flat_map(|&s| (0..s.min(10)).map(move |p| (s, p)))
            {
                let on = |k: &i64| k.rem_euclid(stride) == phase;
                let mut labelled: Vec<_> =
                    (first..=last).filter(on).map(|k| (k as f64, power_of_ten(k))).collect();
                self.drop_overhanging(&mut labelled, length, direction);
                let crowded = labelled.len() as f32 > room + 1.0;
                if labelled.len() < least || crowded || !self.apart(&labelled, length, direction) {
                    continue;
                }
                let mut ticks = Numbers::plain(&self.unit).ticks(&self.name, labelled);
                if stride == 1 && last - first <= 8 {
                    ticks.minor = self.within_decades(first, last);
                } else if last - first <= 40 {
                    ticks.minor = (first..=last).filter(|k| !on(k)).map(|k| k as f64).collect();
                }
                return Some(ticks);
            }
        }
        None
    }

    /// Coordinates of the whole multiples of the powers of ten.
    fn within_decades(&self, first: i64, last: i64) -> Vec<f64> {
        (first - 1..=last)
            .flat_map(|k| (1..=9).map(move |m| k as f64 + f64::from(m).log10()))
            .filter(|c| (self.low..=self.high).contains(c))
            .collect()
    }

    /// Labels that would stand out over the ends are left out.
    fn drop_overhanging(
        &self,
        labelled: &mut Vec<(f64, String)>,
        length: f32,
        direction: Direction,
    ) {
        if let Direction::Across { overhang } = direction {
            labelled.retain(|(c, label)| {
                let at = self.along(*c, length);
                let half = text::length(label, TICK_SIZE) / 2.0;
                at - half >= -overhang && at + half <= length + overhang
            });
        }
    }

    fn along(&self, coordinate: f64, length: f32) -> f32 {
        ((coordinate - self.low) / (self.high - self.low)) as f32 * length
    }

    fn apart(&self, labelled: &[(f64, String)], length: f32, direction: Direction) -> bool {
        labelled.windows(2).all(|pair| {
            let distance = self.along(pair[1].0, length) - self.along(pair[0].0, length);
            let room = match direction {
                Direction::Across { .. } => {
                    (text::length(&pair[0].1, TICK_SIZE) + text::length(&pair[1].1, TICK_SIZE))
                        / 2.0
                        + GAP
                }
                Direction::Up => TICK_SIZE * 1.25,
            };
            distance >= room
        })
    }
}

/// A step of 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    digit: i32,
    exponent: i32,
}

impl Step {
    fn at_least(size: f64) -> Step {
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
        if self.exponent < 0 {
            f64::from(self.digit) / 10_f64.powi(-self.exponent)
        } else {
            f64::from(self.digit) * 10_f64.powi(self.exponent)
        }
    }

    fn next(self) -> Step {
        match self.digit {
            1 => Step { digit: 2, ..self },
            2 => Step { digit: 5, ..self },
            _ => Step { digit: 1, exponent: self.exponent + 1 },
        }
    }
}

/// How the numbers of a linear axis are written: what is taken off, which power is taken out, how many decimals stay.
struct Numbers {
    step: Step,
    offset: f64,
    offset_text: String,
    power: i32,
    power_in_unit: bool,
    decimals: usize,
    unit: String,
}

impl Numbers {
    fn plain(unit: &str) -> Numbers {
        Numbers {
            step: Step { digit: 1, exponent: 0 },
            offset: 0.0,
            offset_text: String::new(),
            power: 0,
            power_in_unit: false,
            decimals: 0,
            unit: unit.to_owned(),
        }
    }

    fn new(low: f64, high: f64, step: Step, unit: &str) -> Numbers {
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

    fn labels(&self, low: f64, high: f64) -> Vec<(f64, String)> {
        let step = self.step.value();
        // A tick at the very end stays although its place is rounded.
        let slack = |steps: f64| 1e-9 + 4.0 * f64::EPSILON * steps.abs();
        let (first, last) = (low / step, high / step);
        let (first, last) = ((first - slack(first)).ceil(), (last + slack(last)).floor());
        let count = ((last - first).max(-1.0) as usize + 1).min(100);
        (0..count)
            .map(|i| {
                let value = (first + i as f64) * step;
                // In units of the step the difference is a whole number, free of rounding.
                let steps = (first + i as f64) - (self.offset / step).round();
                (
                    value.clamp(low, high),
                    self.written(steps * f64::from(self.step.digit), self.step.exponent),
                )
            })
            .collect()
    }

    /// `digits` times ten to the `exponent`, over the power that was taken out.
    fn written(&self, digits: f64, exponent: i32) -> String {
        let shifted = exponent - self.power;
        let value = if shifted < 0 {
            digits / 10_f64.powi(-shifted)
        } else {
            digits * 10_f64.powi(shifted)
        };
        signed(&format!("{value:.*}", self.decimals))
    }

    /// A value with no more decimals than it needs.
    fn label_shortest(&self, value: f64) -> String {
        let text = format!("{:.12}", value / 10_f64.powi(self.power));
        signed(text.trim_end_matches('0').trim_end_matches('.'))
    }

    /// Ticks titled with name and unit and whatever was taken out of the labels.
    fn ticks(&self, name: &str, labelled: Vec<(f64, String)>) -> Ticks {
        let mut inner = String::new();
        if self.power != 0 && !self.power_in_unit {
            inner = power_of_ten(i64::from(self.power));
        }
        if !self.unit.is_empty() {
            if !inner.is_empty() {
                inner.push(' ');
            }
            inner.push_str(&self.unit);
        }
        let offset = match self.offset_text.strip_prefix('−') {
            _ if self.offset_text.is_empty() => String::new(),
            Some(size) => format!(" + {size}"),
            None => format!(" − {}", self.offset_text),
        };
        let unit = if inner.is_empty() { inner } else { format!(" ({inner})") };
        Ticks { labelled, minor: Vec::new(), name: format!("{name}{offset}"), unit }
    }
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

fn power_of_ten(k: i64) -> String {
    format!("10^{{{}}}", signed(&k.to_string()))
}

/// A true minus sign, and none for zero.
fn signed(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| matches!(c, '0' | '.')) => digits.to_owned(),
        Some(digits) => format!("−{digits}"),
        None => text.to_owned(),
    }
}

/// A shared offset with as many digits as it has, in powers where it is large or small.
fn offset_text(offset: f64, last_digit: i32) -> String {
    if offset == 0.0 {
        return String::new();
    }
    let exponent = offset.abs().log10().floor() as i32;
    if (-3..7).contains(&exponent) && last_digit > -12 {
        let text = format!("{:.*}", (-last_digit).max(0) as usize, offset);
        let text = if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.')
        } else {
            &text
        };
        return signed(text);
    }
    let mantissa = format!(
        "{:.*}",
        (exponent - last_digit).clamp(0, 16) as usize,
        offset / 10_f64.powi(exponent)
    );
    let mantissa = if mantissa.contains('.') {
        mantissa.trim_end_matches('0').trim_end_matches('.')
    } else {
        &mantissa
    };
    format!("{}×{}", signed(mantissa), power_of_ten(i64::from(exponent)))
}
