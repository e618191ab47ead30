//! What a process does not know of the integrals.

use super::variate::{capped, mean};
use crate::cholesky::add_multiple;
use crate::mixture::Proposal;
use crate::normal::ln_prior;
use crate::pool::Pool;
use crate::small_budget::{Edge, StandIn};
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};
use rand::RngExt as _;
use rayon::prelude::*;

/// Points of the proposal, those of g that are drawn from them, and draws of g there: the spread of so many is known to a tenth.
const POINTS: usize = 4096;
const DRAWN: usize = 384;
const DRAWS: usize = 96;
/// Share of the draws within the largest error that counts: those beyond it count as that, so that one draw in fifty that is far off does
/// not make what the others agree on unknown.
const COUNTED: f64 = 0.95;
/// Largest ratio of a draw to g, e^20: beyond it nothing is known, and errors stay numbers.
const LARGEST: f64 = 485_165_195.0;

/// A proposal q, and the scale and the largest value of g/q.
#[derive(Clone, Copy)]
pub(super) struct Over<'a> {
    pub proposal: &'a Proposal,
    pub ln_scale: f64,
    pub cap: f64,
}

/// The points of a net, taken to the proposal, row by row, and g/q there with a wide edge of failures.
pub(super) fn weighed(
    process: &StandIn<'_>,
    Over { proposal, ln_scale, cap }: Over<'_>,
    net: &[f64],
) -> (Vec<f64>, Vec<f64>) {
    let (width, d) = (proposal.uniforms(), proposal.dimension);
    let mut z = vec![0.0; net.len() / width * d];
    net.chunks_exact(width).zip(z.chunks_exact_mut(d)).for_each(|(u, z)| proposal.draw(u, z));
    let ratio = |z: &[f64]| {
        let ln_ratio =
            process.ln_likelihood_at(z, Edge::WIDE) - proposal.ln_over_prior(z, ln_prior(z));
        capped(ln_ratio - ln_scale, cap)
    };
    let weights = z.par_chunks(d).with_min_len(64).map(ratio).collect();
    (z, weights)
}

/// Points that are drawn from the root of g/q with a wide edge of failures, row by row, and the part of g's integral that each stands
/// for: as many from g itself would leave the ends of intervals without any. `random` gives numbers in 0 to 1.
fn drawn_from(
    process: &StandIn<'_>,
    over: Over<'_>,
    net: &[f64],
    mut random: impl FnMut() -> f64,
) -> (Vec<f64>, Vec<f64>) {
    let (z, weights) = weighed(process, over, net);
    let (d, points) = (over.proposal.dimension, weights.len());
    let roots: Vec<f64> = weights.iter().map(|w| w.sqrt()).collect();
    let total: f64 = roots.iter().sum();
    let (mut drawn, mut parts) = (Vec::with_capacity(DRAWN * d), Vec::with_capacity(DRAWN));
    // One of every so much weight, at random: one in so many points of a net would be a corner of it.
    let (mut sum, mut count, mut next) = (0.0, 0.0, random());
    for (root, z) in roots.iter().zip(z.chunks_exact(d)) {
        sum += root / total * DRAWN as f64;
        while next < sum {
            drawn.extend_from_slice(z);
            parts.push(root * total / (DRAWN * points) as f64);
            count += 1.0;
            next = count + random();
        }
    }
    (drawn, parts)
}

/// The integrals of g phi by draws of the likelihood from the process that made g, p numbers for every draw: at points
/// that are drawn for g each draw has a weight, its likelihood over the predicted one. Where g is lowered because the process knows
/// too little, draws are lowered as much. `features` writes the p phi of a point z.
pub(super) fn integrals(
    process: &StandIn<'_>,
    pool: &Pool,
    over: Over<'_>,
    p: usize,
    features: &dyn Fn(&[f64], &mut [f64]),
    seed: u64,
) -> Vec<f64> {
    let mut rng = stream(seed, Purpose::Errors, 1, 0);
    let net = scrambled_net(over.proposal.uniforms(), POINTS, &mut rng);
    let (drawn, parts) = drawn_from(process, over, &net, || rng.random());
    if drawn.is_empty() {
        return Vec::new();
    }
    let mut rows = vec![0.0; parts.len() * p];
    let points = drawn.chunks_exact(pool.d).zip(rows.chunks_exact_mut(p));
    points.for_each(|(z, row)| features(z, row));
    let mut integrals = vec![0.0; DRAWS * p];
    let draws = process.ln_ratios(pool, &drawn, DRAWS, seed);
    for (ratios, own) in draws.iter().zip(integrals.chunks_exact_mut(p)) {
        for ((ratio, part), row) in ratios.iter().zip(&parts).zip(rows.chunks_exact(p)) {
            let weight = part * capped(*ratio, LARGEST);
            add_multiple(own, weight, row);
        }
    }
    integrals
}

