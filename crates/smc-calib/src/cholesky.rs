//! Factors of small symmetric matrices, row by row in plain slices.
//!
//! Written here because their bits are part of every result: samples are placed and weighted by these factors, and
//! another order of the sums would move them.

use crate::lanes::LANES;

/// Lower Cholesky factor of a symmetric matrix (row by row), or none where it is not positive definite.
pub(crate) fn cholesky(matrix: &[f64], d: usize) -> Option<Vec<f64>> {
    factor(matrix, d, |a, b| a.iter().zip(b).map(|(a, b)| a * b).sum(), positive_root)
}

/// The same of a large matrix, with sums in several lanes.
pub(crate) fn large_cholesky(matrix: &[f64], n: usize) -> Option<Vec<f64>> {
    factor(matrix, n, dot, positive_root)
}

/// Lower factor of a large positive semidefinite matrix. A row whose rest by those above is no more than its `rounding` depends on
/// them alone.
pub(crate) fn semidefinite_cholesky(matrix: &[f64], n: usize, rounding: &[f64]) -> Vec<f64> {
    let root = |i: usize, rest: f64| Some(if rest > rounding[i] { rest.sqrt() } else { 0.0 });
    factor(matrix, n, dot, root).unwrap_or_default()
}

/// Square root of what is left of a diagonal element; none where it is not positive.
fn positive_root(_: usize, rest: f64) -> Option<f64> {
    (rest > 0.0 && rest.is_finite()).then(|| rest.sqrt())
}

/// Product of two vectors of equal length, summed in [`LANES`] lanes.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_blocks, a_rest) = a.as_chunks::<LANES>();
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for (a, b) in a_blocks.iter().zip(b_blocks) {
        for k in 0..LANES {
            sums[k] += a[k] * b[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

/// Product `L x` of a lower factor, row by row.
pub(crate) fn lower_times(factor: &[f64], x: &[f64]) -> Vec<f64> {
    let rows = factor.chunks_exact(x.len()).enumerate();
    rows.map(|(i, row)| dot(&row[..=i], &x[..=i])).collect()
}

/// Lower factor whose diagonal elements are the `root`s of what is left of the matrix there; a row of root zero has no part in others.
fn factor(
    matrix: &[f64],
    d: usize,
    dot: impl Fn(&[f64], &[f64]) -> f64,
    root: impl Fn(usize, f64) -> Option<f64>,
) -> Option<Vec<f64>> {
    let mut l = vec![0.0; d * d];
    for i in 0..d {
        let (above, row) = l.split_at_mut(i * d);
        for j in 0..i {
            let pivot = above[j * d + j];
            if pivot > 0.0 {
                row[j] = (matrix[i * d + j] - dot(&row[..j], &above[j * d..j * d + j])) / pivot;
            }
        }
        row[i] = root(i, matrix[i * d + i] - dot(&row[..i], &row[..i]))?;
    }
    Some(l)
}

/// Inverse of a lower triangular factor, lower triangle packed row by row.
pub(crate) fn packed_inverse(factor: &[f64], d: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; d * (d + 1) / 2];
    for i in 0..d {
        let (above, rest) = inverse.split_at_mut(i * (i + 1) / 2);
        let (row, factor) = (&mut rest[..=i], &factor[i * d..=i * d + i]);
        for (k, l) in factor[..i].iter().enumerate() {
            let start = k * (k + 1) / 2;
            row.iter_mut().zip(&above[start..=start + k]).for_each(|(r, a)| *r -= l * a);
        }
        row[i] = 1.0;
        row.iter_mut().for_each(|r| *r /= factor[i]);
    }
    inverse
}

/// Solves `factor factor^T x = right`, the factor lower triangular, row by row.
pub(crate) fn solve(factor: &[f64], right: &[f64]) -> Vec<f64> {
    let p = right.len();
    let mut x = right.to_vec();
    for a in 0..p {
        let dot: f64 = (0..a).map(|b| factor[a * p + b] * x[b]).sum();
        x[a] = (x[a] - dot) / factor[a * p + a];
    }
    for a in (0..p).rev() {
        let dot: f64 = (a + 1..p).map(|b| factor[b * p + a] * x[b]).sum();
        x[a] = (x[a] - dot) / factor[a * p + a];
    }
    x
}

/// W^T W of a lower triangle W, packed row by row.
pub(crate) fn gram(lower: &[f64], d: usize) -> Vec<f64> {
    let mut sum = vec![0.0; d * d];
    let mut row = 0;
    for i in 0..d {
        for a in 0..=i {
            for b in 0..=i {
                sum[a * d + b] += lower[row + a] * lower[row + b];
            }
        }
        row += i + 1;
    }
    sum
}

/// Values of no more columns than rows with the same products of rows.
pub(crate) fn narrow(values: &[f64], n: usize) -> Vec<f64> {
    let m = values.len() / n;
    if m <= n {
        return values.to_vec();
    }
    let mut products = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let (a, b) = (&values[i * m..(i + 1) * m], &values[j * m..(j + 1) * m]);
            let dot = a.iter().zip(b).map(|(a, b)| a * b).sum();
            products[i * n + j] = dot;
            products[j * n + i] = dot;
        }
    }
    let trace: f64 = (0..n).map(|i| products[i * n + i]).sum();
    (0..n).for_each(|i| products[i * n + i] += 1e-10 * trace / n as f64);
    cholesky(&products, n).unwrap_or_else(|| values.to_vec())
}

/// Centre and packed inverse factor of the weighted covariance.
pub(crate) fn whitening(d: usize, z: &[f64], weights: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let total: f64 = weights.iter().sum();
    let mut centre = vec![0.0; d];
    let mut covariance = vec![0.0; d * d];
    for (w, z) in weights.iter().zip(z.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
        for (c, z) in centre.iter_mut().zip(z) {
            *c += w / total * z;
        }
    }
    for (w, z) in weights.iter().zip(z.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
        for i in 0..d {
            for j in 0..d {
                covariance[i * d + j] += w / total * (z[i] - centre[i]) * (z[j] - centre[j]);
            }
        }
    }
    let trace: f64 = (0..d).map(|i| covariance[i * d + i]).sum();
    (0..d).for_each(|i| covariance[i * d + i] += 1e-3 * trace / d as f64 + 1e-18);
    let factor = cholesky(&covariance, d)?;
    Some((centre, packed_inverse(&factor, d)))
}

/// Coordinates of z from that centre, in units of that factor.
pub(crate) fn whiten(z: &[f64], centre: &[f64], inverse: &[f64], out: &mut [f64]) {
    let mut row = 0;
    for i in 0..z.len() {
        out[i] = (0..=i).map(|j| inverse[row + j] * (z[j] - centre[j])).sum();
        row += i + 1;
    }
}
