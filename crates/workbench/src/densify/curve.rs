//! The bed of one draw over time, as a file, and the bands over all draws.

use std::fmt::Write as _;

use dem_core::bed::{Sample, Series};
use serde::Serialize;

use smc_calib::Weighted;

/// A level whose time is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Mass over density and bed volume.
    RelativeDensity(f64),
    /// Mean a/R over the contacts of the bed.
    ContactRatio(f64),
}

impl Target {
    /// Name of the quantity.
    pub fn name(self) -> &'static str {
        match self {
            Self::RelativeDensity(_) => "relative density",
            Self::ContactRatio(_) => "mean contact ratio a/R",
        }
    }

    /// The level.
    pub fn value(self) -> f64 {
        match self {
            Self::RelativeDensity(value) | Self::ContactRatio(value) => value,
        }
    }
}

/// A bed at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Time since heating began \[s\].
    pub time_s: f64,
    /// Relative density, NaN where the bed has no volume.
    pub relative_density: f64,
    /// Contacts per particle.
    pub coordination: f64,
    /// Mean contact ratio.
    pub mean_contact_ratio: f64,
    /// Share of the particles on which necks meet.
    pub necks_meet: f64,
    /// Mean and largest of the force that drives the growth, over fa.
    pub driving: [f64; 2],
    /// Inertial number.
    pub inertial_number: f64,
}

impl Moment {
    /// From an observation, with time counted from the start of heating.
    pub fn of(sample: &Sample, heated_from_s: f64) -> Self {
        Self {
            time_s: sample.time_s - heated_from_s,
            relative_density: sample.relative_density,
            coordination: sample.coordination,
            mean_contact_ratio: sample.mean_contact_ratio,
            necks_meet: sample.necks_meet,
            driving: [sample.mean_driving, sample.largest_driving],
            inertial_number: sample.inertial_number,
        }
    }

    /// The target's quantity.
    pub fn of_target(&self, target: Target) -> f64 {
        match target {
            Target::RelativeDensity(_) => self.relative_density,
            Target::ContactRatio(_) => self.mean_contact_ratio,
        }
    }

    /// From the numbers of a line, in the order of [`COLUMNS`].
    fn of_numbers(numbers: [f64; 8]) -> Self {
        let [time_s, relative_density, coordination, mean_contact_ratio, rest @ ..] = numbers;
        let [necks_meet, mean, largest, inertial_number] = rest;
        let driving = [mean, largest];
        Self {
            time_s,
            relative_density,
            coordination,
            mean_contact_ratio,
            necks_meet,
            driving,
            inertial_number,
        }
    }

    fn numbers(&self) -> [f64; 8] {
        let Self { time_s, relative_density, coordination, mean_contact_ratio, necks_meet, .. } =
            *self;
        let ([mean, largest], inertial_number) = (self.driving, self.inertial_number);
        [
            time_s,
            relative_density,
            coordination,
            mean_contact_ratio,
            necks_meet,
            mean,
            largest,
            inertial_number,
        ]
    }
}

/// The bed of one draw.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    /// Its moments, in time. It ends where the bed is full (relative density 1), where its pairs do if the scene says so, or with the scene.
    pub moments: Vec<Moment>,
    /// Sum of the errors of a/R of all quasi-static steps; 0 for dynamic scenes.
    pub error_estimate: f64,
    /// Where its pairs end.
    pub pairs_end: Option<PairsEnd>,
}

/// Time at which a quantity has a level between two observations `(time, value)`, by straight lines that bend at `bend`
/// where that lies between them.
pub fn crossing([mut from, mut to]: [(f64, f64); 2], bend: Option<(f64, f64)>, level: f64) -> f64 {
    if let Some(bend) = bend
        && from.0 < bend.0
        && bend.0 < to.0
    {
        if bend.1 >= level { to = bend } else { from = bend }
    }
    from.0 + (level - from.1) / (to.1 - from.1) * (to.0 - from.0)
}

