//! Shares of the posterior below levels of a coordinate, and the quantiles that they tell.

use super::held::{Integrals, Samples, only, totals};
use crate::normal;

/// Shares are taken to be at least so far from none and all: the levels reach three normal scores out, and half a score beyond nothing
/// is said.
const LEAST: f64 = 2e-4;
/// Errors of shares count as no smaller than this.
const LEAST_ERROR: f64 = 1e-3;
/// Normal scores beyond the first and the last level up to which something is known.
const BEYOND: f64 = 0.3;

/// Shares of the posterior below some levels of one coordinate, as normal scores, ascending; with their standard errors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Below {
    levels: Vec<f64>,
    scores: Vec<f64>,
    errors: Vec<f64>,
}

/// Shares of the posterior in bins of a coordinate, and the bin of each of some points.
pub(crate) struct Bins {
    pub shares: Vec<f64>,
    pub of: Vec<usize>,
}

/// Neighbouring levels that have one share: sums of their weights and, by weight, of levels, shares and errors.
#[derive(Clone, Copy)]
struct Block {
    weight: f64,
    level: f64,
    share: f64,
    error: f64,
}

impl Block {
    fn of(level: f64, share: f64, error: f64) -> Self {
        let weight = error.max(LEAST_ERROR).powi(-2);
        Self { weight, level: weight * level, share: weight * share, error: weight * error }
    }

    fn with(self, other: Self) -> Self {
        Self {
            weight: self.weight + other.weight,
            level: self.level + other.level,
            share: self.share + other.share,
            error: self.error + other.error,
        }
    }

    /// Level, share and error.
    fn means(self) -> [f64; 3] {
        [self.level, self.share, self.error].map(|sum| sum / self.weight)
    }
}

/// The least squares shares that grow with the level, by weights of one over their errors squared: neighbours that do not grow have their
/// mean (M. Ayer, H.D. Brunk, G.M. Ewing, W.T. Reid, E. Silverman, Ann. Math. Stat. 26 (1955) 641).
fn growing(all: impl Iterator<Item = [f64; 3]>) -> Vec<[f64; 3]> {
    let mut blocks: Vec<Block> = Vec::new();
    for [level, share, error] in all {
        let mut last = Block::of(level, share, error);
        while let Some(before) = blocks.last().copied() {
            let ([level, share, _], [own_level, own_share, _]) = (before.means(), last.means());
            if share < own_share && level < own_level {
                break;
            }
            last = before.with(last);
            blocks.pop();
        }
        blocks.push(last);
    }
    blocks.into_iter().map(Block::means).collect()
}

impl Below {
    /// None where fewer than three levels have shares of their own.
    fn new(levels: &[f64], shares: &[f64], errors: &[f64]) -> Option<Self> {
        let mut below = Self { levels: Vec::new(), scores: Vec::new(), errors: Vec::new() };
        let all = levels.iter().zip(shares).zip(errors);
        let known = all.filter(|((_, share), error)| share.is_finite() && error.is_finite());
        for [level, share, error] in growing(known.map(|((l, share), e)| [*l, *share, *e])) {
            let score = normal::quantile(share.clamp(LEAST, 1.0 - LEAST));
            let grows = below.scores.last().is_none_or(|last| score > *last);
            if (LEAST..=1.0 - LEAST).contains(&share) && grows {
                below.levels.push(level);
                below.scores.push(score);
                below.errors.push(error);
            }
        }
        (below.levels.len() > 2).then_some(below)
    }

    /// The first of the two levels that a normal score is between, or of the two at the end that it is beyond.
    fn place(&self, score: f64) -> usize {
        let after = self.scores.partition_point(|s| *s <= score);
        after.saturating_sub(1).min(self.scores.len() - 2)
    }

