//! Heaviness of the tail of importance weights.
//!
//! A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, "Pareto smoothed importance sampling", JMLR 25 (2024)
//! 72: the largest weights are fitted by a generalised Pareto distribution; with its shape k-hat below
//! [`KHAT_LIMIT`](crate::trust::limits::KHAT_LIMIT) estimates can be trusted. The fit is that of J. Zhang and M. A. Stephens, "A new and efficient estimation
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
    pareto(&excess).map_or(UNKNOWN, |(k, _)| k)
}

/// Share of the sum of some non-negative values that lies above the cut of the tail which [`khat`] fits; 1 where there is
/// no such tail.
pub fn tail_share(values: &[f64]) -> f64 {
    let s = values.len();
    let tail = ((0.2 * s as f64).min(3.0 * (s as f64).sqrt())).ceil() as usize;
    if s <= tail {
        return 1.0;
    }
    let mut sorted = values.to_vec();
    let (_, cut, top) = sorted.select_nth_unstable_by(s - tail - 1, f64::total_cmp);
    let excess: f64 = top.iter().map(|v| v - *cut).sum();
    let share = excess / values.iter().sum::<f64>();
    if share.is_finite() { share } else { 1.0 }
}

/// Importance weights with their largest ones smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed {
    /// Normalised weights.
    pub weights: Vec<f64>,
    /// Pareto shape of the tail; [`UNKNOWN`] where it cannot be fitted, and nothing was smoothed then.
    pub khat: f64,
}

/// Pareto smoothing of importance ratios given by their logarithms (minus infinity for none).
///
/// The tail that [`khat`] fits is replaced by the quantiles `(j - 1/2)/M` of the fitted distribution, in order,
/// none of them above the largest raw ratio; then everything is normalised.
pub fn smooth(ln_ratios: &[f64]) -> Smoothed {
    let largest = ln_ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut weights: Vec<f64> = ln_ratios.iter().map(|r| (r - largest).exp()).collect();
    let s = weights.len();
    let khat = khat(&weights);
    if largest.is_finite() && khat > -1.0 && khat < UNKNOWN {
        let tail = ((0.2 * s as f64).min(3.0 * (s as f64).sqrt())).ceil() as usize;
        let mut order: Vec<usize> = (0..s).collect();
        order.sort_unstable_by(|a, b| weights[*a].total_cmp(&weights[*b]).then(a.cmp(b)));
        let cut = weights[order[s - tail - 1]];
        let top: Vec<usize> =
            order[s - tail..].iter().copied().filter(|i| weights[*i] > cut).collect();
        let excess: Vec<f64> = top.iter().map(|i| weights[*i] - cut).collect();
        if let Some((k, scale)) = pareto(&excess) {
            let m = top.len() as f64;
            for (j, i) in top.iter().enumerate() {
                let ln_survival = (-(j as f64 + 0.5) / m).ln_1p();
                let quantile =
                    if k == 0.0 { -ln_survival } else { (-k * ln_survival).exp_m1() / k };
                weights[*i] = (cut + scale * quantile).min(1.0);
            }
        }
    }
    let total: f64 = weights.iter().sum();
    for w in &mut weights {
        *w /= total;
    }
    Smoothed { weights, khat }
}

/// Shape and scale of the generalised Pareto distribution of ascending positive exceedances.
fn pareto(x: &[f64]) -> Option<(f64, f64)> {
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
        return None;
    }
    let b = weighted / sum;
    let k = shape(b);
    let scale = -k / b;
    (k.is_finite() && scale.is_finite() && scale > 0.0)
        .then(|| (((k * n + 5.0) / (n + 10.0)).clamp(-1.0, UNKNOWN), scale))
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
    fn smoothing_keeps_the_body_the_order_and_the_sum_and_tames_the_mean_of_heavy_ratios() {
        // Ratios u^-0.6 have mean 1/(1 - 0.6); their largest ones decide how far a raw mean is off.
        let (mut raw_error, mut smooth_error) = (0.0, 0.0);
        for r in 0..200 {
            let mut rng = stream(13, Purpose::Draws, 0, r);
            let ln: Vec<f64> = (0..2000).map(|_| -0.6 * (1.0 - rng.random::<f64>()).ln()).collect();
            let smoothed = smooth(&ln);
            assert!((smoothed.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let mut order: Vec<usize> = (0..ln.len()).collect();
            order.sort_by(|a, b| ln[*a].total_cmp(&ln[*b]));
            assert!(
                order.windows(2).all(|w| smoothed.weights[w[0]] <= smoothed.weights[w[1]]),
                "the order of the ratios is kept"
            );
            let (low, next) = (order[0], order[1]);
            let ratio = smoothed.weights[next] / smoothed.weights[low];
            assert!((ratio.ln() - (ln[next] - ln[low])).abs() < 1e-9, "the body is untouched");
            // The body's scale gives back the mean of the smoothed ratios.
            let mean = ln[low].exp() / smoothed.weights[low] / ln.len() as f64;
            let raw = ln.iter().map(|l| l.exp()).sum::<f64>() / ln.len() as f64;
            raw_error += (raw - 2.5f64).powi(2);
            smooth_error += (mean - 2.5f64).powi(2);
        }
        assert!(smooth_error < 0.9 * raw_error, "{smooth_error} {raw_error}");
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
    fn the_share_of_a_tail_is_what_lies_above_its_cut() {
        // Twenty of a hundred are the tail: above the cut of one, four times two.
        let mut values = vec![1.0; 96];
        values.extend([3.0; 4]);
        assert!((tail_share(&values) - 8.0 / 108.0).abs() < 1e-12);
        assert_eq!(tail_share(&[1.0; 100]), 0.0);
        assert_eq!((tail_share(&[]), tail_share(&[0.0; 100])), (1.0, 1.0));
    }

    #[test]
    fn khat_of_bounded_weights_is_below_zero_point_two() {
        let mut rng = stream(12, Purpose::Draws, 0, 0);
        let w: Vec<f64> = (0..4000).map(|_| rng.random::<f64>()).collect();
        assert!(khat(&w) < 0.0, "{}", khat(&w));
    }
}