/// What draws of integrals say of the logarithm of the first and of the ratios of the others to it, row by row, less their mean; none where
/// there is no likelihood. Any draw may be the likelihood, and if it is, the posterior has its ratios: one that is a hundred times the others
/// somewhere has the moments of that place, not a hundred times their errors. Errors count from the median to that of [`COUNTED`] of the draws.
pub(super) fn off_by_draws(draws: &[f64], means: &[f64]) -> Vec<f64> {
    let p = means.len();
    if means[0].is_nan() || means[0] <= 0.0 {
        return Vec::new();
    }
    let of = |row: &[f64]| -> Vec<f64> {
        let ln = row[0].max(means[0] / LARGEST).ln();
        let ratio = |(value, mean): (&f64, &f64)| {
            if row[0] > 0.0 { value / row[0] } else { mean / means[0] }
        };
        std::iter::once(ln).chain(row.iter().zip(means).skip(1).map(ratio)).collect()
    };
    let mut all: Vec<f64> = draws.chunks_exact(p).flat_map(of).collect();
    for a in 0..p {
        let column: Vec<f64> = all.iter().skip(a).step_by(p).copied().collect();
        let middle = at(&column, 0.5);
        let off: Vec<f64> = column.iter().map(|value| (value - middle).abs()).collect();
        let most = at(&off, COUNTED);
        let counted: Vec<f64> =
            column.iter().map(|value| (value - middle).max(-most).min(most)).collect();
        let mean = mean(&counted, 1, 0);
        all.iter_mut().skip(a).step_by(p).zip(&counted).for_each(|(e, value)| *e = value - mean);
    }
    all
}