    /// The p-quantile: linear in the normal score between two levels, and on beyond the first and the last, to no more than the
    /// range.
    pub(crate) fn quantile(&self, p: f64, range: [f64; 2]) -> f64 {
        let score = normal::quantile(p.clamp(LEAST, 1.0 - LEAST));
        let last = self.scores.len() - 1;
        // Beyond the levels the slope is that over a normal score: two levels next to each other may have nearly the same one.
        let (from, to) = if score < self.scores[0] {
            (0, self.scores.partition_point(|s| *s < self.scores[0] + 1.0).min(last))
        } else if score > self.scores[last] {
            let inner = self.scores.partition_point(|s| *s <= self.scores[last] - 1.0);
            (last, inner.saturating_sub(1))
        } else {
            let k = self.place(score);
            (k, k + 1)
        };
        let slope = (self.levels[to] - self.levels[from]) / (self.scores[to] - self.scores[from]);
        (self.levels[from] + slope * (score - self.scores[from])).max(range[0]).min(range[1])
    }

    /// Whether the p-quantile is between levels, or hardly beyond them.
    pub(crate) fn reaches(&self, p: f64) -> bool {
        let (score, last) = (normal::quantile(p), self.scores.len() - 1);
        self.scores[0] - BEYOND <= score && score <= self.scores[last] + BEYOND
    }

    /// Shares of the posterior between levels, and the bin of each of some coordinates.
    pub(crate) fn bins(&self, x: impl Iterator<Item = f64>) -> Bins {
        let below = self.scores.iter().map(|score| normal::cdf(*score));
        let ends: Vec<f64> = [0.0].into_iter().chain(below).chain([1.0]).collect();
        let shares = ends.windows(2).map(|ends| ends[1] - ends[0]).collect();
        let of = x.map(|x| self.levels.partition_point(|level| *level < x)).collect();
        Bins { shares, of }
    }

    /// Standard error of the share below the p-quantile: linear between two levels.
    pub(crate) fn error(&self, p: f64) -> f64 {
        let score = normal::quantile(p.clamp(LEAST, 1.0 - LEAST));
        let k = self.place(score);
        let along = (score - self.scores[k]) / (self.scores[k + 1] - self.scores[k]);
        let along = along.clamp(0.0, 1.0);
        (1.0 - along) * self.errors[k] + along * self.errors[k + 1]
    }
}

