//! The control variate: a surrogate of the likelihood over the proposal, its integrals, and what is measured of it.

use crate::cholesky::{cholesky, gram, packed_inverse};
use crate::estimate::Axis;
use crate::mixture::Proposal;
use crate::normal::ln_prior;
use crate::pool::Pool;
use crate::sampler::Sampler;
use crate::small_budget::{Edge, StandIn};
use crate::surrogate::{MOST_PARAMETERS, Surrogate, coefficients, monomials};
use rayon::prelude::*;
use std::sync::Arc;

/// Samples with a log posterior density this far below the best have no part in the surrogate.
const DEPTH: f64 = 16.0;
/// Largest g/q, in units of the mean of f/q: a g above it is wrong more often than right.
const CAP: f64 = 3.0;

/// Centre and scale of every coordinate, and levels below which shares are integrated, if any.
pub(super) struct Standard {
    mean: Vec<f64>,
    sd: Vec<f64>,
    levels: Vec<Vec<f64>>,
}

impl Standard {
    fn of(d: usize, x: &[f64], weights: &[f64], levels: Vec<Vec<f64>>) -> Self {
        let total: f64 = weights.iter().sum();
        let mut standard = Self { mean: vec![0.0; d], sd: vec![0.0; d], levels };
        for (w, x) in weights.iter().zip(x.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
            for (m, x) in standard.mean.iter_mut().zip(x) {
                *m += w / total * x;
            }
        }
        for (w, x) in weights.iter().zip(x.chunks_exact(d)).filter(|(w, _)| **w > 0.0) {
            for ((s, m), x) in standard.sd.iter_mut().zip(&standard.mean).zip(x) {
                *s += w / total * (x - m).powi(2);
            }
        }
        standard.sd.iter_mut().for_each(|s| *s = s.sqrt().max(f64::MIN_POSITIVE));
        standard
    }

    /// With the ranges of the coordinates.
    pub(super) fn axes(&self, range: impl Fn(usize) -> [f64; 2]) -> Vec<Axis> {
        let each = self.mean.iter().zip(&self.sd).enumerate();
        each.map(|(j, (mean, sd))| Axis { mean: *mean, sd: *sd, range: range(j) }).collect()
    }

    /// Number of the phi.
    pub(super) fn count(&self) -> usize {
        coefficients(self.mean.len()) + self.levels.iter().map(Vec::len).sum::<usize>()
    }

    /// The levels.
    pub(super) fn into_levels(self) -> Vec<Vec<f64>> {
        self.levels
    }

    /// 1, x_j and x_i x_j of the coordinates of z, and for every level 1 where its coordinate is not above it, else 0.
    pub(super) fn features_at(
        &self,
        z: &[f64],
        coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
        out: &mut [f64],
    ) {
        self.features(z.iter().enumerate().map(|(j, z)| coordinate(j, *z)), out);
    }

    fn features(&self, x: impl Iterator<Item = f64>, out: &mut [f64]) {
        let mut standard = [0.0; MOST_PARAMETERS];
        let d = self.mean.len();
        let (moments, mut below) = out.split_at_mut(coefficients(d));
        for (j, x) in x.enumerate().take(d) {
            standard[j] = (x - self.mean[j]) / self.sd[j];
            if let Some(levels) = self.levels.get(j) {
                let (own, rest) = below.split_at_mut(levels.len());
                own.iter_mut().zip(levels).for_each(|(b, l)| *b = f64::from(u8::from(x <= *l)));
                below = rest;
            }
        }
        monomials(&standard[..d], moments);
    }
}

/// 1, x_j, and x_i x_j of all samples, and whether x is below these levels, row by row, and what x is measured in.
pub(super) fn features(
    pool: &Pool,
    weights: &[f64],
    coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
    levels: Vec<Vec<f64>>,
) -> (Standard, Vec<f64>) {
    let d = pool.d;
    // Failed samples too: f is zero there, but g need not be.
    let x: Vec<f64> = (0..pool.len() * d)
        .into_par_iter()
        .with_min_len(256)
        .map(|i| coordinate(i % d, pool.z[i]))
        .collect();
    let standard = Standard::of(d, &x, weights, levels);
    let p = standard.count();
    let mut features = vec![0.0; pool.len() * p];
    features.par_chunks_mut(p).zip(x.par_chunks(d)).with_min_len(256).for_each(|(out, x)| {
        standard.features(x.iter().copied(), out);
    });
    (standard, features)
}

