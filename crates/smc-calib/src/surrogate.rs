//! A cheap stand-in for the log likelihood: around each of some simulated samples a quadratic, fitted to its
//! nearest neighbours, and between them a blend of the quadratics of the nearest ones (modified Shepard's method:
//! R. Franke, G. Nielson, Int. J. Numer. Methods Eng. 15 (1980) 1691).
//!
//! Nothing depends on its being right: it serves as a control variate ([`crate::control`]), whose error only
//! sets how much of the Monte Carlo error is taken away.

use crate::cholesky::{cholesky, packed_inverse, rows_of, solve};
use crate::neighbours::{MOST_DIMENSIONS, Neighbours};
use crate::sobol::evenly;
use rayon::prelude::*;

/// Most parameters.
pub(crate) const MOST_PARAMETERS: usize = 12;
/// Most fits where there are more than [`MOST_DIMENSIONS`] parameters: a sample has no near neighbours there, and fits of nearly
/// all samples are nearly alike.
const MOST_FITS: usize = 128;
/// Neighbours of each fit, per coefficient of the quadratic.
const NEIGHBOURS: usize = 3;
/// Largest root mean square residual of a fit.
const ROUGHEST: f64 = 1.0;
/// Largest excess of a fit over the largest of the values that it was made from.
const EXCESS: f64 = 0.1;
/// Samples whose quadratics are blended; the last one sets the distance at which weights reach zero.
const BLENDED: usize = 3;
/// Least squared distance that weights of the blend tell from zero.
const TOUCHING: f64 = 1e-280;
/// Local quadratics.
pub(crate) struct Surrogate {
    d: usize,
    /// Lower triangle, packed row by row, that takes z to where distances are measured.
    inverse: Vec<f64>,
    /// Where the fits are looked up: around all samples, or in many dimensions around those that have one.
    tree: Neighbours,
    places: Vec<f64>,
    /// Number of the fit around each of these places.
    slots: Vec<u32>,
    fits: Vec<Option<Quadratic>>,
    /// Squared distance beyond which no fit reaches: a point far from all samples, of which the defensive share of
    /// the prior has many, would have them all searched.
    reach2: f64,
    /// Coefficients of all fits, [`coefficients`] each.
    slopes: Vec<f64>,
}

/// Reach and bounds of one fit.
#[derive(Clone, Copy)]
struct Quadratic {
    /// Squared distance of the farthest neighbour; offsets are in units of its root.
    reach2: f64,
    /// Largest value to believe.
    highest: f64,
    /// Largest value above the log proposal to believe.
    highest_ratio: f64,
}

/// Number of coefficients of a quadratic.
pub(crate) fn coefficients(d: usize) -> usize {
    (d + 1) * (d + 2) / 2
}

/// 1, x_j, and x_i x_j for j not above i.
pub(crate) fn monomials(x: &[f64], out: &mut [f64]) {
    let d = x.len();
    out[0] = 1.0;
    out[1..=d].copy_from_slice(x);
    let mut at = 1 + d;
    for i in 0..d {
        for j in 0..=i {
            out[at] = x[i] * x[j];
            at += 1;
        }
    }
}

