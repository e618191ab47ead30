//! A history as a sequence of smooth pieces.

use super::mobility::{Mobility, Vogel};
use super::quadrature::integrate;

/// The mobility from the end of the piece before to `until_s`, which the last piece has at infinity. There it is constant,
/// or decays exponentially.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    pub(super) until_s: f64,
    pub(super) course: Course,
}

/// A smooth mobility over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Course {
    /// m.
    Constant(f64),
    /// `m = amplitude exp(-(t - from)/cooling)`.
    Decay { from_s: f64, amplitude: f64, cooling_s: f64 },
    /// m at `T = ambient + rise exp(-(t - from)/cooling)`.
    Cooling { law: Vogel, from_s: f64, ambient_k: f64, rise_k: f64, cooling_s: f64 },
    /// m at `T = start + rate (t - from)`.
    Ramp { law: Vogel, from_s: f64, start_k: f64, rate_k_per_s: f64 },
}

/// Relative error of the integral over each interval: all are positive, so that their sum is as good.
const RELATIVE: f64 = 1e-12;
/// Absolute error of it, over what has passed before.
const OVER_PAST: f64 = 1e-16;

impl Course {
    #[inline]
    pub(super) fn mobility(&self, time_s: f64) -> f64 {
        match *self {
            Self::Constant(m) => m,
            Self::Decay { from_s, amplitude, cooling_s } => {
                amplitude * (-(time_s - from_s) / cooling_s).exp()
            }
            Self::Cooling { law, from_s, ambient_k, rise_k, cooling_s } => {
                law.at(ambient_k + rise_k * (-(time_s - from_s) / cooling_s).exp())
            }
            Self::Ramp { law, from_s, start_k, rate_k_per_s } => {
                law.at(start_k + rate_k_per_s * (time_s - from_s))
            }
        }
    }

    /// Whether the integral has a closed form.
    pub(super) fn is_closed(&self) -> bool {
        matches!(self, Self::Constant(_) | Self::Decay { .. })
    }

    /// Integral of m from one time to a later one, which a closed form may have at infinity. `past` is the integral up to the first.
    pub(super) fn integral(&self, from_s: f64, to_s: f64, past: f64) -> f64 {
        match *self {
            Self::Constant(0.0) => 0.0,
            Self::Constant(m) => m * (to_s - from_s),
            Self::Decay { cooling_s, .. } => {
                self.mobility(from_s) * cooling_s * -(-(to_s - from_s) / cooling_s).exp_m1()
            }
            _ if to_s <= from_s => 0.0,
            _ => integrate(
                |time_s| self.mobility(time_s),
                from_s,
                to_s,
                (RELATIVE, OVER_PAST * past),
            ),
        }
    }

    /// The time after `from_s` at which the integral of m has grown by `more`, which it does before `until_s`.
    pub(super) fn time_after(&self, from_s: f64, until_s: f64, more: f64) -> f64 {
        match *self {
            Self::Constant(m) => from_s + more / m,
            Self::Decay { cooling_s, .. } => {
                from_s - cooling_s * (-more / (self.mobility(from_s) * cooling_s)).ln_1p()
            }
            _ => self.search(from_s, until_s, more),
        }
    }

    /// Newton's method, with the middle of the bracket where it leaves it or m is 0. The integral is carried along from
    /// the lower end of the bracket.
    fn search(&self, from_s: f64, until_s: f64, more: f64) -> f64 {
        let (mut low, mut high, mut passed) = (from_s, until_s, 0.0);
        let mut at = low + (more / self.mobility(low)).min(0.5 * (high - low));
        for _ in 0..200 {
            if !(low < at && at < high) {
                at = 0.5 * (low + high);
            }
            if at <= low || at >= high {
                break;
            }
            let there = passed + self.integral(low, at, passed);
            if (there - more).abs() <= 1e-15 * more {
                return at;
            }
            if there < more {
                (low, passed) = (at, there);
            } else {
                high = at;
            }
            at += (more - there) / self.mobility(at);
        }
        low
    }
}

/// Pieces under way: each is added with the time at which it ends.
pub(super) struct Pieces<'a> {
    mobility: &'a Mobility,
    now_s: f64,
    pieces: Vec<Piece>,
}

impl<'a> Pieces<'a> {
    /// A history that begins at `start_s`, and rests at a temperature before it.
    pub(super) fn new(mobility: &'a Mobility, start_s: f64, before_k: f64) -> Self {
        let mut pieces = Self { mobility, now_s: f64::NEG_INFINITY, pieces: vec![] };
        pieces.constant(before_k, start_s);
        pieces
    }

    pub(super) fn now_s(&self) -> f64 {
        self.now_s
    }

    fn push(&mut self, until_s: f64, course: Course) {
        if until_s > self.now_s {
            self.pieces.push(Piece { until_s, course });
            self.now_s = until_s;
        }
    }

    pub(super) fn constant(&mut self, temperature_k: f64, until_s: f64) {
        self.push(until_s, Course::Constant(self.mobility.at(temperature_k)));
    }

    /// A straight line to a temperature.
    pub(super) fn ramp(&mut self, start_k: f64, end_k: f64, until_s: f64) {
        let (from_s, floor_k) = (self.now_s, self.mobility.floor_k());
        let rate_k_per_s = (end_k - start_k) / (until_s - from_s);
        if start_k == end_k || start_k.max(end_k) <= floor_k {
            return self.constant(start_k, until_s);
        }
        let course = Course::Ramp { law: self.mobility.vogel, from_s, start_k, rate_k_per_s };
        let crossing_s = (from_s + (floor_k - start_k) / rate_k_per_s).clamp(from_s, until_s);
        let (nothing, rises) = (Course::Constant(0.0), start_k < end_k);
        if start_k.min(end_k) >= floor_k {
            self.push(until_s, course);
        } else {
            self.push(crossing_s, if rises { nothing } else { course });
            self.push(until_s, if rises { course } else { nothing });
        }
    }

    /// From `ambient + rise` towards `ambient`, without an end.
    ///
    /// The decay is cut in pieces that double, up to where nothing is left of the rise: in each the integrand has one
    /// scale, which the quadrature cannot miss.
    pub(super) fn cool(&mut self, ambient_k: f64, rise_k: f64, cooling_s: f64) {
        let (from_s, floor_k) = (self.now_s, self.mobility.floor_k());
        if rise_k == 0.0 || cooling_s.is_infinite() {
            return self.constant(ambient_k + rise_k, f64::INFINITY);
        }
        let frozen_s = if ambient_k + rise_k <= floor_k {
            from_s
        } else if ambient_k < floor_k {
            from_s + cooling_s * (rise_k / (floor_k - ambient_k)).ln()
        } else {
            f64::INFINITY
        };
        let law = self.mobility.vogel;
        let course = Course::Cooling { law, from_s, ambient_k, rise_k, cooling_s };
        for doubling in -1..=10 {
            self.push((from_s + cooling_s * 2f64.powi(doubling)).min(frozen_s), course);
        }
        if frozen_s.is_finite() {
            self.push(f64::INFINITY, Course::Constant(0.0));
        }
        self.constant(ambient_k, f64::INFINITY);
    }

    pub(super) fn into_vec(self) -> Vec<Piece> {
        self.pieces
    }
}