/// Largest g/q from the values of f/q: [`CAP`] times their mean, which of all samples, many of them far from the posterior,
/// is taken by weight.
pub(super) fn cap(values: impl ExactSizeIterator<Item = f64> + Clone, by_weight: bool) -> f64 {
    let n = values.len() as f64;
    let sum: f64 = values.clone().sum();
    if by_weight { CAP * values.map(|v| v * v).sum::<f64>() / sum } else { CAP * sum / n }
}

/// A surrogate of the likelihood.
pub(super) enum Model<'a> {
    Local(Box<Surrogate>),
    Process(Arc<StandIn<'a>>),
}

impl Model<'_> {
    /// Log of g over `exp(ln_q)` and the prior at z.
    fn ln_ratio(&self, z: &[f64], ln_q: f64, found: &mut Vec<(f64, u32)>) -> Option<f64> {
        match self {
            Self::Local(surrogate) => surrogate.ln_ratio(z, ln_q, found),
            Self::Process(process) => Some(process.ln_likelihood_at(z, Edge::KNOWN) - ln_q),
        }
    }
}

/// g/q from its logarithm, up to its largest value; zero where that is not a number.
pub(super) fn capped(ln_ratio: f64, cap: f64) -> f64 {
    let ratio = ln_ratio.exp();
    if ratio.is_nan() { 0.0 } else { ratio.min(cap) }
}

/// The control variate g/q over the scale of the weights.
pub(super) struct Variate<'a> {
    pub model: Model<'a>,
    pub ln_scale: f64,
    /// Its largest value.
    pub cap: f64,
}

impl Variate<'_> {
    /// At z, where `ln_q` is the log of proposal over prior.
    pub(super) fn at(&self, z: &[f64], ln_q: f64, found: &mut Vec<(f64, u32)>) -> f64 {
        let ratio = self.model.ln_ratio(z, ln_q, found);
        ratio.map_or(0.0, |ratio| capped(ratio - self.ln_scale, self.cap))
    }

    /// What `control` at z would be for simulations that never fail, as its sample there did or not: for local quadratics, which know
    /// nothing of failures, the control itself.
    pub(super) fn without_edge(&self, control: f64, z: &[f64], failed: bool) -> f64 {
        match &self.model {
            Model::Local(_) => control,
            Model::Process(_) if failed => 0.0,
            Model::Process(process) => {
                (control / process.ln_finished(z, Edge::KNOWN).exp()).min(self.cap)
            }
        }
    }

    /// Adds the integral of g phi by the points of a net, taken to the proposal.
    pub(super) fn integrate(
        &self,
        net: &[f64],
        proposal: &Proposal,
        standard: &Standard,
        coordinate: &(dyn Fn(usize, f64) -> f64 + Sync),
        sums: &mut [f64],
    ) {
        let width = proposal.uniforms();
        let points = (net.len() / width) as f64;
        let (mut z, mut row) = (vec![0.0; proposal.dimension], vec![0.0; sums.len()]);
        let mut found = Vec::new();
        for u in net.chunks_exact(width) {
            proposal.draw(u, &mut z);
            let g = self.at(&z, proposal.ln_over_prior(&z, ln_prior(&z)), &mut found);
            if g > 0.0 {
                standard.features_at(&z, coordinate, &mut row);
                sums.iter_mut().zip(&row).for_each(|(s, f)| *s += g * f / points);
            }
        }
    }
}

/// Factor of the covariance that distances are measured in: of the mean precision of the proposal's components, which
/// says how fast the posterior varies, not how wide it is (a bent or a split posterior is much wider).
pub(super) fn metric(proposal: &Proposal) -> Option<Vec<f64>> {
    let d = proposal.dimension;
    let mut precision = vec![0.0; d * d];
    for c in &proposal.components {
        let own = gram(&packed_inverse(&c.factor, d), d);
        precision.iter_mut().zip(own).for_each(|(p, own)| *p += c.weight * own);
    }
    cholesky(&gram(&packed_inverse(&cholesky(&precision, d)?, d), d), d)
}

