//! Where simulations fail, by a process.

use super::points::in_turn;
use crate::cholesky::{whiten, whitening};
use crate::gaussian_process::{Covariance, Data, Found, GaussianProcess};
use crate::normal;
use crate::pool::Pool;
use rand::Rng;

/// Nugget of what tells finished samples, 1, from failed ones, -1.
const NUGGET_OF_FAILING: f64 = 0.1;
/// Width of the edge between them: where it is known, and per standard deviation of the process. From errors and error bars on
/// a ridge that a bound cuts.
#[derive(Clone, Copy)]
pub(crate) struct Edge([f64; 2]);

impl Edge {
    /// Of estimates: not sharper than it is known.
    pub(crate) const KNOWN: Self = Self([0.2, 0.6]);
    /// Of points at which draws of the edge can differ.
    pub(crate) const WIDE: Self = Self([0.7, 0.7]);
}

/// Squared distance from the middle of the posterior, in its own covariance and beyond the number of parameters, within which samples
/// tell where simulations fail. By the nearest alone, which lie at its middle, the ridge (two parameters) is .036 off at 512 simulations
/// and .028 at 1024, not .011 and .014.
const NEAR: f64 = 10.0;

/// Lengths of a process whose signs tell finished from failed, over those of one that jumps from -1 to 1. From error bars on the ridge.
const LONGER: f64 = 4.0;

/// A process through 1 at samples that finished and -1 at those that failed or have no likelihood: it knows edges that run
/// straight through the prior far better than neighbours do.
pub(super) struct Failing {
    process: GaussianProcess,
}

impl Failing {
    /// Of the known samples and whether each finished, through so many at most.
    pub(super) fn new(
        (pool, weights): (&Pool, &[f64]),
        (known, alive): (&[usize], &[bool]),
        points: usize,
        covariance: Covariance<'_>,
    ) -> Option<Self> {
        let (centre, inverse) = whitening(pool.d, &pool.z, weights)?;
        let mut x = vec![0.0; pool.d];
        let mut ranked = [Vec::new(), Vec::new()];
        for (i, alive) in known.iter().zip(alive) {
            whiten(pool.point(*i), &centre, &inverse, &mut x);
            ranked[usize::from(!alive)].push((x.iter().map(|x| x * x).sum::<f64>(), *i));
        }
        for kind in &mut ranked {
            kind.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        let near = pool.d as f64 + NEAR;
        let both = in_turn([&ranked[0], &ranked[1]], points, near).into_iter();
        let (chosen, values): (Vec<usize>, Vec<f64>) =
            both.map(|(i, kind)| (i, [1.0, -1.0][kind])).unzip();
        let process = GaussianProcess::new(Data {
            d: pool.d,
            z: &pool.z,
            weights,
            chosen: &chosen,
            values: &values,
            nuggets: &vec![NUGGET_OF_FAILING; values.len()],
            offsets: vec![0.0],
            units: vec![1.0],
            covariance,
        })?;
        Some(Self { process })
    }

    /// Its covariance.
    pub(super) fn covariance(&self) -> &Found {
        &self.process.covariance
    }

    /// Probability that a simulation finishes: that the process is above zero.
    pub(super) fn finished(&self, z: &[f64], Edge(edge): Edge) -> f64 {
        let mut mean = [0.0];
        self.process.predict(z, &mut mean);
        normal::cdf(mean[0] / (edge[0] + edge[1] * self.process.variance(z).sqrt()))
    }

    /// Draws of whether simulations finish at points z: the edge is anywhere between finished and failed samples.
    pub(super) fn draws(&self, z: &[f64], draws: usize, rng: &mut impl Rng) -> Vec<Vec<bool>> {
        let longer = self.process.longer(LONGER, NUGGET_OF_FAILING);
        let process = longer.as_ref().unwrap_or(&self.process);
        let drawn = process.draws_of_signs(z, draws, rng).into_iter();
        drawn.map(|draw| draw.into_iter().map(|value| value > 0.0).collect()).collect()
    }
}
