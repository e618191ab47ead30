//! Quadrature over what a noise model does not know beside its scale.

use crate::lanes::{LANES, exp_of_nonpositive};

/// Gauss-Legendre rule of `n` nodes on the interval from 0 to 1: places, in ascending order, and weights that sum to 1.
///
/// Zeros of the Legendre polynomial by Newton's method from Tricomi's estimate (W. H. Press et al., Numerical Recipes
/// (2007), section 4.6.1).
pub(super) fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    let rows = n as f64;
    (0..n)
        .rev()
        .map(|i| {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (rows + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..20 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 0..n {
                    let k = k as f64;
                    (p, before) = (((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p);
                }
                slope = rows * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            ((1.0 + x) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Eight numbers that are computed together.
pub(super) type Lane = [f64; LANES];

/// Log of the sum of exponentials; minus infinity counts as nothing.
#[inline(always)]
pub(super) fn ln_sum_exp(terms: &[Lane]) -> f64 {
    let mut top = [f64::NEG_INFINITY; LANES];
    for lane in terms {
        for (top, t) in top.iter_mut().zip(lane) {
            *top = top.max(*t);
        }
    }
    let top = top.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if top == f64::NEG_INFINITY {
        return top;
    }
    let mut sums = [0.0; LANES];
    for lane in terms {
        for (sum, t) in sums.iter_mut().zip(lane) {
            *sum += exp_of_nonpositive(t - top);
        }
    }
    top + sums.iter().sum::<f64>().ln()
}

/// Equal-tailed quantiles of a quantity with probability `p` at each of some ascending places: every place stands for the
/// interval that its prior weight takes of (0, 1), within which the probability is spread evenly. `at` takes (0, 1) to
/// the quantity.
pub(super) fn quantile_of_nodes(
    prior: &[f64],
    p: &[f64],
    probability: f64,
    at: impl Fn(f64) -> f64,
) -> f64 {
    let total: f64 = p.iter().sum();
    let (mut before, mut edge) = (0.0, 0.0);
    for (prior, p) in prior.iter().zip(p) {
        let share = p / total;
        if before + share >= probability {
            return at(edge + prior * ((probability - before) / share).clamp(0.0, 1.0));
        }
        (before, edge) = (before + share, edge + prior);
    }
    at(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_of_n_nodes_integrates_polynomials_up_to_degree_2n_minus_1() {
        for n in 1..=24 {
            let rule = gauss_legendre(n);
            assert!(rule.windows(2).all(|pair| pair[0].0 < pair[1].0));
            for degree in 0..2 * n {
                let sum: f64 = rule.iter().map(|(x, w)| w * x.powi(degree as i32)).sum();
                let exact = 1.0 / (degree as f64 + 1.0);
                assert!((sum - exact).abs() < 1e-14, "{n} nodes, degree {degree}: {sum} {exact}");
            }
        }
    }

    #[test]
    fn sums_of_exponentials_hold_for_sizes_beyond_the_range_of_numbers() {
        let mut terms = [[-2000.0; LANES], [f64::NEG_INFINITY; LANES]];
        terms[1][3] = -2000.0 + 2f64.ln();
        let exact = -2000.0 + 10f64.ln();
        assert!((ln_sum_exp(&terms) - exact).abs() < 1e-12);
        assert_eq!(ln_sum_exp(&[[f64::NEG_INFINITY; LANES]]), f64::NEG_INFINITY);
    }

    #[test]
    fn quantiles_of_a_posterior_that_is_the_prior_are_those_of_the_prior() {
        let prior: Vec<f64> = gauss_legendre(7).iter().map(|(_, w)| *w).collect();
        for p in [0.025, 0.25, 0.5, 0.9] {
            let found = quantile_of_nodes(&prior, &prior, p, |u| u);
            assert!((found - p).abs() < 1e-12, "{found}");
        }
    }
}
