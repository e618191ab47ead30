//! Mistakes that can be planted, to see whether validation finds them.
//!
//! Without the feature `planted-bugs` `is` is the constant `false` and nothing of this is compiled in.

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

#[cfg(feature = "planted-bugs")]
mod switch {
    use super::Bug;
    use std::sync::atomic::{AtomicU8, Ordering};

    static PLANTED: AtomicU8 = AtomicU8::new(0);

    /// Plants a mistake in the whole program, or with [`Bug::None`] takes it out again.
    pub fn plant(bug: Bug) {
        PLANTED.store(bug as u8, Ordering::SeqCst);
    }

    /// Whether this mistake is planted.
    #[inline]
    pub(crate) fn is(bug: Bug) -> bool {
        PLANTED.load(Ordering::Relaxed) == bug as u8
    }
}

#[cfg(not(feature = "planted-bugs"))]
mod switch {
    /// No mistake is planted.
    #[inline(always)]
    pub(crate) const fn is(_: super::Bug) -> bool {
        false
    }
}

pub(crate) use switch::is;
#[cfg(feature = "planted-bugs")]
pub use switch::plant;
