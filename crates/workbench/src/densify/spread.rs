//! The share of each parameter in the spread of the densification time.
//!
//! The logarithm of the time is regressed, with a straight line in each, on the normal scores of the parameters (their ranks
//! among the draws, mapped to a normal distribution). `R^2` of that regression is divided among the
//! parameters by Shapley's rule: the share of a parameter is what it adds to `R^2`, averaged over all orders in which the
//! parameters can be added (Lindeman, Merenda, Gold 1980; Owen, Prieur 2017). For independent parameters that is the
//! first-order variance share of each; for correlated ones what they explain together is divided evenly, and
//! [`alone`](Share::alone) and [`last`](Share::last) say between which bounds it could lie. The rest,
//! `1 - R^2`, is curvature and interaction, which is not divided.

use serde::Serialize;
use smc_calib::normal;

/// The share of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Share {
    /// The parameter.
    pub parameter: String,
    /// Its share of the variance; all shares add up to `r_squared`.
    pub share: f64,
    /// Standard error of that (jackknife).
    pub se: f64,
    /// `R^2` of a regression on this parameter alone.
    pub alone: f64,
    /// Its addition to the `R^2` of all others.
    pub last: f64,
    /// Correlation of its normal scores with the logarithm of the time.
    pub correlation: f64,
}

/// The spread of the time and its division.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spread {
    /// The method in one sentence.
    pub method: String,
    /// Draws used: those that reach the target.
    pub draws: usize,
    /// Standard deviation of the natural logarithm of the time.
    pub sd_ln_time: f64,
    /// Share of the variance that the regression explains.
    pub r_squared: f64,
    /// The same for draws that were left out, one at a time.
    pub r_squared_left_out: f64,
    /// Shares of the parameters.
    pub shares: Vec<Share>,
}

/// The method in one sentence.
const METHOD: &str = "linear regression of ln(time) on the normal scores of the parameters; R^2 divided by Shapley's rule \
                      (mean of what a parameter adds over all orders)";

/// Divides the spread of times among parameters, one column of values each; `None` for fewer than four draws
/// per coefficient, or where nothing spreads.
pub(super) fn divide(names: &[String], columns: &[Vec<f64>], time_s: &[f64]) -> Option<Spread> {
    let n = time_s.len();
    if n < 4 * (columns.len() + 1) {
        return None;
    }
    let response: Vec<f64> = time_s.iter().map(|time| time.ln()).collect();
    let scores: Vec<Vec<f64>> = columns.iter().map(|column| normal_scores(column)).collect();
    let all: Vec<usize> = (0..n).collect();
    let whole = explained(&scores, &response, &all)?;
    let mut errors = vec![0.0; columns.len()];
    // One draw at a time, or with many of them every hundredth.
    let groups = n.min(100);
    let without: Vec<Vec<f64>> = (0..groups)
        .filter_map(|out| {
            let rows: Vec<usize> = all.iter().copied().filter(|row| row % groups != out).collect();
            explained(&scores, &response, &rows).map(|explained| explained.shapley())
        })
        .collect();
    for (place, error) in errors.iter_mut().enumerate() {
        let count = without.len() as f64;
        let mean = without.iter().map(|shares| shares[place]).sum::<f64>() / count;
        let sum: f64 = without.iter().map(|shares| (shares[place] - mean).powi(2)).sum();
        *error = ((count - 1.0) / count * sum).sqrt();
    }
    let shapley = whole.shapley();
    let full = whole.subsets.len() - 1;
    let mean = response.iter().sum::<f64>() / n as f64;
    let variance = response.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / n as f64;
    Some(Spread {
        method: METHOD.to_owned(),
        draws: n,
        sd_ln_time: variance.sqrt(),
        r_squared: whole.subsets[full],
        r_squared_left_out: left_out(&scores, &response),
        shares: names
            .iter()
            .enumerate()
            .map(|(place, name)| Share {
                parameter: name.clone(),
                share: shapley[place],
                se: errors[place],
                alone: whole.subsets[1 << place],
                last: whole.subsets[full] - whole.subsets[full & !(1 << place)],
                correlation: correlation(&scores[place], &response),
            })
            .collect(),
    })
}