/// The value that a share of some are below; zero of none.
fn at(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get((share * sorted.len() as f64) as usize).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::super::variate::scatter;
    use super::*;
    use crate::SimError;
    use crate::small_budget::{sampled, through_all};
    use crate::target::Target;

    /// A bumpy log likelihood of one parameter, which ten samples do not tell.
    struct Bumpy;

    impl Target for Bumpy {
        fn dimension(&self) -> usize {
            1
        }

        fn ln_likelihood(&self, z: &[f64], _: &mut [f64]) -> Result<f64, SimError> {
            Ok(1.5 * (2.5 * z[0]).sin() + (4.0 * z[0]).cos() - 5.0 * z[0] * z[0])
        }
    }

    #[test]
    fn a_log_likelihood_is_lowered_by_what_half_of_five_times_its_variance_exceeds_two_by() {
        // Of forty the first 32 are enough for most places.
        for (n, least) in [(10, 10), (40, 1)] {
            let pool = sampled(&Bumpy, n);
            let stand_in = StandIn::of_all(&Bumpy, &pool, &vec![1.0; n]).expect("has spread");
            let mut lowered = 0;
            for k in -60..=60 {
                let (z, mut predicted) = ([0.1 * f64::from(k)], [0.0]);
                stand_in.process.predict(&z, &mut predicted);
                let by = (2.5 * stand_in.process.variance(&z) - 2.0).max(0.0);
                let found = stand_in.ln_likelihood_at(&z, Edge::KNOWN);
                assert!(
                    (found - (predicted[0] - by)).abs() < 1e-9,
                    "{z:?}: {found} {predicted:?} {by}"
                );
                lowered += usize::from(by > 0.0);
            }
            assert!((least..110).contains(&lowered), "{n}: {lowered}");
        }
    }

    #[test]
    fn draws_of_integrals_have_the_variance_of_the_integral_of_a_log_normal_process() {
        let pool = &sampled(&Bumpy, 10);
        let process = through_all(&Bumpy, pool);
        assert!(process.runs_through_all(pool));
        let prior = Proposal::prior(1);
        let over = Over { proposal: &prior, ln_scale: 0.7, cap: 1e9 };
        let features = |z: &[f64], row: &mut [f64]| row.copy_from_slice(&[1.0, z[0]]);
        let seeds: Vec<Vec<f64>> =
            (1..=8).map(|seed| integrals(&process, pool, over, 2, &features, seed)).collect();

        // integral integral g g' (e^C - 1) phi phi', with g the mean of the log-normal process.
        let n = 31;
        let z: Vec<f64> = (0..n).map(|i| 0.1 * (f64::from(i) - 15.0)).collect();
        let l = process.process.factor_of_errors(&z);
        let n = n as usize;
        let covariance = |a: usize, b: usize| -> f64 {
            l[a * n..(a + 1) * n].iter().zip(&l[b * n..(b + 1) * n]).map(|(a, b)| a * b).sum()
        };
        let g: Vec<f64> = (0..n)
            .map(|i| {
                let ln_g =
                    process.ln_likelihood_at(&z[i..=i], Edge::KNOWN) + 0.5 * covariance(i, i);
                0.1 * (ln_g + ln_prior(&z[i..=i]) - 0.7).exp()
            })
            .collect();
        for power in 0..2 {
            let g: Vec<f64> = g.iter().zip(&z).map(|(g, z)| g * z.powi(power)).collect();
            let pairs = (0..n).flat_map(|a| (0..n).map(move |b| (a, b)));
            let exact: f64 = pairs.map(|(a, b)| g[a] * g[b] * covariance(a, b).exp_m1()).sum();
            let variance =
                |found: &Vec<f64>| scatter(found, 2, power as usize) / (DRAWS - 1) as f64;
            let ratios: Vec<f64> = seeds.iter().map(|found| variance(found) / exact).collect();
            let mean = ratios.iter().sum::<f64>() / 8.0;
            assert!((0.7..1.4).contains(&mean), "{power}: {ratios:?}");
        }
    }

    #[test]
    fn errors_are_those_of_ratios_and_draws_that_are_far_larger_have_the_moments_of_their_place() {
        let means = [2.0, 0.6, -0.2];
        let off = |k: usize, a: usize| 1e-4 * (1.7 * (3 * k + a) as f64).sin();
        // So many of a hundred draws are a thousand times as large, where the second is 5.
        let draws = |far: usize| -> Vec<f64> {
            let draw = |k: usize| -> [f64; 3] {
                let place = if k < far { [2000.0, 10_000.0, -200.0] } else { means };
                std::array::from_fn(|a| place[a] + off(k, a))
            };
            (0..100).flat_map(draw).collect()
        };
        let rms = |all: &[f64], a: usize| {
            (all.iter().skip(a).step_by(3).map(|e| e * e).sum::<f64>() / 99.0).sqrt()
        };
        // To first order, where they are small; those beyond the 95th count as that.
        let small = off_by_draws(&draws(0), &means);
        let first = |k: usize, a: usize| match a {
            0 => off(k, 0) / 2.0,
            _ => (off(k, a) - means[a] / 2.0 * off(k, 0)) / 2.0,
        };
        for a in 0..3 {
            let linear: Vec<f64> = (0..100).map(|k| first(k, a)).collect();
            let largest = at(&linear.iter().map(|e| e.abs()).collect::<Vec<_>>(), 0.9);
            let met = (0..100).filter(|k| linear[*k].abs() < largest);
            let gaps: Vec<f64> = met.map(|k| small[3 * k + a] - linear[k]).collect();
            assert!(
                gaps.len() >= 90 && gaps.iter().all(|g| (g - gaps[0]).abs() < 1e-8),
                "{gaps:?}"
            );
        }
        // Four that are far off count as the next ones, a fifth of all as what it is: 5 and 0.3 with probabilities of .2 and .8.
        let few = off_by_draws(&draws(4), &means);
        for a in 0..3 {
            let ratio = rms(&few, a) / rms(&small, a);
            assert!((0.9..1.2).contains(&ratio), "{a}: {ratio}");
        }
        let many = off_by_draws(&draws(20), &means);
        let exact = 4.7 * (0.16f64 * 100.0 / 99.0).sqrt();
        assert!((rms(&many, 1) / exact - 1.0).abs() < 0.01, "{}", rms(&many, 1));
        // Draws without a likelihood, and a process without one.
        assert!(off_by_draws(&[0.0; 6], &means).iter().all(|e| *e == 0.0));
        for none in [0.0, f64::NAN] {
            assert!(off_by_draws(&draws(0), &[none, 0.1, 0.1]).is_empty());
        }
    }
}
