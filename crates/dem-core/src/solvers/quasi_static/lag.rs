//! The range in which the quasi-static limit holds.

use crate::solvers::QuasiStaticLag;
use crate::{Kinetic, PairScene};

/// The limit is taken to hold where the lag is below this share of the time scale.
const SMALL: f64 = 0.01;

/// The estimate described at [`QuasiStaticLag`], for a run that ended at `overlap`.
pub(super) fn estimate<K: Kinetic>(scene: &PairScene, law: &K, overlap: f64) -> QuasiStaticLag {
    let (start, end) = (scene.x0(), scene.final_overlap());
    let coefficients = law.coefficients();
    let is_slow = |x: f64, (numerator, denominator): (f64, f64)| {
        scene.inertial_lag_s(x) * numerator <= SMALL * x * denominator
    };
    let first = |x: f64| is_slow(x, K::rate_before_switch(&coefficients, x));
    let second = |x: f64| is_slow(x, K::rate_after_switch(&coefficients, x));
    let switch = if K::HAS_SWITCH { coefficients.switch.clamp(start, end) } else { start };
    // Within each branch the rate relative to x falls, so that each has one such place at most.
    let holds_from = if switch < end && !second(switch) {
        second(end).then(|| bisect(switch, end, second))
    } else if switch <= start || first(start) {
        Some(start)
    } else if first(switch) {
        Some(bisect(start, switch, first))
    } else {
        (switch < end).then_some(switch)
    };
    let has_ended = overlap >= end;
    QuasiStaticLag {
        lag_s: scene.inertial_lag_s(overlap),
        time_scale_s: if has_ended { f64::INFINITY } else { overlap / law.rate(overlap) },
        holds_from_contact_ratio: holds_from.map(f64::sqrt),
        holds_from_s: holds_from.map(|x| law.time_to_overlap(x)).filter(|time| time.is_finite()),
    }
}

/// The place between `low`, where `holds` does not, and `high`, where it does; to 1e-6.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    while high - low > 1e-6 * high {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    high
}
