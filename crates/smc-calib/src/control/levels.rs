//! Levels of each coordinate, below which shares of the posterior are integrated where few simulations do not tell its intervals.

use super::errors::{Over, weighed};
use crate::normal;
use crate::small_budget::StandIn;
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};
use crate::weighted::Weighted;

/// Levels for each coordinate, their distance in normal scores, and the points that they are found with.
const LEVELS: i32 = 25;
const APART: f64 = 0.25;
const POINTS: usize = 4096;

/// The quantiles of each coordinate by a process, at even normal scores from -3 to 3; none where it has no likelihood.
pub(super) fn levels(
    process: &StandIn<'_>,
    over: Over<'_>,
    coordinate: &dyn Fn(usize, f64) -> f64,
    seed: u64,
) -> Vec<Vec<f64>> {
    let mut rng = stream(seed, Purpose::Surrogate, 2, 0);
    let net = scrambled_net(over.proposal.uniforms(), POINTS, &mut rng);
    let (z, weights) = weighed(process, over, &net);
    let d = over.proposal.dimension;
    let of = |j: usize| {
        let x = z.iter().skip(j).step_by(d).map(|z| coordinate(j, *z));
        let marginal = Weighted::new(x.zip(weights.iter().copied()));
        let score = |k: i32| APART * f64::from(k - LEVELS / 2);
        (0..LEVELS).map(|k| marginal.quantile(normal::cdf(score(k)))).collect::<Vec<f64>>()
    };
    let levels: Vec<Vec<f64>> = (0..d).map(of).collect();
    if levels.iter().flatten().all(|level| level.is_finite()) { levels } else { Vec::new() }
}