/// A bed where its pairs end: the necks meet, or the pores close.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PairsEnd {
    /// Time since heating began \[s\].
    pub time_s: f64,
    /// Relative density.
    pub relative_density: f64,
    /// Mean contact ratio.
    pub mean_contact_ratio: f64,
}

const COLUMNS: &str = "time_s,relative_density,coordination,mean_contact_ratio,necks_meet,mean_driving,\
                       largest_driving,inertial_number";
const PAIRS_END: &str = "# pairs_end ";
const END: &str = "# end";

impl Curve {
    /// As a file. Its first line names what it belongs to, and its last line marks the end.
    pub fn file(&self, belongs_to: &str) -> String {
        let mut text = format!("# {belongs_to}\n# error_estimate {:e}\n", self.error_estimate);
        if let Some(PairsEnd { time_s, relative_density, mean_contact_ratio }) = self.pairs_end {
            let numbers = [time_s, relative_density, mean_contact_ratio];
            let [time, density, ratio] = numbers.map(|number| format!("{number:e}"));
            let _ = writeln!(text, "{PAIRS_END}{time} {density} {ratio}");
        }
        text.push_str(COLUMNS);
        text.push('\n');
        for moment in &self.moments {
            let numbers = moment.numbers().map(|number| format!("{number:e}"));
            let _ = writeln!(text, "{}", numbers.join(","));
        }
        text.push_str(END);
        text.push('\n');
        text
    }

    /// Reads such a file back; `None` where it belongs to something else or is cut off.
    pub fn parse(text: &str, belongs_to: &str) -> Option<Self> {
        let mut lines = text.lines();
        if lines.next()?.strip_prefix("# ")? != belongs_to {
            return None;
        }
        let error_estimate = lines.next()?.strip_prefix("# error_estimate ")?.parse().ok()?;
        let mut header = lines.next()?;
        let mut pairs_end = None;
        if let Some(numbers) = header.strip_prefix(PAIRS_END) {
            let numbers: Vec<f64> =
                numbers.split(' ').map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
            let [time_s, relative_density, mean_contact_ratio] = numbers.try_into().ok()?;
            pairs_end = Some(PairsEnd { time_s, relative_density, mean_contact_ratio });
            header = lines.next()?;
        }
        if header != COLUMNS {
            return None;
        }
        let mut moments = Vec::new();
        for line in lines {
            if line == END {
                let curve = Self { moments, error_estimate, pairs_end };
                return Some(curve).filter(|curve| !curve.moments.is_empty());
            }
            let numbers: Vec<f64> =
                line.split(',').map(|cell| cell.parse().ok()).collect::<Option<_>>()?;
            moments.push(Moment::of_numbers(numbers.try_into().ok()?));
        }
        None
    }

    /// Time at which the target is reached \[s\], by linear interpolation between observations and the end of the pairs.
    pub fn time_to(&self, target: Target) -> Option<f64> {
        let (of, level) = (|moment: &Moment| moment.of_target(target), target.value());
        let after = self.moments.iter().position(|moment| of(moment) >= level)?;
        let point = |k: usize| (self.moments[k].time_s, of(&self.moments[k]));
        let Some(before) = after.checked_sub(1) else { return Some(point(after).0) };
        Some(crossing([point(before), point(after)], self.pairs_end_at(target), level))
    }

    /// Time \[s\] at which the pairs end, and the target's quantity at that time.
    pub fn pairs_end_at(&self, target: Target) -> Option<(f64, f64)> {
        self.pairs_end.map(|end| match target {
            Target::RelativeDensity(_) => (end.time_s, end.relative_density),
            Target::ContactRatio(_) => (end.time_s, end.mean_contact_ratio),
        })
    }

    /// Takes over where the pairs of a run ended, and its error.
    pub(super) fn close(&mut self, series: &Series, heated_from_s: f64) {
        self.error_estimate = series.quasi_static.error_estimate;
        self.pairs_end = series.hand_over.map(|end| PairsEnd {
            time_s: end.time_s - heated_from_s,
            relative_density: end.relative_density,
            mean_contact_ratio: end.mean_contact_ratio,
        });
    }
}

