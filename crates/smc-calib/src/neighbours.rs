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
    /// Length of a row: the dimensions, or [`MAX_DIMENSIONS`] with zeros behind them where they are more than a few.
    /// Loops of a length that is known when they are compiled take half the time.
    row: usize,
    /// Points in the order of the leaves, row by row.
    points: Vec<f64>,
    /// Number of each of them in the order in which they were given.
    index: Vec<u32>,
    /// Splits of the inner nodes: axis and value; the children of node k are 2k + 1 and 2k + 2.
    splits: Vec<(usize, f64)>,
}

/// A query: `count` points nearest to z, closer than a squared distance.
struct Search<const D: usize> {
    z: [f64; D],
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
        let row = if d <= MOST_DIMENSIONS { d } else { MAX_DIMENSIONS };
        let mut ordered = vec![0.0; n * row];
        for (row, i) in ordered.chunks_exact_mut(row.max(1)).zip(&index) {
            row[..d].copy_from_slice(&points[*i as usize * d..(*i as usize + 1) * d]);
        }
        Self { row, points: ordered, index, splits }
    }

    /// Numbers of the points, those near each other near each other.
    pub(crate) fn order(&self) -> &[u32] {
        &self.index
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
        if count == 0 || self.index.is_empty() {
            return;
        }
        match self.row {
            1 => self.begin::<1>(z, count, within, found),
            2 => self.begin::<2>(z, count, within, found),
            3 => self.begin::<3>(z, count, within, found),
            4 => self.begin::<4>(z, count, within, found),
            5 => self.begin::<5>(z, count, within, found),
            6 => self.begin::<6>(z, count, within, found),
            _ => self.begin::<MAX_DIMENSIONS>(z, count, within, found),
        }
    }

    fn begin<const D: usize>(
        &self,
        z: &[f64],
        count: usize,
        within: f64,
        found: &mut Vec<(f64, u32)>,
    ) {
        let mut search = Search { z: [0.0; D], count, within };
        search.z[..z.len()].copy_from_slice(z);
        self.search(&search, found, &mut [0.0; D], 0, 0..self.index.len());
    }

    /// Searches one node. `off` is the distance of z from the node's cell along each axis.
    fn search<const D: usize>(
        &self,
        search: &Search<D>,
        found: &mut Vec<(f64, u32)>,
        off: &mut [f64; D],
        node: usize,
        points: Range<usize>,
    ) {
        let Search { z, count, within } = search;
        if let Some((axis, value)) = self.splits.get(node) {
            let middle = points.start + points.len() / 2;
            let beyond = z[*axis] - value;
            let halves = [(2 * node + 1, points.start..middle), (2 * node + 2, middle..points.end)];
            let [low, high] = halves;
            let (near, far) = if beyond < 0.0 { (low, high) } else { (high, low) };
            self.search(search, found, off, near.0, near.1);
            let before = std::mem::replace(&mut off[*axis], beyond);
            // Summed in the order of the points' distances, so that rounding never puts it above that of a point inside.
            let least = square_between(off, &[0.0; D]);
            if least < *within && (found.len() < *count || least <= found[found.len() - 1].0) {
                self.search(search, found, off, far.0, far.1);
            }
            off[*axis] = before;
            return;
        }
        let rows = self.points[points.start * D..points.end * D].as_chunks::<D>().0;
        for (point, number) in rows.iter().zip(&self.index[points]) {
            let square = square_between(point, z);
            if square < *within {
                keep_nearest(found, *count, (square, *number));
            }
        }
    }
}

/// Squared distance.
#[inline(always)]
fn square_between<const D: usize>(a: &[f64; D], b: &[f64; D]) -> f64 {
    let mut sum = 0.0;
    for k in 0..D {
        sum += (a[k] - b[k]) * (a[k] - b[k]);
    }
    sum
}

/// Puts an entry where it belongs among the `count` nearest, the nearest first; of two as near, the lower number.
fn keep_nearest(found: &mut Vec<(f64, u32)>, count: usize, entry: (f64, u32)) {
    let before =
        |other: &(f64, u32)| entry.0 < other.0 || (entry.0 == other.0 && entry.1 < other.1);
    if found.len() < count {
        found.push(entry);
    } else if !before(&found[count - 1]) {
        return;
    }
    let mut place = found.len() - 1;
    while place > 0 && before(&found[place - 1]) {
        found[place] = found[place - 1];
        place -= 1;
    }
    found[place] = entry;
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
        for (n, d) in
            [(1, 1), (40, 1), (7, 2), (9, 3), (500, 3), (90, 4), (333, 5), (99, 6), (77, 7)]
        {
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
