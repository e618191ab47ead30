//! Which samples a process runs through.

use crate::sobol::evenly;

/// Samples that a process runs through at most: some near the best one, and some of the rest, so that it does not believe in places
/// that were seen to be bad. Both are taken evenly over their ranks.
#[derive(Clone, Copy)]
pub(super) struct Points {
    near: usize,
    rest: usize,
    /// Those less than this in log density below the best one are near, or the first ones where these are too few.
    depth: f64,
}

impl Points {
    /// To place samples by, at every stage: the best ones and some others.
    pub(super) const FEW: Self = Self { near: 100, rest: 50, depth: 0.0 };
    /// To estimate by, once: the covariances that integrals are taken with. Those of the best samples are right for the middle of the
    /// posterior, and PS is twice as far off with them at 1024 simulations (means .015 posterior sds, not .007).
    pub(super) const EVEN: Self = Self { depth: 12.0, ..Self::FEW };
    /// To take integrals with.
    pub(super) const MANY: Self = Self { near: 300, rest: 100, ..Self::EVEN };

    /// All of them.
    pub(super) fn most(self) -> usize {
        self.near + self.rest
    }

    /// Those of samples that are ordered by log density, the best first; `depth` is how far one is below the best.
    pub(super) fn of(self, ordered: Vec<usize>, depth: impl Fn(&usize) -> f64) -> Vec<usize> {
        let n = ordered.len();
        if n <= self.most() {
            return ordered;
        }
        let near = ordered.partition_point(|i| depth(i) < self.depth).max(self.near);
        let rest = self.rest.min(n - near);
        let of_rest = evenly(n - near, rest).map(|k| near + k);
        evenly(near, self.most() - rest).chain(of_rest).map(|k| ordered[k]).collect()
    }
}

/// Up to so many of two kinds in turn, the number of each sample with its kind; samples are given by how far away they are, the nearest
/// first. Of each kind half of them, more where the other has fewer, evenly from those that are less than `near` away, or the nearest where
/// these are too few.
pub(super) fn in_turn(
    kinds: [&[(f64, usize)]; 2],
    points: usize,
    near: f64,
) -> Vec<(usize, usize)> {
    let chosen = |kind: usize| -> Vec<(usize, usize)> {
        let (all, others) = (kinds[kind], kinds[1 - kind].len());
        let count = all.len().min((points / 2).max(points.saturating_sub(others)));
        let near = all.partition_point(|one| one.0 < near).max(count);
        evenly(near, count).map(|k| (all[k].1, kind)).collect()
    };
    let [first, second] = [chosen(0), chosen(1)];
    let most = first.len().max(second.len());
    (0..most).flat_map(|k| [first.get(k), second.get(k)]).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of so many samples, numbered from the last to the first, of which so many are less than 12 below the best: the ranks of those
    /// that are taken.
    fn taken(points: Points, n: usize, within: usize) -> Vec<usize> {
        let rank = |i: &usize| n - 1 - i;
        let depth = |i: &usize| 12.0 * (rank(i) as f64 / within as f64).powi(2);
        points.of((0..n).rev().collect(), depth).iter().map(rank).collect()
    }

    #[test]
    fn as_many_as_are_allowed_are_taken_each_once_and_the_best_first() {
        for points in [Points::FEW, Points::EVEN, Points::MANY] {
            for n in 1..1300 {
                for within in [1, 1 + n / 3, 1 + n / 2, n - n / 10, n] {
                    let taken = taken(points, n, within);
                    assert_eq!(taken.len(), n.min(points.most()), "{n} {within}");
                    assert_eq!(taken[0], 0);
                    assert!(taken.is_sorted_by(|a, b| a < b), "{n} {within}: {taken:?}");
                }
            }
        }
    }

    #[test]
    fn samples_are_placed_by_the_best_and_integrals_are_taken_with_all_down_to_a_depth() {
        let below = |taken: &[usize], end: usize| taken.iter().filter(|k| **k < end).count();
        let best = taken(Points::FEW, 1000, 600);
        assert_eq!((below(&best, 100), below(&best, 550)), (100, 125));
        let even = taken(Points::EVEN, 1000, 600);
        assert_eq!((below(&even, 300), below(&even, 600)), (50, 100));
        let many = taken(Points::MANY, 1000, 600);
        assert_eq!((below(&many, 300), below(&many, 600), below(&many, 800)), (150, 300, 350));
        // Where few are near, the next ones are taken too.
        let narrow = taken(Points::EVEN, 1000, 30);
        assert_eq!(below(&narrow, 100), 100);
        // Of a rest that is small all are.
        let wide = taken(Points::EVEN, 1000, 980);
        assert_eq!((below(&wide, 980), wide.len()), (130, 150));
    }

    #[test]
    fn of_two_kinds_all_are_taken_in_turn_where_they_are_few_and_evenly_those_near_where_they_are_many()
     {
        let kind = |from: usize, n: usize| -> Vec<(f64, usize)> {
            (0..n).map(|k| (k as f64, from + k)).collect()
        };
        let taken = |n: usize, m: usize, near: f64| -> Vec<usize> {
            let (first, second) = (kind(0, n), kind(1000, m));
            let taken = in_turn([&first, &second], 150, near);
            assert!(taken.iter().all(|(i, kind)| usize::from(*i >= 1000) == *kind));
            taken.into_iter().map(|(i, _)| i).collect()
        };
        for (n, m) in [(0, 3), (3, 0), (2, 4), (100, 50), (149, 1), (75, 75)] {
            let in_turn = (0..n.max(m)).flat_map(|k| [(k, k < n), (1000 + k, k < m)]);
            let all: Vec<usize> = in_turn.filter(|one| one.1).map(|one| one.0).collect();
            assert_eq!(taken(n, m, 12.0), all, "{n} {m}");
        }
        for (n, m, near, ends) in [
            // Half of each, over all that are near.
            (400, 300, 225.0, [222, 1222]),
            // The nearest where few are near.
            (400, 300, 10.0, [74, 1074]),
            // Few of one kind: more of the other.
            (400, 20, 260.0, [258, 1019]),
        ] {
            let taken = taken(n, m, near);
            let last =
                |second: bool| taken.iter().filter(|i| (**i >= 1000) == second).max().copied();
            assert_eq!(taken.len(), 150, "{n} {m}");
            assert_eq!([last(false), last(true)], ends.map(Some), "{n} {m}");
        }
    }
}
