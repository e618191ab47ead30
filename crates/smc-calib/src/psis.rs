//! How heavy the tail of importance weights is.
//!
//! A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, "Pareto smoothed importance sampling", JMLR 25 (2024)
//! 72: the largest weights are fitted by a generalised Pareto distribution; with its shape k-hat below 0.7
//! estimates can be trusted. The fit is that of J. Zhang and M. A. Stephens, "A new and efficient estimation
//! method for the generalized Pareto distribution", Technometrics 51 (2009) 316, with the weak prior of the
//! former paper.

/// k-hat that stands for "cannot be estimated": fewer than five positive weights in the tail.
pub const UNKNOWN: f64 = 10.0;

/// Pareto shape of the largest of some non-negative values; [`UNKNOWN`] where there are too few.
///
/// The tail is the largest min(S/5, 3 sqrt S) of the S values.
pub fn khat(values: &[f64]) -> f64 {
    let s = values.len();
    let tail = ((0.2 * s as f64).min(3.0 * (s as f64).sqrt())).ceil() as usize;
    if tail < 5 || s <= tail {
        return UNKNOWN;
    }
    let mut sorted = values.to_vec();
    let (_, cut, top) = sorted.select_nth_unstable_by(s - tail - 1, f64::total_cmp);
    let cut = *cut;
    let mut top: Vec<f64> = top.to_vec();
    top.sort_unstable_by(f64::total_cmp);
    let largest = top[top.len() - 1];
    if largest <= 0.0 || !largest.is_finite() {
        return UNKNOWN;
    }
    // A tail that does not rise above the cut has no weight to lose.
    if (largest - cut) <= 1e-12 * largest {
        return -1.0;
    }
    let scale = largest;
    let excess: Vec<f64> = top.iter().map(|v| (v - cut) / scale).filter(|e| *e > 0.0).collect();
    if excess.len() < 5 {
        return UNKNOWN;
    }
    pareto_shape(&excess)
}

/// Shape of the generalised Pareto distribution of ascending positive exceedances.
fn pareto_shape(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let quartile = x[((n / 4.0 + 0.5) as usize).clamp(1, x.len()) - 1];
    let largest = x[x.len() - 1];
    let points = 30 + n.sqrt() as usize;
    let shape = |b: f64| x.iter().map(|x| (-b * x).ln_1p()).sum::<f64>() / n;
    let candidates: Vec<(f64, f64)> = (1..=points)
        .map(|j| {
            let b = 1.0 / largest
                + (1.0 - (points as f64 / (j as f64 - 0.5)).sqrt()) / (3.0 * quartile);
            let k = shape(b);
            let ln = if b == 0.0 || k == 0.0 {
                f64::NEG_INFINITY
            } else {
                n * ((-b / k).ln() - k - 1.0)
            };
            (b, ln)
        })
        .filter(|(_, ln)| ln.is_finite())
        .collect();
    let top = candidates.iter().map(|c| c.1).fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut weighted) = (0.0, 0.0);
    for (b, ln) in &candidates {
        let w = (ln - top).exp();
        sum += w;
        weighted += w * b;
    }
    if sum <= 0.0 || sum.is_nan() {
        return UNKNOWN;
    }
    let k = shape(weighted / sum);
    if !k.is_finite() {
        return UNKNOWN;
    }
    ((k * n + 5.0) / (n + 10.0)).clamp(-1.0, UNKNOWN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, stream};
    use rand::RngExt;

    #[test]
    fn khat_recovers_known_tail_shapes() {
        for shape in [0.1, 0.3, 0.5, 0.7, 1.0, 1.5] {
            let repeats = 20;
            let mean = (0..repeats)
                .map(|r| {
                    let mut rng = stream(11, Purpose::Draws, 0, r);
                    let w: Vec<f64> =
                        (0..4000).map(|_| (1.0 - rng.random::<f64>()).powf(-shape)).collect();
                    khat(&w)
                })
                .sum::<f64>()
                / f64::from(repeats as u32);
            // The weak prior pulls the 190 values of the tail towards one half by ten values' worth.
            let expected = (shape * 190.0 + 5.0) / 200.0;
            assert!((mean - expected).abs() < 0.06, "shape {shape}: k-hat {mean}");
        }
    }

    #[test]
    fn khat_of_equal_weights_is_low_and_of_one_live_weight_unknown() {
        assert!(khat(&[1.0; 1000]) < 0.0);
        let mut one = vec![0.0; 1000];
        one[3] = 1.0;
        assert_eq!(khat(&one), UNKNOWN);
        assert_eq!(khat(&[1.0, 2.0]), UNKNOWN);
    }

    #[test]
    fn khat_of_bounded_weights_is_below_zero_point_two() {
        let mut rng = stream(12, Purpose::Draws, 0, 0);
        let w: Vec<f64> = (0..4000).map(|_| rng.random::<f64>()).collect();
        assert!(khat(&w) < 0.0, "{}", khat(&w));
    }
}
