//! Gaussian mixtures fitted to weighted samples by MAP-EM; the number of components by BIC.
//!
//! Everything happens in the whitened coordinates of a [`Cloud`], so that shrinkage and floors are relative to the spread
//! of what is fitted.

use crate::cholesky::{add_multiple, cholesky, packed_inverse};
use crate::cloud::{Cloud, Gaussian};
use crate::lanes::{LANES, exp_of_nonpositive, ln_of_positive, minus, plus, times, wide};
use crate::stream::{Purpose, stream};
use rand::RngExt;
use rayon::prelude::*;

/// Most EM iterations per fit.
const MAX_ITERATIONS: usize = 40;
/// EM ends when the mean log density rises by less than this in one iteration.
const TOLERANCE: f64 = 1e-3;
/// Variance that covariances are shrunk towards, as a share of that of a K-th of the cloud. Small: the cloud of a
/// heavy-tailed target is far wider than its core, and a full share fattens the core's component until a
/// narrow posterior is missed (PEEK at 4096 simulations: error of the means 0.52 posterior sd with 1, 0.007 with 0.01).
const SHRINK: f64 = 0.01;
/// Least variance of a component, as a share of the pooled variance.
const VARIANCE_FLOOR: f64 = 1e-7;

/// A fitted mixture and the work it took.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub components: Vec<Gaussian>,
    pub em_iterations: usize,
    pub mixtures: usize,
}

impl Cloud {
    /// The mixture with the best BIC among one to `max_components` components.
    pub(crate) fn fit(&self, max_components: usize, seed: u64, stage: usize) -> Fit {
        let parameters = |k: usize| (k - 1 + k * self.d + k * self.d * (self.d + 1) / 2) as f64;
        let most = max_components.min(self.weights.len()).max(1);
        let (mut em_iterations, mut mixtures) = (0, 0);
        let mut best: Option<(f64, Mixture)> = None;
        let mut worse = 0;
        let mut k = 1;
        // Two sizes at a time, one for each of two threads; the order of the decisions is fixed.
        while k <= most && worse < 2 {
            let pair: Vec<(usize, Mixture, f64, usize)> = (k..=(k + 1).min(most))
                .into_par_iter()
                .map(|k| {
                    let (mixture, ln, iterations) = self.em(self.start(k, seed, stage));
                    (k, mixture, ln, iterations)
                })
                .collect();
            for (k, mixture, ln, iterations) in pair {
                em_iterations += iterations;
                mixtures += 1;
                let bic = -2.0 * self.ess * ln + parameters(k) * self.ess.max(1.0).ln();
                match &best {
                    Some((b, _)) if bic >= *b => worse += 1,
                    _ => {
                        worse = 0;
                        best = Some((bic, mixture));
                    }
                }
            }
            k += 2;
        }
        let components = best.map_or_else(Vec::new, |(_, m)| {
            let parts = m.weights.iter().zip(m.means.chunks_exact(self.d));
            let parts = parts.zip(m.factors.chunks_exact(self.d * self.d));
            parts.map(|((weight, mean), factor)| self.unwhiten(*weight, mean, factor)).collect()
        });
        Fit { components, em_iterations, mixtures }
    }

