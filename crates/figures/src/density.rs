//! Densities of weighted draws on a grid, and the contours that hold a given mass.

use std::collections::BTreeMap;

/// Bins of one coordinate; smoothing moves no mass out of the support of the prior.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bins {
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) count: usize,
    /// Bounds of the support.
    pub(crate) support: (f64, f64),
}

impl Bins {
    pub(crate) fn width(&self) -> f64 {
        (self.high - self.low) / self.count as f64
    }

    pub(crate) fn centre(&self, bin: usize) -> f64 {
        self.low + (bin as f64 + 0.5) * self.width()
    }

    fn of(&self, value: f64) -> Option<usize> {
        let at = (value - self.low) / self.width();
        (at >= 0.0 && at < self.count as f64).then_some(at as usize)
    }

    /// First and last bin within the support.
    fn inner(&self) -> (usize, usize) {
        let first = self.of(self.support.0 + self.width() * 1e-6).unwrap_or(0);
        let last = self.of(self.support.1 - self.width() * 1e-6).unwrap_or(self.count - 1);
        (first.min(last), last)
    }

    /// Gaussian smoothing; mass that would leave the support is folded back in.
    fn smooth(&self, values: &[f64], bandwidth: f64) -> Vec<f64> {
        let sd = bandwidth / self.width();
        let reach = ((4.0 * sd).ceil() as usize).min(self.count);
        if sd < 0.05 || reach == 0 {
            return values.to_vec();
        }
        let kernel: Vec<f64> =
            (0..=reach).map(|i| (-0.5 * (i as f64 / sd).powi(2)).exp()).collect();
        let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f64>();
        let (first, last) = self.inner();
        let mut smooth = vec![0.0; values.len()];
        for (i, &value) in values.iter().enumerate().filter(|(_, v)| **v > 0.0) {
            for offset in -(reach as i64)..=reach as i64 {
                let mut to = i as i64 + offset;
                if (first..=last).contains(&i) {
                    let (first, last) = (first as i64, last as i64);
                    if to < first {
                        to = 2 * first - 1 - to;
                    }
                    if to > last {
                        to = 2 * last + 1 - to;
                    }
                }
                if (0..values.len() as i64).contains(&to) {
                    smooth[to as usize] += value * kernel[offset.unsigned_abs() as usize] / total;
                }
            }
        }
        smooth
    }
}

/// Bandwidth by Silverman's rule, with the spread of the middle half where tails are heavy.
///
/// B. W. Silverman, Density Estimation for Statistics and Data Analysis, 1986, eq. 3.31.
pub(crate) fn bandwidth(draws: &[f64], weights: impl Fn(usize) -> f64, dimensions: f64) -> f64 {
    let (mut sum, mut squares, mut total) = (0.0, 0.0, 0.0);
    let mut sorted: Vec<(f64, f64)> = Vec::with_capacity(draws.len());
    for (i, &x) in draws.iter().enumerate() {
        let w = weights(i);
        if x.is_finite() && w > 0.0 {
            sum += w;
            squares += w * w;
            total += w * x;
            sorted.push((x, w));
        }
    }
    if sum <= 0.0 {
        return 0.0;
    }
    let mean = total / sum;
    let variance = sorted.iter().map(|(x, w)| w * (x - mean).powi(2)).sum::<f64>() / sum;
    let effective = sum * sum / squares;
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let middle = quantile_sorted(&sorted, 0.75) - quantile_sorted(&sorted, 0.25);
    let spread = if middle > 0.0 { variance.sqrt().min(middle / 1.349) } else { variance.sqrt() };
    0.9 * spread * effective.powf(-1.0 / (dimensions + 4.0))
}

/// Quantile of (value, weight) pairs sorted by value.
pub(crate) fn quantile_sorted(sorted: &[(f64, f64)], p: f64) -> f64 {
    let total: f64 = sorted.iter().map(|(_, w)| w).sum();
    let mut below = 0.0;
    for &(x, w) in sorted {
        below += w;
        if below >= p * total {
            return x;
        }
    }
    sorted.last().map_or(f64::NAN, |&(x, _)| x)
}

/// Density per unit of the coordinate at the centre of each bin, smoothed.
pub(crate) fn marginal(
    bins: &Bins,
    draws: &[f64],
    weights: impl Fn(usize) -> f64,
    bandwidth: f64,
) -> Vec<f64> {
    let mut mass = vec![0.0; bins.count];
    let mut total = 0.0;
    for (i, &x) in draws.iter().enumerate() {
        let w = weights(i);
        if w > 0.0 && x.is_finite() {
            total += w;
            if let Some(bin) = bins.of(x) {
                mass[bin] += w;
            }
        }
    }
    let scale = if total > 0.0 { 1.0 / (total * bins.width()) } else { 0.0 };
    bins.smooth(&mass, bandwidth).into_iter().map(|m| m * scale).collect()
}