impl Surrogate {
    /// From samples (row by row), their finite log likelihoods, the log of proposal over prior there, and which of them
    /// get a fit of their own; distances are measured with the Cholesky factor of a covariance. None with fewer samples
    /// than a fit takes.
    pub(crate) fn new(
        z: &[f64],
        ln_l: &[f64],
        ln_q: &[f64],
        fitted: &[bool],
        factor: &[f64],
    ) -> Option<Self> {
        let d = z.len().checked_div(ln_l.len())?;
        let p = coefficients(d);
        let count = NEIGHBOURS * p;
        if d > MOST_PARAMETERS || ln_l.len() < count {
            return None;
        }
        let inverse = packed_inverse(factor, d);
        let mut places = vec![0.0; z.len()];
        for (z, x) in z.chunks_exact(d).zip(places.chunks_exact_mut(d)) {
            whiten(z, &inverse, x);
        }
        let tree = Neighbours::new(&places, d);
        let samples = Samples { d, places: &places, ln_l };
        // In the order of the tree, so that one fit finds in the cache what the last one has read.
        let centres = centres(d, fitted, tree.order());
        let mut slopes = vec![0.0; centres.len() * p];
        let fits: Vec<Option<Quadratic>> = slopes
            .par_chunks_mut(p)
            .zip(&centres)
            .with_min_len(64)
            .map_init(
                || (Vec::new(), Workspace::new(p)),
                |(found, space), (slopes, i)| {
                    if !fitted[*i] {
                        return None;
                    }
                    tree.nearest(&places[i * d..(i + 1) * d], count, f64::INFINITY, found);
                    let mut fit = quadratic(samples, *i, found, space, slopes)?;
                    let ratios = found.iter().map(|(_, k)| ln_l[*k as usize] - ln_q[*k as usize]);
                    fit.highest_ratio = ratios.fold(f64::NEG_INFINITY, f64::max) + EXCESS;
                    Some(fit)
                },
            )
            .collect();
        let reach2 = fits.iter().flatten().map(|fit| fit.reach2).fold(0.0, f64::max);
        let mut slots = vec![0; centres.len()];
        let (tree, places) = if d > MOST_DIMENSIONS {
            slots.iter_mut().zip(0..).for_each(|(slot, k)| *slot = k);
            let own = rows_of(&places, d, &centres);
            (Neighbours::new(&own, d), own)
        } else {
            centres.iter().zip(0..).for_each(|(i, k)| slots[*i] = k);
            (tree, places)
        };
        Some(Self { d, inverse, tree, places, slots, fits, reach2, slopes })
    }

    /// Log of likelihood over `exp(ln_q)` at z, where `ln_q` is the log of proposal over prior: blended of the fits of
    /// the nearest samples; none where they have none or are too far.
    pub(crate) fn ln_ratio(
        &self,
        z: &[f64],
        ln_q: f64,
        found: &mut Vec<(f64, u32)>,
    ) -> Option<f64> {
        let d = self.d;
        let mut x = [0.0; MOST_PARAMETERS];
        let x = &mut x[..d];
        whiten(z, &self.inverse, x);
        self.tree.nearest(x, BLENDED, self.reach2, found);
        let far = match found.get(BLENDED - 1) {
            Some((square, _)) => square.max(TOUCHING),
            None => self.reach2,
        };
        let (mut sum, mut total) = (0.0, 0.0);
        for (square, i) in &*found {
            let i = *i as usize;
            let slot = self.slots[i] as usize;
            let Some(fit) = self.fits[slot].filter(|fit| *square < fit.reach2) else { continue };
            let ln_l = self.value(i, slot, &fit, x).min(fit.highest);
            let weight = (1.0 - square / far).powi(2).max(1e-8) / square.max(TOUCHING);
            sum += weight * (ln_l - ln_q).min(fit.highest_ratio);
            total += weight;
        }
        (total > 0.0).then(|| sum / total)
    }

    /// The quadratic about place i, the fit of some slot, at whitened coordinates.
    fn value(&self, i: usize, slot: usize, fit: &Quadratic, at: &[f64]) -> f64 {
        let d = self.d;
        let scale = 1.0 / fit.reach2.sqrt();
        let mut x = [0.0; MOST_PARAMETERS];
        for ((x, at), place) in x.iter_mut().zip(at).zip(&self.places[i * d..]) {
            *x = (at - place) * scale;
        }
        let p = coefficients(d);
        let slopes = &self.slopes[slot * p..(slot + 1) * p];
        let mut sum = slopes[0];
        let mut at = 1 + d;
        for i in 0..d {
            let mut slope = slopes[1 + i];
            for x in &x[..=i] {
                slope += slopes[at] * x;
                at += 1;
            }
            sum += slope * x[i];
        }
        sum
    }
}

