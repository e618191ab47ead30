//! The pace of a run: what solvers are compiled for, so that a run without heat computes nothing for it.

use std::borrow::Cow;

use super::piece::{Course, Piece};
use super::reduced_time::Walk;

/// The mobility along a run: [`Isothermal`], or that of a [`Heat`](super::Heat). A cursor stands on one smooth stretch of it.
pub trait Pace: Copy + Send + Sync {
    /// Whether it is anything but 1.
    const VARIES: bool;

    /// Reduced times \[s\] of sorted times.
    fn reduced_times<'a>(&self, times_s: &'a [f64]) -> Cow<'a, [f64]>;

    /// The time at which the reduced time has a value \[s\]; `None` where it never has.
    fn time(&self, reduced_s: f64) -> Option<f64>;

    /// Moves the cursor forward to the stretch that holds a time \[s\].
    fn seek(&mut self, time_s: f64);

    /// Moves the cursor to the next stretch.
    fn next_stretch(&mut self);

    /// End of the stretch \[s\]; infinite for the last.
    fn until_s(&self) -> f64;

    /// Whether nothing moves on this stretch.
    fn is_frozen(&self) -> bool;

    /// What is 1 at the reference at a time \[s\] on this stretch: `value` times m.
    fn scaled(&self, time_s: f64, value: f64) -> f64;
}

/// The mobility is 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Isothermal;

impl Pace for Isothermal {
    const VARIES: bool = false;

    fn reduced_times<'a>(&self, times_s: &'a [f64]) -> Cow<'a, [f64]> {
        Cow::Borrowed(times_s)
    }

    fn time(&self, reduced_s: f64) -> Option<f64> {
        Some(reduced_s)
    }

    #[inline(always)]
    fn seek(&mut self, _: f64) {}

    fn next_stretch(&mut self) {}

    #[inline(always)]
    fn until_s(&self) -> f64 {
        f64::INFINITY
    }

    #[inline(always)]
    fn is_frozen(&self) -> bool {
        false
    }

    #[inline(always)]
    fn scaled(&self, _: f64, value: f64) -> f64 {
        value
    }
}

/// The mobility of a heat.
#[derive(Debug, Clone, Copy)]
pub struct Heated<'a> {
    all: &'a [Piece],
    /// The present piece and those after it: one at least.
    left: &'a [Piece],
}

impl<'a> Heated<'a> {
    pub(super) fn new(pieces: &'a [Piece]) -> Self {
        Self { all: pieces, left: pieces }
    }

    #[inline]
    fn piece(&self) -> Piece {
        let nothing = Piece { until_s: f64::INFINITY, course: Course::Constant(0.0) };
        self.left.first().copied().unwrap_or(nothing)
    }
}

impl Pace for Heated<'_> {
    const VARIES: bool = true;

    fn reduced_times<'a>(&self, times_s: &'a [f64]) -> Cow<'a, [f64]> {
        let mut walk = Walk::new(self.all);
        Cow::Owned(times_s.iter().map(|&time_s| walk.to(time_s)).collect())
    }

    fn time(&self, reduced_s: f64) -> Option<f64> {
        Walk::time(self.all, reduced_s)
    }

    #[inline]
    fn seek(&mut self, time_s: f64) {
        while self.left.len() > 1 && self.left[0].until_s <= time_s {
            self.left = &self.left[1..];
        }
    }

    fn next_stretch(&mut self) {
        if self.left.len() > 1 {
            self.left = &self.left[1..];
        }
    }

    #[inline]
    fn until_s(&self) -> f64 {
        self.piece().until_s
    }

    #[inline]
    fn is_frozen(&self) -> bool {
        self.piece().course == Course::Constant(0.0)
    }

    #[inline]
    fn scaled(&self, time_s: f64, value: f64) -> f64 {
        value * self.piece().course.mobility(time_s)
    }
}
