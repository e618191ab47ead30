//! The number type of the rate laws and of the Verlet step: one `f64`, or eight side by side.
//!
//! The same source, in the same order of operations and without contraction, runs a single curve on
//! `f64` and eight curves on [`F64x8`], so that both give the same bits.

use std::ops::{Add, Div, Mul, Sub};

/// A number or a vector of them.
pub trait Lanes:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Send
    + Sync
{
    /// One number in all lanes.
    fn splat(value: f64) -> Self;
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// Minimum.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// Maximum.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// `below` where `value < limit`, `above` elsewhere. A single number evaluates only one.
    fn choose_pair(
        value: Self,
        limit: Self,
        below: impl FnOnce() -> (Self, Self),
        above: impl FnOnce() -> (Self, Self),
    ) -> (Self, Self);
}

impl Lanes for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn choose_pair(
        value: Self,
        limit: Self,
        below: impl FnOnce() -> (Self, Self),
        above: impl FnOnce() -> (Self, Self),
    ) -> (Self, Self) {
        if value < limit { below() } else { above() }
    }
}

/// Number of lanes of [`F64x8`].
pub const WIDTH: usize = 8;

/// Eight numbers; two vectors of AVX2, one of AVX-512.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct F64x8(pub [f64; WIDTH]);

impl F64x8 {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = [0.0; WIDTH];
        for (out, (a, b)) in out.iter_mut().zip(self.0.into_iter().zip(other.0)) {
            *out = f(a, b);
        }
        Self(out)
    }
}

macro_rules! lane_by_lane {
    ($($trait:ident $name:ident $op:tt;)*) => {$(
        impl $trait for F64x8 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                self.zip(other, |a, b| a $op b)
            }
        }
    )*};
}
lane_by_lane! { Add add +; Sub sub -; Mul mul *; Div div /; }

impl Lanes for F64x8 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; WIDTH])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.zip(self, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn choose_pair(
        value: Self,
        limit: Self,
        below: impl FnOnce() -> (Self, Self),
        above: impl FnOnce() -> (Self, Self),
    ) -> (Self, Self) {
        let (below, above) = (below(), above());
        let mut out = above;
        #[allow(clippy::needless_range_loop, reason = "six arrays run along")]
        for i in 0..WIDTH {
            let is_below = value.0[i] < limit.0[i];
            out.0.0[i] = if is_below { below.0.0[i] } else { above.0.0[i] };
            out.1.0[i] = if is_below { below.1.0[i] } else { above.1.0[i] };
        }
        out
    }
}
