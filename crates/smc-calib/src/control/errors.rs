//! What a process does not know of the integrals.

use super::variate::{capped, mean};
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
const DRAWN: usize = 256;
const DRAWS: usize = 48;
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

/// Points that are drawn from g with a wide edge of failures, row by row, and its integral; none where it is zero. `random` gives
/// numbers in 0 to 1.
fn drawn_from(
    process: &StandIn<'_>,
    over: Over<'_>,
    net: &[f64],
    mut random: impl FnMut() -> f64,
) -> Option<(Vec<f64>, f64)> {
    let (z, weights) = weighed(process, over, net);
    let (d, points) = (over.proposal.dimension, weights.len());
    let total: f64 = weights.iter().sum();
    let mut drawn = Vec::with_capacity(DRAWN * d);
    // One of every so much weight, at random: one in so many points of a net would be a corner of it.
    let (mut sum, mut count, mut next) = (0.0, 0.0, random());
    for (weight, z) in weights.iter().zip(z.chunks_exact(d)) {
        sum += weight / total * DRAWN as f64;
        while next < sum {
            drawn.extend_from_slice(z);
            count += 1.0;
            next = count + random();
        }
    }
    (!drawn.is_empty()).then_some((drawn, total / points as f64))
}

/// Errors of the integrals of g phi by draws of the likelihood from the process that made g, p numbers for every draw: at points
/// that are drawn from g each draw has a weight, its likelihood over the predicted one. Where g is lowered because the process knows
/// too little, draws are lowered as much. `features` writes the p phi of a point z.
pub(super) fn errors(
    process: &StandIn<'_>,
    pool: &Pool,
    over: Over<'_>,
    p: usize,
    features: &dyn Fn(&[f64], &mut [f64]),
    seed: u64,
) -> Vec<f64> {
    let mut rng = stream(seed, Purpose::Errors, 1, 0);
    let net = scrambled_net(over.proposal.uniforms(), POINTS, &mut rng);
    let drawn = drawn_from(process, over, &net, || rng.random());
    let Some((drawn, integral)) = drawn else { return Vec::new() };
    let m = drawn.len() / pool.d;
    let mut rows = vec![0.0; m * p];
    let points = drawn.chunks_exact(pool.d).zip(rows.chunks_exact_mut(p));
    points.for_each(|(z, row)| features(z, row));
    let mut errors = vec![0.0; DRAWS * p];
    let draws = process.ln_ratios(pool, &drawn, DRAWS, seed);
    for (ratios, own) in draws.iter().zip(errors.chunks_exact_mut(p)) {
        for (ratio, row) in ratios.iter().zip(rows.chunks_exact(p)) {
            let weight = integral / m as f64 * capped(*ratio, LARGEST);
            own.iter_mut().zip(row).for_each(|(sum, phi)| *sum += weight * phi);
        }
    }
    for a in 0..p {
        let mean = mean(&errors, p, a);
        errors.iter_mut().skip(a).step_by(p).for_each(|e| *e -= mean);
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian_process::Covariance;
    use crate::sampler::Sampler;
    use crate::target::Target;
    use crate::{Settings, SimError};

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
            let settings = Settings { samples: n, replicates: 1, ..Settings::default() };
            let mut sampler = Sampler::new(&Bumpy, &settings);
            sampler.run().expect("never fails");
            let weights = vec![1.0; n];
            let stand_in = StandIn::of_all(&Bumpy, &sampler.pool, &weights).expect("has spread");
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
    fn errors_of_integrals_have_the_variance_of_the_integral_of_a_log_normal_process() {
        let settings = Settings { samples: 10, replicates: 1, ..Settings::default() };
        let mut sampler = Sampler::new(&Bumpy, &settings);
        sampler.run().expect("never fails");
        let pool = &sampler.pool;
        let process =
            StandIn::new(&Bumpy, pool, &[1.0; 10], 0..10, Covariance::Search).expect("has spread");
        assert!(process.runs_through_all(pool));
        let prior = Proposal::prior(1);
        let over = Over { proposal: &prior, ln_scale: 0.7, cap: 1e9 };
        let features = |z: &[f64], row: &mut [f64]| row.copy_from_slice(&[1.0, z[0]]);
        let found = errors(&process, pool, over, 2, &features, 1);

        // integral integral g g' (e^C - 1) phi phi', with g the mean of the log-normal process.
        let n = 61;
        let z: Vec<f64> = (0..n).map(|i| 0.05 * (f64::from(i) - 30.0)).collect();
        let l = process.process.factor_of_errors(&z);
        let n = n as usize;
        let covariance = |a: usize, b: usize| -> f64 {
            l[a * n..(a + 1) * n].iter().zip(&l[b * n..(b + 1) * n]).map(|(a, b)| a * b).sum()
        };
        let g: Vec<f64> = (0..n)
            .map(|i| {
                let ln_g =
                    process.ln_likelihood_at(&z[i..=i], Edge::KNOWN) + 0.5 * covariance(i, i);
                0.05 * (ln_g + ln_prior(&z[i..=i]) - 0.7).exp()
            })
            .collect();
        for power in 0..2 {
            let g: Vec<f64> = g.iter().zip(&z).map(|(g, z)| g * z.powi(power)).collect();
            let pairs = (0..n).flat_map(|a| (0..n).map(move |b| (a, b)));
            let exact: f64 = pairs.map(|(a, b)| g[a] * g[b] * covariance(a, b).exp_m1()).sum();
            let squares = found.iter().skip(power as usize).step_by(2).map(|e| e * e);
            let variance = squares.sum::<f64>() / (DRAWS - 1) as f64;
            // By so many draws a variance is known to a fifth.
            let ratio = variance / exact;
            assert!((0.6..1.6).contains(&ratio), "{power}: {variance} {exact}");
        }
    }
}
