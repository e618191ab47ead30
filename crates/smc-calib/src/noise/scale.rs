//! What distances between observations are measured in.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Smallest positive control value over the largest below which a curve begins near zero.
const NEAR_ZERO: f64 = 0.1;

/// What distances between observations are measured in.
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DistanceScale {
    /// Logarithm of the control variable; a value at 0 is infinitely far from all others.
    Log,
    /// The control variable itself.
    Linear,
}

impl DistanceScale {
    /// The scale for observations where none is given: logarithmic where no control value is negative and the smallest
    /// positive one is less than a tenth of the largest (a curve over time that begins near zero), else linear.
    pub fn of(control: &[f64]) -> Self {
        let smallest = control.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let largest = control.iter().copied().fold(0.0, f64::max);
        if control.iter().all(|s| *s >= 0.0) && smallest < NEAR_ZERO * largest {
            Self::Log
        } else {
            Self::Linear
        }
    }

    /// Range of the places on the scale; none with fewer than three different ones.
    pub(super) fn range(self, control: &[f64]) -> Option<f64> {
        let mut places: Vec<f64> =
            control.iter().map(|s| self.place(*s)).filter(|s| s.is_finite()).collect();
        places.dedup();
        (places.len() >= 3).then(|| places[places.len() - 1] - places[0])
    }

    /// Correlation of the Ornstein-Uhlenbeck process between two control values, the first not above the second.
    pub(super) fn correlation(self, a: f64, b: f64, length: f64) -> f64 {
        if a == b {
            return 1.0;
        }
        let distance = self.place(b) - self.place(a);
        (-distance / length).exp()
    }

    /// Place on the scale.
    fn place(self, control: f64) -> f64 {
        match self {
            Self::Log => control.ln(),
            Self::Linear => control,
        }
    }
}

impl fmt::Display for DistanceScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Log => "log",
            Self::Linear => "linear",
        })
    }
}