/// The surrogate fitted to some samples of the pool.
pub(super) fn surrogate(
    sampler: &Sampler<'_>,
    known: &[usize],
    ln_q: &[f64],
    metric: &[f64],
) -> Option<Surrogate> {
    let pool = &sampler.pool;
    let density = |i: usize| pool.ln_l[i] + pool.ln_prior(i);
    let top = known.iter().map(|i| density(*i)).fold(f64::NEG_INFINITY, f64::max);
    let kept: Vec<usize> =
        known.iter().copied().filter(|i| density(*i) > top - 2.0 * DEPTH).collect();
    let z: Vec<f64> = kept.iter().flat_map(|i| pool.point(*i)).copied().collect();
    let of_kept = |all: &[f64]| -> Vec<f64> { kept.iter().map(|i| all[*i]).collect() };
    let fitted: Vec<bool> = kept.iter().map(|i| density(*i) > top - DEPTH).collect();
    Surrogate::new(&z, &of_kept(&pool.ln_l), &of_kept(ln_q), &fitted, metric)
}

/// Share of the variance of the target that a control variate leaves.
pub(super) fn left(target: &[f64], control: &[f64]) -> f64 {
    let variance = |values: &mut dyn Iterator<Item = f64>| {
        let (mut sum, mut squares, mut n) = (0.0, 0.0, 0.0);
        for v in values {
            (sum, squares, n) = (sum + v, squares + v * v, n + 1.0);
        }
        squares - sum * sum / n
    };
    let left = variance(&mut target.iter().zip(control).map(|(t, c)| t - c));
    left / variance(&mut target.iter().copied())
}

/// Of the variances of an integral by samples alone and with g, the share of the former in their sum up to which it is left to the
/// samples, and from which on it is taken with g; between them a part of it is. A g that is wrong where there are no samples differs
/// from sub-net to sub-net by the points that each of them has there.
pub(super) const SHARES: [f64; 2] = [0.4, 0.8];

/// The share of an integral that is taken with g, by the scatters of the sub-nets' values of it with g and by samples alone.
pub(super) fn share(known: f64, samples: f64) -> f64 {
    let best = if samples > 0.0 { samples / (known + samples) } else { 0.0 };
    ((best - SHARES[0]) / (SHARES[1] - SHARES[0])).clamp(0.0, 1.0)
}

/// Least share of a control that is used.
const LEAST_SHARE: f64 = 0.02;

/// Shares of all controls for each integral, whose terms are weighted by its own squares.
pub(super) fn stacked(
    controls: &[Vec<f64>],
    target: &[f64],
    squares: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let of_integral = |squares: &Vec<f64>| {
        let mut shares = least_squares_shares(controls, target, squares);
        shares.iter_mut().filter(|s| **s < LEAST_SHARE).for_each(|s| *s = 0.0);
        shares
    };
    squares.iter().map(of_integral).collect()
}

/// Shares c from 0 to 1 for which `target - sum of c_k controls_k` has the least sum of weighted squares, coordinate by
/// coordinate (V. Franc, V. Hlavac, M. Navara, Computer Analysis of Images and Patterns (2005) 407). Controls that are all but
/// alike take many steps to their own shares, and their sum few.
fn least_squares_shares(controls: &[Vec<f64>], target: &[f64], weights: &[f64]) -> Vec<f64> {
    const STEPS: usize = 2000;
    const CHANGED: f64 = 1e-9;
    let m = controls.len();
    let inner = |a: &[f64], b: &[f64]| -> f64 {
        a.iter().zip(b).zip(weights).map(|((a, b), w)| w * a * b).sum()
    };
    let right: Vec<f64> = controls.iter().map(|c| inner(c, target)).collect();
    let products: Vec<f64> =
        controls.iter().flat_map(|a| controls.iter().map(|b| inner(a, b))).collect();
    let mut shares = vec![0.0; m];
    for _ in 0..STEPS {
        let mut changed = 0.0f64;
        for k in 0..m {
            let row = &products[k * m..(k + 1) * m];
            if row[k] <= 0.0 {
                continue;
            }
            let explained: f64 = row.iter().zip(&shares).map(|(p, s)| p * s).sum();
            let next = shares[k] + (right[k] - explained) / row[k];
            // More than one of a control that is all but zero where it counts would be noise; what is not a number is none.
            let next = if next > 0.0 { next.min(1.0) } else { 0.0 };
            changed = changed.max((next - shares[k]).abs());
            shares[k] = next;
        }
        if changed < CHANGED {
            break;
        }
    }
    shares
}

