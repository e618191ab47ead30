//! Which samples a process runs through.

/// Samples that a process runs through at most: some whose log density is up to `depth` below the best one's, or that are among the
/// best, and some of the rest, so that it does not believe in places that were seen to be bad. Both are taken evenly over their ranks.
#[derive(Clone, Copy)]
pub(super) struct Points {
    best: usize,
    rest: usize,
    depth: f64,
}

impl Points {
    /// To place samples by, at every stage: the best ones.
    pub(super) const FEW: Self = Self { best: 100, rest: 50, depth: 0.0 };
    /// To find covariances that integrals are taken with, once. With those of the best ones, which are right for the middle of the
    /// posterior, PS is twice as far off at 512 and 1024 simulations (means .015 posterior sds, not .007).
    pub(super) const EVEN: Self = Self { depth: 12.0, ..Self::FEW };
    /// To take integrals with.
    pub(super) const MANY: Self = Self { best: 300, rest: 100, ..Self::EVEN };

    /// All of them.
    pub(super) fn most(self) -> usize {
        self.best + self.rest
    }

    /// Those of samples that are ordered by log density, the best first; the depths below it are in the same order.
    pub(super) fn of(self, ordered: Vec<usize>, depths: &[f64]) -> Vec<usize> {
        let n = ordered.len();
        if n <= self.most() {
            return ordered;
        }
        let near = depths.partition_point(|depth| *depth < self.depth).max(self.best);
        let rest = self.rest.min(n - near);
        let best = self.most() - rest;
        evenly(0, near, best).chain(evenly(near, n, rest)).map(|k| ordered[k]).collect()
    }
}

/// So many of the numbers from one to below another, the first among them.
pub(super) fn evenly(from: usize, to: usize, count: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |k| from + k * (to - from) / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of so many samples, the first of them this near to the best: the numbers of those that are taken.
    fn taken(points: Points, n: usize, near: usize) -> Vec<usize> {
        let depths: Vec<f64> = (0..n).map(|k| if k < near { 0.0 } else { 20.0 }).collect();
        points.of((0..n).collect(), &depths)
    }

    #[test]
    fn as_many_as_are_allowed_are_taken_each_once_and_the_best_first() {
        for points in [Points::FEW, Points::EVEN, Points::MANY] {
            for n in 1..1300 {
                for near in [0, 1, n / 3, n / 2, n - n / 10, n - 1, n] {
                    let taken = taken(points, n, near);
                    assert_eq!(taken.len(), n.min(points.most()), "{n} {near}");
                    assert_eq!(taken[0], 0);
                    assert!(taken.is_sorted_by(|a, b| a < b), "{n} {near}: {taken:?}");
                }
            }
        }
    }

    #[test]
    fn samples_are_placed_by_the_best_and_integrals_are_taken_with_all_depths_that_matter() {
        let below = |taken: &[usize], end: usize| taken.iter().filter(|k| **k < end).count();
        let best = taken(Points::FEW, 1000, 600);
        assert_eq!((below(&best, 100), below(&best, 550)), (100, 125));
        let even = taken(Points::EVEN, 1000, 600);
        assert_eq!((below(&even, 300), below(&even, 600)), (50, 100));
        let many = taken(Points::MANY, 1000, 600);
        assert_eq!((below(&many, 300), below(&many, 600), below(&many, 800)), (150, 300, 350));
        // Few that matter are all taken, and the next best.
        let narrow = taken(Points::EVEN, 1000, 30);
        assert_eq!(below(&narrow, 100), 100);
        // Of a rest that is small all are.
        let wide = taken(Points::EVEN, 1000, 980);
        assert_eq!((below(&wide, 980), wide.len()), (130, 150));
    }
}
