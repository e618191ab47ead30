//! Inner loops of the sampler, opened for the benchmarks only; no part of the interface.

use crate::em::Cloud;
use crate::mixture::{Component, Proposal};
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};

/// Points and a mixture of five components in three dimensions.
pub struct Bench {
    proposal: Proposal,
    points: Vec<f64>,
    cloud: Option<Cloud>,
}

impl Bench {
    /// Draws `n` points from the mixture.
    pub fn new(n: usize) -> Self {
        let factor = vec![0.5, 0.0, 0.0, 0.2, 0.4, 0.0, -0.1, 0.2, 0.3];
        let components = (0..5)
            .map(|k| {
                let k = f64::from(k);
                Component::new(0.196, vec![0.5 * k, -0.3 * k, 0.2 * k * k], factor.clone(), 10.0)
            })
            .collect();
        let proposal =
            Proposal { dimension: 3, prior_share: 0.02, degrees_of_freedom: 10.0, components };
        let net = scrambled_net(proposal.uniforms(), n, &mut stream(1, Purpose::Scramble, 0, 0));
        let mut points = vec![0.0; 3 * n];
        for (u, z) in net.chunks_exact(5).zip(points.chunks_exact_mut(3)) {
            proposal.draw(u, z);
        }
        let few = n.min(512);
        let cloud = Cloud::new(3, &points[..3 * few], &vec![1.0; few], 1, 0);
        Self { proposal, points, cloud }
    }

    /// Sum of the mixture's density over all points.
    pub fn density(&self) -> f64 {
        self.points.chunks_exact(3).map(|z| self.proposal.student_density(z)).sum()
    }

    /// One EM step of five components; the mean log density before it.
    pub fn em_step(&self) -> f64 {
        self.cloud.as_ref().map_or(f64::NAN, |c| c.one_step(5))
    }
}
