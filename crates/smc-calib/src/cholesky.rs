//! Factors of small symmetric matrices, row by row in plain slices.
//!
//! Written here because their bits are part of every result: samples are placed and weighted by these factors, and
//! another order of the sums would move them.

use crate::lanes::{LANES, Lane, wide};

/// Lower Cholesky factor of a symmetric matrix (row by row), or none where it is not positive definite.
pub(crate) fn cholesky(matrix: &[f64], d: usize) -> Option<Vec<f64>> {
    let mut l = vec![0.0; d * d];
    for i in 0..d {
        let (above, row) = l.split_at_mut(i * d);
        for j in 0..=i {
            let before = if j < i { &above[j * d..j * d + j] } else { &row[..j] };
            let dot: f64 = row[..j].iter().zip(before).map(|(a, b)| a * b).sum();
            let rest = matrix[i * d + j] - dot;
            row[j] = if j < i { rest / above[j * d + j] } else { positive_root(i, rest)? };
        }
    }
    Some(l)
}

/// The same of a large matrix, with sums in several lanes.
pub(crate) fn large_cholesky(matrix: &[f64], n: usize) -> Option<Vec<f64>> {
    factor(matrix, n, positive_root)
}

/// Lower factor of a large positive semidefinite matrix. A row whose rest by those above is no more than its `rounding` depends on
/// them alone.
pub(crate) fn semidefinite_cholesky(matrix: &[f64], n: usize, rounding: &[f64]) -> Vec<f64> {
    let root = |i: usize, rest: f64| Some(if rest > rounding[i] { rest.sqrt() } else { 0.0 });
    factor(matrix, n, root).unwrap_or_default()
}

/// Square root of what is left of a diagonal element; none where it is not positive.
fn positive_root(_: usize, rest: f64) -> Option<f64> {
    (rest > 0.0 && rest.is_finite()).then(|| rest.sqrt())
}

/// Product of two vectors of equal length, summed in [`LANES`] lanes. Loops are over places: a zip here is a call where the program is not
/// optimised when it is linked, as in tests.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let b = &b[..a.len()];
    let (a_blocks, a_rest) = a.as_chunks::<LANES>();
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for i in 0..a_blocks.len() {
        for k in 0..LANES {
            sums[k] += a_blocks[i][k] * b_blocks[i][k];
        }
    }
    let mut rest = -0.0;
    for i in 0..a_rest.len() {
        rest += a_rest[i] * b_rest[i];
    }
    sums.iter().sum::<f64>() + rest
}

/// Adds a multiple of a vector to another of the same length.
#[inline(always)]
pub(crate) fn add_multiple(sum: &mut [f64], by: f64, of: &[f64]) {
    let of = &of[..sum.len()];
    for i in 0..of.len() {
        sum[i] += by * of[i];
    }
}

/// Product `L x` of a lower factor, row by row.
pub(crate) fn lower_times(factor: &[f64], x: &[f64]) -> Vec<f64> {
    let rows = factor.chunks_exact(x.len()).enumerate();
    rows.map(|(i, row)| dot(&row[..=i], &x[..=i])).collect()
}

/// Rows that a factor gains together, and blocks of columns that are solved for together.
const ROWS: usize = 4;
const BLOCKS: usize = 2;

/// Lower factor whose diagonal elements are the `root`s of what is left of the matrix there; a row of root zero has no part in others.
///
/// In panels of [`LANES`] columns: sums over the columns before a panel are those of several rows at a time. Every element is what the
/// [`dot`] of the two rows before it leaves, to the bit.
fn factor(matrix: &[f64], n: usize, root: impl Fn(usize, f64) -> Option<f64>) -> Option<Vec<f64>> {
    wide(
        #[inline(always)]
        || {
            let mut l = vec![0.0; n * n];
            for start in (0..n).step_by(LANES) {
                let end = (start + LANES).min(n);
                for i in start..end {
                    let (above, row) = l.split_at_mut(i * n);
                    let panel = Panel { n, start, rows: &above[start * n..] };
                    panel.columns::<1>(&matrix[i * n..], row);
                    row[i] = root(i, matrix[i * n + i] - dot(&row[..i], &row[..i]))?;
                }
                let (above, rows) = l.split_at_mut(end * n);
                let panel = Panel { n, start, rows: &above[start * n..] };
                let below = rows.chunks_mut(ROWS * n).zip(matrix[end * n..].chunks(ROWS * n));
                for (rows, matrix) in below {
                    if rows.len() == ROWS * n {
                        panel.columns::<ROWS>(matrix, rows);
                    } else {
                        let each = rows.chunks_mut(n).zip(matrix.chunks(n));
                        each.for_each(|(row, matrix)| panel.columns::<1>(matrix, row));
                    }
                }
            }
            Some(l)
        },
    )
}

/// Rows of a factor of n columns whose diagonal elements are from column `start` on, at most [`LANES`].
struct Panel<'a> {
    n: usize,
    start: usize,
    rows: &'a [f64],
}

