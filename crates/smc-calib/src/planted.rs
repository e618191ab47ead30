//! Mistakes that can be planted, to see whether validation finds them.
//!
//! Compiled with the feature `planted-bugs` only. Each mistake sits at a seam between two formulas: it spoils what one
//! hands to the next, so that the formulas themselves are those that are shipped.

use crate::mixture::{Component, Proposal};
use crate::pool::Pool;
use std::sync::atomic::{AtomicU8, Ordering};

/// A mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Bug {
    /// None: what is shipped.
    None,
    /// Every sample is weighted by the proposal of its own stage only.
    FrozenWeights,
    /// The determinant of the scale matrix is left out of the components' density.
    MissingJacobian,
    /// Off-diagonal elements of the inverse factor change sign in the density.
    FlippedSign,
    /// Noise standard deviations are drawn ten per cent too large.
    SigmaTenPercent,
    /// The prior's share of the proposals is left out of their density.
    DefensiveShareLeftOut,
    /// Densities use the covariance before widening, draws the one after.
    StaleCovariance,
    /// Draws are normal, their density Student t.
    NormalDraws,
    /// The likelihood forgets the last observation.
    LastObservationForgotten,
    /// The final weights are those of a tempered likelihood, at power 0.9.
    Tempered,
    /// Proposals are mixed in equal parts, whatever the sizes of their stages.
    EqualStages,
    /// Standard errors divide by the number of sub-nets once too often.
    ErrorsTooSmall,
    /// All sub-nets of a stage are scrambled alike.
    SameScrambling,
}

impl Bug {
    /// All of them, without [`Bug::None`].
    pub const ALL: [Self; 12] = [
        Self::FrozenWeights,
        Self::MissingJacobian,
        Self::FlippedSign,
        Self::SigmaTenPercent,
        Self::DefensiveShareLeftOut,
        Self::StaleCovariance,
        Self::NormalDraws,
        Self::LastObservationForgotten,
        Self::Tempered,
        Self::EqualStages,
        Self::ErrorsTooSmall,
        Self::SameScrambling,
    ];

    /// What was done wrong.
    pub fn description(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::FrozenWeights => "weights frozen at their stage",
            Self::MissingJacobian => "determinant of the scale matrix missing from the density",
            Self::FlippedSign => "sign of the off-diagonal inverse factor flipped in the density",
            Self::SigmaTenPercent => "sigma drawn 10 % too large",
            Self::DefensiveShareLeftOut => "defensive share left out of the density",
            Self::StaleCovariance => "covariance before widening in the density only",
            Self::NormalDraws => "normal draws for Student-t components",
            Self::LastObservationForgotten => "last observation left out of the likelihood",
            Self::Tempered => "final weights at likelihood^0.9",
            Self::EqualStages => "stages mixed in equal parts, whatever their sizes",
            Self::ErrorsTooSmall => "standard errors divided by sqrt(replicates) twice",
            Self::SameScrambling => "all sub-nets scrambled alike",
        }
    }
}

static PLANTED: AtomicU8 = AtomicU8::new(0);

/// Plants a mistake in the whole program, or with [`Bug::None`] takes it out again.
pub fn plant(bug: Bug) {
    PLANTED.store(bug as u8, Ordering::SeqCst);
}

/// Whether this mistake is planted.
fn is(bug: Bug) -> bool {
    PLANTED.load(Ordering::Relaxed) == bug as u8
}

/// A component whose density is not that of its draws.
pub(crate) fn component(mut c: Component) -> Component {
    let d = c.mean.len();
    let ln_det: f64 = (0..d).map(|i| c.factor[i * d + i].ln()).sum();
    if is(Bug::MissingJacobian) {
        c.peak *= ln_det.exp();
    }
    if is(Bug::FlippedSign) {
        let mut at = 0;
        for i in 0..d {
            for j in 0..=i {
                c.inverse[at] *= if i == j { 1.0 } else { -1.0 };
                at += 1;
            }
        }
    }
    if is(Bug::StaleCovariance) {
        let widen = 1.6f64.sqrt();
        c.inverse.iter_mut().for_each(|f| *f *= widen);
        c.peak *= widen.powi(d as i32);
    }
    c
}

/// The sub-net whose scrambling sub-net `k` gets.
pub(crate) fn scrambling(k: usize) -> usize {
    if is(Bug::SameScrambling) { 0 } else { k }
}

/// A net whose last coordinate, the one of the t scale, stretches nothing.
pub(crate) fn net(mut net: Vec<f64>, width: usize, nu: f64) -> Vec<f64> {
    if is(Bug::NormalDraws) {
        let unstretched = statrs::function::gamma::gamma_lr(0.5 * nu, 0.5 * nu);
        net.chunks_exact_mut(width).for_each(|u| u[width - 1] = unstretched);
    }
    net
}

/// A proposal as weights know it, after its draws were made.
pub(crate) fn remembered(mut proposal: Proposal, stage: usize) -> Proposal {
    if is(Bug::DefensiveShareLeftOut) && stage > 0 {
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
        if is(Bug::FrozenWeights) {
            over_prior(&proposals[pool.stage[i] as usize].1).ln()
        } else {
            let sum: f64 = proposals.iter().map(|(_, q)| over_prior(q)).sum();
            (sum / proposals.len() as f64).ln()
        }
    };
    if is(Bug::FrozenWeights) || is(Bug::EqualStages) {
        pool.ln_mixture_over_prior = (0..pool.len()).map(wrong).collect();
    }
}

/// Log likelihoods of the final weights.
pub(crate) fn likelihoods(ln_l: &[f64]) -> Vec<f64> {
    let power = if is(Bug::Tempered) { 0.9 } else { 1.0 };
    ln_l.iter().map(|l| power * l).collect()
}

/// A noise standard deviation that was drawn.
pub(crate) fn sigma(sigma: f64) -> f64 {
    if is(Bug::SigmaTenPercent) { 1.1 * sigma } else { sigma }
}

/// The outputs that residuals are taken of.
pub(crate) fn outputs(outputs: &[f64]) -> &[f64] {
    let seen = outputs.len() - usize::from(is(Bug::LastObservationForgotten));
    &outputs[..seen]
}

/// A standard error from `r` sub-nets.
pub(crate) fn standard_error(se: f64, r: usize) -> f64 {
    if is(Bug::ErrorsTooSmall) { se / (r as f64).sqrt() } else { se }
}