/// Quantiles over draws at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Median.
    pub median: f64,
    /// Equal-tailed 50 % interval.
    pub eti50: [f64; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [f64; 2],
}

impl Band {
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let draws = Weighted::new(values.map(|value| (value, 1.0)));
        let median = draws.quantile(0.5);
        median.is_finite().then(|| Self {
            median,
            eti50: draws.interval(0.5),
            eti90: draws.interval(0.9),
        })
    }
}

/// All draws at one time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Point {
    /// Time since heating began \[s\].
    pub time_s: f64,
    /// Relative density; none where the bed has no volume. Draws whose bed is full by then count as 1.
    pub relative_density: Option<Band>,
    /// Mean contact ratio; of draws whose bed is full by then, the last one.
    pub mean_contact_ratio: Band,
    /// Share of the draws whose pairs have ended by then.
    pub outside_model: f64,
}

impl Point {
    /// The band of the target's quantity.
    pub fn of_target(&self, target: Target) -> Option<Band> {
        match target {
            Target::RelativeDensity(_) => self.relative_density,
            Target::ContactRatio(_) => Some(self.mean_contact_ratio),
        }
    }
}

/// Bands at the observation times of the scene.
pub(super) fn bands(curves: &[Curve]) -> Vec<Point> {
    let Some(longest) = curves.iter().max_by_key(|curve| curve.moments.len()) else {
        return Vec::new();
    };
    let ends: Vec<f64> = curves
        .iter()
        .map(|curve| curve.pairs_end.map_or(f64::INFINITY, |end| end.time_s))
        .collect();
    longest
        .moments
        .iter()
        .enumerate()
        .filter_map(|(place, moment)| {
            // A bed that was full stays as it was.
            let at = |curve: &Curve| curve.moments.get(place).or(curve.moments.last()).copied();
            let all = || curves.iter().filter_map(at);
            let outside = ends.iter().filter(|&&end| end <= moment.time_s).count();
            Some(Point {
                time_s: moment.time_s,
                relative_density: Band::of(
                    all().map(|m| m.relative_density.min(1.0)).filter(|d| !d.is_nan()),
                ),
                mean_contact_ratio: Band::of(all().map(|m| m.mean_contact_ratio))?,
                outside_model: outside as f64 / curves.len() as f64,
            })
        })
        .collect()
}

/// The time to a target over all draws, those that never reach it being later than all others.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TimeTo {
    /// Median \[s\]; none where half of the draws or more never reach it.
    pub median: Option<f64>,
    /// Equal-tailed 50 % interval; an end that no draw reaches is none.
    pub eti50: [Option<f64>; 2],
    /// Equal-tailed 90 % interval.
    pub eti90: [Option<f64>; 2],
}

