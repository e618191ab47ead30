//! Tails of importance weights and of the estimates that they give.

use super::limits::{KHAT_LIMIT, TAIL_SHARE};
use crate::posterior::ParameterSummary;
use crate::psis;

/// Whether the Pareto shape of weights lets them be trusted; not where it is not a number.
pub fn khat_holds(khat: f64) -> bool {
    khat < KHAT_LIMIT
}

/// Tail of some weights, or of an estimate by them.
#[derive(Clone, Copy)]
pub(crate) struct Tail {
    /// Pareto shape.
    pub khat: f64,
    /// Share of the sum that it has, where it is heavy.
    pub share: f64,
}

impl Tail {
    /// Of some non-negative values.
    pub(crate) fn of(values: &[f64]) -> Self {
        let khat = psis::khat(values);
        let share = if khat_holds(khat) { 0.0 } else { psis::tail_share(values) };
        Self { khat, share }
    }

    /// Of the mean and the variance of a weighted column about its mean: the heavier one.
    pub(crate) fn of_moments(weights: &[f64], column: &[f64], mean: f64) -> Self {
        let of = |power: i32| {
            let weighted = weights.iter().zip(column);
            Self::of(&weighted.map(|(w, x)| w * (x - mean).abs().powi(power)).collect::<Vec<_>>())
        };
        of(1).heavier(of(2))
    }

    /// The larger shape and the larger share of both.
    pub(crate) fn heavier(self, other: Self) -> Self {
        Self { khat: self.khat.max(other.khat), share: self.share.max(other.share) }
    }

    /// Whether the estimate can be trusted.
    pub(crate) fn holds(self) -> bool {
        khat_holds(self.khat) || self.share < TAIL_SHARE
    }
}

impl ParameterSummary {
    /// The heaviest tail of the weights and of its moments.
    pub(super) fn tail(&self) -> Tail {
        Tail { khat: self.khat, share: self.tail_share }
    }
}