impl Panel<'_> {
    /// Fills the columns of these rows' diagonal elements in R further rows.
    #[inline(always)]
    fn columns<const R: usize>(&self, matrix: &[f64], rows: &mut [f64]) {
        let Self { n, start, rows: panel } = *self;
        let mut sums = [[0.0; R]; LANES];
        let mut before: [&[Lane]; R] = [&[]; R];
        for r in 0..R {
            before[r] = rows[r * n..][..start].as_chunks::<LANES>().0;
        }
        for (pivots, sums) in panel.chunks_exact(n).zip(&mut sums) {
            let mut lanes = [[0.0; LANES]; R];
            for (k, b) in pivots[..start].as_chunks::<LANES>().0.iter().enumerate() {
                for r in 0..R {
                    let a = &before[r][k];
                    for l in 0..LANES {
                        lanes[r][l] += a[l] * b[l];
                    }
                }
            }
            for r in 0..R {
                sums[r] = lanes[r].iter().sum();
            }
        }
        let mut values = [[0.0; R]; LANES];
        for (j, pivots) in panel.chunks_exact(n).enumerate() {
            let pivots = &pivots[start..=start + j];
            let mut rest = [0.0; R];
            for (value, pivot) in values.iter().zip(&pivots[..j]) {
                for r in 0..R {
                    rest[r] += value[r] * pivot;
                }
            }
            if pivots[j] > 0.0 {
                for r in 0..R {
                    let left = matrix[r * n + start + j] - (sums[j][r] + rest[r]);
                    values[j][r] = left / pivots[j];
                    rows[r * n + start + j] = values[j][r];
                }
            }
        }
    }
}

/// `factor^-1 values` of n rows, the factor lower triangular; both row by row.
pub(crate) fn lower_solve(factor: &[f64], mut values: Vec<f64>, n: usize) -> Vec<f64> {
    let m = values.len() / n;
    wide(
        #[inline(always)]
        || {
            for from in (0..m).step_by(BLOCKS * LANES) {
                if m - from > LANES {
                    solve_columns::<BLOCKS>(factor, &mut values, n, from);
                } else {
                    solve_columns::<1>(factor, &mut values, n, from);
                }
            }
        },
    );
    values
}

/// The same of at most W blocks of [`LANES`] columns.
#[inline(always)]
fn solve_columns<const W: usize>(factor: &[f64], values: &mut [f64], n: usize, from: usize) {
    let m = values.len() / n;
    let mut blocks = vec![[[0.0; LANES]; W]; n];
    for (row, blocks) in values.chunks_exact(m).zip(&mut blocks) {
        blocks.as_flattened_mut().iter_mut().zip(&row[from..]).for_each(|(b, v)| *b = *v);
    }
    for (i, l) in factor.chunks_exact(n).enumerate() {
        let (before, rest) = blocks.split_at_mut(i);
        let mut value = rest[0];
        for (l, other) in l.iter().zip(before) {
            for w in 0..W {
                for c in 0..LANES {
                    value[w][c] -= l * other[w][c];
                }
            }
        }
        for w in 0..W {
            for c in 0..LANES {
                value[w][c] /= l[i];
            }
        }
        rest[0] = value;
    }
    for (row, blocks) in values.chunks_exact_mut(m).zip(&blocks) {
        row[from..].iter_mut().zip(blocks.as_flattened()).for_each(|(v, b)| *v = *b);
    }
}

/// `factor^-T values` of n rows, the factor lower triangular; both row by row.
pub(crate) fn upper_solve(factor: &[f64], mut values: Vec<f64>, n: usize) -> Vec<f64> {
    let m = values.len() / n;
    wide(
        #[inline(always)]
        || {
            for i in (0..n).rev() {
                let (before, rest) = values.split_at_mut(i * m);
                let row = &mut rest[..m];
                row.iter_mut().for_each(|r| *r /= factor[i * n + i]);
                for (l, other) in factor[i * n..].iter().zip(before.chunks_exact_mut(m)) {
                    add_multiple(other, -l, row);
                }
            }
        },
    );
    values
}

/// Lower triangle, row by row, of the inverse of `factor factor^T`, the factor lower triangular: that of [`gram`] of [`packed_inverse`], in
/// lanes and three to four times as fast.
pub(crate) fn inverse_of_factored(factor: &[f64], n: usize) -> Vec<f64> {
    wide(
        #[inline(always)]
        || {
            // Columns of the factor's inverse, as rows.
            let mut columns = vec![0.0; n * n];
            for (j, column) in columns.chunks_exact_mut(n).enumerate() {
                column[j] = 1.0 / factor[j * n + j];
                for i in j + 1..n {
                    let row = &factor[i * n..i * n + i];
                    column[i] = -dot(&row[j..], &column[j..i]) / factor[i * n + i];
                }
            }
            let mut inverse = vec![0.0; n * n];
            for (i, own) in columns.chunks_exact(n).enumerate() {
                for (j, other) in columns.chunks_exact(n).take(i + 1).enumerate() {
                    inverse[i * n + j] = dot(&own[i..], &other[i..]);
                }
            }
            inverse
        },
    )
}

