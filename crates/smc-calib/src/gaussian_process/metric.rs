//! From parameters' coordinates to those that distances of a covariance are measured in (C. E. Rasmussen, C. K. I. Williams (2006), section
//! 5.1; J. Snoek, K. Swersky, R. Zemel, R. P. Adams, Input warping for Bayesian optimization, ICML 2014).

/// Standard deviations, before any sample, of how far coordinates are mixed and bent.
const MIXED: f64 = 1.0;
const BENT: f64 = 1.5;
/// Most that one is bent: lengths at one end are then this many e-folds of those at the other.
pub(super) const MOST_BENT: f64 = 4.0;

/// `x -> M b(x)` with `b_j(x) = 2 (exp(w_j (x_j + 1)/2) - 1)/(exp(w_j) - 1) - 1`, which leaves -1 and 1 where they are, and a lower
/// triangular M: row k has 1/length_k on its diagonal and mix_kl/length_k before it. Any matrix of distances has such an M; which are
/// probable before any sample depends on the order of the parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Metric {
    pub lengths: Vec<f64>,
    /// Of rows 1, 2, ..., one after the other; empty: none.
    pub mixed: Vec<f64>,
    /// The w; empty: none.
    pub bent: Vec<f64>,
}

impl Metric {
    /// Coordinates that distances are measured in.
    pub(crate) fn of(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(x);
        for (x, w) in out.iter_mut().zip(&self.bent) {
            *x = bend(*x, *w);
        }
        // From the last row on: each needs those before it as they were.
        for k in (0..x.len()).rev() {
            if !self.mixed.is_empty() {
                let row = &self.mixed[k * k.saturating_sub(1) / 2..][..k];
                let before: f64 = row.iter().zip(&*out).map(|(mix, x)| mix * x).sum();
                out[k] += before;
            }
            out[k] /= self.lengths[k];
        }
    }

    /// Log of its density before any sample, without its constant.
    pub(crate) fn ln_prior(&self) -> f64 {
        let of =
            |values: &[f64], sd: f64| -0.5 * values.iter().map(|v| (v / sd).powi(2)).sum::<f64>();
        of(&self.mixed, MIXED) + of(&self.bent, BENT)
    }

    /// Slopes, by the logarithms of the lengths, the mixes and the bends, of that log density plus something that has these slopes by the
    /// coordinates which distances of points are measured in, row by row.
    pub(super) fn slopes(&self, points: &[f64], by_measured: &[f64]) -> Self {
        let d = self.lengths.len();
        let prior = |values: &[f64], sd: f64| values.iter().map(|v| -v / (sd * sd)).collect();
        let (mixed, bent) = (prior(&self.mixed, MIXED), prior(&self.bent, BENT));
        let mut slopes = Self { lengths: vec![0.0; d], mixed, bent };
        let mut bent = vec![0.0; d];
        for (x, by) in points.chunks_exact(d).zip(by_measured.chunks_exact(d)) {
            bent.copy_from_slice(x);
            bent.iter_mut().zip(&self.bent).for_each(|(x, w)| *x = bend(*x, *w));
            // Of every bent coordinate, by those that it is mixed into.
            let mut by_bent = vec![0.0; d];
            for k in 0..d {
                let by = by[k] / self.lengths[k];
                let mut measured = bent[k];
                by_bent[k] += by;
                if !self.mixed.is_empty() {
                    let at = k * k.saturating_sub(1) / 2;
                    for l in 0..k {
                        measured += self.mixed[at + l] * bent[l];
                        slopes.mixed[at + l] += by * bent[l];
                        by_bent[l] += by * self.mixed[at + l];
                    }
                }
                slopes.lengths[k] -= by * measured;
            }
            for (l, (s, w)) in slopes.bent.iter_mut().zip(&self.bent).enumerate() {
                *s += by_bent[l] * bend_slope(x[l], *w);
            }
        }
        slopes
    }
}

fn bend(x: f64, w: f64) -> f64 {
    if w.abs() < 1e-6 { x } else { 2.0 * (0.5 * w * (x + 1.0)).exp_m1() / w.exp_m1() - 1.0 }
}

/// Slope of [`bend`] by w.
fn bend_slope(x: f64, w: f64) -> f64 {
    let at = 0.5 * (x + 1.0);
    if w.abs() < 1e-4 {
        return at * (at - 1.0);
    }
    let (part, whole) = ((at * w).exp_m1(), w.exp_m1());
    2.0 * (at * (part + 1.0) - part * (whole + 1.0) / whole) / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_a_triangular_matrix_after_each_coordinate_is_bent() {
        let metric = Metric {
            lengths: vec![0.5, 2.0, 4.0],
            mixed: vec![0.3, -0.2, 0.7],
            bent: vec![1.5, 0.0, -2.0],
        };
        let mut ends = [0.0; 3];
        for end in [-1.0, 1.0] {
            metric.of(&[end; 3], &mut ends);
            let exact = [end / 0.5, end * (0.3 + 1.0) / 2.0, end * (-0.2 + 0.7 + 1.0) / 4.0];
            assert!(ends.iter().zip(exact).all(|(x, exact)| (x - exact).abs() < 1e-12), "{ends:?}");
        }
        // In the middle of the cube: 2/(exp(w/2) + 1) - 1.
        let bent = [1.5_f64, -2.0].map(|w| 2.0 / ((0.5 * w).exp() + 1.0) - 1.0);
        metric.of(&[0.0; 3], &mut ends);
        let exact = [bent[0] / 0.5, 0.3 * bent[0] / 2.0, (-0.2 * bent[0] + bent[1]) / 4.0];
        assert!(ends.iter().zip(exact).all(|(x, exact)| (x - exact).abs() < 1e-12), "{ends:?}");
        let exact = -0.5 * (0.09 + 0.04 + 0.49) - 0.5 * (1.0 + 16.0 / 9.0);
        assert!((metric.ln_prior() - exact).abs() < 1e-12, "{}", metric.ln_prior());
    }

    #[test]
    fn no_bend_is_the_limit_of_a_small_one() {
        for x in [-1.0, -0.3, 0.5, 1.0] {
            for w in [-1e-5, -1e-7, 0.0, 1e-7, 1e-5] {
                assert!((bend(x, w) - x).abs() < 1e-5, "{x} {w}");
                assert!((bend_slope(x, w) - 0.25 * (x * x - 1.0)).abs() < 1e-4, "{x} {w}");
            }
        }
    }
}