/// Smoothed mass per cell of a pair of coordinates, row by row of the second.
pub(crate) fn pair(
    bins: (&Bins, &Bins),
    draws: (&[f64], &[f64]),
    weights: impl Fn(usize) -> f64,
    bandwidths: (f64, f64),
) -> Vec<f64> {
    let (columns, rows) = (bins.0.count, bins.1.count);
    let mut mass = vec![0.0; columns * rows];
    for (i, (&x, &y)) in draws.0.iter().zip(draws.1).enumerate() {
        if let (Some(column), Some(row)) = (bins.0.of(x), bins.1.of(y)) {
            mass[row * columns + column] += weights(i).max(0.0);
        }
    }
    for row in mass.chunks_mut(columns) {
        let smooth = bins.0.smooth(row, bandwidths.0);
        row.copy_from_slice(&smooth);
    }
    for column in 0..columns {
        let values: Vec<f64> = (0..rows).map(|row| mass[row * columns + column]).collect();
        for (row, value) in bins.1.smooth(&values, bandwidths.1).into_iter().enumerate() {
            mass[row * columns + column] = value;
        }
    }
    mass
}

/// Level above which the cells together hold a share of the mass.
pub(crate) fn level_holding(mass: &[f64], share: f64) -> f64 {
    let mut sorted: Vec<f64> = mass.iter().copied().filter(|m| *m > 0.0).collect();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let total: f64 = sorted.iter().sum();
    let mut held = 0.0;
    for &m in &sorted {
        held += m;
        if held >= share * total {
            return m;
        }
    }
    f64::INFINITY
}

/// Closed outlines of the region above a level (marching squares), in cell units: the centre of cell (0, 0) is (0, 0).
/// The region lies on the same side of every outline, so holes wind the other way.
pub(crate) fn contours(mass: &[f64], columns: usize, level: f64) -> Vec<Vec<(f64, f64)>> {
    let rows = mass.len() / columns.max(1);
    if !level.is_finite() || level <= 0.0 || rows == 0 {
        return Vec::new();
    }
    // The mass outside the grid is zero, so every outline closes.
    let value = |x: i64, y: i64| -> f64 {
        if x < 0 || y < 0 || x >= columns as i64 || y >= rows as i64 {
            0.0
        } else {
            mass[y as usize * columns + x as usize]
        }
    };
    // An edge of the dual grid: (x, y, 0) runs from (x, y) to (x + 1, y), (x, y, 1) to (x, y + 1).
    type Edge = (i64, i64, u8);
    let mut next: BTreeMap<Edge, Edge> = BTreeMap::new();
    for y in -1..rows as i64 {
        for x in -1..columns as i64 {
            // Corners and edges of the cell, counter-clockwise: edge i runs from corner i to the next.
            let corner = [value(x, y), value(x + 1, y), value(x + 1, y + 1), value(x, y + 1)];
            let edges: [Edge; 4] = [(x, y, 0), (x + 1, y, 1), (x, y + 1, 0), (x, y, 1)];
            let inside = corner.map(|v| v >= level);
            // Each outline keeps the region to its left: it enters through an edge that leaves the region, and goes on
            // through one that comes back; of two, the next one if the centre of the cell belongs to the region.
            let step = if corner.iter().sum::<f64>() / 4.0 >= level { 1 } else { 3 };
            for enter in (0..4).filter(|&i| inside[i] && !inside[(i + 1) % 4]) {
                let mut leave = (enter + step) % 4;
                while inside[leave] || !inside[(leave + 1) % 4] {
                    leave = (leave + step) % 4;
                }
                next.insert(edges[enter], edges[leave]);
            }
        }
    }
    let crossing = |(x, y, direction): Edge| -> (f64, f64) {
        let (dx, dy) = if direction == 0 { (1, 0) } else { (0, 1) };
        let (a, b) = (value(x, y), value(x + dx, y + dy));
        let s = if a == b { 0.5 } else { ((level - a) / (b - a)).clamp(0.0, 1.0) };
        (x as f64 + s * dx as f64, y as f64 + s * dy as f64)
    };
    let mut outlines = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut outline = Vec::new();
        let mut edge = start;
        while let Some(to) = next.remove(&edge) {
            outline.push(crossing(edge));
            edge = to;
        }
        outlines.push(outline);
    }
    outlines
}
