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
    let smooth = |mass: &[f64], wider: f64| {
        let mut smooth = mass.to_vec();
        for row in smooth.chunks_mut(columns) {
            let of_row = bins.0.smooth(row, wider * bandwidths.0);
            row.copy_from_slice(&of_row);
        }
        for column in 0..columns {
            let values: Vec<f64> = (0..rows).map(|row| smooth[row * columns + column]).collect();
            for (row, value) in bins.1.smooth(&values, wider * bandwidths.1).into_iter().enumerate()
            {
                smooth[row * columns + column] = value;
            }
        }
        smooth
    };
    adaptive(&mass, smooth)
}

/// Mass smoothed the more, the thinner it lies: where draws are few, a kernel made for the peak would show each of them.
/// Its width goes with the inverse root of a first estimate, in whole steps up to three.
///
/// I. S. Abramson, Ann. Statist. 10 (1982) 1217.
fn adaptive(mass: &[f64], smooth: impl Fn(&[f64], f64) -> Vec<f64>) -> Vec<f64> {
    let first = smooth(mass, 1.0);
    let total: f64 = mass.iter().sum();
    let logs = mass.iter().zip(&first).filter(|(m, f)| **m > 0.0 && **f > 0.0);
    let typical = (logs.map(|(m, f)| m * f.ln()).sum::<f64>() / total).exp();
    let wider = |first: f64| match (typical / first).sqrt() {
        ..1.5 => 1.0,
        1.5..2.5 => 2.0,
        _ => 3.0,
    };
    let mut sum = vec![0.0; mass.len()];
    for width in [1.0, 2.0, 3.0] {
        let part = mass.iter().zip(&first).map(|(m, f)| if wider(*f) == width { *m } else { 0.0 });
        let part: Vec<f64> = part.collect();
        if part.iter().any(|m| *m > 0.0) {
            sum.iter_mut().zip(smooth(&part, width)).for_each(|(sum, m)| *sum += m);
        }
    }
    sum
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

/// The mass without the parts of the region above a level that hold less than a share of it all and touch no other part.
pub(crate) fn without_specks(mass: &[f64], columns: usize, level: f64, share: f64) -> Vec<f64> {
    let mut kept = mass.to_vec();
    let least = share * mass.iter().sum::<f64>();
    let mut seen: Vec<bool> = mass.iter().map(|m| *m < level).collect();
    for start in 0..mass.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut part = vec![start];
        let mut at = 0;
        while let Some(&cell) = part.get(at) {
            at += 1;
            let (column, row) = (cell % columns, cell / columns);
            for near_row in row.saturating_sub(1)..=row + 1 {
                for near_column in column.saturating_sub(1)..=(column + 1).min(columns - 1) {
                    let near = near_row * columns + near_column;
                    if seen.get(near) == Some(&false) {
                        seen[near] = true;
                        part.push(near);
                    }
                }
            }
        }
        if part.iter().map(|cell| mass[*cell]).sum::<f64>() < least {
            part.into_iter().for_each(|cell| kept[cell] = 0.0);
        }
    }
    kept
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specks_that_chance_draws_are_left_out_and_the_rest_stays() {
        let mut mass = vec![0.0; 100];
        (0..3).for_each(|k| mass[11 + k] = 1.0);
        mass[88] = 0.01;
        let kept = without_specks(&mass, 10, 0.005, 0.02);
        assert_eq!((kept[88], &kept[..88]), (0.0, &mass[..88]));
        // A second mode of some weight is none.
        assert_eq!(without_specks(&mass, 10, 0.005, 0.001), mass);
    }

    #[test]
    fn thin_mass_of_a_pair_is_smoothed_more_than_a_peak_and_none_is_lost() {
        let bins =
            Bins { low: 0.0, high: 1.0, count: 100, support: (f64::NEG_INFINITY, f64::INFINITY) };
        // A peak of 99 % and, far away, a lone draw.
        let draws: Vec<f64> = (0..99).map(|_| 0.3).chain([0.7]).collect();
        let mass = pair((&bins, &bins), (&draws, &draws), |_| 1.0, (0.02, 0.02));
        let total: f64 = mass.iter().sum();
        assert!((total - 100.0).abs() < 0.01, "{total}");
        // Over a normal density of so many cells the mass is 2 pi times their square times the highest.
        let area = |from: usize, to: usize| {
            let part = (from..to).flat_map(|row| &mass[row * 100 + from..row * 100 + to]);
            let (sum, most) = part.fold((0.0, 0.0_f64), |(t, m), x| (t + x, m.max(*x)));
            sum / most
        };
        let ratio = (area(50, 100) / area(0, 50)).sqrt();
        assert!((ratio - 3.0).abs() < 0.1, "{ratio}");
    }
}