    /// K-means++ start: centres drawn in proportion to weight times squared distance, then a few Lloyd steps.
    fn start(&self, k: usize, seed: u64, stage: usize) -> Mixture {
        let (d, n) = (self.d, self.weights.len());
        let mut rng = stream(seed, Purpose::MixtureStart, stage, k);
        let mut centres: Vec<f64> = Vec::with_capacity(k * d);
        let mut nearest = vec![f64::INFINITY; n];
        let point = |i: usize| &self.points[i * d..(i + 1) * d];
        let square =
            |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        for c in 0..k {
            let mass =
                |i: usize, nearest: &[f64]| self.weights[i] * if c == 0 { 1.0 } else { nearest[i] };
            let total: f64 = (0..n).map(|i| mass(i, &nearest)).sum();
            let mut target = rng.random::<f64>() * total;
            let mut chosen = 0;
            for i in 0..n {
                let m = mass(i, &nearest);
                if m > 0.0 {
                    chosen = i;
                    if target < m {
                        break;
                    }
                    target -= m;
                }
            }
            centres.extend_from_slice(point(chosen));
            for i in 0..n {
                nearest[i] = nearest[i].min(square(point(i), point(chosen)));
            }
        }
        let mut assigned = vec![0usize; n];
        for _ in 0..5 {
            for (i, a) in assigned.iter_mut().enumerate() {
                let mut least = f64::INFINITY;
                for c in 0..k {
                    let m = square(point(i), &centres[c * d..(c + 1) * d]);
                    if m < least {
                        (least, *a) = (m, c);
                    }
                }
            }
            let mut sums = vec![0.0; k * (d + 1)];
            for i in 0..n {
                let row = &mut sums[assigned[i] * (d + 1)..(assigned[i] + 1) * (d + 1)];
                add_multiple(&mut row[..d], self.weights[i], point(i));
                row[d] += self.weights[i];
            }
            for c in 0..k {
                let mass = sums[c * (d + 1) + d];
                if mass > 0.0 {
                    for j in 0..d {
                        centres[c * d + j] = sums[c * (d + 1) + j] / mass;
                    }
                }
            }
        }
        let mut shares = vec![0.0; self.padded() * k];
        for i in 0..n {
            shares[(i / LANES * k + assigned[i]) * LANES + i % LANES] = self.weights[i];
        }
        let mut mixture = Mixture {
            k,
            weights: vec![1.0 / k as f64; k],
            means: centres,
            factors: vec![0.0; k * d * d],
        };
        for c in 0..k {
            for j in 0..d {
                mixture.factors[c * d * d + j * d + j] = 1.0;
            }
        }
        self.maximise(&mut mixture, &shares);
        mixture
    }

    /// EM to convergence; mean log density per unit weight and the number of iterations.
    fn em(&self, mut mixture: Mixture) -> (Mixture, f64, usize) {
        let mut shares = vec![0.0; self.padded() * mixture.k];
        let mut last = f64::NEG_INFINITY;
        for iteration in 1..=MAX_ITERATIONS {
            let ln = self.expect(&mixture, &mut shares);
            if mixture.k == 1 || ln - last < TOLERANCE || iteration == MAX_ITERATIONS {
                return (mixture, ln, iteration);
            }
            last = ln;
            self.maximise(&mut mixture, &shares);
        }
        (mixture, last, MAX_ITERATIONS)
    }

    /// Number of points with those of weight zero that fill the last block.
    fn padded(&self) -> usize {
        self.lane_weights.len()
    }

    /// Weight times responsibility of each component, block of points by block of points, component by component
    /// within; the mean log density.
    fn expect(&self, mixture: &Mixture, shares: &mut [f64]) -> f64 {
        wide(
            #[inline(always)]
            || match self.d {
                1 => self.expect_of::<1>(mixture, shares),
                2 => self.expect_of::<2>(mixture, shares),
                3 => self.expect_of::<3>(mixture, shares),
                4 => self.expect_of::<4>(mixture, shares),
                _ => self.expect_of::<0>(mixture, shares),
            },
        )
    }