/// Ranks as quantiles of the normal distribution; equal values get the mean of their ranks.
fn normal_scores(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut scores = vec![0.0; n];
    let mut from = 0;
    while from < n {
        let mut to = from + 1;
        while to < n && values[order[to]] == values[order[from]] {
            to += 1;
        }
        let middle = 0.5 * (from + to) as f64 / n as f64;
        for &place in &order[from..to] {
            scores[place] = normal::quantile(middle);
        }
        from = to;
    }
    scores
}

/// `R^2` of every subset of the parameters, by bit mask.
struct Explained {
    parameters: usize,
    subsets: Vec<f64>,
}

fn explained(columns: &[Vec<f64>], response: &[f64], rows: &[usize]) -> Option<Explained> {
    let pick = |values: &[f64]| centred(rows.iter().map(|&row| values[row]).collect());
    let y = pick(response);
    let total = product(&y, &y);
    if total <= 1e-24 * rows.len() as f64 {
        return None;
    }
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| pick(column)).collect();
    let subsets = (0..1usize << columns.len())
        .map(|mask| {
            let chosen: Vec<&[f64]> = (0..columns.len())
                .filter(|place| mask >> place & 1 == 1)
                .map(|place| columns[place].as_slice())
                .collect();
            orthonormal(&chosen).iter().map(|q| product(q, &y).powi(2)).sum::<f64>() / total
        })
        .collect();
    Some(Explained { parameters: columns.len(), subsets })
}