/// Mean of the sub-nets' values of integral a, of p.
pub(super) fn mean(of_sub_nets: &[f64], p: usize, a: usize) -> f64 {
    of_sub_nets.iter().skip(a).step_by(p).sum::<f64>() / (of_sub_nets.len() / p) as f64
}

/// Sum of the squares of their deviations from it.
pub(super) fn scatter(of_sub_nets: &[f64], p: usize, a: usize) -> f64 {
    let mean = mean(of_sub_nets, p, a);
    of_sub_nets.iter().skip(a).step_by(p).map(|v| (v - mean).powi(2)).sum()
}

/// What the p integrals of every sub-net are off by as the mean of its two nets, row by row: half of their difference.
pub(super) fn off_by_nets(of_nets: &[f64], p: usize) -> Vec<f64> {
    let halves = |nets: &[f64]| -> Vec<f64> {
        nets[..p].iter().zip(&nets[p..]).map(|(one, other)| 0.5 * (one - other)).collect()
    };
    of_nets.chunks_exact(2 * p).flat_map(halves).collect()
}

/// Widens the spread of the sub-nets' values of each of p integrals by what it misses, for R > 2 sub-nets.
///
/// What an interpolating g leaves at a sample depends on where the next ones are: it is a sum of terms h of pairs of samples.
/// The sum over all samples has every pair twice, as h(i, j) and as h(j, i). Where these are equal its variance is twice that of
/// as many independent terms (W. Hoeffding, Ann. Math. Stat. 19 (1948) 293, section 5), and the spread of the sub-nets, which has
/// the mean of all taken out, shows (R - 2) / (R - 1) of the latter; where they are not equal it is less than twice.
///
/// Each net is drawn for itself, so that the spread shows the errors of the nets in full. Their part of the variance is told by
/// the differences of the two nets of each sub-net. Local quadratics take the mean of many samples and depend little on any pair.
pub(super) fn count_pairs_twice(of_sub_nets: &mut [f64], of_nets: &[f64], p: usize) {
    let r = (of_sub_nets.len() / p) as f64;
    let off = off_by_nets(of_nets, p);
    for a in 0..p {
        let of_net: f64 = off.iter().skip(a).step_by(p).map(|off| off * off).sum();
        let all = scatter(of_sub_nets, p, a);
        if all > 0.0 {
            // The mean is taken out of `all`, not of the differences.
            let pairs = (1.0 - (r - 1.0) / r * of_net / all).max(0.0);
            let widening = (1.0 + pairs * r / (r - 2.0)).sqrt();
            let mean = mean(of_sub_nets, p, a);
            let values = of_sub_nets.iter_mut().skip(a).step_by(p);
            values.for_each(|v| *v = mean + widening * (*v - mean));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, stream};
    use rand_distr::{Distribution as _, StandardNormal};

    /// Mean of the variance of the mean that R sub-nets state, over that of their mean: before the pairs are counted, and after.
    fn stated(r: usize, pairs: f64, nets: f64) -> [f64; 2] {
        const RUNS: usize = 40_000;
        let (mut squares, mut plain, mut counted) = (0.0, 0.0, 0.0);
        for run in 0..RUNS {
            let mut rng = stream(1, Purpose::Surrogate, 0, run);
            let mut normal = |scale: f64| {
                let x: f64 = StandardNormal.sample(&mut rng);
                scale * x
            };
            let x: Vec<f64> = (0..r).map(|_| normal(1.0)).collect();
            let of_nets: Vec<f64> = (0..2 * r).map(|_| normal(nets * 2.0_f64.sqrt())).collect();
            let sum: f64 = x.iter().sum();
            // Sub-net k has the value x_k times the others' sum, and the mean of its nets.
            let of_pairs = x.iter().map(|x| pairs * x * (sum - x) / ((r - 1) as f64).sqrt());
            let mut of_sub_nets: Vec<f64> = of_pairs
                .zip(of_nets.chunks(2))
                .map(|(pairs, nets)| pairs + 0.5 * (nets[0] + nets[1]))
                .collect();
            let n = r as f64;
            squares += (of_sub_nets.iter().sum::<f64>() / n).powi(2);
            plain += scatter(&of_sub_nets, 1, 0) / (n * (n - 1.0));
            count_pairs_twice(&mut of_sub_nets, &of_nets, 1);
            counted += scatter(&of_sub_nets, 1, 0) / (n * (n - 1.0));
        }
        [plain / squares, counted / squares]
    }

    #[test]
    fn shares_are_those_that_a_sum_was_made_with_from_none_to_all() {
        let controls = [vec![1.0, 2.0, -1.0, 0.5], vec![0.0, 1.0, 3.0, 1.0]];
        let sum = |c: [f64; 2]| -> Vec<f64> {
            (0..4).map(|i| c[0] * controls[0][i] + c[1] * controls[1][i]).collect()
        };
        let weights = [1.0, 0.2, 3.0, 0.7];
        let found = least_squares_shares(&controls, &sum([0.3, 0.6]), &weights);
        assert!((found[0] - 0.3).abs() < 1e-7 && (found[1] - 0.6).abs() < 1e-7, "{found:?}");
        // Against -0.2 of the second nothing is better than none of it; the first alone has the regression of one variable.
        let target = sum([0.4, -0.2]);
        let found = least_squares_shares(&controls, &target, &weights);
        let of = |a: &[f64], b: &[f64]| -> f64 { (0..4).map(|i| weights[i] * a[i] * b[i]).sum() };
        let alone = of(&controls[0], &target) / of(&controls[0], &controls[0]);
        assert!((found[0] - alone).abs() < 1e-12 && found[1] == 0.0, "{found:?} {alone}");
        // Of one that is too small no more than all is taken.
        let found = least_squares_shares(&[sum([1e-9, 0.0])], &sum([0.5, 0.0]), &weights);
        assert_eq!(found, [1.0]);
        // What is zero wherever it counts has no share.
        let found = least_squares_shares(&[vec![0.0; 4]], &target, &weights);
        assert_eq!(found, [0.0]);
    }

    /// The mean of all has the variance 2 / R, and the spread says (R - 2) / (2 (R - 1)) of that.
    #[test]
    fn terms_of_pairs_have_twice_the_variance_that_their_spread_shows() {
        for r in [3, 4, 7, 12, 16] {
            let [plain, counted] = stated(r, 1.0, 0.0);
            let exact = (r - 2) as f64 / (2 * (r - 1)) as f64;
            assert!((plain / exact - 1.0).abs() < 0.1, "{r}: {plain} {exact}");
            assert!((counted - 1.0).abs() < 0.1, "{r}: {counted}");
        }
    }

    /// Where the nets have all of the error, their estimated share has an error of relative variance 4 / R, and can be no more
    /// than one: the variance is too large by the mean of the positive part of a normal number.
    #[test]
    fn errors_of_nets_are_counted_once() {
        for r in [7, 12, 16] {
            let [plain, counted] = stated(r, 0.0, 1.0);
            assert!((plain - 1.0).abs() < 0.05, "{r}: {plain}");
            let positive = (4.0 / r as f64 / std::f64::consts::TAU).sqrt();
            let exact = 1.0 + positive * r as f64 / (r - 2) as f64;
            assert!((counted - exact).abs() < 0.05, "{r}: {counted} {exact}");
        }
    }

    #[test]
    fn pairs_beside_nets_are_counted_by_their_share() {
        for (r, pairs, nets) in [(7, 1.0, 1.0), (12, 1.0, 1.0), (16, 1.0, 0.5), (16, 0.5, 1.0)] {
            let [_, counted] = stated(r, pairs, nets);
            assert!((counted - 1.0).abs() < 0.2, "{r} {pairs} {nets}: {counted}");
        }
    }
}