/// The samples that fits are looked up around, in the order of the tree: all, or in many dimensions some of the fitted ones,
/// evenly among them.
fn centres(d: usize, fitted: &[bool], order: &[u32]) -> Vec<usize> {
    let all = order.iter().map(|i| *i as usize);
    if d <= MOST_DIMENSIONS {
        return all.collect();
    }
    let all: Vec<usize> = all.filter(|i| fitted[*i]).collect();
    let count = all.len().min(MOST_FITS);
    evenly(all.len(), count).map(|k| all[k]).collect()
}

fn whiten(z: &[f64], inverse: &[f64], x: &mut [f64]) {
    let mut row = 0;
    for i in 0..z.len() {
        x[i] = inverse[row..].iter().zip(&z[..=i]).map(|(f, z)| f * z).sum();
        row += i + 1;
    }
}

/// Normal equations of one fit.
struct Workspace {
    left: Vec<f64>,
    right: Vec<f64>,
    row: Vec<f64>,
}

impl Workspace {
    fn new(p: usize) -> Self {
        Self { left: vec![0.0; p * p], right: vec![0.0; p], row: vec![0.0; p] }
    }
}

/// Whitened samples, row by row, and their log likelihoods.
#[derive(Clone, Copy)]
struct Samples<'a> {
    d: usize,
    places: &'a [f64],
    ln_l: &'a [f64],
}

