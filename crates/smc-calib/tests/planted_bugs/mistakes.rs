//! Mistakes, one of which the environment variable `PLANTED` names. This file is no part of the library: it is put into
//! a copy of its sources.
//!
//! Each mistake sits at a seam between two formulas: it spoils what one hands to the next, so that the formulas
//! themselves are those that are shipped.

use crate::mixture::{Component, Proposal};
use crate::pool::Pool;
use std::sync::OnceLock;

/// Whether this mistake is planted.
fn is(name: &str) -> bool {
    static PLANTED: OnceLock<String> = OnceLock::new();
    PLANTED.get_or_init(|| std::env::var("PLANTED").unwrap_or_default()) == name
}

/// A component whose density is not that of its draws.
pub(crate) fn component(mut c: Component) -> Component {
    let d = c.mean.len();
    let ln_det: f64 = (0..d).map(|i| c.factor[i * d + i].ln()).sum();
    if is("missing-jacobian") {
        c.peak *= ln_det.exp();
    }
    if is("flipped-sign") {
        let mut at = 0;
        for i in 0..d {
            for j in 0..=i {
                c.inverse[at] *= if i == j { 1.0 } else { -1.0 };
                at += 1;
            }
        }
    }
    if is("stale-covariance") {
        let widen = 1.6f64.sqrt();
        c.inverse.iter_mut().for_each(|f| *f *= widen);
        c.peak *= widen.powi(d as i32);
    }
    c
}

/// The sub-net whose scrambling sub-net `k` gets.
pub(crate) fn scrambling(k: usize) -> usize {
    if is("same-scrambling") { 0 } else { k }
}

/// A net whose last coordinate, the one of the t scale, stretches nothing.
pub(crate) fn net(mut net: Vec<f64>, width: usize, nu: f64) -> Vec<f64> {
    if is("normal-draws") {
        let unstretched = statrs::function::gamma::gamma_lr(0.5 * nu, 0.5 * nu);
        net.chunks_exact_mut(width).for_each(|u| u[width - 1] = unstretched);
    }
    net
}

/// A proposal as weights know it, after its draws were made.
pub(crate) fn remembered(mut proposal: Proposal, stage: usize) -> Proposal {
    if is("defensive-share-left-out") && stage > 0 {
        proposal.prior_share = 0.0;
    }
    proposal
}

/// The mixture that samples are weighted by.
pub(crate) fn mixture(pool: &mut Pool, proposals: &[(usize, Proposal)]) {
    let wrong = |i: usize| -> f64 {
        let over_prior = |q: &Proposal| {
            q.prior_share + q.student_density(pool.point(i)) / pool.ln_prior(i).exp()
        };
        if is("frozen-weights") {
            over_prior(&proposals[pool.stage[i] as usize].1).ln()
        } else {
            let sum: f64 = proposals.iter().map(|(_, q)| over_prior(q)).sum();
            (sum / proposals.len() as f64).ln()
        }
    };
    if is("frozen-weights") || is("equal-stages") {
        pool.ln_mixture_over_prior = (0..pool.len()).map(wrong).collect();
    }
}

/// Log likelihoods of the final weights.
pub(crate) fn likelihoods(ln_l: &[f64]) -> Vec<f64> {
    let power = if is("tempered") { 0.9 } else { 1.0 };
    ln_l.iter().map(|l| power * l).collect()
}

/// A noise standard deviation that was drawn.
pub(crate) fn sigma(sigma: f64) -> f64 {
    if is("sigma-ten-percent") { 1.1 * sigma } else { sigma }
}

/// The outputs that residuals are taken of.
pub(crate) fn outputs(outputs: &[f64]) -> &[f64] {
    let seen = outputs.len() - usize::from(is("last-observation-forgotten"));
    &outputs[..seen]
}

/// A standard error from `r` sub-nets.
pub(crate) fn standard_error(se: f64, r: usize) -> f64 {
    if is("errors-too-small") { se / (r as f64).sqrt() } else { se }
}
