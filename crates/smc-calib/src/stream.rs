//! Keyed random streams: the same key gives the same numbers, whatever thread asks.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution as _, StandardNormal};

/// Purpose of a stream; streams of different purposes are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u8)]
pub(crate) enum Purpose {
    /// Scrambling of the nets.
    Scramble = 1,
    /// Starts of the mixture fits.
    MixtureStart = 2,
    /// Resampling for the mixture fits.
    MixtureResample = 3,
    /// Equally weighted draws.
    Draws = 4,
    /// Noise of predictive bands.
    Predictive = 6,
    /// True parameters and noise of made data.
    Truth = 17,
    /// Places within ties of ranks.
    Ties = 18,
    /// Noise standard deviation of each draw.
    Sigma = 5,
    /// Noise standard deviation of each sample, for leaving observations out.
    LeaveOneOut = 7,
    /// Random orders of failures.
    Failures = 19,
    /// Scrambling of the nets that a surrogate is integrated with.
    Surrogate = 8,
    /// The next member of a population.
    NextMember = 20,
    /// Errors of a Gaussian process.
    Errors = 22,
    /// Data that are made by draws of the posterior.
    Replicated = 21,
}

/// The stream of `seed` for one purpose, stage and index (sample or sub-net, below 2^40).
pub(crate) fn stream(seed: u64, purpose: Purpose, stage: usize, index: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(
        (purpose as u64) << 56
            | ((stage as u64) & 0xffff) << 40
            | ((index as u64) & 0xff_ffff_ffff),
    );
    rng
}

/// Independent standard normal numbers.
pub(crate) fn normals(count: usize, rng: &mut impl Rng) -> Vec<f64> {
    (0..count).map(|_| StandardNormal.sample(rng)).collect()
}