/// Weighted least squares about sample i.
fn quadratic(
    Samples { d, places, ln_l }: Samples<'_>,
    i: usize,
    found: &[(f64, u32)],
    space: &mut Workspace,
    slopes: &mut [f64],
) -> Option<Quadratic> {
    let p = slopes.len();
    let (reach2, _) = *found.last()?;
    if reach2 <= 0.0 {
        return None;
    }
    let scale = 1.0 / reach2.sqrt();
    let Workspace { left, right, row } = space;
    left.fill(0.0);
    right.fill(0.0);
    let mut x = [0.0; MOST_PARAMETERS];
    // Values relative to the one in the middle, so that nothing cancels.
    let (mut highest, mut total, mut squares) = (0.0f64, 0.0, 0.0);
    for (square, k) in found {
        let k = *k as usize;
        for ((x, there), here) in
            x.iter_mut().zip(&places[k * d..(k + 1) * d]).zip(&places[i * d..])
        {
            *x = (there - here) * scale;
        }
        monomials(&x[..d], row);
        // Nearer ones count more; the farthest still counts.
        let weight = (1.02 - square / reach2).powi(2);
        let y = ln_l[k] - ln_l[i];
        for a in 0..p {
            let w = weight * row[a];
            for b in 0..=a {
                left[a * p + b] += w * row[b];
            }
            right[a] += w * y;
        }
        total += weight;
        squares += weight * y * y;
        highest = highest.max(y);
    }
    for a in 0..p {
        left[a * p + a] += 1e-9 * total;
    }
    let factor = cholesky(left, p)?;
    slopes.copy_from_slice(&solve(&factor, right));
    // Least squares: what is explained is the inner product of solution and right side.
    let explained: f64 = slopes.iter().zip(right.iter()).map(|(s, r)| s * r).sum();
    if squares - explained > ROUGHEST * ROUGHEST * total {
        return None;
    }
    slopes[0] += ln_l[i];
    let highest = ln_l[i] + highest + EXCESS;
    Some(Quadratic { reach2, highest, highest_ratio: f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a scrambled net over the square of side 2 about the origin.
    fn points(n: usize) -> Vec<f64> {
        let mut rng = crate::stream::stream(5, crate::stream::Purpose::Draws, 0, 0);
        crate::sobol::scrambled_net(2, n, &mut rng).iter().map(|u| 2.0 * u - 1.0).collect()
    }

    fn built(n: usize, f: impl Fn(f64, f64) -> f64) -> Surrogate {
        let z = points(n);
        let ln_l: Vec<f64> = z.chunks_exact(2).map(|z| f(z[0], z[1])).collect();
        Surrogate::new(&z, &ln_l, &vec![0.0; n], &vec![true; n], &[0.5, 0.0, 0.1, 0.3])
            .expect("enough samples")
    }

    #[test]
    fn a_quadratic_is_reproduced() {
        let f = |x: f64, y: f64| 3.0 - 2.0 * x + 0.5 * y - 4.0 * x * x + x * y - 7.0 * y * y;
        let surrogate = built(256, f);
        for z in [[0.1, 0.2], [-0.5, 0.4], [0.33, -0.61]] {
            let found = surrogate.ln_ratio(&z, 0.0, &mut Vec::new()).expect("near samples");
            assert!((found - f(z[0], z[1])).abs() < 1e-5, "{z:?}: {found}");
        }
        assert!(surrogate.ln_ratio(&[4.0, 4.0], 0.0, &mut Vec::new()).is_none());
    }

    #[test]
    fn the_error_falls_with_the_third_power_of_the_distance() {
        let f = |x: f64, y: f64| (2.0 * x + y).sin() + x * (3.0 * y).cos();
        let error = |n: usize| {
            let surrogate = built(n, f);
            let squares: f64 = (0..400)
                .map(|i| [0.8 * f64::from(i).sin(), 0.8 * (1.7 * f64::from(i)).cos()])
                .map(|z| {
                    let found = surrogate.ln_ratio(&z, 0.0, &mut Vec::new()).expect("near samples");
                    (found - f(z[0], z[1])).powi(2)
                })
                .sum();
            (squares / 400.0).sqrt()
        };
        // 16 times the samples: distances a quarter, errors 4^-3.
        let (coarse, fine) = (error(512), error(8192));
        let order = (coarse / fine).ln() / 4f64.ln();
        assert!((2.6..3.6).contains(&order), "order {order}: {coarse:e} {fine:e}");
    }

    #[test]
    fn the_surrogate_does_not_jump_between_samples_though_the_function_has_kinks() {
        let f = |x: f64, y: f64| -4.0 * (x - 0.3 * y).abs() - y * y;
        let surrogate = built(512, f);
        let at = |i: usize| {
            let z = [-0.6 + 6e-5 * i as f64, 0.2 - 2e-5 * i as f64];
            surrogate.ln_ratio(&z, 0.0, &mut Vec::new()).expect("near samples")
        };
        let largest = (0..20_000).map(|i| (at(i + 1) - at(i)).abs()).fold(0.0, f64::max);
        // One fit alone jumps by its error at the kink, 0.1 and more, where the nearest sample changes.
        assert!(largest < 5e-3, "{largest}");
    }

    #[test]
    fn values_stay_below_the_largest_of_those_that_they_were_made_from() {
        // The curvature at the edge of the samples points upwards; the ratio to the proposal is bounded as well.
        let z = points(256);
        let ln_l: Vec<f64> = z.chunks_exact(2).map(|z| 5.0 * z[0].powi(2) + z[1]).collect();
        let ln_q: Vec<f64> = z.chunks_exact(2).map(|z| 5.0 * z[0].powi(2)).collect();
        let factor = [0.5, 0.0, 0.1, 0.3];
        let surrogate =
            Surrogate::new(&z, &ln_l, &ln_q, &[true; 256], &factor).expect("enough samples");
        for i in 0..100 {
            let z = [1.0 + 0.002 * f64::from(i), 0.3];
            let Some(ratio) = surrogate.ln_ratio(&z, 0.0, &mut Vec::new()) else { continue };
            assert!(ratio <= 1.0 + EXCESS, "{z:?}: {ratio}");
        }
    }
}