/// Inverse of a lower triangular factor, lower triangle packed row by row.
pub(crate) fn packed_inverse(factor: &[f64], d: usize) -> Vec<f64> {
    wide(
        #[inline(always)]
        || {
            let mut inverse = vec![0.0; d * (d + 1) / 2];
            for i in 0..d {
                let (above, rest) = inverse.split_at_mut(i * (i + 1) / 2);
                let (row, factor) = (&mut rest[..=i], &factor[i * d..=i * d + i]);
                for (k, l) in factor[..i].iter().enumerate() {
                    let start = k * (k + 1) / 2;
                    add_multiple(&mut row[..=k], -l, &above[start..=start + k]);
                }
                row[i] = 1.0;
                row.iter_mut().for_each(|r| *r /= factor[i]);
            }
            inverse
        },
    )
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

/// Some rows of a table, whose rows of `width` numbers are one after the other.
pub(crate) fn rows_of(table: &[f64], width: usize, chosen: &[usize]) -> Vec<f64> {
    chosen.iter().flat_map(|i| &table[i * width..(i + 1) * width]).copied().collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, normals, stream};

    /// Products of the rows of n random points in `rank` dimensions, with so much more on the diagonal.
    fn products(n: usize, rank: usize, more: f64) -> Vec<f64> {
        let points = normals(n * rank, &mut stream(n as u64, Purpose::Errors, 0, 0));
        let mut matrix = vec![0.0; n * n];
        for (i, a) in points.chunks_exact(rank).enumerate() {
            for (j, b) in points.chunks_exact(rank).enumerate() {
                matrix[i * n + j] = dot(a, b) + if i == j { more } else { 0.0 };
            }
        }
        matrix
    }

    #[test]
    fn a_factor_in_panels_has_the_bits_of_one_element_by_element() {
        for n in 1..=45_usize {
            for (rank, more) in [(n, 0.1), (n.div_ceil(2), 0.0)] {
                let matrix = products(n, rank, more);
                let rounding = vec![1e-9; n];
                let mut exact = vec![0.0; n * n];
                for i in 0..n {
                    for j in 0..=i {
                        let before = dot(&exact[i * n..i * n + j], &exact[j * n..j * n + j]);
                        let rest = matrix[i * n + j] - before;
                        let pivot = exact[j * n + j];
                        exact[i * n + j] = if i == j && rest > rounding[i] {
                            rest.sqrt()
                        } else if i > j && pivot > 0.0 {
                            rest / pivot
                        } else {
                            0.0
                        };
                    }
                }
                assert_eq!(semidefinite_cholesky(&matrix, n, &rounding), exact, "{n} {rank}");
                let found = large_cholesky(&matrix, n);
                assert!(rank < n || found == Some(exact), "{n}");
            }
        }
        assert_eq!(large_cholesky(&[1.0, 2.0, 2.0, 1.0], 2), None);
    }

    #[test]
    fn systems_that_are_solved_together_have_the_bits_of_one_at_a_time() {
        for (n, m) in (1..=20).flat_map(|n| (1..=35).map(move |m| (n, m))) {
            let factor = large_cholesky(&products(n, n, 0.1), n).expect("definite");
            let values = normals(n * m, &mut stream(m as u64, Purpose::Errors, 0, 0));
            let mut exact = values.clone();
            for i in 0..n {
                for c in 0..m {
                    let mut value = exact[i * m + c];
                    for k in 0..i {
                        value -= factor[i * n + k] * exact[k * m + c];
                    }
                    exact[i * m + c] = value / factor[i * n + i];
                }
            }
            assert_eq!(lower_solve(&factor, values, n), exact, "{n} {m}");
        }
    }

    #[test]
    fn the_inverse_of_a_factored_matrix_times_it_is_one_and_solves_both_of_its_systems() {
        for n in 1..=45 {
            let matrix = products(n, n, 0.1);
            let factor = large_cholesky(&matrix, n).expect("definite");
            let lower = inverse_of_factored(&factor, n);
            let inverse = |i: usize, j: usize| lower[i.max(j) * n + i.min(j)];
            for i in 0..n {
                for j in 0..n {
                    let sum: f64 = (0..n).map(|k| inverse(i, k) * matrix[k * n + j]).sum();
                    let one = f64::from(u8::from(i == j));
                    assert!((sum - one).abs() < 1e-9, "{n} {i} {j}: {sum}");
                }
            }
            let m = 3;
            let values = normals(n * m, &mut stream(n as u64, Purpose::Errors, 0, 1));
            let solved = upper_solve(&factor, lower_solve(&factor, values.clone(), n), n);
            for (i, c) in (0..n).flat_map(|i| (0..m).map(move |c| (i, c))) {
                let exact: f64 = (0..n).map(|k| inverse(i, k) * values[k * m + c]).sum();
                assert!((solved[i * m + c] - exact).abs() < 1e-9, "{n} {i} {c}");
            }
        }
    }
}
