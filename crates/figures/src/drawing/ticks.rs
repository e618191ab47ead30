//! Ticks of an axis: at round values, with labels that do not touch.

use super::axis::{Axis, Scale};
use super::numbers::{Numbers, Step, power_of_ten};
use super::text;

/// Size of tick labels in points.
pub(crate) const TICK_SIZE: f32 = 7.0;
/// Least free space between neighbouring tick labels, in points.
const GAP: f32 = 4.0;

/// Places of ticks as coordinates, with their labels, and the title of the axis.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Ticks {
    pub(crate) labelled: Vec<(f64, String)>,
    /// Short ticks without label.
    pub(crate) minor: Vec<f64>,
    /// Name of the quantity, with the offset that was taken off the labels.
    pub(crate) name: String,
    /// Unit with prefix or power of ten in brackets, or nothing.
    pub(crate) unit: String,
    /// The unit with its prefix alone, and the power of ten that the prefix stands for.
    pub(crate) prefixed: (String, i32),
}

/// Direction of an axis, which decides where labels collide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Direction {
    /// Labels side by side; they may reach this far beyond the ends.
    Across { overhang: f32 },
    /// Labels above each other.
    Up,
}

impl Axis {
    /// The densest round ticks whose labels do not touch on an axis of the given length in points.
    pub(crate) fn ticks(&self, length: f32, direction: Direction) -> Ticks {
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

    /// The unit in which the labels of a horizontal axis of a length are, and the power of ten that its prefix stands for.
    pub(crate) fn prefixed_unit(&self, length: f32) -> (String, i32) {
        self.ticks(length, Direction::Across { overhang: 0.0 }).prefixed
    }

    fn linear(&self, length: f32, direction: Direction, most: usize, least_step: f64) -> Ticks {
        let range = self.high - self.low;
        let mut step = Step::at_least((range / (most as f64 * 3.0)).max(least_step));
        // Best: not crowded and at least two labels; then two labels; then any.
        let mut best: Option<(u8, Ticks)> = None;
        for _ in 0..10 {
            let numbers = Numbers::new(self.low, self.high, step, &self.unit);
            let mut labelled = numbers.labels(self.low, self.high);
            self.drop_overhanging(&mut labelled, length, direction);
            let count = labelled.len();
            if count == 0 || self.apart(&labelled, length, direction) {
                let rank = match count {
                    0 => 3,
                    1 => 2,
                    _ => u8::from(count > most + 1),
                };
                if best.as_ref().is_none_or(|(least, _)| rank < *least) {
                    best = Some((rank, self.titled(&numbers, labelled)));
                }
                if rank == 0 {
                    break;
                }
            }
            step = step.next();
        }
        best.map_or_else(
            || self.titled(&Numbers::plain(&self.unit), Vec::new()),
            |(_, ticks)| ticks,
        )
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
        let linear = Axis { scale: Scale::Linear, low, high, ..self.clone() };
        let mut ticks =
            if high / low > 3.0 { self.mantissas(&linear, length, direction) } else { None }
                .unwrap_or_else(|| self.linear_within(&linear, length, direction, most));
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
                let mut ticks = self.titled(&Numbers::plain(&self.unit), labelled);
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

    /// Few round mantissas in every decade, as many as have room. `linear` is the axis of the values themselves.
    fn mantissas(&self, linear: &Axis, length: f32, direction: Direction) -> Option<Ticks> {
        let numbers = Numbers::new(linear.low, linear.high, Step::at_least(linear.low), &self.unit);
        let decades = self.low.floor() as i32..=self.high.floor() as i32;
        let choices: [&[u8]; 5] = [&[1, 2, 3, 5], &[1, 2, 5], &[1, 3], &[2, 5], &[1]];
        choices.into_iter().find_map(|mantissas| {
            let mut labelled: Vec<(f64, String)> = decades
                .clone()
                .flat_map(|k| mantissas.iter().map(move |&m| f64::from(m) * 10_f64.powi(k)))
                .map(|value| (value.log10(), numbers.shortest(value)))
                .filter(|(c, _)| (self.low..=self.high).contains(c))
                .collect();
            self.drop_overhanging(&mut labelled, length, direction);
            let fit = labelled.len() >= 2 && self.apart(&labelled, length, direction);
            fit.then(|| self.titled(&numbers, labelled))
        })
    }

    /// Ticks at equal steps of the value, as many as are apart on the logarithmic axis.
    fn linear_within(
        &self,
        linear: &Axis,
        length: f32,
        direction: Direction,
        most: usize,
    ) -> Ticks {
        let mut most = most;
        loop {
            let mut ticks = linear.linear(length, direction, most, 0.0);
            for (c, _) in &mut ticks.labelled {
                *c = c.log10();
            }
            if most > 1 && !self.apart(&ticks.labelled, length, direction) {
                most -= 1;
                continue;
            }
            while !self.apart(&ticks.labelled, length, direction) {
                ticks.labelled.pop();
            }
            self.drop_overhanging(&mut ticks.labelled, length, direction);
            return ticks;
        }
    }

    /// Coordinates of the whole multiples of the powers of ten.
    fn within_decades(&self, first: i64, last: i64) -> Vec<f64> {
        (first - 1..=last)
            .flat_map(|k| (1..=9).map(move |m| k as f64 + f64::from(m).log10()))
            .filter(|c| (self.low..=self.high).contains(c))
            .collect()
    }

    fn titled(&self, numbers: &Numbers, labelled: Vec<(f64, String)>) -> Ticks {
        let (offset, unit) = numbers.taken_out();
        let name = format!("{}{offset}", self.name);
        Ticks { labelled, minor: Vec::new(), name, unit, prefixed: numbers.prefixed_unit() }
    }

    /// Leaves out labels that would stand out over the ends.
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

    /// Whether no two labels touch.
    fn apart(&self, labelled: &[(f64, String)], length: f32, direction: Direction) -> bool {
        let size = |label: &str| text::length(label, TICK_SIZE);
        labelled.windows(2).all(|pair| {
            let distance = self.along(pair[1].0, length) - self.along(pair[0].0, length);
            let room = match direction {
                Direction::Across { .. } => (size(&pair[0].1) + size(&pair[1].1)) / 2.0 + GAP,
                Direction::Up => TICK_SIZE * 1.25,
            };
            distance >= room
        })
    }
}
