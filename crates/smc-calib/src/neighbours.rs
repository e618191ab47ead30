//! Nearest neighbours among a fixed set of points: a k-d tree.

use crate::sobol::MAX_DIMENSIONS;
use std::ops::Range;

/// Most coordinates of points that have near neighbours: with more of them all are far.
pub(crate) const MOST_DIMENSIONS: usize = 6;
/// Points per leaf.
const LEAF: usize = 8;

/// A balanced k-d tree of at most [`MAX_DIMENSIONS`] dimensions; of more than [`MOST_DIMENSIONS`] it is hardly faster than
/// a look at every point.
pub(crate) struct Neighbours {
    d: usize,
    /// Points in the order of the leaves, row by row.
    points: Vec<f64>,
    /// Number of each of them in the order in which they were given.
    index: Vec<u32>,
    /// Splits of the inner nodes: axis and value; the children of node k are 2k + 1 and 2k + 2.
    splits: Vec<(usize, f64)>,
}

/// A query: `count` points nearest to z, closer than a squared distance.
struct Search<'a> {
    z: &'a [f64],
    count: usize,
    within: f64,
}

impl Neighbours {
    /// Takes points row by row.
    pub(crate) fn new(points: &[f64], d: usize) -> Self {
        let n = points.len() / d;
        let mut index: Vec<u32> = (0..n as u32).collect();
        let mut levels = 0;
        while n >> levels > LEAF {
            levels += 1;
        }
        let mut splits = vec![(0, 0.0); (1 << levels) - 1];
        split(points, d, &mut index, &mut splits, 0);
        let ordered =
            index.iter().flat_map(|i| &points[*i as usize * d..(*i as usize + 1) * d]).copied();
        Self { d, points: ordered.collect(), index, splits }
    }

    /// The `count` points nearest to z whose squared distance is below `within`: squared distance and number, nearest
    /// first.
    pub(crate) fn nearest(
        &self,
        z: &[f64],
        count: usize,
        within: f64,
        found: &mut Vec<(f64, u32)>,
    ) {
        found.clear();
        if count > 0 && !self.index.is_empty() {
            let mut off = [0.0; MAX_DIMENSIONS];
            let search = Search { z, count, within };
            self.search(&search, found, &mut off[..self.d], 0, 0..self.index.len());
        }
    }

    /// Searches one node. `off` is the distance of z from the node's cell along each axis.
    fn search(
        &self,
        search: &Search<'_>,
        found: &mut Vec<(f64, u32)>,
        off: &mut [f64],
        node: usize,
        points: Range<usize>,
    ) {
        let Search { z, count, within } = *search;
        if let Some((axis, value)) = self.splits.get(node) {
            let middle = points.start + points.len() / 2;
            let beyond = z[*axis] - value;
            let halves = [(2 * node + 1, points.start..middle), (2 * node + 2, middle..points.end)];
            let [low, high] = halves;
            let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
            self.search(search, found, off, near.0, near.1);
            let before = std::mem::replace(&mut off[*axis], beyond);
            // Summed in the order of the points' distances, so that rounding never puts it above that of a point inside.
            let least: f64 = off.iter().map(|off| off * off).sum();
            if least < within && (found.len() < count || least <= found[found.len() - 1].0) {
                self.search(search, found, off, far.0, far.1);
            }
            off[*axis] = before;
            return;
        }
        for at in points {
            let point = &self.points[at * self.d..(at + 1) * self.d];
            let square: f64 = point.iter().zip(z).map(|(a, b)| (a - b) * (a - b)).sum();
            let entry = (square, self.index[at]);
            if square >= within {
                continue;
            }
            if found.len() == count {
                if found[count - 1] <= entry {
                    continue;
                }
                found.pop();
            }
            let place = found.partition_point(|other| *other < entry);
            found.insert(place, entry);
        }
    }
}

/// Orders a node's points about the median of the axis on which they spread most, and its children's.
fn split(points: &[f64], d: usize, index: &mut [u32], splits: &mut [(usize, f64)], node: usize) {
    if node >= splits.len() {
        return;
    }
    let at = |i: u32, axis: usize| points[i as usize * d + axis];
    let spread = |axis: usize| {
        let (low, high) = index.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), i| {
            (l.min(at(*i, axis)), h.max(at(*i, axis)))
        });
        high - low
    };
    let axis = (0..d).max_by(|a, b| spread(*a).total_cmp(&spread(*b))).unwrap_or(0);
    let middle = index.len() / 2;
    index.select_nth_unstable_by(middle, |a, b| {
        at(*a, axis).total_cmp(&at(*b, axis)).then(a.cmp(b))
    });
    splits[node] = (axis, at(index[middle], axis));
    let (low, high) = index.split_at_mut(middle);
    split(points, d, low, splits, 2 * node + 1);
    split(points, d, high, splits, 2 * node + 2);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_those_of_brute_force() {
        for (n, d) in [(1, 1), (7, 2), (9, 3), (500, 3), (333, 5)] {
            // Rounded, so that there are ties and duplicates.
            let points: Vec<f64> =
                (0..n * d).map(|i| (((i * i) as f64 * 0.7).sin() * 8.0).round() / 4.0).collect();
            let tree = Neighbours::new(&points, d);
            let mut found = Vec::new();
            for q in 0..20 {
                let z: Vec<f64> = (0..d).map(|j| ((q * d + j) as f64 * 1.3).cos() * 2.5).collect();
                let mut all: Vec<(f64, u32)> = (0..n)
                    .map(|i| {
                        let p = &points[i * d..(i + 1) * d];
                        (p.iter().zip(&z).map(|(a, b)| (a - b) * (a - b)).sum(), i as u32)
                    })
                    .collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                for count in [1, 6, 30] {
                    for within in [f64::INFINITY, 2.0, 0.0] {
                        tree.nearest(&z, count, within, &mut found);
                        let near = all.iter().filter(|(square, _)| *square < within).take(count);
                        assert!(found.iter().eq(near), "{n} {d} {count} {within}");
                    }
                }
            }
        }
    }
}