/// Takes the levels out of the integrals, and what they tell of each coordinate; `wider` is the factor on the variance that sub-nets show.
/// None where there are no levels, or they tell nothing of one of the coordinates.
pub(super) fn taken_out(
    integrals: &mut Integrals,
    samples: &Samples<'_>,
    wider: f64,
) -> Option<Vec<Below>> {
    let levels = std::mem::take(&mut integrals.levels);
    if levels.is_empty() {
        return None;
    }
    let p = integrals.shares.len();
    let moments = p - levels.iter().map(Vec::len).sum::<usize>();
    let by_samples = samples.sums(samples.weights, &integrals.features, p);
    let [known, off] = integrals.partly(&by_samples, 1.0);
    let r = (known.len() / p) as f64;
    let sums = totals(&known, p);
    // Share below, with the larger of the errors by sub-nets and by draws.
    let of = |a: usize| {
        let share = sums[a] / sums[0];
        let squares = |rows: &[f64]| -> f64 {
            rows.chunks_exact(p).map(|row| ((row[a] - share * row[0]) * r / sums[0]).powi(2)).sum()
        };
        let by_sub_nets = wider * squares(&known) / (r * (r - 1.0));
        let draws = (off.len() / p) as f64;
        let by_draws = if draws < 2.0 { 0.0 } else { squares(&off) / (draws - 1.0) };
        (share, by_sub_nets.max(by_draws).sqrt())
    };
    let mut first = moments;
    let below = levels.iter().map(|levels| {
        let (shares, errors): (Vec<f64>, Vec<f64>) = (first..first + levels.len()).map(of).unzip();
        first += levels.len();
        Below::new(levels, &shares, &errors)
    });
    let below = below.collect();
    let columns: Vec<usize> = (0..moments).collect();
    let Integrals { of_sub_nets, features, shares, errors, .. } = integrals;
    [of_sub_nets, features, errors].into_iter().for_each(|all| *all = only(all, p, &columns));
    shares.truncate(moments);
    below
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels of N(1, 2^2) a normal score apart, with the shares below them.
    fn normal_levels() -> Below {
        let scores: Vec<f64> = (-2..=2).map(f64::from).collect();
        let levels: Vec<f64> = scores.iter().map(|s| 1.0 + 2.0 * s).collect();
        let shares: Vec<f64> = scores.iter().map(|s| normal::cdf(*s)).collect();
        Below::new(&levels, &shares, &[0.01, 0.02, 0.03, 0.02, 0.01]).expect("five levels")
    }

    #[test]
    fn quantiles_of_a_normal_are_exact_between_its_levels_and_beyond_them() {
        let below = normal_levels();
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        for p in [0.001, 0.025, 0.3, 0.5, 0.84, 0.999] {
            let exact = 1.0 + 2.0 * normal::quantile(p);
            assert!((below.quantile(p, everywhere) - exact).abs() < 1e-9, "{p}");
        }
        assert_eq!([0.001, 0.999].map(|p| below.quantile(p, [-4.0, 6.0])), [-4.0, 6.0]);
        assert!(below.quantile(0.0, everywhere).is_finite());
    }

    #[test]
    fn beyond_levels_of_nearly_the_same_share_quantiles_go_on_as_over_a_normal_score_and_are_not_reached()
     {
        let scores = [-1.001, -1.0, -0.5, 0.0, 0.5, 1.0, 1.001];
        let shares = scores.map(normal::cdf);
        let levels = [-1.25, -1.0, -0.5, 0.0, 0.5, 1.0, 1.25];
        let below = Below::new(&levels, &shares, &[0.01; 7]).expect("seven levels");
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        for p in [0.025, 0.975] {
            assert!(below.quantile(p, everywhere).abs() < 2.7, "{}", below.quantile(p, everywhere));
            assert!(!below.reaches(p) && below.reaches(0.5) && below.reaches(normal::cdf(1.3)));
        }
        assert!(normal_levels().reaches(0.975));
    }

    #[test]
    fn errors_of_shares_are_linear_between_levels_and_those_of_the_ends_beyond() {
        let below = normal_levels();
        let at = |score: f64| below.error(normal::cdf(score));
        for (score, error) in
            [(-3.0, 0.01), (-1.5, 0.015), (0.0, 0.03), (0.25, 0.0275), (2.5, 0.01)]
        {
            assert!((at(score) - error).abs() < 1e-9, "{score}: {}", at(score));
        }
    }

    #[test]
    fn levels_that_have_one_share_are_one_and_those_below_which_is_nothing_or_all_are_left_out() {
        let of = |shares: &[f64]| {
            let levels: Vec<f64> = (0..shares.len() as i32).map(f64::from).collect();
            Below::new(&levels, shares, &vec![0.1; shares.len()]).map(|below| below.levels)
        };
        // 0.3 and 0.2 have their mean, which 0.25 is not above.
        assert_eq!(of(&[0.1, 0.3, 0.2, 0.25, 0.6]), Some(vec![0.0, 2.0, 4.0]));
        assert_eq!(of(&[-0.1, 0.0, 0.2, 0.5, 0.9, 1.0, 1.1]), Some(vec![2.0, 3.0, 4.0]));
        assert_eq!(of(&[0.1, f64::NAN, 0.5]), None);
        // Equal levels have one quantile.
        let below = Below::new(&[1.0, 1.0, 2.0, 3.0], &[0.1, 0.2, 0.3, 0.4], &[0.1; 4]);
        assert_eq!(below.expect("three").levels, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn shares_that_do_not_grow_have_their_mean_by_weight_and_both_ends_are_treated_alike() {
        // The second is known ten times better than the third.
        let (shares, errors) = ([0.1, 0.4, 0.3, 0.9], [0.01, 0.001, 0.01, 0.01]);
        let below = Below::new(&[0.0, 1.0, 2.0, 3.0], &shares, &errors).expect("three");
        let mean = (100.0 * 0.4 + 0.3) / 101.0;
        assert!((normal::cdf(below.scores[1]) - mean).abs() < 1e-12);
        assert!((below.levels[1] - (100.0 + 2.0) / 101.0).abs() < 1e-12);
        assert!((below.errors[1] - (100.0 * 0.001 + 0.01) / 101.0).abs() < 1e-12);
        let levels: Vec<f64> = (0..7).map(f64::from).collect();
        let shares = [0.03, 0.05, 0.5, 0.42, 0.46, 0.97, 0.96];
        let errors = [0.01, 0.01, 0.02, 0.03, 0.02, 0.01, 0.02];
        let mirrored: Vec<f64> = shares.iter().rev().map(|share| 1.0 - share).collect();
        let reversed: Vec<f64> = errors.iter().rev().copied().collect();
        let one = Below::new(&levels, &shares, &errors).expect("levels");
        let other = Below::new(&levels, &mirrored, &reversed).expect("levels");
        let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
        for p in [0.025, 0.1, 0.45, 0.8, 0.96] {
            let [a, b] = [one.quantile(p, everywhere), other.quantile(1.0 - p, everywhere)];
            assert!((a - (6.0 - b)).abs() < 1e-9, "{p}: {a} {b}");
            assert!((one.error(p) - other.error(1.0 - p)).abs() < 1e-12, "{p}");
        }
    }

    #[test]
    fn levels_are_taken_out_of_the_integrals_with_the_larger_error_of_sub_nets_and_draws() {
        // 1, x and x^2 of three sub-nets, and three levels; evidence 2, of which sub-nets differ in what is below the second alone.
        let row = |off: f64| [2.0, 0.2, 2.0, 0.4, 1.0 + off, 1.6];
        let of = |draw: f64| {
            let draw = [0.0, 0.0, 0.0, 0.0, draw, 0.0];
            let mut integrals = Integrals {
                of_sub_nets: [row(-0.1), row(0.0), row(0.1)].concat(),
                features: vec![1.0; 6 * 3],
                shares: vec![1.0; 6],
                errors: [draw, draw.map(|x: f64| -x)].concat(),
                levels: vec![vec![-1.0, 0.0, 1.0]],
                ..Integrals::default()
            };
            let samples = Samples { weights: &[1.0; 3], label: &[0, 1, 2], replicates: 3 };
            let below = taken_out(&mut integrals, &samples, 1.5).expect("three levels");
            assert_eq!((integrals.shares.len(), integrals.features.len()), (3, 9));
            assert_eq!(integrals.of_sub_nets, [2.0, 0.2, 2.0].repeat(3));
            assert_eq!(integrals.errors, vec![0.0; 6]);
            below[0].errors.clone()
        };
        // 1.5 times the variance 0.1^2 / 3 of a mean, over the evidence; and the spread of two draws.
        let by_sub_nets = (1.5_f64 * 0.01 / 3.0).sqrt() / 2.0;
        for (draw, exact) in [(0.0, by_sub_nets), (0.2, 0.2 * 2.0_f64.sqrt() / 2.0)] {
            let errors = of(draw);
            assert!((errors[1] - exact).abs() < 1e-12, "{errors:?} {exact}");
            assert!(errors[0] < 1e-12 && errors[2] < 1e-12, "{errors:?}");
        }
    }

    #[test]
    fn without_levels_nothing_is_taken_out() {
        let mut integrals = Integrals { shares: vec![1.0; 3], ..Integrals::default() };
        let samples = Samples { weights: &[], label: &[], replicates: 3 };
        assert_eq!(taken_out(&mut integrals, &samples, 1.0), None);
        assert_eq!(integrals.shares.len(), 3);
    }
}