impl Explained {
    /// Addition of each parameter, averaged over all orders.
    fn shapley(&self) -> Vec<f64> {
        let p = self.parameters;
        (0..p)
            .map(|place| {
                (0..self.subsets.len())
                    .filter(|mask| mask >> place & 1 == 0)
                    .map(|mask| {
                        // Orders in which exactly these come before: |S|! (p - |S| - 1)! of p!.
                        let before = mask.count_ones() as usize;
                        let orders = factorial(before) * factorial(p - before - 1) / factorial(p);
                        orders * (self.subsets[mask | 1 << place] - self.subsets[mask])
                    })
                    .sum()
            })
            .collect()
    }
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

/// `R^2` of predictions for draws that the regression has not seen.
fn left_out(columns: &[Vec<f64>], response: &[f64]) -> f64 {
    let columns: Vec<Vec<f64>> = columns.iter().map(|column| centred(column.clone())).collect();
    let y = centred(response.to_vec());
    let n = y.len() as f64;
    let basis = orthonormal(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
    let mut squares = 0.0;
    let along: Vec<f64> = basis.iter().map(|q| product(q, &y)).collect();
    for row in 0..y.len() {
        let fitted: f64 = basis.iter().zip(&along).map(|(q, along)| q[row] * along).sum();
        let leverage: f64 = 1.0 / n + basis.iter().map(|q| q[row] * q[row]).sum::<f64>();
        squares += ((y[row] - fitted) / (1.0 - leverage).max(1e-12)).powi(2);
    }
    1.0 - squares / product(&y, &y)
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (centred(a.to_vec()), centred(b.to_vec()));
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    if scale > 0.0 { product(&a, &b) / scale } else { 0.0 }
}

fn centred(mut values: Vec<f64>) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// An orthonormal basis of the span of columns (Gram-Schmidt, twice); a column in the span of those before it adds
/// nothing.
fn orthonormal(columns: &[&[f64]]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let length = product(column, column).sqrt();
        let mut rest = column.to_vec();
        for _ in 0..2 {
            for q in &basis {
                let along = product(q, &rest);
                rest.iter_mut().zip(q).for_each(|(rest, q)| *rest -= along * q);
            }
        }
        let left = product(&rest, &rest).sqrt();
        if left > 1e-9 * length && left > 0.0 {
            rest.iter_mut().for_each(|value| *value /= left);
            basis.push(rest);
        }
    }
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent standard normal columns: quantiles of Halton's points, which fill the cube evenly.
    fn columns(n: usize) -> Vec<Vec<f64>> {
        let mirrored = |mut k: usize, base: usize| {
            let (mut value, mut place) = (0.0, 1.0);
            while k > 0 {
                place /= base as f64;
                value += place * (k % base) as f64;
                k /= base;
            }
            value
        };
        [2, 3, 5]
            .map(|base| (1..=n).map(|k| normal::quantile(mirrored(k, base))).collect())
            .to_vec()
    }

    fn names() -> Vec<String> {
        ["a", "b", "c"].map(str::to_owned).to_vec()
    }

    fn time(of: impl Fn(f64, f64, f64) -> f64, columns: &[Vec<f64>]) -> Vec<f64> {
        (0..columns[0].len())
            .map(|k| of(columns[0][k], columns[1][k], columns[2][k]).exp())
            .collect()
    }

    #[test]
    fn shares_of_a_product_of_powers_are_the_squares_of_its_exponents() {
        // ln t = 0.3 a - 0.2 b + 0 c, parameters monotone in normal variables: shares 9/13, 4/13, 0.
        let z = columns(2000);
        let time_s = time(|a, b, _| 0.3 * a - 0.2 * b, &z);
        let monotone: Vec<Vec<f64>> =
            z.iter().map(|column| column.iter().map(|v| (2.0 * v).exp()).collect()).collect();
        let spread = divide(&names(), &monotone, &time_s).expect("enough draws");
        let shares: Vec<f64> = spread.shares.iter().map(|share| share.share).collect();
        for (found, expected) in shares.iter().zip([9.0 / 13.0, 4.0 / 13.0, 0.0]) {
            assert!((found - expected).abs() < 0.01, "{shares:?}");
        }
        assert!((shares.iter().sum::<f64>() - spread.r_squared).abs() < 1e-12);
        assert!(spread.r_squared > 0.999 && spread.r_squared_left_out > 0.998, "{spread:?}");
        assert!((spread.sd_ln_time / 0.13f64.sqrt() - 1.0).abs() < 0.01);
        assert!(spread.shares[1].correlation < -0.5);
        assert!(spread.shares.iter().all(|share| share.se < 0.03), "{spread:?}");
    }

    #[test]
    fn correlated_parameters_share_what_they_explain_together() {
        // x2 = r x1 + sqrt(1 - r^2) w, ln t = a x1 + b x2. Shapley's share of x1 is, in closed form,
        // ((a + b r)^2 + a^2 (1 - r^2))/2 over the variance.
        let (a, b, r) = (0.5, 0.2, -0.7f64);
        let mut z = columns(4000);
        let second: Vec<f64> =
            z[0].iter().zip(&z[1]).map(|(x, w)| r * x + (1.0 - r * r).sqrt() * w).collect();
        z[1] = second;
        let time_s = time(|x, y, _| a * x + b * y, &z);
        let spread = divide(&names(), &z, &time_s).expect("enough draws");
        let variance = a * a + b * b + 2.0 * a * b * r;
        let expected =
            |a: f64, b: f64| 0.5 * ((a + b * r).powi(2) + a * a * (1.0 - r * r)) / variance;
        for (share, expected) in spread.shares.iter().zip([expected(a, b), expected(b, a)]) {
            assert!((share.share - expected).abs() < 0.02, "{expected} {share:?}");
        }
        let first = &spread.shares[0];
        assert!((first.alone - (a + b * r).powi(2) / variance).abs() < 0.02, "{first:?}");
        assert!((first.last - a * a * (1.0 - r * r) / variance).abs() < 0.02, "{first:?}");
    }

    #[test]
    fn what_no_line_explains_is_left_out_of_the_shares() {
        let z = columns(2000);
        // Half of the variance is curvature: var(a) = 1, var((b^2 - 1)/sqrt 2) = 1.
        let time_s = time(|a, b, _| 0.1 * (a + (b * b - 1.0) / 2f64.sqrt()), &z);
        let spread = divide(&names(), &z, &time_s).expect("enough draws");
        assert!((spread.r_squared - 0.5).abs() < 0.02, "{spread:?}");
        assert!((spread.shares[0].share - 0.5).abs() < 0.02, "{spread:?}");
        assert!(spread.shares[1].share < 0.01, "{spread:?}");
    }

    #[test]
    fn too_few_draws_or_no_spread_give_no_shares_and_a_constant_parameter_has_share_zero() {
        let mut z = columns(100);
        let time_s = time(|a, _, _| a, &z);
        assert!(divide(&names(), &z, &vec![2.0; 100]).is_none());
        let few: Vec<Vec<f64>> = z.iter().map(|column| column[..15].to_vec()).collect();
        assert!(divide(&names(), &few, &time_s[..15]).is_none());
        z[2] = vec![1.0; 100];
        z[1] = z[0].clone();
        let spread = divide(&names(), &z, &time_s).expect("enough draws");
        let shares: Vec<f64> = spread.shares.iter().map(|share| share.share).collect();
        assert!((shares[0] - shares[1]).abs() < 1e-12 && shares[2] == 0.0, "{shares:?}");
    }
}
