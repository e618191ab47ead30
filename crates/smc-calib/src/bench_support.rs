//! Inner loops of the sampler, opened for the benchmarks only; no part of the interface.

use crate::em::{Cloud, Mixture};
use crate::mixture::{Component, Proposal};
use crate::sobol::scrambled_net;
use crate::stream::{Purpose, stream};
use crate::surrogate::Surrogate;

/// Samples that the surrogate is fitted to.
pub const FITTED: usize = 4096;
/// Points of the cloud that a mixture is fitted to.
pub const CLOUD: usize = 512;

/// Points in three dimensions, drawn from a mixture of five components, and what is done with them.
pub struct Bench {
    proposal: Proposal,
    points: Vec<f64>,
    cloud: Option<Cloud>,
    mixture: (Mixture, Vec<f64>),
    factor: Vec<f64>,
    ln_density: Vec<f64>,
    surrogate: Option<Surrogate>,
}

impl Bench {
    /// Draws `n` points from the mixture, at least [`FITTED`].
    pub fn new(n: usize) -> Self {
        let n = n.max(FITTED);
        let factor = vec![0.5, 0.0, 0.0, 0.2, 0.4, 0.0, -0.1, 0.2, 0.3];
        let components = (0..5)
            .map(|k| {
                let k = f64::from(k);
                Component::new(0.196, vec![0.5 * k, -0.3 * k, 0.2 * k * k], factor.clone(), 10.0)
            })
            .collect();
        let proposal =
            Proposal { dimension: 3, prior_share: 0.02, degrees_of_freedom: 10.0, components };
        let points = drawn(&proposal, n);
        let cloud = Cloud::new(3, &points[..3 * CLOUD], &[1.0; CLOUD], 1, 0);
        let mixture = cloud.as_ref().map_or_else(Default::default, |cloud| cloud.started(5));
        let ln_density = points.chunks_exact(3).map(|z| proposal.student_density(z).ln()).collect();
        let mut bench =
            Self { proposal, points, cloud, mixture, factor, ln_density, surrogate: None };
        bench.surrogate = bench.fitted();
        bench
    }

    /// Draws all points again, nets and quantiles; the sum of their coordinates.
    pub fn draw(&self) -> f64 {
        drawn(&self.proposal, self.points.len() / 3).iter().sum()
    }

    /// Sum of the mixture's density over all points.
    pub fn density(&self) -> f64 {
        self.points.chunks_exact(3).map(|z| self.proposal.student_density(z)).sum()
    }

    /// One EM step of five components on the first [`CLOUD`] points; the mean log density before it.
    pub fn em_step(&mut self) -> f64 {
        self.cloud.as_ref().map_or(f64::NAN, |cloud| cloud.one_step(&mut self.mixture))
    }

    /// Fits the surrogate to the log density of the first [`FITTED`] points; whether it could.
    pub fn fit_surrogate(&self) -> bool {
        self.fitted().is_some()
    }

    /// Sum of the surrogate over all points.
    pub fn surrogate(&self) -> f64 {
        let Some(surrogate) = &self.surrogate else { return f64::NAN };
        let mut found = Vec::new();
        let value = |z| surrogate.ln_ratio(z, 0.0, &mut found).unwrap_or(0.0);
        self.points.chunks_exact(3).map(value).sum()
    }

    fn fitted(&self) -> Option<Surrogate> {
        let (z, ln_l) = (&self.points[..3 * FITTED], &self.ln_density[..FITTED]);
        Surrogate::new(z, ln_l, &[0.0; FITTED], &[true; FITTED], &self.factor)
    }
}

/// Points of a scrambled net, taken to the proposal.
fn drawn(proposal: &Proposal, n: usize) -> Vec<f64> {
    let width = proposal.uniforms();
    let net = scrambled_net(width, n, &mut stream(1, Purpose::Scramble, 0, 0));
    let mut points = vec![0.0; 3 * n];
    for (u, z) in net.chunks_exact(width).zip(points.chunks_exact_mut(3)) {
        proposal.draw(u, z);
    }
    points
}