impl TimeTo {
    /// From the times of all draws; none for a draw that never reaches the target.
    pub fn of(times: &[Option<f64>]) -> Self {
        let mut sorted: Vec<f64> = times.iter().map(|time| time.unwrap_or(f64::INFINITY)).collect();
        sorted.sort_by(f64::total_cmp);
        // As `Weighted`, linear between the middles of neighbouring weights.
        let quantile = |p: f64| {
            let last = sorted.len().checked_sub(1)?;
            let at = (p * sorted.len() as f64 - 0.5).clamp(0.0, last as f64);
            let (below, share) = (at.floor() as usize, at.fract());
            let value = match share {
                0.0 => sorted[below],
                share => sorted[below] + share * (sorted[below + 1] - sorted[below]),
            };
            Some(value).filter(|value| value.is_finite())
        };
        Self {
            median: quantile(0.5),
            eti50: [0.25, 0.75].map(quantile),
            eti90: [0.05, 0.95].map(quantile),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(density: &[f64]) -> Curve {
        let moments = density
            .iter()
            .enumerate()
            .map(|(k, &relative_density)| Moment {
                time_s: k as f64,
                relative_density,
                coordination: 6.0,
                mean_contact_ratio: 0.5 * relative_density,
                necks_meet: if relative_density > 0.85 { 0.1 } else { 0.0 },
                driving: [1.0, 1.5],
                inertial_number: f64::NAN,
            })
            .collect();
        let pairs_end = density.iter().position(|&density| density > 0.85).map(|at| PairsEnd {
            time_s: at as f64 - 0.25,
            relative_density: 0.85,
            mean_contact_ratio: 0.425,
        });
        Curve { moments, error_estimate: 1e-3, pairs_end }
    }

    #[test]
    fn times_are_read_off_straight_lines_that_bend_where_the_pairs_end() {
        let curve = curve(&[0.6, 0.8, 0.9]);
        let halfway = curve.time_to(Target::RelativeDensity(0.7)).expect("reached");
        assert!((halfway - 0.5).abs() < 1e-12, "{halfway}");
        assert_eq!(curve.time_to(Target::RelativeDensity(0.6)), Some(0.0));
        assert_eq!(curve.time_to(Target::ContactRatio(0.45)), Some(2.0));
        assert_eq!(curve.time_to(Target::RelativeDensity(0.95)), None);
        // From 0.8 at 1 s to 0.85 at 1.75 s, where the pairs end, and to 0.9 at 2 s.
        let before = curve.time_to(Target::RelativeDensity(0.82)).expect("reached");
        assert!((before - 1.3).abs() < 1e-12, "{before}");
        let after = curve.time_to(Target::RelativeDensity(0.86)).expect("reached");
        assert!((after - 1.8).abs() < 1e-12, "{after}");
        assert_eq!(curve.pairs_end_at(Target::RelativeDensity(0.9)), Some((1.75, 0.85)));
        assert_eq!(curve.pairs_end_at(Target::ContactRatio(0.9)), Some((1.75, 0.425)));
    }

    #[test]
    fn a_curve_reads_back_to_the_bit_and_is_refused_for_another_plan_or_when_cut() {
        let curve = curve(&[0.6, 0.7, 0.123_456_789_012_345_67]);
        let text = curve.file("plan 1 draw 2");
        let back = Curve::parse(&text, "plan 1 draw 2").expect("whole");
        assert_eq!(format!("{back:?}"), format!("{curve:?}"));
        assert_eq!(Curve::parse(&text, "plan 1 draw 3"), None);
        for cut in 0..text.len() - 1 {
            assert_eq!(Curve::parse(&text[..cut], "plan 1 draw 2"), None, "{cut}");
        }
    }

    #[test]
    fn a_full_bed_stays_at_density_one_and_draws_outside_the_model_are_counted() {
        let curves = [curve(&[0.6, 0.8, 1.02]), curve(&[0.6, 0.7, 0.8, 0.9])];
        let points = bands(&curves);
        assert_eq!(points.len(), 4);
        let last = &points[3];
        let density = last.relative_density.expect("a density");
        assert_eq!((density.median, density.eti90[1]), (0.95, 1.0));
        let outside: Vec<f64> = points.iter().map(|point| point.outside_model).collect();
        assert_eq!(outside, [0.0, 0.0, 0.5, 1.0]);
    }

    #[test]
    fn draws_that_never_reach_the_target_count_as_later_than_all_others() {
        let some = |times: &[f64], never: usize| {
            let mut all: Vec<Option<f64>> = times.iter().copied().map(Some).collect();
            all.extend(vec![None; never]);
            TimeTo::of(&all)
        };
        let all = some(&[1.0, 2.0, 3.0, 4.0], 0);
        assert_eq!((all.median, all.eti90), (Some(2.5), [Some(1.0), Some(4.0)]));
        let half = some(&[1.0, 2.0], 2);
        assert_eq!((half.median, half.eti50[0], half.eti90[1]), (None, Some(1.5), None));
        assert_eq!(some(&[], 3).median, None);
        assert_eq!(some(&[], 0).median, None);
    }
}
