//! What other laws of densification say of the same time: the part of what is not known that no posterior holds.

use dem_core::PairScene;
use dem_core::bed::Growing;
use dem_core::densification::Densification;
use dem_core::heat::Heat;
use serde::Serialize;

use super::curve::{Curve, Target, TimeTo};
use crate::number::significant;

/// The time to the target by another law, from the starting density and with the parameters of each draw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherLaw {
    /// Name of the law.
    pub law: &'static str,
    /// Over all draws \[s\].
    pub time_s: TimeTo,
}

/// What another law needs of a draw.
pub(super) type OfDraw<'a> = (PairScene, Growing, Option<&'a Heat>, &'a Curve);

/// Times by all laws, where the target is a relative density. `draws` are the pairs of two particles of the mean
/// radius, with the growth, the heat and the bed of each draw.
pub(super) fn other_laws(target: Target, draws: &[OfDraw<'_>]) -> Vec<OtherLaw> {
    let Target::RelativeDensity(density) = target else { return Vec::new() };
    let time = |law: Densification, (pair, growing, heat, curve): &OfDraw<'_>| {
        let start = curve.moments.first()?.relative_density;
        let sintering = growing.sintering.at_radius(growing.calibrated_radius_m, pair.radius_m());
        let reduced_s = law.time_s(pair, (growing.kinetics, &sintering), start, density)?;
        match heat {
            None => Some(reduced_s),
            Some(heat) => heat.time(reduced_s),
        }
    };
    Densification::ALL
        .into_iter()
        .map(|law| {
            let times: Vec<Option<f64>> = draws.iter().map(|draw| time(law, draw)).collect();
            OtherLaw { law: law.name(), time_s: TimeTo::of(&times) }
        })
        .collect()
}

/// The laws as lines of the summary; none without laws. `bed` is the median of the beds.
pub(super) fn lines(laws: &[OtherLaw], bed: Option<f64>) -> Vec<String> {
    let medians: Vec<f64> =
        laws.iter().filter_map(|law| law.time_s.median).chain(bed).filter(|t| *t > 0.0).collect();
    let shortest = medians.iter().copied().fold(f64::INFINITY, f64::min);
    let longest = medians.iter().copied().fold(0.0, f64::max);
    if laws.is_empty() || medians.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![
        "  medians of the same time by other laws, from the bed's starting density".to_owned(),
    ];
    for law in laws {
        let median =
            law.time_s.median.map_or_else(|| "never".to_owned(), |s| significant(s, 3) + " s");
        lines.push(format!("    {:<42} {median}", law.law));
    }
    lines.push(
        "    open and closed pores have no zipping stage: they start at once, and are faster early"
            .to_owned(),
    );
    let never =
        laws.iter().filter(|law| law.time_s.median.is_none()).count() + usize::from(bed.is_none());
    let they = match never {
        0 => "they".to_owned(),
        _ => format!("{never} of {} never get there; the others", laws.len() + 1),
    };
    lines.push(format!(
        "    {they} differ by a factor of {} ({} .. {} s): the interval above is the posterior's part alone",
        significant(longest / shortest, 2),
        significant(shortest, 3),
        significant(longest, 3)
    ));
    lines
}