    /// D is the dimension where it is known at compile time, else 0.
    #[inline(always)]
    fn expect_of<const D: usize>(&self, mixture: &Mixture, shares: &mut [f64]) -> f64 {
        let d = if D > 0 { D } else { self.d };
        let k = mixture.k;
        // Per component: constant, mean, packed inverse factor.
        let packed = d * (d + 1) / 2;
        let width = 1 + d + packed;
        let mut table = Vec::with_capacity(k * width);
        for c in 0..k {
            let factor = &mixture.factors[c * d * d..(c + 1) * d * d];
            let ln_det: f64 = (0..d).map(|j| factor[j * d + j].ln()).sum();
            table.push(mixture.weights[c].ln() - ln_det - d as f64 * crate::normal::LN_SQRT_2PI);
            table.extend_from_slice(&mixture.means[c * d..(c + 1) * d]);
            table.extend(packed_inverse(factor, d));
        }
        let mut mean = [0.0; LANES];
        for ((x, w), block) in self
            .lanes
            .chunks_exact(d * LANES)
            .zip(self.lane_weights.as_chunks::<LANES>().0)
            .zip(shares.chunks_exact_mut(k * LANES))
        {
            let mut largest = [f64::NEG_INFINITY; LANES];
            for (row, out) in table.chunks_exact(width).zip(block.as_chunks_mut::<LANES>().0) {
                let (centre, inverse) = (&row[1..1 + d], &row[1 + d..]);
                let mut squares = [0.0; LANES];
                let mut at = 0;
                for i in 0..d {
                    let mut u = [0.0; LANES];
                    for j in 0..=i {
                        let (f, m) = (inverse[at], centre[j]);
                        for l in 0..LANES {
                            u[l] += f * (x[j * LANES + l] - m);
                        }
                        at += 1;
                    }
                    for l in 0..LANES {
                        squares[l] += u[l] * u[l];
                    }
                }
                for l in 0..LANES {
                    out[l] = row[0] - 0.5 * squares[l];
                    largest[l] = if out[l] > largest[l] { out[l] } else { largest[l] };
                }
            }
            let mut sum = [0.0; LANES];
            for out in block.as_chunks_mut::<LANES>().0 {
                for l in 0..LANES {
                    out[l] = exp_of_nonpositive(out[l] - largest[l]);
                    sum[l] += out[l];
                }
            }
            let mut scale = [0.0; LANES];
            for l in 0..LANES {
                scale[l] = w[l] / sum[l];
                mean[l] += w[l] * (largest[l] + ln_of_positive(sum[l]));
            }
            for out in block.as_chunks_mut::<LANES>().0 {
                for l in 0..LANES {
                    out[l] *= scale[l];
                }
            }
        }
        mean.iter().sum()
    }

    /// Weights, means and covariances from the components' shares, covariances shrunk towards a K-th of the cloud.
    fn maximise(&self, mixture: &mut Mixture, shares: &[f64]) {
        wide(
            #[inline(always)]
            || match self.d {
                1 => self.maximise_of::<1>(mixture, shares),
                2 => self.maximise_of::<2>(mixture, shares),
                3 => self.maximise_of::<3>(mixture, shares),
                4 => self.maximise_of::<4>(mixture, shares),
                _ => self.maximise_of::<0>(mixture, shares),
            },
        );
    }

    #[inline(always)]
    fn maximise_of<const D: usize>(&self, mixture: &mut Mixture, shares: &[f64]) {
        let d = if D > 0 { D } else { self.d };
        let k = mixture.k;
        let pull = d as f64 + 2.0;
        let target = (k as f64).powf(-2.0 / d as f64);
        let packed = d * (d + 1) / 2;
        // Moments about the previous centres, so that nothing cancels.
        let width = 1 + d + packed;
        let mut sums = vec![[0.0; LANES]; k * width];
        let mut offset = vec![[0.0; LANES]; d];
        let points = self.lanes.as_chunks::<LANES>().0.chunks_exact(d);
        for (x, block) in points.zip(shares.as_chunks::<LANES>().0.chunks_exact(k)) {
            for (c, r) in block.iter().enumerate() {
                let m = &mixture.means[c * d..(c + 1) * d];
                let s = &mut sums[c * width..(c + 1) * width];
                s[0] = plus(&s[0], r);
                for i in 0..d {
                    offset[i] = minus(&x[i], &[m[i]; LANES]);
                }
                let mut at = 1 + d;
                for i in 0..d {
                    let u = times(r, &offset[i]);
                    s[1 + i] = plus(&s[1 + i], &u);
                    for other in &offset[..=i] {
                        s[at] = plus(&s[at], &times(&u, other));
                        at += 1;
                    }
                }
            }
        }
        let sums: Vec<f64> = sums.iter().map(|lanes| lanes.iter().sum()).collect();
        for c in 0..k {
            let s = &sums[c * width..(c + 1) * width];
            let mass = s[0];
            let samples = mass * self.ess;
            // A sample's worth of weight for every component: none dies, none has weight zero.
            mixture.weights[c] = (samples + 0.1) / (self.ess + 0.1 * k as f64);
            if mass <= 1e-12 {
                continue;
            }
            let shift: Vec<f64> = (0..d).map(|i| s[1 + i] / mass).collect();
            let mut cov = vec![0.0; d * d];
            let mut at = 1 + d;
            for i in 0..d {
                for j in 0..=i {
                    let v = (s[at] / mass - shift[i] * shift[j]) * samples / (samples + pull);
                    cov[i * d + j] = v;
                    cov[j * d + i] = v;
                    at += 1;
                }
                cov[i * d + i] += target * pull / (samples + pull) * SHRINK + VARIANCE_FLOOR;
            }
            for i in 0..d {
                mixture.means[c * d + i] += shift[i];
            }
            if let Some(factor) = cholesky(&cov, d) {
                mixture.factors[c * d * d..(c + 1) * d * d].copy_from_slice(&factor);
            }
        }
    }
}

