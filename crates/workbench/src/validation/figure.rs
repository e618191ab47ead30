//! Empirical distribution function of the ranks minus the uniform one, one panel per quantity, with the band.

use figures::{Band, RankedQuantity, RanksFigure};

use super::ranks::Ranks;

/// The figure of a study. Counts are those of ranks not above k/100, k = 1..99.
pub(super) fn figure(ranks: &Ranks) -> RanksFigure {
    let n = ranks.data_sets as f64;
    let level: Vec<f64> = (1..=ranks.band.len()).map(|k| k as f64 / 100.0).collect();
    let differences = |counts: &mut dyn Iterator<Item = usize>| -> Vec<f64> {
        counts.zip(&level).map(|(count, u)| count as f64 / n - u).collect()
    };
    let quantities = ranks.ranked.iter().map(|ranked| RankedQuantity {
        name: ranked.name.clone(),
        difference: differences(&mut ranked.counts.iter().copied()),
        p_value: ranked.p_value,
    });
    RanksFigure {
        title: ranks.title.clone(),
        quantities: quantities.collect(),
        band95: Band {
            lower: differences(&mut ranks.band.iter().map(|(low, _)| *low)),
            upper: differences(&mut ranks.band.iter().map(|(_, high)| *high)),
        },
        level,
    }
}
