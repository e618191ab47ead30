//! Longer lines of reasons to be careful.

use crate::number::significant;

/// Words on a bed in which the necks of a particle meet.
pub(super) fn necks_meet(time_s: f64, contact_ratio: f64, limit: f64, then: &str) -> String {
    format!(
        "from t = {} s (a/R {}) necks meet on more than {} % of the particles, or pores close: {then}",
        significant(time_s, 3),
        significant(contact_ratio, 3),
        100.0 * limit
    )
}

/// Words on contacts that settle softly; `load` and its limit are `fa/(K1 R)`.
pub(super) fn soft_settling(phase: &str, k1: f64, [load, limit]: [f64; 2], needed: f64) -> String {
    format!(
        "phase {phase}: with K1 = {} N/m adhesion alone presses contacts into each other by fa/(K1 R) = {}, above {limit}: the numerical stiffness has a part in how the bed settles, and the times of its heat move by ten percent and more with it; K1 of {} N/m or more is hard enough",
        significant(k1, 3),
        significant(load, 2),
        significant(needed, 2)
    )
}

/// Words on an earlier result most of which the priors exclude.
pub(super) fn outside_priors(from: &str, share: f64) -> String {
    format!(
        "{:.0} % of {from}, which the first runs are placed by, lie outside the priors of this run and are left out",
        100.0 * share
    )
}

/// Words on a pulse energy beyond those that were calibrated.
pub(super) fn outside_energies(energy: f64, [lowest, highest]: [f64; 2]) -> String {
    let calibrated = match lowest < highest {
        true => format!("those that were calibrated, {lowest} to {highest}"),
        false => format!("the one that was calibrated, {lowest}"),
    };
    format!(
        "a pulse energy of {} lies outside of {calibrated}: how far a pulse goes there is a claim of the mobility law, whose error no interval holds",
        significant(energy, 3)
    )
}

/// Words on draws that reach the target after their pairs have ended.
pub(super) fn outside_model(outside: usize, draws: usize, limit: f64) -> String {
    format!(
        "{outside} of {draws} draws that reach the target do so after necks have met on more than {} % of the particles, or pores have closed: from there their times are not those of the contacts",
        100.0 * limit
    )
}

/// Words on a time that rests on few samples.
pub(super) fn few_reach(ratio: f64, reach: usize, samples: usize, draws: usize) -> String {
    format!(
        "{reach} of {draws} draws reach a/R = {}, copies of {samples} sample{}: the interval of its time is theirs, not that of the posterior",
        significant(ratio, 3),
        if samples == 1 { "" } else { "s" }
    )
}

/// Words on a comparison that another prior would change.
pub(super) fn prior_decides(
    between: &str,
    parameters: usize,
    reach: f64,
    difference: f64,
) -> String {
    format!(
        "{between}: the prior decides: they differ in {parameters} informed parameter{}, and a prior one decade wider or narrower in each moves ln K by {}, more than the {} between them (Lindley's paradox)",
        if parameters == 1 { "" } else { "s" },
        significant(reach, 2),
        significant(difference, 2)
    )
}

/// Words on a comparison whose best entry leaves residuals that are alike.
pub(super) fn dependent(kinetics: &str, noise: &str, lag1: f64, correlated: bool) -> String {
    format!(
        "neighbouring residuals are alike even under {kinetics} with {noise} errors (lag-1 correlation {lag1:.2}): {}",
        if correlated {
            "no noise of this table describes them, and its evidences say which is the least bad"
        } else {
            "the evidences take the errors for independent, and they are not"
        }
    )
}