/// A mixture in whitened coordinates.
#[derive(Clone, Debug)]
struct Mixture {
    k: usize,
    weights: Vec<f64>,
    means: Vec<f64>,
    factors: Vec<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound(fit: &Fit, d: usize) {
        assert!(!fit.components.is_empty());
        let total: f64 = fit.components.iter().map(|g| g.weight).sum();
        assert!((total - 1.0).abs() < 1e-9, "{total}");
        for g in &fit.components {
            assert!(g.weight > 0.0 && g.mean.iter().all(|m| m.is_finite()));
            assert!(
                (0..d).all(|i| g.factor[i * d + i] > 0.0) && g.factor.iter().all(|f| f.is_finite())
            );
        }
    }

    #[test]
    fn degenerate_clouds_still_give_positive_definite_components() {
        let n = 40;
        let spread: Vec<f64> = (0..n * 2).map(|i| ((i * i) as f64 * 0.7).sin()).collect();
        let mut one = vec![0.0; n];
        one[7] = 1.0;
        let duplicates = [0.3, -0.2].repeat(n);
        let collinear: Vec<f64> = (0..n).flat_map(|i| [i as f64, 2.0 * i as f64 + 1.0]).collect();
        let equal = vec![1.0; n];
        for (points, weights) in
            [(&spread, &one), (&duplicates, &equal), (&collinear, &equal), (&spread, &equal)]
        {
            let cloud = Cloud::new(2, points, weights, 1, 0).expect("has weight");
            sound(&cloud.fit(8, 1, 0), 2);
        }
        // Fewer samples than components.
        let cloud = Cloud::new(2, &spread[..6], &[1.0; 3], 1, 0).expect("has weight");
        let fit = cloud.fit(8, 1, 0);
        assert!(fit.components.len() <= 3);
        sound(&fit, 2);
        assert!(Cloud::new(2, &spread, &vec![0.0; n], 1, 0).is_none());
    }

    #[test]
    fn two_separate_clusters_become_two_components_at_their_places() {
        let n = 300;
        let mut rng = stream(4, Purpose::Draws, 0, 0);
        let points: Vec<f64> = (0..n)
            .flat_map(|i| {
                let centre = if i % 3 == 0 { -3.0 } else { 2.0 };
                let mut normal =
                    || crate::normal::quantile(rng.random::<f64>().clamp(1e-9, 1.0 - 1e-9));
                [centre + 0.5 * normal(), 0.5 * normal()]
            })
            .collect();
        let mut fit = Cloud::new(2, &points, &vec![1.0; n], 1, 0)
            .expect("has weight")
            .fit(8, 1, 0)
            .components;
        fit.sort_by(|a, b| a.mean[0].total_cmp(&b.mean[0]));
        assert_eq!(fit.len(), 2);
        assert!((fit[0].mean[0] + 3.0).abs() < 0.15 && (fit[1].mean[0] - 2.0).abs() < 0.15);
        assert!((fit[0].weight - 1.0 / 3.0).abs() < 0.02);
        assert!((fit[0].factor[0] - 0.5).abs() < 0.08, "{:?}", fit[0].factor);
    }
}
